"""What can be changed of a scenario while one looks: declared once, by keys of the scenario.

A control is a number in the unit that people use. It becomes the text that a scenario file would
have, ``"0.3 mm"``: the page, a file that is saved and `jointplay run` read the same.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from jointplay.base.errors import JointplayError, MissingName, require_finite
from jointplay.base.schema import explanations
from jointplay.base.units import COMMON, round_below
from jointplay.model.robots import resolve
from jointplay.model.urdf import STANDARD_GRAVITY
from jointplay.physics.joints import Clearance
from jointplay.scenario.load import Scenario, merge
from jointplay.scenario.model import MotionTable
from jointplay.scenario.settings import as_toml

if TYPE_CHECKING:
    from jointplay.simulation.simulation import Simulation

WHOLE = "the machine"
"""Group of what no single joint has."""

_PARTS = {
    "radial_clearance": ("radial clearance", "mm"),
    "clearance": ("clearance", "mm"),
    "clearance_y": ("clearance across", "mm"),
    "axial_clearance": ("axial clearance", "mm"),
    "temperature_difference": ("inner ring warmer than outer", "K"),
    "restitution": ("coefficient of restitution", ""),
}
"""Numbers of a joint with play that can be changed, by key: what they are called, and the unit."""

_TIMES = 20.0
"""A clearance goes from its value divided by this to its value times this."""
_WIDEST = 0.2
"""Clearance at most, part of the bearing's radius."""
_LARGEST = {"temperature_difference": 60.0, "restitution": 0.99, "mu_d": 0.6}
_FASTEST = 3.0
"""Factor of the speed: up to this, and down to its inverse."""
_HEAVIEST = 0.3
"""Payload at most, part of the mass of the machine."""
_STRONGEST = 20.0
"""Gravity at most [m/s^2]."""


@dataclass(frozen=True)
class Control:
    """A number that can be changed.

    Attributes:
        name: by which answers and links know it.
        group: joint, or `WHOLE`.
        label: what it is called.
        unit: of value and range, as text; empty for pure numbers.
        value: at the beginning.
        low, high: range of the slider; a field takes what lies outside, if the scenario does.
        logarithmic: whether the slider's steps are factors.
        help: what the scenario's tables say of it.
        keys: of the scenario that receive it, the first one names it in errors.
        along: for vectors, the direction (3,) that it is multiplied by; else empty.
    """

    name: str
    group: str
    label: str
    unit: str
    value: float
    low: float
    high: float
    logarithmic: bool
    help: str
    keys: tuple[tuple[str, ...], ...]
    along: tuple[float, ...] = ()

    def written(self, value: float) -> Any:
        if self.along:
            return [value * part for part in self.along]
        return f"{value!r} {self.unit}" if self.unit else value


@dataclass(frozen=True)
class State:
    """What can be changed of one case of a scenario, and what it says to begin with.

    Attributes:
        scenario, case: whose.
        controls: by name, in the order in which they stand.
    """

    scenario: Scenario
    case: str
    controls: Mapping[str, Control]

    @classmethod
    def of(cls, scenario: Scenario, case: str, simulation: Simulation) -> State:
        """Find what can be changed; `simulation` is that of the case."""
        controls: dict[str, Control] = {}
        for one in _controls(scenario.data(case), simulation):
            controls[one.name] = one
        return cls(scenario, case, controls)

    def described(self) -> list[dict[str, Any]]:
        return [
            {key: value for key, value in asdict(one).items() if key not in ("keys", "along")}
            for one in self.controls.values()
        ]

    def changes(self, values: Mapping[str, float]) -> dict[str, Any]:
        """Changes of the case, nested as in its file, that give the controls these values.

        Controls that are not named, or have the value of the beginning, change nothing.

        Raises:
            MissingName: no such control.
            JointplayError: not a finite number; `where` is the key.
        """
        made: dict[str, Any] = {}
        for name, value in {**self._beside(values), **values}.items():
            control = self.controls.get(name)
            if control is None:
                raise MissingName("control", name, self.controls)
            value = require_finite(control.label, value, control.unit, where=control.keys[0])
            if value == control.value and name not in self._beside(values):
                continue
            for key in control.keys:
                _put(
                    made, key, self._payloads(value) if key == _PAYLOAD else control.written(value)
                )
        return made

    def _beside(self, values: Mapping[str, float]) -> dict[str, float]:
        """The shown clearances of joints of which one changes: none is to follow another."""
        changed = {
            control.keys[0][:2]
            for name, value in values.items()
            if (control := self.controls.get(name)) is not None and value != control.value
        }
        return {
            name: values.get(name, control.value)
            for name, control in self.controls.items()
            if str(control.keys[0][-1]).endswith("_clearance") and control.keys[0][:2] in changed
        }

    def _payloads(self, mass: float) -> list[dict[str, Any]]:
        """The scenario's payloads, the first with this mass; one at the tool if it has none."""
        given = list(self.scenario.data(self.case).get("payloads", ()))
        if mass < 0.0:
            raise JointplayError(f"payload must be >= 0 kg, got {mass:g}", where=_PAYLOAD)
        first = {**(given[0] if given else {}), "mass": mass}
        return [*([first] if mass > 0.0 else []), *given[1:]]

    def data(self, values: Mapping[str, float]) -> dict[str, Any]:
        return merge(self.scenario.data(self.case), self.changes(values))

    def text(self, values: Mapping[str, float]) -> str:
        """A scenario file with these values, which `jointplay run` runs from any folder.

        Raises:
            JointplayError: what `changes` refuses.
        """
        data, folder = self.data(values), self.scenario.path.parent
        for table, key in (("robot", "urdf"), ("motion", "file")):
            given = data.get(table, {}).get(key)
            if given is not None and ":" not in given:
                data = merge(data, {table: {key: str(resolve(given, folder).resolve())}})
        return as_toml(data)

    def control_at(self, where: Sequence[str | int]) -> str | None:
        """Name of the control whose key an error is at; None if it is at none of them."""
        for one in self.controls.values():
            if any(tuple(where[: len(key)]) == key for key in one.keys):
                return one.name
        return None


