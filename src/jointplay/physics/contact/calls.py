"""Calls of laws by address, for compiled code (`machine_code` compiles the laws).

Each takes the address, and a tuple of the law's arguments: its state, a pointer to its parameters
and, where it has several results, a pointer to these.
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
"""Call of a law of a whole joint, such as `rolling.find_element_forces`."""
