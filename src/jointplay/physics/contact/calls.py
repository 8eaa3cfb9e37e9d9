"""Calls by address of compiled laws, for compiled code (`machine_code` has the laws).

Each takes the address, and in a tuple what the law does: its state, a pointer to its parameters,
and where it has several answers a pointer to them.
"""

from __future__ import annotations

from jointplay.base.compiler import calling
from jointplay.physics.contact.bristle import BristleLaw
from jointplay.physics.contact.film import FilmLaw
from jointplay.physics.contact.law import FrictionLaw, NormalForceLaw
from jointplay.physics.contact.machine_code import law_signature

call_normal = calling(law_signature(NormalForceLaw.state, NormalForceLaw.answers))
call_friction = calling(law_signature(FrictionLaw.state, FrictionLaw.answers))
call_bristle = calling(law_signature(BristleLaw.state, BristleLaw.answers))
call_film = calling(law_signature(FilmLaw.state, FilmLaw.answers))
call_elements = calling("v(p,p,p,i)")
"""Of `rolling.find_element_forces`."""
