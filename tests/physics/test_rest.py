"""Machines that begin where they stand."""

import dataclasses

import numpy as np
import pinocchio as pin
import pytest
from conftest import body, joint, still

import jointplay as jp
from jointplay.physics.joints import PrismaticClearance, SphericalClearance
from jointplay.scenario import Scenario
from jointplay.simulation.statics import StaticEquilibrium, StaticLoads, weight_curvature

PIN = {"radial_clearance": 1e-4, "axial_clearance": 1e-4}
WEIGHT = 2.0 * 9.81


def pendulum(urdf, bearing, gravity=(0.0, -9.81, 0.0), kind="revolute", com="0 0 0", **options):
    path = urdf(body("arm", 2.0, com), joint("pin", "base", "arm", kind))
    return jp.Mechanism(path, {"pin": bearing}, gravity=gravity, **options)


def standing(mechanism, duration=0.01, **options):
    return jp.Simulation(mechanism, still(mechanism, duration), **options)


def test_depth_of_a_planar_journal_is_that_of_hertz_under_its_weight(urdf):
    bearing = jp.RevoluteClearance.planar(radial_clearance=1e-4)
    run = jp.Run(standing(pendulum(urdf, bearing)))
    depth = (WEIGHT / bearing.hertz_stiffness) ** (2 / 3)
    assert run.rest.solved
    assert run.workspace.q[:2] == pytest.approx([0.0, -(1e-4 + depth)], abs=1e-13)
    assert run.rest.load == pytest.approx(WEIGHT, rel=1e-9)


PROFILE = 2e-5 * (1.0 + np.cos(2 * np.pi * np.arange(36) / 36 - 4.0))
KINDS = {
    "revolute": (jp.RevoluteClearance(**PIN), "revolute", (0.0, -9.81, 0.0)),
    "revolute, upright": (jp.RevoluteClearance(**PIN), "revolute", (0.0, 0.0, -9.81)),
    "worn": (jp.RevoluteClearance(worn=PROFILE, **PIN), "revolute", (0.0, -9.81, 0.0)),
    "exchanged": (jp.RevoluteClearance(exchanged=True, **PIN), "revolute", (0.0, -9.81, 0.0)),
    "open": (
        jp.RevoluteClearance(open_ends=True, radial_clearance=1e-4), "revolute", (0.0, -9.81, 0.0)
    ),
    "planar": (jp.RevoluteClearance.planar(radial_clearance=1e-4), "revolute", (0.0, -9.81, 0.0)),
    "ball": (
        SphericalClearance(bearing_radius=10e-3, radial_clearance=1e-4),
        "floating", (1.0, -9.0, -3.0),
    ),
    "slider": (
        PrismaticClearance(length=40e-3, width=20e-3, height=20e-3, clearance=1e-4),
        "prismatic", (0.0, -9.81, 0.0),
    ),
}  # fmt: skip


@pytest.mark.parametrize("kind", KINDS)
def test_a_machine_at_rest_stays_there(urdf, kind):
    bearing, urdf_kind, gravity = KINDS[kind]
    com = "0 0 0" if kind == "ball" else "0.03 0 0.02"  # a ball would swing
    robot = pendulum(urdf, bearing, gravity, urdf_kind, com=com)
    options = {"drive": {}} if kind == "ball" else {"motion": still(robot, 0.01)}
    result = jp.Simulation(robot, duration=0.01, **options).run()
    force = np.linalg.norm(result["joint_force"].values[:, 0], axis=1)
    weight = 2.0 * np.linalg.norm(gravity)
    assert result.audit.start == "rest"
    assert result.audit.start_residual < 1e-6 * weight
    if kind in ("revolute", "worn", "planar", "exchanged", "open", "revolute, upright"):
        assert force == pytest.approx(weight, rel=1e-3)
    assert np.ptp(force) < 2e-3 * weight
    assert np.ptp(result["journal_centre"].values, axis=0).max() < 1e-8


def test_from_the_centre_it_falls_as_ever(urdf):
    robot = pendulum(urdf, jp.RevoluteClearance(**PIN))
    fallen, rested = (standing(robot, start=s).run().audit for s in ("centred", "rest"))
    assert fallen.peak_force > 10.0 * rested.peak_force
    assert rested.peak_force == pytest.approx(WEIGHT, rel=1e-3)
    assert fallen.start == "centred"


