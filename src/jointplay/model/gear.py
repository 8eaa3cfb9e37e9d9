"""Gears between motors and joints: play, elasticity, hysteresis, kinematic error and losses.

A `Gearing` is a nonlinear torsion spring between the motor's coordinate and the joint's: no torque
within the play; beyond it an elastic `Curve` and, in parallel, bristles that give the hysteresis
loop. Friction acts on the motor (`Losses`). Kinds of gear differ in the numbers from which these
follow: a stiffness (`Gear`, `GearTrain`), or what catalogues measure (`StrainWaveGear`,
`CycloidalGear`).

A screw, rack or belt before a joint that slides is such a gear in metres and newtons: what is a
torque, an angle or an inertia here is a force, a way or a mass there.

docs/drives.md has the equations, what catalogues measure, and where numbers come from.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np

from jointplay.base.errors import JointplayError
from jointplay.base.files import shipped_table
from jointplay.base.schema import (
    Described,
    Family,
    OptionalQuantity,
    Quantity,
    check_fields,
    one_of,
    quantity,
    register,
)
from jointplay.physics.kernel.constants import GEAR_ORDERS

SOFTEST = 1e-4
"""Least stiffness to which a stated lost motion may lead, relative to the gear's first one."""

CYCLES = 2
"""Cycles of load after which a hysteresis loop is closed."""


class Curve(NamedTuple):
    """Elastic torque over the twist beyond the play: an odd, piecewise linear function."""

    slopes: np.ndarray
    """Stiffness of each piece, (n + 1,) [N m/rad]."""
    twists: np.ndarray
    """Twists at which the slope changes, (n,) [rad]."""
    torques: np.ndarray
    """Torques at these twists, (n,) [N m]."""

    @classmethod
    def of(cls, pieces: Sequence[tuple[float, float]]) -> Curve:
        """Curve of pieces: the slope of each [N m/rad], and the torque at which it ends [N m]."""
        slopes = np.array([slope for slope, _ in pieces])
        torques = np.array([end for _, end in pieces[:-1]])
        steps = np.diff(torques, prepend=0.0) / slopes[:-1]
        return cls(slopes, np.cumsum(steps), torques)

    def _starts(self) -> tuple[np.ndarray, np.ndarray]:
        return np.append(0.0, self.twists), np.append(0.0, self.torques)

    def torque(self, depth: np.ndarray) -> np.ndarray:
        """Torque [N m] at twists beyond the play (`depth`, not negative) [rad]."""
        twists, torques = self._starts()
        at = np.searchsorted(self.twists, depth)
        return np.asarray(torques[at] + self.slopes[at] * (depth - twists[at]))

    def slope(self, depth: float) -> float:
        """Stiffness at a twist beyond the play [N m/rad]."""
        return float(self.slopes[np.searchsorted(self.twists, depth)])

    def energy(self, depth: np.ndarray) -> np.ndarray:
        """Elastic energy stored at twists beyond the play [J]."""
        twists, torques = self._starts()
        steps = 0.5 * np.diff(twists) * (torques[1:] + torques[:-1])
        stored = np.append(0.0, np.cumsum(steps))
        at = np.searchsorted(self.twists, depth)
        more = depth - twists[at]
        return np.asarray(stored[at] + torques[at] * more + 0.5 * self.slopes[at] * more**2)

    def depth(self, torque: np.ndarray) -> np.ndarray:
        """Twists beyond the play [rad] at torques, not negative [N m]: the inverse of `torque`."""
        twists, torques = self._starts()
        at = np.searchsorted(self.torques, torque)
        return np.asarray(twists[at] + (torque - torques[at]) / self.slopes[at])


class Losses(NamedTuple):
    """Friction on a gear's motor, referred to the joint."""

    running: float = 0.0
    """Dry friction without load [N m]."""
    viscous: float = 0.0
    """Viscous friction [N m s/rad]."""
    driving: float = 0.0
    """Dry friction per torque that the gear transmits, where the motor drives."""
    driven: float = 0.0
    """Dry friction per torque that the gear transmits, where the joint drives."""


