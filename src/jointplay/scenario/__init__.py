"""Scenario files: what to simulate, in TOML, with units."""

from jointplay.scenario.load import Scenario

__all__ = ["Scenario"]
