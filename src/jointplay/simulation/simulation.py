"""A simulation: all inputs of a run of eqs 22 and 23, completed and checked."""

from __future__ import annotations

import math
import re
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypedDict, Unpack

import numpy as np

from jointplay.base.conveniences import provided
from jointplay.base.errors import (
    JointplayError,
    JointplayWarning,
    require_a,
    require_non_negative,
    require_table,
)
from jointplay.base.schema import check_fields, known_keywords, read, unknown_key
from jointplay.base.tables import Overview, few
from jointplay.base.units import readable
from jointplay.model.mechanism import Mechanism
from jointplay.model.payload import Payload
from jointplay.model.urdf import MOST_LETTERS
from jointplay.physics.kernel import Status
from jointplay.simulation import checkpoint
from jointplay.simulation.initial import position_and_speed
from jointplay.simulation.loads import Load
from jointplay.simulation.loads.drive import Drive, JointFriction
from jointplay.simulation.loads.gear_pair import led_by_teeth
from jointplay.simulation.motion.completion import complete_motion
from jointplay.simulation.motion.reference import Motion
from jointplay.simulation.result.inputs import FILES_DRIVES, FILES_LOADS, Inputs
from jointplay.simulation.run import Moment, Run
from jointplay.simulation.saving import run_to

if TYPE_CHECKING:
    from jointplay.simulation.result.result import Result

_TURNS = re.compile(r"\s*([0-9.]+(?:[eE][+-]?[0-9]+)?)\s*(turns?|s)\s*")
"""A settling time as text: ``2 turns`` or ``0.5 s``."""

_NODES = 20000
"""Times at which a motion is sampled to count its turns."""