class Gearing(Described, ABC):
    """A gear between a motor and the joint that it moves. Subclasses are frozen dataclasses.

    The motor becomes a coordinate of its own, ``<joint>.motor``. All quantities are referred to the
    joint's side: an inertia J behind a ratio N counts N^2 J. The rotor's gyroscopic effect and
    weight are left out.
    """

    selector = ("kind", "kind")

    kind: ClassVar[str]
    """The word that selects the kind of gear."""
    linear: ClassVar[bool] = False
    """Whether the gear can move a joint that slides, too."""
    play: float
    """Angle or way by which the joint moves freely while the motor stands [rad or m]."""
    rotor_inertia: float
    """Inertia of the rotor, referred to the joint [kg m^2 or kg]."""
    damping: float
    """Damping of the teeth in contact and the shaft [N m s/rad or N s/m]."""
    ruled: ClassVar[tuple[str, ...]] = ("rotor_inertia",)
    """Fields whose numbers a rule of `gear_rules` gives where nobody does."""
    rated_torque: float | None = None
    """Torque to which catalogues refer lost motion and hysteresis [N m]; None: not known."""

    @abstractmethod
    def curve(self) -> Curve:
        """Elastic torque of the gear over the twist beyond the play."""

    @property
    def missing(self) -> tuple[str, ...]:
        """Fields that are not given, and for which a `Mechanism` has rules."""
        return tuple(name for name in self.ruled if getattr(self, name) is None)

    @property
    def bristles(self) -> tuple[float, float]:
        """Largest torque of the hysteresis [N m]; twist in which it turns over to 1 - 1/e [rad]."""
        return 0.0, 1.0

    @property
    def error_terms(self) -> tuple[tuple[float, float, float], ...]:
        """Terms of the kinematic error: cycles per turn of the joint, amplitude and phase [rad]."""
        return ()

    def without_error(self) -> Gearing:
        """The same gear without kinematic error."""
        return self

    def with_play(self, play: float) -> Self:
        """The same gear with another play [rad or m]; the stages of a train in proportion."""
        changes: dict[str, Any] = {"play": play}
        return replace(self, **changes)  # type: ignore[type-var]

    @property
    def losses(self) -> Losses:
        """Friction on the motor; none unless a kind of gear has it."""
        return Losses()

    @property
    def steepest(self) -> float:
        """Largest stiffness of the gear, bristles included [N m/rad]."""
        grip, bend = self.bristles
        return float(self.curve().slopes.max()) + grip / bend

    @property
    def unloaded_range(self) -> float:
        """Range in which an unloaded joint may rest [rad]: the play and the hysteresis' width."""
        grip, _ = self.bristles
        return self.play + 2.0 * float(self.curve().depth(np.array(grip)))

    def row(self, motor: int = 0, link: int = 0) -> np.ndarray:
        """The gear's record for the kernels, shape (1,), of the type `layout.GEAR_ROW`.

        `motor` and `link`: indices of the motor's and the joint's coordinates.
        """
        from jointplay.physics.kernel.layout import gear_row  # the compiler takes long to import

        terms = np.array(self.error_terms).reshape(-1, 3).T
        names = ("running_torque", "viscous", "driving_loss", "driven_loss")
        return gear_row(
            motor=motor,
            link=link,
            half_play=self.play / 2.0,
            damping=self.damping,
            rubs=int(self.bristles[0] > 0.0 or any(self.losses)),
            orders=terms.shape[1],
            **dict(zip(("order", "amplitude", "phase"), terms, strict=True)),
            **dict(zip(names, self.losses, strict=True)),
            **_torsion_fields(self.curve(), self.bristles),
        )

    # Statics and energy.

    def kinematic_error(self, motor: Any) -> tuple[Any, Any, Any]:
        """Kinematic error at the motor's angles [rad], and its first two derivatives by them."""
        error = slope = bend = 0.0 * motor
        for order, amplitude, phase in self.error_terms:
            sine, cosine = np.sin(order * motor + phase), np.cos(order * motor + phase)
            error = error + amplitude * sine
            slope = slope + amplitude * order * cosine
            bend = bend - amplitude * order**2 * sine
        return error, slope, bend

    def twist(self, motor: Any, link: Any) -> Any:
        """Twist of the gear at its motor's and its joint's angles [rad]."""
        return motor + self.kinematic_error(motor)[0] - link

    def stored_energy(self, twist: np.ndarray, hysteresis: np.ndarray | float = 0.0) -> np.ndarray:
        """Energy [J] in teeth, shafts and bristles at twists (n,) [rad].

        `hysteresis`: torques of the bristles (n,) [N m].
        """
        energy = self.curve().energy(np.maximum(np.abs(twist) - self.play / 2.0, 0.0))
        grip, bend = self.bristles
        if grip > 0.0:
            energy = energy + 0.5 * bend / grip * np.square(hysteresis)
        return energy

    def first_load(self, twist: float) -> tuple[float, float, float]:
        """Work [J], torque [N m] and stiffness [N m/rad] on the virgin curve at a twist [rad].

        The virgin curve holds at twists that were never exceeded before.
        """
        curve, depth = self.curve(), abs(twist) - self.play / 2.0
        energy = torque = slope = 0.0
        if depth > 0.0:
            energy, torque = (float(f(np.array(depth))) for f in (curve.energy, curve.torque))
            slope = curve.slope(depth)
        grip, bend = self.bristles
        if grip > 0.0:
            decay = math.exp(-abs(twist) / bend)
            energy += grip * (abs(twist) - bend * (1.0 - decay))
            torque += grip * (1.0 - decay)
            slope += grip / bend * decay
        return energy, math.copysign(torque, twist), slope

    def wound_up(self, torque: Any) -> Any:
        """Twist under a torque on the middle line of all loops, play included [rad]."""
        depth = self.curve().depth(np.abs(torque))
        return np.sign(torque) * (self.play / 2.0 + depth)

    def first_twist(self, torque: float) -> float:
        """Twist under a torque on the virgin curve, play included [rad]; see `first_load`."""
        if self.bristles[0] <= 0.0:
            return float(self.wound_up(torque))
        return float(self.torsion([torque])[0])

    # What catalogues measure: hysteresis loss and lost motion.

    def torsion(self, torques: Sequence[float] | np.ndarray) -> np.ndarray:
        """Angles of the joint (n,) [rad] under torques (n,) [N m] in turn, the motor held.

        The load goes slowly from one torque to the next, from the virgin state, with the law that
        runs use. Where several angles bear a torque, as within the play, the joint goes no farther
        than to the first.
        """
        return self._torsion(self.curve(), self.bristles, torques)

    def _torsion(
        self, curve: Curve, bristles: tuple[float, float], torques: Sequence[float] | np.ndarray
    ) -> np.ndarray:
        from jointplay.physics.kernel.gear import turn_slowly
        from jointplay.physics.kernel.layout import gear_row

        torques = np.asarray(torques, float)
        if torques.ndim != 1 or not np.isfinite(torques).all():
            raise JointplayError(f"torques must be a list of finite numbers, got {torques!r}")
        twists = np.empty_like(torques)
        row = gear_row(half_play=self.play / 2.0, **_torsion_fields(curve, bristles))
        turn_slowly(row.ctypes.data, torques, twists)
        return twists

    @property
    def _rated(self) -> float:
        if self.rated_torque is None:
            raise JointplayError(
                f"lost motion and hysteresis refer to the rated torque, and this {self.kind} gear "
                "has none; give rated_torque",
                ("rated_torque",),
            )
        return self.rated_torque

    def hysteresis_loss(self) -> float:
        """Width at zero torque of the loop between both rated torques, play included [rad].

        Raises:
            JointplayError: the gear has no rated torque.
        """
        top = self._rated
        angles = self.torsion([*[top, -top] * CYCLES, top, 0.0, -top, 0.0])
        return float(angles[-3] - angles[-1])

    def lost_motion(self, torque_fraction: float | None = None) -> float:
        """Lost motion: angle between a fraction of the rated torque one way and the other [rad].

        For strain-wave gears between the ends of a loop to this torque; for others on the middle
        line of the loop to the rated torque. None takes the fraction of the kind's catalogues: 0.04
        for strain-wave gears, else 0.03.

        Raises:
            JointplayError: the gear has no rated torque; a fraction not above 0 or above 1.
        """
        if torque_fraction is None:
            torque_fraction = _fraction(self.kind)
        if not 0.0 < torque_fraction <= 1.0:
            raise JointplayError(
                f"a torque fraction is above 0 and at most 1, got {torque_fraction!r}"
            )
        return self._lost_motion(self.curve(), self.bristles, torque_fraction)

    def _lost_motion(self, curve: Curve, bristles: tuple[float, float], part: float) -> float:
        top, small = self._rated, part * self._rated
        torques = [*[top, -top] * CYCLES, top, small, -small, -top, -small, small]
        angles = self._torsion(curve, bristles, torques)
        down_high, down_low, _, up_low, up_high = angles[-5:]
        return float(0.5 * (down_high + up_high - down_low - up_low))

    # Provenance.

    def origins(self) -> dict[str, str]:
        """Origin and source of the numbers that a catalogue gave, by field."""
        return {}

    @property
    def notes(self) -> str:
        """A clause that says which numbers a catalogue gave, and which of them are unchecked."""
        by_origin: dict[str, list[str]] = {}
        for name, source in self.origins().items():
            by_origin.setdefault(source.partition(":")[0], []).append(name)
        explained = {"memory": "from memory, to be checked"}
        return "; ".join(
            f"{explained.get(origin, origin)}: {', '.join(names)}"
            for origin, names in by_origin.items()
        )


