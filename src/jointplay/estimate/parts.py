"""Parts of a joint that can be identified: their unknowns, and the part with values of these.

A class each for a journal in its bore, the elements of a rolling bearing, the springs of a joint or
of its seat, and a gear. `Part.unknowns` lists what can be unknown of it, each with a name by which
`Part.holding` takes its value.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any, cast

import numpy as np

from jointplay.estimate.unknowns import FRICTION_MODEL_ERROR, Unknown
from jointplay.model.gear import CycloidalGear, Gear, Gearing, GearTrain, StrainWaveGear
from jointplay.model.mechanism import Mechanism
from jointplay.physics.joints import Clearance, RollingBearing
from jointplay.physics.joints.base import RELATIVE
from jointplay.physics.joints.elasticity import ABOUT_AXIS, Elasticity
from jointplay.physics.joints.play import JournalPlay

ALSO = ("friction", "stiffness", "hysteresis")
"""Unknowns that are identified only if asked for: dry friction behind all gears; stiffness of
rolling elements, and of each piece of a gear's curve; hysteresis of gears that have none in the
scenario."""
SPRINGS = {"radial": (0, 1), "axial": (2,), "tilt": (3, 4), "torsional": (5,)}
"""Components of a load and a displacement in bearing axes, by the way in which springs give way."""
WOUND = ("gear_compliance", "gear_compliance_2", "gear_compliance_3", "torsional_compliance")
"""Names of the compliances by which the torque that a joint transmits turns its link."""
_LARGEST_CLEARANCE_M = 1e-3
"""Upper limit of a journal's clearance, unless ten times the expected one is more [m] (judged: with
3 mm the same is told of 11 machines of benchmarks/truth/identify.py)."""
COMPLIANCE_RANGE = 100.0
"""Largest compliance of a gear, of springs or of a joint that winds up, as a multiple of the
expected one; of rolling elements, largest and smallest (judged: from 30 to 300 the same is told of
these 11 machines)."""
_SMALL_CLEARANCE_M = 5e-6
"""Least scale of a bearing's internal clearance [m]: judged, some micrometres, as bearings of class
CN of ISO 5753 have at least. From 2 to 10 um the same is told of these 11 machines."""
LOAD_ERROR = 0.03
"""Part by which compliances may be off: load cells are by 2 % (a standard deviation), 1.96 of which
are this with `SAFETY`."""
_MOST_PRELOAD = 5e-3
"""Largest interference that preloads, as a part of an element's diameter: judged, five times what
is called heavy. From half to twice of it the same is told of these 11 machines."""
_ELEMENT_STIFFNESS_SPREAD = 0.15
"""Prior deviation of the stiffness of rolling elements, as a part of that by their geometry, which
is estimated: three per cent of a ball's diameter, one ball more or less, and the grooves' radii
(judged: from 0.1 to 0.25 the same is told of these 11 machines)."""
_MOST_HYSTERESIS = 0.9
"""Largest part of the rated torque that hysteresis takes: with all of it the gear would hold
(judged: with 0.8 the same is told of these 11 machines)."""
NEGLIGIBLE = 1e-12
"""A clearance or a compliance that is none: keeps divisions finite, and torques by the difference
of two angles above rounding [m, rad/(N m)]."""


@dataclass(frozen=True)
class Part(ABC):
    """A part of a joint."""

    joint: str
    """Name of the joint."""
    component: Any
    """The clearance or the gear that the part belongs to, as expected."""

    @abstractmethod
    def unknowns(self, also: Collection[str]) -> Iterator[Unknown]:
        """Unknowns of the part, with those of `ALSO` that are asked for."""

    @abstractmethod
    def holding(self, values: Mapping[str, float]) -> Any:
        """The component with values of the part's unknowns by name; other names are ignored."""


