"""The ledger of a study: what is done, written as runs end.

SQLite, because a transaction is there as a whole or not at all after a kill, and
the primary key keeps a run from being entered twice. Write-ahead logging makes a
commit cheap (below a millisecond, once for each run). The lock is exclusive: two
studies cannot write into one folder, and no shared memory is needed, so that it
works on network file systems too. The lock ends with the process.
"""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from ballsim.errors import ConfigError
from ballsim.studies.single_run import Outcome

__all__ = ["LEDGER_FILE", "Ledger", "open_ledger"]

LEDGER_FILE = "ledger.sqlite"

_SCHEMA = """
CREATE TABLE IF NOT EXISTS study (digest TEXT NOT NULL, name TEXT NOT NULL);
CREATE TABLE IF NOT EXISTS code (id INTEGER PRIMARY KEY, versions TEXT UNIQUE);
CREATE TABLE IF NOT EXISTS runs (
    cell INTEGER, seed INTEGER, status TEXT NOT NULL, attempts INTEGER NOT NULL,
    message TEXT, wall_time REAL, realtime_factor REAL,
    code INTEGER REFERENCES code (id), summary TEXT NOT NULL,
    PRIMARY KEY (cell, seed)
) WITHOUT ROWID;
"""
_COLUMNS = "cell, seed, status, attempts, message, wall_time, realtime_factor, summary"


class Ledger:
    """An open ledger; see `open_ledger`.

    Args:
        connection: Its data base, locked.
    """

    def __init__(self, connection: sqlite3.Connection) -> None:
        self._connection = connection

    def write(self, outcome: Outcome) -> None:
        """Enter a run; it is there after a kill at any later moment."""
        o, code = outcome, None
        with self._connection as connection:
            if o.provenance is not None:
                text = (json.dumps(o.provenance, sort_keys=True),)
                connection.execute(
                    "INSERT OR IGNORE INTO code (versions) VALUES (?)", text
                )
                found = connection.execute(
                    "SELECT id FROM code WHERE versions = ?", text
                )
                code = found.fetchone()[0]
            connection.execute(
                f"INSERT INTO runs ({_COLUMNS}, code) VALUES (?,?,?,?,?,?,?,?,?)",
                (
                    o.cell,
                    o.seed,
                    o.status,
                    o.attempts,
                    o.message,
                    o.wall_time,
                    o.realtime_factor,
                    json.dumps(o.summary, allow_nan=False),
                    code,
                ),
            )

    def read(self) -> list[Outcome]:
        """Return all runs, sorted by cell and seed."""
        rows = self._connection.execute(
            f"SELECT {_COLUMNS} FROM runs ORDER BY cell, seed"
        )
        names = _COLUMNS.split(", ")
        tables = [dict(zip(names, row, strict=True)) for row in rows]
        return [
            Outcome(**{**table, "summary": json.loads(table["summary"])})
            for table in tables
        ]

    def read_versions(self) -> dict[str, str]:
        """Return versions and revision of the code, several joined by `` or ``."""
        rows = self._connection.execute("SELECT versions FROM code")
        return _merge(json.loads(versions) for (versions,) in rows)


@contextmanager
def open_ledger(folder: Path, digest: str, name: str) -> Iterator[Ledger]:
    """Open the ledger of a study, a new one if the folder has none.

    Args:
        folder: Folder of the study; it exists.
        digest: What tells the study from others, see `design.Plan`.
        name: Name of the study.

    Raises:
        ConfigError: The ledger is another study's, or in use, or no ledger.
    """
    file = folder / LEDGER_FILE

    def refuse(valid: str) -> ConfigError:
        return ConfigError("--out", str(folder), valid, "command line")

    connection = sqlite3.connect(file, timeout=0.5)
    try:
        try:
            connection.execute("PRAGMA locking_mode = EXCLUSIVE")
            connection.execute("PRAGMA journal_mode = WAL")
            connection.execute("PRAGMA synchronous = NORMAL")
            connection.executescript(_SCHEMA)
            found = connection.execute("SELECT digest, name FROM study").fetchone()
            if found is None:
                with connection:
                    entry = "INSERT INTO study VALUES (?, ?)"
                    connection.execute(entry, (digest, name))
        except sqlite3.OperationalError as error:
            if "locked" in str(error):
                valid = "a folder that no other study is writing to at this moment"
            else:
                valid = f"a folder whose {file.name} can be written ({error})"
            raise refuse(valid) from None
        except sqlite3.DatabaseError as error:
            raise refuse(f"a folder whose {file.name} is a ledger ({error})") from None
        if found is not None and found[0] != digest:
            valid = f"a new folder: this one holds another study, {found[1]!r}"
            if found[1] == name:
                valid = f"a new folder: {name} was another study when this one was made"
            raise refuse(valid)
        yield Ledger(connection)
    finally:
        connection.close()


def _merge(tables: Iterable[dict[str, str]]) -> dict[str, str]:
    merged: dict[str, set[str]] = {}
    for table in tables:
        for key, value in table.items():
            merged.setdefault(key, set()).add(value)
    return {key: " or ".join(sorted(values)) for key, values in merged.items()}
