"""M, C, G of Pinocchio and F_C of the contact module are the run's, term by term."""

import re
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

import jointplay as jp

PAGE = Path(__file__).parents[2] / "docs" / "equation_of_motion.md"


def test_the_page_finds_the_recorded_forces_by_hand():
    found = {}
    for code in re.findall(r"```python\n(.*?)```", PAGE.read_text(), re.DOTALL):
        exec(code, found)
    assert found["largest"] > 300.0
    assert found["difference"] < 1e-8  # of 343 N, measured: 1e-11
    assert max(found["by_hand"]) > 200.0
    assert found["apart"] < 1e-8  # of 231 N, measured: 2e-12


@pytest.fixture(scope="module")
def arm():
    joint = jp.RevoluteClearance(radial_clearance=2e-4, axial_clearance=2e-4)
    return jp.Mechanism("jointplay:scara.urdf", {"joint_b": joint}, tool="suction_cup")


@given(st.integers(0, 2**32 - 1))
def test_the_terms_make_the_inverse_dynamics(arm, seed):
    q, v, a = np.random.default_rng(seed).uniform(-1.0, 1.0, (3, arm.model.nq))
    mass = arm.mass_matrix(q)
    assert np.array_equal(mass, mass.T)
    assert np.linalg.eigvalsh(mass).min() > 0.0
    left = mass @ a + arm.coriolis_matrix(q, v) @ v + arm.gravity_forces(q)
    assert left == pytest.approx(pin.rnea(arm.model, arm.data, q, v, a), rel=1e-9, abs=1e-9)
    # dM/dt - 2 C is skew-symmetric: C is made of Christoffel's symbols.
    ahead, back = (arm.mass_matrix(q + 1e-6 * sign * v) for sign in (1.0, -1.0))
    skew = (ahead - back) / 2e-6 - 2.0 * arm.coriolis_matrix(q, v)
    assert skew == pytest.approx(-skew.T, abs=1e-7)


def test_terms_asked_for_earlier_stay_as_they_were(arm):
    zero, other = np.zeros(arm.model.nq), np.full(arm.model.nq, 0.3)
    terms = arm.mass_matrix(zero), arm.coriolis_matrix(zero, other), arm.gravity_forces(zero)
    before = [term.copy() for term in terms]
    arm.mass_matrix(other), arm.coriolis_matrix(other, other), arm.gravity_forces(other)
    assert all(np.array_equal(one, was) for one, was in zip(terms, before, strict=True))