class Journal(Part):
    """A journal that slides in its bore: clearances and friction."""

    component: Clearance

    def unknowns(self, also: Collection[str]) -> Iterator[Unknown]:
        for name, value in self.component.clearances.items():
            most = max(_LARGEST_CLEARANCE_M, 10.0 * value)
            yield Unknown(self.joint, name, "m", value, value, most)
        if mu := friction_of(self.component):
            yield Unknown(self.joint, "friction", "", mu, mu, 2.0, model_error=FRICTION_MODEL_ERROR)

    def holding(self, values: Mapping[str, float]) -> Clearance:
        sizes = {
            name: max(values[name], NEGLIGIBLE)
            for name in self.component.clearances
            if name in values
        }
        changed = self.component.with_clearances(sizes)
        if friction_of(self.component) is not None and "friction" in values:
            law, coefficient = self.component.friction, values["friction"]
            known = law.coefficients
            scaled = law.scaled(coefficient / known["mu_d"]) if known["mu_d"] > 0.0 else None
            equal: dict[str, float] = dict.fromkeys(known, coefficient)
            changed = changed.with_friction(scaled or replace(law, **equal))
        return changed


class Elements(Part):
    """Balls or rollers of a bearing: clearance or preload, place of the cage, and stiffness.

    The internal clearance is negative where they are preloaded; a pair has its preload instead. The
    stiffness is a factor of that by their geometry.
    """

    component: RollingBearing

    def unknowns(self, also: Collection[str]) -> Iterator[Unknown]:
        bearing, preload = self.component, getattr(self.component, "preload", None)
        if preload is not None:
            static = bearing.ratings()[1]
            scale = preload or 1e-3 * static
            most = max(static, 2.0 * scale)
            yield Unknown(self.joint, "preload", "N", preload, scale, most, model_error=LOAD_ERROR)
        else:
            value, pressed = bearing.bought_clearance, _MOST_PRELOAD * bearing.d_element
            least, most = min(-pressed, 2.0 * value), bearing.loosest
            scale = max(abs(value), _SMALL_CLEARANCE_M)
            yield Unknown(self.joint, "radial_clearance", "m", value, scale, most, least=least)
        turn = 2.0 * self.period
        yield Unknown(
            self.joint, "cage_angle", "rad", bearing.cage_angle, 0.25 * self.period,
            bearing.cage_angle + turn, False, least=bearing.cage_angle - turn, model_error=0.0,
        )  # fmt: skip
        sought = "stiffness" in also
        spread = math.inf if sought else _ELEMENT_STIFFNESS_SPREAD
        yield Unknown(
            self.joint, "stiffness_factor", "", 1.0, 1.0, COMPLIANCE_RANGE, sought, spread,
            least=1.0 / COMPLIANCE_RANGE,
        )  # fmt: skip

    @property
    def period(self) -> float:
        """Turn of the cage after which elements are where others were: rollers alternate [rad]."""
        return 2.0 * math.pi / self.component.count * (1.0 + self.component.roller_elements)

    def holding(self, values: Mapping[str, float]) -> RollingBearing:
        bearing, sizes = self.component, ("radial_clearance", "preload")
        changes = {name: values[name] for name in sizes if name in values}
        if "stiffness_factor" in values:
            changes["element_stiffness"] = bearing.stiffness_of_element * values["stiffness_factor"]
        return _changed(bearing, tuple(changes.items()))


@lru_cache  # a bearing computes its geometry once
def _changed(bearing: RollingBearing, changes: tuple[tuple[str, float], ...]) -> RollingBearing:
    return replace(bearing, **cast(Any, dict(changes)))


