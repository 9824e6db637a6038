"""The documentation: builds without a warning, and does what it says."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import tomli_w

from ballsim.config_io import load_config
from ballsim.faults import FaultConfig
from ballsim.live.instructions import INSTRUCTIONS
from ballsim.preparation import prepare
from ballsim.reference import (
    format_commands,
    format_instructions,
    format_keys,
    format_settings,
    format_signals,
)
from ballsim.settings import write_table
from ballsim.simulation import run_prepared
from ballsim.studies.design import load_plan
from ballsim_controllers.messages import BallParameters, ControllerSetup
from ballsim_controllers.robot import load_robot_description

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
_BLOCK = re.compile(r'^```(\w+)(?: title="([^"]*)")?\n(.*?)^```$', re.M | re.S)


def _blocks(page: str, folder: Path = DOCS) -> list[tuple[str, str, str]]:
    """Return language, title and content of each code block of a page."""
    text = (folder / page).read_text(encoding="utf-8")
    return [match.groups("") for match in _BLOCK.finditer(text)]  # type: ignore[misc]


@pytest.mark.skipif(not (ROOT / "mkdocs.yml").exists(), reason="not in a checkout")
def test_site_builds_without_a_warning(tmp_path: Path) -> None:
    """Every link and every reference has a target; generated parts are there."""
    environment = {**os.environ, "NO_MKDOCS_2_WARNING": "1"}
    words = ["-m", "mkdocs", "build", "--strict", "--site-dir", str(tmp_path / "site")]
    done = subprocess.run(
        [sys.executable, *words],
        cwd=ROOT,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    page = (tmp_path / "site" / "reference" / "settings.html").read_text("utf-8")
    assert "scene.timestep_s" in page
    assert "generated:" not in page
    page = (tmp_path / "site" / "reference" / "python.html").read_text("utf-8")
    assert "ballsim.run_result.load" in page


def _find_toml(page: str) -> str:
    (text,) = [text for kind, _title, text in _blocks(page) if kind == "toml"]
    return text


def _keys(table: Any, prefix: str = "") -> set[str]:
    if isinstance(table, dict):
        pairs = [(f"{prefix}.{key}" if prefix else key, v) for key, v in table.items()]
    elif isinstance(table, list) and table and isinstance(table[0], dict):
        pairs = [(prefix, item) for item in table]
    else:
        return {prefix}
    return {name for key, value in pairs for name in _keys(value, key)}


def test_reference_names_every_setting() -> None:
    """What `config.toml` may hold stands in the reference, and the other way round."""
    reference = set(re.findall(r"^\| `([\w.]+)` \|", format_settings(), re.M))
    written: set[str] = set()
    for name in ("wheeled-lip", "paper"):
        config = prepare(load_config("push", [f"controller.name={name}"]).config).config
        table = write_table(config)
        table["command"] = write_table(load_config("walk").config)["command"]
        table["fault"] = [write_table(FaultConfig())]
        table["parameters"] = 0
        written |= _keys(table) - {"controller.name"}
    assert reference == written


def test_reference_names_every_command_and_series() -> None:
    """Commands of the contract, and one series of each tree."""
    commands = format_commands()
    for name in ("run", "replay", "paper", "study", "view", "bench", "plot", "compare"):
        assert f"## `ballsim {name}`" in commands
    assert format_instructions().count("\n| `") == len(INSTRUCTIONS)
    assert "| Left | `push 40 left` |" in format_keys()
    signals = format_signals()
    for path in ("truth/cop", "estimate/cop", "control/cop", "sensors/imu/gyro"):
        assert f"| `{path}` |" in signals


def test_controller_of_the_guide_runs() -> None:
    """The block of the guide is a controller."""
    (code,) = [
        text
        for kind, _, text in _blocks("howto/own-controller.md")
        if "class Hold" in text
    ]
    names: dict[str, Any] = {}
    exec(compile(code, "own-controller.md", "exec"), names)
    config = load_config("stand", ["duration_s=0.1"]).config
    setup = ControllerSetup(
        robot=load_robot_description(ROOT / "models" / "biped" / "robot.toml"),
        ball=BallParameters(0.5, 40.0, 0.5),
        control_period=0.005,
    )
    result = run_prepared(prepare(config, names["Hold"](setup)))
    assert result.n_ticks == 20


def test_files_of_the_guides_are_valid(tmp_path: Path) -> None:
    """Study and sensors can be used as they stand there."""
    (study,) = [
        text for kind, _, text in _blocks("howto/own-study.md") if kind == "toml"
    ]
    (tmp_path / "lean.toml").write_text(study)
    assert len(load_plan(tmp_path / "lean.toml").study.seeds) == 10
    (sensors,) = [
        text for kind, _, text in _blocks("howto/own-sensors.md") if kind == "toml"
    ]
    (tmp_path / "mine.toml").write_text(sensors)
    config = load_config(tmp_path / "mine.toml").config
    assert config.sensors.preset == "mid"
    assert config.sensors.gyro.noise_density == 1.2e-4
    assert tomli_w.dumps(write_table(config))


@pytest.mark.slow
def test_tutorial_works_as_written(tmp_path: Path) -> None:
    """A newcomer's path: every block of the tutorial, in its order."""
    blocks = _blocks("tutorial.md")
    assert [kind for kind, *_ in blocks].count("sh") >= 8
    script = []
    for kind, title, text in blocks:
        if kind == "sh" and title != "set up":
            script.append(text)
        elif title and kind != "sh":
            (tmp_path / title).write_text(text)
    output = _run_script(script, tmp_path)
    assert "the ball got to 0." in output
    assert "identical" in output
    for name in ("first/figures.pdf", "both/comparison.md", "mine/run.rrd"):
        assert (tmp_path / "runs" / name).exists()


