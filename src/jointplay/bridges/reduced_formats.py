"""Formats of files with reduced joints, and which of them each simulator takes."""

from __future__ import annotations

import importlib.util
from collections.abc import Sequence
from typing import NamedTuple

from jointplay.base.errors import JointplayError
from jointplay.base.imports import how_to_install

FORMATS = {
    "mjcf": (".xml",),
    "sdf": (".sdf",),
    "urdf": (".urdf", ".yaml"),
    "json": (".json",),
    "usd": (".usda",),
    "proto": (".proto",),
    "py": ("_dead_band.py",),
}
"""Endings of the files of each format."""
_NEEDS = {
    "mjcf": ("mujoco", "MuJoCo compiles the URDF"),
    "usd": ("newton_usd_schemas", "Newton's schemas and OpenUSD write USD"),
    "proto": ("urdf2webots", "urdf2webots makes the PROTO"),
}
"""Package that a format needs, and why."""
_TILTED = ("mjcf", "json")
"""Formats that can represent the tilt of an axis."""


class Simulator(NamedTuple):
    """What a robot simulator can import, by its importers' code or documentation."""

    formats: tuple[str, ...]
    """The formats with which it represents most."""
    takes: str
    """Formats that it imports."""
    has: str
    """Parts of the play that it then has."""
    lacks: str
    """What is lost."""

    def notes(self, name: str) -> list[str]:
        """These texts as notes, a line each."""
        clauses = (f"takes {self.takes}", f"has {self.has}", f"lacks {self.lacks}")
        return [f"{name}: {clause}" for clause in clauses]


_HINGE = "dead band as limits of a second hinge, rotor as a body; friction and damping at the motor"
SIMULATORS = {
    "mujoco": Simulator(
        ("mjcf", "py"),
        "MJCF, and URDF without any stiffness (4.0.0; MJX 3.17.0 and MuJoCo Warp 4.0.0 run it)",
        "dead band and teeth as tendon, friction and damping at the link, rotor as armature, tilt, "
        "servo as dcmotor",
        "a servo's dead band, counts and sampling; MJX in JAX has no dcmotor",
    ),
    "newton": Simulator(
        ("usd", "py"),
        "USD, MJCF without tendons between two hinges of a body, URDF with rigid stops (1.8.0)",
        f"{_HINGE}; teeth as the limits' spring",
        "tilt, servos, friction at the link, shapes; its MuJoCo solver's limits are off by tenths",
    ),
    "genesis": Simulator(
        ("urdf", "py"),
        "URDF, MJCF without springs in tendons, USD without Newton's schemas (1.4.5)",
        _HINGE,
        "the teeth's stiffness, tilt, servos, friction at the link",
    ),
    "gazebo": Simulator(
        ("sdf", "urdf"),
        "SDF, and URDF with tags of ros2_control",
        f"{_HINGE}; encoders as states that it publishes",
        "tilt, servos, friction at the link, shapes in SDF; the teeth's stiffness in DART",
    ),
    "webots": Simulator(
        ("proto",),
        "PROTO (made by urdf2webots 2025.0.0; it was not run in Webots)",
        "dead band as stops of a second hinge, rotor as a Solid, encoders as PositionSensor",
        "the teeth's stiffness, tilt, servos, friction at the link, joints that mimic, a held base "
        "(but to a link `world`); its maker expects play below 10 mrad to be simulated badly",
    ),
    "isaac": Simulator(
        ("usd", "py"),
        "USD; converts URDF and MJCF to it (Isaac Sim 6.0, Isaac Lab 3.0, by their documentation)",
        f"{_HINGE} (PhysxJointAxisAPI)",
        "the teeth's stiffness in PhysX, tilt, servos, friction at the link, shapes",
    ),
}
"""Simulators by their names for ``--for``."""


def choose(
    requested: Sequence[str], tilt: bool, simulator: str | None = None
) -> tuple[list[str], list[str]]:
    """Formats to write, and notes on those that are left out.

    Args:
        requested: formats that were asked for; none: all that can be written.
        tilt: whether the tilt of axes is to be written.
        simulator: one of `SIMULATORS`, whose formats are written in place of all.

    Raises:
        JointplayError: both formats and a simulator are given; a format that was asked for cannot
            represent the tilt of an axis, or needs a package that is missing.
    """
    if requested and simulator:
        formats = ", ".join(SIMULATORS[simulator].formats)
        raise JointplayError(
            f"--for {simulator} chooses the formats ({formats}): leave out --format "
            f"{' '.join(requested)}, or --for"
        )
    notes = SIMULATORS[simulator].notes(simulator) if simulator else []
    available: Sequence[str] = SIMULATORS[simulator].formats if simulator else tuple(FORMATS)
    chosen = list(dict.fromkeys(requested or available))
    upright = [name for name in chosen if tilt and name not in _TILTED]
    if upright:
        limit = f"the tilt of an axis, which --tilt writes, is held by {' and '.join(_TILTED)} only"
        if requested or len(upright) == len(chosen):
            option = f"--for {simulator}" if simulator else f"--format {upright[0]}"
            raise JointplayError(f"{option} with --tilt: {limit}")
        chosen = [name for name in chosen if name in _TILTED]
        notes.append(f"no {', '.join(upright)}: {limit}")
    for name, (package, purpose) in _NEEDS.items():
        if name not in chosen or importlib.util.find_spec(package) is not None:
            continue
        text = f"{purpose}, and the package {package} is missing: {how_to_install('simulators')}"
        if requested or simulator:
            raise JointplayError(text)
        chosen.remove(name)
        notes.append(f"no {name}: {text}")
    if simulator and "py" in chosen:
        content = "motor, dead band and teeth as torques on a robot without play"
        notes.append(f"{simulator}: *{FORMATS['py'][0]} has {content}")
    return chosen, notes
