"""`ballsim plot` and `ballsim compare`: what they show is what the runs hold."""

from __future__ import annotations

import dataclasses
import itertools
import json
import math
from pathlib import Path

import numpy as np
import pytest

import ballsim
from ballsim import cli
from ballsim.inspection.comparison import compare
from ballsim.inspection.page import draw_page, render
from ballsim.inspection.scaling import find_walk_end
from ballsim.inspection.support import compute_support, find_landings

pytest.importorskip("rerun")


@pytest.fixture(scope="module")
def walk(tmp_path_factory: pytest.TempPathFactory) -> ballsim.RunResult:
    """A run that steps and rolls the ball."""
    return ballsim.run("walk", out=tmp_path_factory.mktemp("walk"), duration=10)


@pytest.fixture(scope="module")
def stumble(tmp_path_factory: pytest.TempPathFactory) -> ballsim.RunResult:
    """A run that stumbles for most of a second before it ends."""
    changes = {"force": 300, "push.0.time_s": 0.3, "duration": 3}
    return ballsim.run("push", out=tmp_path_factory.mktemp("stumble"), **changes)


@pytest.fixture(scope="module")
def fall(tmp_path_factory: pytest.TempPathFactory) -> ballsim.RunResult:
    """A run that ends at once, without a stumble."""
    changes = {"force": 1200, "push.0.time_s": 0.3, "duration": 3}
    return ballsim.run("push", out=tmp_path_factory.mktemp("fall"), **changes)


def test_actual_cop_is_within_the_support(walk: ballsim.RunResult) -> None:
    """The contact points lie within the soles, so their mean does."""
    for axis in ("forward", "left"):
        time, low, high = compute_support(walk, axis)
        cop = walk["truth/cop"]
        rows = np.searchsorted(cop.time, time - 1e-9)
        inside = (cop[axis][rows] > low - 3e-3) & (cop[axis][rows] < high + 3e-3)
        assert inside.mean() > 0.99


def test_there_is_a_footprint_for_each_step(walk: ballsim.RunResult) -> None:
    """Feet alternate; the robot steps backwards on a ball that it rolls forwards."""
    landings = find_landings(walk)
    assert len(landings) == 2 + walk.summary["step_count"] > 10
    feet = [foot for foot, _ in landings[2:]]
    assert all(one != other for one, other in itertools.pairwise(feet))
    rolled = walk["truth/ball/angle"]["forward"][-1] * walk.config.ball.radius
    places = [corners.mean(axis=0) for _, corners in landings]
    moved = np.mean(places[-2:], axis=0) - np.mean(places[:2], axis=0)
    assert moved[0] == pytest.approx(-rolled, abs=0.1)
    assert rolled > 0.3
    for _, corners in landings:
        assert np.ptp(corners, axis=0) == pytest.approx([0.2, 0.09])


def test_axes_show_the_walk_and_not_the_fall(fall: ballsim.RunResult) -> None:
    """While it falls the CoP leaves the ball: that is not what the axes are for."""
    assert not fall.survived
    axes = {ax.get_title(): ax for ax in draw_page(fall).axes}
    assert np.ptp(axes["centre of pressure, forward"].get_ylim()) < 500.0
    forces = fall["truth/foot_forces"]
    walked = forces.values[forces.time < find_walk_end(fall)].max()
    high = axes["force of the ball on each foot"].get_ylim()[1]
    assert walked < high < 1.4 * walked < forces.values.max()
    prints = axes["footprints on the unrolled ball"]
    assert np.ptp(prints.get_xlim()) < 1.0
    marks = [line.get_xdata() for line in axes["ball speed"].lines]
    assert any(np.allclose(mark, fall.summary["fall_time"]) for mark in marks)


def test_axes_of_a_stumble_are_those_of_its_cop(stumble: ballsim.RunResult) -> None:
    """A foot that misses the ball's top does not make the CoP's curve flat.

    All of the CoP before the fall is shown, with as much of the support on each side,
    and without the fall's own.
    """
    assert not stumble.survived
    cop, end = stumble["truth/cop"], find_walk_end(stumble)
    assert 0.5 < end < stumble.summary["fall_time"] - 0.3
    assert find_walk_end(dataclasses.replace(stumble, events=())) == math.inf
    axes = {ax.get_title(): ax for ax in draw_page(stumble).axes}
    for axis in ("forward", "left"):
        walked = 1e3 * cop[axis][cop.time < end]
        walked = walked[np.isfinite(walked)]
        low, high = axes[f"centre of pressure, {axis}"].get_ylim()
        assert low < walked.min()
        assert high > walked.max()
        most = np.ptp(walked) + 2.0 * 150.0  # and margins, and the legend
        assert high - low < 1.4 * most
    forces = stumble["truth/foot_forces"]
    walked = forces.values[forces.time < end]
    low, high = axes["force of the ball on each foot"].get_ylim()
    assert walked.max() < high < 1.4 * walked.max()


def test_plot_writes_a_page(
    walk: ballsim.RunResult, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Into another folder, if asked to; equal runs give equal files."""
    assert cli.main(["plot", str(walk.folder), "--out", str(tmp_path / "new")]) == 0
    printed = capsys.readouterr().out.split()
    assert [Path(line).name for line in printed] == ["figures.png", "figures.pdf"]
    found = {Path(line).suffix[1:]: Path(line).read_bytes() for line in printed}
    assert found == dict(render(draw_page(ballsim.load(walk.folder or ""))))
    assert found["png"].startswith(b"\x89PNG")
    assert found["pdf"].startswith(b"%PDF")


def test_bad_input_of_plot(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Exit code 2, one line, nothing written."""
    assert cli.main(["plot", str(tmp_path), "--out", str(tmp_path / "new")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "run.rrd" in line
    assert not list(tmp_path.iterdir())


def test_differences_are_differences(
    walk: ballsim.RunResult, fall: ballsim.RunResult
) -> None:
    """Every setting and every number that differs, and no other."""
    found = compare(walk, fall, ("a", "b"))
    assert found.settings["duration_s"] == (10.0, 3.0)
    assert found.settings["push.0.force_n"] == (None, 1200.0)
    assert "ball.radius_m" not in found.settings
    steps = walk.summary["step_count"], fall.summary["step_count"]
    assert found.numbers["step_count"] == steps
    assert f"| {steps[1] - steps[0]:+.4g} |" in found.format_markdown()
    same = compare(walk, walk, ("a", "b"))
    assert (same.settings, same.numbers) == ({}, {})
    assert "The same numbers." in same.format_markdown()


def test_compare_writes_figures_and_table(
    walk: ballsim.RunResult,
    fall: ballsim.RunResult,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Figures and the table that is printed; with --json nothing else on stdout."""
    words = ["compare", str(walk.folder), str(fall.folder), "--out", str(tmp_path)]
    assert cli.main(words) == 0
    table = (tmp_path / "comparison.md").read_text()
    assert table in capsys.readouterr().out
    names = {file.name for file in tmp_path.iterdir()}
    assert names == {"comparison.md", "comparison.png", "comparison.pdf"}
    assert cli.main([*words, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["settings"]["duration_s"] == [10.0, 3.0]
