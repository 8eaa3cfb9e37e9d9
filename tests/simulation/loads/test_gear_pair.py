"""Gears that mesh: against Modelica's law integrated by scipy, conservation, and a rigid ratio."""

import re
from pathlib import Path

import numpy as np
import pytest
from conftest import body, joint
from machines import NO_GRAVITY, QUIET
from scipy.integrate import solve_ivp

import jointplay as jp
from jointplay.cli import main
from jointplay.simulation.loads import Controller, GearPair

ONE, TWO = 0.02, 0.05  # moments of inertia [kg m^2]


def file_of_discs(urdf, kind="continuous", mimic=""):
    return urdf(
        *(body("one", 1.0, inertia=ONE), body("two", 1.0, inertia=TWO)),
        joint("a", "base", "one", "continuous"),
        joint("b", "base", "two", kind, at="0.15 0 0").replace("<limit", f"{mimic}<limit"),
    )


def discs(urdf, **options):
    return jp.Mechanism(file_of_discs(urdf, **options), gravity=NO_GRAVITY)


def push(time, q, v, p, out):
    out[0] = p[0] * np.cos(p[1] * time)


def backlash(times, ratio, play, stiffness, damping, torque, rate):
    """Angles (n, 2) of two discs on Modelica's ElastoBacklash2, which with damping 0 is
    ElastoBacklash, by scipy between the moments at which teeth touch or part; and how many.
    """

    def slope(t, y):
        twist, turning = y[1] - ratio * y[0], y[3] - ratio * y[2]
        side = np.sign(twist) * (abs(twist) > 0.5 * play)
        tau = side * max(stiffness * (abs(twist) - 0.5 * play) + side * damping * turning, 0.0)
        return [y[2], y[3], (torque * np.cos(rate * t) + ratio * tau) / ONE, -tau / TWO]

    def at(flank):
        def touch(_, y):
            return y[1] - ratio * y[0] - flank

        touch.terminal = True
        return touch

    flanks, y, now, events = [at(0.5 * play), at(-0.5 * play)], np.zeros(4), 0.0, 0
    found = np.full((len(times), 2), np.nan)
    while True:
        part = solve_ivp(
            *(slope, (now, times[-1]), y),
            method="LSODA", rtol=1e-11, atol=1e-13, events=flanks, dense_output=True, max_step=1e-3,
        )  # fmt: skip
        here = (times >= now - 1e-11) & (times <= part.t[-1])
        found[here] = part.sol(times[here]).T[:, :2]
        if part.status != 1:
            return found, events
        events, now = events + 1, part.t[-1] + 1e-12
        y = part.y[:, -1] + 1e-12 * np.array(slope(now, part.y[:, -1]))  # past this touch


@pytest.mark.parametrize("damping", [0.0, 1.0])
def test_discs_move_as_on_modelicas_backlash(urdf, damping):
    ratio, play, torque, rate = -0.5, np.deg2rad(0.5), 1.5, 8.0 * np.pi
    mesh = GearPair("b", "a", ratio=ratio, play=play, stiffness=2e3, damping=damping)
    loads = {"mesh": mesh, "push": Controller(("a",), push, (torque, rate))}
    result = jp.simulate(
        discs(urdf), duration=0.5, loads=loads, step=2e-6, record_every=500, **QUIET
    )
    exact, touches = backlash(result.time, ratio, play, 2e3, damping, torque, rate)
    assert touches > 15
    ways = np.sign(np.diff(exact[::25, 0]))
    assert np.count_nonzero(np.diff(ways)) >= 3  # reversals
    assert result["q"].values == pytest.approx(exact, abs=1e-4)