class Springs(Part):
    """Springs that hold a joint without play, or the seat of a bearing: their compliances."""

    component: Clearance

    @property
    def elasticity(self) -> Elasticity:
        """The springs of the joint or, of a bearing, those of its seat."""
        return cast(Elasticity, self.component.springs or cast(Any, self.component).seat)

    @cached_property
    def compliances(self) -> dict[str, float]:
        """Expected compliance at small loads, by way of `SPRINGS` [m/N, rad/(N m)]."""
        diagonal = np.diag(self.elasticity.stiffness)
        rows = {RELATIVE.index(freedom) for freedom in self.component.freedoms} & set(
            self.elasticity.held
        )
        rows_of = {way: [k for k in at if k in rows] for way, at in SPRINGS.items()}
        return {way: float(1.0 / diagonal[at].mean()) for way, at in rows_of.items() if at}

    def unknowns(self, also: Collection[str]) -> Iterator[Unknown]:
        for way, value in self.compliances.items():
            unit = "rad/(N*m)" if way in ("tilt", "torsional") else "m/N"
            yield Unknown(
                self.joint, f"{way}_compliance", unit, value, value, COMPLIANCE_RANGE * value
            )

    def sunk(self, loads: np.ndarray) -> dict[str, np.ndarray]:
        """Displacements under loads (n, 6), by way: its components, all others zero, (n, 6)."""
        free = ABOUT_AXIS if self.component.springs is None else cast(Any, self.component).free
        total = self.elasticity.sunk(loads, free)
        held = [RELATIVE.index(freedom) for freedom in self.component.freedoms]
        displacements = {}
        for way in self.compliances:
            at = [k for k in SPRINGS[way] if k in held]
            displacements[way] = np.zeros_like(total)
            displacements[way][:, at] = total[:, at]
        return displacements

    def holding(self, values: Mapping[str, float]) -> Clearance:
        softer = {
            way: max(values[f"{way}_compliance"] / nominal, NEGLIGIBLE)
            for way, nominal in self.compliances.items()
            if f"{way}_compliance" in values
        }
        if not softer:
            return self.component
        old, changes = self.elasticity, dict[str, Any]()
        for way, factor in softer.items():
            name = "torsion" if way == "torsional" else way
            if getattr(old, name) is not None:
                changes[name] = getattr(old, name) / factor
            if curve := getattr(old, f"{name}_curve"):
                changes[f"{name}_curve"] = [(x, force / factor) for x, force in curve]
        if old.matrix is not None:  # scaled from both sides, so that it stays positive definite
            root = np.ones(6)
            for way, factor in softer.items():
                root[list(SPRINGS[way])] = factor**-0.5
            changes["matrix"] = (np.array(old.matrix) * np.outer(root, root)).tolist()
        field = "seat" if self.component.springs is None else "elasticity"
        new: dict[str, Any] = {field: replace(old, **changes)}
        return replace(self.component, **new)


