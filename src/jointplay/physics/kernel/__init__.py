"""The compiled time loop.

In the order in which to read it:

- `constants`: status, commands, integrators. `layout`: the records that hold a run, and `access`,
  which opens the arrays they point to. `workspace`: a run's arrays in Python.
- Methods: `multirate` (macro and micro steps), `adaptive` (micro steps by their error),
  `singlerate` (explicit methods), `solve` (the velocity solve of the multi-rate method), `loops`
  (loops without clearance).
- Forces: `contact`, `rolling` and `film` in joints with clearance, `gear`, `drive` and `load`
  elsewhere; `frames` has the kinematics that they share.
- `record`: recorded rows. `entry`: the compiled functions through which all is entered, imported
  with their first use.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
