"""What loads did in a run: their energies, works and records, and what they pushed on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from jointplay.loads.base import Load
from jointplay.mechanism.mechanism import Mechanism
from jointplay.mechanism.tree import Frame
from jointplay.result.records import Records

Variables = dict[str, tuple[tuple[str, ...], np.ndarray, str, str]]


@dataclass(frozen=True)
class Pushes:
    """What loads pushed on, by record."""

    efforts: np.ndarray
    """On the coordinates (n, nv) [N m or N]."""
    bodies: tuple[int, ...]
    """Pinocchio joints that carry bodies on which wrenches acted."""
    wrenches: np.ndarray
    """Force [N] and moment about the world's origin [N m], world axes (n, bodies, 6)."""


class Acting:
    """The loads of a run, bound to its mechanism.

    Attributes:
        pairs: frames whose poses are needed, by a key: those of each load between frames, and its
            second one in the world.
    """

    def __init__(self, mechanism: Mechanism, loads: Mapping[str, Load]) -> None:
        """Find where they act."""
        self.mechanism, self.loads = mechanism, loads
        self._sites = {name: load.site(mechanism) for name, load in loads.items()}
        self.pairs: dict[Any, tuple[Frame, Frame]] = {}
        for name, site in self._sites.items():
            if site.frames is not None:
                self.pairs["load", name] = site.frames
                self.pairs["world", name] = ((0, pin.SE3.Identity()), site.frames[1])

    def _answers(self, records: Records) -> dict[str, np.ndarray]:
        """What each load's law gave, (n, size)."""
        recorded, answers, at = records.recorded("load_force"), {}, 0
        for name, site in self._sites.items():
            size = len(site.pushed) if site.frames is None else 6
            answers[name] = recorded[:, at : at + size]
            at += size
        return answers

    def histories(
        self, q: np.ndarray, body: Mapping[str, Any], records: Records
    ) -> tuple[Variables, dict[str, Any]]:
        """Variables of a result, and their coordinates.

        Args:
            q: of all records (n, nq).
            body: has under "poses" those of `pairs` (n, 12), by key.
            records: these.
        """
        n, names = len(q), list(self.loads)
        energy, answers = np.zeros((n, len(names))), self._answers(records)
        parts, values, units = [], [], []
        for i, (name, load) in enumerate(self.loads.items()):
            site = self._sites[name]
            x = q[:, list(site.seen)] if site.frames is None else body["poses"]["load", name]
            energy[:, i] = load.energy(x, load.numbers(self.mechanism))
            for series in load.record(x, answers[name]):
                parts.append(f"{name}.{series.name}")
                values.append(series.values)
                units.append(series.unit)
        work = records.recorded("load_work").copy()
        each, part = ("time", "load"), ("time", "load_part")
        text = "brought in by the load since t = 0, beyond what it stores"
        variables: Variables = {
            "load_energy": (each, energy, "J", "stored in the load"),
            "load_work": (each, work, "J", text),
            "load_record": (part, np.stack(values, axis=1), "", "what loads record of themselves"),
        }
        units_of_parts = ("load_part", units)
        return variables, {"load": names, "load_part": parts, "load_part_unit": units_of_parts}

    def driven(self, records: Records) -> np.ndarray:
        """Efforts of those loads that are actuators of joints, (n, nv) [N m or N]."""
        efforts = np.zeros((records.rows, self.mechanism.model.nv))
        for name, answers in self._answers(records).items():
            if self.loads[name].driven():
                efforts[:, list(self._sites[name].pushed)] += answers
        return efforts

    def pushes(self, body: Mapping[str, Any], records: Records) -> Pushes:
        """What the loads pushed on; arguments as in `histories`."""
        n = records.rows
        efforts = np.zeros((n, self.mechanism.model.nv))
        bodies: list[int] = []
        wrenches = []
        for name, answers in self._answers(records).items():
            site = self._sites[name]
            if site.frames is None:
                efforts[:, list(site.pushed)] += answers
                continue
            turn = body["bearings"]["load", name]
            force = np.einsum("nik,nk->ni", turn, answers[:, :3])
            moment = np.einsum("nik,nk->ni", turn, answers[:, 3:])
            moment = moment + np.cross(body["poses"]["world", name][:, :3], force)
            whole = np.hstack([force, moment])
            bodies += [site.frames[0][0], site.frames[1][0]]
            wrenches += [-whole, whole]
        given = np.stack(wrenches, axis=1) if wrenches else np.zeros((n, 0, 6))
        return Pushes(efforts, tuple(bodies), given)
