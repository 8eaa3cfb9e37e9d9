"""Random copies of a robot with play: numbers drawn within what was identified, or assumed."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from jointplay.base.errors import JointplayError, MissingName, require_non_negative
from jointplay.base.tables import Column, Table
from jointplay.bridges.reduction import Reduction
from jointplay.model.mechanism import Mechanism
from jointplay.scenario.presets import Preset, preset
from jointplay.simulation.loads.drive import Servo

QUANTITIES = {
    "half_play": "rad",
    "friction": "N m",
    "stiffness": "N m/rad",
    "motor_friction": "N m",
    "tilt": "rad",
}
"""What is drawn of each joint, and in which unit; the last two only MJCF has, the servo's friction
and how far the axis can tilt."""
_DRAWN = ("gear_play", "gear_compliance", "dry_friction", "friction")
"""Unknowns of measurements that these follow from."""


@dataclass(frozen=True)
class Interval:
    """From where to where a number of a joint is drawn, each value as likely as any other."""

    joint: str
    quantity: str
    """Of `QUANTITIES`."""
    low: float
    high: float
    origin: str
    """``identified``, or ``assumed``."""

    @property
    def label(self) -> str:
        return f"{self.joint} {self.quantity} [{QUANTITIES[self.quantity]}]"


def intervals(
    mechanism: Mechanism,
    reductions: Iterable[Reduction],
    spread: float,
    identified: Mapping[str, Any] | None = None,
    servos: Mapping[str, Servo] = MappingProxyType({}),
    tilting: Iterable[str] = (),
) -> list[Interval]:
    """Intervals of half play, friction, stiffness and tilt of each joint, and its servo's friction.

    Args:
        spread: half width, relative, of what was not identified: an assumption.
        identified: what `Identification.describe` says, the contents of ``identified.json``; of a
            preset `measured_intervals`.
            Gear play, gear compliance and dry friction are taken as they are; the coefficient of
            friction scales the bearing's part of the friction. A clearance gives no dead band about
            the axis, and is not drawn; the tilt is, within the spread.
        tilting: joints whose axes tilt in the files.

    Raises:
        JointplayError: a negative spread, or one of 100 % or more, for which play would vanish;
            nothing that was identified belongs to the joints with play.
    """
    require_non_negative("spread", spread, "")
    if spread >= 1.0:
        raise JointplayError(f"the spread must be below 100 %, got {100.0 * spread:g} %")
    known = {} if identified is None else _known(identified)
    found, used, tilting = [], 0, set(tilting)
    for one in reductions:
        own = mechanism.description.joints[one.joint].friction
        numbers = {"half_play": 0.5 * one.dead_band}
        numbers |= {"friction": one.friction, "stiffness": one.stiffness}
        numbers["motor_friction"] = servos[one.joint].friction if one.joint in servos else 0.0
        numbers["tilt"] = one.tilt if one.joint in tilting else 0.0
        ends = {k: (x * (1.0 - spread), x * (1.0 + spread)) for k, x in numbers.items()}
        mine = {name: row for (joint, name), row in known.items() if joint == one.joint}
        better = {}
        if "gear_play" in mine and one.dead_band > 0.0:
            low, high, _ = mine["gear_play"]
            better["half_play"] = (0.5 * low, 0.5 * high)
        if "gear_compliance" in mine and one.dead_band > 0.0 and mine["gear_compliance"][0] > 0.0:
            low, high, _ = mine["gear_compliance"]
            better["stiffness"] = (1.0 / high, 1.0 / low)
        if {"dry_friction", "friction"} & set(mine):
            bearing = max(one.friction - own, 0.0)
            dry = mine.get("dry_friction", (own, own, own))
            *ends_of, nominal = mine.get("friction", (1.0, 1.0, 1.0))
            low, high = (dry[k] + bearing * ends_of[k] / nominal for k in (0, 1))
            better["friction"] = (low, high)
        used += len(better)
        for quantity in QUANTITIES:
            low, high = better.get(quantity, ends[quantity])
            origin = "identified" if quantity in better else "assumed"
            if high > 0.0 or quantity in better:
                found.append(Interval(one.joint, quantity, low, high, origin))
    if known and not used:
        rows = ", ".join(f"{joint} {name.replace('_', ' ')}" for joint, name in known)
        names = ", ".join(one.joint for one in reductions)
        raise JointplayError(
            f"nothing that was identified ({rows}) is drawn for the joints {names}: gear play, "
            "gear compliance, dry friction and friction are"
        )
    return found


def _known(identified: Mapping[str, Any]) -> dict[tuple[str, str], tuple[float, float, float]]:
    rows = identified.get("unknowns") if isinstance(identified, Mapping) else None
    if not isinstance(rows, list):
        raise JointplayError(
            "this is no file of jointplay identify or calibrate: it has no list 'unknowns'"
        )
    found = {}
    for row in rows:
        if not {"low", "high", "joint", "quantity"} <= set(row):
            continue  # the measurement could not tell
        low, high = float(row["low"]), float(row["high"])
        nominal = float(row.get("expected") or row.get("found") or 1.0)
        found[str(row["joint"]), str(row["quantity"])] = (low, high, nominal)
    if not found:
        raise JointplayError("nothing was identified: no unknown in the file has an interval")
    return found


def measured_intervals(own: Preset) -> dict[str, Any] | None:
    """Intervals of a preset's numbers that were measured on this robot, as far as they are drawn,
    for `intervals`; None if there are none."""
    rows = [
        {"joint": joint, "quantity": name, "low": low, "high": high}
        for (joint, name), (low, high) in own.intervals.items()
        if name in _DRAWN
    ]
    return {"unknowns": rows} if rows else None


def read_identified(path: str | Path, joints: Iterable[str]) -> dict[str, Any]:
    """What `identify` or `calibrate` wrote, JSON or a preset, of a robot with these joints."""
    names = list(joints)
    try:
        if str(path).lower().endswith(".toml"):
            data = measured_intervals(preset(path)) or {"unknowns": []}
        else:
            data = json.loads(Path(path).read_text(encoding="utf-8"))
        known = _known(data)
    except (OSError, UnicodeDecodeError) as error:
        raise JointplayError(f"cannot read {str(path)!r}: {error}") from None
    except json.JSONDecodeError as error:
        raise JointplayError(f"{str(path)!r} is no JSON: {error}") from None
    except JointplayError as error:
        raise JointplayError(f"{str(path)!r}: {error}") from None
    for joint, _ in known:
        if joint and joint not in names:
            raise MissingName("joint", joint, names)
    return dict(data)


def draw(ranges: Sequence[Interval], count: int, seed: int) -> np.ndarray:
    """Values within the intervals, each as likely as any other, shape (count, len(ranges)) [SI]."""
    if count < 1:
        raise JointplayError(f"a batch has at least one copy, got {count}")
    if seed < 0:
        raise JointplayError(f"the seed must not be negative, got {seed}")
    low, high = np.array([[one.low, one.high] for one in ranges]).reshape(-1, 2).T
    return low + (high - low) * np.random.default_rng(seed).random((count, len(ranges)))


def drawn(
    reductions: Iterable[Reduction], ranges: Sequence[Interval], row: np.ndarray
) -> list[Reduction]:
    """The joints with the values of a row of `draw`."""
    changes: dict[str, dict[str, Any]] = {}
    for one, value in zip(ranges, row, strict=True):
        if one.quantity == "motor_friction":
            continue
        name = "dead_band" if one.quantity == "half_play" else one.quantity
        factor = 2.0 if one.quantity == "half_play" else 1.0
        changes.setdefault(one.joint, {})[name] = factor * float(value)
    return [replace(one, **changes.get(one.joint, {})) for one in reductions]


def drawn_servos(
    servos: Mapping[str, Servo], ranges: Sequence[Interval], row: np.ndarray
) -> dict[str, Servo]:
    """The servos with the friction of a row of `draw`."""
    values = zip(ranges, row, strict=True)
    found = {one.joint: float(x) for one, x in values if one.quantity == "motor_friction"}
    return {k: replace(s, friction=found[k]) if k in found else s for k, s in servos.items()}


def table(ranges: Sequence[Interval], values: np.ndarray, names: Sequence[str]) -> Table:
    """What was drawn, a row for each copy [SI]."""
    columns = [Column("copy", names)]
    for one, drawn in zip(ranges, values.T, strict=True):
        columns.append(Column(one.label, drawn, key=one.label))
    return Table(columns)