def _run_script(lines: list[str], folder: Path) -> str:
    """Run lines of a shell in a folder as a newcomer would; return their output."""
    binaries = Path(sys.executable).parent
    environment = {**os.environ, "PATH": f"{binaries}{os.pathsep}{os.environ['PATH']}"}
    done = subprocess.run(
        ["bash", "-c", "\n".join(["set -euo pipefail", *lines])],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    return done.stdout


@pytest.mark.slow
@pytest.mark.timeout(1200)
@pytest.mark.skipif(not (ROOT / "Makefile").exists(), reason="not in a checkout")
def test_readme_works_as_written(tmp_path: Path) -> None:
    """What a newcomer reads first: its commands, its Python, its scenario, its table.

    Left out are only what needs a display and what takes minutes: the viewer, the
    bench, and all but the plan of the study. `make` gets the environment that there is.
    """
    blocks = _blocks("README.md", ROOT)
    shell = [text for kind, _, text in blocks if kind == "sh"]
    first, others, studies = shell
    binaries = Path(sys.executable).parent
    demo = first.splitlines()[0].partition("#")[0].strip()
    assert demo == "make run"
    make = f"{demo} --file {ROOT / 'Makefile'} --old-file setup BIN={binaries}"
    (table,) = [text for kind, _, text in blocks if text.startswith("walk with ")]
    output = _run_script([make], tmp_path)
    labels = [re.sub(r"-?[0-9.]+", "", line).split() for line in table.splitlines()]
    printed = [re.sub(r"-?[0-9.]+", "", line).split() for line in output.splitlines()]
    assert [words for words in labels if words not in printed] == []
    for file in ("summary.json", "run.rrd", "config.toml", "scene.xml", "readings.npz"):
        assert (tmp_path / "runs" / "walk" / file).is_file()
    (code,) = [text for kind, _, text in blocks if "ballsim.run(" in text]
    (tmp_path / "first.py").write_text(code)
    (scenario,) = [text for _, _, text in blocks if text.startswith("# there-and-back")]
    (tmp_path / "there-and-back.toml").write_text(scenario)
    (command,) = re.findall(
        r"^`(ballsim run there-and-back.*)`$", (ROOT / "README.md").read_text(), re.M
    )
    commands = [line for line in others.splitlines() if "ballsim bench" not in line]
    (tmp_path / "studies").symlink_to(ROOT / "studies")
    script = ["python first.py", *commands, command, studies.splitlines()[0]]
    output = _run_script(script, tmp_path)
    n_runs = sum(line.startswith("ballsim run") for line in [*commands, command])
    assert output.count("still up at the end") == n_runs > 10
    assert "friction: " in output
