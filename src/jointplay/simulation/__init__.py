"""Simulation of one run: the motion and loads of a mechanism, the time loop, and the result.

`motion` and `loads` are what acts, `Simulation` holds all inputs of a run, and `Run` steps through
it (eqs 22, 23). `result` has its histories and its audit; `analysis` makes figures of them: tool
error, forces, spectra, and the numerical error of each. Nothing here knows of scenario files, of
plans of many runs or of pictures.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
