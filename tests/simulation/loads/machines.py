"""Machines that loads are tried on."""

from conftest import body, joint

import jointplay as jp

QUIET = {"joint_friction": {}, "drive": jp.loads.Free()}
NO_GRAVITY = (0.0, 0.0, 0.0)


def slider(urdf, mass=2.0, gravity=NO_GRAVITY):
    path = urdf(body("cart", mass), joint("x", "base", "cart", "prismatic", axis="1 0 0"))
    return jp.Mechanism(path, gravity=gravity)


def rotor(urdf, inertia=0.02, kind="revolute", clearance=None, gravity=NO_GRAVITY, **options):
    path = urdf(body("disc", 1.0, "0 0 0", inertia), joint("a", "base", "disc", kind))
    return jp.Mechanism(path, clearance, gravity=gravity, **options)


def arm(urdf, clearance=None):
    path = urdf(
        *(body("one", 3.0, "0.15 0.02 0"), body("two", 2.0, "0.1 0 0.03")),
        joint("a", "base", "one", axis="0 1 0"),
        joint("b", "one", "two", axis="0 1 0", at="0.3 0 0"),
    )
    return jp.Mechanism(path, clearance)
