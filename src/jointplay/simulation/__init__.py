"""Simulations: inputs, initial state and the loop through time."""

from jointplay.simulation.simulation import PERTURBATION, Run, Simulation, simulate

__all__ = ["PERTURBATION", "Run", "Simulation", "simulate"]
