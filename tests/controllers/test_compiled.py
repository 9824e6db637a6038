"""Laws of the compiled functions: MuJoCo's numbers, plain Python's numbers, in time."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from ballsim_controllers import compilation
from ballsim_controllers.geometry import (
    apply,
    apply_transposed,
    multiply,
    solve_linear,
)
from ballsim_controllers.native import find_function, view_1d, view_2d
from ballsim_controllers.robot_kinematics import com_velocity
from ballsim_controllers.robot_model import RobotModel
from ballsim_controllers.whole_body.leg_motion import (
    N_BASE,
    foot_bias_acceleration,
    foot_jacobian,
)
from ballsim_controllers.whole_body.nominal_stance import solve_nominal_stance


def move_somewhere(robot: RobotModel, seed: int) -> None:
    """Put the robot into some posture, moving."""
    generator = np.random.default_rng(seed)
    qpos = solve_nominal_stance(robot, 0.5).qpos.copy()
    qpos[:3] += generator.normal(size=3)
    qpos[3:7] += 0.3 * generator.normal(size=4)
    qpos[3:7] /= np.linalg.norm(qpos[3:7])
    qpos[7:] += 0.2 * generator.normal(size=robot.joint_count)
    robot.update(qpos, generator.normal(size=robot.model.nv))


@pytest.mark.parametrize("size", [1, 2, 3, 6])
def test_linear_solution_is_lapacks(size: int) -> None:
    """A small system has NumPy's solution, also where pivots must be exchanged."""
    generator = np.random.default_rng(size)
    for _ in range(20):
        matrix = generator.normal(size=(size, size))
        matrix[0, 0] = 0.0 if size > 1 else 2.0
        right = generator.normal(size=(size, 3))
        before = matrix.copy(), right.copy()
        found = solve_linear(matrix, right)
        np.testing.assert_allclose(found, np.linalg.solve(matrix, right), atol=1e-9)
        np.testing.assert_array_equal(matrix, before[0])
        np.testing.assert_array_equal(right, before[1])


def test_singular_system_has_no_finite_solution() -> None:
    """Where there is no solution the numbers say so, and nothing is raised."""
    with np.errstate(all="ignore"):
        assert not np.isfinite(solve_linear(np.zeros((2, 2)), np.ones((2, 1)))).any()


def test_products_are_numpys() -> None:
    """Loops over the elements give what NumPy's products give."""
    generator = np.random.default_rng(0)
    a, b = generator.normal(size=(3, 6)), generator.normal(size=(6, 2))
    np.testing.assert_allclose(multiply(a, b), a @ b, atol=1e-14)
    np.testing.assert_allclose(multiply(b.T, a.T), b.T @ a.T, atol=1e-14)
    np.testing.assert_allclose(apply(a, b[:, 0]), a @ b[:, 0], atol=1e-14)
    np.testing.assert_allclose(apply_transposed(a, a[:, 1]), a.T @ a[:, 1], atol=1e-14)


def test_views_are_the_memory_itself() -> None:
    """What is written through an address stands in the array."""
    array = np.arange(6.0).reshape(2, 3)
    address = array.ctypes.data
    view_2d(address, 2, 3)[1, 2] = 50.0
    view_1d(address, 6)[0] = -1.0
    assert array[1, 2] == 50.0
    assert array[0, 0] == -1.0


def test_unknown_function_is_no_address() -> None:
    """A name that MuJoCo does not have raises, and is not called."""
    assert find_function("mj_kinematics") > 0
    with pytest.raises(AttributeError, match="mj_nothing"):
        find_function("mj_nothing")


@pytest.mark.parametrize("foot", [0, 1])
def test_foot_jacobian_is_mujocos(robot: RobotModel, foot: int) -> None:
    """Columns of base and leg are those of ``mj_jac``; all others are zero there."""
    leg, data = robot.leg_dofs[foot], robot.data
    columns = np.concatenate((np.arange(N_BASE), leg))
    for seed in range(5):
        move_somewhere(robot, seed)
        point = robot.feet[foot].position + np.array([0.05, -0.02, 0.01])
        found, com = np.empty((6, 12)), data.subtree_com[1]
        foot_jacobian(found, point, leg, data.cdof, com)
        expected = robot.point_jacobian(foot, point)
        np.testing.assert_allclose(found, expected[:, columns], atol=1e-12)
        assert not np.delete(expected, columns, axis=1).any()
        bias = foot_bias_acceleration(
            point,
            leg,
            data.cvel[robot.foot_body_ids[foot]],
            data.qvel,
            data.cdof_dot,
            com,
        )
        expected = robot.point_bias_acceleration(foot, point)
        np.testing.assert_allclose(bias, expected, atol=1e-10)


