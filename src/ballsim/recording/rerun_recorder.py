"""Writes a run to a rerun recording while it goes on.

Blocks of rows are sent as columns: logging tick by tick costs a hundred times as
much in Python.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import mujoco
import numpy as np
import numpy.typing as npt
import rerun as rr

from ballsim.config_io import format_config
from ballsim.recording.block import Block, compute_block
from ballsim.recording.blueprint import (
    BALL_TOP_PATH,
    FOCUS_PATH,
    focus_height,
    make_blueprint,
)
from ballsim.recording.columns import make_scalars, make_texts, make_vectors
from ballsim.recording.marks import MARKS
from ballsim.recording.meshes import (
    Mesh,
    make_ball_mesh,
    make_body_mesh,
    make_floor_mesh,
)
from ballsim.recording.palette import LEFT, PUSH, RIGHT
from ballsim.recording.plots import PHASE_COLOURS, PHASE_PATH, Plot, make_plots
from ballsim.recording.push_arrows import compute_push_arrows
from ballsim.recording.recorder import RunBlock, RunContext
from ballsim_controllers.messages import Array, GaitPhase
from ballsim_controllers.sensor_names import name_sensors

__all__ = ["RerunRecorder"]

_POSE_PERIOD = 0.01  # time between two poses in the 3-D view, [s]
_VISUAL_GROUP = 2
_TIMELINE = "sim_time"
_FORCE_SCALE = 1.2e-3  # length of an arrow for each newton, [m/N]
_PUSH_SCALE = 5e-3  # the same for pushes, which are weaker, [m/N]

# The index of a recording is kept in memory until its end: 25 MB for two minutes. A
# longer one has none: `rerun rrd optimize` makes it, the viewer does without.
_INDEXED_DURATION = 120.0  # [s]

# Rerun's writer is a thread beside ours. A run that is killed loses the block that
# is being filled, and what came in since the writer woke up last.
_WRITER_PERIOD = 0.005  # [s]
_BLOCKS_BETWEEN_WAITS = 25  # or all of a run could queue up in memory
_FLUSH_TIMEOUT = 10.0  # [s]

_TRANSLATION = rr.Transform3D.descriptor_translation()
_QUATERNION = rr.Transform3D.descriptor_quaternion()
_POSITIONS = rr.Points3D.descriptor_positions()
_ORIGINS = rr.Arrows3D.descriptor_origins()
_VECTORS = rr.Arrows3D.descriptor_vectors()
_TEXT = rr.TextLog.descriptor_text()
_STATE = rr.StateChange.descriptor_state()


class RerunRecorder:
    """Streams a run into an .rrd file that is readable up to a crash.

    Args:
        path: The file; replaced if it exists.
    """

    def __init__(self, path: Path) -> None:
        """Remember the path; the file is opened by `start`."""
        self._path = path
        self._stream: rr.RecordingStream | None = None
        self._bodies: list[tuple[int, str]] = []
        self._plots: tuple[Plot, ...] = ()
        self._phase, self._ill = -1, 0
        self._n_blocks = 0

    def start(self, context: RunContext) -> None:
        """Open the file and log what does not change."""
        config = context.config
        self._plots = make_plots(context)
        batcher = rr.ChunkBatcherConfig(flush_tick=_WRITER_PERIOD)
        stream = rr.RecordingStream("ballsim", batcher_config=batcher)
        stream.set_log_tick_enabled(False)
        stream.set_log_time_enabled(False)
        stream.save(
            self._path,
            default_blueprint=make_blueprint(context, self._plots),
            write_footer=config.duration <= _INDEXED_DURATION,
        )
        name = f"{config.scenario}, seed {config.seed}, ball {config.ball.radius:g} m"
        stream.send_recording_name(name)
        self._stream = stream
        self._log_static(stream, context)
        stream.flush(timeout_sec=_FLUSH_TIMEOUT)

    def record(self, block: RunBlock) -> None:
        """Send the rows of a block."""
        assert self._stream is not None
        stream = self._stream
        period = block.context.config.simulation.control_period
        shown = compute_block(block, max(1, round(_POSE_PERIOD / period)))
        fast = [rr.TimeColumn(_TIMELINE, duration=shown.time)]
        slow = [rr.TimeColumn(_TIMELINE, duration=shown.slow_time)]
        for path, columns in self._make_poses(block, shown.slow_rows):
            stream.send_columns(path, slow, columns)
        for mark in MARKS:
            column = make_vectors(_POSITIONS, mark.compute(shown))
            stream.send_columns(mark.path, slow, [column])
        stream.send_columns("/world/contacts", slow, _make_contacts(shown))
        if block.series.wrenches is not None:
            columns = _make_pushes(shown, block.scratch)
            stream.send_columns("/world/pushes", slow, columns)
        for plot in self._plots:
            time = slow if plot.is_slow else fast
            stream.send_columns(plot.path, time, make_scalars(plot.compute(shown)))
        self._send_phases(stream, shown)
        self._send_outages(stream, shown)
        self._n_blocks += 1
        if self._n_blocks % _BLOCKS_BETWEEN_WAITS == 0:
            stream.flush(timeout_sec=_FLUSH_TIMEOUT)

    def close(self) -> None:
        """Finish the file.

        Raises:
            RuntimeError: It cannot be written: the disk is full, for instance.
        """
        if self._stream is not None:
            stream, self._stream = self._stream, None
            stream.flush(timeout_sec=_FLUSH_TIMEOUT)
            stream.disconnect()

    def _send_outages(self, stream: rr.RecordingStream, shown: Block) -> None:
        """Log a line wherever the set of sensors that are not used changes."""
        ill = shown.telemetry.ill_sensors
        if not ill.any() and self._ill == 0:
            return
        before = np.concatenate(([self._ill], ill[:-1]))
        rows = np.flatnonzero(ill != before)
        texts = [
            f"not used: {', '.join(name_sensors(bits)) or 'no sensor'}"
            for bits in ill[rows].tolist()
        ]
        self._ill = int(ill[-1])
        if len(rows) > 0:
            times = [rr.TimeColumn(_TIMELINE, duration=shown.time[rows])]
            stream.send_columns("/sensors", times, [make_texts(_TEXT, texts)])

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
        if context.config.pushes:
            arrows = rr.Arrows3D.from_fields(colors=[PUSH], radii=[0.015])
            stream.log("/world/pushes", arrows, static=True)
        text = f"```toml\n{format_config(context.config)}```"
        document = rr.TextDocument(text, media_type="text/markdown")
        stream.log("/config", document, static=True)

    def _make_poses(
        self, block: RunBlock, rows: npt.NDArray[np.int_]
    ) -> Iterator[tuple[str, list[rr.ComponentColumn]]]:
        """Yield the path and the pose of everything that moves in the 3-D view."""
        context, scratch = block.context, block.scratch
        model, n, qpos = context.model, len(rows), block.series.qpos
        # Columns of one body are contiguous: they are sent without a copy.
        positions = np.empty((model.nbody, n, 1, 3), np.float32)
        quaternions = np.empty((model.nbody, n, 1, 4), np.float32)
        for i, row in enumerate(rows.tolist()):
            scratch.qpos[:] = qpos[row]
            mujoco.mj_kinematics(model, scratch)
            positions[:, i, 0], quaternions[:, i, 0] = scratch.xpos, scratch.xquat
        quaternions = np.roll(quaternions, -1, axis=-1)  # x, y, z, w
        for body, path in self._bodies:
            yield (
                path,
                [
                    make_vectors(_TRANSLATION, positions[body]),
                    make_vectors(_QUATERNION, quaternions[body]),
                ],
            )
        # What has been sent is not copied: it must not change any more.
        focus = positions[context.ids.body_ball].copy()
        for path, height in (
            (FOCUS_PATH, focus_height(context)),
            (BALL_TOP_PATH, 2.0 * context.config.ball.radius),
        ):
            focus[..., 2] = height
            yield path, [make_vectors(_TRANSLATION, focus.copy())]

    def _send_phases(self, stream: rr.RecordingStream, block: Block) -> None:
        phases = block.telemetry.phase
        before = np.concatenate([[self._phase], phases[:-1]])
        rows = np.flatnonzero(phases != before)
        self._phase = int(phases[-1])
        if rows.size > 0:
            time = [rr.TimeColumn(_TIMELINE, duration=block.time[rows])]
            names = [GaitPhase(phase).name for phase in phases[rows].tolist()]
            stream.send_columns(PHASE_PATH, time, [make_texts(_STATE, names)])


def _make_contacts(block: Block) -> list[rr.ComponentColumn]:
    """Return the contact forces at the slow rows, as arrows."""
    contacts, ids = block.series.contacts, block.context.ids
    rows = np.repeat(np.arange(block.series.n_ticks), contacts.counts)
    is_slow = np.zeros(block.series.n_ticks, np.bool_)
    is_slow[block.slow_rows] = True
    is_shown = is_slow[rows]
    geoms = contacts.geoms[is_shown]
    forces = contacts.compute_forces()[is_shown]
    # Show the force on the robot; below the ball, that on the ball.
    is_flipped = np.where(
        (geoms == ids.geom_floor).any(axis=1),
        geoms[:, 0] == ids.geom_ball,
        geoms[:, 1] == ids.geom_ball,
    )
    forces[is_flipped] *= -1.0
    counts = contacts.counts[block.slow_rows]
    return [
        make_vectors(_ORIGINS, contacts.positions[is_shown], counts),
        make_vectors(_VECTORS, _FORCE_SCALE * forces, counts),
    ]


def _make_pushes(block: Block, scratch: mujoco.MjData) -> list[rr.ComponentColumn]:
    """Return the pushes at the slow rows, as arrows that end where they act."""
    points, forces, counts = compute_push_arrows(block, scratch)
    vectors = _PUSH_SCALE * forces
    return [
        make_vectors(_ORIGINS, points - vectors, counts),
        make_vectors(_VECTORS, vectors, counts),
    ]


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
