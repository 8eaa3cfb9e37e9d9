"""Contact and friction laws (eqs 10-21), one module each; `law` says what a law is."""

from __future__ import annotations

import importlib
from typing import Any

from jointplay.contact.ambrosio import Ambrosio
from jointplay.contact.bristle import BristleLaw, CustomBristle
from jointplay.contact.dahl import Dahl
from jointplay.contact.film import CustomFilm, FilmLaw, FilmProperties
from jointplay.contact.gonthier_friction import GonthierFriction
from jointplay.contact.hertz import Hertz
from jointplay.contact.hunt_crossley import HuntCrossley
from jointplay.contact.kelvin_voigt import KelvinVoigt
from jointplay.contact.lankarani_nikravesh import LankaraniNikravesh
from jointplay.contact.law import (
    ContactProperties,
    CustomFriction,
    CustomNormalForce,
    FrictionLaw,
    NormalForceLaw,
)
from jointplay.contact.linear_spring import LinearSpring
from jointplay.contact.lugre import LuGre
from jointplay.contact.pinkus_sternlicht import PinkusSternlicht
from jointplay.contact.short_bearing import ShortBearing
from jointplay.errors import JointplayError, MissingName

NORMAL_LAWS: dict[str, type[NormalForceLaw]] = {
    law.name: law for law in (Hertz, LinearSpring, KelvinVoigt, HuntCrossley, LankaraniNikravesh)
}
FRICTION_LAWS: dict[str, type[FrictionLaw]] = {
    law.name: law for law in (Ambrosio, Dahl, LuGre, GonthierFriction)
}

FILM_LAWS: dict[str, type[FilmLaw]] = {law.name: law for law in (ShortBearing, PinkusSternlicht)}


def normal_law(description: dict[str, Any]) -> NormalForceLaw:
    """Build the normal-force law that `NormalForceLaw.describe` described.

    Raises:
        MissingName: no law of that name.
        JointplayError: a user's own law whose module cannot be imported here.
    """
    fields = dict(description)
    name = fields.pop("law")
    if name == CustomNormalForce.name:
        return CustomNormalForce(_imported(fields["function"]), tuple(fields["parameters"]))
    if name not in NORMAL_LAWS:
        raise MissingName("normal-force law", name, NORMAL_LAWS)
    return NORMAL_LAWS[name](**fields)


def friction_law(description: dict[str, Any]) -> FrictionLaw:
    """Build the friction law that `FrictionLaw.describe` described; see `normal_law`."""
    fields = dict(description)
    name = fields.pop("law")
    for custom in (CustomFriction, CustomBristle):
        if name == custom.name:
            return custom(_imported(fields["function"]), tuple(fields["parameters"]))
    if name not in FRICTION_LAWS:
        raise MissingName("friction law", name, FRICTION_LAWS)
    return FRICTION_LAWS[name](**fields)


def film_law(description: dict[str, Any]) -> FilmLaw:
    """Build the film law that `FilmLaw.describe` described; see `normal_law`."""
    fields = dict(description)
    name = fields.pop("law")
    if name == CustomFilm.name:
        function, parameters = fields.pop("function"), fields.pop("parameters")
        return CustomFilm(_imported(function), tuple(parameters), **fields)
    if name not in FILM_LAWS:
        raise MissingName("film law", name, FILM_LAWS)
    return FILM_LAWS[name](**fields)


def _imported(path: str) -> Any:
    module, _, name = path.partition(":")
    try:
        return getattr(importlib.import_module(module), name)
    except (ImportError, AttributeError) as error:
        raise JointplayError(f"the law {path!r} cannot be imported here: {error}") from error


__all__ = [
    "FILM_LAWS",
    "FRICTION_LAWS",
    "NORMAL_LAWS",
    "Ambrosio",
    "BristleLaw",
    "ContactProperties",
    "CustomBristle",
    "CustomFilm",
    "CustomFriction",
    "CustomNormalForce",
    "Dahl",
    "FilmLaw",
    "FilmProperties",
    "FrictionLaw",
    "GonthierFriction",
    "Hertz",
    "HuntCrossley",
    "KelvinVoigt",
    "LankaraniNikravesh",
    "LinearSpring",
    "LuGre",
    "NormalForceLaw",
    "PinkusSternlicht",
    "ShortBearing",
    "film_law",
    "friction_law",
    "normal_law",
]