@dataclass(frozen=True, repr=False)
class Simulation(Overview, Inputs):
    """Everything that defines a run. Equal simulations give bit-identical results on one machine.

    Values can be given as scenario files have them: ``step="5 us"``, ``drive="free"``.

    Raises:
        JointplayError: a value that cannot be; see also `Run`.
    """

    def _check_tables(self) -> None:
        """Refuse loads, joint friction and drives that are no tables of such objects by name."""
        tables: dict[str, Any] = {"load": self.loads}
        if self.joint_friction is not None:
            tables["joint friction"] = self.joint_friction
        if not isinstance(self.drive, Drive):
            tables["drive"] = self.drive
        kinds = {"load": "Load", "joint friction": "JointFriction", "drive": "Drive"}
        for name, table in tables.items():
            require_a(f"{name}s", table, "Mapping")
            for entry in table.values():
                require_a(f"a {name}", entry, kinds[name])
        for name in self.loads:
            if not isinstance(name, str) or not name or not name.isprintable():
                raise JointplayError(f"the name of a load must be readable text, got {name!r}")
            if len(name) > MOST_LETTERS:
                raise JointplayError(
                    f"a load's name has {len(name)} letters; at most {MOST_LETTERS}"
                )

    def __post_init__(self) -> None:
        require_a("mechanism", self.mechanism, "Mechanism")
        if self.motion is not None:
            require_a("motion", self.motion, "Motion")
        require_a("payloads", self.payloads, "Iterable")
        # Loads and drives that nobody gave are those of the robot's file.
        if self.loads is FILES_LOADS:
            object.__setattr__(self, "loads", self._from_file("loads", Load))
        filed = self._from_file("drives", Drive) if self.drive is FILES_DRIVES else {}
        check_fields(self)
        if self.start == "rest" and self.mechanism.free_base is not None:
            reason = "start 'rest' is for a base that is held: start 'centred', or hold the base"
            raise JointplayError(reason, ("start",))
        table = require_table("state", self.state, "of positions [rad, m] by joint", ("state",))
        state = {name: position_and_speed(name, value) for name, value in table.items()}
        object.__setattr__(self, "state", state)
        for payload in self.payloads:
            require_a("a payload", payload, "Payload")
        carried = tuple(payload for payload in self.payloads if payload.mass > 0.0)
        object.__setattr__(self, "payloads", carried)
        self._check_tables()
        # With one drive for all, joints that the motion does not name are held, or follow those
        # that they mimic, unless their speed or a drive that follows nothing is given, or teeth
        # lead them.
        if self.motion is not None and isinstance(self.drive, Drive) and self.drive.follows:
            moving = {name for name, (_, speed) in state.items() if speed is not None}
            moving |= {name for name, drive in filed.items() if not drive.follows}
            meshing: set[str] = set()
            for load in self.loads.values():
                meshing |= led_by_teeth(load, self.mechanism, self.motion)
            moving |= meshing
            places = {name: at for name, (at, _) in state.items() if at is not None}
            complete = complete_motion(self.mechanism, self.motion, places, moving)
            object.__setattr__(self, "motion", complete.motion)
            left = {name: at for name, at in state.items() if name not in complete.held}
            object.__setattr__(self, "state", left)
            if meshing - set(complete.motion.joints):
                drives = dict.fromkeys(complete.motion.joints, self.drive)
                object.__setattr__(self, "drive", drives)
        if self.motion is not None and filed:
            drives = {joint: filed.get(joint, FILES_DRIVES) for joint in self.motion.joints}
            object.__setattr__(self, "drive", drives)

    def _from_file(self, table: str, kind: type[Any]) -> dict[str, Any]:
        """Objects of a table that the robot's file has beyond a URDF, for joints that move."""
        rows = self.mechanism.description.beyond.tables.get(table, {})
        moving = self.mechanism.joints
        return {
            name: read(kind, row) for name, row in rows.items() if row.get("joint", name) in moving
        }

    def facts(self) -> tuple[str, dict[str, str]]:
        headline, facts = self.mechanism.facts()
        if self.motion is not None:
            motion, joints = self.motion, few(list(self.motion.joints))
            facts["motion"] = f"{joints}: {motion.summary}"
        drives = {"all": self.drive} if isinstance(self.drive, Drive) else self.drive
        kinds = (f"{name}: {drive.kind}" for name, drive in drives.items())
        facts["drives"] = "; ".join(kinds) or "none"
        duration = self._simulated_time()
        facts["duration"] = "not given" if math.isnan(duration) else readable(duration, "s")
        facts["integration"] = f"{self.integrator}, steps of {readable(self.step, 's')}"
        listed = {"mechanism", "motion", "drive", "duration", "integrator", "step"}
        for field in fields(self):
            value = getattr(self, field.name)
            if field.name not in listed and value and value != field.default:
                shown = ", ".join(value) if isinstance(value, Mapping) else value
                facts[field.name.replace("_", " ")] = str(shown)
        return headline, facts

    @property
    def starts_at_rest(self) -> bool:
        """Whether journals shall begin where they rest under load."""
        if self.start is not None:
            return self.start == "rest"
        if self.mechanism.free_base is not None:
            return False
        joints = self.mechanism.clearance.values()
        if any(joint.film is not None and not joint.film[0].hybrid for joint in joints):
            return False  # such a film carries in motion only, and its journal must not touch
        if any(self.mechanism.gravity):
            return True
        if self.motion is None:
            return False
        _, speed, acceleration = self.motion(np.zeros(1))  # then inertia forces press journals
        return bool(speed.any() or acceleration.any())

    @property
    def judged_from(self) -> float | None:
        """Time from which figures are judged [s].

        It is `judge_from` if given, else the end of `settle`. Without either it is 0, unless
        journals fall into their bearings at the start, or perturbed teeth through their play: then
        it is the end of the first turn of a joint of the motion that makes two, or else None: when
        contacts have settled, which a run finds (`judging`). Refused if it makes no sense, as turns
        of what does not turn.
        """
        duration = self._simulated_time()
        if self.judge_from is not None:
            if self.settle is not None:
                raise JointplayError(
                    f"judge_from ({self.judge_from!r}) and settle ({self.settle!r}) both set the "
                    "start of judging; give only one of them"
                )
            start = require_non_negative("judge_from", self.judge_from, "s")
        elif self.settle is not None:
            start = _settling_time(self, self.settle, duration)
        else:
            perturbed, machine = self.seed is not None, self.mechanism
            falls = machine.clearance and (perturbed or not self.starts_at_rest)
            loose = any(gear.play > 0.0 for gear in machine.gears.values())
            if not (falls or (perturbed and loose)):
                return 0.0
            motion, periods = self.motion, list[float]()
            for name in _turning(self):
                assert motion is not None
                # A turn is the period of a motion that repeats it.
                if _time_of_turns(motion, name, 2.0, duration) <= duration:
                    turned = _time_of_turns(motion, name, 1.0, duration)
                    periods.append(math.ceil(turned / self.step) * self.step)
            return min(periods, default=None)
        if start >= duration:
            raise JointplayError(
                f"figures would be judged from {start:g} s on, but the run ends at {duration:g} s"
            )
        return start

    def _simulated_time(self) -> float:
        if self.duration is not None:
            return float(self.duration)
        return math.nan if self.motion is None else float(self.motion.duration)

    def steps(self, every: float | None = None) -> Iterator[Moment]:
        """Run, and yield the state between macro steps, each `every` seconds: see `Run.steps`.

        Leave the loop when you have seen enough.
        """
        return Run(self).steps(every)

    @staticmethod
    @known_keywords
    def resume(path: str | Path) -> Run:
        """Make the run that `Run.checkpoint` wrote, to be continued bit for bit.

        Args:
            path: the file.

        Raises:
            JointplayError: no such file, damaged, or of another version.
        """

        def build(description: dict[str, Any], records: Path | None) -> Run:
            return Run(Simulation.from_description(description), records=records)

        return checkpoint.resume(Path(path), build)

    def run_to(self, path: str | Path, progress: bool = False, resume: bool = False) -> Result:
        """Simulate with the histories on disk: memory does not grow with the length of the run.

        Beside the file are written, while it runs, its records (``.records``) and every minute a
        checkpoint (``.checkpoint``), with which an interrupted run is continued bit for bit.

        Args:
            path: the result's file, ``NAME.nc``.
            progress: show bars.
            resume: continue from the checkpoint if there is one.

        Returns:
            The result, opened as by `Result.open`; of an interrupted run everything up to there.

        Raises:
            JointplayError: see `Run`; the file exists (and nothing is to be continued); it cannot
                be written.
        """
        result = run_to(self, Path(path), progress, resume)
        _warn(result.audit.warnings, stacklevel=3)
        return result

    def run(
        self,
        progress: bool = False,
        certify: bool = False,
        check_step: bool = True,
        estimate: bool = True,
        only: Sequence[str] | None = None,
    ) -> Result:
        """Simulate to the end, and state the numerical errors of the headline figures.

        Args:
            progress: show bars.
            certify: find the errors in `Result.certificate` by several further, finer runs.
            check_step: see `Run.finish`.
            estimate: estimate them by two further runs, in doubt three: see docs/certificates.md.
            only: names of the histories that the result shall have, for less memory and time; its
                methods must do with these. None: all.

        The warnings of the result's audit are also raised, as `JointplayWarning`.
        """
        return self._run(progress, certify, check_step, estimate, only)

    def _run(
        self,
        progress: bool,
        certify: bool,
        check_step: bool = True,
        estimate: bool = True,
        only: Sequence[str] | None = None,
    ) -> Result:
        """`run`, called from as deep below the user's line as `simulate` calls it."""
        result = Run(self, progress).finish(progress, check_step, only)
        if (certify or estimate) and result.status == Status.COMPLETED:
            find_errors = provided("errors_of_run")
            try:
                certificate = find_errors(result, certify, simulation=self, progress=progress)
            except KeyboardInterrupt:
                text = "interrupted: the result is complete, but its numerical errors are unknown"
                _warn([text], stacklevel=4)
            else:
                if certificate is not None:
                    result.certificate = certificate
        _warn(result.audit.warnings, stacklevel=4)
        return result


