"""Making a result: from the records of a run to its time histories and its audit."""

from __future__ import annotations

import json
from collections.abc import Collection, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from jointplay.base.origins import to_text
from jointplay.model.loop import locked
from jointplay.model.tree import Tree
from jointplay.physics.geometry import Form, Mode
from jointplay.physics.joints.base import WEARING_PARTS
from jointplay.physics.kernel import AZIMUTHS, Status
from jointplay.physics.kernel.workspace import Workspace
from jointplay.simulation.result import variables
from jointplay.simulation.result.audit import PORTION, Audit, Auditor
from jointplay.simulation.result.result import AXES, FORMAT, Result
from jointplay.simulation.result.stored import versions
from jointplay.simulation.values import values

if TYPE_CHECKING:
    import xarray as xr

    from jointplay.simulation.run import Run

AT_ONCE = 2 * PORTION
"""Number of records whose histories are all in memory at a time, where only some are wanted.

So many fit into a processor's cache: eight times as many take a sixth longer.
"""
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
        run: the run with the records.
        only: names of the histories that are wanted, as far as they exist; None: all. Others are
            made only as far as the audit needs them.
    """

    def __init__(self, run: Run, only: Collection[str] | None = None) -> None:
        self._run, self._only = run, only
        self._mechanism = mechanism = run.mechanism
        self._simulation = run.simulation.describe()
        self._acting = variables.BoundLoads(mechanism, run.simulation.loads)
        self._auditor = Auditor(mechanism, self._simulation, run.judging.start)
        self._energy: np.ndarray | None = None
        self._orientation: np.ndarray | None = None
        self._held: dict[int, list[pin.RigidConstraintModel]] = {}
        self._trees: dict[int, Tree] = {}
        closed = [name for name in mechanism.loops if name not in mechanism.clearance]
        self._strict = [*closed, *map(locked, mechanism.locks)]

    def portion(
        self, records: variables.Records, phases: Sequence[variables.Phase] | None = None
    ) -> xr.Dataset:
        """Histories of the next records, at least one; the run's attributes come at its end.

        `phases`: the run's phases by rows of these records, if these are not the run's own.
        """
        return _dataset(*self.contents(records, phases))

    def contents(
        self, records: variables.Records, phases: Sequence[variables.Phase] | None = None
    ) -> tuple[variables.Variables, dict[str, Any]]:
        """Variables and coordinates of a `portion`, by name."""
        mechanism, acting, n = self._mechanism, self._acting, records.rows
        phases = self._run.phases if phases is None else phases
        q, v = (np.ascontiguousarray(records.recorded(name)) for name in ("q", "v"))
        stretches = variables.phase_stretches(phases, records.first, n)
        # Motion of the bodies, energies, and work of the forces.
        body = variables.kinematics(mechanism, q, v, stretches, acting.pairs, self._trees)
        self._continue_orientation(body["orientation"])
        work = records.recorded("work")
        values = {
            "q": q,
            "v": v,
            "drive": records.recorded("drive"),
            **{f"tool_{name}": body[name] for name in ("position", "velocity", "orientation")},
            "tool_angular_velocity": body["spin"],
            "kinetic_energy": body["kinetic"],
            "potential_energy": body["potential"],
            **{term.variable: work[:, index] for index, term in enumerate(variables.TERMS)},
        }
        histories = variables.declared(values, tool=mechanism.tool)
        # Contacts, or without clearance the constraint forces; gaps of ideal loops.
        elastic = np.zeros(n)
        if mechanism.clearance:
            selection = variables.HISTORIES if self._only is None else self._only
            contact, elastic = variables.contact_variables(mechanism, records, body, selection)
            histories |= contact
        elif self._only is None or "reaction_force" in self._only:
            held = [self._constraints(phase, q[first]) for first, _, phase in stretches]
            pushed, bodies, wrenches = acting.pushes(body, records)
            effort = variables.applied_effort(mechanism, q, v, records, self._run.friction, pushed)
            forces = variables.reactions(mechanism, q, v, effort, stretches, held, bodies, wrenches)
            histories |= variables.declared({"reaction_force": forces})
        drift = np.zeros(0)
        if self._strict:
            drifts = (variables.loop_drift(mechanism, n, body["poses"][n]) for n in self._strict)
            drift = np.stack([*drifts], axis=1)
            histories |= variables.declared({"loop_drift": drift})
        histories |= variables.declared({"contact_elastic_energy": elastic})
        # Gears, loads and payloads, with their energies and works.
        coordinates: dict[str, Any] = {}
        if mechanism.gears:
            geared, coordinates, stored = variables.gear_variables(mechanism, records, q)
            histories |= geared
            elastic = elastic + stored
        if acting.loads:
            loads, of_loads = acting.histories(q, body, records)
            histories |= loads
            coordinates |= of_loads
            elastic = elastic + loads["load_energy"][1].sum(axis=1)
            work = np.hstack([work, -loads["load_work"][1]])
        if len(phases) > 1:
            brought = np.concatenate([np.full(end - at, p.energy) for at, end, p in stretches])
            histories |= variables.declared({"payload_energy": brought})
            work = work.copy()
            work[:, 0] += brought
        # The energy balance, and the audit.
        residual = self._residual(body, elastic, work)
        histories |= variables.declared({"energy_residual": residual})
        energies = (body["kinetic"], body["potential"])
        effort = records.recorded("drive") + acting.driven(records)
        self._auditor.add_records(records, (q, v), energies, work, residual, drift, effort, elastic)
        coordinates |= self._coordinates(records)
        if self._only is None:
            return histories, coordinates
        return self._chosen(histories, coordinates)

    def _chosen(
        self, histories: variables.Variables, coordinates: Mapping[str, Any]
    ) -> tuple[variables.Variables, dict[str, Any]]:
        """The histories that are wanted, and their coordinates."""
        chosen = {name: histories[name] for name in self._only or () if name in histories}
        used = {"time"}.union(*(dims for dims, *_ in chosen.values()))
        return chosen, {
            name: coordinate
            for name, coordinate in coordinates.items()
            if (coordinate[0] if isinstance(coordinate, tuple) else name) in used
        }

    def _continue_orientation(self, orientation: np.ndarray) -> None:
        """Continue orientations from the last ones without a jump in the quaternion's sign."""
        if not len(orientation):
            return
        if self._orientation is not None and self._orientation @ orientation[0] < 0.0:
            np.negative(orientation, out=orientation)
        self._orientation = orientation[-1].copy()

    def _constraints(self, phase: variables.Phase, q: np.ndarray) -> list[pin.RigidConstraintModel]:
        if phase.row not in self._held:
            self._held[phase.row] = self._mechanism.constraints(q, 0.0)
        return self._held[phase.row]

    def _residual(
        self, body: Mapping[str, Any], elastic: np.ndarray, work: np.ndarray
    ) -> np.ndarray:
        """Residual of the energy balance: energy less work brought in, plus work lost, from the
        start on (n,) [J].
        """
        energy = body["kinetic"] + body["potential"] + elastic - work[:, 0]
        energy = energy + sum(work.T[1:])  # a sum along the short axis takes ten times as long
        if self._energy is None:
            self._energy = energy[:1].copy()
        residual: np.ndarray = energy - self._energy
        return residual

    def _coordinates(self, records: variables.Records) -> dict[str, Any]:
        mechanism = self._mechanism
        units = [variables.unit_of(mechanism, name) for name in mechanism.coordinates]
        coordinates: dict[str, Any] = {
            "time": ("time", records.recorded("time"), {"units": "s"}),
            "coordinate": list(mechanism.coordinates),
            "coordinate_unit": ("coordinate", units),
            "axis": list(AXES),
            "quaternion": list(QUATERNION),
        }
        if mechanism.clearance:
            names = variables.contact_names(mechanism)
            coordinates |= {"joint": list(mechanism.clearance), "contact": names}
        else:
            coordinates["moving_joint"] = [*mechanism.joints, *mechanism.loops]
        if self._strict:
            coordinates["loop"] = self._strict
        return coordinates

    def totals(self) -> dict[str, xr.DataArray]:
        """Variables of the whole run, by name, with their coordinates: the sliding work of wear."""
        joints = list(self._mechanism.clearance.values())
        unwanted = self._only is not None and "sliding_work" not in self._only
        if unwanted or not any(joint.wear is not None for joint in joints):
            return {}
        import xarray as xr  # takes long to import

        names = variables.contact_names(self._mechanism)
        # NaN where there is no contact
        work = np.full((len(joints), 2, len(names), AZIMUTHS), np.nan)
        for j, joint in enumerate(joints):
            counted = self._run.workspace.sliding_work[j]
            for k in range(counted.shape[1]):
                work[j, :, names.index(joint.contacts[k])] = counted[:, k]
        azimuths = 2.0 * np.pi * np.arange(AZIMUTHS) / AZIMUTHS
        text = "around bore or journal, from its own x axis"
        about = ("azimuth", azimuths, {"units": "rad", "long_name": text})
        text = "normal force times sliding distance over the whole run"
        attributes = {"units": "N m", "long_name": text}
        dims = ("joint", "part", "contact", "azimuth")
        coordinates = {"part": list(WEARING_PARTS), "azimuth": about}
        return {"sliding_work": xr.DataArray(work, coordinates, dims, attrs=attributes)}

    def audit(self) -> Audit:
        return self._auditor.audit(self._run.workspace, self._run.rest, self._run.judging.unjudged)

    def attributes(self, status: Status) -> dict[str, Any]:
        """Attributes of the result, once all portions are made."""
        return {
            "jointplay_format": FORMAT,
            "simulation": json.dumps(self._simulation),
            "audit": json.dumps(self.audit().describe()),
            "values": to_text(values(self._run.simulation)),
            "status": status.name.lower(),
            "message": self._run.message(status),
            "wall_time_s": self._run.elapsed,
            "versions": json.dumps(versions()),
        }


