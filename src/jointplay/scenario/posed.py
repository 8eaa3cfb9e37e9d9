"""Machines at rest at poses, as a request describes them; options that then have no effect."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from jointplay.accuracy.poses import Poses, poses_of, read_pose, read_poses
from jointplay.base.errors import JointplayError
from jointplay.base.origins import Value
from jointplay.model.mechanism import Mechanism
from jointplay.scenario.assumptions import (
    assumed,
    assumed_bearings,
    notes_at_poses,
    undecided_at_rest,
)
from jointplay.scenario.reading import Scenario, Setting
from jointplay.scenario.request import Request
from jointplay.simulation.motion.reference import Motion
from jointplay.simulation.simulation import Simulation
from jointplay.simulation.values import values

IN_MOTION = (
    *("drive.damping_ratio", "drives.*.damping_ratio", "gears.*.damping", "joints.*.restitution"),
    *("integration", "output"),
)
"""Keys without effect on a machine that stands; `*` is any name."""
OF_CONTACTS = tuple(
    f"joints.*.{key}"
    for key in (
        *("friction", "normal", "stiffness", "axial_stiffness"),
        *("bearing_material", "journal_material"),
    )
)
"""Keys of contacts: stiffness and friction, and materials."""
AT_REST = (
    *("drive", "drives", "joint_friction", "payloads", "loads", "robot.gravity"),
    *("gears.*.stiffness", "gears.*.rotor_inertia", *OF_CONTACTS),
)
"""Keys that decide where a machine rests, but not how far its play lets it go."""


@dataclass(frozen=True)
class PosedMachine:
    """A machine that stands at poses, with the scenario that describes it."""

    scenario: Scenario
    case: str
    of_file: bool
    """Whether the scenario comes from a file, and not from a robot."""
    poses: Poses
    notes: list[str]
    """Lines on what was chosen for the user."""

    @classmethod
    def of(
        cls,
        request: Request,
        scenario: Scenario,
        poses: Sequence[str] = (),
        file: str | Path | None = None,
        workspace: int | None = None,
        single: bool = False,
    ) -> PosedMachine:
        """The machine of a request's scenario, at poses that are given or follow its motion.

        Args:
            request, scenario: the request, and its scenario.
            poses: each as ``JOINT=X,...``; see `read_pose`.
            file: CSV of poses; see `read_poses`.
            workspace: number of poses spread over the limits of all joints.
            single: whether one pose is wanted, which does not follow the scenario's motion.

        Raises:
            JointplayError: a pose cannot be read, or the machine cannot take it.
        """
        case = request.case or scenario.cases[0]
        machine = scenario.simulation(request.case, still=True)
        given: Mapping[str, Mapping[str, float]] | None = None
        if file is not None:
            given = read_poses(machine.mechanism, Path(file))
        elif poses:
            several = len(poses) > 1  # a single pose needs no name
            given = {text * several: read_pose(machine.mechanism, text) for text in poses}
        moved = any(setting.key == ("motion", "file") for setting in request.keys)
        if single and not given and not moved:
            given = {"": {}}
        standing = poses_of(machine, given, workspace)
        notes = notes_at_poses(
            scenario,
            case,
            standing,
            named=request.joints,
            play=bool(request.joints or request.journals),
            relative_to=request.relative_to,
        )
        return cls(scenario, case, request.of_file, standing, notes)

    def undecided(self, force: bool) -> str:
        """A clause on values that nobody gave and that decide where the machine rests.

        `force`: whether a force acts on the tool.
        """
        machine = self.poses.machine
        loaded = bool(machine.payloads or machine.loads) or force
        return assumed(undecided_at_rest(self.scenario, self.case, self.mechanism, loaded))

    @property
    def bearings_not_given(self) -> str:
        """A clause on sizes of bearings that nobody gave and that decide how far journals tilt."""
        return assumed(assumed_bearings(self.scenario, self.case, self.mechanism))

    @property
    def mechanism(self) -> Mechanism:
        return self.poses.mechanism

    @property
    def motion(self) -> Motion | None:
        return self.poses.machine.motion

    @property
    def values(self) -> list[Value]:
        """The values that describe the machine, with their origins."""
        machine = self.poses.machine
        if machine.motion is not None:  # as a run has it, where the motion leads some drives
            machine = self.scenario.simulation(self.case)
        return values(machine, self.scenario.origins(self.case), merged=False)

    @property
    def simulation(self) -> Simulation | None:
        """The simulation of a scenario file's case; None for a robot."""
        return self.scenario.simulation(self.case) if self.of_file else None

    def refuse_idle(self, patterns: Sequence[str], why: str) -> None:
        """Refuse options for keys that would have no effect; `*` stands for any name."""
        for setting in self.scenario.settings:
            option = setting.source.startswith("--") and not setting.source.startswith("--preset")
            if option and any(_matches(setting, pattern) for pattern in patterns):
                raise JointplayError(f"{setting.source} {why}")

    def refuse_idle_friction(self, whole: bool) -> None:
        """Refuse options of friction that holds nothing at rest; with `whole`, any friction."""
        if whole:
            why = "acts on where the machine rests, which --whole does not ask"
            self.refuse_idle(("joint_friction", "joints.*.friction"), why)
        for setting in self.scenario.settings:
            if setting.source == "--joint-friction" and setting.key[1] not in self.mechanism.gears:
                why = f"acts at rest on the teeth of a gear, and {setting.key[1]!r} has none"
                raise JointplayError(f"{setting.source} {why}")


def _matches(setting: Setting, pattern: str) -> bool:
    """Whether a setting's key matches a pattern, or lies below one that does."""
    parts = pattern.split(".")
    known = zip(parts, setting.key, strict=False)
    return len(parts) <= len(setting.key) and all(part in (key, "*") for part, key in known)
