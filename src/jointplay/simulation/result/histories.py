"""From the records of a run to its time histories: what a `Result` is made of."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from jointplay.model.loop import locked
from jointplay.model.mechanism import Mechanism
from jointplay.physics.geometry import Form, Mode
from jointplay.physics.kernel import AZIMUTHS, Status
from jointplay.physics.kernel.workspace import Workspace
from jointplay.simulation.loads.base import Load
from jointplay.simulation.loads.drive import JointFriction
from jointplay.simulation.result.audit import PORTION, Audit, Auditor, Judgement
from jointplay.simulation.result.result import AXES, FORMAT, Result
from jointplay.simulation.result.stored import versions
from jointplay.simulation.result.variables import (
    TERMS,
    BoundLoads,
    Phase,
    Records,
    Variables,
    applied_effort,
    contact_names,
    contact_variables,
    declared,
    gear_variables,
    kinematics,
    loop_drift,
    motion_variables,
    phase_stretches,
    reactions,
    unit_of,
)

if TYPE_CHECKING:
    import xarray as xr

QUATERNION = ("w", "x", "y", "z")
"""Components of orientations, in their order."""
CONVENTION = (
    "Hamilton quaternion w, x, y, z of the active rotation from the tool's axes to the world's: "
    "v_world = R(quaternion) v_tool; the scalar comes first, signs do not jump"
)


class HistoryBuilder:
    """Makes the histories of a run, all at once or portion by portion.

    Portions follow one another, and begin at multiples of `audit.PORTION`; it makes no difference
    to the histories how many there are.

    Args:
        mechanism: what was simulated.
        simulation: the whole simulation as plain data, to run it again.
        friction: friction by joint.
        judged_from: when judging begins [s].
        loads: by name, in the order of the run's.
        reactions: whether the constraint forces of an ideal mechanism are found.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        simulation: dict[str, Any],
        friction: Mapping[str, JointFriction],
        judged_from: float = 0.0,
        loads: Mapping[str, Load] | None = None,
        reactions: bool = True,
    ) -> None:
        self._mechanism, self._simulation, self._friction = mechanism, simulation, friction
        self._reactions = reactions
        self._acting = BoundLoads(mechanism, loads or {})
        self._auditor = Auditor(mechanism, simulation, judged_from)
        self._energy: np.ndarray | None = None
        self._orientation: np.ndarray | None = None
        self._held: dict[int, list[pin.RigidConstraintModel]] = {}
        closed = [name for name in mechanism.loops if name not in mechanism.clearance]
        self._strict = [*closed, *map(locked, mechanism.locks)]

    def portion(self, records: Records, phases: Sequence[Phase]) -> xr.Dataset:
        """Histories of the next records, but for what is told of the whole run.

        Args:
            records: at least one.
            phases: bodies as payloads come and go, of the whole run.
        """
        mechanism, acting, n = self._mechanism, self._acting, records.rows
        q, v = (np.ascontiguousarray(records.recorded(name)) for name in ("q", "v"))
        stretches = phase_stretches(phases, records.first, n)
        body = kinematics(mechanism, q, v, stretches, acting.pairs)
        self._continue_orientation(body["orientation"])
        variables = motion_variables(mechanism, records, q, v, body)
        work = records.recorded("work")
        for index, term in enumerate(TERMS):
            variables |= declared({term.variable: work[:, index]})
        elastic = np.zeros(n)
        if mechanism.clearance:
            contact, elastic = contact_variables(mechanism, records, body)
            variables |= contact
        elif self._reactions:
            held = [self._constraints(phase, q[first]) for first, _, phase in stretches]
            pushes = acting.pushes(body, records)
            effort = applied_effort(mechanism, q, v, records, self._friction, pushes)
            forces = reactions(mechanism, q, v, effort, stretches, held, pushes)
            variables |= declared({"reaction_force": forces})
        drift = np.zeros(0)
        if self._strict:
            gaps = [loop_drift(mechanism, name, body["poses"][name]) for name in self._strict]
            drift = np.stack(gaps, axis=1)
            variables |= declared({"loop_drift": drift})
        variables |= declared({"contact_elastic_energy": elastic})
        coordinates: dict[str, Any] = {}
        if mechanism.gears:
            geared, coordinates, stored = gear_variables(mechanism, records, q)
            variables |= geared
            elastic = elastic + stored
        if acting.loads:
            loads, of_loads = acting.histories(q, body, records)
            variables |= loads
            coordinates |= of_loads
            elastic = elastic + loads["load_energy"][1].sum(axis=1)
            work = np.hstack([work, -loads["load_work"][1]])
        if len(phases) > 1:
            brought = np.concatenate([np.full(hi - lo, one.energy) for lo, hi, one in stretches])
            variables |= declared({"payload_energy": brought})
            work = work.copy()
            work[:, 0] += brought
        residual = self._residual(body, elastic, work)
        variables |= declared({"energy_residual": residual})
        energies = (body["kinetic"], body["potential"])
        effort = records.recorded("drive") + acting.driven(records)
        self._auditor.add_records(records, energies, work, residual, drift, effort, elastic)
        return _dataset(variables, coordinates | self._coordinates(records))

    def _continue_orientation(self, orientation: np.ndarray) -> None:
        """Let orientations go on from the last ones without a jump in sign."""
        if not len(orientation):
            return
        if self._orientation is not None and self._orientation @ orientation[0] < 0.0:
            np.negative(orientation, out=orientation)
        self._orientation = orientation[-1].copy()

    def _constraints(self, phase: Phase, q: np.ndarray) -> list[pin.RigidConstraintModel]:
        if phase.row not in self._held:
            self._held[phase.row] = self._mechanism.constraints(q, 0.0)
        return self._held[phase.row]

    def _residual(
        self, body: Mapping[str, Any], elastic: np.ndarray, work: np.ndarray
    ) -> np.ndarray:
        energy = body["kinetic"] + body["potential"] + elastic - work[:, 0]
        energy = energy + work[:, 1:].sum(axis=1)
        if self._energy is None:
            self._energy = energy[:1].copy()
        residual: np.ndarray = energy - self._energy
        return residual

    def _coordinates(self, records: Records) -> dict[str, Any]:
        mechanism = self._mechanism
        units = [unit_of(mechanism, name) for name in mechanism.coordinates]
        coordinates: dict[str, Any] = {
            "time": ("time", records.recorded("time"), {"units": "s"}),
            "coordinate": list(mechanism.coordinates),
            "coordinate_unit": ("coordinate", units),
            "axis": list(AXES),
            "quaternion": list(QUATERNION),
        }
        if mechanism.clearance:
            coordinates |= {"joint": list(mechanism.clearance), "contact": contact_names(mechanism)}
        else:
            closed = [name for name in mechanism.loops if name not in mechanism.clearance]
            coordinates["moving_joint"] = [*mechanism.joints, *closed]
        if self._strict:
            coordinates["loop"] = self._strict
        return coordinates

    def totals(self, workspace: Workspace) -> dict[str, xr.DataArray]:
        """Variables that count over the whole run, by name; their azimuths are in them."""
        joints = list(self._mechanism.clearance.values())
        if not any(joint.wear is not None for joint in joints):
            return {}
        import xarray as xr  # takes long to import

        names = contact_names(self._mechanism)
        work = np.full((len(joints), len(names), AZIMUTHS), np.nan)  # where there is no contact
        for j, joint in enumerate(joints):
            for k, counted in enumerate(workspace.sliding_work[j]):
                work[j, names.index(joint.contacts[k])] = counted
        azimuths = 2.0 * np.pi * np.arange(AZIMUTHS) / AZIMUTHS
        text = "around the bore, from the bearing's x axis"
        about = ("azimuth", azimuths, {"units": "rad", "long_name": text})
        text = "normal force times sliding distance over the whole run"
        attributes = {"units": "N m", "long_name": text}
        dims = ("joint", "contact", "azimuth")
        return {"sliding_work": xr.DataArray(work, {"azimuth": about}, dims, attrs=attributes)}

    def audit(self, workspace: Workspace, judgement: Judgement) -> Audit:
        return self._auditor.audit(workspace, judgement)

    def attributes(
        self,
        workspace: Workspace,
        status: Status,
        message: str,
        wall_time: float,
        judgement: Judgement | None = None,
    ) -> dict[str, Any]:
        """What a result says of the run, all its portions made.

        Args:
            workspace: of the run.
            status, message: how it ended.
            wall_time: what it took [s].
            judgement: how it began and from when on it is judged; None: centred, from the start.
        """
        return {
            "jointplay_format": FORMAT,
            "simulation": json.dumps(self._simulation),
            "audit": json.dumps(self.audit(workspace, judgement or Judgement()).describe()),
            "status": status.name.lower(),
            "message": message,
            "wall_time_s": wall_time,
            "versions": json.dumps(versions()),
        }


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
    only: Sequence[str] | None = None,
) -> Result:
    """Make a `Result` of the records that a run left in its workspace; see `HistoryBuilder`.

    `only`: histories that are wanted; memory then holds the others a portion at a time.
    """
    judged_from = (judgement or Judgement()).judged_from
    made = HistoryBuilder(mechanism, simulation, friction, judged_from, loads, reactions)
    records = records_of(workspace)
    if only is None:
        dataset = made.portion(records, phases)
    else:
        import xarray as xr  # takes long to import

        parts = [made.portion(part, phases)[list(only)] for part in records.parts(PORTION)]
        dataset = parts[0]
        if len(parts) > 1:
            dataset = xr.concat(parts, "time", coords="minimal", compat="override", join="override")
    whole = made.totals(workspace)
    if whole:  # to assign nothing takes milliseconds
        dataset = dataset.assign(whole)
    dataset.attrs = made.attributes(workspace, status, message, wall_time, judgement)
    return Result(dataset)


def records_of(workspace: Workspace) -> Records:
    """The records in a workspace."""
    count = workspace.rows - workspace.kept_elsewhere
    return Records(workspace.record[:count], workspace.fields, workspace.kept_elsewhere)


def _dataset(variables: Variables, coordinates: Mapping[str, Any]) -> xr.Dataset:
    import xarray as xr  # takes long to import

    dataset = xr.Dataset(
        {
            name: (dims, values, {"units": unit, "long_name": text})
            for name, (dims, values, unit, text) in variables.items()
        },
        coordinates,
    )
    dataset["tool_orientation"].attrs["comment"] = CONVENTION
    if "mode" in variables:
        for name, kind in (("mode", Mode), ("form", Form)):
            members = [member.name.lower() for member in kind]  # type: ignore[var-annotated]
            dataset[name].attrs["flag_meanings"] = " ".join(members)
            dataset[name].attrs["flag_values"] = np.arange(len(members), dtype=np.int8)
        dataset["form"].attrs["comment"] = "-1 for joints that Figure 2 does not show"
    return dataset
