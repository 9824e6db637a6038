"""How the log looks when it is opened: 3-D views left, pages of plots right."""

from __future__ import annotations

import rerun.blueprint as rrb

from ballsim.recording.plots import PHASE_PATH, Plot
from ballsim.recording.recorder import RunContext

__all__ = ["BALL_TOP_PATH", "FOCUS_PATH", "focus_height", "make_blueprint"]

# Frames that follow the ball. The views have them as origins, which keeps the ball in
# the middle; an eye that tracks an entity would do so from the first mouse drag only.
FOCUS_PATH = "/world/focus"
BALL_TOP_PATH = "/world/ball_top"

Point = tuple[float, float, float]

_BACKGROUND = (44, 50, 58)
_BALANCE = ("ball_angle", "cop_forward", "cop_left")
_FEET = ("normal_forces", "soles_forward", "soles_left")
_STATE = ("ball_speed", "ball_lateral", "com_forward", "com_left", "trunk_tilt")
_JOINTS = ("torques_left_leg", "torques_right_leg", "torques_upper_body")
_SENSORS = ("angular_velocity_imu", "acceleration_imu", "angular_velocity_ball")


def make_blueprint(context: RunContext, plots: tuple[Plot, ...]) -> rrb.Blueprint:
    """Lay out the views.

    Args:
        context: What does not change during the run.
        plots: All plots.
    """
    # Room for the legends, before the run begins.
    axis = rrb.TimeAxis(
        view_range=rrb.TimeRange(
            rrb.TimeRangeBoundary.absolute(seconds=-0.13 * context.config.duration),
            rrb.TimeRangeBoundary.infinite(),
        )
    )
    by_name = {plot.path.rsplit("/", 1)[1]: plot for plot in plots}

    def page(title: str, names: tuple[str, ...], *more: rrb.View) -> rrb.Vertical:
        views = [_make_view(by_name[name], axis) for name in names if name in by_name]
        shares = [3.0] * len(views) + [1.3] * len(more)
        return rrb.Vertical(*views, *more, name=title, row_shares=shares)

    def gait() -> rrb.StateTimelineView:
        name = "gait phase: red left support, teal right support, grey both"
        return rrb.StateTimelineView(origin=PHASE_PATH, name=name)

    distance = 1.4 + 1.3 * context.config.ball.radius
    scene = _make_scene_view(
        "robot and ball", FOCUS_PATH, (distance, -distance, 0.45 * distance)
    )
    feet = _make_scene_view(
        "feet from above: CoP and foot targets",
        BALL_TOP_PATH,
        (0.0, 0.0, 0.36),
        up=(1.0, 0.0, 0.0),
        hidden=("robot", "com", "contacts"),
    )
    forces = _make_scene_view(
        "contact forces and CoM from behind",
        BALL_TOP_PATH,
        (-1.9, 0.0, 0.45),
        target=(0.0, 0.0, 0.45),
        hidden=("robot", "targets"),
    )
    config = rrb.TextDocumentView(origin="/config", name="configuration")
    pages = rrb.Tabs(
        page("balance", _BALANCE, gait()),
        page("feet", _FEET, gait()),
        page("state", _STATE),
        page("torques", _JOINTS),
        page("sensors", _SENSORS),
        config,
        active_tab=0,
    )
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(scene, rrb.Horizontal(feet, forces), row_shares=[2.2, 1.0]),
            pages,
            column_shares=[1.0, 1.1],
        ),
        rrb.TimePanel(state="collapsed", timeline="sim_time"),
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
        auto_views=False,
    )


def focus_height(context: RunContext) -> float:
    """Return the height that the camera looks at, [m].

    Args:
        context: What does not change during the run.
    """
    return context.config.ball.radius + 0.7  # middle of ball and robot


def _make_scene_view(
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


def _make_view(plot: Plot, axis: rrb.TimeAxis) -> rrb.TimeSeriesView:
    legend = rrb.PlotLegend(corner=rrb.Corner2D.LeftTop)
    return rrb.TimeSeriesView(
        origin=plot.path, name=plot.title, plot_legend=legend, axis_x=axis
    )
