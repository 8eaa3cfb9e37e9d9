"""The controls of the live page: numbers of a scenario that can be changed, and their ranges.

A control's value becomes the text that a scenario file would have, ``"0.3 mm"``, under the key of
the scenario: the page, a saved file and `jointplay run` read the same.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from jointplay.base.errors import JointplayError, MissingName, require_finite
from jointplay.base.schema import explanations
from jointplay.base.units import COMMON, round_below
from jointplay.model.robots import resolve
from jointplay.model.urdf import STANDARD_GRAVITY
from jointplay.physics.joints import Clearance
from jointplay.scenario.declarations import MotionTable
from jointplay.scenario.reading import Scenario, as_toml, merge

if TYPE_CHECKING:
    from jointplay.simulation.simulation import Simulation

WHOLE = "the machine"  # group of controls that belong to no single joint

_PARTS = {
    "radial_clearance": ("radial clearance", "mm"),
    "clearance": ("clearance", "mm"),
    "clearance_y": ("clearance across", "mm"),
    "axial_clearance": ("axial clearance", "mm"),
    "temperature_difference": ("inner ring warmer than outer", "K"),
    "restitution": ("coefficient of restitution", ""),
}
"""Numbers of a joint with play that have a control, by key: label and unit."""

# Ranges of the sliders (judged); a field beside each takes values outside.
_CLEARANCE_FACTOR = 20.0  # ratio of a clearance's limits to its value in the scenario
_WIDEST_CLEARANCE = 0.2  # largest clearance relative to the bearing's radius
_MOST_PLAY = 5.0  # largest play of a gear [deg, mm of a screw]
_LARGEST = {"temperature_difference": 60.0, "restitution": 0.99, "mu_d": 0.6}  # [K, 1, 1]
_SPEED_FACTOR = 3.0  # ratio of the limits of a speed to its value in the scenario
_HEAVIEST_PAYLOAD = 0.3  # largest payload relative to the machine's mass
_STRONGEST_GRAVITY = 20.0  # twice the Earth's [m/s^2]


@dataclass(frozen=True)
class Control:
    """A number of the scenario that the page can change."""

    name: str  # identifies it in questions and links
    group: str  # joint, or `WHOLE`
    label: str
    unit: str  # of value and range; empty for pure numbers
    value: float  # the scenario's
    low: float  # range of the slider; the field takes what the scenario allows
    high: float
    help: str  # the explanation of the scenario's key
    key: tuple[str, ...]  # key of the scenario that receives the value
    logarithmic: bool = False  # whether the slider is logarithmic
    along: tuple[float, ...] = ()  # direction (3,) of a vector whose size the control gives

    def written(self, value: float) -> Any:
        """A value as the scenario's file has it."""
        if self.along:
            return [value * part for part in self.along]
        return f"{value!r} {self.unit}" if self.unit else value


@dataclass(frozen=True)
class State:
    """One case of a scenario, and its controls by name."""

    scenario: Scenario
    case: str
    controls: Mapping[str, Control]

    @classmethod
    def of(cls, scenario: Scenario, case: str, simulation: Simulation) -> State:
        """The state of a case, of which `simulation` is built."""
        controls = _controls(scenario.data(case), simulation)
        return cls(scenario, case, {control.name: control for control in controls})

    def described(self) -> list[dict[str, Any]]:
        """The controls as plain data for the page."""
        kept = [field.name for field in fields(Control) if field.name not in ("key", "along")]
        return [
            {name: getattr(control, name) for name in kept} for control in self.controls.values()
        ]

    def changes(self, values: Mapping[str, float]) -> dict[str, Any]:
        """Changes of the case, nested as in its file, that give the controls these values.

        Controls that are not named, or have the scenario's value, change nothing.

        Raises:
            JointplayError: no such control, or not a finite number; `where` is the key.
        """
        changes: dict[str, Any] = {}
        siblings = self._siblings(values)
        for name, value in {**siblings, **values}.items():
            control = self.controls.get(name)
            if control is None:
                raise MissingName("control", name, self.controls)
            *tables, key = control.key
            value = require_finite(control.label, value, control.unit, where=control.key)
            if value != control.value or name in siblings:
                table = changes
                for part in tables:
                    table = table.setdefault(part, {})
                is_payload = control.key == _PAYLOAD
                table[key] = self._payloads(value) if is_payload else control.written(value)
        return changes

    def _siblings(self, values: Mapping[str, float]) -> dict[str, float]:
        """All clearances of joints of which a value changes: they are written out, too, because one
        that the file does not give may follow from another."""
        changed = {
            control.key[:2]
            for name, value in values.items()
            if (control := self.controls.get(name)) is not None and value != control.value
        }
        return {
            name: values.get(name, control.value)
            for name, control in self.controls.items()
            if control.key[-1].endswith("_clearance") and control.key[:2] in changed
        }

    def _payloads(self, mass: float) -> list[dict[str, Any]]:
        """The scenario's payloads with this mass of the first [kg], or a new one at the tool."""
        given = list(self.scenario.data(self.case).get("payloads", ()))
        if mass < 0.0:
            raise JointplayError(f"payload must be >= 0 kg, got {mass:g}", where=_PAYLOAD)
        first = {**(given[0] if given else {}), "mass": mass}
        return [*([first] if mass > 0.0 else []), *given[1:]]

    def text(self, values: Mapping[str, float]) -> str:
        """A scenario file with these values, which `jointplay run` runs from any folder."""
        data = merge(self.scenario.data(self.case), self.changes(values))
        folder = self.scenario.path.parent
        for table, key in (("robot", "urdf"), ("motion", "file")):
            given = data.get(table, {}).get(key)
            if given is not None and ":" not in given:
                data = merge(data, {table: {key: str(resolve(given, folder).resolve())}})
        return as_toml(data)

    def control_at(self, where: Sequence[str | int]) -> str | None:
        """Name of the control whose key an error names (`where`); None if none has that key."""
        for control in self.controls.values():
            if tuple(where[: len(control.key)]) == control.key:
                return control.name
        return None