@dataclass(frozen=True)
class Gear(Gearing):
    """A gear, or a screw, with backlash between a motor and its joint.

    Within the play no torque passes; beyond it, the teeth are a spring and a damper in parallel
    that never pull. A screw of lead l [m per turn] refers a rotor's inertia J as J (2 pi / l)^2.
    Reference: M. Nordin, P.-O. Gutman, Automatica 38 (2002) 1633-1649.

    Raises:
        JointplayError: a value that is negative, zero where it must not be, or not finite.
    """

    kind: ClassVar[str] = "backlash"
    linear: ClassVar[bool] = True
    ruled: ClassVar[tuple[str, ...]] = ("rotor_inertia", "stiffness", "damping")

    play: Quantity = quantity("rad", "m", least=0.0, label="gear play")
    """Angle or way by which the joint moves freely while the motor stands [rad or m]."""
    rotor_inertia: Quantity = quantity(
        "kg*m^2", "kg", default=None, above=0.0, label="rotor inertia"
    )
    """Inertia of the rotor, referred to the joint [kg m^2 or kg]; by a rule if not given."""
    stiffness: Quantity = quantity(
        "N*m/rad", "N/m", default=None, above=0.0, label="gear stiffness"
    )
    """Stiffness of the teeth in contact and the shaft [N m/rad or N/m]; by a rule if not given."""
    damping: Quantity = quantity(
        "N*m*s/rad", "N*s/m", default=None, least=0.0, label="gear damping"
    )
    """Damping of the teeth in contact and the shaft [N m s/rad or N s/m]; if not given, by a rule
    where the stiffness is, else 0."""

    def __post_init__(self) -> None:
        if self.damping is None and self.stiffness is not None:
            object.__setattr__(self, "damping", 0.0)
        check_fields(self)

    def curve(self) -> Curve:
        if self.stiffness is None:
            raise JointplayError(
                "the stiffness of this gear is not given, and follows from its joint: see "
                "Mechanism.gears, or give it",
                ("stiffness",),
            )
        return Curve.of([(self.stiffness, math.inf)])