class Teeth(Part):
    """A gear: play, compliance of each piece of its curve, hysteresis and lost motion."""

    component: Gearing

    @cached_property
    def stiffness(self) -> tuple[float, ...]:
        """Stiffness of each piece of its curve [N m/rad]: K1, K2 and K3 of strain-wave gears."""
        gear = self.component
        if isinstance(gear, StrainWaveGear):
            pieces = gear.stiffness_1, gear.stiffness_2, gear.stiffness_3
            return tuple(piece for piece in pieces if piece is not None)
        return (cast(Gear | CycloidalGear | GearTrain, gear).stiffness,)

    @property
    def curved(self) -> bool:
        """Whether it may have more than play and one stiffness."""
        return isinstance(self.component, StrainWaveGear | CycloidalGear)

    def unknowns(self, also: Collection[str]) -> Iterator[Unknown]:
        """Unknowns except the compliance, which `Machine` has, as it knows what is given."""
        gear, joint = self.component, self.joint
        if gear.play or isinstance(gear, Gear):
            yield Unknown(joint, "gear_play", "rad", gear.play, gear.play or 1e-3, 1.0)
        if "stiffness" in also:
            for k, piece in enumerate(self.stiffness[1:], 2):
                value = 1.0 / piece
                name, unit = f"gear_compliance_{k}", "rad/(N*m)"
                yield Unknown(joint, name, unit, value, value, COMPLIANCE_RANGE * value)
        if isinstance(gear, StrainWaveGear | CycloidalGear):
            if gear.hysteresis or "hysteresis" in also:
                value = gear.hysteresis
                unknown = Unknown(joint, "hysteresis", "rad", value, value or 2e-4, 1.0)
                yield replace(unknown, model_error=FRICTION_MODEL_ERROR)
            if gear.stated_lost_motion is not None:
                value = gear.stated_lost_motion
                yield Unknown(joint, "lost_motion", "rad", value, value, 1.0)

    def holding(self, values: Mapping[str, float]) -> Gearing:
        names = ("gear_play", "hysteresis", "lost_motion", *WOUND[:3])
        return _geared(self, tuple((name, values[name]) for name in names if name in values))

    def _held(self, values: Mapping[str, float]) -> Gearing:
        gear, changes = cast(Any, self.component), dict[str, Any]()
        if "gear_play" in values:
            if isinstance(gear, GearTrain):
                gear = gear.with_play(values["gear_play"])
            else:
                changes["play"] = values["gear_play"]
        softer = (
            self.stiffness[0] * values["gear_compliance"] if "gear_compliance" in values else 1.0
        )
        for k, piece in enumerate(self.stiffness, 1):
            # A piece without a value of its own follows the first one in proportion.
            give = values.get(f"gear_compliance_{k}", softer / piece)
            name = f"stiffness_{k}" if isinstance(gear, StrainWaveGear) else "stiffness"
            if give != 1.0 / piece:
                changes[name] = 1.0 / max(give, NEGLIGIBLE)
        if not isinstance(gear, StrainWaveGear | CycloidalGear):
            return replace(gear, **changes)
        # Hysteresis and lost motion, each as large as the gear can have it at most.
        stated = values.get("lost_motion", gear.stated_lost_motion)
        changes["hysteresis"] = 0.0
        bare = replace(gear, **changes, stated_lost_motion=None)
        hysteresis = values.get("hysteresis", gear.hysteresis)
        if gear.rated_torque is not None:
            most = 2.0 * float(bare.curve().depth(np.array(_MOST_HYSTERESIS * gear.rated_torque)))
            hysteresis = min(hysteresis, most)
        full = replace(bare, hysteresis=hysteresis)
        if stated is None:
            return full
        least, most = full.lost_motion_range()
        return replace(full, stated_lost_motion=min(max(stated, least), most))


@lru_cache  # a gear with hysteresis solves for its curve
def _geared(part: Teeth, values: tuple[tuple[str, float], ...]) -> Gearing:
    return part._held(dict(values))


def bearing_parts(joint: str, bearing: Clearance) -> list[Part]:
    """Parts of a joint with clearance or springs that can be identified."""
    parts: list[Part] = []
    if isinstance(bearing, RollingBearing):
        parts.append(Elements(joint, bearing))
    elif bearing.clearances:
        parts.append(Journal(joint, bearing))
    if bearing.springs is not None or (
        isinstance(bearing, RollingBearing) and bearing.seat is not None
    ):
        parts.append(Springs(joint, bearing))
    return parts


def with_values(joint: str, bearing: Clearance, values: Mapping[str, float]) -> Clearance:
    """The joint with values of its parts' unknowns by name."""
    for kind in map(type, bearing_parts(joint, bearing)):
        bearing = kind(joint, bearing).holding(values)
    return bearing


def springs_of(mechanism: Mechanism) -> dict[str, Springs]:
    """Springs and seats by joint, except the hinges of flexible links, which are no unknowns."""
    hinges = {hinge for names in mechanism.hinges.values() for hinge in names}
    return {
        joint: part
        for joint, bearing in mechanism.clearance.items()
        for part in bearing_parts(joint, bearing)
        if isinstance(part, Springs) and joint not in hinges
    }


def friction_of(joint: Clearance) -> float | None:
    """Friction coefficient of a journal's law; None where there is none to identify."""
    value = joint.friction.coefficients.get("mu_d")
    known = isinstance(joint.play(False), JournalPlay)
    return None if value is None or not known else float(value)
