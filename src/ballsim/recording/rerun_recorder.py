"""Writes a run to a rerun recording while it goes on.

Rows are buffered in the run's own arrays and sent as columns, a few hundred
ticks at once: logging tick by tick costs a hundred times as much in Python.
"""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import rerun as rr

from ballsim.config_io import format_config
from ballsim.recording.block import Block, compute_block
from ballsim.recording.blueprint import (
    BALL_TOP_PATH,
    FOCUS_PATH,
    focus_height,
    make_blueprint,
)
from ballsim.recording.marks import MARKS
from ballsim.recording.meshes import (
    Mesh,
    make_ball_mesh,
    make_body_mesh,
    make_floor_mesh,
)
from ballsim.recording.palette import LEFT, RIGHT
from ballsim.recording.plots import PHASE_COLOURS, PHASE_PATH, Plot, make_plots
from ballsim.recording.recorder import RunContext
from ballsim.series import RunSeries
from ballsim_controllers.messages import Array, GaitPhase

__all__ = ["RerunRecorder"]

_POSE_PERIOD = 0.01  # time between two poses in the 3-D view, [s]
_VISUAL_GROUP = 2
_TIMELINE = "sim_time"
_FORCE_SCALE = 1.2e-3  # length of an arrow for each newton, [m/N]
_FLUSH_TIMEOUT = 10.0  # [s]