@pytest.mark.parametrize("integrator", ["multi-rate", "rk4"])
def test_turbines_on_one_shaft_keep_momentum_and_energy(urdf, integrator):
    loads = {"shaft": GearPair("b", "a", ratio=1.0, play=0.02, stiffness=2e3)}
    state = {"a": (0.0, 3.0), "b": (0.0, 0.0)}
    result = jp.simulate(
        discs(urdf), duration=0.2, loads=loads, state=state, step=5e-6, integrator=integrator,
        **QUIET,
    )  # fmt: skip
    v, energy = result["v"].values, result["load_energy"].values[:, 0]
    assert v @ [ONE, TWO] == pytest.approx(3.0 * ONE, rel=1e-9)
    kinetic = 0.5 * v**2 @ [ONE, TWO]
    assert energy.max() > 0.3 * kinetic[0]
    assert kinetic + energy == pytest.approx(0.5 * ONE * 9.0, rel=1e-5)
    side = np.sign(result["load_record"].sel(load_part="shaft.torque").values)
    assert {-1.0, 0.0, 1.0} == set(side)
    assert result["load_work"].values == pytest.approx(0.0, abs=1e-9)


def test_stiff_teeth_without_play_are_a_rigid_ratio(urdf):
    ratio, torque = -0.4, 2.0
    mesh = GearPair("b", "a", ratio=ratio, stiffness=1e6, damping=100.0, centre_distance=0.14)
    loads = {"mesh": mesh, "push": Controller(("a",), steady, (torque,))}
    result = jp.simulate(discs(urdf), duration=0.05, loads=loads, step=2e-6, **QUIET)
    along = torque / (ONE + ratio**2 * TWO)  # of the pinion [rad/s^2]
    exact = 0.5 * along * np.outer(result.time**2, [1.0, ratio])
    assert result["q"].values == pytest.approx(exact, abs=2e-6)
    # The wheel's pitch radius is 100 mm: what accelerates it is the force there.
    force = result["load_record"].sel(load_part="mesh.force").values[-1]
    expected = TWO * ratio * along / 0.1 / np.cos(np.deg2rad(20.0))
    assert force == pytest.approx(expected, rel=1e-3)


def steady(time, q, v, p, out):
    out[0] = p[0]


def test_a_rack_moves_with_its_pinion(urdf):
    mesh = GearPair("b", "a", ratio=0.03, play="0.1 mm", stiffness=1e7, damping=3e3)
    robot = discs(urdf, kind="prismatic")
    motion = jp.Motion(["a"], [0.0, 0.1, 0.2], [[0.0], [1.0], [0.0]])
    options = {"drive": jp.loads.Prescribed(), "joint_friction": {}}
    result = jp.simulate(robot, motion, loads={"mesh": mesh}, step=5e-6, **options)
    apart = result["q"].values[:, 1] - 0.03 * result["q"].values[:, 0]
    assert apart.max() == pytest.approx(5e-5, abs=2e-5)
    assert apart.min() == pytest.approx(-5e-5, abs=2e-5)


MIMIC = '<mimic joint="a" multiplier="-2" offset="0.1"/>'


def test_a_mimic_with_play_follows_through_its_teeth(urdf):
    """It has no drive of its own, and begins where the URDF has it; its twin has no play."""
    robot = discs(urdf, mimic=MIMIC)
    motion = jp.Motion(["a"], [0.0, 0.2, 0.4], [[0.3], [0.8], [0.3]])
    mesh = GearPair("b", play=0.02, stiffness=2e5, damping=100.0)
    drive = jp.loads.Prescribed()
    result = jp.simulate(robot, motion, loads={"mesh": mesh}, drive=drive, joint_friction={})
    q = result["q"].values
    assert list(result.simulation.drive) == ["a"]
    assert q[0] == pytest.approx([0.3, -0.5])
    apart = q[:, 1] - (0.1 - 2.0 * q[:, 0])
    assert apart.max() == pytest.approx(0.01, abs=2e-3)
    assert apart.min() == pytest.approx(-0.01, abs=2e-3)
    twin = jp.analysis.twin(result)["q"].values
    assert twin[:, 1] == pytest.approx(0.1 - 2.0 * twin[:, 0], abs=5e-4)
    assert jp.analysis.is_twin(result, jp.analysis.twin(result))