def serial(urdf):
    """Three joints in series, all loose."""
    path = urdf(
        body("one", com="0.2 0 0"), joint("a", "base", "one", axis="0 1 0"),
        body("two", com="0.1 0.02 0"), joint("b", "one", "two", axis="0 0 1", at="0.4 0 0"),
        body("three", com="0.1 0 0.01"), joint("c", "two", "three", axis="1 0 0", at="0.2 0 0"),
    )  # fmt: skip
    return jp.Mechanism(path, {name: jp.RevoluteClearance(**PIN) for name in "abc"})


def test_gravitys_curvature_is_that_of_differences(urdf):
    robot = serial(urdf)
    model, data = robot.model, robot.data
    q = 0.3 * np.random.default_rng(1).normal(size=model.nq)
    apart = [
        pin.computeGeneralizedGravity(model, data, q + way * step).copy()
        for step in 1e-6 * np.eye(model.nq)
        for way in (1.0, -1.0)
    ]
    differences = np.array(apart[::2]).T - np.array(apart[1::2]).T
    found = weight_curvature(model, data, q)
    assert found == pytest.approx(differences / 2e-6, abs=1e-5)
    assert (found == found.T).all()


def test_a_machine_rests_in_one_place_whatever_the_way_to_it(urdf):
    # The first joint's axis is vertical: where it lies across costs its weight nothing.
    path = urdf(
        body("one", com="0.2 0 0"), joint("a", "base", "one"),
        body("two", com="0.1 0.02 0"), joint("b", "one", "two", axis="0 1 0", at="0.4 0 0"),
    )  # fmt: skip
    robot = jp.Mechanism(path, {name: jp.RevoluteClearance(**PIN) for name in "ab"})
    run = jp.Run(standing(robot, drive=jp.loads.Prescribed()))
    q = np.zeros(robot.model.nq)
    drives = dict.fromkeys("ab", jp.loads.Prescribed())
    balance = StaticEquilibrium(
        robot, robot.model, q, q, drives, (), (), np.zeros(0), {}, StaticLoads({}, robot, []), q
    )
    random, places = np.random.default_rng(2), []
    for _ in range(5):
        near = q.copy()
        for name in "ab":
            at = robot.virtual_link(name)
            near[at : at + 3] = 6e-5 * random.uniform(-1.0, 1.0, 3)
            near[at + 4 : at + 6] = 1e-3 * random.uniform(-1.0, 1.0, 2)
        rest = balance.settle(near)
        assert rest.solved
        places.append(rest.q)
    assert np.ptp(places, axis=0) == pytest.approx(0.0, abs=1e-8)  # play: 1e-4 m
    assert places[0] == pytest.approx(run.rest.q, abs=1e-8)


def test_a_search_from_known_places_ends_in_the_same_rest(urdf):
    robot = serial(urdf)
    wide = jp.RevoluteClearance(radial_clearance=2e-4, axial_clearance=2e-4)
    wider = robot.with_clearance({**robot.given_joints, "b": wide})
    before = jp.Run(standing(robot)).rest
    assert set(before.places) == set("abc")
    known = {name: before.places[name] for name in "ac"}
    alone, led = jp.Run(standing(wider)).rest, jp.Run(standing(wider), places=known).rest
    assert led.solved
    assert led.q == pytest.approx(alone.q, abs=1e-10)  # play: 1e-4 m


def test_joints_in_series_all_rest(urdf):
    result = standing(serial(urdf)).run()
    force = np.linalg.norm(result["joint_force"].values, axis=2)
    assert force[0] == pytest.approx(WEIGHT * np.array([3.0, 2.0, 1.0]), rel=1e-3)
    assert result.audit.peak_force == pytest.approx(3.0 * WEIGHT, rel=1e-2)


def test_a_moving_start_bears_the_centrifugal_force_from_the_first(urdf):
    speed, arm = 30.0, 0.1
    robot = pendulum(
        urdf, jp.RevoluteClearance.planar(radial_clearance=1e-4), (0.0, 0.0, 0.0), com=f"{arm} 0 0"
    )
    motion = jp.Motion(["pin"], [0.0, 0.02], [[0.0], [speed * 0.02]], "constant-speed")
    simulation = jp.Simulation(robot, motion, drive=jp.loads.Prescribed(), step=2e-6)
    run = jp.Run(simulation)
    assert run.rest.load == pytest.approx(2.0 * speed**2 * arm, rel=1e-3)
    force = np.linalg.norm(run.finish()["joint_force"].values[:, 0], axis=1)
    assert force == pytest.approx(2.0 * speed**2 * arm, rel=0.1)
    centred = dataclasses.replace(simulation, start="centred").run().audit
    assert centred.peak_force > 1.5 * force.max()


