"""Drives of joints: the forces F(t) of eq. 22.

A joint that has a motor gear is driven at the motor, any other at its own coordinate (yaw, with
clearance). A drive acts on joints of the URDF; joints that close loops follow.
"""

from __future__ import annotations

import math
from abc import ABC
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from jointplay.base.errors import JointplayError, MissingName, require_increasing
from jointplay.base.files import shipped_table
from jointplay.base.schema import (
    Described,
    Family,
    OptionalQuantity,
    Quantity,
    check_fields,
    choice,
    one_of,
    quantity,
    register,
)
from jointplay.physics import kernel

if TYPE_CHECKING:
    from jointplay.model.gear import Gearing
    from jointplay.model.mechanism import Mechanism
    from jointplay.simulation.motion.reference import Motion

FASTEST = 1e9
"""Largest bandwidth of a drive [rad/s]: no step follows it."""
MOST_DAMPED = 1e9
"""Largest damping ratio: beyond it a joint creeps, and far beyond it numbers overflow."""
BANDWIDTH = 100.0
"""Default bandwidth of computed torque [rad/s]: judged; the effect of play on the tool of SO-101,
AR4, UR5 and Panda changes by less than 4 % between 30 and 300."""
MARGIN = 0.5
"""Bandwidth of a drive through teeth, relative to the largest that is stable: the usual gain margin
of 6 dB; of five arms one became unstable at 0.8, none at this."""
PRESCRIBED_ARMATURE = 1e9
"""Armature of a joint with prescribed motion, relative to the inertia that it carries: the joint
departs from the reference by its inverse."""
ENCODERS = ("motor", "link")
"""Where an encoder can sit: before the play of its joint's gear, as in nearly all arms and servos
(the default), or behind it, on the joint."""
SPEEDS = ("exact", "difference")
"""Speeds that the D term of a servo can take; see `Servo.speed`."""


@dataclass(frozen=True)
class JointFriction(Described):
    """Friction Q(qd) of a joint and its gear: Coulomb, viscous, Stribeck, and presliding.

    Q = g(qd) tanh(qd / 1 mrad/s) + viscous qd,
    g(qd) = coulomb + (static - coulomb) exp(-(qd/stribeck_speed)^2), which creeps under any load.
    With `presliding` s it holds at rest, by bristles (LuGre): Q = k z + presliding_damping dz/dt +
    viscous qd, dz/dt = qd - |qd| k z/g(qd), k = static/s. With clearance it acts on the yaw
    coordinate, beside the contact's own friction. References: B. Armstrong-Helouvry et al.,
    Automatica 30 (1994) 1083-1138, for the Stribeck term; C. Canudas de Wit et al., IEEE Trans.
    Automatic Control 40 (1995) 419-425, for the bristles.
    """

    coulomb: Quantity = quantity("N*m", "N", default=0.0, least=0.0, label="Coulomb joint friction")
    """Dry friction [N m, or N for prismatic joints]."""
    viscous: Quantity = quantity(
        "N*m*s/rad", "N*s/m", default=0.0, least=0.0, label="viscous joint friction"
    )
    """Viscous friction [N m s/rad, or N s/m for prismatic joints]."""
    static: OptionalQuantity = quantity(
        "N*m", "N", default=None, least=0.0, label="static joint friction"
    )
    """Friction at breakaway [N m or N]; None: equal to the dry friction."""
    stribeck_speed: Quantity = quantity(
        "rad/s", "m/s", default=0.01, above=0.0, label="Stribeck speed"
    )
    """Speed at which the excess over dry friction has fallen to 1/e [rad/s or m/s]."""
    presliding: Quantity = quantity("rad", "m", default=0.0, least=0.0, label="presliding")
    """Deflection of the bristles at breakaway [rad or m]; 0: no bristles, the joint creeps."""
    presliding_damping: Quantity = quantity(
        "N*m*s/rad", "N*s/m", default=0.0, least=0.0, label="damping of joint friction's bristles"
    )
    """Damping of the bristles [N m s/rad, or N s/m for prismatic joints]."""

    def __post_init__(self) -> None:
        check_fields(self)
        if self.static is not None and self.static < self.coulomb:
            conflict = f"{self.static:g} N m is below the dry friction {self.coulomb:g} N m"
            raise JointplayError(f"static joint friction {conflict}", ("static",))

    @property
    def excess(self) -> float:
        """Static friction beyond dry friction [N m or N]."""
        return 0.0 if self.static is None else self.static - self.coulomb

    def torque(self, speed: np.ndarray) -> np.ndarray:
        """Friction Q of steady motion at `speed` [rad/s or m/s], of any shape [N m or N]."""
        with np.errstate(over="ignore"):  # far above the Stribeck speed the excess is 0
            dry = self.coulomb + self.excess * np.exp(-((speed / self.stribeck_speed) ** 2))
        return dry * np.tanh(speed / kernel.JOINT_FRICTION_SPEED) + self.viscous * speed


