"""A machine before a measurement: its unknowns with their priors, by joint.

The unknowns of bearings, springs and gears are those of their `parts`. Every machine is elastic,
and elasticity looks like play to whoever pushes with one force only. So the compliances of each
joint (about and along its axis, across it, in tilt), of each gear and of the structure at the tool
are unknown, too, unless their stiffness is given (`compliances`).

After a measurement, `apply` puts the estimates into the mechanism, `preset_found` into a preset.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from jointplay.base.errors import JointplayError, NothingHasPlay, require_known
from jointplay.estimate import parts
from jointplay.estimate.unknowns import PLAYS, Estimate, Unknown
from jointplay.model.gear import Gear
from jointplay.model.mechanism import Mechanism
from jointplay.simulation.loads.drive import JointFriction

if TYPE_CHECKING:
    from jointplay.scenario.presets import Origin, Preset

WAYS = {
    "torsional": "rad/(N*m)",
    "link": "rad/(N*m)",
    "tilt": "rad/(N*m)",
    "radial": "m/N",
    "bush": "m/N",
    "axial": "m/N",
}
"""Ways in which a joint gives way, and the unit of that compliance.

``torsional``: about its axis. ``link``: its link about that axis, where friction at the joint holds
none of it (a joint that winds up has both, others one). ``tilt``: about the axes across.
``radial``: across, along the load. ``bush``: of a bush that gives way across, how much of it turns
aside with the contact's normal where friction does. ``axial``: along the axis.
"""
TOOL, ALL = "tool", "all"
"""Labels of the structure's compliance at the tool, and of all compliances together."""
COMPLIANCE_SCALES = {"rad/(N*m)": 1e-5, "m/N": 1e-7}
"""Scales of compliances, by unit, from which unknown ones are sought (judged: of stiff robots)."""
_BY_MOTOR = {"kind": "computed-torque", "encoder": "motor"}
"""Drive of joints with gears of whose drive nothing else is known: play shows by such encoders."""
LINK_SPREAD = 1e-4
"""Prior deviation from none of the bending of links where a joint winds up, unless the gear is
expected to give way by more [rad/(N m)]: without a prior, link and gear could make up for each
other (judged: from 3e-5 to 3e-4 the same is told of 11 machines of
benchmarks/truth/identify.py)."""
LINK_SPREAD_BY_GEAR = 0.15
"""Prior deviation of the bending of links beside gears with a curve or hysteresis, as a part of the
gear's expected compliance: where their laws are exact they would tell one from the other, but no
gear follows them so closely (judged: from 0.1 to 0.25 the same is told of these 11 machines)."""
_LARGEST_STICTION = 3.0
"""Largest static friction, as a multiple of the dynamic one (judged: from 2 to 5 the same is told
of these 11 machines)."""
KEPT_AT_STOPS = 0.5
"""Expected part of friction that is kept at a stop: the middle of what is possible, 0 to 1."""
_FRICTION_N_M = 0.1
"""Scale of a friction of which the scenario says nothing, where its search begins (judged: from
0.03 to 0.3 the same is told of these 11 machines)."""


def compliance(label: str, value: float = 0.0, spread: float = math.inf) -> Unknown:
    """Compliance of a label with its prior's mean and deviation [rad/(N m) or m/N]."""
    joint, _, way = label.rpartition(" ")
    unit = WAYS.get(way, "m/N")
    return Unknown(
        joint, f"{way}_compliance", unit, value, COMPLIANCE_SCALES[unit], sought=False,
        spread=spread, least=-math.inf,
    )  # fmt: skip


Given = Mapping[str, float | tuple[float, float]]
"""Given stiffness by label [N m/rad or N/m], with its relative standard deviation if not exact."""


