"""Views of the log that are no plots."""

from __future__ import annotations

import rerun.blueprint as rrb

from ballsim.recording.paths import EVENTS_PATH, PHASE_PATH, TOP_PATH
from ballsim.recording.tracks import TIMELINE

__all__ = ["make_events_view", "make_gait_view", "make_scene_view", "make_top_view"]

Point = tuple[float, float, float]

_BACKGROUND = (44, 50, 58)
_TOP_SIZE = 230.0  # half of what the view from above shows, [mm]


def make_events_view() -> rrb.TextLogView:
    """Return the list of events."""
    columns = rrb.TextLogColumns(
        timeline_columns=[rrb.encodings.TimelineColumn(TIMELINE)],
        text_log_columns=[
            rrb.encodings.TextLogColumn("LogLevel"),
            rrb.encodings.TextLogColumn("Body"),
        ],
    )
    return rrb.TextLogView(origin=EVENTS_PATH, name="events", columns=columns)


def make_gait_view() -> rrb.StateTimelineView:
    """Return the phases of the gait over time."""
    name = "gait phase: red left support, teal right support, grey both"
    return rrb.StateTimelineView(origin=PHASE_PATH, name=name)


def make_top_view() -> rrb.Spatial2DView:
    """Return the unrolled top of the ball from above."""
    bounds = rrb.VisualBounds2D(
        x_range=[-_TOP_SIZE, _TOP_SIZE], y_range=[-_TOP_SIZE, _TOP_SIZE]
    )
    return rrb.Spatial2DView(
        origin=TOP_PATH,
        name="ball's top, unrolled: support and CoP (grid 50 mm, forwards up)",
        visual_bounds=bounds,
        background=_BACKGROUND,
    )


def make_scene_view(
    name: str,
    origin: str,
    eye: Point,
    target: Point = (0.0, 0.0, 0.0),
    up: Point = (0.0, 0.0, 1.0),
    hidden: tuple[str, ...] = (),
) -> rrb.Spatial3DView:
    """Return a 3-D view that moves with a frame.

    Args:
        name: Title.
        origin: Path of the frame.
        eye: Position of the eye in the frame, [m].
        target: What it looks at, likewise.
        up: Direction that is up in the picture.
        hidden: Parts of the world that are not shown.
    """
    controls = rrb.EyeControls3D(position=eye, look_target=target, eye_up=up)
    return rrb.Spatial3DView(
        origin=origin,
        contents=["+ /world/**", *(f"- /world/{part}/**" for part in hidden)],
        name=name,
        background=_BACKGROUND,
        line_grid=False,
        eye_controls=controls,
    )
