"""Scenario files: what to simulate, in TOML, with units."""

from jointplay.scenario.load import Scenario
from jointplay.scenario.robot import robot_scenario

__all__ = ["Scenario", "robot_scenario"]
