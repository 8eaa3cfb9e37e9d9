"""What is sought of a machine: clearances, friction, the play of gears, by joint.

Every machine is elastic, and elasticity looks like play to whoever pushes with one force only. So
the compliances of each joint (about and along its axis, across it, in tilt), of each gear and of
the structure at the tool are unknown, too, unless they are given.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.optimize import brentq

from jointplay.base.errors import JointplayError, MissingName
from jointplay.estimate.unknowns import Estimate, Unknown
from jointplay.model.gear import Gear
from jointplay.model.mechanism import Mechanism
from jointplay.physics.joints import Clearance
from jointplay.physics.joints.play import JournalPlay
from jointplay.simulation.loads.drive import JointFriction

ALSO = ("friction",)
"""What of gears is identified only if asked for."""
WAYS = {
    "torsional": "rad/(N*m)",
    "link": "rad/(N*m)",
    "tilt": "rad/(N*m)",
    "radial": "m/N",
    "bush": "m/N",
    "axial": "m/N",
}
"""In which a joint gives way, and the unit of that compliance: about its axis; its link about that
axis, where friction at the joint holds none of it (a joint that winds up has both, others one);
about the axes across; across, along the load; of a bush that gives way across, how much of it turns
aside with the contact's normal where friction does; along."""
TOOL, ALL = "tool", "all"
"""Names of the structure's compliance at the tool, and of everything's."""
WOUND = ("gear_compliance", "torsional_compliance")
"""Names of the unknown by which the torque that a joint transmits turns its link."""
SOFT = {"rad/(N*m)": 1e-5, "m/N": 1e-7}
"""Scales of compliances, by unit."""
_LARGEST = 1e-3
"""Clearance beyond which no bearing is one, unless the scenario says otherwise [m]."""
_LEAST = 1e-9
"""Clearances below it are none [m]."""
_SMALLEST_PART = 0.05
"""Part of a value below which it is not drawn."""
_SOFTEST = 100.0
"""Largest compliance of a gear or of a joint that winds up, by the expected one."""
LINK = 1e-4
"""Deviation of the bending of links from none where a joint winds up, unless the gear is expected
to give way by more [rad/(N m)]: with any number one could make up for the other."""
BUSH = 1e-7
"""Deviation from none of what a bush gives way by along the contact's normal [m/N]: passes under
one load do not tell it from friction, so without a bound no friction could be told from them."""
_TORSION = 1e-5
"""Torsional compliance from which an unknown one is sought [rad/(N m)]."""
_STICKS = 3.0
"""Largest static friction by the dynamic one."""
_TORQUE_N_M = 0.1
"""Scale of a friction of which the scenario says nothing."""


def compliance(label: str, value: float = 0.0, spread: float = math.inf) -> Unknown:
    """One that is known so well before the measurement [rad/(N m) or m/N]."""
    joint, _, way = label.rpartition(" ")
    unit = WAYS.get(way, "m/N")
    return Unknown(
        joint, f"{way}_compliance", unit, value, SOFT[unit], sought=False, spread=spread,
        least=-math.inf,
    )  # fmt: skip


Given = Mapping[str, float | tuple[float, float]]
"""Stiffness by label [N m/rad or N/m], with its relative standard deviation if it is not exact."""


def known_gears(mechanism: Mechanism) -> dict[str, Gear]:
    """The gears of a mechanism, by joint.

    Raises:
        JointplayError: one that is more than play and one stiffness.
    """
    known = {}
    for joint, gear in mechanism.gears.items():
        if not isinstance(gear, Gear):
            where = ("gears", joint, "kind")
            words = f"a {gear.kind} gear has more than the play and stiffness that are identified"
            raise JointplayError(f"{words}; describe it as a {Gear.kind} gear", where)
        known[joint] = gear
    return known


