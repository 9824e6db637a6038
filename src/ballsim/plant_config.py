"""Configuration of what is simulated: ball, robot, drives, contacts, pushes."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ballsim.errors import ConfigError
from ballsim.settings import Choice, Number, Text, check_table, setting

__all__ = ["BallConfig", "DrivesConfig", "PushConfig", "RobotConfig", "SceneTable"]

_HOLLOW_FACTOR = 2.0 / 3.0  # thin shell: the largest that a ball can have
_SOLID_FACTOR = 2.0 / 5.0
_DEFAULT_INERTIA = 0.5  # [kg m^2]
_MAX_DIRECTION = 6.2832  # a full turn either way, [rad]


@dataclass(frozen=True, slots=True)
class BallConfig:
    """The ball; the defaults are the paper's.

    Attributes:
        radius: Radius r0, [m].
        mass: Mass m0, [kg].
        inertia: Moment of inertia about any axis through the centre, [kg m^2],
            or ``"solid"`` or ``"hollow"`` (thin shell).
        believed_radius_scale: Radius that the controller is told, as a multiple
            of the true one.
        believed_mass_scale: Mass, likewise.
        believed_inertia_scale: Moment of inertia, likewise.
    """

    radius: float = setting(Number(0.1, 5.0, unit="m"), 0.5, "radius_m")
    mass: float = setting(Number(1.0, 1e4, unit="kg"), 40.0, "mass_kg")
    inertia: float | str = setting(
        Number(0.0, is_low_open=True, unit="kg m2", words=("solid", "hollow")),
        _DEFAULT_INERTIA,
        "inertia",
    )
    believed_radius_scale: float = setting(
        Number(0.5, 2.0), 1.0, "believed_radius_scale"
    )
    believed_mass_scale: float = setting(Number(0.1, 10.0), 1.0, "believed_mass_scale")
    believed_inertia_scale: float = setting(
        Number(0.1, 10.0), 1.0, "believed_inertia_scale"
    )

    def __post_init__(self) -> None:
        """Check the fields, and the inertia against mass and radius."""
        check_table(self)
        limit = _HOLLOW_FACTOR * self.mass * self.radius**2
        if isinstance(self.inertia, str) or self.inertia <= limit * (1 + 1e-9):
            return
        if self.inertia != _DEFAULT_INERTIA:
            valid = (
                f"at most {limit:.3g} kg m2 (a thin shell) for radius_m = "
                f"{self.radius:g} and mass_kg = {self.mass:g}, or 'solid' or 'hollow'"
            )
            raise ConfigError("inertia", self.inertia, valid)
        least = self.radius * math.sqrt(self.inertia / limit)
        valid = (
            f"at least {least:.3g} m (a thin shell) for inertia = {self.inertia:g} "
            f"and mass_kg = {self.mass:g}, or set inertia to 'solid' or 'hollow'"
        )
        raise ConfigError("radius_m", self.radius, valid)

    @property
    def moment_of_inertia(self) -> float:
        """Return the moment of inertia, [kg m^2]."""
        if not isinstance(self.inertia, str):
            return self.inertia
        factor = _SOLID_FACTOR if self.inertia == "solid" else _HOLLOW_FACTOR
        return factor * self.mass * self.radius**2


@dataclass(frozen=True, slots=True)
class SceneTable:
    """Contact and integration; explained at `ballsim.scene.SceneConfig`.

    Attributes:
        sole_friction: Coulomb friction of a sole on whatever it touches.
        floor_friction: Coulomb friction of the ball on the floor.
        torsional_friction: Torsional friction of both contacts, [m].
        rolling_friction: Rolling friction of both contacts, [m].
        timestep: Time of one physics step, [s].
        integrator: MuJoCo's integrator.
        cone: Friction cone.
        impratio: Ratio of frictional to normal constraint impedance.
        contact_time_constant: Time constant of the contacts, [s].
    """

    sole_friction: float = setting(Number(0.0, 10.0), 1.0, "sole_friction")
    floor_friction: float = setting(Number(0.0, 10.0), 1.0, "floor_friction")
    torsional_friction: float = setting(
        Number(0.0, 1.0, unit="m"), 0.02, "torsional_friction_m"
    )
    rolling_friction: float = setting(
        Number(0.0, 1.0, unit="m"), 0.0, "rolling_friction_m"
    )
    timestep: float = setting(Number(1e-5, 0.01, unit="s"), 0.001, "timestep_s")
    integrator: str = setting(
        Choice(("Euler", "implicit", "implicitfast", "RK4")),
        "implicitfast",
        "integrator",
    )
    cone: str = setting(Choice(("elliptic", "pyramidal")), "elliptic", "cone")
    impratio: float = setting(Number(0.01, 1000.0), 10.0, "impratio")
    contact_time_constant: float = setting(
        Number(2e-5, 1.0, unit="s"), 0.005, "contact_time_constant_s"
    )

    def __post_init__(self) -> None:
        """Check the fields, and the contacts against the time step."""
        check_table(self)
        if self.contact_time_constant < 2.0 * self.timestep:
            valid = f"at least two time steps, {2.0 * self.timestep:g} s"
            key, value = "contact_time_constant_s", self.contact_time_constant
            raise ConfigError(key, value, valid)


@dataclass(frozen=True, slots=True)
class RobotConfig:
    """The robot, and how it differs from what its controller is told.

    The start is that of the nominal robot: whoever places it knows no more than its
    controller.

    Attributes:
        name: Folder of the robot under ``models/``.
        mass_scale: Factor on all masses and moments of inertia.
        com_offset_x: How far the CoM of the whole robot is moved, forwards in the
            frame of the trunk, [m]; the trunk's own CoM is moved for it.
        com_offset_y: To the left, [m].
        com_offset_z: Upwards, [m].
    """

    name: str = setting(Text(), "biped", "name")
    mass_scale: float = setting(Number(0.1, 10.0), 1.0, "mass_scale")
    com_offset_x: float = setting(Number(-0.5, 0.5, unit="m"), 0.0, "com_offset_x_m")
    com_offset_y: float = setting(Number(-0.5, 0.5, unit="m"), 0.0, "com_offset_y_m")
    com_offset_z: float = setting(Number(-0.5, 0.5, unit="m"), 0.0, "com_offset_z_m")

    def __post_init__(self) -> None:
        """Check the fields."""
        check_table(self)


@dataclass(frozen=True, slots=True)
class DrivesConfig:
    """The joint drives.

    Attributes:
        delay: Time from a set-point's being sent to its acting, [s], a multiple of
            the physics step. Until the first one arrives it acts already: the
            robot was held with it.
    """

    delay: float = setting(Number(0.0, 1.0, unit="s"), 0.0, "delay_s")

    def __post_init__(self) -> None:
        """Check the fields."""
        check_table(self)


@dataclass(frozen=True, slots=True)
class PushConfig:
    """A horizontal force on a body for a while.

    Attributes:
        time: When it begins, [s], a multiple of the control period.
        time_spread: It begins so much later at most, [s]: the run's seed draws by how
            much, so that pushes meet the gait at any phase.
        duration: How long it lasts, [s], likewise.
        body: Body that it acts on: ``ball`` or one of the robot.
        direction: Its direction in the robot's heading at the start: 0 forwards,
            pi/2 to the left, [rad].
        force: Its size, [N].
        height: Height of the point that it acts on above the body's CoM, [m].
    """

    time: float = setting(Number(0.0, 1e6, unit="s"), 3.0, "time_s")
    time_spread: float = setting(Number(0.0, 1e6, unit="s"), 0.0, "time_spread_s")
    duration: float = setting(Number(0.0, 1e6, unit="s"), 0.1, "duration_s")
    body: str = setting(Text(), "trunk", "body")
    direction: float = setting(
        Number(-_MAX_DIRECTION, _MAX_DIRECTION, unit="rad"), 0.0, "direction_rad"
    )
    force: float = setting(Number(0.0, 1e5, unit="N"), 0.0, "force_n")
    height: float = setting(Number(-2.0, 2.0, unit="m"), 0.0, "height_m")

    def __post_init__(self) -> None:
        """Check the fields."""
        check_table(self)
