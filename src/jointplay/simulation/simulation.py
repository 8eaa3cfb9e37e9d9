"""All inputs of a run (eqs 22, 23)."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from jointplay.errors import JointplayError
from jointplay.host.late import late
from jointplay.kernel.integrators import DEFAULT
from jointplay.loads.drive import ComputedTorque, Drive, JointFriction, drive_from_description
from jointplay.mechanism.mechanism import Mechanism
from jointplay.mechanism.payload import Payload
from jointplay.motion.reference import Motion
from jointplay.result.result import Result
from jointplay.simulation.initial import PERTURBATION
from jointplay.simulation.run import Run

__all__ = ["PERTURBATION", "Run", "Simulation", "simulate"]


@dataclass(frozen=True)
class Simulation:
    """Everything that defines a run. Equal simulations give bit-identical results on one machine.

    Raises:
        JointplayError: on anything that cannot be simulated; see `prepare`.
    """

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
    start: Mapping[str, float] = field(default_factory=dict)
    """Where joints without reference begin [rad or m]; in loops, if not given, they follow."""
    start_speed: Mapping[str, float] = field(default_factory=dict)
    """How fast [rad/s or m/s]."""

    def describe(self) -> dict[str, Any]:
        """All inputs as plain data; `from_description` reads it back."""
        return {
            "mechanism": self.mechanism.describe(),
            "motion": None if self.motion is None else self.motion.describe(),
            "drive": {name: drive.describe() for name, drive in self.drive.items()}
            if isinstance(self.drive, Mapping)
            else [self.drive.describe()],
            "duration": self.duration,
            "step": self.step,
            "integrator": self.integrator,
            "macro_step": self.macro_step,
            "tolerance": self.tolerance,
            "record_every": self.record_every,
            "joint_friction": None
            if self.joint_friction is None
            else {name: asdict(value) for name, value in self.joint_friction.items()},
            "seed": self.seed,
            "payloads": [payload.describe() for payload in self.payloads],
            "start": dict(self.start),
            "start_speed": dict(self.start_speed),
        }

    @classmethod
    def from_description(cls, description: Mapping[str, Any]) -> Simulation:
        """Build the simulation that `describe` described."""
        fields = dict(description)
        fields["mechanism"] = Mechanism.from_description(fields["mechanism"])
        if fields["motion"] is not None:
            fields["motion"] = Motion.from_description(fields["motion"])
        drive = fields["drive"]
        if isinstance(drive, Mapping):
            fields["drive"] = {name: drive_from_description(one) for name, one in drive.items()}
        else:
            fields["drive"] = drive_from_description(drive[0])
        fields["payloads"] = tuple(Payload.from_description(one) for one in fields["payloads"])
        if fields["joint_friction"] is not None:
            fields["joint_friction"] = {
                name: JointFriction(**value) for name, value in fields["joint_friction"].items()
            }
        return cls(**fields)

    def prepare(self) -> Run:
        """Check everything and make ready to step.

        Raises:
            JointplayError: a step, duration or record interval that makes no sense, a step too
                large for the contact stiffness, or a motion that does not fit the mechanism.
        """
        try:
            return Run(self)
        except (ArithmeticError, np.linalg.LinAlgError) as error:
            raise JointplayError(
                f"these numbers cannot be computed with, one is far too large or small: {error}"
            ) from None

    def run(self, progress: bool = False, certify: bool = False) -> Result:
        """`prepare`, then `Run.execute`.

        Args:
            progress: see `Run.execute`.
            certify: run again more finely, and put the numerical errors of the headline figures
                into `Result.certificate`.
        """
        result = self.prepare().execute(progress)
        if certify:
            find_errors = late("analysis.certify:certify")
            try:
                result.certificate = find_errors(result, simulation=self, progress=progress)
            except KeyboardInterrupt:
                text = "interrupted while certifying: the result is whole, but not certified"
                warnings.warn(text, RuntimeWarning, stacklevel=2)
        return result


def simulate(
    mechanism: Mechanism,
    motion: Motion | None = None,
    *,
    progress: bool = False,
    certify: bool = False,
    **options: Any,
) -> Result:
    """Simulate `mechanism` following `motion`; `options` are the fields of `Simulation`.

    See `Simulation.run` for `progress` and `certify`.
    """
    return Simulation(mechanism, motion, **options).run(progress, certify)
