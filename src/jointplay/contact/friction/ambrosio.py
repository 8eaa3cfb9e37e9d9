"""Ambrosio's modified Coulomb friction, the paper's own law (eqs 20, 21)."""

from __future__ import annotations

from dataclasses import dataclass

from jointplay.contact.law import FrictionLaw
from jointplay.core.errors import JointplayError
from jointplay.core.schema import quantity


@dataclass(frozen=True)
class Ambrosio(FrictionLaw):
    """No friction up to v0, a ramp to mu_d at v1, mu_d above (eq. 21).

    The paper prints 1 instead of mu_d in the last branch; mu_d is what makes it continuous.
    """

    name = "ambrosio"
    formula = (
        r"\mu = 0\ (|v_t|\le v_0),\quad \mu_d\frac{|v_t|-v_0}{v_1-v_0},\quad \mu_d\ (|v_t|\ge v_1)"
    )
    reference = (
        "J. A. C. Ambrosio, in Schiehlen, Valasek (eds), Virtual Nonlinear Multibody Systems, "
        "Kluwer, 2003, 57-81"
    )
    validity = "sliding; no sticking: a resting contact creeps below v1, freely below v0"

    mu_d: float = quantity("", default=0.1, least=0.0, words="friction coefficient")
    """Dynamic friction coefficient."""
    v0: float = quantity("m/s", default=1e-4, least=0.0)
    """Sliding speed at which the ramp begins [m/s].

    The paper gives none; 1e-4 and 1e-3 m/s are this project's choice.
    """
    v1: float = quantity("m/s", default=1e-3, least=0.0)
    """Sliding speed at which it ends, > v0 [m/s]."""

    def __post_init__(self) -> None:
        """Check the parameters."""
        super().__post_init__()
        if self.v1 <= self.v0:
            raise JointplayError(
                f"v1 must be greater than v0, got v0 = {self.v0:g} and v1 = {self.v1:g} m/s",
                where=("v1",),
            )

    @staticmethod
    def function(speed: float, mu_d: float, v0: float, v1: float) -> float:
        """Evaluate eq. 21."""
        if speed <= v0:
            return 0.0
        if speed >= v1:
            return mu_d
        return mu_d * (speed - v0) / (v1 - v0)
