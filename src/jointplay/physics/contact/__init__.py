"""Contact and friction laws (eqs 10-21 and beyond); `law` says what a law is."""

from __future__ import annotations

from jointplay.base.schema import Family, register
from jointplay.physics.contact.bristle import BristleLaw, Bristles, Dahl, GonthierFriction, LuGre
from jointplay.physics.contact.custom import (
    CustomBristle,
    CustomFilm,
    CustomFriction,
    CustomNormalForce,
)
from jointplay.physics.contact.film import (
    FilmForce,
    FilmLaw,
    FilmProperties,
    PinkusSternlicht,
    ShortBearing,
)
from jointplay.physics.contact.friction import (
    Ambrosio,
    BengisuAkay,
    BrownMcPhee,
    Coulomb,
    Threlfall,
)
from jointplay.physics.contact.hertzian import (
    CarvalhoMartins,
    Flores,
    GharibHurmuzlu,
    Gonthier,
    HerbertMcWhannell,
    Hertz,
    HuGuo,
    HuntCrossley,
    HuntCrossley1975,
    LankaraniNikravesh,
    LeeWang,
    QinLu,
    ZhangSharf,
)
from jointplay.physics.contact.law import ContactProperties, FrictionLaw, NormalForceLaw
from jointplay.physics.contact.line_contact import (
    DubowskyFreudenstein,
    Esdu78035,
    Goldsmith,
    Johnson,
    Liu,
    Pereira,
    Radzimovsky,
)
from jointplay.physics.contact.linear import Anagnostopoulos, KelvinVoigt, LinearSpring

NORMAL_LAWS: dict[str, type[NormalForceLaw]] = {
    law.name: law
    for law in (
        *(LankaraniNikravesh, Hertz, LinearSpring, KelvinVoigt, Anagnostopoulos, HuntCrossley),
        *(HuntCrossley1975, HerbertMcWhannell, LeeWang, Gonthier, ZhangSharf, QinLu, Flores, HuGuo),
        *(CarvalhoMartins, GharibHurmuzlu, Johnson, Radzimovsky, Goldsmith, DubowskyFreudenstein),
        *(Pereira, Esdu78035, Liu),
    )
}
"""Normal-force laws by the word that selects them: point contacts, then lines."""

FRICTION_LAWS: dict[str, type[FrictionLaw]] = {
    law.name: law
    for law in (
        *(Ambrosio, Coulomb, Threlfall, BengisuAkay, BrownMcPhee, Dahl, LuGre, GonthierFriction),
    )
}
"""Friction laws by the word that selects them: functions of the speed, then with bristles."""

FILM_LAWS: dict[str, type[FilmLaw]] = {law.name: law for law in (ShortBearing, PinkusSternlicht)}
"""Film laws by the word that selects them."""


register(
    NormalForceLaw,
    Family(
        "law",
        "normal-force law",
        NORMAL_LAWS | {"custom": CustomNormalForce},
        default=LankaraniNikravesh.name,
    ),
)
register(
    FrictionLaw,
    Family(
        "law",
        "friction law",
        FRICTION_LAWS | {"custom": CustomFriction, "custom-bristle": CustomBristle},
        default=Ambrosio.name,
        number=(Ambrosio.name, "mu_d"),
    ),
)
register(FilmLaw, Family("law", "film law", FILM_LAWS | {"custom-film": CustomFilm}))


__all__ = [
    "FILM_LAWS", "FRICTION_LAWS", "NORMAL_LAWS", "Ambrosio", "Anagnostopoulos", "BengisuAkay",
    "BristleLaw", "Bristles", "BrownMcPhee", "CarvalhoMartins", "ContactProperties", "Coulomb",
    "CustomBristle", "CustomFilm", "CustomFriction", "CustomNormalForce", "Dahl",
    "DubowskyFreudenstein", "Esdu78035", "FilmForce", "FilmLaw", "FilmProperties", "Flores",
    "FrictionLaw", "GharibHurmuzlu", "Goldsmith", "Gonthier", "GonthierFriction",
    "HerbertMcWhannell", "Hertz", "HuGuo", "HuntCrossley", "HuntCrossley1975", "Johnson",
    "KelvinVoigt", "LankaraniNikravesh", "LeeWang", "LinearSpring", "Liu", "LuGre",
    "NormalForceLaw", "Pereira", "PinkusSternlicht", "QinLu", "Radzimovsky", "ShortBearing",
    "Threlfall", "ZhangSharf",
]  # fmt: skip
