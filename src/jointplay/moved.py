"""Modules and names of `jointplay` as they were before version 0.2: still found, with a notice."""

from __future__ import annotations

import importlib
import importlib.abc
import importlib.machinery
import sys
import warnings
from collections.abc import Sequence
from types import ModuleType
from typing import Any

_FOLDERS = {
    "host": "files numba_cache stopping streams workers",
    "joints": "materials",
    "kernel": "integrators workspace",
    "loads": "drive",
    "mechanism": "export gear impact model payload picture robots tree urdf visuals",
    "motion": "cartesian ideal",
    "result": "audit histories netcdf stored",
    "scenario": "keep",
    "simulation": "limits loop",
    "analysis": "claims replay wear",
    "playback": "policy",
    "contact.normal": (
        "anagnostopoulos carvalho_martins dubowsky_freudenstein esdu_78035 flores gharib_hurmuzlu "
        "goldsmith gonthier herbert_mcwhannell hertz hertzian hu_guo hunt_crossley "
        "hunt_crossley_1975 johnson kelvin_voigt lankarani_nikravesh lee_wang line_contact "
        "linear_spring liu pereira radzimovsky restitution zhang_sharf zhiying_qishao"
    ),
    "contact.friction": (
        "ambrosio bengisu_akay bristle brown_mcphee coulomb dahl gonthier_friction lugre threlfall"
    ),
    "contact.film": "pinkus_sternlicht short_bearing",
}

MOVED = {
    f"jointplay.{'contact.' if '.' in folder else ''}{name}": f"jointplay.{folder}.{name}"
    for folder, names in _FOLDERS.items()
    for name in names.split()
} | {
    "jointplay.certify": "jointplay.analysis.certification",
    "jointplay.loops": "jointplay.mechanism.loop",
    "jointplay.scenario.units": "jointplay.units",
}
"""Full name of a module before, and now."""

_PACKAGES = {
    "analysis": "allocate budget reduce_joint wear_life worn_depth",
    "contact": (
        "Ambrosio Anagnostopoulos BengisuAkay BrownMcPhee CarvalhoMartins Coulomb CustomBristle "
        "CustomFilm CustomFriction CustomNormalForce Dahl DubowskyFreudenstein Esdu78035 Flores "
        "GharibHurmuzlu Goldsmith Gonthier GonthierFriction HerbertMcWhannell Hertz HuGuo "
        "HuntCrossley HuntCrossley1975 Johnson KelvinVoigt LankaraniNikravesh LeeWang LinearSpring "
        "Liu LuGre Pereira PinkusSternlicht Radzimovsky ShortBearing Threlfall ZhangSharf "
        "ZhiyingQishao"
    ),
    "geometry": "Form Mode",
    "loads": "ComputedTorque Free JointFriction Prescribed Torque",
    "motion": "cartesian_motion",
    "result": "Audit Certificate",
}

KINDS = {
    "ClearanceJoint": "RevoluteClearance",
    "PrismaticJoint": "PrismaticClearance",
    "SphericalJoint": "SphericalClearance",
}
"""Kinds of joint as they were called, and are."""

NAMES = {
    name: f"jointplay.{package}.{name}"
    for package, names in _PACKAGES.items()
    for name in names.split()
} | {old: f"jointplay.{new}" for old, new in KINDS.items()}
"""Name that `jointplay` itself had before, and where it is now."""


def found(module: str, name: str) -> Any:
    """What `module` once called `name`, one of `NAMES`, with a notice to the caller's caller."""
    new = NAMES[name]
    warnings.warn(f"{module}.{name} is {new} now", DeprecationWarning, stacklevel=3)
    home, _, own = new.rpartition(".")
    return getattr(importlib.import_module(home), own)


class _Moved(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    """Finds a module that moved by its old name, and gives the module itself."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> importlib.machinery.ModuleSpec | None:
        if fullname not in MOVED:
            return None
        return importlib.machinery.ModuleSpec(fullname, self)

    def create_module(self, spec: importlib.machinery.ModuleSpec) -> ModuleType:
        new = MOVED[spec.name]
        warnings.warn(f"{spec.name} is {new} now", DeprecationWarning, stacklevel=2)
        return importlib.import_module(new)

    def exec_module(self, module: ModuleType) -> None:
        """The module has run already, under its own name."""


def install() -> None:
    """Let old names be found, after all that really exists."""
    if not any(isinstance(finder, _Moved) for finder in sys.meta_path):
        sys.meta_path.append(_Moved())
