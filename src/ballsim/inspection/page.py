"""A page of figures of a run, in the manner of the paper's."""

from __future__ import annotations

import io
from collections.abc import Iterator
from pathlib import Path

import matplotlib as mpl
from matplotlib.figure import Figure

from ballsim.errors import ConfigError
from ballsim.inspection import panels
from ballsim.inspection.scaling import find_walk_end
from ballsim.run_files import check_out_dir, write_file
from ballsim.run_result import RunResult, load
from ballsim.style import STYLE, make_figure

__all__ = ["draw_page", "load_complete", "plot_run", "render", "write_figures"]

FORMATS = ("png", "pdf")
_NAME = "figures"
_EVENT = "#CC79A7"
_NEEDED = ("control/cop", "limits/joints/torque", "truth/cop", "truth/soles")


def draw_page(run: RunResult) -> Figure:
    """Draw the page of a run.

    Args:
        run: The run.
    """
    with mpl.rc_context(STYLE):
        figure, grid = make_figure(10.6, 5, 2)
        axes = [ax for row in grid for ax in row]
        panels.draw_ball_angle(axes[0], run)
        panels.draw_ball_speed(axes[1], run)
        panels.draw_cop(axes[2], run, "forward")
        panels.draw_cop(axes[3], run, "left")
        panels.draw_cop_deviation(axes[4], run)
        panels.draw_foot_forces(axes[5], run)
        panels.draw_joint_torques(axes[6], run, "left")
        panels.draw_joint_torques(axes[7], run, "right")
        panels.draw_estimate_errors(axes[8], run)
        panels.draw_footsteps(axes[9], run)
        last = max(float(series.time[-1]) for series in run.signals.values())
        for ax in axes[:-1]:
            ax.set(xlabel="time [s]", xlim=(0.0, last))
            for event in run.events:
                if event.kind in ("fall", "push"):
                    ax.axvline(event.time, color=_EVENT, linewidth=0.8)
            if find_walk_end(run) < last:  # the limits are not for what is there
                ax.axvspan(find_walk_end(run), last, color=_EVENT, alpha=0.1, lw=0)
        figure.suptitle(_title(run), fontsize=9)
        return figure


def render(figure: Figure) -> Iterator[tuple[str, bytes]]:
    """Yield the suffix and the content of each file of a figure.

    Args:
        figure: The figure.
    """
    for suffix in FORMATS:
        buffer = io.BytesIO()
        metadata = {"CreationDate": None} if suffix == "pdf" else None
        with mpl.rc_context(STYLE):
            figure.savefig(buffer, format=suffix, metadata=metadata)
        yield suffix, buffer.getvalue()


def load_complete(path: Path) -> RunResult:
    """Read a run back that has all that figures show.

    Args:
        path: Folder of a run, or its recording.

    Raises:
        ConfigError: There is no recording, or one by an older ballsim.
    """
    run = load(path)
    missing = [name for name in _NEEDED if name not in run.signals]
    if missing or len(run["truth/soles"]) < 2:
        lack = ", ".join(missing) or "at least two rows of each series"
        valid = f"a recording of this version, but it lacks {lack}"
        raise ConfigError("DIR", str(path), valid, "command line")
    return run


def plot_run(folder: Path, out: Path | None = None) -> list[Path]:
    """Draw the page of a run and write it.

    Args:
        folder: Folder of the run, or its recording.
        out: Folder of the figures; that of the run if None.

    Returns:
        The files.

    Raises:
        ConfigError: There is no recording, or the folder cannot be written.
    """
    run = load_complete(folder)
    target = out or (folder if folder.is_dir() else folder.parent)
    check_out_dir(target)
    content = list(render(draw_page(run)))
    return write_figures(target, _NAME, content)


def write_figures(
    folder: Path, name: str, content: list[tuple[str, bytes]]
) -> list[Path]:
    """Write the files of a figure.

    Args:
        folder: Their folder; made if need be.
        name: Their name without the suffix.
        content: What `render` yields.

    Raises:
        ConfigError: The folder cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        files = [folder / f"{name}.{suffix}" for suffix, _ in content]
        for file, (_, data) in zip(files, content, strict=True):
            write_file(file, data)
    except OSError as error:
        valid = f"a folder that can be written ({error.strerror})"
        raise ConfigError("--out", str(folder), valid, "command line") from error
    return files


def _title(run: RunResult) -> str:
    config = run.config
    falls = [event for event in run.events if event.kind == "fall"]
    end = f"; {falls[0].text} at {falls[0].time:.2f} s" if falls else ""
    return (
        f"{config.scenario}, {config.controller.name}, ball {config.ball.radius:g} m, "
        f"sensors {config.sensors.preset}, seed {config.seed}{end}"
    )
