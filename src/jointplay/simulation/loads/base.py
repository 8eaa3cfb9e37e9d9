"""What a load is: something that pushes on a mechanism, besides contact, drives and gravity.

A load says where it acts, by what law, and what it is made of:

- its law is a short function ``law(time, x, dx, p, out)``, compiled and called by address in every
  micro step (`kernel.load` says what x, dx and out are), as a contact law is;
- it stores energy, or it brings work in or takes it out; both enter the energy balance;
- it records histories of its own, beside these energies.

The model is Drake's ForceElement (multibody/tree/force_element.h): forces, stored energy, power of
what is conserved and of what is not. A new load is a class in a module of its own, and an entry in
`loads.LOADS`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import KW_ONLY, dataclass
from typing import TYPE_CHECKING, ClassVar, NamedTuple

import numpy as np

from jointplay.base.compiler import Native
from jointplay.base.errors import JointplayError
from jointplay.base.schema import Described, check_fields, quantity
from jointplay.physics.contact.functions import Absent
from jointplay.physics.contact.machine_code import compiled_function
from jointplay.physics.kernel.constants import NEVER

if TYPE_CHECKING:
    from jointplay.model.frames import Frame
    from jointplay.model.mechanism import Mechanism

WORLD = "world"
"""Name of the frame that does not move."""

Vector = tuple[float, float, float]


class Series(NamedTuple):
    """A history that a load records."""

    name: str
    values: np.ndarray
    """(n,)."""
    unit: str


@dataclass(frozen=True)
class Site:
    """Where a load acts: on coordinates, or between two frames."""

    inputs: tuple[int, ...] = ()
    """Coordinates whose positions and velocities its law reads."""
    outputs: tuple[int, ...] = ()
    """Coordinates on which it acts."""
    levers: tuple[float, ...] = ()
    """How fast what a spring is bent by changes with each of these; 1 if not given."""
    frames: tuple[Frame, Frame] | None = None
    """The law's wrench acts on the second, its opposite on the first."""


class Load(Described, ABC):
    """Something that pushes on a mechanism. Subclasses are frozen dataclasses.

    Their numbers are fields with units (`base.schema.quantity`), of revolute and of prismatic
    joints where these depend on the joint that the load's `joint` names.
    """

    selector = ("kind", "kind")

    kind: ClassVar[str]
    """The one word that selects the load."""
    stores: ClassVar[bool] = False
    """Whether its answer at rest is the slope of an energy: a spring's."""

    def __post_init__(self) -> None:
        check_fields(self)

    @abstractmethod
    def site(self, mechanism: Mechanism) -> Site:
        """Where it acts; a joint or frame that `mechanism` does not have is refused."""

    @abstractmethod
    def law(self) -> Callable[..., None]:
        """``law(time, x, dx, p, out)``, at module level; numba compiles it."""

    @abstractmethod
    def numbers(self, mechanism: Mechanism) -> np.ndarray:
        """Numbers p of the law."""

    def implicit(self) -> int:
        """When its answer depends on velocity: `constants.NEVER`, `ALWAYS` or `IF_PRESSED`.

        Of loads whose answer at rest is the slope of an energy; others are extrapolated.
        """
        return NEVER

    def energy(self, x: np.ndarray, numbers: np.ndarray) -> np.ndarray:
        """Energy stored at the positions x, shape (n, numbers that the law sees): (n,) [J]."""
        return np.zeros(len(x))

    def steepest(self) -> float:
        """Largest slope of its answer at rest, by which time steps are checked [N/m or N m/rad]."""
        return 0.0

    @abstractmethod
    def record(self, x: np.ndarray, answers: np.ndarray) -> Sequence[Series]:
        """Histories that results hold, from x as in `energy` and the law's answers (n, size)."""

    def driven(self) -> tuple[str, ...]:
        """Joints whose actuator it is: torques that their limit of effort concerns."""
        return ()

    def tight(self) -> Load:
        """The same without play, as the ideal mechanism has it."""
        return self

    def left_out(self) -> str:
        """Why a machine that drives hold in a pose has it not; empty if it does."""
        return "drives hold" if self.driven() else ""


@dataclass(frozen=True)
class OnJoint(Load):
    """What loads have in common that act on the coordinate of a joint."""

    joint: str
    """Joint on which it acts."""

    def site(self, mechanism: Mechanism) -> Site:
        """The joint's coordinate: yaw, or z of a slider, if it has clearance."""
        at = (mechanism.coordinate(self.joint),)
        return Site(at, at)

    def record(self, x: np.ndarray, answers: np.ndarray) -> Sequence[Series]:
        return (Series("torque", answers[:, 0], "N m or N"),)


@dataclass(frozen=True)
class OnFrame(Load):
    """What loads have in common that act at a point of a link or frame."""

    frame: str
    """Link or frame that it acts on."""
    _: KW_ONLY
    at: Vector = quantity("m", default=(0.0, 0.0, 0.0))
    """Point in the axes of `frame` at which it acts [m]."""


def compiled_law(load: Load) -> Native:
    """The load's compiled law: its `address`, and `ctypes` to call it from Python.

    Raises:
        JointplayError: numba cannot compile it, for the reason given; or it is not at hand.
    """
    law = load.law()
    if isinstance(law, Absent):
        raise JointplayError(law.reason)
    from jointplay.physics.kernel.load import LOAD_LAW

    return compiled_function(law, LOAD_LAW)


def frame(mechanism: Mechanism, name: str, at: Vector = (0.0, 0.0, 0.0)) -> Frame:
    """Frame of the point `at` [m] of a frame or link, refused if there is none; `WORLD` is the
    ground.
    """
    import pinocchio as pin

    from jointplay.model.frames import carried
    from jointplay.model.mechanism import frame_index

    model = mechanism.model
    place = pin.SE3(np.eye(3), np.array(at))
    if name == WORLD and not model.existFrame(name):
        return 0, place
    index, held = carried(model, frame_index(model, name, "frame for a load", (WORLD,)))
    return index, held * place


def between(mechanism: Mechanism, first: Frame, second: Frame) -> Site:
    """Site between two frames, which must move against each other."""
    if first[0] == second[0]:
        raise JointplayError(
            "a load acts between two frames that do not move against each other: "
            f"both belong to {mechanism.model.names[first[0]]!r}"
        )
    return Site(frames=(first, second))