def test_loops_rest_with_a_driven_crank():
    simulation = Scenario.load("jointplay:four_bar.toml").simulation("0.2 mm")
    simulation = dataclasses.replace(simulation, duration=2e-3, start="rest")
    rested = simulation.run().audit
    fallen = dataclasses.replace(simulation, start="centred", duration=0.02).run().audit
    assert rested.start_residual < 1e-6 * rested.start_load
    assert rested.peak_force < 1.5 * rested.start_load
    assert fallen.peak_force > 3.0 * rested.peak_force


def test_the_slider_of_a_fast_crank_presses_from_the_first():
    simulation = jp.Scenario.load("jointplay:slider_crank.toml").simulation("0.2 mm")
    simulation = dataclasses.replace(simulation, duration=2e-4)
    run = jp.Run(simulation)
    # At the outer dead centre: m r omega^2 (1 + r / l).
    speed, radius, rod, mass = 5000 * 2 * np.pi / 60, 0.05, 0.12, 0.14
    assert run.rest.load == pytest.approx(mass * radius * speed**2 * (1 + radius / rod), rel=1e-2)
    force = np.linalg.norm(run.finish()["joint_force"].values[:, 0], axis=1)
    assert force[0] == pytest.approx(run.rest.load, rel=1e-3)
    assert force.max() < 1.2 * run.rest.load  # it rings a little; centred, it strikes with 30 kN


@pytest.mark.parametrize("encoder", ["link", "motor"])
def test_teeth_bear_what_hangs_on_them(urdf, encoder):
    gear = jp.Gear(play=1e-2, stiffness=500.0, damping=0.1, rotor_inertia=1e-3)
    path = urdf(body("arm", 2.0, "0.1 0 0"), joint("pin", "base", "arm"))
    robot = jp.Mechanism(path, gears={"pin": gear}, gravity=(0.0, -9.81, 0.0))
    drive = jp.loads.ComputedTorque(encoder=encoder)
    run = jp.Run(jp.Simulation(robot, still(robot, 0.01), drive=drive, start="rest"))
    motor, link = (run.workspace.q[robot.coordinates.index(n)] for n in ("pin.motor", "pin"))
    assert motor - link == pytest.approx(5e-3 + WEIGHT * 0.1 / 500.0, rel=1e-2)
    speed = run.finish()["v"].values
    assert np.abs(speed).max() < 1e-6


def test_payload_in_hand_at_the_start_weighs(urdf):
    robot = pendulum(urdf, jp.RevoluteClearance.planar(radial_clearance=1e-4), tool="arm")
    run = jp.Run(standing(robot, payloads=[jp.Payload("arm", 1.0)]))
    assert run.rest.load == pytest.approx(3.0 * 9.81, rel=1e-9)


def test_without_load_journals_start_centred(urdf):
    robot = pendulum(urdf, jp.RevoluteClearance(**PIN), (0.0, 0.0, 0.0))
    result = standing(robot).run()
    assert result.audit.start == "centred"
    assert not result["journal_centre"].values.any()


def test_perturbed_journals_start_between_rest_and_a_random_place(urdf):
    robot = pendulum(urdf, jp.RevoluteClearance(**PIN))
    places = [jp.Run(standing(robot, seed=seed)).workspace.q[:3].copy() for seed in (1, 2, 2)]
    assert (places[1] == places[2]).all()
    assert not np.allclose(places[0], places[1], atol=1e-6)
    for place in places:
        assert np.hypot(*place[:2]) < 1e-4
        assert place[1] < 0.0


def test_what_no_joint_can_bear_is_said(urdf):
    soft = jp.RevoluteClearance.planar(radial_clearance=1e-4, normal=jp.contact.LinearSpring(1e-3))
    robot = pendulum(urdf, soft)
    with pytest.raises(jp.JointplayError, match="no equilibrium was found"):
        jp.Run(standing(robot, start="rest"))
    run = jp.Run(standing(robot))
    assert run.simulation.start == "centred"
    assert not run.rest.solved
    (warning,) = (text for text in run.result().audit.warnings if "equilibrium" in text)
    assert warning.startswith("the run starts centred, and falls into contact: ")
