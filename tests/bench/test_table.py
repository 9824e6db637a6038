"""From a report to the tables of the document."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from ballsim.bench import table
from ballsim.bench.table import format_markdown, replace_tables

DOCS = Path(__file__).resolve().parents[2] / "docs"
DOCUMENT = "above\n<!-- bench: begin -->\nold\n<!-- bench: end -->\nbelow\n"


def test_only_what_is_between_the_marks_is_replaced() -> None:
    """Text around stays; what was there goes, whatever signs the new one has."""
    new = replace_tables(DOCUMENT, "a \\1 \\n b\n")
    assert new.startswith("above\n<!-- bench: begin -->\na \\1 \\n b\n<!--")
    assert new.endswith("<!-- bench: end -->\nbelow\n")
    assert "old" not in new
    assert replace_tables(new, "old\n") == DOCUMENT


@pytest.mark.skipif(not DOCS.is_dir(), reason="the sdist has no documents")
def test_document_shows_the_saved_figures() -> None:
    """The tables are those that `make performance` would write."""
    report = json.loads((DOCS / "performance.json").read_text(encoding="utf-8"))
    text = (DOCS / "performance.md").read_text(encoding="utf-8")
    assert replace_tables(text, format_markdown(report)) == text
    assert {ball["ball_radius"] for ball in report["balls"]} == {0.25, 0.5, 0.75, 1.0}


@pytest.mark.parametrize("content", [None, "", "{}", "[1]"])
def test_no_report_exits_with_2(
    content: str | None, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A missing or other file: one line, the document is left alone."""
    report, document = tmp_path / "report.json", tmp_path / "document.md"
    document.write_text(DOCUMENT)
    if content is not None:
        report.write_text(content)
    assert table.main([str(report), str(document)]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert document.read_text() == DOCUMENT
