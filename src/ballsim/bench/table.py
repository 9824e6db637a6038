"""A report as tables: in the terminal, or in a Markdown file.

``python -m ballsim.bench.table REPORT.json`` prints a report that ``ballsim bench
--json`` gave; with a Markdown file as second word it puts the tables there,
between two marks, in place of those of before.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from ballsim.bench.sections import Section, describe, make_sections
from ballsim.errors import ConfigError
from ballsim.module_parser import OneLineParser
from ballsim.run_files import write_file

__all__ = ["format_markdown", "main", "print_report", "replace_tables", "show_status"]

_BEGIN, _END = "<!-- bench: begin -->", "<!-- bench: end -->"


@contextmanager
def show_status() -> Iterator[Callable[[str], None]]:
    """Show on stderr what is being measured, if that is a terminal.

    Yields:
        What to call with a few words.
    """
    console = Console(stderr=True)
    if not console.is_terminal:
        yield lambda _: None
        return
    with console.status("") as status:
        yield status.update


def print_report(report: Mapping[str, Any]) -> None:
    """Print a report to the terminal.

    Args:
        report: As `ballsim.bench.command.run_bench` returns it.
    """
    console = Console(highlight=False)
    for line in describe(report):
        console.print(line, markup=False)
    for section in make_sections(report):
        console.print(f"\n[bold]{section.title}[/bold]")
        console.print(_make_table(section))
        if section.note:
            console.print(section.note, style="dim", markup=False)


def format_markdown(report: Mapping[str, Any]) -> str:
    """Return a report as Markdown.

    Args:
        report: As `ballsim.bench.command.run_bench` returns it.
    """
    blocks = ["\n\n".join(describe(report))]
    for section in make_sections(report):
        rule = ["---"] + ["---:"] * (len(section.head) - 1)
        lines = [section.head, rule, *section.rows]
        table = "\n".join(f"| {' | '.join(line)} |" for line in lines)
        blocks += [f"### {section.title}", table]
        if section.note:
            blocks.append(section.note)
    return "\n\n".join(blocks) + "\n"


def replace_tables(text: str, tables: str) -> str:
    """Return a document with other tables between its two marks.

    Args:
        text: The document.
        tables: Markdown.

    Raises:
        ValueError: The marks are not there.
    """
    pattern = re.compile(f"{re.escape(_BEGIN)}\n.*{re.escape(_END)}", re.DOTALL)
    if pattern.search(text) is None:
        raise ValueError(f"no lines {_BEGIN} and {_END}")
    return pattern.sub(lambda _: f"{_BEGIN}\n{tables}{_END}", text)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print a report or put it into a document; see the module.

    Args:
        arguments: Words of the command line, those of the process if None.

    Returns:
        Exit code: 0 done, 2 bad input.
    """
    parser = OneLineParser(prog="python -m ballsim.bench.table")
    parser.add_argument("report", metavar="REPORT.json", type=Path)
    parser.add_argument("document", metavar="DOCUMENT.md", type=Path, nargs="?")
    options = parser.parse_args(arguments)
    try:
        report = _read_report(options.report)
        if options.document is None:
            print_report(report)
        else:
            _update(options.document, format_markdown(report))
    except ConfigError as error:
        print(f"ballsim.bench.table: {error}", file=sys.stderr)
        return 2
    return 0


def _read_report(file: Path) -> dict[str, Any]:
    valid = "a file that `ballsim bench --json` wrote"
    try:
        report: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
        make_sections(report)
    except (OSError, ValueError, LookupError, TypeError):
        raise ConfigError("REPORT.json", str(file), valid, "command line") from None
    return report


def _update(document: Path, tables: str) -> None:
    valid = f"a document with the lines {_BEGIN} and {_END}"
    try:
        text = replace_tables(document.read_text(encoding="utf-8"), tables)
    except (OSError, ValueError):
        raise ConfigError("DOCUMENT.md", str(document), valid, "command line") from None
    write_file(document, text.encode())


def _make_table(section: Section) -> Table:
    table = Table(box=None, pad_edge=False)
    for number, name in enumerate(section.head):
        table.add_column(name, justify="right" if number else "left")
    for row in section.rows:
        table.add_row(*row)
    return table


if __name__ == "__main__":
    raise SystemExit(main())
