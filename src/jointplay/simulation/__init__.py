"""Simulations: inputs, initial state and the loop through time."""

from typing import TYPE_CHECKING

from jointplay.host.late import offering

if TYPE_CHECKING:
    from jointplay.simulation.simulation import PERTURBATION as PERTURBATION
    from jointplay.simulation.simulation import Run as Run
    from jointplay.simulation.simulation import Simulation as Simulation
    from jointplay.simulation.simulation import simulate as simulate

__all__ = ["PERTURBATION", "Run", "Simulation", "simulate"]

__getattr__ = offering(__name__, dict.fromkeys(__all__, "simulation"))
