"""From the records of a run to its time histories: what a `Result` is made of."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from jointplay.geometry import Form, Mode
from jointplay.joints import VIRTUAL_LINK
from jointplay.kernel import AZIMUTHS, Status
from jointplay.kernel.workspace import Workspace
from jointplay.loads.base import Load
from jointplay.loads.drive import JointFriction
from jointplay.loads.limits import beyond
from jointplay.loads.terms import TERMS
from jointplay.mechanism.loop import locked
from jointplay.mechanism.mechanism import Mechanism
from jointplay.result.audit import Audit, Judgement
from jointplay.result.contacts import contact_histories, contact_names
from jointplay.result.kinematics import (
    Phase,
    drift,
    gear_energy,
    joint_forces,
    kinematics,
    stretches_of,
    turning,
)
from jointplay.result.loads import Acting, Variables
from jointplay.result.provenance import versions
from jointplay.result.result import AXES, FORMAT, Result

QUATERNION = ("w", "x", "y", "z")
"""Components of orientations, in their order."""
CONVENTION = (
    "Hamilton quaternion w, x, y, z of the active rotation from the tool's axes to the world's: "
    "v_world = R(quaternion) v_tool; the scalar comes first, signs do not jump"
)


def histories(
    mechanism: Mechanism,
    simulation: dict[str, Any],
    workspace: Workspace,
    friction: Mapping[str, JointFriction],
    phases: Sequence[Phase],
    status: Status,
    message: str,
    wall_time: float,
    judgement: Judgement | None = None,
    loads: Mapping[str, Load] | None = None,
    reactions: bool = True,
) -> Result:
    """Make a `Result` of the records that a run left in its workspace.

    Args:
        mechanism: what was simulated.
        simulation: the whole simulation as plain data, to run it again.
        workspace: the records.
        friction: friction by joint.
        phases: bodies as payloads come and go.
        status, message: how the run ended.
        wall_time: what it took [s].
        judgement: how the run began and from when on it is judged; None: centred, from the start.
        loads: by name, in the order of the run's.
        reactions: whether the constraint forces of an ideal mechanism are found.
    """
    told = _Told(mechanism, workspace, phases, loads or {})
    told.moved()
    if mechanism.clearance:
        told.touched()
    elif reactions:
        told.held(friction)
    told.closed()
    told.stored()
    told.pushed()
    residual = told.balanced()
    audit = Audit.of(
        mechanism,
        simulation,
        workspace,
        (told.body["kinetic"], told.body["potential"]),
        told.work,
        residual,
        told.variables["loop_drift"][1] if told.strict else np.zeros(0),
        judgement,
        _beyond_limits(mechanism, simulation, workspace, told.acting),
    )
    attributes = {
        "jointplay_format": FORMAT,
        "simulation": json.dumps(simulation),
        "audit": json.dumps(audit.describe()),
        "status": status.name.lower(),
        "message": message,
        "wall_time_s": wall_time,
        "versions": json.dumps(versions()),
    }
    return Result(_explained(xr.Dataset(told.explained(), told.coordinates(), attributes)))


class _Told:
    """What the records of a run tell, gathered variable by variable.

    Attributes:
        body: what `kinematics` makes of the coordinates.
        variables: dimensions, values, unit and explanation, by name.
        elastic: energy stored in contacts, gears and loads by record, shape (n,) [J].
        work: done by drives, payloads and loads, and lost, shape (n, terms) [J].
        strict: names of the loops without clearance, and of locks.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        workspace: Workspace,
        phases: Sequence[Phase],
        loads: Mapping[str, Load],
    ) -> None:
        self.mechanism, self.workspace, self.phases = mechanism, workspace, phases
        self.q, self.v = (np.ascontiguousarray(workspace.recorded(name)) for name in ("q", "v"))
        self.stretches = stretches_of(phases, workspace.rows)
        self.acting = Acting(mechanism, loads)
        self.body = kinematics(mechanism, self.q, self.v, self.stretches, self.acting.pairs)
        self.variables: Variables = {}
        self.elastic = np.zeros(workspace.rows)
        self.work = workspace.recorded("work")
        self.ideal_loops = [name for name in mechanism.loops if name not in mechanism.clearance]
        self.strict = [*self.ideal_loops, *map(locked, mechanism.locks)]
        self._of_loads: dict[str, Any] = {}

    def moved(self) -> None:
        """Coordinates, the tool, the energies of bodies, and work."""
        of_each = ("time", "coordinate")
        of_tool = ("time", "axis")
        tool = f"{self.mechanism.tool}, world axes"
        body, drive = self.body, self.workspace.recorded("drive")
        self.variables |= {
            "q": (of_each, self.q, "", "generalised coordinates"),
            "v": (of_each, self.v, "", "generalised velocities"),
            "drive": (of_each, drive, "", "drive efforts"),
            "tool_position": (of_tool, body["position"], "m", tool),
            "tool_velocity": (of_tool, body["velocity"], "m/s", "of the tool, world axes"),
            **turning(body),
            "kinetic_energy": (("time",), body["kinetic"], "J", "kinetic energy"),
            "potential_energy": (("time",), body["potential"], "J", "potential energy of gravity"),
        }
        for index, term in enumerate(TERMS):
            text = f"{term.variable.replace('_', ' ')} since t = 0"
            self.variables[term.variable] = (("time",), self.work[:, index], "J", text)

    def touched(self) -> None:
        """Joints with clearance."""
        found, self.elastic = contact_histories(self.mechanism, self.workspace, self.body)
        self.variables |= found

    def held(self, friction: Mapping[str, JointFriction]) -> None:
        """Forces of the joints of an ideal mechanism."""
        forces = joint_forces(
            self.mechanism,
            self.q,
            self.v,
            self.workspace.recorded("drive"),
            friction,
            self.stretches,
            self.acting.pushes(self.body, self.workspace),
        )
        text = "constraint force of the parent on the child at the joint, world axes"
        self.variables["reaction_force"] = ("time", "moving_joint", "axis"), forces, "N", text

    def closed(self) -> None:
        """Gaps of loops without clearance."""
        if self.strict:
            poses = self.body["poses"]
            gaps = [drift(self.mechanism, name, poses[name]) for name in self.strict]
            found = np.stack(gaps, axis=1)
            self.variables["loop_drift"] = ("time", "loop"), found, "m", "gap of the ideal loop"

    def stored(self) -> None:
        """Energy in contacts and gears."""
        text = "stored in the contacts"
        self.variables["contact_elastic_energy"] = ("time",), self.elastic, "J", text
        if self.mechanism.gears:
            energy = gear_energy(self.mechanism, self.q)
            self.variables["gear_elastic_energy"] = ("time",), energy, "J", "stored in the gears"
            self.elastic = self.elastic + energy

    def pushed(self) -> None:
        """Loads and payloads: what they stored and brought in."""
        if self.acting.loads:
            found, self._of_loads = self.acting.histories(self.q, self.body, self.workspace)
            self.variables |= found
            self.elastic = self.elastic + found["load_energy"][1].sum(axis=1)
            self.work = np.hstack([self.work, -found["load_work"][1]])
        if len(self.phases) > 1:
            brought = np.concatenate(
                [np.full(end - first, phase.energy) for first, end, phase in self.stretches]
            )
            self.variables["payload_energy"] = ("time",), brought, "J", "brought in by payloads"
            self.work = self.work.copy()
            self.work[:, 0] += brought

    def balanced(self) -> np.ndarray:
        """Error of the energy balance, shape (n,) [J]."""
        body, work = self.body, self.work
        energy = body["kinetic"] + body["potential"] + self.elastic
        energy = energy - work[:, 0] + work[:, 1:].sum(axis=1)
        residual: np.ndarray = energy - energy[:1]
        self.variables["energy_residual"] = ("time",), residual, "J", "error of the energy balance"
        return residual

    def explained(self) -> dict[str, Any]:
        """Variables as xarray takes them."""
        return {
            name: (dims, values, {"units": unit, "long_name": text})
            for name, (dims, values, unit, text) in self.variables.items()
        }

    def coordinates(self) -> dict[str, Any]:
        """Names along the dimensions."""
        mechanism = self.mechanism
        units = [_units(mechanism, name) for name in mechanism.coordinates]
        found = self._of_loads | {
            "time": ("time", self.workspace.recorded("time")[:, 0], {"units": "s"}),
            "coordinate": list(mechanism.coordinates),
            "coordinate_unit": ("coordinate", units),
            "axis": list(AXES),
            "quaternion": list(QUATERNION),
        }
        if mechanism.clearance:
            found |= {"joint": list(mechanism.clearance), "contact": contact_names(mechanism)}
        else:
            found["moving_joint"] = [*mechanism.joints, *self.ideal_loops]
        if self.strict:
            found["loop"] = self.strict
        if "sliding_work" in self.variables:
            azimuths = 2.0 * np.pi * np.arange(AZIMUTHS) / AZIMUTHS
            text = "around the bore, from the bearing's x axis"
            found["azimuth"] = ("azimuth", azimuths, {"units": "rad", "long_name": text})
        return found


