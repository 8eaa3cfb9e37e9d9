"""Loads: forces on a mechanism besides contact, drives and gravity.

A load has a site, a law, and numbers for the law:

- its law is a short function ``law(time, x, dx, p, out)``, compiled and called by address in every
  micro step (`kernel.load` says what x, dx and out are), as a contact law is;
- it stores energy, or brings work in or takes it out; both enter the energy balance;
- it records histories of its own, beside these energies.

The model is Drake's ForceElement (multibody/tree/force_element.h): forces, stored energy,
conservative and non-conservative power. A new load is a class in a module of its own, and an entry
in `loads.LOADS`.
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
    """Coordinates whose positions and velocities the law reads."""
    outputs: tuple[int, ...] = ()
    """Coordinates on which the law's efforts act."""
    levers: tuple[float, ...] = ()
    """Rate of a spring's deflection with each of these coordinates; 1 if not given."""
    frames: tuple[Frame, Frame] | None = None
    """Frames between which the load acts: the law's wrench on the second, its opposite on the
    first."""


class Load(Described, ABC):
    """A load on a mechanism. Subclasses are frozen dataclasses.

    Their numbers are fields with units (`base.schema.quantity`); two units where they depend on
    whether the load's `joint` is revolute or prismatic.
    """

    selector = ("kind", "kind")

    kind: ClassVar[str]
    """The word that selects this kind of load."""
    stores: ClassVar[bool] = False
    """Whether the force at rest is the gradient of a stored energy, as a spring's."""

    def __post_init__(self) -> None:
        check_fields(self)

    @abstractmethod
    def site(self, mechanism: Mechanism) -> Site:
        """Where the load acts; refused if `mechanism` does not have the joint or frame."""

    @abstractmethod
    def law(self) -> Callable[..., None]:
        """The function ``law(time, x, dx, p, out)``, at module level; numba compiles it."""

    @abstractmethod
    def numbers(self, mechanism: Mechanism) -> np.ndarray:
        """Numbers p of the law."""

    def implicit(self) -> int:
        """When the force depends on velocity: `constants.NEVER`, `ALWAYS` or `IF_PRESSED`.

        This counts for loads with `stores`, whose damping is solved implicitly; the others are
        evaluated at extrapolated velocities.
        """
        return NEVER

    def energy(self, x: np.ndarray, numbers: np.ndarray) -> np.ndarray:
        """Energy stored at n positions x, shape (n, inputs of the law): (n,) [J]."""
        return np.zeros(len(x))

    def steepest(self) -> float:
        """Largest stiffness, by which time steps are checked [N/m or N m/rad]."""
        return 0.0

    @abstractmethod
    def record(self, x: np.ndarray, answers: np.ndarray) -> Sequence[Series]:
        """Histories for results, from x as in `energy` and the law's answers (n, size)."""

    def driven(self) -> tuple[str, ...]:
        """Joints whose actuator the load is, so that their limits of effort apply to it."""
        return ()

    def tight(self) -> Load:
        """The load without play, for the ideal mechanism."""
        return self

    def left_out(self) -> str:
        """Why the load does not count on a machine that drives hold in a pose; empty: it does."""
        return "drives hold" if self.driven() else ""


@dataclass(frozen=True)
class OnJoint(Load):
    """A load on the coordinate of a joint."""

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
    """A load at a point of a link or frame."""

    frame: str
    """Link or frame on which it acts."""
    _: KW_ONLY
    at: Vector = quantity("m", default=(0.0, 0.0, 0.0))
    """Point at which it acts, in the axes of `frame` [m]."""


def compiled_law(load: Load) -> Native:
    """The load's compiled law: its `address`, and `ctypes` to call it from Python.

    Raises:
        JointplayError: numba cannot compile it, for the reason given; or its code is not at hand.
    """
    law = load.law()
    if isinstance(law, Absent):
        raise JointplayError(law.reason)
    from jointplay.physics.kernel.load import LOAD_LAW

    return compiled_function(law, LOAD_LAW)


def frame(mechanism: Mechanism, name: str, at: Vector = (0.0, 0.0, 0.0)) -> Frame:
    """Frame at the point `at` [m] of a frame or link, which must exist; `WORLD` is the ground."""
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