def _warn(texts: Sequence[str], stacklevel: int) -> None:
    for text in texts:
        warnings.warn(text, JointplayWarning, stacklevel=stacklevel)


class Settings(TypedDict, total=False):
    """Keywords of `simulate`: fields of `Simulation`, as values or as files have them."""

    drive: Drive | str | Mapping[str, Drive | str]
    step: float | str
    integrator: str
    macro_step: float | str | None
    tolerance: float | None
    duration: float | str | None
    seed: int | None
    start: str | None
    settle: float | str | None
    judge_from: float | str | None
    record_every: int
    limits: str
    joint_friction: Mapping[str, JointFriction] | None
    payloads: Sequence[Payload]
    state: Mapping[str, float | tuple[float | None, float | None]]
    loads: Mapping[str, Load]


def simulate(
    mechanism: Mechanism,
    motion: Motion | None = None,
    *,
    progress: bool = False,
    certify: bool = False,
    estimate: bool = True,
    **settings: Unpack[Settings],
) -> Result:
    """Simulate `mechanism` following `motion`: `Simulation(...).run(...)` in one call.

    `progress`, `certify` and `estimate` are those of `Simulation.run`, the settings fields of
    `Simulation`, which says what each means, its unit and its default.

    Raises:
        JointplayError: on anything that cannot be simulated.
    """
    for name in settings:
        if name not in Settings.__annotations__:
            known = [*Settings.__annotations__, "progress", "certify", "estimate"]
            raise JointplayError(unknown_key(name, known, " of simulate"), where=(name,))
    simulation = Simulation(mechanism, motion, **settings)  # type: ignore[arg-type]
    return simulation._run(progress, certify, estimate=estimate)


