"""Figures that explain the method rather than reproduce the paper's."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from ballsim.paper.loop import loop_growth
from ballsim.paper.observer_gains import make_balance
from ballsim.paper.parameter_sets import PARAMETER_SETS, RADII
from ballsim.paper.planar_simulation import PlanarRun
from ballsim.paper.point_contact import point_contact_poles
from ballsim.paper.speed_limits import RampRun
from ballsim.paper.style import BALL_LINES
from ballsim.style import COLOURS, REFERENCE, STYLE, make_figure
from ballsim_controllers.balance.paper_controller import PaperBalanceController
from ballsim_controllers.messages import Array
from ballsim_controllers.wheeled_lip import (
    WheeledLipParameters,
    discretise,
    equilibrium_direction,
    held_cop_wheeled_lip,
    wheeled_lip_matrices,
)

__all__ = [
    "draw_delays",
    "draw_feet",
    "draw_modes",
    "draw_point_contact",
    "draw_ramps",
    "draw_step_responses",
    "unstable_modes",
]


def unstable_modes(A: Array) -> list[float]:
    """Return the rates of the growing modes, slow first, [rad/s].

    Args:
        A: State matrix.
    """
    rates = np.linalg.eigvals(A).real
    return sorted(float(rate) for rate in rates if rate > 0.1)


def draw_modes() -> Figure:
    """Draw the two unstable modes over the ball's radius, wheel free and held."""
    radii = np.linspace(0.2, 1.2, 41)
    with matplotlib.rc_context(STYLE):
        figure, ((free, held),) = make_figure(2.6, 1, 2)
        for ax, matrices, title in (
            (free, wheeled_lip_matrices, r"no torque ($\tau_2 = 0$)"),
            (held, held_cop_wheeled_lip, r"contact held ($\ddot\theta_2 = 0$)"),
        ):
            params = [WheeledLipParameters(float(radius)) for radius in radii]
            modes = np.array([unstable_modes(matrices(p).A) for p in params])
            ax.plot(radii, modes[:, 0], "-", color=COLOURS[0], label="slow: the fall")
            fast = "fast: the ball kicked away"
            ax.plot(radii, modes[:, 1], "--", color=COLOURS[1], label=fast)
            for radius in RADII:
                ax.axvline(radius, linestyle=":", **REFERENCE)
            ax.set(title=title, xlabel=r"$r_0$ [m]", ylabel="growth rate [1/s]")
            ax.set_ylim(bottom=0.0)
        held.legend()
        return figure


def draw_step_responses(duration: float = 8.0, dt: float = 0.01) -> Figure:
    """Draw theta_1 and theta_2 after a step of 1 rad, exact and without feet.

    Args:
        duration: End of the time axis, [s].
        dt: Step between points, [s].
    """
    times = np.arange(0.0, duration, dt)
    with matplotlib.rc_context(STYLE):
        figure, ((ball, contact),) = make_figure(2.6, 1, 2)
        for radius, line in BALL_LINES.items():
            params = WheeledLipParameters(radius)
            balance = PaperBalanceController(params)
            (A, B), K = balance.model, balance.gain
            target = B @ K @ equilibrium_direction(params)[:, None]
            step, state, states = discretise(A - B @ K, target, dt), np.zeros(6), []
            for _ in times:
                states.append(state)
                state = step.A @ state + step.B[:, 0]
            first, second = np.array(states).T[:2]
            ball.plot(times, first, label=f"$r_0$ = {radius:g} m", **line)
            contact.plot(times, second, **line)
        ball.set(xlabel="time [s]", ylabel=r"$\theta_1$ [rad]")
        contact.set(xlabel="time [s]", ylabel=r"$\theta_2$ [rad]")
        ball.legend()
        return figure


