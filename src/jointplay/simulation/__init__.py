"""One run: what moves and loads a mechanism, the loop through time, its result.

`motion` and `loads` say what acts, `Simulation` holds all inputs of a run and `Run` steps through
it (eqs 22, 23); `result` is what it leaves behind, with its audit, and `analysis` reads it: tool
error, forces, spectra, and the numerical error of each figure. Nothing here knows of scenario
files, of plans of many runs or of pictures.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
