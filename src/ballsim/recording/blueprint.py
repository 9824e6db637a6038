"""How the log looks when it is opened: 3-D view left, plots right."""

from __future__ import annotations

import rerun.blueprint as rrb

from ballsim.recording.plots import PHASE_PATH, Plot
from ballsim.recording.recorder import RunContext

__all__ = ["BALL_TOP_PATH", "FOCUS_PATH", "focus_height", "make_blueprint"]

FOCUS_PATH = "/world/focus"  # follows the ball; what the camera looks at
BALL_TOP_PATH = "/world/ball_top"  # likewise, for the view from above

_BALANCE = ("ball_angle", "cop_forward", "cop_left", "normal_forces")
_STATE = ("ball_speed", "ball_lateral", "com_forward", "com_left", "trunk_tilt")
_JOINTS = ("torques_left_leg", "torques_right_leg", "torques_upper_body")
_SENSORS = ("angular_velocity_imu", "acceleration_imu", "angular_velocity_ball")


def make_blueprint(context: RunContext, plots: tuple[Plot, ...]) -> rrb.Blueprint:
    """Lay out the views.

    Args:
        context: What does not change during the run.
        plots: All plots.
    """
    by_name = {plot.path.rsplit("/", 1)[1]: plot for plot in plots}

    def page(title: str, names: tuple[str, ...], *more: rrb.View) -> rrb.Vertical:
        views = [_make_view(by_name[name]) for name in names if name in by_name]
        shares = [3.0] * len(views) + [1.3] * len(more)
        return rrb.Vertical(*views, *more, name=title, row_shares=shares)

    top = 2.0 * context.config.ball.radius
    scene = rrb.Spatial3DView(
        origin="/world",
        name="world",
        background=(44, 50, 58),
        line_grid=False,
        eye_controls=rrb.EyeControls3D(
            position=(1.6 + 0.7 * top, -1.6 - 0.7 * top, top + 1.0),
            look_target=(0.0, 0.0, focus_height(context)),
            eye_up=(0.0, 0.0, 1.0),
            tracking_entity=FOCUS_PATH,
        ),
    )
    feet = rrb.Spatial3DView(
        origin="/world",
        contents=[
            "+ $origin/**",
            "- /world/robot/**",
            "- /world/com/**",
            "- /world/contacts/**",
        ],
        name="feet from above",
        background=(44, 50, 58),
        line_grid=False,
        eye_controls=rrb.EyeControls3D(
            position=(0.0, 0.0, top + 0.36),
            look_target=(0.0, 0.0, top),
            eye_up=(1.0, 0.0, 0.0),
            tracking_entity=BALL_TOP_PATH,
        ),
    )
    gait = rrb.StateTimelineView(origin=PHASE_PATH, name="gait phase")
    config = rrb.TextDocumentView(origin="/config", name="configuration")
    pages = rrb.Tabs(
        page("balance", _BALANCE, gait),
        page("state", _STATE),
        page("torques", _JOINTS),
        page("sensors", _SENSORS),
        config,
        active_tab=0,
    )
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(scene, feet, row_shares=[2.4, 1.0]),
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


def _make_view(plot: Plot) -> rrb.TimeSeriesView:
    legend = rrb.PlotLegend(corner=rrb.Corner2D.RightTop)
    return rrb.TimeSeriesView(origin=plot.path, name=plot.title, plot_legend=legend)