@dataclass(frozen=True)
class Machine:
    """A mechanism with expected play, and what is known of it before a measurement."""

    mechanism: Mechanism
    friction: Mapping[str, JointFriction]
    """Of the joints besides their bearings'."""
    compliances: Mapping[str, Unknown]
    """By label, see `compliances`."""

    def __post_init__(self) -> None:
        known_gears(self.mechanism)

    def compliance(self, label: str) -> Unknown:
        """What is known of it."""
        return self.compliances.get(label) or compliance(label)

    def rigid(self, label: str) -> bool:
        """Whether it is known that there is no compliance."""
        one = self.compliance(label)
        return one.nominal == one.spread == 0.0

    @cached_property
    def wound(self) -> tuple[str, ...]:
        """Joints whose link lags behind the motor by what its torque and dry friction wind up.

        Those with gears, and all others that turn, are not rigid about their axis and have dry
        friction that holds the link where it is: the lag depends on the way there.
        """
        gears, entries = self.mechanism.gears, self.mechanism.description.joints
        return tuple(gears) + tuple(
            joint
            for joint in self.mechanism.joints
            if joint not in gears
            and self.friction.get(joint, JointFriction()).coulomb > 0.0
            and joint in entries
            and not entries[joint].slides
            and not self.rigid(f"{joint} torsional")
        )

    def unknowns(
        self,
        torques: Collection[str],
        stops: bool,
        also: Collection[str] = (),
        known: Collection[str] = (),
    ) -> tuple[Unknown, ...]:
        """All unknowns, but compliances that move the tool in proportion to loads.

        Friction is sought only at joints that have some in the scenario.

        Args:
            torques: joints whose torque is measured: their friction is sought.
            stops: whether there are stops, at which an unknown part of the friction stays.
            also: of `ALSO`: dry friction behind all gears.
            known: labels or names of unknowns that are taken from the scenario.

        Raises:
            JointplayError: nothing is sought; an unknown name in `also` or `known`; the clearance
                of a rolling bearing, unless it is known.
        """
        mechanism, friction = self.mechanism, self.friction
        if not mechanism.clearance and not mechanism.gears:
            raise JointplayError(
                'nothing has play: give clearance (--clearance "0.1 mm", --joint NAME="0.1 mm") or '
                f"gears with play; joints: {', '.join(mechanism.joints)}"
            )
        found = []
        for joint, bearing in mechanism.clearance.items():
            for name, value in bearing.clearances.items():
                most = max(_LARGEST, 10.0 * value)
                found.append(Unknown(joint, name, "m", value, value, most))
            if coefficient := friction_of(bearing):
                one = Unknown(joint, "friction", "", coefficient, coefficient, 2.0, model_error=0.1)
                found.append(one)
        rubs = any(one.name == "friction" for one in found)
        for joint, gear in known_gears(mechanism).items():
            found.append(Unknown(joint, "gear_play", "rad", gear.play, gear.play or 1e-3, 1.0))
            found += self._compliance(joint, "gear_compliance", 1.0 / gear.stiffness)
        wound = [joint for joint in self.wound if joint not in mechanism.gears]
        for joint in wound:
            found += self._compliance(joint, "torsional_compliance", _TORSION)
        dry = [name for name, one in friction.items() if one.coulomb > 0.0]
        behind = [joint for joint in mechanism.gears if "friction" in also or joint in dry]
        for joint in dict.fromkeys([*torques, *behind, *wound]):
            value = friction[joint].coulomb if joint in friction else 0.0
            unit = "N" if mechanism.description.joints[joint].slides else "N*m"
            found.append(Unknown(joint, "dry_friction", unit, value, value or _TORQUE_N_M, 1e6))
            if joint in behind or joint in wound:
                ratio = 1.0 + friction[joint].excess / value if value else 1.0
                found.append(Unknown(joint, "stiction", "", ratio, 1.0, _STICKS, sought=False))
        if stops and rubs:
            found.append(Unknown("", "friction_kept_at_stops", "", 0.5, 0.5, 1.0, sought=False))
        for word in also:
            if word not in ALSO:
                raise MissingName("unknown to identify besides", word, ALSO)
        for word in known:
            if not any(word in (one.label, one.name) for one in found):
                labels = ", ".join(one.label for one in found)
                raise JointplayError(f"no unknown {word!r}; there are: {labels}")
        kept = tuple(one for one in found if not {one.label, one.name} & set(known))
        for one in kept:
            bought = mechanism.clearance.get(one.joint)
            if bought and bought.resultant is not None and one.name in bought.clearances:
                raise JointplayError(
                    f"the clearance of the rolling bearing in {one.joint!r} cannot be identified: "
                    "its balls or rollers give way by as much as its play, which the static model "
                    f"leaves out; take it as known: --known {one.label!r}"
                )
        if not any(one.sought for one in kept):
            raise JointplayError("everything is given as known: nothing is left to identify")
        return kept

    def _compliance(self, joint: str, name: str, expected: float) -> list[Unknown]:
        """The unknown by which a joint winds up, unless its compliance is given exactly."""
        one = self.compliance(f"{joint} torsional")
        if one.spread == 0.0:
            return []
        value = one.nominal or expected
        most = _SOFTEST * value
        return [Unknown(joint, name, "rad/(N*m)", value, value, most, spread=one.spread)]


def labels(mechanism: Mechanism) -> list[str]:
    """Of all stiffnesses that can be given: ``elbow torsional``, ``elbow``, ``tool``, ``all``."""
    joints = list(dict.fromkeys([*mechanism.joints, *mechanism.clearance]))
    return [f"{name} {way}" for name in joints for way in WAYS] + [*joints, TOOL, ALL]