class RerunRecorder:
    """Streams a run into an .rrd file that is readable up to a crash.

    Args:
        path: The file; replaced if it exists.
    """

    def __init__(self, path: Path) -> None:
        """Remember the path; the file is opened by `start`."""
        self._path = path
        self._stream: rr.RecordingStream | None = None
        self._context: RunContext | None = None
        self._scratch: mujoco.MjData | None = None
        self._bodies: list[tuple[int, str]] = []
        self._plots: tuple[Plot, ...] = ()
        self._phase: int | None = None

    def start(self, context: RunContext) -> None:
        """Open the file and log what does not change."""
        config = context.config
        self._plots = make_plots(context)
        stream = rr.RecordingStream("ballsim")
        stream.set_log_tick_enabled(False)
        stream.set_log_time_enabled(False)
        stream.save(self._path, default_blueprint=make_blueprint(context, self._plots))
        name = f"{config.scenario}, seed {config.seed}, ball {config.ball.radius:g} m"
        stream.send_recording_name(name)
        self._stream, self._context = stream, context
        self._scratch = mujoco.MjData(context.model)
        self._log_static(stream, context)
        stream.flush(timeout_sec=_FLUSH_TIMEOUT)

    def record(self, series: RunSeries, start: int, stop: int) -> None:
        """Send the rows from start to stop."""
        if self._stream is None or self._context is None or stop <= start:
            return
        stream, context = self._stream, self._context
        period = context.config.simulation.control_period
        stride = max(1, round(_POSE_PERIOD / period))
        slow = np.arange(-(-start // stride) * stride, stop, stride)
        block = compute_block(context, series, start, stop, slow)
        self._send_poses(stream, series, slow)
        self._send_marks(stream, block)
        self._send_contacts(stream, series, start, stop, slow)
        for plot in self._plots:
            values = plot.compute(block)
            time = block.slow_time if plot.is_slow else block.time
            self._send_scalars(stream, plot.path, time, values)
        self._send_phases(stream, block)
        stream.flush(timeout_sec=_FLUSH_TIMEOUT)

    def close(self) -> None:
        """Finish the file."""
        if self._stream is not None:
            self._stream.disconnect()
            self._stream = None

    def _log_static(self, stream: rr.RecordingStream, context: RunContext) -> None:
        model, ids = context.model, context.ids
        stream.log("/world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        stream.log("/world/floor", _to_rerun(make_floor_mesh()), static=True)
        ball_mesh = make_ball_mesh(context.config.ball.radius)
        stream.log("/world/ball", _to_rerun(ball_mesh), static=True)
        self._bodies = [(ids.body_ball, "/world/ball")]
        for body in range(1, model.nbody):
            mesh = make_body_mesh(model, body, _VISUAL_GROUP)
            if body == ids.body_ball or mesh is None:
                continue
            path = f"/world/robot/{model.body(body).name}"
            stream.log(path, _to_rerun(mesh), static=True)
            self._bodies.append((body, path))
        for i, colour in enumerate((LEFT, RIGHT)):
            path = f"/world/soles/{('left', 'right')[i]}"
            outline = rr.LineStrips3D(
                [_sole_outline(model, int(ids.geom_soles[i]))],
                colors=[colour],
                radii=[0.0025],
            )
            stream.log(path, outline, static=True)
            self._bodies.append((int(ids.body_feet[i]), path))
        for mark in MARKS:
            points = rr.Points3D.from_fields(colors=mark.colours, radii=[mark.radius])
            stream.log(mark.path, points, static=True)
        for plot in self._plots:
            names, colours = zip(*plot.lines, strict=True)
            lines = rr.SeriesLines(names=names, colors=colours, widths=plot.widths)
            stream.log(plot.path, lines, static=True)
        phases = rr.StateConfiguration(
            values=list(PHASE_COLOURS),
            labels=[name.lower().replace("_", " ") for name in PHASE_COLOURS],
            colors=list(PHASE_COLOURS.values()),
        )
        stream.log(PHASE_PATH, phases, static=True)
        arrows = rr.Arrows3D.from_fields(colors=[(255, 214, 10)], radii=[0.012])
        stream.log("/world/contacts", arrows, static=True)
        text = f"```toml\n{format_config(context.config)}```"
        document = rr.TextDocument(text, media_type="text/markdown")
        stream.log("/config", document, static=True)

    def _send_poses(
        self, stream: rr.RecordingStream, series: RunSeries, ticks: np.ndarray
    ) -> None:
        assert self._context is not None
        assert self._scratch is not None
        model, scratch = self._context.model, self._scratch
        positions = np.empty((len(ticks), model.nbody, 3))
        quaternions = np.empty((len(ticks), model.nbody, 4))
        for i, tick in enumerate(ticks):
            scratch.qpos[:] = series.qpos[tick]
            mujoco.mj_kinematics(model, scratch)
            positions[i], quaternions[i] = scratch.xpos, scratch.xquat
        time = [rr.TimeColumn(_TIMELINE, duration=series.time[ticks])]
        quaternions = quaternions[..., [1, 2, 3, 0]]
        for body, path in self._bodies:
            columns = rr.Transform3D.columns(
                translation=positions[:, body], quaternion=quaternions[:, body]
            )
            stream.send_columns(path, time, columns)
        focus = positions[:, self._context.ids.body_ball].copy()
        for path, height in (
            (FOCUS_PATH, focus_height(self._context)),
            (BALL_TOP_PATH, 2.0 * self._context.config.ball.radius),
        ):
            focus[:, 2] = height
            columns = rr.Transform3D.columns(translation=focus)
            stream.send_columns(path, time, columns)

    def _send_marks(self, stream: rr.RecordingStream, block: Block) -> None:
        for mark in MARKS:
            points = mark.compute(block)  # (n, n_points, 3)
            columns = rr.Points3D.columns(positions=points.reshape(-1, 3))
            lengths = [mark.n_points] * len(points)
            time = [rr.TimeColumn(_TIMELINE, duration=block.slow_time)]
            stream.send_columns(mark.path, time, columns.partition(lengths))

    def _send_contacts(
        self,
        stream: rr.RecordingStream,
        series: RunSeries,
        start: int,
        stop: int,
        ticks: np.ndarray,
    ) -> None:
        assert self._context is not None
        contacts, ids = series.contacts, self._context.ids
        counts = contacts.counts[start:stop]
        first = int(contacts.counts[:start].sum())
        last = first + int(counts.sum())
        tick = np.repeat(np.arange(start, stop), counts)
        is_shown = np.isin(tick, ticks)
        geoms = contacts.geoms[first:last][is_shown]
        forces = contacts.compute_forces(first, last)[is_shown]
        points = contacts.positions[first:last][is_shown]
        # Show the force on the robot; below the ball, that on the ball.
        is_flipped = np.where(
            (geoms == ids.geom_floor).any(axis=1),
            geoms[:, 0] == ids.geom_ball,
            geoms[:, 1] == ids.geom_ball,
        )
        forces[is_flipped] *= -1.0
        shown_counts = np.bincount(tick[is_shown] - start, minlength=stop - start)
        columns = rr.Arrows3D.columns(origins=points, vectors=_FORCE_SCALE * forces)
        lengths = shown_counts[ticks - start]
        time = [rr.TimeColumn(_TIMELINE, duration=series.time[ticks])]
        stream.send_columns("/world/contacts", time, columns.partition(lengths))

    def _send_scalars(
        self,
        stream: rr.RecordingStream,
        path: str,
        time: np.ndarray,
        values: np.ndarray,
    ) -> None:
        columns = rr.Scalars.columns(scalars=values.ravel())
        lengths = [values.shape[1]] * len(values)
        indexes = [rr.TimeColumn(_TIMELINE, duration=time)]
        stream.send_columns(path, indexes, columns.partition(lengths))

    def _send_phases(self, stream: rr.RecordingStream, block: Block) -> None:
        for tick, phase in enumerate(block.phases.tolist()):
            if phase != self._phase:
                self._phase = phase
                stream.set_time(_TIMELINE, duration=float(block.time[tick]))
                change = rr.StateChange(state=GaitPhase(phase).name)
                stream.log(PHASE_PATH, change)


def _sole_outline(model: mujoco.MjModel, geom: int) -> Array:
    """Return the edge of a sole's underside in the foot's frame, closed."""
    x, y, z = model.geom_size[geom]
    corners = np.array([[x, y, -z], [-x, y, -z], [-x, -y, -z], [x, -y, -z], [x, y, -z]])
    matrix = np.zeros(9)
    mujoco.mju_quat2Mat(matrix, model.geom_quat[geom])
    points: Array = corners @ matrix.reshape(3, 3).T + model.geom_pos[geom]
    return points


def _to_rerun(mesh: Mesh) -> rr.Mesh3D:
    return rr.Mesh3D(
        vertex_positions=mesh.vertices,
        vertex_normals=mesh.normals,
        triangle_indices=mesh.triangles,
        vertex_colors=mesh.colours,
    )
