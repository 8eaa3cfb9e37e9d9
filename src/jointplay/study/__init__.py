"""Many runs: a plan of variations, measures of each, and a store that loses nothing.

Sweeps, ensembles, ISO 9283, wear, and certificates of the numerical error are plans with measures;
`nonlinear` has sections, exponents and bifurcations. Modules are loaded when a name is first used.
Nothing here draws.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
