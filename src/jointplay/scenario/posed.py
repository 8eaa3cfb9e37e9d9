"""A machine that stands at poses, as it was asked for: what holds it, and what of that counts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from jointplay.accuracy.poses import Poses, poses_of, read_pose, read_poses
from jointplay.base.errors import JointplayError
from jointplay.base.origins import Value
from jointplay.model.mechanism import Mechanism
from jointplay.scenario.assumptions import notes_at_poses, undecided_at_rest
from jointplay.scenario.reading import Scenario, Setting
from jointplay.scenario.request import Request
from jointplay.simulation.motion.reference import Motion
from jointplay.simulation.simulation import Simulation
from jointplay.simulation.values import values

IN_MOTION = (
    *("drive.damping_ratio", "drives.*.damping_ratio", "gears.*.damping", "joints.*.restitution"),
    *("integration", "output"),
)
"""Keys that say nothing of a machine that stands; `*` is any name."""
OF_CONTACTS = tuple(
    f"joints.*.{key}"
    for key in (
        *("friction", "normal", "stiffness", "axial_stiffness"),
        *("bearing_material", "journal_material"),
    )
)
AT_REST = (
    *("drive", "drives", "joint_friction", "payloads", "loads", "robot.gravity"),
    *("gears.*.stiffness", "gears.*.rotor_inertia", *OF_CONTACTS),
)
"""Keys that say where a machine rests, and not how far its play lets it go."""


@dataclass(frozen=True)
class PosedMachine:
    """A machine that stands, and who gave what of it."""

    scenario: Scenario
    case: str
    of_file: bool
    """Whether the scenario is one of a file, and not of a robot."""
    poses: Poses
    notes: list[str]
    """What was chosen for the user, a line each."""

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
        """The machine of a request's scenario, at the poses at which it is to be looked at.

        Args:
            request, scenario: what was asked for, and its scenario.
            poses: each as ``JOINT=X,...``; see `read_pose`.
            file: CSV of poses; see `read_poses`.
            workspace: number of poses spread over the limits of all joints.
            single: whether it is one pose, which does not follow the scenario's motion.

        Raises:
            JointplayError: what is given cannot be read, or be a pose of the machine.
        """
        case = request.case or scenario.cases[0]
        machine = scenario.simulation(request.case, still=True)
        given: Mapping[str, Mapping[str, float]] | None = None
        if file is not None:
            given = read_poses(machine.mechanism, Path(file))
        elif poses:
            several = len(poses) > 1  # else its name need not be said
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
        """What decides where it rests and nobody gave, to add to a sentence.

        `force`: whether one is on the tool.
        """
        machine = self.poses.machine
        loaded = bool(machine.payloads or machine.loads) or force
        causes = undecided_at_rest(self.scenario, self.case, self.mechanism, loaded)
        return f"; assumed: {', '.join(causes)}" if causes else ""

    @property
    def mechanism(self) -> Mechanism:
        return self.poses.mechanism

    @property
    def motion(self) -> Motion | None:
        return self.poses.machine.motion

    @property
    def values(self) -> list[Value]:
        """The values of which it is made, with their origins."""
        machine = self.poses.machine
        if machine.motion is not None:  # which leads some of its drives
            machine = self.scenario.simulation(self.case)
        return values(machine, self.scenario.origins(self.case), merged=False)

    @property
    def simulation(self) -> Simulation | None:
        """As a run of a scenario file has it; None of a robot."""
        return self.scenario.simulation(self.case) if self.of_file else None

    def refuse_idle(self, patterns: Sequence[str], why: str) -> None:
        """Refuse options for keys that would act on nothing; `*` stands for any name."""
        for setting in self.scenario.settings:
            option = setting.source.startswith("--") and not setting.source.startswith("--preset")
            if option and any(_is_of(setting, pattern) for pattern in patterns):
                raise JointplayError(f"{setting.source} {why}")

    def refuse_idle_friction(self, whole: bool) -> None:
        """Refuse friction that holds nothing where it rests; if `whole`, any."""
        if whole:
            why = "acts on where the machine rests, which --whole does not ask"
            self.refuse_idle(("joint_friction", "joints.*.friction"), why)
        for setting in self.scenario.settings:
            if setting.source == "--joint-friction" and setting.key[1] not in self.mechanism.gears:
                why = f"acts at rest on the teeth of a gear, and {setting.key[1]!r} has none"
                raise JointplayError(f"{setting.source} {why}")


def _is_of(setting: Setting, pattern: str) -> bool:
    """Whether a setting is of a key, or of one below it."""
    parts = pattern.split(".")
    known = zip(parts, setting.key, strict=False)
    return len(parts) <= len(setting.key) and all(part in (key, "*") for part, key in known)
