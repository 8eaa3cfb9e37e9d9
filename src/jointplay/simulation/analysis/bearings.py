"""Contacts of a result, and its rolling bearings: element loads, friction, rating life."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from jointplay.base.errors import JointplayError, require_finite, require_known
from jointplay.physics.geometry import Form, Mode
from jointplay.physics.joints import RollingBearing
from jointplay.physics.kernel import JOINT_FRICTION_SPEED
from jointplay.simulation.analysis.twins import journal_poses, places, rolls
from jointplay.simulation.result.certificate import alone
from jointplay.simulation.result.result import Result

if TYPE_CHECKING:
    import xarray as xr


# Contacts: their number, durations and peaks, and the shares of time in each mode.


@dataclass(frozen=True)
class Contacts:
    """Contacts at one place of one joint, in the order in which they began.

    Records cannot separate contacts that follow each other within one record interval, nor time
    them better than to about one interval; peaks are exact.
    """

    joint: str
    contact: str
    start: np.ndarray
    """Time of the record before each contact (n,) [s]."""
    duration: np.ndarray
    """Record intervals touched less one, the unbiased estimate; at least half an interval [s]."""
    peak: np.ndarray
    """Largest normal force (n,) [N]."""
    peak_time: np.ndarray
    """Time of the record that holds it (n,) [s]."""
    share: float
    """Fraction of the records with a normal force."""


def contacts(result: Result, start: float | None = None) -> list[Contacts]:
    """Contacts at every place of every clearance joint that began from `start` [s] on.

    `start`: None: `Result.judge_from`. A contact lasts from the first to the last of consecutive
    records with a normal force.
    """
    time = result.time
    if not result.joints:
        return []
    start = result.judge_from if start is None else require_finite("start", start, "s")
    later = np.diff(time, prepend=time[0])
    judged = time >= start
    statistics = []
    for joint in result.joints:
        for contact in places(result, joint):
            at = {"joint": joint, "contact": contact}
            force = result["normal_force_peak"].sel(at).values
            edges = np.diff(np.concatenate([[False], force > 0.0, [False]]).astype(int))
            first, last = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1) - 1
            begun = time[first] >= start
            first, last = first[begun], last[begun]
            top = [f + int(force[f : t + 1].argmax()) for f, t in zip(first, last, strict=True)]
            spacing = later[first]
            normal = result["normal_force"].sel(at).values[judged]
            statistics.append(
                Contacts(
                    joint,
                    contact,
                    time[first] - spacing,
                    np.maximum(time[last] - time[first], 0.5 * spacing),
                    force[top],
                    time[top],
                    float(np.mean(normal > 0.0)) if normal.size else 0.0,
                )
            )
    return statistics


def time_fractions(
    result: Result, joint: str, of: str = "mode", start: float | None = None
) -> dict[str, float]:
    """Fractions of the time from `start` [s] on that `joint` spends in each ``mode`` or ``form``.

    They are by name, in the order of the enumeration, and sum to 1; none for the forms of a joint
    that Figure 2 does not show. `start`: None: `Result.judge_from`.
    """
    require_known("clearance joint", joint, result.joints)
    kinds: dict[str, Any] = {"mode": Mode, "form": Form}
    require_known("state", of, kinds)
    start = result.judge_from if start is None else require_finite("start", start, "s")
    values = result[of].sel(joint=joint).values[result.time >= start]
    if len(values) and values.min() < 0:
        return {}
    counts = np.bincount(values, minlength=len(kinds[of]))
    total = max(len(values), 1)
    return {member.name.lower(): float(counts[member] / total) for member in kinds[of]}


# Rolling bearings.

CENTURY_H = 100 * 365.25 * 24
"""Hours of a century, day and night; a longer life is not stated in numbers."""


def rolling_bearings(result: Result) -> dict[str, RollingBearing]:
    """Rolling bearings of a result by joint; refused if its mechanism cannot be built again."""
    if not any(rolls(result, joint) for joint in result.joints):
        return {}
    joints = result.simulation.mechanism.clearance
    return {name: joint for name, joint in joints.items() if isinstance(joint, RollingBearing)}


def bearing_of(result: Result, joint: str) -> RollingBearing:
    """The rolling bearing of a joint, refused if it has none."""
    require_known("clearance joint", joint, result.joints)
    bearings = rolling_bearings(result)
    if joint not in bearings:
        raise JointplayError(
            f"joint {joint!r} has no rolling bearing"
            + (f"; those that have one: {', '.join(bearings)}" if bearings else "")
        )
    return bearings[joint]


def element_loads(result: Result, joint: str) -> xr.DataArray:
    """Load of every element of a rolling bearing over time, by the law at the recorded poses.

    Returns:
        Array (time, element), elements row by row from the cage's azimuth on [N].
    """
    import xarray as xr

    bearing = bearing_of(result, joint)
    pose = journal_poses(result, joint)
    cage = result["cage_angle"].sel(joint=joint).values
    loads, _ = bearing.element_loads(pose[:, :3], pose[:, [5, 8, 11]], cage)
    return xr.DataArray(
        loads,
        dims=("time", "element"),
        coords={"time": result.time, "element": np.arange(loads.shape[1])},
        name="element_load",
        attrs={"units": "N", "long_name": "load of each element"},
    )


@dataclass(frozen=True)
class BearingLife:
    """Rating life of a rolling bearing under a motion, and its friction.

    Basic reference rating life of ISO/TS 16281: 90 % of the bearings last longer, at the rated
    lubrication and cleanliness of a factor a_ISO = 1. The formulas are for rings that turn; they
    are not meant for rings that swing by less than the distance of two elements.
    """

    joint: str
    revolutions: float
    """L10 at the mean loads of this motion; infinite where nothing turns or bears load."""
    hours: float
    """L10 of repeating this motion [h]; infinite where nothing turns or bears load."""
    damage: float
    """Part of L10 that the motion takes, by Palmgren and Miner's sum."""
    turned: float
    """Way of the inner ring in the outer one, both directions counted [revolutions]."""
    swing: float
    """Range of the inner ring's angle [rad]."""
    spacing: float
    """Angle between two elements [rad]."""
    largest_load: float
    """Largest load of an element, between records too [N]."""
    rated_load: float
    """Load of an element at the bearing's static rating [N]."""
    most_loaded: int
    """Largest number of elements that bore load at a time."""
    elements: int
    """Number of elements."""
    mean_torque: float
    """Friction torque, mean over the way; 0 where nothing turns [N m]."""
    friction_work: float
    """Energy lost in friction over the motion [J]."""
    friction_power: float
    """Mean power lost in friction [W]."""

    @property
    def oscillates(self) -> bool:
        """Whether no element reaches the place of its neighbour."""
        return self.swing < self.spacing

    def __str__(self) -> str:
        most = f"largest element load {alone(self.largest_load)} N"
        share = f"{self.most_loaded} of {self.elements} elements loaded at most"
        return f"{most}, {share}; life L10 {self.lasting}"

    @property
    def lasting(self) -> str:
        """The life in words."""
        if math.isinf(self.revolutions):
            return "unlimited: it does not turn under load"
        if self.hours > CENTURY_H:
            return "far beyond any use: more than a century of this motion"
        return f"{self.revolutions:.3g} revolutions, {self.hours:.3g} h of this motion"