def histories(
    run: Run,
    status: Status,
    only: Collection[str] | None = None,
    phases: Sequence[variables.Phase] | None = None,
) -> Result:
    """Make a `Result` of the records in the workspace of a run.

    Args:
        run, only, phases: see `HistoryBuilder`; with `only`, memory holds what is not wanted a
            portion at a time.
        status: how it ended.
    """
    builder, records = HistoryBuilder(run, only), records_of(run.workspace)
    if only is None:
        dataset = builder.portion(records, phases)
    else:
        parts, coordinates = zip(
            *(builder.contents(part, phases) for part in records.parts(AT_ONCE)), strict=True
        )
        times = "time", records.recorded("time"), {"units": "s"}
        dataset = _dataset(_joined(parts), coordinates[-1] | {"time": times})
    totals = builder.totals()
    if totals:  # to assign nothing takes milliseconds
        dataset = dataset.assign(totals)
    dataset.attrs = builder.attributes(status)
    return Result(dataset)


def compile_histories(run: Run) -> None:
    """Compile the functions that histories need, by making those of an empty record."""
    like = records_of(run.workspace)
    row = np.zeros((1, *like.rows_of.shape[1:]))
    with np.errstate(all="ignore"):
        HistoryBuilder(run).contents(variables.Records(row, like.fields))