def compliances(mechanism: Mechanism, given: Given) -> dict[str, Unknown]:
    """What stiffnesses that are given say of compliances, by label.

    Args:
        mechanism: whose.
        given: an infinite one is rigid. That of a joint without a way is its torsional one (of the
            gear, where it has one); where it is infinite, the joint is rigid in all ways. ``all``
            can be infinite only: everything is rigid of which nothing else is said, but gears.

    Raises:
        MissingName: no such label.
        JointplayError: a stiffness or a deviation that cannot be.
    """
    known: dict[str, Unknown] = {}
    for name in mechanism.joints:
        gear = known_gears(mechanism).get(name)
        spread = LINK if gear is None else max(LINK, 1.0 / gear.stiffness)
        known[f"{name} link"] = compliance(f"{name} link", spread=spread)
    bushes = [f"{name} bush" for name in mechanism.clearance]
    known |= {label: compliance(label, spread=BUSH) for label in bushes}
    for label in sorted(given, key=lambda one: (one != ALL, " " in one)):
        entry = given[label]
        stiffness, part = entry if isinstance(entry, tuple) else (entry, 0.0)
        if label not in labels(mechanism):
            raise MissingName("stiffness", label, labels(mechanism))
        if not stiffness > 0.0 or not 0.0 <= part < math.inf:
            raise JointplayError(
                f"stiffness of {label!r} must be positive: {stiffness!r}, {part!r}"
            )
        rigid = math.isinf(stiffness)
        if label == ALL:
            if not rigid:
                raise JointplayError(f"stiffness of 'all' can only be inf (rigid): {stiffness!r}")
            geared = [f"{name} torsional" for name in mechanism.gears]
            meant = [name for name in labels(mechanism) if name not in geared]
        elif " " in label or label == TOOL:
            meant = [label]
        else:
            meant = [f"{label} {way}" for way in (WAYS if rigid else ("torsional",))]
        known |= {name: compliance(name, 1.0 / stiffness, part / stiffness) for name in meant}
    return known


def friction_of(joint: Clearance) -> float | None:
    """Friction coefficient of a journal's law; None where it has none that could be told."""
    value = joint.friction.coefficients.get("mu_d")
    known = isinstance(joint.play(False), JournalPlay)
    return None if value is None or not known else float(value)


def with_clearance(joint: Clearance, values: Mapping[str, float]) -> Clearance:
    """The joint with other clearances [m] or another ``friction``; a static one keeps its ratio."""
    sizes = {name: max(value, _LEAST) for name, value in values.items() if name != "friction"}
    changed = joint.with_clearances(sizes)
    if "friction" in values:
        known, asked = joint.friction.coefficients, values["friction"]
        law = joint.friction.scaled(asked / known["mu_d"]) if known["mu_d"] > 0.0 else None
        rough: dict[str, float] = dict.fromkeys(known, asked)
        changed = changed.with_friction(law or replace(joint.friction, **rough))
    return changed


def delivered(joint: Clearance, nominal: float) -> float:
    """Restitution that impacts have with a nominal one."""
    value = joint.normal.effective_restitution(nominal)
    return nominal if value is None else float(value)


def nominal_of(joint: Clearance, value: float) -> float:
    """The nominal restitution with which the joint's law delivers a value; nan if it cannot."""
    ends = [delivered(joint, end) - value for end in (1e-3, 1.0)]
    if ends[0] * ends[1] > 0.0:
        return np.nan
    return float(brentq(lambda nominal: delivered(joint, nominal) - value, 1e-3, 1.0, xtol=1e-6))


def apply(mechanism: Mechanism, found: Sequence[Estimate]) -> Mechanism:
    """The mechanism with those values that are identified, and that it can have."""
    joints, gears = dict(mechanism.clearance), known_gears(mechanism)
    for one in found:
        joint, name, value = one.joint, one.unknown.name, one.value
        if one.reason or not joint:
            continue
        if name == "gear_play":
            gears[joint] = replace(gears[joint], play=value)
        elif name == "gear_compliance":
            gears[joint] = replace(gears[joint], stiffness=1.0 / max(value, 1e-12))
        elif name == "restitution":  # what its law can deliver
            if math.isfinite(nominal := nominal_of(joints[joint], value)):
                joints[joint] = joints[joint].with_restitution(nominal)
        elif joint in joints and name in (*joints[joint].clearances, "friction"):
            joints[joint] = with_clearance(joints[joint], {name: value})
    return mechanism.with_clearance(joints, gears)


def drawn(
    mechanism: Mechanism, found: Sequence[Estimate], random: np.random.Generator
) -> Mechanism:
    """The mechanism with values as they may be, by the standard deviations of what was found."""
    values = [
        replace(one, value=max(one.value + one.deviation * random.standard_normal(),
                               _SMALLEST_PART * one.value))
        for one in found
        if one.identified
    ]  # fmt: skip
    most = [replace(one, value=min(one.value, one.unknown.most)) for one in values]
    return apply(mechanism, most)