@dataclass(frozen=True)
class Machine:
    """A mechanism with expected play, and what is known of it before a measurement."""

    mechanism: Mechanism
    friction: Mapping[str, JointFriction]
    """Friction of joints besides that of their bearings, by joint."""
    compliances: Mapping[str, Unknown]
    """Compliances of which something is known, by label, see `compliances`."""

    @cached_property
    def springs(self) -> dict[str, parts.Springs]:
        """Springs and seats whose compliances are sought, unless they are given, by joint."""
        return parts.springs_of(self.mechanism)

    def compliance(self, label: str) -> Unknown:
        """Compliance of a label with its prior; without one if nothing is known of it."""
        return self.compliances.get(label) or compliance(label)

    def rigid(self, label: str) -> bool:
        """Whether it is known that there is no such compliance."""
        prior = self.compliance(label)
        return prior.nominal == prior.spread == 0.0

    @cached_property
    def wound(self) -> tuple[str, ...]:
        """Joints that wind up: their link lags behind the motor, by the way there (`windup`).

        These are joints with a gear, and others that turn, are not rigid about their axis and have
        dry friction that holds the link.
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
        links: Collection[str] = (),
    ) -> tuple[Unknown, ...]:
        """All unknowns, except compliances that are nuisances (`model.Elastic`).

        Friction of bearings is sought only where the scenario has some.

        Args:
            torques: joints whose torque is measured: their friction is sought.
            stops: whether there are stops, at which an unknown part of the friction is kept.
            also: what else is sought, of `parts.ALSO`.
            known: labels or names of unknowns that are taken from the scenario.
            links: joints with an encoder behind their gear, which tells the gear from the link.

        Raises:
            JointplayError: nothing is sought; an unknown name in `also` or `known`.
        """
        for word in also:
            require_known("unknown to identify besides", word, parts.ALSO)
        mechanism = self.mechanism
        if not mechanism.clearance and not mechanism.gears:
            raise NothingHasPlay(mechanism.joints)
        sliding = [n for n in mechanism.gears if mechanism.description.joints[n].slides]
        if sliding:
            raise JointplayError(
                f"gears of joints that slide ({', '.join(sliding)}) are not identified from "
                "recordings; readings of a dial gauge tell their play and compliance"
            )
        unknowns = [*self._of_bearings(also), *self._of_gears(also, links)]
        for joint in self.wound:
            if joint not in mechanism.gears:
                expected = COMPLIANCE_SCALES["rad/(N*m)"]
                name = "torsional_compliance"
                unknowns += self._compliance(joint, "torsional", name, expected)
        unknowns += self._of_dry_friction(torques, also)
        if stops and any(unknown.name == "friction" for unknown in unknowns):
            half, name = KEPT_AT_STOPS, "friction_kept_at_stops"
            unknowns.append(Unknown("", name, "", half, half, 1.0, sought=False))
        labels = [{unknown.label, unknown.name} for unknown in unknowns]
        for word in known:
            if not any(word in either for either in labels):
                choices = ", ".join(unknown.label for unknown in unknowns)
                raise JointplayError(f"no unknown {word!r}; there are: {choices}")
        remaining = tuple(
            unknown for unknown, either in zip(unknowns, labels, strict=True)
            if not either & set(known)
        )  # fmt: skip
        if not any(unknown.sought for unknown in remaining):
            raise JointplayError("everything is given as known: nothing is left to identify")
        return remaining

    def _of_bearings(self, also: Collection[str]) -> Iterator[Unknown]:
        """Clearances and friction of bearings, and compliances of springs and seats."""
        for joint, bearing in self.mechanism.clearance.items():
            for part in parts.bearing_parts(joint, bearing):
                if not isinstance(part, parts.Springs):
                    yield from part.unknowns(also)
                elif joint in self.springs:
                    for spring in part.unknowns(also):
                        way = spring.name.removesuffix("_compliance")
                        for soft in self._compliance(joint, way, spring.name, spring.nominal):
                            yield replace(soft, model_error=parts.LOAD_ERROR)

    def _of_gears(self, also: Collection[str], links: Collection[str]) -> Iterator[Unknown]:
        """Play, compliance and hysteresis of gears.

        Compliances of a gear with a curve are only nearly right, unless an encoder on the link
        tells the gear's twist from the bending of the link.
        """
        for joint, gear in self.mechanism.gears.items():
            teeth = parts.Teeth(joint, gear)
            of_teeth = list(teeth.unknowns(also))
            plays = [unknown for unknown in of_teeth if unknown.name == "gear_play"]
            give = self._compliance(joint, "torsional", "gear_compliance", 1.0 / teeth.stiffness[0])
            rough = parts.LOAD_ERROR if joint in links else LINK_SPREAD_BY_GEAR
            for unknown in (*plays, *give, *(x for x in of_teeth if x not in plays)):
                bends = teeth.curved and unknown.name in parts.WOUND
                yield replace(unknown, model_error=rough) if bends else unknown

    def _of_dry_friction(
        self, torques: Collection[str], also: Collection[str]
    ) -> Iterator[Unknown]:
        """Dry friction of joints whose torque is measured, and of those that wind up by it.

        At the latter it may be larger while they stick.
        """
        gears, friction = self.mechanism.gears, self.friction
        dry = [joint for joint, law in friction.items() if law.coulomb > 0.0]
        winding = [joint for joint in gears if "friction" in also or joint in dry]
        winding += [joint for joint in self.wound if joint not in gears]
        for joint in dict.fromkeys([*torques, *winding]):
            value = friction[joint].coulomb if joint in friction else 0.0
            unit = "N" if self.mechanism.description.joints[joint].slides else "N*m"
            yield Unknown(joint, "dry_friction", unit, value, value or _FRICTION_N_M)
            if joint in winding:
                ratio = 1.0 + friction[joint].excess / value if value else 1.0
                yield Unknown(joint, "stiction", "", ratio, 1.0, _LARGEST_STICTION, sought=False)

    def _compliance(self, joint: str, way: str, name: str, expected: float) -> list[Unknown]:
        """Compliance of a joint as an unknown of this name; none if it is given exactly."""
        stated = self.compliance(f"{joint} {way}")
        if stated.spread == 0.0:
            return []
        value = stated.nominal or expected
        most = parts.COMPLIANCE_RANGE * value
        return [Unknown(joint, name, WAYS[way], value, value, most, spread=stated.spread)]


def labels(mechanism: Mechanism) -> list[str]:
    """Labels of all stiffnesses that can be given: ``elbow tilt``, ``elbow``, ``tool``, ``all``."""
    joints = list(dict.fromkeys([*mechanism.joints, *mechanism.clearance]))
    return [f"{name} {way}" for name in joints for way in WAYS] + [*joints, TOOL, ALL]


def compliances(mechanism: Mechanism, stated: Given) -> dict[str, Unknown]:
    """Compliances of which something is known, by label, from given stiffnesses.

    Args:
        mechanism: whose.
        stated: given stiffness by label; an infinite one is rigid. That of a joint without a way is
            its torsional one (of the gear, where it has one); where it is infinite, the joint is
            rigid in all ways. ``all`` can only be infinite: everything is rigid of which nothing
            else is said, except gears, springs and seats.

    Raises:
        MissingName: no such label.
        JointplayError: a stiffness or a deviation that cannot be.
    """
    known: dict[str, Unknown] = {}
    # Priors without which other unknowns could not be told, unless something is given.
    for name in mechanism.joints:
        spread = LINK_SPREAD
        if name in mechanism.gears:
            teeth = parts.Teeth(name, mechanism.gears[name])
            give = 1.0 / teeth.stiffness[0]
            spread = LINK_SPREAD_BY_GEAR * give if teeth.curved else max(LINK_SPREAD, give)
        known[f"{name} link"] = compliance(f"{name} link", spread=spread)
    bushes = [f"{name} bush" for name in mechanism.clearance]
    # Passes under one load do not tell it from friction: without a bound no friction could be told.
    known |= {label: compliance(label, spread=COMPLIANCE_SCALES["m/N"]) for label in bushes}
    # The general first, for the special overrides it: all, a joint or the tool, a way of a joint.
    for label in sorted(stated, key=lambda label: (label != ALL, " " in label)):
        entry = stated[label]
        stiffness, part = entry if isinstance(entry, tuple) else (entry, 0.0)
        require_known("stiffness", label, labels(mechanism))
        if not stiffness > 0.0 or not 0.0 <= part < math.inf:
            raise JointplayError(
                f"stiffness of {label!r} must be positive: {stiffness!r}, {part!r}"
            )
        rigid = math.isinf(stiffness)
        if label == ALL:
            if not rigid:
                raise JointplayError(f"stiffness of 'all' can only be inf (rigid): {stiffness!r}")
            soft = {f"{name} torsional" for name in mechanism.gears}
            for name, springs in parts.springs_of(mechanism).items():
                soft |= {f"{name} {way}" for way in springs.compliances}
            meant = [name for name in labels(mechanism) if name not in soft]
        elif " " in label or label == TOOL:
            meant = [label]
        else:
            meant = [f"{label} {way}" for way in (WAYS if rigid else ("torsional",))]
        known |= {name: compliance(name, 1.0 / stiffness, part / stiffness) for name in meant}
    return known


def apply(mechanism: Mechanism, estimates: Sequence[Estimate]) -> Mechanism:
    """The mechanism with the estimates that have no reason against them, as far as it has parts for
    them."""
    joints, gears = dict(mechanism.clearance), dict(mechanism.gears)
    values: dict[str, dict[str, float]] = {}
    for estimate in estimates:
        if not estimate.reason and estimate.joint:
            values.setdefault(estimate.joint, {})[estimate.unknown.name] = estimate.value
    for joint, identified in values.items():
        if joint in joints:
            joints[joint] = parts.with_values(joint, joints[joint], identified)
        if joint in gears:
            gears[joint] = parts.Teeth(joint, gears[joint]).holding(identified)
    return mechanism.with_clearance(joints, gears)


def preset_found(
    mechanism: Mechanism,
    estimates: Sequence[Estimate],
    source: str,
    robot: str | Path | None = None,
    tables: Mapping[str, Mapping[str, Any]] = MappingProxyType({}),
) -> Preset:
    """A preset of the mechanism's joints with their estimates, each number with its origin.

    Args:
        mechanism: as the scenario has it.
        estimates: of its unknowns.
        source: name of the measurement.
        robot: name or path; None: the file of its URDF.
        tables: see `Preset.of_mechanism`.
    """
    from jointplay.scenario.presets import Preset

    traced = (_origin(estimate, source) for estimate in estimates)
    origins = [origin for origin in traced if origin.value]
    place = str(robot or mechanism.description.path)
    title = f"{Path(place).stem} as measured by {source}"
    gears = {name: dict(entry) for name, entry in tables.get("gear", {}).items()}
    # Joints that have no gear in the scenario get one of their play and compliance.
    for estimate in estimates:
        name, nonzero = estimate.unknown.name, not estimate.reason and estimate.value > 0.0
        if nonzero and estimate.joint not in mechanism.gears:
            if name == "gear_play":
                gears.setdefault(estimate.joint, {})["play"] = (
                    estimate.upper if estimate.bounded else estimate.value
                )
            elif name == "gear_compliance":
                gears.setdefault(estimate.joint, {"play": 0.0})["stiffness"] = 1.0 / estimate.value
    drives = dict.fromkeys([*mechanism.gears, *gears], _BY_MOTOR) | dict(tables.get("drive", {}))
    tables = dict(tables) | {"gear": gears, "drive": drives}
    return Preset.of_mechanism(apply(mechanism, estimates), title, origins, tables, place)


def _origin(estimate: Estimate, source: str) -> Origin:
    """Origin of a preset's number that is an estimate's; a compliance stands as a stiffness."""
    from jointplay.scenario.presets import QUANTITIES, Origin

    name, unknown = estimate.unknown.name, estimate.unknown
    key = next((key for key, quantity in QUANTITIES.items() if quantity == name), f"bearing.{name}")
    key = f"{estimate.joint}.{key}"
    if estimate.reason:
        why = f"of the scenario; {source} cannot tell: {estimate.reason}"
        return Origin(key=key, value=unknown.shown(unknown.nominal), origin="assumed", source=why)
    value, ends = estimate.value, estimate.interval
    if estimate.bounded:
        value, ends = estimate.upper, (0.0, estimate.upper)
    stiffness, interval = key.endswith("stiffness"), tuple(map(float, ends))
    if math.isinf(ends[1]):
        why, interval = estimate.span, ()
    elif stiffness and min(value, *ends) <= 0.0:
        why, interval = "its compliance", ()
    else:
        if stiffness:
            value, interval = 1.0 / value, (1.0 / ends[1], 1.0 / ends[0])
            unit = "N/m" if unknown.unit == "m/N" else "N*m/rad"
            unknown = replace(unknown, unit=unit, fine=False)
        why = "95 % interval {} to {}".format(*map(unknown.shown, interval))
    return Origin(
        key=key, value=unknown.shown(value), origin="measured", source=f"{why}; {source}",
        interval=interval,
    )  # fmt: skip


def worst_at_ends(
    mechanism: Mechanism,
    intervals: Mapping[tuple[str, str], tuple[float, float]],
    *about: Any,
    **options: Any,
) -> list[str]:
    """Text of the worst case with all plays at the lower, and at the upper ends of their intervals.

    None if no play has an interval. `about` and `options` are those of `budget`.
    """
    from jointplay.accuracy.error_budget import budget

    plays = {key: ends for key, ends in intervals.items() if key[1] in PLAYS}
    if not plays:
        return []
    low, high = (
        budget(with_plays(mechanism, {key: plays[key][k] for key in plays}), *about, **options)
        for k in (0, 1)
    )
    worst = " to ".join(f"{1e3 * float(errors.worst.max()):.4g}" for errors in (low, high))
    ends = "with measured plays at the ends of their 95 % intervals"
    return [f"{ends}: worst case {worst} m{getattr(low, 'unit', 'm')}"]


def with_plays(mechanism: Mechanism, plays: Mapping[tuple[str, str], float]) -> Mechanism:
    """The mechanism with plays by joint and name, such as ``("elbow", "gear_play")`` [SI].

    Joints without a gear get one, of which only the play counts.
    """
    gears = dict(mechanism.gears)
    for joint, name in plays:
        if name == "gear_play" and joint not in gears:
            gears[joint] = Gear(0.0)
    mechanism = mechanism.with_clearance(mechanism.clearance, gears)
    values = [Estimate(Unknown(*key, "m"), value=value) for key, value in plays.items()]
    return apply(mechanism, values)
