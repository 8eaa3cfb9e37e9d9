"""The compiled part of the time loop.

`constants` says what is asked of it. `layout` has the records that hold a run, `access` opens what
they point to, `frames` has the geometry, `contact`, `film`, `load`, `gear`, `drive`
and `rolling` the forces, `solve` the velocity solve, `record` the records, `multirate`,
`adaptive` (steps by their error) and `singlerate` the methods, which `constants` lists, `loops`
what the first makes of closed loops. All is entered through the compiled functions of
`entry`, which are imported with their first use; what few runs have is compiled apart from these.

Around it, in Python: `workspace` holds a run's arrays, made from the sites of `layout`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