def _check_efficiency(efficiency: float, driven: float | None) -> None:
    """Refuse efficiencies that would create energy, or let nothing through."""
    if not 0.0 < efficiency <= 1.0:
        raise JointplayError(
            f"efficiency must be above 0 and at most 1, got {efficiency:g}", ("efficiency",)
        )
    if driven is not None and not 0.0 <= driven <= 1.0:
        text = f"back driving efficiency must be from 0 to 1, got {driven:g}"
        raise JointplayError(text, ("back_driving_efficiency",))


def _back_driving(efficiency: float, stated: float | None) -> float:
    """Efficiency where the joint drives; if not stated, that of the same friction both ways.

    Friction 1/efficiency - 1 per transmitted torque leaves 1 - (1/efficiency - 1) to the motor.
    """
    return max(2.0 - 1.0 / efficiency, 0.0) if stated is None else stated


@dataclass(frozen=True, kw_only=True)
class _Lossy(Gearing):
    """A gear with friction on its motor."""

    rotor_inertia: Quantity = quantity("kg*m^2", default=None, above=0.0, label="rotor inertia")
    """Inertia of the rotor, referred to the joint [kg m^2]; by a rule if not given."""
    damping: Quantity = quantity("N*m*s/rad", default=0.0, least=0.0, label="gear damping")
    """Damping of the teeth in contact and the shaft [N m s/rad]."""
    rated_torque: OptionalQuantity = quantity("N*m", default=None, above=0.0, label="rated torque")
    """Rated torque, to which catalogues refer lost motion and hysteresis [N m]."""
    no_load_torque: Quantity = quantity(
        "N*m", default=0.0, least=0.0, label="no-load running torque"
    )
    """Dry friction of the gear without load, referred to the joint [N m]."""
    viscous: Quantity = quantity("N*m*s/rad", default=0.0, least=0.0, label="viscous gear friction")
    """Viscous friction of the gear, referred to the joint [N m s/rad]."""