def _explained(dataset: xr.Dataset) -> xr.Dataset:
    """The dataset with what its units and flags mean."""
    for name, unit in (
        ("q", "see coordinate_unit"),
        ("v", "coordinate_unit per second"),
        ("drive", "N m for rad, N for m"),
    ):
        dataset[name].attrs["units"] = unit
    dataset["tool_orientation"].attrs["comment"] = CONVENTION
    if "mode" in dataset:
        for name, kind in (("mode", Mode), ("form", Form)):
            members = [member.name.lower() for member in kind]  # type: ignore[var-annotated]
            dataset[name].attrs["flag_meanings"] = " ".join(members)
            dataset[name].attrs["flag_values"] = np.arange(len(members), dtype=np.int8)
        dataset["form"].attrs["comment"] = "-1 for joints that Figure 2 does not show"
    return dataset


def _beyond_limits(
    mechanism: Mechanism, simulation: Mapping[str, Any], workspace: Workspace, acting: Acting
) -> tuple[str, ...]:
    """In what the run went beyond the URDF's limits, unless they are to be ignored."""
    if simulation["limits"] == "ignore":
        return ()
    effort = workspace.recorded("drive") + acting.driven(workspace)
    time, q, v = (workspace.recorded(name) for name in ("time", "q", "v"))
    return beyond(mechanism, time[:, 0], q, v, effort)


def _units(mechanism: Mechanism, coordinate: str) -> str:
    joint, _, part = coordinate.partition(".")
    if part in VIRTUAL_LINK:
        return "m" if part in AXES else "rad"
    return "m" if mechanism.description.joints[joint].slides else "rad"