def urdf_friction(mechanism: Mechanism) -> dict[str, JointFriction]:
    """Friction of the moving joints in the URDF."""
    entries = mechanism.description.joints
    return {
        name: JointFriction(entries[name].friction, entries[name].damping)
        for name in mechanism.joints
    }


class Drive(Described, ABC):
    """The drive of one joint."""

    selector = ("kind", "kind")

    kind: ClassVar[str]
    """The word that selects this kind of drive."""
    follows: ClassVar[bool]
    """Whether the joint follows the reference motion."""

    def origins(self) -> dict[str, str]:
        """Sources of the numbers that a catalogue gave, by field."""
        return {}


@dataclass(frozen=True)
class ComputedTorque(Drive):
    """Computed torque of the ideal mechanism along the reference, plus PD on the encoder.

    F = tau_ideal(q_r, qd_r, qdd_r) + kp (q_r - q) + kd (qd_r - qd). The encoder of a joint with
    clearance sees the rotation about the bearing's axis (the yaw coordinate). The gains follow from
    the inertia that the ideal mechanism's joint carries at the start of the motion: kp =
    bandwidth^2 M_ii, kd = 2 damping_ratio bandwidth M_ii. The torque includes that for the joint's
    friction.
    """

    kind: ClassVar[str] = "computed-torque"
    follows: ClassVar[bool] = True

    bandwidth: OptionalQuantity = quantity("rad/s", default=None, above=0.0)
    """Closed-loop natural frequency of each axis [rad/s]; if not given, 100 rad/s, or less
    where the encoder sits behind a gear."""
    damping_ratio: Quantity = quantity("", default=1.0, least=0.0, label="damping ratio")
    """Damping ratio of each axis."""
    encoder: str = choice("encoder", ENCODERS, default=ENCODERS[0])
    """Where the encoder sits: on the "motor", before the gear, or on the joint ("link")."""

    def __post_init__(self) -> None:
        check_fields(self)
        for name, most in (("bandwidth", FASTEST), ("damping_ratio", MOST_DAMPED)):
            if (value := getattr(self, name)) is not None and value > most:
                noun = name.replace("_", " ")
                raise JointplayError(f"{noun} must be at most {most:g}, got {value:g}", (name,))

    def through_teeth(self, inertia: float, gear: Gearing | None) -> ComputedTorque:
        """This drive with the bandwidth that the teeth of a gear allow, if none was given.

        A rotor J that turns the `inertia` M of a joint [kg m^2 or kg] through teeth of stiffness k
        and damping c, controlled by the angle of M, has the characteristic equation

            J M s^4 + (J + M) (k + c s) (s^2 + 2 damping_ratio bandwidth s + bandwidth^2) = 0,

        which by Routh's criterion is stable, where c is far below critical, up to a bandwidth of
        c (1/J + 1/M) / (2 damping_ratio), whatever k is: nothing but c takes energy from the
        vibration on the teeth. `MARGIN` of that is taken; without c no bandwidth is stable.
        """
        if self.bandwidth is not None or self.encoder == "motor" or gear is None:
            return self
        if gear.rotor_inertia * inertia * self.damping_ratio * gear.damping == 0.0:
            return self
        decay = gear.damping * (1.0 / gear.rotor_inertia + 1.0 / inertia)
        allowed = MARGIN * decay / (2.0 * self.damping_ratio)
        return replace(self, bandwidth=allowed) if allowed < BANDWIDTH else self


@dataclass(frozen=True)
class Prescribed(Drive):
    """Prescribed (rheonomic) motion: the joint follows the reference, whatever torque that takes.

    Position and speed are those of the reference to 1e-9 of their range; the result's `drive` is
    the torque it took.
    """

    kind: ClassVar[str] = "prescribed"
    follows: ClassVar[bool] = True


