"""All inputs of a run (eqs 22, 23)."""

from __future__ import annotations

import warnings
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from jointplay.core.errors import JointplayError, MissingName
from jointplay.core.imports import load_object
from jointplay.core.schema import Described, unknown_key
from jointplay.kernel.integrators import DEFAULT
from jointplay.loads import Load
from jointplay.loads.drive import ComputedTorque, Drive, JointFriction
from jointplay.loads.limits import LIMITS
from jointplay.mechanism.mechanism import Mechanism
from jointplay.mechanism.payload import Payload
from jointplay.motion.reference import Motion
from jointplay.result.judging import STARTS
from jointplay.result.stored import Inputs
from jointplay.simulation import checkpoint, judging
from jointplay.simulation.initial import pair
from jointplay.simulation.run import Moment, Run
from jointplay.simulation.saving import run_to

if TYPE_CHECKING:
    from jointplay.result.result import Result


@dataclass(frozen=True)
class Simulation(Described):
    """Everything that defines a run. Equal simulations give bit-identical results on one machine.

    Raises:
        JointplayError: on anything that cannot be simulated; see `Run`.
    """

    written: ClassVar[type | None] = Inputs

    mechanism: Mechanism
    motion: Motion | None = None
    """Reference of the joints whose drives follow one."""
    drive: Drive | Mapping[str, Drive] = field(default_factory=ComputedTorque)
    """One for all joints of the motion, or by joint; joints that are not named are then free."""
    duration: float | None = None
    """Simulated time [s]; None takes the motion's."""
    step: float = 1e-5
    """Time step [s]."""
    integrator: str = DEFAULT
    macro_step: float | None = None
    """Interval at which the multi-rate method asks Pinocchio for the arm's inertia [s]; None lets
    an error estimate choose it."""
    tolerance: float | None = None
    """Error of a macro step relative to the momentum that contacts and inertia move in it, by which
    the multi-rate method chooses its micro steps; None: all as long as `step`, which otherwise
    sets the times of records only."""
    record_every: int = 10
    """Steps between two records; peaks in between are held."""
    joint_friction: Mapping[str, JointFriction] | None = None
    """Friction by joint; None takes the URDF's <dynamics> entries."""
    seed: int | None = None
    """Displaces each journal at the start by a random vector of up to half its clearances."""
    payloads: Sequence[Payload] = ()
    start: str | None = None
    """``"rest"``: journals begin where they lie under gravity and drives; ``"centred"``: in the
    middle of their bearings. None: at rest where gravity acts or the reference moves from the
    first, if there is a place of rest; centred where a film that is not hybrid must not break."""
    state: Mapping[str, float | tuple[float | None, float | None]] = field(default_factory=dict)
    """Position [rad or m], or position and speed, at the start, by name of a joint without
    reference or of any coordinate: ``joint.x`` and so on are the journal's own. None leaves
    one of the two open. In loops, what is not given follows."""
    settle: float | str | None = None
    """Time at the start in which the motion settles and is not judged [s], or as ``"2 turns"``:
    until a driven joint has turned so often."""
    judge_from: float | None = None
    """When figures begin to be judged [s]; None: when the run has settled, see `judged_from`."""
    loads: Mapping[str, Load] = field(default_factory=dict)
    """What else acts, by a name of your choice: springs, wrenches, stops, controllers."""
    limits: str = LIMITS[0]
    """The URDF's limits: ``report`` refuses motions beyond a position and reports speeds and
    efforts, ``cut`` also cuts the efforts of drives and controllers, ``ignore`` checks nothing."""

    def __post_init__(self) -> None:
        """Refuse a start that there is not."""
        if self.start is not None and self.start not in STARTS:
            raise MissingName("start", str(self.start), STARTS)

    @property
    def stands(self) -> bool:
        """Whether journals shall begin where they rest under load."""
        if self.start is not None:
            return self.start == "rest"
        joints = self.mechanism.clearance.values()
        if any(joint.film is not None and not joint.film[0].hybrid for joint in joints):
            return False  # such a film carries in motion only, and its journal must not touch
        if any(self.mechanism.gravity):
            return True
        if self.motion is None:
            return False
        _, speed, acceleration = self.motion(np.zeros(1))  # inertia presses
        return bool(speed.any() or acceleration.any())

    @property
    def judged_from(self) -> float:
        """When figures begin to be judged [s].

        `judge_from` if given, else when `settle` is over; else, where journals fall into their
        bearings at the start, after `START_UP`, if the run is more than twice as long; else 0.

        Raises:
            JointplayError: numbers that make no sense, or turns of what does not turn.
        """
        return judging.judged_from(self)

    def describe(self) -> dict[str, Any]:
        """All inputs as plain data; `from_description` reads it back."""
        description = super().describe()
        if isinstance(self.drive, Drive):
            description["drive"] = [description["drive"]]
        description["state"] = {name: list(pair(name, value)) for name, value in self.state.items()}
        return description

    @classmethod
    def from_description(cls, description: Any) -> Self:
        """Build the simulation that `describe` described.

        Raises:
            JointplayError: an input that this version does not know or that is missing, or a value
                that cannot be; `where` has its place.
        """
        known = [field.name for field in fields(cls)]
        for name in description if isinstance(description, Mapping) else ():
            if name not in known:
                raise JointplayError(unknown_key(name, known), where=(name,))
        return super().from_description(description)

    @classmethod
    def from_fields(cls, fields: dict[str, Any]) -> Self:
        """Build the simulation from its inputs as files have them."""
        given = dict(fields)
        given["state"] = {name: tuple(at) for name, at in given["state"].items()}
        drive = given["drive"]
        if isinstance(drive, list):
            if len(drive) != 1:
                raise JointplayError(
                    f"one drive stands for all joints, got {len(drive)}", where=("drive",)
                )
            (given["drive"],) = drive
        return cls(**given)

    def steps(self, every: float | None = None) -> Iterator[Moment]:
        """Run, and look at the state between macro steps.

        Stop the loop when you have seen enough; `Run.steps` also gives the run to hold.

        Args:
            every: at most so often [s]; None: after every macro step.
        """
        return Run(self).steps(every)

    @staticmethod
    def resume(path: str | Path, trust: Collection[str] = ()) -> Run:
        """A run as `Run.checkpoint` left it, to be continued bit for bit.

        Args:
            path: the file.
            trust: modules from which laws of the user's own may be imported.

        Raises:
            JointplayError: no such file, damaged, or of another version.
        """
        return checkpoint.resume(Path(path), trust)

    def run_to(self, path: str | Path, progress: bool = False, resume: bool = False) -> Result:
        """Simulate with the histories on disk: memory does not grow with the length of the run.

        Beside the file are written, while it runs, its records (``.records``) and every minute a
        checkpoint (``.checkpoint``), with which an interrupted run is continued bit for bit.

        Args:
            path: the result's file, ``NAME.nc``.
            progress: show bars.
            resume: continue from the checkpoint if there is one.

        Returns:
            The result, opened as by `Result.open`. Interrupted, it holds everything up to there.

        Raises:
            JointplayError: see `Run`; the file exists (and nothing is to be continued); it
                cannot be written.
        """
        return run_to(self, Path(path), progress, resume)

    def run(self, progress: bool = False, certify: bool = False, check_step: bool = True) -> Result:
        """Simulate to the end.

        Args:
            progress: show bars.
            certify: run again more finely, and put the numerical errors of the headline figures
                into `Result.certificate`.
            check_step: see `Run.finish`.

        Raises:
            JointplayError: see `Run`.
        """
        result = Run(self, progress).finish(progress, check_step)
        if certify:
            find_errors = load_object("analysis.certification:certify")
            try:
                result.certificate = find_errors(result, simulation=self, progress=progress)
            except KeyboardInterrupt:
                text = "interrupted while certifying: the result is whole, but not certified"
                warnings.warn(text, RuntimeWarning, stacklevel=2)
        return result


