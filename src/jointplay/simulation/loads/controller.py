"""Controllers of the user's own: compiled like a law, or Python that samples and holds."""

from __future__ import annotations

import inspect
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from jointplay.base.errors import JointplayError
from jointplay.base.schema import OptionalQuantity, choice, quantity
from jointplay.physics.contact.functions import Absent, OfFunction, path_of
from jointplay.simulation.loads import drive
from jointplay.simulation.loads.base import Load, Series, Site
from jointplay.simulation.loads.wrench import LoadFunctionDescription, check_arguments

if TYPE_CHECKING:
    from jointplay.model.mechanism import Mechanism

ENCODERS = (*drive.ENCODERS, "both")


def _hold_law(time: Any, x: Any, dx: Any, p: Any, out: Any) -> None:
    """p: number of torques, time of the last sample, torques before it, and since.

    At the time of the sample their mean acts, for half of the step before and half of the next.
    """
    n = int(p[0])
    for k in range(n):
        out[k] = p[2 + n + k]
        if time == p[1]:
            out[k] = 0.5 * (out[k] + p[2 + k])


Sample = Callable[[float, np.ndarray, np.ndarray], Any]
"""Torques by time [s], q and v."""


@dataclass(frozen=True, kw_only=True)
class ControllerDescription(LoadFunctionDescription):
    """How files describe a controller."""

    joints: tuple[str, ...]
    """Joints whose torques it sets."""
    period: OptionalQuantity = quantity(
        "s", default=None, above=0.0, label="period of a controller"
    )
    """Sampling period [s]; if not given, the function is compiled."""
    encoder: str = choice("encoder", ENCODERS, default=ENCODERS[0])
    """Coordinates that it measures: ``link``, ``motor``, or ``both``."""