@dataclass(frozen=True, kw_only=True)
class _Catalogued(_Lossy):
    """A gear that catalogues describe by stiffness, lost motion and hysteresis."""

    catalogue: str | None = None
    """Name of a gear whose catalogue gives the numbers that are not given here."""
    play: Quantity = quantity("rad", default=None, least=0.0, label="gear play")
    """Angle by which the joint turns freely while the motor stands [rad]; 0 if not given."""
    hysteresis: Quantity = quantity("rad", default=None, least=0.0, label="hysteresis")
    """Width of the torsion loop at zero torque beyond the play [rad]; 0 if not given."""
    presliding: OptionalQuantity = quantity(
        "rad", default=None, above=0.0, label="presliding angle"
    )
    """Twist in which the hysteresis turns over by all but 1/e [rad]; a quarter of `hysteresis` if
    not given."""
    stated_lost_motion: OptionalQuantity = quantity(
        "rad", default=None, above=0.0, label="lost motion"
    )
    """Lost motion of the catalogue [rad]: it makes the gear softer below the torque at which it is
    measured. If not given, lost motion follows from the other numbers."""
    efficiency: Quantity = quantity("", default=1.0)
    """Efficiency under load where the motor drives."""
    back_driving_efficiency: OptionalQuantity = quantity("", default=None)
    """Efficiency where the joint drives; by the friction of `efficiency` if not given."""

    needs: ClassVar[tuple[str, ...]]
    """Fields that either the user or the catalogue must give."""

    def with_play(self, play: float) -> Self:
        stated = self.stated_lost_motion  # includes the play
        lost = None if stated is None else stated + play - self.play
        return replace(self, play=play, stated_lost_motion=lost)

    def __post_init__(self) -> None:
        entry = {} if self.catalogue is None else _entry(self.kind, self.catalogue)
        for name, item in entry.items():
            if getattr(self, name) is None:
                object.__setattr__(self, name, item["value"])
        missing = [name for name in self.needs if getattr(self, name) is None]
        if missing:
            has = f"; the catalogue's {self.catalogue} has {', '.join(entry)}" if entry else ""
            raise JointplayError(f"a {self.kind} gear needs {', '.join(missing)}{has}")
        for name in ("play", "hysteresis"):
            if getattr(self, name) is None:
                object.__setattr__(self, name, 0.0)
        check_fields(self)
        _check_efficiency(self.efficiency, self.back_driving_efficiency)
        self._check()
        _ = self._law  # raises if the numbers contradict each other

    @abstractmethod
    def _check(self) -> None:
        """Refuse values that do not go together."""

    @abstractmethod
    def _pieces(self) -> list[tuple[float, float]]:
        """Pieces of the curve as the catalogue has it, for `Curve.of`."""

    @classmethod
    def of(cls, name: str, **more: Any) -> Self:
        """A gear by its name in the catalogue (`names`); fields in `more` go before its numbers.

        Raises:
            JointplayError: no such gear, the message names the nearest; a number that neither has.
        """
        return cls(catalogue=name, **more)

    @classmethod
    def names(cls) -> list[str]:
        """Names of the gears in the catalogue, for `of`."""
        return list(shipped_table(__file__, "gears")[cls.kind])

    def origins(self) -> dict[str, str]:
        if self.catalogue is None:
            return {}
        return {
            name: f"{item['origin']}: {item['source']}"
            for name, item in _entry(self.kind, self.catalogue).items()
            if getattr(self, name) == item["value"]
        }

    @cached_property
    def _law(self) -> tuple[Curve, tuple[float, float]]:
        """Curve and bristles with which hysteresis and lost motion come out as stated.

        A stated lost motion is reached by a softer beginning of the curve, up to the torque at
        which it is measured; its stiffness is found by bracketing (Brent).
        """
        if self.stated_lost_motion is None:
            curve = Curve.of(self._pieces())
            return curve, self._bristles_of(curve)
        part, stated = _fraction(self.kind), self.stated_lost_motion
        least, largest = self.lost_motion_range()
        if not least <= stated * (1.0 + 1e-9) or not stated <= largest:
            raise JointplayError(
                f"lost motion at {100 * part:g} % of the rated torque must be from {least:.4g} to "
                f"{largest:.4g} rad, as stiffness, play and hysteresis have it, got {stated:.4g} "
                "rad",
                ("stated_lost_motion",),
            )
        from scipy.optimize import brentq  # takes long to import

        most = self._pieces()[0][0]
        if least >= stated:
            return self._beginning(most)

        def excess(slope: float) -> float:
            return self._lost_motion(*self._beginning(slope), part) - stated

        return self._beginning(brentq(excess, SOFTEST * most, most, xtol=1e-9 * most))

    def lost_motion_range(self) -> tuple[float, float]:
        """Least and largest lost motion that the gear's other numbers allow to be stated [rad].

        Raises:
            JointplayError: the gear has no rated torque.
        """
        part, most = _fraction(self.kind), self._pieces()[0][0]
        softest, stiffest = (self._beginning(slope) for slope in (SOFTEST * most, most))
        return self._lost_motion(*stiffest, part), self._lost_motion(*softest, part)

    def _beginning(self, slope: float) -> tuple[Curve, tuple[float, float]]:
        """Curve with this stiffness up to the torque of the lost motion, and its bristles."""
        small = _fraction(self.kind) * self._rated
        beyond = [piece for piece in self._pieces() if piece[1] > small]
        curve = Curve.of([(slope, small), *beyond])
        return curve, self._bristles_of(curve)

    def _bristles_of(self, curve: Curve) -> tuple[float, float]:
        """Bristles with which the loop is as wide at zero torque as `hysteresis`.

        There the curve bears the bristles' torque, at half the width on either side.
        """
        grip = float(curve.torque(np.array(0.5 * self.hysteresis)))
        if self.rated_torque is not None and grip >= self.rated_torque:
            raise JointplayError(
                f"a hysteresis of {self.hysteresis:.4g} rad takes {grip:.4g} N m, which is not "
                f"below the rated torque of {self.rated_torque:.4g} N m",
                ("hysteresis",),
            )
        return grip, self.presliding or (0.25 * self.hysteresis if self.hysteresis else 1.0)

    def curve(self) -> Curve:
        return self._law[0]

    @property
    def bristles(self) -> tuple[float, float]:
        return self._law[1]

    @property
    def losses(self) -> Losses:
        driven = _back_driving(self.efficiency, self.back_driving_efficiency)
        driving = 1.0 / self.efficiency - 1.0
        return Losses(self.no_load_torque, self.viscous, driving, 1.0 - driven)


