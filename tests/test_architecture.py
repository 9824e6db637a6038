"""What may import what, and what the files of the project may hold."""

from __future__ import annotations

import ast
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import ballsim
import ballsim_controllers

ROOT = Path(__file__).resolve().parents[1]
MINK_IMPORTER = "ballsim_controllers.whole_body.inverse_kinematics"
MOST_LINES = 400

IMPORT_ALL = """
import importlib
import pkgutil
import sys

package, *words = sys.argv[1:]
left_out = {word[1:] for word in words if word.startswith("-")}
for word in words:
    if not word.startswith("-"):
        sys.modules[word] = None  # an import of it raises ModuleNotFoundError
root = importlib.import_module(package)
for module in pkgutil.walk_packages(root.__path__, package + "."):
    if module.name not in left_out:
        try:
            importlib.import_module(module.name)
        except ImportError as error:
            sys.exit(f"{module.name}: {error}")
        print(module.name)
"""


def _run_python(code: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", code, *arguments]
    return subprocess.run(
        command, capture_output=True, text=True, timeout=120, check=False
    )


def _sources(package_path: str) -> dict[str, Path]:
    """Return the source files of a package by the names of their modules."""
    folder = Path(package_path)
    return {
        ".".join(file.relative_to(folder.parent).with_suffix("").parts): file
        for file in sorted(folder.rglob("*.py"))
    }


def _imported_names(file: Path) -> Iterator[str]:
    """Yield all that a file imports, be it in a function."""
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{file}: relative import"
            assert node.module is not None
            yield node.module


def _project_files() -> list[Path]:
    """Return the files of the project: those that git would take, if git knows."""
    if shutil.which("git") and (ROOT / ".git").exists():
        command = ["git", "ls-files", "-z", "--cached", "--others"]
        listed = subprocess.run(
            [*command, "--exclude-standard"],
            cwd=ROOT,
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        files = [ROOT / name for name in listed.split("\0") if name]
    else:
        tops = ("controllers", "models", "notebooks", "src", "tests")
        files = [f for top in tops for f in (ROOT / top).rglob("*")]
        files += list(ROOT.iterdir())
    return [f for f in files if f.is_file() and "__pycache__" not in f.parts]


def test_controllers_run_without_the_simulator() -> None:
    """Every control module imports where neither simulator nor log exists."""
    done = _run_python(IMPORT_ALL, "ballsim_controllers", "ballsim", "rerun", "rich")
    assert done.returncode == 0, done.stderr
    modules = set(done.stdout.split())
    assert modules >= {"ballsim_controllers.pipeline", MINK_IMPORTER}
    found = set(_sources(ballsim_controllers.__path__[0]))
    found = {name.removesuffix(".__init__") for name in found}
    assert modules == found - {"ballsim_controllers"}


def test_import_of_all_notices_a_forbidden_import() -> None:
    """The tests by import fail if a package that is needed is taken away."""
    done = _run_python(IMPORT_ALL, "ballsim_controllers", "mink")
    assert done.returncode == 1
    assert "mink" in done.stderr


@pytest.mark.parametrize("package", [ballsim, ballsim_controllers])
def test_only_inverse_kinematics_import_mink(package: object) -> None:
    """Of both packages one module names mink."""
    sources = _sources(package.__path__[0])  # type: ignore[attr-defined]
    importers = {
        name
        for name, file in sources.items()
        if any(imported.split(".")[0] == "mink" for imported in _imported_names(file))
    }
    assert importers == {MINK_IMPORTER} & set(sources)


def test_modules_below_inverse_kinematics_run_without_mink() -> None:
    """What does not need the inverse kinematics imports where mink does not exist."""
    users = [
        "ballsim_controllers.pipeline",
        "ballsim_controllers.paper",
        "ballsim_controllers.whole_body.body_control",
        MINK_IMPORTER,
    ]
    left_out = [f"-{name}" for name in users]
    done = _run_python(IMPORT_ALL, "ballsim_controllers", "mink", *left_out)
    assert done.returncode == 0, done.stderr


def test_controllers_cannot_reach_the_plant() -> None:
    """No control module imports the simulator, not even inside a function.

    The plant's MjData lives in the simulator. An import by a computed name would
    escape the look at the source, therefore there is none either.
    """
    for name, file in _sources(ballsim_controllers.__path__[0]).items():
        tops = {imported.split(".")[0] for imported in _imported_names(file)}
        assert "ballsim" not in tops, name
        text = file.read_text(encoding="utf-8")
        assert not re.search(r"\b(import_module|__import__|sys\.modules)\b", text), name


@pytest.mark.parametrize(
    "field_name", ["MjData", "MjModel", "mjData", "mujoco", "ballsim"]
)
def test_messages_hold_nothing_of_mujoco(field_name: str) -> None:
    """The messages between simulator and controller know neither of the two."""
    messages = _sources(ballsim_controllers.__path__[0])["ballsim_controllers.messages"]
    names = {
        node.id if isinstance(node, ast.Name) else node.attr
        for node in ast.walk(ast.parse(messages.read_text(encoding="utf-8")))
        if isinstance(node, ast.Name | ast.Attribute)
    }
    assert field_name not in names


@pytest.mark.parametrize("module", ["ballsim", "ballsim.cli"])
def test_command_line_starts_light(module: str) -> None:
    """Neither the package nor its command line imports a heavy package."""
    heavy = ("numpy", "scipy", "mujoco", "rerun", "mink", "control", "matplotlib")
    code = f"import {module}, sys; print(*sys.modules)"
    done = _run_python(code)
    assert done.returncode == 0, done.stderr
    assert not set(heavy) & set(done.stdout.split())


def test_no_long_files() -> None:
    """No source file has more than 400 lines."""
    lines = {
        str(file.relative_to(ROOT)): len(file.read_text(encoding="utf-8").splitlines())
        for file in _project_files()
        if file.suffix == ".py"
    }
    assert lines
    assert not {name: n for name, n in lines.items() if n > MOST_LINES}


def test_both_packages_are_whole_and_typed() -> None:
    """Each folder of modules is a package, and both packages carry py.typed."""
    for package in (ballsim, ballsim_controllers):
        root = Path(package.__path__[0])
        assert (root / "py.typed").is_file()
        for folder in {file.parent for file in root.rglob("*.py")}:
            assert (folder / "__init__.py").is_file(), folder


def test_files_name_no_machine_and_no_package_index() -> None:
    """No file of the project knows where it was written or where packages are."""
    # Put together here, lest this file name them itself.
    folders = ("work", "root", "tmp/v", "home", "opt")
    machine = "|".join(rf"(?<![\w.~$)}}]){'/' + folder}/" for folder in folders)
    hosts = "|".join(
        [
            "pypi" + r"\.org",
            "python" + r"hosted\.org",
            r"(extra-)?index" + "-url",
            "file:" + "//",
        ]
    )
    forbidden = re.compile(f"{machine}|{hosts}")
    found = {}
    for file in _project_files():
        try:
            text = file.read_text(encoding="utf-8")
        except UnicodeDecodeError:
            continue
        match = forbidden.search(text)
        if match is not None:
            found[str(file.relative_to(ROOT))] = match.group()
    assert not found


def test_lock_pins_every_dependency_with_hashes() -> None:
    """Each requirement of the lock names one version and its hashes."""
    text = (ROOT / "requirements.lock").read_text(encoding="utf-8")
    lines = [line for line in text.splitlines() if line and line[0] not in "# "]
    pins = {re.split("==", line)[0]: line for line in lines}
    for name, line in pins.items():
        assert re.fullmatch(r"[a-z0-9-]+==[\w.+-]+ \\", line), line
        assert re.search(rf"^{name}==.*\n    --hash=sha256:", text, re.MULTILINE)
    for needed in ("mujoco", "mink", "daqp", "rerun-sdk", "hatchling", "editables"):
        assert needed in pins