@dataclass(frozen=True)
class Controller(OfFunction, Load):
    """A controller of the user's own, that sets the torques of some joints.

    With a `period` it is a Python callable, called at the times 0, period, 2 period, ...; its
    torques are held in between (zero-order hold). A function is called as ``function(time, q, v,
    p)`` and returns the torques. For controllers with a memory give a class: an object
    ``function(*parameters)`` is made at the start of each run, and called as ``object(time, q,
    v)``. For checkpoints it needs ``memory()``, which returns its state as plain data, and
    ``recall(memory)``.

    Without a period it is compiled like a law and evaluated in every micro step: ``function(time,
    q, v, p, out)`` writes the torques into ``out``.

    q and v are what the encoders see: positions [rad or m] and velocities, in the order of the
    joints; with ``encoder="both"`` first those of the links, then those of the motors. A compiled
    controller gets velocities extrapolated by half a step, as drives do. A torque acts on the motor
    of a joint that has a gear, else on its link. It adds to that of the joint's drive; with the
    drive `Free` it acts alone.

    Raises:
        JointplayError: no joints, one of them twice, a function of other arguments, no such
            encoder, a period that is not positive; when a run is prepared: a period that is no
            multiple of its step, a function that numba cannot compile.
    """

    written = ControllerDescription

    kind: ClassVar[str] = "controller"

    joints: tuple[str, ...]
    """Joints whose torques it sets."""
    function: Callable[..., Any]
    """A function or class at module level of an importable file (files then name it as
    ``module:function``)."""
    parameters: tuple[float, ...] = quantity("", default=())
    """Numbers for the function."""
    period: OptionalQuantity = quantity(
        "s", default=None, above=0.0, label="period of a controller"
    )
    """Sampling period [s]; if not given, the function is compiled."""
    encoder: str = choice("encoder", ENCODERS, default=ENCODERS[0])
    """Coordinates that it measures: ``link``, ``motor``, or ``both``."""

    def __post_init__(self) -> None:
        if isinstance(self.joints, str) or not self.joints:
            raise JointplayError(
                f"a controller needs the names of its joints, got {self.joints!r}", ("joints",)
            )
        object.__setattr__(self, "joints", tuple(self.joints))
        if len(set(self.joints)) < len(self.joints):
            raise JointplayError(f"a controller has a joint twice: {', '.join(self.joints)}")
        super().__post_init__()
        self._keep_function(self.function)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters: those of a class's constructor, else ``p0``, ``p1``, ..."""
        labels: list[str] = []
        if inspect.isclass(self.function):
            known = inspect.signature(self.function).parameters.values()
            labels = [part.name for part in known if part.kind is part.POSITIONAL_OR_KEYWORD]
        labels += [f"p{k}" for k in range(len(labels), len(self.parameters))]
        return tuple(labels[: len(self.parameters)])

    def _check_arguments(self, function: Callable[..., Any]) -> None:
        if self.period is None:
            check_arguments(function, ("time", "q", "v", "p", "out"))
        elif not inspect.isclass(function):
            check_arguments(function, ("time", "q", "v", "p"))

    def site(self, mechanism: Mechanism) -> Site:
        links = tuple(mechanism.coordinate(name) for name in self.joints)
        motors = tuple(mechanism.motor(name) for name in self.joints)
        measured = {"link": links, "motor": motors, "both": links + motors}[self.encoder]
        return Site(measured, motors)

    def law(self) -> Callable[..., None]:
        return self.function if self.period is None else _hold_law

    def numbers(self, mechanism: Mechanism) -> np.ndarray:
        if self.period is None:
            return np.array([*self.parameters, 0.0])
        n = len(self.joints)
        return np.array([n, -1.0, *np.zeros(2 * n)])

    def driven(self) -> tuple[str, ...]:
        return self.joints

    def record(self, x: np.ndarray, answers: np.ndarray) -> Sequence[Series]:
        return [
            Series(f"torque.{name}", answers[:, k], "N m or N")
            for k, name in enumerate(self.joints)
        ]

    def sampler(self) -> Sample:
        """The callable that a run samples: an object of the class, or the function."""
        if isinstance(self.function, Absent):
            raise JointplayError(self.function.reason)
        if inspect.isclass(self.function):
            try:
                sample: Any = self.function(*self.parameters)
            except Exception as error:
                raise JointplayError(
                    f"the controller {path_of(self.function)!r} cannot be made of the parameters "
                    f"{self.parameters}: {error}"
                ) from error
            return sample  # type: ignore[no-any-return]
        function, parameters = self.function, self.parameters
        return lambda time, q, v: function(time, q, v, parameters)

    def remember(self, sample: Sample) -> Any:
        """State of a run's object, by its own `memory`; None for a function, which has none.

        Raises:
            JointplayError: an object without `memory` and `recall`, or a memory that no JSON holds.
        """
        if not inspect.isclass(self.function):
            return None
        name = path_of(self.function)
        if not all(callable(getattr(sample, method, None)) for method in ("memory", "recall")):
            raise JointplayError(
                f"the controller {name!r} is an object whose state cannot be saved in a "
                "checkpoint; give it memory(), which returns plain data, and recall(memory)"
            )
        state: Any = sample.memory()  # type: ignore[attr-defined]
        try:
            return json.loads(json.dumps(state))
        except (TypeError, ValueError) as error:
            raise JointplayError(
                f"the memory of the controller {name!r} is not plain data: {error}"
            ) from error

    def torques(self, sample: Sample, time: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Torques at a time, checked, shape (joints,) [N m or N]."""
        name = path_of(self.function)
        try:
            sampled = np.asarray(sample(time, q, v), float)
        except Exception as error:
            raise JointplayError(
                f"the controller {name!r} failed at t = {time:g} s: {error!r}"
            ) from error
        if sampled.shape != (len(self.joints),) or not np.isfinite(sampled).all():
            raise JointplayError(
                f"the controller {name!r} gave {sampled.tolist()!r} at t = {time:g} s; it must "
                f"give {len(self.joints)} finite torques ({', '.join(self.joints)})"
            )
        return sampled


def hold(numbers: np.ndarray, time: float, torques: np.ndarray, jumps: bool) -> None:
    """Hold new torques from `time` on; with `jumps` the old ones count for half at that instant."""
    n = len(torques)
    numbers[1] = time
    numbers[2 : 2 + n] = numbers[2 + n :] if jumps else torques
    numbers[2 + n :] = torques


def held(numbers: np.ndarray) -> np.ndarray:
    """The torques that are held, a copy."""
    return numbers[1 + len(numbers) // 2 :].copy()
