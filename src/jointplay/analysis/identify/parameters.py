"""What is sought: clearances, friction, the play of gears, each with its place in the mechanism."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

from jointplay.errors import JointplayError, MissingName
from jointplay.joints import Clearance
from jointplay.joints.play import JournalPlay
from jointplay.loads.drive import JointFriction
from jointplay.mechanism.mechanism import Mechanism

SCALES = {"m": (1e6, "um"), "rad": (1e3, "mrad"), "N*m": (1.0, "N m"), "N": (1.0, "N")}
"""Factor and unit in which values are printed."""
ALSO = ("compliance", "friction")
"""What of gears is identified only if asked for."""
_LARGEST = 1e-3
"""Clearance beyond which no bearing is one, unless the scenario says otherwise [m]."""
_LEAST = 1e-9
"""Clearances below it are none [m]."""
_FRICTION = 0.1
_TORQUE_N_M = 0.1
"""Scale of a friction of which the scenario says nothing."""


@dataclass(frozen=True)
class Parameter:
    """One unknown."""

    joint: str
    """Whose it is; empty for one of all joints."""
    name: str
    """``radial_clearance``, ``friction``, ``play`` and so on."""
    unit: str
    """SI; empty for a pure number."""
    nominal: float
    """Of the scenario."""
    scale: float
    """Size that matters; steps and thresholds are relative to it."""
    most: float
    """Largest value that can be."""
    sought: bool = True
    """Not if it is estimated only because it must be."""

    @property
    def label(self) -> str:
        """As tables have it."""
        words = self.name.replace("_", " ")
        return f"{self.joint} {words}" if self.joint else words

    def shown(self, value: float) -> str:
        """A value in the unit of tables."""
        factor, unit = SCALES.get(self.unit, (1.0, self.unit))
        return f"{factor * value:.4g} {unit}".rstrip()


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
        changed = replace(changed, friction=law or replace(joint.friction, **rough))
    return changed


def unknowns(
    mechanism: Mechanism,
    friction: Mapping[str, JointFriction],
    torques: Collection[str],
    stops: bool,
    also: Collection[str] = (),
    known: Collection[str] = (),
) -> tuple[Parameter, ...]:
    """All unknowns of a mechanism.

    Args:
        mechanism: its joints with clearance and gears with play.
        friction: of the joints besides their bearings'.
        torques: joints whose torque is measured: their friction is sought.
        stops: whether there are stops, at which an unknown part of the friction stays.
        also: of `ALSO`: the compliance of the gears' teeth, dry friction behind all gears.
        known: labels or names of unknowns that are taken from the scenario.

    Raises:
        JointplayError: nothing is sought; a name in `also` or `known` that there is not.
    """
    if not mechanism.clearance and not mechanism.gears:
        raise JointplayError(
            "nothing has play: give joints with clearance, or gears with play; joints: "
            + ", ".join(mechanism.joints)
        )
    parameters = []
    rubs = False
    for joint, bearing in mechanism.clearance.items():
        for name, value in bearing.clearances.items():
            most = max(_LARGEST, 10.0 * value)
            parameters.append(Parameter(joint, name, "m", value, value, most))
        coefficient = friction_of(bearing)
        if coefficient is not None:
            rubs = True
            scale = coefficient or _FRICTION
            parameters.append(Parameter(joint, "friction", "", coefficient, scale, 2.0))
    for joint, gear in mechanism.gears.items():
        parameters.append(Parameter(joint, "gear_play", "rad", gear.play, gear.play or 1e-3, 1.0))
        if "compliance" in also:
            value = 1.0 / gear.stiffness
            parameters.append(
                Parameter(joint, "gear_compliance", "rad/(N*m)", value, value, 1e3 * value)
            )
    behind = mechanism.gears if "friction" in also else ()
    for joint in dict.fromkeys([*torques, *behind]):
        value = friction[joint].coulomb if joint in friction else 0.0
        slides = mechanism.description.joints[joint].slides
        unit = "N" if slides else "N*m"
        parameters.append(Parameter(joint, "dry_friction", unit, value, value or _TORQUE_N_M, 1e6))
    if stops and rubs:
        parameters.append(Parameter("", "friction_kept_at_stops", "", 0.5, 0.5, 1.0, sought=False))
    _check(also, known, parameters)
    kept = tuple(one for one in parameters if not {one.label, one.name} & set(known))
    if not any(one.sought for one in kept):
        raise JointplayError("everything is said to be known: nothing is left to identify")
    return kept


def _check(
    also: Collection[str], known: Collection[str], parameters: Collection[Parameter]
) -> None:
    for word in also:
        if word not in ALSO:
            raise MissingName("unknown to identify besides", word, ALSO)
    names = {one.label for one in parameters} | {one.name for one in parameters}
    for word in known:
        if word not in names:
            raise JointplayError(
                f"no unknown {word!r}; there are: {', '.join(one.label for one in parameters)}"
            )
