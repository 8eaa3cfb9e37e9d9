"""What measurements say of a machine: play, friction, elasticity, geometry, impacts.

Also which measurement would say more. What is sought is an `Unknown`; a kind of measurement is a
model of its signals (`LeastSquares`) in a module of its own; `solve` finds the unknowns, and an
`Estimate` tells each: its value and interval, or why the measurement cannot tell. Nothing here
draws, or knows of a command line.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
