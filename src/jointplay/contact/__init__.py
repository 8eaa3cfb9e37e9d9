"""Contact and friction laws (eqs 10-21 and beyond), one module each; `law` says what a law is."""

from __future__ import annotations

import inspect
from typing import Any

from jointplay.contact.ambrosio import Ambrosio
from jointplay.contact.anagnostopoulos import Anagnostopoulos
from jointplay.contact.bengisu_akay import BengisuAkay
from jointplay.contact.bristle import BristleLaw, CustomBristle
from jointplay.contact.brown_mcphee import BrownMcPhee
from jointplay.contact.carvalho_martins import CarvalhoMartins
from jointplay.contact.coulomb import Coulomb
from jointplay.contact.dahl import Dahl
from jointplay.contact.dubowsky_freudenstein import DubowskyFreudenstein
from jointplay.contact.esdu_78035 import Esdu78035
from jointplay.contact.film import CustomFilm, FilmLaw, FilmProperties
from jointplay.contact.flores import Flores
from jointplay.contact.gharib_hurmuzlu import GharibHurmuzlu
from jointplay.contact.goldsmith import Goldsmith
from jointplay.contact.gonthier import Gonthier
from jointplay.contact.gonthier_friction import GonthierFriction
from jointplay.contact.herbert_mcwhannell import HerbertMcWhannell
from jointplay.contact.hertz import Hertz
from jointplay.contact.hu_guo import HuGuo
from jointplay.contact.hunt_crossley import HuntCrossley
from jointplay.contact.hunt_crossley_1975 import HuntCrossley1975
from jointplay.contact.johnson import Johnson
from jointplay.contact.kelvin_voigt import KelvinVoigt
from jointplay.contact.lankarani_nikravesh import LankaraniNikravesh
from jointplay.contact.law import (
    ContactProperties,
    CustomFriction,
    CustomNormalForce,
    FrictionLaw,
    Law,
    NormalForceLaw,
)
from jointplay.contact.lee_wang import LeeWang
from jointplay.contact.linear_spring import LinearSpring
from jointplay.contact.liu import Liu
from jointplay.contact.lugre import LuGre
from jointplay.contact.pereira import Pereira
from jointplay.contact.pinkus_sternlicht import PinkusSternlicht
from jointplay.contact.radzimovsky import Radzimovsky
from jointplay.contact.short_bearing import ShortBearing
from jointplay.contact.threlfall import Threlfall
from jointplay.contact.trust import found
from jointplay.contact.zhang_sharf import ZhangSharf
from jointplay.contact.zhiying_qishao import ZhiyingQishao
from jointplay.errors import JointplayError, MissingName

NORMAL_LAWS: dict[str, type[NormalForceLaw]] = {
    law.name: law
    for law in (
        LankaraniNikravesh,
        Hertz,
        LinearSpring,
        KelvinVoigt,
        Anagnostopoulos,
        HuntCrossley,
        HuntCrossley1975,
        HerbertMcWhannell,
        LeeWang,
        Gonthier,
        ZhangSharf,
        ZhiyingQishao,
        Flores,
        HuGuo,
        CarvalhoMartins,
        GharibHurmuzlu,
        Johnson,
        Radzimovsky,
        Goldsmith,
        DubowskyFreudenstein,
        Pereira,
        Esdu78035,
        Liu,
    )
}
"""Normal-force laws by the word that selects them: point contacts, then lines."""

FRICTION_LAWS: dict[str, type[FrictionLaw]] = {
    law.name: law
    for law in (
        Ambrosio,
        Coulomb,
        Threlfall,
        BengisuAkay,
        BrownMcPhee,
        Dahl,
        LuGre,
        GonthierFriction,
    )
}
"""Friction laws by the word that selects them: functions of the speed, then with bristles."""

FILM_LAWS: dict[str, type[FilmLaw]] = {law.name: law for law in (ShortBearing, PinkusSternlicht)}
"""Film laws by the word that selects them."""


