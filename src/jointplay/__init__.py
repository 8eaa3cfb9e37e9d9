"""jointplay: mechanisms whose joints have play.

    import jointplay as jp

    bearing = jp.RevoluteClearance(radial_clearance=0.2e-3, axial_clearance=0.2e-3)
    robot = jp.Mechanism(jp.shipped("scara.urdf"), {"joint_b": bearing}, gravity=(0, 0, 0))
    motion = jp.Motion.from_csv(jp.shipped("scara_motion.csv"))
    result = jp.simulate(robot, motion)

The names here describe, build and run simulations. Drives, springs and other loads are in
`jp.loads`, laws of contact, friction and films in `jp.contact`, analyses of results and mechanisms
in `jp.analysis`. Modules are loaded when a name is first used, so `import jointplay` costs nothing.
"""

import lazy_loader

from jointplay import conveniences as _conveniences  # noqa: F401 - it fills base.conveniences

_load, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)


def __getattr__(name: str) -> object:
    if name == "__version__":
        from importlib.metadata import version  # its import takes longer than all else here

        return version("jointplay")
    return _load(name)
