"""Places of the files that belong to the package."""

from __future__ import annotations

from pathlib import Path

from ballsim.errors import ConfigError

__all__ = ["find_models_folder", "list_robots", "robot_description_path"]


def find_models_folder() -> Path:
    """Return the folder of the models: that of the wheel, else of the checkout.

    An editable install leaves a copy of the models in site-packages, which grows
    stale; therefore the search starts from this file and never from ``sys.path``.

    Raises:
        ConfigError: Neither folder exists.
    """
    here = Path(__file__).resolve().parent
    candidates = (here / "_models", here.parents[1] / "models")
    for folder in candidates:
        if folder.is_dir():
            return folder
    raise ConfigError(
        "models",
        str(candidates[-1]),
        "the folder of the models must exist: reinstall ballsim",
    )


def list_robots() -> tuple[str, ...]:
    """Return the names of the robots that have a description, sorted."""
    return tuple(
        sorted(file.parent.name for file in find_models_folder().glob("*/robot.toml"))
    )


def robot_description_path(name: str) -> Path:
    """Return the path of a robot's description, for ``load_robot_description``.

    Args:
        name: Name of the robot, which is the name of its folder in ``models``.

    Raises:
        ConfigError: There is no such robot.
    """
    available = list_robots()
    if name not in available:
        raise ConfigError("robot", name, f"choose one of {', '.join(available)}")
    return find_models_folder() / name / "robot.toml"
