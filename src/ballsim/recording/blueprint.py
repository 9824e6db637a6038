"""How the log looks when it is opened: a tab for each question."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import rerun as rr
import rerun.blueprint as rrb

from ballsim.recording.bounds import BOUNDS, has_bounds
from ballsim.recording.catalogue import make_signals
from ballsim.recording.limits import find_limits
from ballsim.recording.palette import name_joint_colours
from ballsim.recording.paths import (
    BALL_TOP_PATH,
    CONFIG_PATH,
    FOCUS_PATH,
    SPEED_PATH,
)
from ballsim.recording.recorder import RunContext
from ballsim.recording.views import (
    make_events_view,
    make_gait_view,
    make_scene_view,
    make_top_view,
)

__all__ = ["TABS", "find_joint_groups", "make_blueprint"]

TABS = (
    "overview",
    "estimation",
    "contacts and forces",
    "joints",
    "sensors",
    "performance",
    "configuration",
)

# Lines are made for a dark ground; in a browser the viewer may be bright.
_PLOT_BACKGROUND = rrb.archetypes.PlotBackground(color=(16, 18, 22))
_LONGEST_KEY = 4  # joints whose colours have room in a title
_ROOM = 1.1  # around what a plot is to show
# Three sigma and half as much again, once the tilt is known; other sensors: all.
_ERROR_REACH = {
    ("ideal", "roll"): 0.004,  # [rad]
    ("ideal", "forward"): 0.005,  # of the CoM, [m]
    ("high", "roll"): 0.004,
    ("high", "forward"): 0.005,
    ("mid", "roll"): 0.009,
    ("mid", "forward"): 0.011,
}


def make_blueprint(
    context: RunContext, active_tab: str = TABS[0], is_live: bool = False
) -> rrb.Blueprint:
    """Lay out the views.

    Args:
        context: What does not change during the run.
        active_tab: Which tab is shown at first.
        is_live: True to follow a run that goes on.
    """
    page = _Pages(context)
    tabs = (
        page.overview(),
        page.estimation(),
        page.contacts(),
        page.joints(),
        page.sensors(),
        page.performance(),
        rrb.TextDocumentView(origin=CONFIG_PATH, name=TABS[6]),
    )
    return rrb.Blueprint(
        rrb.Tabs(*tabs, active_tab=TABS.index(active_tab)),
        rrb.TimePanel(
            state="collapsed",
            timeline="sim_time",
            play_state="following" if is_live else None,
        ),
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
        auto_views=False,
    )


class _Pages:
    """The tabs of a run.

    Args:
        context: What does not change during the run.
    """

    def __init__(self, context: RunContext) -> None:
        self._context = context
        self._columns = {item.path: item.columns for item in make_signals(context)}
        self._columns |= {item.path: item.columns for item in find_limits(context)}
        self._columns |= {item.path: item.columns for item in BOUNDS}
        # Room for the legends, before the run begins.
        self._axis = rrb.TimeAxis(
            view_range=rrb.TimeRange(
                rrb.TimeRangeBoundary.absolute(seconds=-0.13 * context.config.duration),
                rrb.TimeRangeBoundary.infinite(),
            )
        )

    def overview(self) -> rrb.Horizontal:
        """Return the tab to begin with: robot, CoP on the ball, gait, events."""
        distance = 1.4 + 1.3 * self._context.config.ball.radius
        eye = (distance, -distance, 0.45 * distance)
        scene = make_scene_view("robot and ball", FOCUS_PATH, eye, hidden=("fall",))
        left = rrb.Vertical(scene, make_gait_view(), row_shares=[6.0, 1.0])
        events = make_events_view()
        title = "ball angle [rad]: target green, reference blue, truth white"
        angle = self.lines(
            title, {"/truth/ball/angle": ("forward",), "/control/ball/angle": None}
        )
        robot = self._context.robot
        # As far as soles reach: in a fall the ideal CoP is metres off.
        reach = _ROOM * robot.sole_half_length
        reach_left = _ROOM * (robot.stance_half_width + robot.sole_half_width)
        cop = (
            self.plot_cop("CoP forwards", "forward", reach),
            self.plot_cop("CoP to the left", "left", reach_left),
        )
        right = rrb.Vertical(
            rrb.Horizontal(make_top_view(), events, column_shares=[1.0, 1.0]),
            angle,
            *cop,
            row_shares=[1.7, 1.0, 1.0, 1.0],
        )
        return rrb.Horizontal(left, right, column_shares=[1.0, 1.1], name=TABS[0])

    def estimation(self) -> rrb.Horizontal:
        """Return the tab that holds the estimate against the truth."""
        left = (
            self.plot("ball angle, forwards [rad]", "ball/angle", "forward"),
            self.plot("ball angle, to the left [rad]", "ball/angle", "left"),
            self.plot("ball rate, forwards [rad/s]", "ball/rate", "forward"),
            self.plot_errors(
                "ball angle [rad]: forwards red, to the left teal",
                "angles",
                ("ball_forward", "ball_left"),
            ),
        )
        middle = (
            self.plot("CoM from the ball, forwards [m]", "com/position", "forward"),
            self.plot("CoM from the ball, to the left [m]", "com/position", "left"),
            self.plot("CoM velocity, forwards [m/s]", "com/velocity", "forward"),
            self.plot_errors(
                "CoM [m]: forwards red, to the left teal", "com", ("forward", "left")
            ),
        )
        right = (
            self.plot("trunk pitch [rad]", "trunk/attitude", "pitch"),
            self.plot("trunk roll [rad]", "trunk/attitude", "roll"),
            self.plot("CoP, forwards [m]", "cop", "forward"),
            self.plot("CoP, to the left [m]", "cop", "left"),
            self.plot_errors(
                "trunk [rad]: roll orange, pitch white", "angles", ("roll", "pitch")
            ),
        )
        columns = [rrb.Vertical(*views) for views in (left, middle, right)]
        return rrb.Horizontal(*columns, name=TABS[1])

    def contacts(self) -> rrb.Horizontal:
        """Return the tab of the feet: forces, soles, footsteps."""
        above = make_scene_view(
            "feet from above: footprints, targets, landings, CoP",
            BALL_TOP_PATH,
            (0.0, 0.0, 0.55),
            up=(1.0, 0.0, 0.0),
            hidden=("robot", "com", "contacts"),
        )
        behind = make_scene_view(
            "contact forces and CoM from behind",
            BALL_TOP_PATH,
            (-1.9, 0.0, 0.45),
            target=(0.0, 0.0, 0.45),
            hidden=("robot", "targets", "landings", "fall"),
        )
        forces = {"/truth/foot_forces": None, "/estimate/foot_forces": None}
        soles = {
            axis: dict.fromkeys(
                ("/truth/soles", "/control/soles"), (f"left_{axis}", f"right_{axis}")
            )
            for axis in ("forward", "left", "up")
        }
        plots = (
            self.lines("foot forces [N]", forces),
            self.lines(
                "soles forwards [m]: left red, right teal, targets wide",
                soles["forward"],
                2.0 * _ROOM * self._context.robot.sole_half_length,
            ),
            self.lines("soles to the left [m]", soles["left"]),
            self.lines("soles upwards [m]", soles["up"]),
            make_gait_view(),
        )
        return rrb.Horizontal(
            rrb.Vertical(above, behind),
            rrb.Vertical(*plots, row_shares=[3.0, 3.0, 3.0, 3.0, 1.6]),
            column_shares=[1.0, 1.4],
            name=TABS[2],
        )

    def joints(self) -> rrb.Horizontal:
        """Return the tab of the joints: angles and torques, with their limits."""
        columns = []
        for groups in find_joint_groups(self._context):
            views = [
                self._plot_joints(group, names, what)
                for what in ("position", "torque")
                for group, names in groups.items()
            ]
            columns.append(rrb.Vertical(*views))
        return rrb.Horizontal(*columns, name=TABS[3])

    def _plot_joints(
        self, group: str, names: Sequence[str], what: str
    ) -> rrb.TimeSeriesView:
        """Return a plot of position or torque of some joints, with their limits.

        The colours stand in the titles: one half of a long key above, one below.
        """
        ends = [f"{name}_{end}" for name in names for end in ("low", "high")]
        shown = {f"/truth/joints/{what}": names, f"/limits/joints/{what}": ends}
        key = [self._name_joint(name, group) for name in names]
        if len(key) > _LONGEST_KEY:
            half = len(key) // 2
            key = key[:half] if what == "position" else key[half:]
        title = {"position": "angles [rad]", "torque": "torques [N m]"}[what]
        return self.lines(f"{group}, {title}: {', '.join(key)}", shown)

    def _name_joint(self, name: str, group: str) -> str:
        """Return name and colour of a joint of a group, for a title."""
        joints = self._context.ids.joint_names
        colour = name_joint_colours(len(joints))[joints.index(name)]
        side = group.split(maxsplit=1)[0]
        return f"{name.removeprefix(f'{side}_').replace('_', ' ')} {colour}"

    def sensors(self) -> rrb.Horizontal:
        """Return the tab of what the controller is given."""
        left = (
            self.lines("gyro on the trunk [rad/s]", {"/sensors/imu/gyro": None}),
            self.lines("accelerometer [m/s2]", {"/sensors/imu/accelerometer": None}),
            self.lines("gyro in the ball [rad/s]", {"/sensors/ball/gyro": None}),
        )
        forces, torques = (
            [
                self.lines(
                    f"ankle {what}, {axis} [{unit}]: left red, right teal",
                    {f"/sensors/feet/{what}": (f"left_{axis}", f"right_{axis}")},
                )
                for axis in "xyz"
            ]
            for what, unit in (("force", "N"), ("torque", "N m"))
        )
        columns = [rrb.Vertical(*views) for views in (left, forces, torques)]
        return rrb.Horizontal(*columns, name=TABS[4])

    def performance(self) -> rrb.Vertical:
        """Return the tab that tells how fast the loop was."""
        name = "simulated time by wall-clock time [x real time]"
        speed = rrb.TimeSeriesView(origin=SPEED_PATH, name=name, axis_x=self._axis)
        events = make_events_view()
        views = (speed, make_gait_view(), events)
        return rrb.Vertical(*views, row_shares=[3.0, 1.0, 2.0], name=TABS[5])

    def plot(self, title: str, leaf: str, column: str) -> rrb.TimeSeriesView:
        """Return a plot of a component: truth and estimate."""
        lines = {f"/{kind}/{leaf}": (column,) for kind in ("truth", "estimate")}
        return self.lines(f"{title}: estimate orange, truth white", lines)

    def plot_errors(
        self, title: str, leaf: str, columns: Sequence[str]
    ) -> rrb.TimeSeriesView:
        """Return a plot of errors of the estimate, with their bounds."""
        ends = [f"{name}_{end}" for name in columns for end in ("low", "high")]
        shown = {f"/estimate/error/{leaf}": columns}
        if has_bounds(self._context.config):
            shown[f"/limits/estimate/{leaf}"] = ends
            title = f"{title}; thin: three sigma"
        # What is unknown when the sensors are switched on would hide the rest.
        reach = _ERROR_REACH.get((self._context.config.sensors.preset, columns[0]))
        return self.lines(f"errors: {title}", shown, reach)

    def plot_cop(self, title: str, column: str, reach: float) -> rrb.TimeSeriesView:
        """Return a plot of ideal and actual CoP along an axis."""
        title = f"{title} of the ball's centre [m]: ideal blue, actual white"
        lines = {"/truth/cop": (column,), "/control/cop": (f"ideal_{column}",)}
        return self.lines(title, lines, reach)

    def lines(
        self,
        title: str,
        shown: Mapping[str, Sequence[str] | None],
        reach: float | None = None,
    ) -> rrb.TimeSeriesView:
        """Return a plot of some components of some signals.

        Args:
            title: Title with the unit.
            shown: Components by path, None for all of them.
            reach: Greatest magnitude that is shown at first, None for what there is.
        """
        axis = None if reach is None else rrb.ScalarAxis(range=(-reach, reach))
        overrides: dict[Any, Any] = {
            path: rr.SeriesLines.from_fields(
                visible_series=[name in columns for name in self._columns[path]]
            )
            for path, columns in shown.items()
            if columns is not None
        }
        return rrb.TimeSeriesView(
            origin="/",
            contents=[f"+ {path}" for path in shown],
            name=title,
            # A legend would list the components that are hidden, too.
            plot_legend=rrb.PlotLegend(rrb.Corner2D.LeftTop, visible=not overrides),
            axis_x=self._axis,
            axis_y=axis,
            background=_PLOT_BACKGROUND,
            overrides=overrides,
        )


def find_joint_groups(context: RunContext) -> list[dict[str, list[str]]]:
    """Return the names of the joints of each leg and of the rest, column by column.

    Args:
        context: What does not change during the run.
    """
    names = context.ids.joint_names
    legs = [set(leg.joints) for leg in context.robot.legs]
    rest = [n for n in names if not any(n in leg for leg in legs)]
    sides = {
        f"{side} arm": [name for name in rest if name.startswith(f"{side}_")]
        for side in ("left", "right")
    }
    middle = [name for name in rest if not name.startswith(("left_", "right_"))]
    columns = [
        {"left leg": [name for name in names if name in legs[0]]},
        {"right leg": [name for name in names if name in legs[1]]},
        {**sides, "trunk": middle},
    ]
    columns = [
        {group: members for group, members in column.items() if members}
        for column in columns
    ]
    return [column for column in columns if column]
