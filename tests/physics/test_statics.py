"""Bearings at rest against statics by hand."""

import numpy as np
import pytest

import jointplay as jp
from jointplay.physics.geometry import Form

MASS, OVERHANG = 4.0, 0.25
WEIGHT = MASS * 9.81
SETTLING = {"restitution": 0.2, "mass": MASS, "record_every": 100}
CLEAR = {"radial_clearance": 2e-4, "axial_clearance": 2e-4}
RIM_A, RIM_B, WALL_A, WALL_B = range(4)


def settled(result):
    """Normal forces and the journal's pose over the last tenth, where nothing moves any more."""
    rest = slice(int(0.9 * len(result.time)), None)
    forces = result["normal_force"].values[rest, 0]
    assert np.ptp(forces, axis=0).max() < 1e-3 * WEIGHT
    return forces.mean(axis=0), result["q"].values[-1]


def wedged(free_mass, mu, **options):
    """An arm that overhangs its vertical bearing, let go close to where it comes to rest."""
    joint = jp.RevoluteClearance(**CLEAR)
    tilt = 0.01
    return free_mass(
        com=f"{OVERHANG} 0 0",
        gravity=(0, 0, -9.81),
        offset=(0, 0, -joint.ca + joint.rj * tilt + 2e-5, 0, tilt, 0),
        friction=jp.contact.Ambrosio(mu),
        duration=0.2,
        **(SETTLING | options),
    ).finish()


# The friction law is zero at rest, so it carries nothing in the end; but see docs/integrators.md
# for the step that it asks of a jammed journal.


def test_chattering_wedge_is_reported(free_mass):
    """At a step too long for the friction of a jammed journal: right, or warned of."""
    result = wedged(free_mass, 0.1, step=1e-5)
    right = np.allclose(result["joint_force"].values[-20:, 0], [0, 0, WEIGHT], atol=0.01 * WEIGHT)
    assert right or result.audit.warnings


@pytest.mark.parametrize("down", [1.0, -1.0])
def test_standing_body_sinks_in_by_its_weight(free_mass, down):
    """Face on end wall, A or B: one force, the weight; depth (W/k)^(2/3); a surface contact."""
    joint = jp.RevoluteClearance(**CLEAR, axial_stiffness=1e9)
    result = free_mass(
        axial_stiffness=1e9,
        gravity=(0, 0, 9.81 * down),
        offset=(0, 0, down * joint.ca, 0, 0, 0),
        duration=0.2,
        step=1e-5,
        **SETTLING,
    ).finish()
    forces, q = settled(result)
    wall = WALL_A if down > 0 else WALL_B
    assert forces[wall] == pytest.approx(WEIGHT, rel=1e-4)
    assert forces.sum() == forces[wall]
    depth = (WEIGHT / 1e9) ** (2.0 / 3.0)
    assert down * q[2] - joint.ca == pytest.approx(depth, rel=1e-4)
    assert Form(result["form"].values[-1, 0]) == Form.SURFACE


@pytest.mark.parametrize("shift", [0.0, 0.3, -0.45])
@pytest.mark.parametrize("azimuth", [0.0, 2.0])
def test_lying_shaft_shares_its_weight_by_the_law_of_the_lever(free_mass, shift, azimuth):
    """Gravity across the bore, the weight `shift` L_j from the middle: forces W (1/2 +- shift)."""
    joint = jp.RevoluteClearance(**CLEAR)
    way = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
    result = free_mass(
        com=f"0 0 {shift * joint.lj}",
        gravity=tuple(9.81 * way),
        offset=(*(joint.cr * way), 0, 0, 0),
        friction=jp.contact.Ambrosio(0.0),
        duration=0.1,
        step=1e-5,
        **SETTLING,
    ).finish()
    forces, _ = settled(result)
    share = WEIGHT * np.array([0.5 + shift, 0.5 - shift])
    assert forces[[RIM_A, RIM_B]] == pytest.approx(share, rel=1e-3)
    depth = (share / joint.hertz_stiffness) ** (2.0 / 3.0)
    assert -result["gap"].values[-1, 0, :2] == pytest.approx(depth, rel=1e-3)
    assert Form(result["form"].values[-1, 0]) == Form.LINE


def test_overhung_shaft_bears_on_opposite_sides(free_mass):
    """Weight 0.8 L_j from the middle: the far end is pressed up with 0.3 W, the near one 1.3 W."""
    joint = jp.RevoluteClearance(**CLEAR)
    tilt = 2.0 * joint.cr / joint.lj
    result = free_mass(
        com=f"0 0 {0.8 * joint.lj}",
        gravity=(9.81, 0, 0),
        offset=(0, 0, 0, 0, tilt, 0),
        friction=jp.contact.Ambrosio(0.0),
        duration=0.2,
        step=1e-5,
        **SETTLING,
    ).finish()
    forces, _ = settled(result)
    assert forces[[RIM_A, RIM_B]] == pytest.approx(WEIGHT * np.array([1.3, 0.3]), rel=0.02)
    assert Form(result["form"].values[-1, 0]) == Form.RADIAL_BOTH_ENDS_OPPOSITE
