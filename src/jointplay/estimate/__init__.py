"""What measurements say of a machine: play, friction, elasticity, geometry.

Also which measurement would say more. What is sought is an `Unknown`; a kind of measurement is a
model of its signals (`LeastSquares`) in a module of its own; `solve` finds the unknowns, and an
`Estimate` tells each: its value and interval, or why the measurement cannot tell. What decides
whether a value counts as known, and by which number, is `known.py`. Nothing here draws, or knows of
a command line.

- Common to all: `unknowns`, `least_squares`, `known`.
- Recordings: `identification`, from `measurement` (or `recordings`) over `visits`, `machine`,
  `parts`, `model`, `loaded_bearings`, `windup` and `nuisances` to `reasons`.
- Static poses: `calibration` and `encoders`, from `static_poses` over `kinematic_model`,
  `pose_problem` and `selection` to `inference` and `calibrated`.
- Dial gauges: `gauge`, `lost_motion`. Two measurements: `changes`. Plans: `planning`. Runs beside
  experiments: `experiment`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