@dataclass(frozen=True, kw_only=True)
class StrainWaveGear(_Catalogued):
    """A strain-wave (harmonic) gear: a stiffness that rises with the torque, and hysteresis.

    Its kinematic error has two cycles in a turn of the wave generator. Reference: T. D. Tuttle,
    W. P. Seering, IEEE Trans. Robotics and Automation 12 (1996) 368-374.

    Raises:
        JointplayError: no such gear in the catalogue, a value that cannot be, or values that do not
            go together.
    """

    kind: ClassVar[str] = "strain-wave"
    needs: ClassVar[tuple[str, ...]] = ("ratio", "stiffness_1")

    ratio: Quantity = quantity("", default=None, above=0.0, label="gear ratio")
    """Turns of the motor in a turn of the joint."""
    stiffness_1: Quantity = quantity("N*m/rad", default=None, above=0.0, label="stiffness K1")
    """Stiffness K1, up to `torque_1` [N m/rad]."""
    stiffness_2: OptionalQuantity = quantity(
        "N*m/rad", default=None, above=0.0, label="stiffness K2"
    )
    """Stiffness K2, up to `torque_2` [N m/rad]; K1 if not given."""
    stiffness_3: OptionalQuantity = quantity(
        "N*m/rad", default=None, above=0.0, label="stiffness K3"
    )
    """Stiffness K3, beyond `torque_2` [N m/rad]; K2 if not given."""
    torque_1: OptionalQuantity = quantity("N*m", default=None, above=0.0, label="torque T1")
    """Torque T1, at which K2 begins [N m]."""
    torque_2: OptionalQuantity = quantity("N*m", default=None, above=0.0, label="torque T2")
    """Torque T2, at which K3 begins [N m]."""
    error_amplitude: Quantity = quantity("rad", default=None, least=0.0, label="kinematic error")
    """Amplitude of the kinematic error, an angle of the joint [rad]; 0 if not given."""
    error_phase: Quantity = quantity("rad", default=0.0, label="phase of the kinematic error")
    """Phase of the kinematic error where the motor is at zero [rad]."""

    def _check(self) -> None:
        for stiffness, torque in (("stiffness_2", "torque_1"), ("stiffness_3", "torque_2")):
            if getattr(self, stiffness) is not None and getattr(self, torque) is None:
                raise JointplayError(f"{stiffness} begins at {torque}: give it", (torque,))
        first, second = self.torque_1, self.torque_2
        if first is not None and second is not None and not first < second:
            raise JointplayError(
                f"torque T2 must be above T1 = {first:g} N m, got {second:g} N m", ("torque_2",)
            )
        if self.error_amplitude is None:
            object.__setattr__(self, "error_amplitude", 0.0)

    def _pieces(self) -> list[tuple[float, float]]:
        pieces = [(self.stiffness_1, math.inf)]
        for slope, begin in ((self.stiffness_2, self.torque_1), (self.stiffness_3, self.torque_2)):
            if slope is not None and begin is not None and slope != pieces[-1][0]:
                pieces[-1] = (pieces[-1][0], begin)
                pieces.append((slope, math.inf))
        return pieces

    @property
    def error_terms(self) -> tuple[tuple[float, float, float], ...]:
        if self.error_amplitude == 0.0:
            return ()
        return ((2.0 * self.ratio, self.error_amplitude, self.error_phase),)

    def without_error(self) -> StrainWaveGear:
        return replace(self, error_amplitude=0.0)

    def _lost_motion(self, curve: Curve, bristles: tuple[float, float], part: float) -> float:
        small = part * self._rated
        angles = self._torsion(curve, bristles, [small, -small] * (CYCLES + 1))
        return float(angles[-2] - angles[-1])


