"""The table: rows, numbers, Markdown."""

from __future__ import annotations

import pytest

from ballsim.paper.comparison import Row, compare, format_number, format_table
from ballsim.paper.experiments import Laboratory
from ballsim.paper.parameter_sets import ParameterSet, open_points
from ballsim.paper.report import format_markdown


@pytest.fixture(scope="module")
def rows() -> list[Row]:
    """Return the table of a run that arrives and one that falls."""
    laboratory = Laboratory()
    return compare(
        [
            laboratory.roll_to("S2", 1.0, (0.0, 1.0), duration=4.0),
            laboratory.roll_to("S2", 0.5, (0.0, 0.5), duration=12.0),
        ]
    )


def test_a_fall_is_told(rows: list[Row]) -> None:
    """A run beyond the envelope has no number, but a time of its fall."""
    fallen, arrived = rows
    assert fallen.ours is fallen.difference is None
    assert fallen.note.startswith("falls at 1.5")
    assert arrived.difference == pytest.approx(0.0, abs=1e-3)
    cells = list(format_table(rows))
    assert cells[1][4:6] == ("-", "-")
    assert cells[0][3:6] == ("paper", "ours", "difference")


def test_words_have_no_difference() -> None:
    """Where the paper prints no number, there is nothing to subtract."""
    row = Row("13", "deviation", 1.0, "cyclic", 0.002, "KNV20")
    assert row.difference is None


@pytest.mark.parametrize(
    ("value", "is_difference", "text"),
    [
        (0.4, False, "0.4000"),
        (0.0123456, True, "+0.0123"),
        (-5.4e-4, True, "-5.4e-04"),
        (1e-12, True, "0"),
        ("stable", False, "stable"),
        (None, True, "-"),
    ],
)
def test_numbers(value: float | str | None, is_difference: bool, text: str) -> None:
    """Four decimals, small ones by their exponent, nothing as a dash."""
    assert format_number(value, is_difference) == text


def test_markdown_is_a_table(rows: list[Row]) -> None:
    """Every line of a table has as many cells as its head."""
    text = format_markdown(rows)
    for block in text.split("# ")[1:]:
        lines = [line for line in block.splitlines() if line.startswith("|")]
        counts = {line.replace(r"\|", "").count("|") for line in lines}
        assert len(counts) == 1
        assert len(lines) > 2


def test_every_choice_has_a_reason() -> None:
    """All fields of a parameter set but its name and purpose are open points."""
    names = {point.name for point in open_points()}
    assert names == set(ParameterSet.__dataclass_fields__) - {"name", "purpose"}
    assert all(point.reason and point.paper for point in open_points())
