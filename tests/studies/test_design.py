"""From the file to the cells: combinations, samples, refusals."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from ballsim.errors import ConfigError
from ballsim.studies.design import extreme_cells, load_plan
from ballsim.studies.factors import Factor
from ballsim.studies.validation import check_plan

WriteStudy = Callable[..., Path]

HEAD = 'scenario = "stand"\nduration_s = 0.1\nseeds = 2\n'
FRICTION = '[[factors]]\nkey = "scene.sole_friction"\n'
RADIUS = '[[factors]]\nkey = "ball.radius_m"\n'
STUDIES = Path(__file__).resolve().parents[2] / "studies"


def test_cells_are_all_combinations(write_study: WriteStudy) -> None:
    """Every cell has its own values in its configuration; the last factor is inner."""
    text = FRICTION + "values = [0.5, 1]\n" + RADIUS + "linspace = [0.4, 0.8, 3]\n"
    plan = load_plan(write_study(HEAD + "[base]\nball.mass_kg = 30\n" + text))
    found = [(c.config.scene.sole_friction, c.config.ball.radius) for c in plan.cells]
    assert found == [(f, r) for f in (0.5, 1.0) for r in (0.4, 0.6, 0.8)]
    assert {c.config.ball.mass for c in plan.cells} == {30.0}
    assert {c.config.duration for c in plan.cells} == {0.1}
    assert plan.n_runs == 12


def test_spaced_values_hold_both_ends() -> None:
    """Even steps, constant ratios; whole numbers stay whole."""
    assert Factor("k", linspace=(0, 20, 5)).levels == (0, 5, 10, 15, 20)
    assert Factor("k", linspace=(0.0, 0.3, 4)).levels == (0.0, 0.1, 0.2, 0.3)
    assert Factor("k", logspace=(0.01, 1, 3)).levels == (0.01, 0.1, 1.0)
    assert Factor("k", logspace=(0.01, 1, 3)).is_log


@pytest.mark.parametrize("method", ["sobol", "latin-hypercube"])
def test_samples_fill_their_ranges(method: str, write_study: WriteStudy) -> None:
    """Each of n slices of every range holds one point; the logarithm may be meant."""
    n = 16
    text = f'[sampling]\nmethod = "{method}"\ncount = {n}\n'
    text += (
        FRICTION + 'range = [0.01, 1.0]\nscale = "log"\n' + RADIUS + "range = [0.3, 1]"
    )
    file = write_study(HEAD + text)
    values = [tuple(cell.values.values()) for cell in load_plan(file).cells]
    friction, radius = np.array(values, dtype=float).T
    for unit in (np.log10(friction) / 2.0 + 1.0, (radius - 0.3) / 0.7):
        assert sorted(np.floor(n * unit).astype(int)) == list(range(n))
    assert values == [tuple(cell.values.values()) for cell in load_plan(file).cells]


def test_saltelli_design_exchanges_one_factor_at_a_time(
    write_study: WriteStudy,
) -> None:
    """Points A, points B, then A with one factor of B: all fill their ranges."""
    text = '[sampling]\nmethod = "saltelli"\ncount = 8\n'
    text += FRICTION + "range = [0.5, 1.0]\n" + RADIUS + "range = [0.4, 0.8]\n"
    plan = load_plan(write_study(HEAD + text))
    values = np.array([list(cell.values.values()) for cell in plan.cells], dtype=float)
    a, b, first, second = values.reshape(4, 8, 2)
    assert (first == np.column_stack([b[:, 0], a[:, 1]])).all()
    assert (second == np.column_stack([a[:, 0], b[:, 1]])).all()
    for column in (*a.T, *b.T):
        assert len(set(column)) == 8
    assert not (a == b).any()


def test_samples_are_crossed_with_grids(write_study: WriteStudy) -> None:
    """Every value of a grid meets the same sampled points."""
    text = "[sampling]\ncount = 4\n" + FRICTION + "range = [0.5, 1.0]\n"
    plan = load_plan(write_study(HEAD + text + RADIUS + "values = [0.4, 0.8]\n"))
    assert len(plan.cells) == 8
    frictions = [cell.values["scene.sole_friction"] for cell in plan.cells]
    assert frictions[:4] == frictions[4:]
    assert list(plan.cells[0].values) == ["scene.sole_friction", "ball.radius_m"]


def test_extreme_cells_hold_every_extreme(write_study: WriteStudy) -> None:
    """Least and greatest of numbers, each of other values, and few cells."""
    text = FRICTION + "values = [0.5, 0.2, 1.0, 0.3]\n"
    text += '[[factors]]\nkey = "controller.name"\nvalues = ["paper", "wheeled-lip"]'
    chosen = extreme_cells(load_plan(write_study(HEAD + text)))
    assert {c.values["scene.sole_friction"] for c in chosen} >= {0.2, 1.0}
    assert {c.values["controller.name"] for c in chosen} == {"paper", "wheeled-lip"}
    assert len(chosen) <= 6


def test_digest_tells_studies_apart_by_what_their_rows_depend_on(
    write_study: WriteStudy,
) -> None:
    """Words and metrics leave a study the same, values and seeds do not."""

    def digest(text: str) -> str:
        return load_plan(write_study(text)).digest

    text = HEAD + FRICTION + "values = [0.5, 1]\n"
    same = [text, 'description = "other"\nmetrics = []\nrun_limit_s = 5\n' + text]
    assert len({digest(t) for t in same}) == 1
    other = [
        text.replace("seeds = 2", "seeds = 3"),
        text.replace("0.5", "0.6"),
        text.replace("duration_s = 0.1", "duration_s = 0.2"),
        text + "[stopping]\nhalf_width = 0.2\n",
        text + "[base]\nball.mass_kg = 30\n",
    ]
    assert len({digest(t) for t in (text, *other)}) == 1 + len(other)


def test_scenario_may_lie_beside_the_study(
    write_study: WriteStudy, tmp_path: Path
) -> None:
    """A relative scenario file is found from wherever the command is given."""
    (tmp_path / "mine.toml").write_text(
        "duration_s = 0.2\n[parameters]\nr = 'ball.radius_m'"
    )
    text = 'scenario = "mine.toml"\n[[factors]]\nkey = "r"\nvalues = [0.4, 0.6]\n'
    plan = load_plan(write_study(text))
    assert [cell.config.ball.radius for cell in plan.cells] == [0.4, 0.6]


@pytest.mark.parametrize("file", sorted(STUDIES.glob("*.toml")), ids=lambda f: f.stem)
def test_shipped_studies_are_valid(file: Path) -> None:
    """Each one passes all the checks that come before its runs."""
    plan = load_plan(file)
    check_plan(plan)
    assert plan.study.description != "no description"


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("seedz = 3", "seedz = 3 is not valid: no such key; the keys at the top"),
        ("seeds = 0", "seeds = 0"),
        ("seeds = [1, 1]", "seeds = [1, 1]"),
        ("metrics = ['speed']", "metrics.0 = 'speed' is not valid: one of ball_radius"),
        ("metrics = ['wall_time']", "metrics.0 = 'wall_time'"),
        ("metrics = ['fall_reason']", "metrics.0 = 'fall_reason'"),
        ("axis = 'ball.radius_m'", "axis = 'ball.radius_m'"),
        ("keep_recordings = 'all'", "one of none, falls"),
        ("scenario = 'stnad'", "scenario = 'stnad' is not valid: one of"),
        ("[base]\nball.mass_kg = -1", "ball.mass_kg = -1"),
        ("[base]\nseed = 4", "base.seed = 4"),
        (
            "scenario = 'roll-to'\n[[factors]]\nkey = 'target_angle'\nvalues = [1]\n"
            "[[factors]]\nkey = 'command.timeline.0.target_angle_rad'\nvalues = [2]",
            "a key that is set once, not by target_angle too",
        ),
        ("[sampling]\ncount = 4", "sampling = 'sobol'"),
        ("[stopping]\nhalf_width = 0", "stopping.half_width = 0"),
        (FRICTION, "factors.0.key = 'scene.sole_friction'"),
        (FRICTION + "values = []", "factors.0.values = []"),
        (FRICTION + "values = [1, 1]", "factors.0.values = [1, 1]"),
        (FRICTION + "values = [nan]", "factors.0.values = nan"),
        (FRICTION + "values = [1]\nrange = [0, 1]", "here values and range"),
        (FRICTION + "values = [0, 1]\nscale = 'log'", "scale = 'log'"),
        (FRICTION + "linspace = [0, 1]", "factors.0.linspace = [0, 1]"),
        (FRICTION + "linspace = [1, 0, 2]", "low less than high"),
        (FRICTION + "logspace = [0, 1, 2]", "low above 0"),
        (FRICTION + "range = [0, 1]", "sampling = None"),
        (
            "[sampling]\ncount = 5\n" + FRICTION + "range = [0, 1]",
            "sampling.count = 5 is not valid: a power of two",
        ),
        (
            "[sampling]\nmethod = 'saltelli'\ncount = 5\n"
            + FRICTION
            + "range = [0, 1]",
            "sampling.count = 5 is not valid: a power of two",
        ),
        (
            "[sampling]\nmethod = 'saltelli'\n" + FRICTION + "range = [0.1, 1]",
            "sampling.method = 'saltelli' is not valid: another one unless two factors",
        ),
        (
            "[sampling]\nmethod = 'saltelli'\n"
            + FRICTION
            + "range = [0.1, 1]\n"
            + RADIUS
            + "values = [0.5]",
            "sampling.method = 'saltelli'",
        ),
        (FRICTION + "values = [1]\n" + FRICTION + "values = [2]", "factors.1.key"),
        (
            "[base]\nscene.sole_friction = 1\n" + FRICTION + "values = [1]",
            "a key that is set once, not by scene.sole_friction too",
        ),
        ("[[factors]]\nkey = 'seed'\nvalues = [1]", "factors.0.key = 'seed'"),
        ("[[factors]]\nkey = 'bal'\nvalues = [1]", "bal = 1 is not valid: no such key"),
        (RADIUS + "values = [0.5, 9]", "ball.radius_m = 9"),
        (RADIUS + "values = [0.5, 'big']", "ball.radius_m = 'big'"),
        (
            "[[factors]]\nkey = 'controller.name'\nvalues = ['paper', 'lip']",
            "controller.name = 'lip' is not valid: one of",
        ),
        (
            "[[factors]]\nkey = 'controller.gait.lift'\nvalues = [1]",
            "controller.gait.lift = 1",
        ),
        ("x", "TOML ="),
    ],
)
def test_bad_study_is_refused_in_one_line(
    text: str, part: str, write_study: WriteStudy
) -> None:
    """The line names the file, the key, the value and what would be valid."""
    head = "" if text.startswith(("seeds", "scenario")) else "seeds = 1\n"
    file = write_study(head + text + "\n")
    with pytest.raises(ConfigError) as caught:
        check_plan(load_plan(file))
    message = str(caught.value)
    assert message.startswith(f"{file}: ")
    assert part in message
    assert "\n" not in message


def test_example_of_the_documentation_is_valid(write_study: WriteStudy) -> None:
    """The file that docs/studies.md shows can be used as it stands."""
    text = (STUDIES.parent / "docs" / "studies.md").read_text()
    blocks = [block.partition("```")[0] for block in text.split("```toml\n")[1:]]
    example, sampling, stopping, cases, variants = blocks
    plan = load_plan(write_study(example.replace("[base]", stopping + "[base]")))
    assert len(plan.cells) == 8
    ranged = example.replace("values = [0.05, 0.1, 0.2, 1.0]", "range = [0.05, 1]")
    plan = load_plan(write_study(ranged.replace("[base]", sampling + "[base]")))
    assert len(plan.cells) == 128
    several = example.replace('scenario = "roll-to"', "") + cases
    plan = load_plan(write_study(several))
    check_plan(plan)
    assert len(plan.cells) == 3 * 4
    varied = load_plan(write_study(several + variants))
    assert len(varied.cells) == len(plan.cells)
    assert {cell.config.robot.mass_scale for cell in varied.cells} == {1.05}