@dataclass(frozen=True, kw_only=True)
class CycloidalGear(_Catalogued):
    """A cycloidal (RV) gear: one stiffness, backlash, hysteresis, kinematic error at given orders.

    Raises:
        JointplayError: no such gear in the catalogue, a value that cannot be, or values that do not
            go together.
    """

    kind: ClassVar[str] = "cycloidal"
    needs: ClassVar[tuple[str, ...]] = ("stiffness",)

    stiffness: Quantity = quantity("N*m/rad", default=None, above=0.0, label="gear stiffness")
    """Torsional stiffness of the catalogue [N m/rad]."""
    error_orders: tuple[float, ...] = quantity("", default=(), label="error order")
    """Orders of the kinematic error: cycles of each of its terms in a turn of the joint."""
    error_amplitudes: tuple[float, ...] = quantity("rad", default=(), label="kinematic error")
    """Amplitude of the kinematic error at each order, an angle of the joint [rad]."""
    error_phases: tuple[float, ...] = quantity("rad", default=(), label="phase of an error")
    """Phase of the kinematic error at each order, the motor at zero [rad]; 0 if not given."""

    def _check(self) -> None:
        orders, amplitudes = self.error_orders, self.error_amplitudes
        if len(orders) != len(amplitudes) or len(self.error_phases) not in (0, len(orders)):
            raise JointplayError(
                f"a kinematic error needs an amplitude, and a phase or none, for each order; got "
                f"{len(orders)} orders, {len(amplitudes)} amplitudes, {len(self.error_phases)} "
                "phases",
                ("error_orders",),
            )
        if len(orders) > GEAR_ORDERS:
            text = f"a kinematic error has at most {GEAR_ORDERS} orders, got {len(orders)}"
            raise JointplayError(text, ("error_orders",))

    def _pieces(self) -> list[tuple[float, float]]:
        return [(self.stiffness, math.inf)]

    @property
    def error_terms(self) -> tuple[tuple[float, float, float], ...]:
        phases = self.error_phases or (0.0,) * len(self.error_orders)
        terms = zip(self.error_orders, self.error_amplitudes, phases, strict=True)
        return tuple(term for term in terms if term[1] != 0.0)

    def without_error(self) -> CycloidalGear:
        return replace(self, error_orders=(), error_amplitudes=(), error_phases=())