@dataclass(frozen=True)
class Torque(Drive):
    """A torque over time: linear between the given points, constant before and after.

    Tabulated at `REFERENCE_NODE_S`: a jump becomes a ramp of that length.
    """

    kind: ClassVar[str] = "torque"
    follows: ClassVar[bool] = False

    times: tuple[float, ...] = quantity("s", label="torque times")
    """Times of the points, increasing [s]."""
    values: tuple[float, ...] = quantity("N*m", "N", label="torque values")
    """Torque at each time [N m, or N for prismatic joints]."""

    def __post_init__(self) -> None:
        check_fields(self)
        if len(self.times) != len(self.values) or not self.times:
            raise JointplayError(
                f"a torque needs as many times as values and at least one, got {len(self.times)} "
                f"and {len(self.values)}"
            )
        require_increasing("torque times", self.times, "s", ("times",))


@dataclass(frozen=True)
class Free(Drive):
    """No drive: nothing acts on the joint but its friction."""

    kind: ClassVar[str] = "free"
    follows: ClassVar[bool] = False


@dataclass(frozen=True, kw_only=True)
class Servo(Drive):
    """A servo: a motor at the voltage that its own position controller sets.

    V = p_gain e + w + d_gain (qd_r - qd), e = <|q_r - q| - dead_band> sgn(q_r - q), saturates at
    the supply's voltage, with q as the encoder reads it, in whole counts of its resolution; the
    integral dw/dt = i_gain e saturates there, too, lest it wind up, and is zero at the start;
    F = k/R (V - k qd_m) on the motor saturates at `effort`, and is reduced by the motor's friction.
    All quantities are referred to the joint's side of its gear, in metres and newtons where it
    slides: the inertia of the armature is the gear's `rotor_inertia`. A joint without gear is moved
    directly, by a motor without inertia.
    """

    kind: ClassVar[str] = "servo"
    follows: ClassVar[bool] = True

    catalogue: str | None = None
    """Name of a servo in the catalogue, whose numbers are taken where none are given here."""
    voltage: Quantity = quantity("V", above=0.0)
    """Voltage of the supply, the largest on the motor [V]."""
    p_gain: Quantity = quantity("V/rad", "V/m", above=0.0, label="P gain")
    """Voltage per error of position beyond the dead band [V/rad or V/m]."""
    i_gain: Quantity = quantity("V/(rad*s)", "V/(m*s)", default=0.0, least=0.0, label="I gain")
    """Rate of voltage per error of position beyond the dead band [V/(rad s) or V/(m s)]."""
    d_gain: Quantity = quantity("V*s/rad", "V*s/m", default=0.0, least=0.0, label="D gain")
    """Voltage per error of speed [V s/rad or V s/m]."""
    speed: str = choice("speed", SPEEDS, default=SPEEDS[0])
    """Speed that the D term takes: the "exact" one, or as in firmware the "difference" of the
    encoder's readings over a period."""
    torque_constant: Quantity = quantity(
        "N*m/A", "N/A", default=None, above=0.0, label="torque constant"
    )
    """Torque or force per current, referred to the joint [N m/A or N/A]; V s/rad or V s/m of
    back-EMF as well."""
    resistance: Quantity = quantity("ohm", default=None, above=0.0)
    """Resistance of the winding [ohm]."""
    friction: Quantity = quantity("N*m", "N", default=None, least=0.0, label="friction of a servo")
    """Dry friction of the motor, referred to the joint [N m or N]; 0 if not given."""
    viscous: Quantity = quantity(
        "N*m*s/rad", "N*s/m", default=None, least=0.0, label="viscous friction"
    )
    """Viscous friction of the motor, referred to the joint [N m s/rad or N s/m]; 0 if not given."""
    presliding: Quantity = quantity("rad", "m", default=0.0, least=0.0, label="presliding")
    """Deflection of the bristles of its dry friction at breakaway [rad or m]; 0: it creeps."""
    presliding_damping: Quantity = quantity(
        "N*m*s/rad", "N*s/m", default=0.0, least=0.0, label="damping of joint friction's bristles"
    )
    """Damping of the bristles [N m s/rad or N s/m]."""
    dead_band: Quantity = quantity("rad", "m", default=0.0, least=0.0, label="dead band")
    """Error of position up to which the P and I terms do not answer [rad or m]."""
    dead_band_counts: Quantity = quantity("", default=0.0, least=0.0, label="dead band in counts")
    """The dead band in counts of the encoder, in place of `dead_band`."""
    resolution: Quantity = quantity(
        "rad", "m", default=0.0, least=0.0, label="resolution of the encoder"
    )
    """Angle or way of the joint in a count of the encoder [rad or m]; 0: it reads exactly."""
    encoder: str = choice("encoder", ENCODERS, default=ENCODERS[0])
    """Where the encoder sits: on the "motor", before the gear, or on the joint ("link")."""
    effort: OptionalQuantity = quantity(
        "N*m", "N", default=None, above=0.0, label="effort of a servo"
    )
    """Largest effort, the back-EMF included [N m or N]; None: no limit."""
    goals: tuple[float, float] | None = quantity("rad", "m", default=None, label="goals of a servo")
    """Lowest and highest position to which the reference is cut [rad or m]; None: no limit."""
    period: OptionalQuantity = quantity("s", default=None, above=0.0, label="period of a servo")
    """Sampling period, over which the voltage is held [s]; continuous if not given."""

    def __post_init__(self) -> None:
        catalogued = {} if self.catalogue is None else _servo(self.catalogue)
        for name, item in catalogued.items():
            if name not in _BESIDE and getattr(self, name) is None:
                object.__setattr__(self, name, item["value"])
        missing = [n for n in ("torque_constant", "resistance") if getattr(self, n) is None]
        if missing:
            raise JointplayError(f"a servo needs {', '.join(missing)}")
        for name in ("friction", "viscous"):
            if getattr(self, name) is None:
                object.__setattr__(self, name, 0.0)
        check_fields(self)
        if self.dead_band_counts and (self.dead_band or not self.resolution):
            raise JointplayError(
                "a dead band in counts needs the encoder's resolution and no dead_band beside it",
                ("dead_band_counts",),
            )
        if self.goals is not None:
            require_increasing("goals of a servo", self.goals, "", ("goals",))
        if self.speed == SPEEDS[1] and self.period is None:
            raise JointplayError("a speed by differences needs a period", ("speed",))

    @classmethod
    def of(cls, name: str, **more: Any) -> Servo:
        """Make a servo of the catalogue, such as ``STS3215``; fields in `more` replace its own."""
        return cls(catalogue=name, **more)

    @staticmethod
    def armature_of(name: str) -> float:
        """Inertia of a catalogued servo's armature, its gear's `rotor_inertia` [kg m^2]."""
        return float(_servo(name)["armature"]["value"])

    def origins(self) -> dict[str, str]:
        catalogued = {} if self.catalogue is None else _servo(self.catalogue)
        return {
            name: str(item["source"])
            for name, item in catalogued.items()
            if name not in _BESIDE and getattr(self, name) == item["value"]
        }

    @staticmethod
    def gains_of(
        name: str, voltage: float, registers: Mapping[str, float]
    ) -> tuple[dict[str, float], list[str]]:
        """Gains that the registers of a catalogued servo set, and a note on each for the user.

        Args:
            name: name in the catalogue.
            voltage: supply voltage [V].
            registers: values of P, I, D, as they are written into the servo.

        Raises:
            JointplayError: no such servo or register, or a value that it cannot hold.
        """
        units, gains, notes = _servo(name).get("registers", {}), dict[str, float](), list[str]()
        for letter, value in registers.items():
            if letter not in REGISTERS:
                raise JointplayError(one_of("register", letter, REGISTERS))
            most, least = units.get("most", math.inf), 1 if letter == "P" else 0
            if not (least <= value <= most and float(value).is_integer()):
                raise JointplayError(
                    f"register {letter} of {name} takes whole numbers from {least} to {most:g}, "
                    f"got {value:g}"
                )
            gain, known = REGISTERS[letter], units.get(letter)
            if known is not None:
                gains[gain] = value * known["value"] * voltage
                notes.append(
                    f"{name} {letter}={value:g} is {gain} {gains[gain]:.4g} V/rad: "
                    f"{known['origin']}; {known['source']}"
                )
            elif value:
                why = units.get("unknown", "its unit was not found")
                notes.append(f"note: {name} {letter}={value:g} left out, {gain} as it was: {why}")
            else:
                gains[gain] = 0.0
        return gains, notes

    @property
    def register(self) -> tuple[float, int] | None:
        """P gain of one unit in the P register [V/rad], and the register's largest value; None: not
        known.
        """
        units = {} if self.catalogue is None else _servo(self.catalogue).get("registers", {})
        return (units["P"]["value"] * self.voltage, units["most"]) if "P" in units else None

    @property
    def band(self) -> float:
        """Dead band of the position error, however it was given [rad or m]."""
        return self.dead_band or self.dead_band_counts * self.resolution

    @property
    def stall(self) -> float:
        """Stall effort per voltage [N m/V or N/V]."""
        return self.torque_constant / self.resistance

    @property
    def braking(self) -> float:
        """Damping of the motor by its back-EMF [N m s/rad or N s/m]."""
        return self.torque_constant * self.stall

    def with_friction(self, losses: JointFriction) -> JointFriction:
        """The friction of a joint together with that of this motor, which turns it directly."""
        static = losses.static
        return replace(
            losses,
            coulomb=losses.coulomb + self.friction,
            viscous=losses.viscous + self.viscous,
            static=None if static is None else static + self.friction,
            presliding=losses.presliding or self.presliding,
            presliding_damping=losses.presliding_damping or self.presliding_damping,
        )