def test_com_velocity_is_mujocos(robot: RobotModel) -> None:
    """The sum over the bodies is what ``mj_subtreeVel`` has."""
    for seed in range(5):
        move_somewhere(robot, seed)
        found = com_velocity(robot.record)
        np.testing.assert_allclose(found, robot.com_velocity(), atol=1e-12)


STEPPING_RUN = """
import sys
import numpy as np
from ballsim.config_io import load_config
from ballsim.preparation import prepare
from ballsim.simulation import run_prepared

prepared = prepare(load_config("step", [
    "duration_s=0.6", "seed=3", "command.timeline.0.time_s=0.05",
    "controller.gait.start_patience_s=0.02",
]).config)
"""

SAVE_SERIES = """
series = run_prepared(prepared).series
np.savez(sys.argv[1], ctrl=series.ctrl, qpos=series.qpos,
         phase=series.telemetry.phase[:series.n_ticks])
"""

COUNT_LOADS = """
from numba.core import caching, dispatcher
loads = []

def note(*_):
    loads.append(_)

original = caching.FunctionCache.load_overload
caching.FunctionCache.load_overload = lambda *a: (note(*a), original(*a))[1]
compile_one = dispatcher.Dispatcher.compile
dispatcher.Dispatcher.compile = lambda *a: (note(*a), compile_one(*a))[1]
result = run_prepared(prepared)
assert result.series.telemetry.step_count.max() >= 1
print(len(loads))
"""


def run_python(code: str, *arguments: str, **environment: str) -> str:
    """Return what a fresh interpreter prints."""
    done = subprocess.run(
        [sys.executable, "-c", code, *arguments],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=True,
        timeout=200,
    )
    return done.stdout


def test_plain_python_does_the_same(tmp_path: Path) -> None:
    """Without compilation the robot stands and steps as with it, to rounding."""
    runs = []
    for name, switch in (("compiled", ""), ("plain", "1")):
        file = tmp_path / f"{name}.npz"
        code = STEPPING_RUN + SAVE_SERIES
        run_python(code, str(file), BALLSIM_NO_COMPILE=switch)
        runs.append(np.load(file))
    compiled, plain = runs
    assert set(plain["phase"]) >= {1, 2} or set(plain["phase"]) >= {1, 3}
    np.testing.assert_array_equal(plain["phase"], compiled["phase"])
    np.testing.assert_allclose(plain["qpos"], compiled["qpos"], atol=1e-6)
    np.testing.assert_allclose(plain["ctrl"][:20], compiled["ctrl"][:20], atol=1e-9)


def test_nothing_is_loaded_during_a_run() -> None:
    """After the rehearsal every compiled function is there: no tick waits for one."""
    assert int(run_python(STEPPING_RUN + COUNT_LOADS)) == 0


def test_an_edit_reaches_the_callers_in_other_files(tmp_path: Path) -> None:
    """Machine code on disk is made anew when any source of the package changes."""
    package = tmp_path / "package"
    package.mkdir()
    source = Path(compilation.__file__).read_text(encoding="utf-8")
    (package / "__init__.py").touch()
    (package / "compilation.py").write_text(source, encoding="utf-8")
    (package / "outer.py").write_text(
        "from package.compilation import compiled\n"
        "from package.inner import inner\n"
        "@compiled\n"
        "def outer():\n"
        "    return inner()\n"
    )
    program = (
        "from package.outer import outer\n"
        "print(outer(), sum(outer.stats.cache_hits.values()))"
    )
    answers = []
    for value in ("1", "1", "2"):
        (package / "inner.py").write_text(
            "from package.compilation import compiled\n"
            "@compiled\n"
            "def inner():\n"
            f"    return {value}\n"
        )
        done = subprocess.run(
            [sys.executable, "-c", program],
            cwd=tmp_path,
            env={**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache")},
            capture_output=True,
            text=True,
            check=True,
        )
        value_found, hits = done.stdout.split()
        answers.append((value_found, int(hits) > 0))
    assert answers == [("1", False), ("1", True), ("2", False)]