_PAYLOAD = ("payloads",)


def _controls(data: Mapping[str, Any], simulation: Simulation) -> Iterator[Control]:
    """Controls of the whole machine (motion, payload, gravity), then of its joints and gears."""
    mechanism, motion = simulation.mechanism, data.get("motion", {})
    at: tuple[str, ...]
    slides = {name: joint.slides for name, joint in mechanism.description.joints.items()}
    texts = explanations(MotionTable)
    for name, speed in motion.get("speeds", {}).items():
        if simulation.motion is None:
            continue
        _, now, _ = simulation.motion(np.zeros(1))
        begins = float(now[0, simulation.motion.joints.index(name)])
        value = float(speed) if isinstance(speed, int | float) else begins
        low, high = sorted((value / _SPEED_FACTOR, value * _SPEED_FACTOR))
        unit, at = "m/s" if slides[name] else "rad/s", ("motion", "speeds", name)
        label, text = f"speed of {name}", texts["speeds"]
        yield Control(f"speed.{name}", WHOLE, label, unit, value, low, high, text, at)
    if motion and "speeds" not in motion:
        value = float(motion.get("faster", 1.0))
        low, high = value / _SPEED_FACTOR, value * _SPEED_FACTOR
        label, at = "speed of the motion, factor", ("motion", "faster")
        text = " ".join(texts["faster"].split())
        yield Control("speed", WHOLE, label, "", value, low, high, text, at, logarithmic=True)
    held = next((payload.mass for payload in simulation.payloads), 0.0)
    most = max(_nice(_HEAVIEST_PAYLOAD * pin.computeTotalMass(mechanism.ideal().model)), 2.0 * held)
    text = "Mass held by the tool, in its origin if the scenario says no more."
    yield Control("payload", WHOLE, "payload", "kg", held, 0.0, most, text, _PAYLOAD)
    size = float(np.linalg.norm(mechanism.gravity))
    down = np.array(mechanism.gravity if size else STANDARD_GRAVITY, float)
    along, most = tuple(down / np.linalg.norm(down)), max(_STRONGEST_GRAVITY, size)
    text, at = "Its direction is the scenario's, or down.", ("robot", "gravity")
    yield Control("gravity", WHOLE, "gravity", "m/s^2", size, 0.0, most, text, at, along=along)
    for name, joint in mechanism.given_joints.items():
        if not joint.ideal:
            yield from _joint_controls(name, joint)
    for name, gear in mechanism.gears.items():
        if name in data.get("gears", {}) and "play" in {field.name for field in fields(gear)}:
            kind: Any = type(gear)
            unit, text = "mm" if slides[name] else "deg", explanations(kind)["play"]
            value = float(f"{gear.play / COMMON[unit][1]:.12g}")
            low, high, logarithmic = _clearances(value, _MOST_PLAY)
            label, text, at = "play of the gear", " ".join(text.split()), ("gears", name, "play")
            key = f"{name}.play"
            yield Control(key, name, label, unit, value, low, high, text, at, logarithmic)


def _joint_controls(name: str, joint: Clearance) -> Iterator[Control]:
    """Controls of a joint with play: the numbers of `_PARTS` that it has, and its friction."""
    at: tuple[str, ...]
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
            widest = _WIDEST_CLEARANCE * joint.outline.size[0] / COMMON[unit][1]
            low, high, logarithmic = _clearances(shown, widest)
        elif key == "temperature_difference":
            low, high = min(-high, shown), max(high, shown)
        text, at = " ".join(texts.get(key, "").split()), ("joints", name, key)
        yield Control(f"{name}.{key}", name, label, unit, shown, low, high, text, at, logarithmic)
    mu = getattr(getattr(joint, "friction", None), "mu_d", None)
    if mu is not None:
        label, text = "coefficient of friction", "Coefficient of friction of the joint's law."
        key, at = f"{name}.friction", ("joints", name, "friction", "mu_d")
        yield Control(key, name, label, "", float(mu), 0.0, max(_LARGEST["mu_d"], mu), text, at)


def _clearances(value: float, widest: float) -> tuple[float, float, bool]:
    """Range for a clearance or play of this value [mm or deg], and whether it is logarithmic."""
    if value <= 0.0:
        return min(value, 0.0), _nice(min(0.5, widest)), False
    high = max(min(_nice(value * _CLEARANCE_FACTOR), _nice(widest)), value)
    return _nice(value / _CLEARANCE_FACTOR), high, True


def _nice(value: float) -> float:
    """The largest round number (1, 2, 5, 10, ...) that is no larger; 1 if none is positive."""
    return round_below(value) if value > 0.0 else 1.0