def bearing_life(
    result: Result, joint: str, start: float | None = None, outer_turns: bool = False
) -> BearingLife:
    """Rating life of a rolling bearing over the motion, by its elements' loads at each instant.

    The damage is Palmgren and Miner's sum of |turn| / (2 pi L10) with L10 at the loads of that
    instant; turns of both directions add up.

    Args:
        result: a result with a rolling bearing.
        joint: joint of the bearing.
        start: records before this are left out [s]; None: before the run is judged.
        outer_turns: whether the outer ring turns against the load, not the inner one.

    Raises:
        JointplayError: the joint has no rolling bearing; fewer than two records from `start` on.
    """
    bearing = bearing_of(result, joint)
    start = result.judge_from if start is None else require_finite("start", start, "s")
    judged = result.time >= start
    time = result.time[judged]
    if len(time) < 2:
        raise JointplayError(f"fewer than two records from {start:g} s on: no life can be told")
    loads = element_loads(result, joint).values[judged]
    # The cage turns by a fixed part of the ring's turn, which thus is known in loops, too, where
    # the joint has no coordinate.
    turn = np.diff(result["cage_angle"].sel(joint=joint).values[judged]) / bearing.cage_ratio
    path, between = np.abs(turn), np.diff(time)
    damages = bearing.damage_of_turn(loads, outer_turns)
    damage = float(np.sum(path * 0.5 * (damages[1:] + damages[:-1])) / (2.0 * np.pi))
    turned, duration = float(path.sum()) / (2.0 * np.pi), float(time[-1] - time[0])
    torque = bearing.drag + bearing.friction_lever * loads.sum(axis=1)
    slow = np.tanh(path / np.maximum(between, 1e-300) / JOINT_FRICTION_SPEED)
    work = float(np.sum(0.5 * (torque[1:] + torque[:-1]) * slow * path))
    peak = result["normal_force_peak"].sel(joint=joint, contact=bearing.contacts[0])
    angle = np.concatenate([[0.0], np.cumsum(turn)])
    return BearingLife(
        joint=joint,
        revolutions=turned / damage if damage > 0.0 else math.inf,
        hours=duration / 3600.0 / damage if damage > 0.0 else math.inf,
        damage=damage,
        turned=turned,
        swing=float(np.ptp(angle)),
        spacing=2.0 * math.pi / bearing.count,
        largest_load=float(np.nanmax(peak.values[judged])),
        rated_load=bearing.rated_load,
        most_loaded=int(np.count_nonzero(loads > 0.0, axis=1).max()),
        elements=loads.shape[1],
        mean_torque=work / float(path.sum()) if turned > 0.0 else 0.0,
        friction_work=work,
        friction_power=work / duration,
    )
