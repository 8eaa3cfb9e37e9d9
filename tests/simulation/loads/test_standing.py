"""Machines that stand under loads: where journals rest, and what presses them."""

import numpy as np
import pinocchio as pin
import pytest
from conftest import body, joint

import jointplay as jp
from jointplay.simulation.acting import load_site
from jointplay.simulation.loads import Controller, CurveSpring, Spring, Stop, TorsionSpring, Wrench
from jointplay.simulation.statics import StaticLoads

PLAY = {"radial_clearance": 1e-4, "axial_clearance": 1e-4}
MASS, REACH = 1.5, 0.1


def arm(urdf, gravity):
    path = urdf(
        body("one", MASS, com=f"{REACH} 0 0"), joint("a", "base", "one", axis="0 1 0"),
        body("two", com="0.1 0 0"), joint("b", "one", "two", axis="0 1 0", at="0.2 0 0")
    )  # fmt: skip
    return jp.Mechanism(path, {"a": jp.RevoluteClearance(**PLAY)}, gravity=gravity)


def held(mechanism, **options):
    motion = jp.Motion(["a", "b"], [0.0, 0.02], [[0.0, 0.0], [0.0, 0.0]])
    return jp.Simulation(mechanism, motion, duration=0.01, **{"start": "rest", **options})


def test_wrenches_as_heavy_as_the_weight_bring_journals_to_rest_where_it_does(urdf):
    heavy = arm(urdf, (0.0, 0.0, -9.81))
    second = float(heavy.model.inertias[heavy.model.getJointId("b")].mass)
    bare = arm(urdf, (0.0, 0.0, 0.0))
    weights = {
        "one": Wrench("one", force=(0, 0, -9.81 * MASS), at=(REACH, 0, 0)),
        "two": Wrench("two", force=(0, 0, -9.81 * second), at=(0.1, 0, 0)),
    }
    # Drives feed the weight forward, and know nothing of wrenches: these give what is lacking.
    lacking = jp.Run(held(heavy)).workspace.reference[0]
    drives = lacking[2 * len(lacking) // 3 :]
    weights |= {
        f"lift {name}": Controller([name], lift, (float(torque),))
        for name, torque in zip(("a", "b"), drives, strict=True)
    }
    under_weight, under_wrench = jp.Run(held(heavy)), jp.Run(held(bare, loads=weights))
    assert under_wrench.rest.solved
    assert under_wrench.rest.load == pytest.approx(9.81 * (MASS + second), rel=1e-3)
    assert under_wrench.rest.q == pytest.approx(under_weight.rest.q, abs=1e-8)  # play: 1e-4 m


def lift(time, q, v, p, out):
    out[0] = p[0]


@pytest.mark.parametrize("integrator", ["multi-rate", "semi-implicit-euler"])
def test_a_journal_that_a_spring_presses_stays_where_it_rests(urdf, integrator):
    loads = {"pull": Spring("one", 300.0, 0.0, at=(0.0, 0.0, 0.0), other_at=(0.3, 0.0, 0.4))}
    machine = arm(urdf, (0.0, 0.0, 0.0))
    result = held(machine, loads=loads, integrator=integrator).run()
    pull = 300.0 * 0.5
    assert result.audit.start_load == pytest.approx(pull, rel=1e-3)
    assert result.audit.start_residual < 1e-4 * pull
    sizes = np.linalg.norm(result["joint_force"].values[:, 0], axis=1)
    # Explicit single steps let it ring in the first records, by 0.7 %.
    assert sizes == pytest.approx(pull, rel=2e-3 if integrator == "multi-rate" else 1e-2)
    falling = held(machine, loads=loads, integrator=integrator, start="centred").run()
    assert np.linalg.norm(falling["joint_force_peak"].values[:, 0], axis=1).max() > 1.5 * pull


@pytest.mark.parametrize(
    "load",
    [
        Spring("two", 80.0, 0.1, at=(0.05, 0.0, 0.02), other_at=(0.1, 0.2, 0.5)),
        Spring("two", 80.0, 0.1, other="one", at=(0.05, 0.0, 0.02), other_at=(0.0, 0.1, 0.3)),
        CurveSpring("two", (0.1, 0.3, 0.9), (1.0, 9.0, 4.0), other_at=(0.1, 0.2, 0.5)),
        TorsionSpring("b", 5.0, rest=0.3),
        Stop("a", 700.0, lower=-0.1, upper=0.05),
    ],
)
def test_slopes_are_those_of_the_energy(urdf, load):
    mechanism = arm(urdf, (0.0, 0.0, 0.0))
    model, data = mechanism.model, mechanism.model.createData()
    pushing = StaticLoads({"it": load}, mechanism, [load_site(load, mechanism, {})])
    q = 0.1 + 0.05 * np.random.default_rng(3).normal(size=model.nq)

    def slope(at):
        pin.computeJointJacobians(model, data, at)
        return pushing.slopes(data, at)

    def energy(at):
        pin.forwardKinematics(model, data, at)
        return pushing.energy(data, at)

    gradient, _ = slope(q)
    steps = 1e-6 * np.eye(model.nv)
    found = [(energy(q + step) - energy(q - step)) / 2e-6 for step in steps]
    assert np.abs(gradient).max() > 0.1
    assert gradient == pytest.approx(found, abs=1e-6)


def test_curvature_of_a_torsion_spring_is_its_stiffness(urdf):
    mechanism = arm(urdf, (0.0, 0.0, 0.0))
    load = TorsionSpring("b", 5.0, damping=3.0)
    pushing = StaticLoads({"it": load}, mechanism, [load_site(load, mechanism, {})])
    q, data = np.zeros(mechanism.model.nq), mechanism.model.createData()
    pin.computeJointJacobians(mechanism.model, data, q)
    _, curvature = pushing.slopes(data, q)
    at = mechanism.coordinate("b")
    assert curvature[at, at] == pytest.approx(5.0)
    assert np.abs(curvature).sum() == pytest.approx(5.0)
    # A damper gives a force where the start moves.
    v = np.zeros(len(q))
    v[at] = 2.0
    assert pushing.nonpotential_forces(mechanism.model, data, q, v)[at] == pytest.approx(-6.0)