def draw_feet(run: PlanarRun, last: float) -> Figure:
    """Draw the ideal CoP and both soles on the ball, as they go on.

    Args:
        run: The run.
        last: End of the time axis, [s].
    """
    shown = run.time <= last
    time, half = run.time[shown], run.footsteps.half_angle
    with matplotlib.rc_context(STYLE):
        figure, ((ax,),) = make_figure(3.2)
        for foot, name in enumerate(("foot 1", "foot 2")):
            centre = run.feet[shown, foot]
            is_down = run.swing_feet[shown] != foot
            edges: tuple[Array, Array] = (centre - half, centre + half)
            look: dict[str, Any] = {"color": COLOURS[foot]}
            ax.fill_between(
                time,
                *edges,
                where=is_down,
                alpha=0.3,
                linewidth=0.0,
                label=name,
                **look,
            )
            in_air = np.where(is_down, np.nan, centre)
            ax.plot(time, in_air, ":", label=f"{name} in the air", **look)
        ideal = run.estimates[shown, 1]
        ax.plot(time, ideal, color=COLOURS[3], label=r"ideal CoP $\hat\theta_2$")
        ax.set(xlabel="time [s]", ylabel="angle on the ball [rad]")
        ax.legend(ncols=2)
        return figure


def draw_delays(most: int = 12, dt: float = 1e-3) -> Figure:
    """Draw how the loop grows with a delay of the CoP, plain and mended.

    Args:
        most: Longest delay, in steps.
        dt: Step, [s].
    """
    delays = np.arange(most + 1)
    with matplotlib.rc_context(STYLE):
        figure, (axes,) = make_figure(2.6, 1, 2)
        for ax, is_mended, title in (
            (axes[0], False, "y with the measured CoP"),
            (axes[1], True, "y with the commanded CoP"),
        ):
            for radius, line in BALL_LINES.items():
                plain = make_balance(PARAMETER_SETS["S1"], radius)
                balance = replace(plain, is_commanded_cop_in_output=is_mended)
                growth = [loop_growth(balance, dt, int(ticks)) for ticks in delays]
                ax.plot(
                    1e3 * dt * delays, growth, label=f"$r_0$ = {radius:g} m", **line
                )
            ax.axhline(0.0, **REFERENCE)
            ax.set(title=title, xlabel="delay [ms]", ylabel="growth rate [1/s]")
            ax.set_ylim(-1.5, 4.0)
        axes[1].legend()
        return figure


def draw_ramps(ramps: Mapping[float, RampRun], limits: Mapping[float, float]) -> Figure:
    """Draw how far the CoP falls behind over the reference velocity.

    Args:
        ramps: Runs by the ball's radius, [m].
        limits: Predicted limits by the ball's radius, [rad/s].
    """
    with matplotlib.rc_context(STYLE):
        figure, ((ax,),) = make_figure(2.8)
        for radius, ramp in ramps.items():
            deviation, line = 1e3 * np.abs(ramp.run.deviations), BALL_LINES[radius]
            ax.plot(ramp.speeds, deviation, label=f"$r_0$ = {radius:g} m", **line)
            ax.axvline(limits[radius], linewidth=0.6, **line)
        ax.set(
            xlabel=r"reference velocity $\dot\theta_1^r$ [rad/s]",
            ylabel=r"|actual $-$ ideal $\theta_2$| [mrad]",
            ylim=(0.0, 20.0),
        )
        ax.legend()
        return figure


def draw_point_contact(wheel_radii: Sequence[float] | Array) -> Figure:
    """Draw where the paper's slow poles go on a contact without a moment.

    Args:
        wheel_radii: r1, [m], the paper's last.
    """
    with matplotlib.rc_context(STYLE):
        figure, (axes,) = make_figure(2.4, 1, len(RADII))
        for ax, (radius, line) in zip(axes, BALL_LINES.items(), strict=True):
            for wheel in wheel_radii:
                params = WheeledLipParameters(radius, wheel_radius=float(wheel))
                poles = point_contact_poles(params)
                is_last = wheel == wheel_radii[-1]
                marker, size = ("x", 6.0) if is_last else (".", 2.5)
                look: dict[str, Any] = {"ls": "", "marker": marker, "ms": size}
                ax.plot(poles.real, poles.imag, color=line["color"], **look)
            ax.axvline(0.0, **REFERENCE)
            ax.set(title=f"$r_0$ = {radius:g} m", xlabel="real [1/s]")
            ax.set(xlim=(-8.0, 1.0), ylim=(-2.5, 2.5))
        axes[0].set_ylabel("imaginary [rad/s]")
        return figure
