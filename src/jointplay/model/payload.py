"""Payloads that the tool picks up and releases during the motion."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from jointplay.base.errors import JointplayError
from jointplay.base.schema import Described, OptionalQuantity, Quantity, check_fields, quantity

if TYPE_CHECKING:
    import pinocchio as pin

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Payload(Described):
    """A rigid body held by a frame of the mechanism from `pick` to `release`.

    Before it is picked up it rests in the world: if the tool moves at that instant, body and
    mechanism hit each other plastically (momentum is conserved, energy is lost). Released, it
    leaves with the speed that it has. A computed-torque drive does not know of it. A mass of 0 is
    no payload.

    Raises:
        JointplayError: a mass that is negative, moments of inertia that no body has, a release
            that does not follow the pick.
    """

    frame: str
    """Frame that holds the payload; usually the tool."""
    mass: Quantity = quantity("kg", least=0.0, label="payload mass")
    """Mass [kg]; 0: no payload."""
    pick: Quantity = quantity("s", default=0.0, least=0.0, label="payload pick time")
    """Time of picking up [s]; a payload picked up at 0 is there from the start."""
    release: OptionalQuantity = quantity("s", default=None, label="payload release time")
    """Time of release [s]; None: never."""
    centre: Vector = quantity("m", default=(0.0, 0.0, 0.0), label="payload centre")
    """Centre of mass in the frame [m]."""
    inertia: Vector = quantity("kg*m^2", default=(0.0, 0.0, 0.0), label="payload inertia")
    """Moments of inertia about the centre of mass, along the frame's axes [kg m^2]."""

    def __post_init__(self) -> None:
        check_fields(self)
        if self.release is not None and self.release <= self.pick:
            text = f"payload release at {self.release:g} s must follow its pick at {self.pick:g} s"
            raise JointplayError(text, where=("release",))
        low, middle, high = sorted(self.inertia)
        if low < 0.0 or high > (low + middle) * (1.0 + 1e-6):
            why = f"no rigid body can have the moments of inertia {self.inertia} kg m^2"
            raise JointplayError(why, where=("inertia",))
        if self.mass == 0.0 and high > 0.0:
            raise JointplayError(
                f"a payload of 0 kg is none, and has no inertia; got {self.inertia} kg m^2",
                where=("inertia",),
            )

    @property
    def body(self) -> pin.Inertia:
        """Inertia of the payload in the frame that holds it."""
        import pinocchio as pin

        return pin.Inertia(self.mass, np.array(self.centre), np.diag(self.inertia))


def velocity_after_pick(
    before: pin.Model, after: pin.Model, q: np.ndarray, v: np.ndarray, forbidden: np.ndarray
) -> np.ndarray:
    """Velocity (nv,) after a plastic impact with a body at rest that is then part of the mechanism.

    It solves M_after v = M_before v_before + forbidden^T impulse, forbidden v = 0, where
    `forbidden` (rows, nv) is the Jacobian of ideal loops. Least squares, as its rows may be
    redundant.
    """
    import pinocchio as pin

    nv, rows = before.nv, len(forbidden)
    masses = []
    for model in (before, after):
        mass = np.triu(pin.crba(model, model.createData(), q).reshape(nv, nv))
        masses.append(mass + np.triu(mass, 1).T)
    system = np.zeros((nv + rows, nv + rows))
    system[:nv, :nv], system[:nv, nv:], system[nv:, :nv] = masses[1], forbidden.T, forbidden
    right = np.concatenate([masses[0] @ v, np.zeros(rows)])
    return np.linalg.lstsq(system, right, rcond=None)[0][:nv]