_FOLLOW = ComputedTorque()


def simulate(
    mechanism: Mechanism,
    motion: Motion | None = None,
    *,
    drive: Drive | Mapping[str, Drive] = _FOLLOW,
    duration: float | None = None,
    step: float = 1e-5,
    integrator: str = DEFAULT,
    macro_step: float | None = None,
    tolerance: float | None = None,
    record_every: int = 10,
    joint_friction: Mapping[str, JointFriction] | None = None,
    seed: int | None = None,
    payloads: Sequence[Payload] = (),
    start: str | None = None,
    state: Mapping[str, float | tuple[float | None, float | None]] | None = None,
    settle: float | str | None = None,
    judge_from: float | None = None,
    loads: Mapping[str, Load] | None = None,
    limits: str = LIMITS[0],
    progress: bool = False,
    certify: bool = False,
) -> Result:
    """Simulate `mechanism` following `motion`: `Simulation(...).run(...)` in one call.

    `progress` and `certify` are those of `Simulation.run`; all else are fields of `Simulation`,
    which says what each means, its unit and its default.

    Raises:
        JointplayError: on anything that cannot be simulated.
    """
    return Simulation(
        mechanism,
        motion,
        drive=drive,
        duration=duration,
        step=step,
        integrator=integrator,
        macro_step=macro_step,
        tolerance=tolerance,
        record_every=record_every,
        joint_friction=joint_friction,
        seed=seed,
        payloads=payloads,
        start=start,
        state=state or {},
        settle=settle,
        judge_from=judge_from,
        loads=loads or {},
        limits=limits,
    ).run(progress, certify)
