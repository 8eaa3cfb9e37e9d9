"""Runs with loads that are continued from a file."""

from dataclasses import replace

import numpy as np
import pytest
from conftest import body, joint

import jointplay as jp
from jointplay.simulation.loads import (
    Controller,
    JointFriction,
    LoadedFriction,
    Spring,
    Stop,
    Wrench,
)

PLAY = {"radial_clearance": 1e-4, "axial_clearance": 1e-4}
METHODS = ({}, {"tolerance": 1e-3}, {"integrator": "rk4"}, {"integrator": "semi-implicit-euler"})


class Integrating:
    """A controller with a memory that it can say."""

    def __init__(self, gain):
        self.gain, self.sum = gain, 0.0

    def __call__(self, time, q, v):
        self.sum += float(q[0])
        return [-self.gain * self.sum]

    def memory(self):
        return {"sum": self.sum}

    def recall(self, memory):
        self.sum = memory["sum"]


class Silent:
    """One that cannot."""

    def __call__(self, time, q, v):
        return [0.0]


class Odd(Silent):
    """One that says what is not plain data."""

    def memory(self):
        return object()

    def recall(self, memory):
        pass


def pushed(time, q, v, p):
    return [p[0] - q[0]]


def simulation(urdf, loads, **options):
    path = urdf(
        body("one", com="0.1 0 0"), joint("a", "base", "one", axis="0 1 0"),
        body("two", com="0.1 0 0"), joint("b", "one", "two", axis="0 1 0", at="0.2 0 0")
    )  # fmt: skip
    robot = jp.Mechanism(path, {"a": jp.RevoluteClearance(**PLAY)})
    motion = jp.Motion(["a", "b"], [0.0, 0.02], [[0.0, 0.0], [0.2, -0.3]])
    return jp.Simulation(robot, motion, duration=8e-3, loads=loads, **options)


@pytest.mark.parametrize("options", METHODS)
def test_loads_are_continued_bit_for_bit(urdf, tmp_path, options):
    loads = {
        "pull": Spring("two", 200.0, 0.1, at=(0.1, 0, 0), other_at=(0, 0, 0.4), damping=2.0),
        "push": Wrench("two", force=(0.0, 0.0, 3.0)),
        "rub": LoadedFriction("b", 0.2, radius=0.01),
        "stop": Stop("b", 1e4, damping=3.0, lower=-0.01, upper=0.3),
        "held": Controller(["b"], pushed, (0.5,), period=3e-4),
        "sum": Controller(["a"], Integrating, (2.0,), period=5e-4),
    }
    whole_simulation = simulation(urdf, loads, start="centred", **options)
    whole = whole_simulation.run()
    run = jp.Run(whole_simulation)
    for moment in run.steps(1e-4):
        if moment.time >= 4.1e-3:
            break
    path = run.checkpoint(tmp_path / "run.npz")
    again = jp.Simulation.resume(path).finish()
    for name in whole.dataset.data_vars:
        assert np.array_equal(again[name].values, whole[name].values, equal_nan=True), name
    rubbed = whole["load_record"].sel(load_part="rub.torque").values
    assert np.abs(rubbed).max() > 0.0
    assert again.audit == whole.audit


@pytest.mark.parametrize("period", [None, 3e-4])
@pytest.mark.parametrize("options", METHODS)
def test_integrals_and_bristles_are_continued_bit_for_bit(urdf, tmp_path, options, period):
    whole_simulation = simulation(urdf, {}, start="centred", **options)
    servo = jp.loads.Servo.of(
        "STS3215", voltage=7.4, p_gain=30.0, i_gain=3e3, d_gain=0.5, resolution=1e-4, period=period,
        speed="exact" if period is None else "difference", encoder="link", presliding=1e-4,
    )  # fmt: skip
    gear = jp.Gear(play=1e-3, rotor_inertia=0.03, stiffness=300.0, damping=0.05)
    robot = whole_simulation.mechanism
    whole_simulation = replace(
        whole_simulation,
        mechanism=robot.with_clearance(dict(robot.clearance), {"b": gear}),
        drive={"a": jp.loads.ComputedTorque(), "b": servo},
        joint_friction={"b": JointFriction(0.02, presliding=1e-4)},
    )
    whole = whole_simulation.run()
    run = jp.Run(whole_simulation)
    for moment in run.steps(1e-4):
        if moment.time >= 4.1e-3:
            break
    path = run.checkpoint(tmp_path / "run.npz")
    again = jp.Simulation.resume(path).finish()
    for name in whole.dataset.data_vars:
        assert np.array_equal(again[name].values, whole[name].values, equal_nan=True), name
    assert abs(run.workspace.servos["integral"][0]) > 1e-3
    assert (run.workspace.frictions["kept_bend"] != 0.0).all()


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        (Silent, "whose state cannot be saved in a checkpoint; give it memory"),
        (Odd, "is not plain data"),
    ],
)
def test_a_controller_that_cannot_say_its_state_is_refused(urdf, tmp_path, kind, words):
    run = jp.Run(simulation(urdf, {"c": Controller(["a"], kind, period=1e-3)}))
    with pytest.raises(jp.JointplayError, match=words):
        run.checkpoint(tmp_path / "run.npz")
    assert not list(tmp_path.glob("run.npz"))


@pytest.mark.parametrize("options", METHODS[:3])
def test_to_look_at_a_run_with_loads_changes_nothing(urdf, options):
    loads = {
        "rub": LoadedFriction("b", 0.2, radius=0.01),
        "held": Controller(["b"], pushed, (0.5,), period=3e-4),
    }
    one = simulation(urdf, loads, **options)
    plain = one.run()
    run = jp.Run(one)
    assert len(list(run.steps(7e-4))) > 10
    assert (run.workspace.recorded("q") == plain["q"].values).all()