@pytest.mark.parametrize(("given", "led"), [("a", {"b": -0.1}), ("b", {"a": -0.4})])
def test_gears_begin_in_mesh_whichever_is_given(urdf, given, led):
    mesh = GearPair("b", "a", ratio=-0.5, stiffness=1e3)
    state = {given: (0.2, 1.0)}
    result = jp.simulate(discs(urdf), duration=1e-3, loads={"m": mesh}, state=state, **QUIET)
    ((other, place),) = led.items()
    index = ["a", "b"].index(other)
    assert result["q"].values[0, index] == pytest.approx(place)
    assert result["v"].values[0, index] == pytest.approx(5.0 * place)
    assert np.abs(result["load_record"].values).max() < 1e-9


def test_a_step_too_large_for_the_teeth_is_refused(urdf):
    """Swing of both discs on the teeth: k (1/J_2 + i^2/J_1)."""
    mesh = GearPair("b", "a", ratio=-3.0, stiffness=1e6)
    frequency = np.sqrt(1e6 * (1.0 / TWO + 9.0 / ONE)) / (2.0 * np.pi)
    with pytest.raises(
        jp.JointplayError, match=re.escape(f"'m', a swing on its springs at {frequency:.3g} Hz")
    ):
        jp.simulate(discs(urdf), duration=0.1, loads={"m": mesh}, step=1e-4, **QUIET)


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({}, "'b' need leader and ratio: the URDF has it mimic no joint"),
        ({"leader": "a"}, "ratio is missing"),
        ({"ratio": 2.0}, "leader is missing"),
        ({"leader": "b", "ratio": 2.0}, "cannot mesh with itself"),
        ({"leader": "a", "ratio": 0.0}, "gear ratio must not be zero"),
        ({"leader": "c", "ratio": 2.0}, "no moving joint 'c'"),
        ({"leader": "a", "ratio": 1.0, "centre_distance": 0.1}, "turn the same way"),
        ({"leader": "a", "ratio": 2.0, "pressure_angle": 1.0}, "below 45 degrees, got 57.2958"),
    ],
)
def test_gears_that_cannot_mesh_are_refused(urdf, fields, words):
    with pytest.raises(jp.JointplayError, match=words):
        jp.simulate(
            discs(urdf),
            duration=0.01,
            loads={"m": GearPair("b", stiffness=1e3, **fields)},
            **QUIET,
        )


DOCS = Path(__file__).parents[3] / "docs" / "drives.md"
SCENARIO = """
[robot]
urdf = "robot.urdf"
gravity = "balanced"
tool = "two"
[motion]
times = [0, "0.2 s", "0.4 s"]
joints.a = ["10 deg", "90 deg", "10 deg"]
"""


@pytest.fixture
def scenario(urdf, tmp_path):
    page = DOCS.read_text(encoding="utf-8")
    (pair,) = re.findall(r"```toml\n(\[loads.mesh\].*?)```", page, re.DOTALL)
    pair = pair.replace('"wheel"', '"b"').replace('"pinion"', '"a"')
    text = SCENARIO.replace("robot.urdf", str(file_of_discs(urdf))) + pair
    (tmp_path / "pair.toml").write_text(text, encoding="utf-8")
    return str(tmp_path / "pair.toml")


@pytest.mark.thorough
def test_a_run_says_what_play_of_teeth_does(scenario, tmp_path, capsys):
    assert main(["run", scenario, "--out", str(tmp_path / "out")]) == 0
    assert "Play of 0.5 deg in mesh turns 'two' by up to" in capsys.readouterr().out


def test_a_budget_says_that_it_leaves_pairs_out(scenario, capsys):
    assert main(["budget", scenario, "--gear", "b=0.1 deg"]) == 0
    said = capsys.readouterr()
    assert "both joints of a gear pair, so its play does not count" in said.out + said.err
