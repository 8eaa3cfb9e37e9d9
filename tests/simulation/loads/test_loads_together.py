"""Loads beside all else: clearance, loops, prescribed motion, payloads, reactions."""

import numpy as np
import pinocchio as pin
import pytest
from machines import QUIET, arm, rotor

import jointplay as jp
from jointplay.simulation.loads import (
    Controller,
    CurveSpring,
    LoadedFriction,
    Spring,
    Stop,
    TorsionSpring,
    Wrench,
)


def spin(time, q, v, p, out):
    out[0] = p[0] * np.sin(20.0 * time)


def every_load():
    tip = {"at": (0.2, 0.0, 0.0)}
    return {
        "spring": Spring("two", 300.0, 0.3, other_at=(0.3, 0.1, 0.5), damping=2.0, **tip),
        "between": Spring("two", 100.0, 0.1, other="base", **tip),
        "curve": CurveSpring("two", (0.1, 0.2, 0.6), (-5.0, 0.0, 60.0), other="base", **tip),
        "push": Wrench("two", force=(0.0, 0.0, 3.0), moment=(0, 0.1, 0), axes="frame", **tip),
        "twist": TorsionSpring("b", 2.0, 0.05),
        "stop": Stop("a", 800.0, 3.0, lower=-0.2, upper=0.3),
        "drive": Controller(("a",), spin, (2.0,)),
        "rub": LoadedFriction("b", 0.1, 0.01),
    }


@pytest.mark.parametrize(
    "options",
    [{}, {"integrator": "rk4"}, {"integrator": "semi-implicit-euler"}, {"tolerance": 1e-4}],
    ids=str,
)
@pytest.mark.parametrize("play", [False, True])
def test_energy_is_kept_with_all_loads_at_once(urdf, options, play):
    clearance = {"b": jp.RevoluteClearance(radial_clearance=1e-4, axial_clearance=1e-4)}
    robot = arm(urdf, clearance if play else None)
    options = options | {"duration": 0.2, "state": {"a": 0.2}, **QUIET}
    result = jp.simulate(robot, loads=every_load(), **options)
    assert result.status.name == "COMPLETED"
    rough = play or options.get("integrator") == "semi-implicit-euler"
    limit = 1e-3 if rough else 1e-5
    assert result.audit.relative_energy_residual < limit
    assert (np.abs(result["load_work"].values[-1]) > 1e-9).sum() >= 5


def test_energy_is_kept_with_springs_on_loops():
    scenario = jp.Scenario.load(jp.shipped("four_bar.toml"))
    for case in list(scenario.cases)[:2]:
        given = scenario.simulation(case)
        loads = {"s": Spring("coupler", 200.0, 0.05, other_at=(0.1, 0.1, 0.1), damping=1.0)}
        options = {"drive": given.drive, "state": given.state, "duration": 0.03}
        plain, result = (
            jp.simulate(given.mechanism, given.motion, loads=one, **options) for one in ({}, loads)
        )
        assert result.audit.relative_energy_residual < 1e-3 + plain.audit.relative_energy_residual
        assert float(np.abs(result["load_work"][-1]).max()) > 1e-4


@pytest.mark.parametrize("integrator", ["multi-rate", "rk4"])
def test_prescribed_motion_takes_the_torque_that_loads_ask_for(urdf, integrator):
    robot = rotor(urdf)
    motion = jp.Motion(["a"], [0.0, 0.2], [[0.0], [0.8]])
    loads = {"k": TorsionSpring("a", 5.0, 0.1), "m": Wrench("disc", moment=(0, 0, 0.7))}
    options = QUIET | {"drive": jp.loads.Prescribed(), "integrator": integrator}
    result = jp.simulate(robot, motion, loads=loads, **options)
    q, v, a = motion(result.time)
    assert np.abs(result["q"].values - q).max() < 1e-9
    torque = 0.02 * a[:, 0] + 5.0 * q[:, 0] + 0.1 * v[:, 0] - 0.7
    assert result["drive"].values[5:-5, 0] == pytest.approx(torque[5:-5], abs=2e-4)


def test_a_payload_may_be_picked_while_loads_act(urdf):
    payload = jp.Payload("two", 1.0, pick=0.05, release=0.1)
    result = jp.simulate(
        arm(urdf), duration=0.15, loads=every_load(), payloads=[payload], state={"a": 0.2}, **QUIET
    )
    assert result.audit.relative_energy_residual < 1e-5


def test_reactions_are_those_of_inverse_dynamics_with_the_loads_forces(urdf):
    robot = arm(urdf)
    loads = {
        "between": Spring("two", 500.0, 0.05, other="one", at=(0.2, 0, 0.1), other_at=(0, 0, 0.2)),
        "ground": Spring("two", 300.0, 0.3, at=(0.2, 0, 0), other_at=(0.3, 0.1, 0.5)),
    }
    result = jp.simulate(robot, duration=0.05, loads=loads, state={"a": 0.2}, **QUIET)
    model, data = robot.model, robot.model.createData()
    for k in (0, 200, 400):
        q, v = result["q"].values[k], result["v"].values[k]
        pin.forwardKinematics(model, data, q)
        pin.updateFramePlacements(model, data)
        forces = [pin.Force.Zero() for _ in range(model.njoints)]

        def point(link, at, model=model, data=data):
            frame = model.getFrameId(link)
            return model.frames[frame].parentJoint, data.oMf[frame].act(np.array(at))

        for load in loads.values():
            index, end = point(load.frame, load.at)
            other, start = (0, np.array(load.other_at))
            if load.other != "world":
                other, start = point(load.other, load.other_at)
            length = np.linalg.norm(end - start)
            pull = -load.stiffness * (length - load.free_length) * (end - start) / length
            for at, sign in ((index, 1.0), (other, -1.0)):
                force = pin.Force(sign * pull, np.cross(end, sign * pull))
                forces[at] = forces[at] + data.oMi[at].actInv(force)
        fext = pin.StdVec_Force()
        fext.extend(forces)
        a = pin.aba(model, data, q, v, np.zeros(2), fext).copy()
        pin.rnea(model, data, q, v, a, fext)
        for j, name in enumerate(robot.joints, 1):
            exact = data.oMi[j].rotation @ data.f[j].linear
            found = result["reaction_force"].sel(moving_joint=name).values[k]
            assert found == pytest.approx(exact, abs=1e-6 * np.abs(exact).max())


@pytest.mark.parametrize(
    ("loads", "words"),
    [
        ([1], "loads must be a mapping of names"),
        ({"": TorsionSpring("a", 1.0)}, "name of a load must be readable text"),
        ({"x" * 300: TorsionSpring("a", 1.0)}, "has 300 letters; at most"),
    ],
)
def test_loads_have_names(urdf, loads, words):
    with pytest.raises(jp.JointplayError, match=words):
        jp.simulate(arm(urdf), duration=0.1, loads=loads, **QUIET)