@dataclass(frozen=True, kw_only=True)
class GearStage(Described):
    """One pair of wheels of a gear train.

    Raises:
        JointplayError: a value that cannot be.
    """

    ratio: Quantity = quantity("", above=0.0, label="ratio of a stage")
    """Turns of the stage's input in a turn of its output."""
    backlash: Quantity = quantity("rad", default=0.0, least=0.0, label="backlash of a stage")
    """Free angle of the stage's output shaft while its input stands [rad]."""
    efficiency: Quantity = quantity("", default=1.0)
    """Efficiency where the motor drives."""
    back_driving_efficiency: OptionalQuantity = quantity("", default=None)
    """Efficiency where the joint drives; by the friction of `efficiency` if not given."""

    def __post_init__(self) -> None:
        check_fields(self)
        _check_efficiency(self.efficiency, self.back_driving_efficiency)


@dataclass(frozen=True, kw_only=True)
class GearTrain(_Lossy):
    """A train of spur wheels, as in servos: stages from the motor on, each with its backlash.

    The backlash of a stage turns the joint by as much as the stages behind it leave of it, so the
    last counts most. Efficiencies multiply.

    Raises:
        JointplayError: no stage, or a value that cannot be.
    """

    kind: ClassVar[str] = "train"

    stages: tuple[GearStage, ...]
    """Stages, from the motor to the joint."""
    stiffness: Quantity = quantity("N*m/rad", above=0.0, label="gear stiffness")
    """Stiffness of all teeth in contact and shafts, referred to the joint [N m/rad]."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "stages", tuple(self.stages))
        check_fields(self)
        if not self.stages:
            raise JointplayError("a gear train needs at least one stage", ("stages",))
        for index, stage in enumerate(self.stages):
            if not isinstance(stage, GearStage):
                raise JointplayError(
                    f"a stage is a GearStage, got {stage!r:.60}", ("stages", index)
                )

    @property
    def ratio(self) -> float:
        """Turns of the motor in a turn of the joint."""
        return math.prod(stage.ratio for stage in self.stages)

    @property
    def play(self) -> float:  # type: ignore[override]
        behind, total = 1.0, 0.0
        for stage in reversed(self.stages):
            total += stage.backlash / behind
            behind *= stage.ratio
        return total

    def with_play(self, play: float) -> Self:
        part = play / self.play if self.play else 1.0
        stages = (replace(stage, backlash=part * stage.backlash) for stage in self.stages)
        return replace(self, stages=tuple(stages))

    def curve(self) -> Curve:
        return Curve.of([(self.stiffness, math.inf)])

    @property
    def losses(self) -> Losses:
        efficiency = math.prod(stage.efficiency for stage in self.stages)
        driven = math.prod(
            _back_driving(stage.efficiency, stage.back_driving_efficiency) for stage in self.stages
        )
        return Losses(self.no_load_torque, self.viscous, 1.0 / efficiency - 1.0, 1.0 - driven)


GEARS: dict[str, type[Gearing]] = {
    gear.kind: gear for gear in (Gear, StrainWaveGear, CycloidalGear, GearTrain)
}
"""Kinds of gear by the word that selects them."""


register(Gearing, Family("kind", "gear", GEARS, default=Gear.kind, bare=False))


def _torsion_fields(curve: Curve, bristles: tuple[float, float]) -> dict[str, Any]:
    """Fields of `layout.GEAR_ROW` for a curve and bristles."""
    fields = {"slopes": curve.slopes, "bend_twists": curve.twists, "bend_torques": curve.torques}
    return fields | dict(zip(("grip", "presliding"), bristles, strict=True))


def _entry(kind: str, name: str) -> dict[str, dict[str, Any]]:
    """Numbers of a gear in the catalogue, by field: each with value, origin and source."""
    entries: dict[str, dict[str, dict[str, Any]]] = shipped_table(__file__, "gears")[kind]
    if name not in entries:
        raise JointplayError(one_of(f"{kind} gear", name, entries), ("catalogue",))
    return entries[name]


def _fraction(kind: str) -> float:
    """Fraction of the rated torque at which a kind's catalogues measure lost motion."""
    table = shipped_table(__file__, "gears")["lost_motion"]
    return float(table.get(kind, table["cycloidal"])["fraction"])