_BESIDE = ("armature", "registers")
"""Entries of the catalogue that are no fields of a servo: the gear's `rotor_inertia`, and units of
registers."""
REGISTERS = {"P": "p_gain", "I": "i_gain", "D": "d_gain"}
"""The gain that each register of a servo sets."""


def _servo(name: str) -> dict[str, Any]:
    """Numbers of a servo in the catalogue by field, each with value, origin and source."""
    servos = shipped_table(__file__, "servos")
    if name not in servos:
        raise JointplayError(one_of("servo", name, servos), ("catalogue",))
    entry: dict[str, Any] = servos[name]
    return entry


DRIVES: dict[str, type[Drive]] = {
    drive.kind: drive for drive in (ComputedTorque, Prescribed, Torque, Servo, Free)
}


register(Drive, Family("kind", "drive", DRIVES))


def assign(
    mechanism: Mechanism, motion: Motion | None, drive: Drive | Mapping[str, Drive]
) -> dict[str, Drive]:
    """Assign a drive to every moving joint.

    A single drive is for every joint of the motion; joints that the motion does not name are free
    in a mechanism with loops, and an error elsewhere. A mapping names the driven joints; the others
    are free.

    Raises:
        JointplayError: a joint that does not exist, that lacks a reference, or that has one but no
            drive that follows it.
    """
    joints = mechanism.joints
    in_motion = () if motion is None else motion.joints
    if isinstance(drive, Mapping):
        drives = {name: drive.get(name, Free()) for name in joints}
        unknown = [name for name in (*drive, *in_motion) if name not in joints]
    else:
        names = in_motion if drive.follows else joints
        unknown = [name for name in in_motion if name not in joints]
        missing = [name for name in joints if name not in names and not mechanism.loops]
        if missing or unknown:
            wrong = [f"lacks {', '.join(missing)}"] if missing else []
            wrong += [f"names {', '.join(unknown)}"] if unknown else []
            raise JointplayError(
                f"the motion {' and '.join(wrong)}; the moving joints are: {', '.join(joints)}",
                where=("motion",),
            )
        drives = {name: drive if name in names else Free() for name in joints}
    if unknown:
        raise MissingName("moving joint", unknown[0], joints)
    for name, stated in ({} if motion is None else motion.units).items():
        if stated != (unit := mechanism.description.joints[name].unit):
            message = (
                f"joint {name!r} has positions in {unit}, the motion's file has them in {stated}"
            )
            raise JointplayError(message, where=("motion",))
    for name, chosen in drives.items():
        if not isinstance(chosen, Drive):
            raise JointplayError(f"joint {name!r} needs a drive, got {chosen!r}")
        entry = mechanism.description.joints.get(name)
        if isinstance(chosen, Servo) and chosen.catalogue and entry is not None and entry.slides:
            raise JointplayError(
                f"joint {name!r} slides, but the servo {chosen.catalogue} turns: give "
                "torque_constant [N/A] and resistance instead of a name in the catalogue"
            )
        if chosen.follows and name not in in_motion:
            raise JointplayError(
                f"joint {name!r} has a {chosen.kind} drive but no reference motion"
            )
        if name in in_motion and not chosen.follows:
            raise JointplayError(
                f"joint {name!r} has a reference motion, but its drive is {chosen.kind}; "
                f"drives that follow: {', '.join(d.kind for d in DRIVES.values() if d.follows)}"
            )
    return drives