_PAYLOAD = ("payloads",)


def _put(table: dict[str, Any], key: Sequence[str], value: Any) -> None:
    for part in key[:-1]:
        table = table.setdefault(part, {})
    table[key[-1]] = value


def _controls(data: Mapping[str, Any], simulation: Simulation) -> Iterator[Control]:
    yield from _of_machine(data, simulation)
    for name, joint in simulation.mechanism.given_joints.items():
        if not joint.ideal:
            yield from _of_joint(name, joint)


def _of_machine(data: Mapping[str, Any], simulation: Simulation) -> Iterator[Control]:
    mechanism, motion = simulation.mechanism, data.get("motion", {})
    texts = explanations(MotionTable)
    for name, speed in motion.get("speeds", {}).items():
        column = None if simulation.motion is None else simulation.motion.joints.index(name)
        if column is None:
            continue
        _, now, _ = simulation.motion(np.zeros(1))  # type: ignore[misc]
        value = float(now[0, column]) if not isinstance(speed, int | float) else float(speed)
        unit = "m/s" if mechanism.description.joints[name].slides else "rad/s"
        low, high = sorted((value / _FASTEST, value * _FASTEST))
        key = ("motion", "speeds", name)
        words = f"speed of {name}"
        yield Control(
            f"speed.{name}", WHOLE, words, unit, value, low, high, False, texts["speeds"], (key,)
        )
    if motion and "speeds" not in motion:
        value = float(motion.get("faster", 1.0))
        span = value / _FASTEST, value * _FASTEST
        yield Control(
            *("speed", WHOLE, "speed of the motion, factor", "", value, *span, True),
            *(" ".join(texts["faster"].split()), (("motion", "faster"),)),
        )
    mass = pin.computeTotalMass(mechanism.ideal().model)
    held = [payload.mass for payload in simulation.payloads]
    most = _nice(_HEAVIEST * mass)
    yield Control(
        *("payload", WHOLE, "payload", "kg", held[0] if held else 0.0, 0.0),
        *(max(most, 2.0 * held[0] if held else 0.0), False),
        *("Mass held by the tool, in its origin if the scenario says no more.", (_PAYLOAD,)),
    )
    gravity = np.array(mechanism.gravity, float)
    size = float(np.linalg.norm(gravity))
    along = (
        gravity / size if size else np.array(STANDARD_GRAVITY) / np.linalg.norm(STANDARD_GRAVITY)
    )
    yield Control(
        *("gravity", WHOLE, "gravity", "m/s^2", size, 0.0, max(_STRONGEST, size), False),
        *("Its direction is the scenario's, or down.", (("robot", "gravity"),), tuple(along)),
    )


def _of_joint(name: str, joint: Clearance) -> Iterator[Control]:
    texts = explanations(type(joint))
    for key, (label, unit) in _PARTS.items():
        value = getattr(joint, key, None)
        if key == "radial_clearance" and value is None:
            value = getattr(joint, "bought_clearance", None)
        if value is None or isinstance(value, str) or math.isinf(value):
            continue
        if key == "axial_clearance" and getattr(joint, "lock_axial", False):
            continue
        shown = float(f"{value / COMMON.get(unit, ('', 1.0))[1]:.12g}")
        low, high, logarithmic = 0.0, _LARGEST.get(key, 1.0), False
        if unit == "mm":
            widest = _WIDEST * joint.outline.size[0] / COMMON[unit][1]
            low, high, logarithmic = _clearances(shown, widest)
        elif key == "temperature_difference":
            low, high = min(-high, shown), max(high, shown)
        words = " ".join(texts.get(key, "").split())
        at = (("joints", name, key),)
        yield Control(f"{name}.{key}", name, label, unit, shown, low, high, logarithmic, words, at)
    friction = getattr(joint, "friction", None)
    if friction is not None and hasattr(friction, "mu_d"):
        mu = ("joints", name, "friction", "mu_d")
        words = "Coefficient of friction of the joint's law."
        high = max(_LARGEST["mu_d"], friction.mu_d)
        yield Control(
            *(f"{name}.friction", name, "coefficient of friction", "", float(friction.mu_d)),
            *(0.0, high, False, words, (mu,)),
        )


def _clearances(value: float, widest: float) -> tuple[float, float, bool]:
    """Range of a clearance that has this value, and whether it is logarithmic [mm]."""
    if value <= 0.0:
        return min(value, 0.0), _nice(min(0.5, widest)), False
    high = max(min(_nice(value * _TIMES), _nice(widest)), value)
    return _nice(value / _TIMES), high, True


def _nice(value: float) -> float:
    """The largest of 1, 2, 5, 10, ... that is no larger; 1 of what is not positive."""
    return round_below(value) if value > 0.0 else 1.0