def normal_law(description: dict[str, Any] | str) -> NormalForceLaw:
    """Build the normal-force law that `NormalForceLaw.describe` described.

    Args:
        description: ``law`` and the law's fields, or the law's word alone.

    Raises:
        MissingName: no law of that name.
        JointplayError: a field that the law does not have, or lacks, or of an impossible value; a
            user's own law that is neither known here nor of a trusted module (see `trust`).
    """
    return _built("normal-force law", description, NORMAL_LAWS, (CustomNormalForce,))


def friction_law(description: dict[str, Any] | str) -> FrictionLaw:
    """Build the friction law that `FrictionLaw.describe` described; see `normal_law`."""
    return _built("friction law", description, FRICTION_LAWS, (CustomFriction, CustomBristle))


def _built(kind: str, description: Any, laws: dict[str, Any], customs: tuple[Any, ...]) -> Any:
    fields = {"law": description} if isinstance(description, str) else dict(description)
    if "law" not in fields:
        raise JointplayError(f"{kind} needs the field 'law'; available: {', '.join(laws)}")
    name = fields.pop("law")
    for custom in customs:
        if name == custom.name:
            valid, required = _fields(custom)
            _check_fields(name, fields, valid, required)
            function, parameters = fields.pop("function"), fields.pop("parameters", ())
            return custom(found(function), tuple(parameters), **fields)
    if name not in laws:
        raise MissingName(kind, name, [*laws, *(custom.name for custom in customs)])
    law: type[Law] = laws[name]
    _check_fields(name, fields, *_fields(law))
    return law(**fields)


def film_law(description: dict[str, Any] | str) -> FilmLaw:
    """Build the film law that `FilmLaw.describe` described; see `normal_law`."""
    return _built("film law", description, FILM_LAWS, (CustomFilm,))


def _fields(law: type[Law]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Names of all fields of a law, and of those that have no default."""
    if law.__init__ is object.__init__:
        return (), ()
    every = list(inspect.signature(law).parameters.values())
    required = tuple(field.name for field in every if field.default is field.empty)
    return tuple(field.name for field in every), required


def _check_fields(
    law: str, given: dict[str, Any], valid: tuple[str, ...], required: tuple[str, ...]
) -> None:
    for name in given:
        if name not in valid:
            raise JointplayError(
                f"law {law!r} has no field {name!r}; available: {', '.join(valid) or 'none'}"
            )
    for name in required:
        if name not in given:
            raise JointplayError(f"law {law!r} needs the field {name!r}")


__all__ = [
    "FILM_LAWS",
    "FRICTION_LAWS",
    "NORMAL_LAWS",
    "Ambrosio",
    "Anagnostopoulos",
    "BengisuAkay",
    "BristleLaw",
    "BrownMcPhee",
    "CarvalhoMartins",
    "ContactProperties",
    "Coulomb",
    "CustomBristle",
    "CustomFilm",
    "CustomFriction",
    "CustomNormalForce",
    "Dahl",
    "DubowskyFreudenstein",
    "Esdu78035",
    "FilmLaw",
    "FilmProperties",
    "Flores",
    "FrictionLaw",
    "GharibHurmuzlu",
    "Goldsmith",
    "Gonthier",
    "GonthierFriction",
    "HerbertMcWhannell",
    "Hertz",
    "HuGuo",
    "HuntCrossley",
    "HuntCrossley1975",
    "Johnson",
    "KelvinVoigt",
    "LankaraniNikravesh",
    "LeeWang",
    "LinearSpring",
    "Liu",
    "LuGre",
    "NormalForceLaw",
    "Pereira",
    "PinkusSternlicht",
    "Radzimovsky",
    "ShortBearing",
    "Threlfall",
    "ZhangSharf",
    "ZhiyingQishao",
    "film_law",
    "friction_law",
    "normal_law",
]
