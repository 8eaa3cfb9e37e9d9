"""Budgets of outputs that are angles, against kinematics written anew."""

import numpy as np
import pytest
from scipy.optimize import fsolve

import jointplay as jp
from jointplay.accuracy.poses import along_motion

CRANK, A, B, C = 0.04, (0.04, 0.0), (0.1, 0.1), (0.15, 0.0)
COUPLER, ROCKER = np.hypot(0.06, 0.1), np.hypot(0.05, 0.1)
PLAY = 1e-4


def rocker(crank, aside, guess):
    """Angles of coupler and rocker with pins displaced by `aside` (2,) [m] in sum."""
    near = CRANK * np.array([np.cos(crank), np.sin(crank)]) + aside

    def gap(angles):
        coupler, out = angles
        tip = near + COUPLER * np.array([np.cos(coupler), np.sin(coupler)])
        return tip - C - ROCKER * np.array([np.cos(out), np.sin(out)])

    return fsolve(gap, guess, xtol=1e-13)


@pytest.fixture(scope="module")
def machine():
    linkage = jp.Linkage(
        points={"O": (0, 0), "A": A, "B": B, "C": C},
        ground=["O", "C"],
        links={
            "crank": jp.LinkageLink(["O", "A"], mass=0.1),
            "coupler": jp.LinkageLink(["A", "B"], mass=0.1),
            "rocker": jp.LinkageLink(["B", "C"], mass=0.1),
        },
    )
    pin = jp.RevoluteClearance.planar(radial_clearance=PLAY)
    mechanism = jp.Mechanism(linkage, {"A": pin, "B": pin})
    turn = jp.Motion(["O"], [0, 1], [[0], [2 * np.pi]], "constant-speed")
    return mechanism, along_motion(mechanism, turn, 31)


def test_the_budget_of_a_rocker_is_its_angle(machine):
    mechanism, q = machine
    found = jp.budget(mechanism, q, driven=["O"])
    assert found.unit == "rad"
    guess = np.array([np.arctan2(0.1, 0.06), np.arctan2(0.1, -0.05)])
    ways = np.linspace(0, 2 * np.pi, 181)
    for row, worst in zip(q, found.worst, strict=True):
        crank = row[mechanism.coordinate("O")]
        guess = rocker(crank, np.zeros(2), guess)
        turned = [
            rocker(crank, 2 * PLAY * np.array([np.cos(way), np.sin(way)]), guess)[1] - guess[1]
            for way in ways
        ]
        # Exact kinematics with the pins aside: the second order is a percent here.
        assert worst == pytest.approx(np.abs(turned).max(), rel=0.01)
    np.testing.assert_allclose(found.shares, 0.5, atol=1e-6)
    said = found.sentence
    assert said.startswith("Play turns the tool 'rocker' by up to 2.12 mrad")
    assert " mm" not in said.partition(";")[0]
    heads = [column.title for column in found.table().columns]
    assert "alone [mrad]" in str(found.table()).splitlines()[0]
    assert "worst turn" not in heads


def test_a_rocker_is_kept_within_an_angle(machine):
    mechanism, q = machine
    target = np.radians(0.05)
    found = jp.allocate(mechanism, q, target, turn=True, driven=["O"])
    sized = {
        choice.joint: jp.RevoluteClearance.planar(radial_clearance=choice.clearance)
        for choice in found.choices
    }
    again = jp.budget(mechanism.with_clearance(sized, {}), q, driven=["O"])
    assert again.worst.max() == pytest.approx(target, rel=1e-3)
