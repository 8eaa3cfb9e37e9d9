"""Commands of the command line, one module each.

A module has `add`, which adds its parser, and `run`, which does the work and returns the exit
status. To keep `jointplay --help` quick, modules import what they need inside `run`.
"""

from __future__ import annotations

MODULES = ("init", "check", "schema", "play", "report", "robots", "urdf", "wear")
"""Modules with a command of their own, in the order of the help."""
