"""The velocity solve against dense linear algebra."""

import ctypes

import numpy as np
import pytest

import jointplay as jp
from jointplay.base.compiler import compiled
from jointplay.physics.kernel import Command, layout
from jointplay.physics.kernel.access import run_at
from jointplay.physics.kernel.solve import TOLERANCE, find_velocity_forces, solve_velocity


@compiled
def solve(address, h):
    """Find and solve as a micro step does; the base velocity is that in `scratch`."""
    run = run_at(address)
    find_velocity_forces(run, run.q, run.half)
    solve_velocity(run, run.q, run.scratch, run.v, h)


class Coordinates:
    """A run without joints: `nv` coordinates, viscous friction on some of them."""

    SQUARE = ("minv", "compliance", "slope", "inverse")

    def __init__(self, nv, listed, rng):
        self.run = np.zeros(1, layout.RUN)
        names = (*self.SQUARE, "q", "v", "half", "scratch", "velocity_forces", "load_forces")
        names += ("inertia",)
        self.arrays = {name: np.zeros((nv, nv) if name in self.SQUARE else nv) for name in names}
        self.arrays["trial"] = np.zeros((layout.TRIAL_ROWS, nv))
        self.arrays |= {name: np.zeros(nv, np.int64) for name in ("touched", "place", "exchanged")}
        rows = self.arrays["frictions"] = np.zeros(len(listed), layout.FRICTION_ROW)
        rows["coordinate"], rows["stribeck"] = listed, 1.0
        rows["viscous"] = rng.uniform(1.0, 1e4, len(listed))
        for name, array in self.arrays.items():
            self.run[name] = array.ctypes.data
        self.run["nv"], self.run["nf"] = nv, len(listed)
        root = rng.normal(size=(nv, nv))
        self.arrays["minv"][:] = root @ root.T
        self.arrays["inertia"][:] = 1.0 / np.diag(self.arrays["minv"])
        self.arrays["scratch"][:] = rng.normal(size=nv)

    def __getattr__(self, name):
        return self.arrays[name]


@pytest.mark.thorough  # it compiles the solve by itself
@pytest.mark.parametrize(
    ("nv", "count", "active"),
    [(6, 6, 6), (9, 6, 6), (7, 7, 7), (24, 10, 10), (24, 20, 24), (37, 37, 37)],
)
def test_the_solve_agrees_with_a_dense_one(nv, count, active):
    rng = np.random.default_rng(nv + count)
    listed = np.sort(rng.permutation(nv)[:count])
    case, h = Coordinates(nv, listed, rng), 1e-3
    damping = np.zeros(nv)
    damping[listed] = case.frictions["viscous"]
    expected = np.linalg.solve(np.eye(nv) + h * case.minv * damping, case.scratch)
    for _ in range(2):  # with a new matrix, then with the one that is kept
        case.velocity_forces[:] = 0.0
        solve(case.run.ctypes.data, h)
        assert case.run["active"][0] == active
        assert case.run["unsolved"][0] == 0
        np.testing.assert_allclose(case.v[listed], expected[listed], rtol=1e-6, atol=1e-8)
        forces = -damping * expected
        np.testing.assert_allclose(case.velocity_forces, forces, rtol=1e-6, atol=1e-5)


def numbers(run, name, *shape):
    """Numbers to which a run's record points."""
    pointer = ctypes.POINTER(ctypes.c_double)
    return np.ctypeslib.as_array(ctypes.cast(int(run[name][0]), pointer), shape)


@pytest.mark.parametrize("loose", [1, 6])
def test_velocities_are_those_that_the_forces_make(loose):
    """v = v_half + h (a_free + M^-1 [...]), joints that touch beside others that do not."""
    names = ("elbow", "shoulder_lift", "wrist_1", "shoulder_pan", "wrist_2", "wrist_3")[:loose]
    size = {"radial_clearance": 1e-4, "axial_clearance": 1e-4}
    bearing = jp.RevoluteClearance(**size, bearing_radius=30e-3, bearing_length=60e-3)
    robot = jp.Mechanism("ur5", {f"{name}_joint": bearing for name in names}, gravity=(0, 0, 0))
    motion = jp.Motion(list(robot.joints), [0.0, 0.2], [np.zeros(6), np.full(6, 0.3)])
    run = jp.Run(jp.Simulation(robot, motion, duration=0.02, step=2e-6, start="centred"))
    run.workspace.drives["implicit"] = 0  # their part is moved into the efforts
    run.begin()
    w, touching = run.workspace, set()
    nv = len(w.q)
    while w.steps < run.total_steps:
        assert run.advance(20)
        speeds = w.v.copy()
        w.execute(Command.SYNCHRONIZE)
        base, h = numbers(w.run, "scratch", nv), 0.5 * float(w.run["dt_before"][0])
        forces = numbers(w.run, "velocity_forces", nv)
        minv = numbers(w.run, "minv", nv, nv)
        off = w.v - base - h * minv @ forces
        # A last Newton step is taken without new forces, where all coordinates take part.
        tolerance = 2.0 * TOLERANCE if w.run["active"][0] == nv else 1e-12
        assert np.sqrt(np.mean(off**2 / np.diag(minv))) < tolerance
        touching.add(int(w.run["touching"][0]))
        w.v[:] = speeds
    assert w.run["unsolved"][0] == 0
    assert 0 in touching
    assert len(touching) > 1


def test_what_was_found_before_tells_the_next_velocities():
    """Errors of earlier solves do not grow so much by extrapolation that each is solved anew."""
    size = {"radial_clearance": 1e-4, "axial_clearance": 1e-4}
    bearing = jp.RevoluteClearance(**size, bearing_radius=30e-3, bearing_length=60e-3)
    robot = jp.Mechanism("ur5", {f"{name}_joint": bearing for name in ("elbow", "shoulder_lift")})
    motion = jp.Motion(list(robot.joints), [0.0, 1.0], [np.zeros(6), np.full(6, 0.3)])
    run = jp.Run(jp.Simulation(robot, motion, duration=0.05))
    run.begin()
    assert run.advance(run.total_steps)
    found = run.workspace.run[0]
    assert found["solves"] > 1000
    assert found["iterations"] < 1.1 * found["solves"]
