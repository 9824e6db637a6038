"""The table: rows that depend on the study alone."""

from __future__ import annotations

import io
import json
from collections.abc import Callable
from pathlib import Path

import pyarrow.parquet as pq

from ballsim.studies.design import load_plan
from ballsim.studies.single_run import FINISHED, Outcome
from ballsim.studies.table import make_rows, pack_parquet

WriteStudy = Callable[..., Path]


def _outcomes() -> list[Outcome]:
    up = {"survived": True, "fall_time": None, "n": 3, "x": 1, "rms": {"a_m": 0.5}}
    fell = {"survived": False, "fall_time": 2, "n": 4, "x": 1.5, "rms": {}}
    return [
        Outcome(0, 0, "crashed", {}, attempts=2, wall_time=9.0),
        Outcome(0, 1, FINISHED, up, wall_time=1.0),
        Outcome(1, 0, FINISHED, fell, wall_time=2.0),
    ]


def test_row_holds_factors_seed_and_every_scalar(write_study: WriteStudy) -> None:
    """Nothing of the clock; None where a run has nothing."""
    rows = make_rows(load_plan(write_study()), _outcomes())
    head = ["cell", "scene.sole_friction", "seed", "status"]
    assert list(rows[0]) == [*head, "survived", "fall_time", "n", "x", "rms.a_m"]
    assert rows[0] | {"status": ""} == dict.fromkeys(rows[0]) | {
        "cell": 0,
        "scene.sole_friction": 0.5,
        "seed": 0,
        "status": "",
    }
    assert rows[2]["scene.sole_friction"] == 1.0
    assert [row["rms.a_m"] for row in rows] == [None, 0.5, None]


def test_same_rows_give_the_same_bytes_and_come_back(write_study: WriteStudy) -> None:
    """The file holds the rows, numbers of one type, and the metadata."""
    rows = make_rows(load_plan(write_study()), _outcomes())
    content = pack_parquet(rows, {"b": "2", "a": "1"})
    assert content == pack_parquet([dict(row) for row in rows], {"a": "1", "b": "2"})
    table = pq.read_table(io.BytesIO(content))
    assert table.to_pylist() == rows
    assert str(table.schema.field("x").type) == "double"
    assert str(table.schema.field("n").type) == "int64"
    assert json.loads(table.schema.metadata[b"ballsim"]) == {"a": "1", "b": "2"}