def _settling_time(simulation: Simulation, settle: float | str, duration: float) -> float:
    """`Simulation.settle` as a time [s]."""
    if not isinstance(settle, str):
        return require_non_negative("settle", settle, "s", ("settle",))
    match = _TURNS.fullmatch(settle)
    if match is None:
        raise JointplayError(
            f"settle must be seconds or as in '2 turns', got {settle!r}", where=("settle",)
        )
    number = float(match[1])
    if match[2] == "s":
        return number
    motion, turning = simulation.motion, _turning(simulation)
    if motion is None or not turning:
        raise JointplayError(
            f"settle = {settle!r}: no joint follows a motion; give seconds", ("settle",)
        )
    times = [_time_of_turns(motion, name, number, duration) for name in turning]
    first = min(times)
    if math.isinf(first):
        raise JointplayError(
            f"settle = {settle!r}: no joint of the motion makes so many turns; give seconds",
            where=("settle",),
        )
    return first


def _turning(simulation: Simulation) -> list[str]:
    """Joints of the motion that turn rather than slide."""
    motion, mechanism = simulation.motion, simulation.mechanism
    named = () if motion is None else motion.joints
    entries = mechanism.description.joints
    return [name for name in named if name in mechanism.joints and not entries[name].slides]


def _time_of_turns(motion: Motion, joint: str, turns: float, duration: float) -> float:
    """Time at which a joint of the motion has made so many turns [s]; infinite if it never has."""
    times = np.linspace(0.0, duration, _NODES)
    position = motion(times)[0][:, motion.joints.index(joint)]
    turned = np.abs(position - position[0])
    reached = np.flatnonzero(turned >= 2.0 * np.pi * turns * (1.0 - 1e-12))
    if not len(reached):
        return math.inf
    k = int(reached[0])
    if k == 0:
        return 0.0
    part = (2.0 * np.pi * turns - turned[k - 1]) / (turned[k] - turned[k - 1])
    return float(times[k - 1] + part * (times[k] - times[k - 1]))