def _joined(parts: Sequence[variables.Variables]) -> variables.Variables:
    """Variables of consecutive portions, joined along the time."""
    if len(parts) == 1:
        return parts[0]
    return {
        name: (dims, np.concatenate([part[name][1] for part in parts]), unit, text)
        for name, (dims, _, unit, text) in parts[0].items()
    }


def records_of(workspace: Workspace) -> variables.Records:
    """The records in a workspace."""
    count = workspace.rows - workspace.kept_elsewhere
    return variables.Records(workspace.record[:count], workspace.fields, workspace.kept_elsewhere)


def _dataset(histories: variables.Variables, coordinates: Mapping[str, Any]) -> xr.Dataset:
    """A dataset with units, descriptions, and the meaning of flags."""
    import xarray as xr  # takes long to import

    dataset = xr.Dataset(
        {
            name: (dims, values, {"units": unit, "long_name": text})
            for name, (dims, values, unit, text) in histories.items()
        },
        coordinates,
    )
    named = dataset.variables
    if "tool_orientation" in named:
        named["tool_orientation"].attrs["comment"] = CONVENTION
    for name, kind in (("mode", Mode), ("form", Form)):
        if name in named:
            members = [member.name.lower() for member in kind]  # type: ignore[var-annotated]
            named[name].attrs["flag_meanings"] = " ".join(members)
            named[name].attrs["flag_values"] = np.arange(len(members), dtype=np.int8)
    if "form" in named:
        named["form"].attrs["comment"] = "-1 for joints that Figure 2 does not show"
    return dataset
