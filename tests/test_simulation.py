"""The time loop: the ideal robot, invariants, limits, failures."""

import dataclasses

import numpy as np
import pinocchio as pin
import pytest
from conftest import body, joint, release, still

import jointplay as jp
from jointplay import ClearanceJoint, ComputedTorque, JointplayError, Mechanism, Motion, Simulation
from jointplay.integrators import INTEGRATORS
from jointplay.kernel import Status
from jointplay.result import Result
from jointplay.study import CONDITIONS, Condition, scara

PLAY = {"radial_clearance": 2e-4, "axial_clearance": 2e-4}
LOADED = Condition("loaded", "consistent")


def short(simulation, duration, **changes):
    return dataclasses.replace(simulation, duration=duration, **changes)


def test_ideal_robot_is_pinocchios_own():
    """The time loop against the same integration written out with pin.aba and the drive's law."""
    simulation = short(scara(None, LOADED), 0.05, record_every=1)
    result = simulation.run()
    mechanism, motion = simulation.mechanism, simulation.motion
    model, data = mechanism.model, mechanism.data
    q, v, a = motion(np.arange(5001) * 1e-5)
    inertia = pin.crba(model, data, q[0]).diagonal()
    kp, kd = 1e4 * inertia, 200.0 * inertia
    x, w = q[0].copy(), v[0].copy()
    for n in range(5000):
        forward = pin.rnea(model, data, q[n], v[n], a[n])
        effort = forward + kp * (q[n] - x) + kd * (v[n] - w)
        w = w + 1e-5 * pin.aba(model, data, x, w, effort)
        x = x + 1e-5 * w
    assert np.allclose(result["q"].values[-1], x, atol=2e-9)
    assert np.allclose(result["v"].values[-1], w, atol=1e-6)


def test_ideal_robot_tracks_its_reference():
    for condition in CONDITIONS[::3]:
        simulation = short(scara(None, condition), 1.0)
        result = simulation.run()
        reference, _, _ = simulation.motion(result.time)
        assert np.abs(result["q"].values - reference).max() < 2e-5


@pytest.mark.parametrize("losses", [None, {"joint_b": jp.JointFriction(5.0, 1.0)}])
def test_reaction_force_of_the_ideal_robot_carries_what_hangs_on_it(losses):
    result = short(scara(None, LOADED), 0.3, joint_friction=losses).run()
    force = result["reaction_force"].sel(moving_joint="joint_b").values
    # At rest, and wherever the stroke's acceleration vanishes: the weight of arms 2 and 3.
    assert force[0] == pytest.approx([0.0, 0.0, (4.35 + 3.03) * 9.81], abs=1e-6)
    stroke = result["v"].sel(coordinate="stroke").values
    acceleration = np.gradient(stroke, result.time)
    expected = 7.38 * 9.81 + 3.03 * acceleration
    assert np.allclose(force[5:-5, 2], expected[5:-5], atol=0.5)


def two_bodies(urdf, tmp=None):
    """Three sliders carry body 1, body 2 turns on it with play: free in space."""
    return urdf(
        '<link name="a"/><link name="b"/>',
        body("one", 3.0, "0 0 0", 0.05),
        body("two", 2.0, "0.1 0 0.05", 0.02),
        joint("sx", "base", "a", "prismatic", "1 0 0"),
        joint("sy", "a", "b", "prismatic", "0 1 0"),
        joint("sz", "b", "one", "prismatic", "0 0 1"),
        joint("pin", "one", "two", at="0.05 0.02 0"),
    )


def flying(path, **options):
    mechanism = Mechanism(path, {"pin": ClearanceJoint(**PLAY)}, gravity=(0, 0, 0))
    simulation = Simulation(
        mechanism, still(mechanism, 0.02), drive=ComputedTorque(bandwidth=1.0), **options
    )
    run = release(simulation.prepare())
    run.workspace.v[:] = [0.1, -0.2, 0.05, 0.3, 0.1, -0.2, 1.0, 0.5, -0.4]
    return mechanism, run


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_momentum_survives_impacts(urdf, integrator):
    mechanism, run = flying(two_bodies(urdf), integrator=integrator)
    result = run.execute()
    assert result.audit.impacts > 3
    momentum = np.array(
        [
            pin.computeCentroidalMomentum(mechanism.model, mechanism.data, q, v).linear.copy()
            for q, v in zip(result["q"].values, result["v"].values, strict=True)
        ]
    )
    order = INTEGRATORS[integrator].order
    drift = np.abs(momentum - momentum[0]).max() / np.linalg.norm(momentum[0])
    assert drift < (1e-3 if order == 1 else 1e-6)


def test_angular_momentum_about_a_free_hinge_survives_impacts(urdf):
    path = urdf(
        body("one", 3.0, "0.1 0 0", 0.05),
        body("two", 2.0, "0.1 0 0", 0.02),
        joint("hinge", "base", "one"),
        joint("pin", "one", "two", at="0.3 0 0"),
    )
    mechanism = Mechanism(path, {"pin": ClearanceJoint(**PLAY)}, gravity=(0, 0, 0))
    drive = ComputedTorque(bandwidth=1.0)
    motion = still(mechanism, 0.3)
    run = release(Simulation(mechanism, motion, drive=drive, integrator="rk4").prepare())
    run.workspace.v[:] = [0.5, 0, 0, 0, 1.0, 0, 0]
    result = run.execute()
    assert result.audit.impacts > 3
    hinge = np.array(
        [
            (pin.crba(mechanism.model, mechanism.data, q) @ v)[0]
            for q, v in zip(result["q"].values, result["v"].values, strict=True)
        ]
    )
    assert np.abs(hinge - hinge[0]).max() < 1e-6 * abs(hinge[0])


def test_internal_forces_do_no_work_in_rigid_motion(urdf):
    """A pair pressed together and carried along: the contact's power is zero to rounding."""
    mechanism, run = flying(two_bodies(urdf))
    at = mechanism.virtual_link("pin")
    run.workspace.v[at:] = 0.0
    run.workspace.q[at : at + 3] = [2.05e-4, 0.0, 0.0]
    from jointplay import kernel

    kernel.begin(run.workspace.table)
    assert np.abs(run.workspace.tau).max() > 100.0
    assert np.array_equal(run.workspace.tau[:3], np.zeros(3))  # nothing acts on the pair as a whole
    assert float(run.workspace.tau @ run.workspace.v) == 0.0


def order_of(residuals, steps):
    return np.polyfit(np.log(steps), np.log(residuals), 1)[0]


@pytest.mark.parametrize("method", INTEGRATORS.values(), ids=INTEGRATORS.keys())
def test_energy_residual_of_smooth_motion_falls_at_the_integrators_order(urdf, method):
    path = urdf(
        body("one", 3.0, "0.2 0 -0.1", 0.05),
        body("two", 2.0, "0.1 0 -0.2", 0.02),
        joint("j1", "base", "one", axis="0 1 0"),
        joint("j2", "one", "two", axis="0 1 0", at="0.3 0 0"),
    )
    mechanism = Mechanism(path)
    motion = still(mechanism, 0.32)
    drive = ComputedTorque(bandwidth=1.0)
    steps = np.array([2e-3, 1e-3, 5e-4])
    found = []
    for step in steps:
        simulation = Simulation(
            mechanism, motion, drive, step=step, integrator=method.name, record_every=1
        )
        run = release(simulation.prepare())
        run.workspace.v[:] = [3.0, -5.0]
        found.append(run.execute().audit.energy_residual)
    assert order_of(found, steps) == pytest.approx(method.order, abs=0.25)


def impact_residual(free_mass, step, integrator):
    run = free_mass(
        normal=jp.Hertz(),
        restitution=1.0,
        friction=jp.Ambrosio(0.0),
        step=step,
        integrator=integrator,
        offset=(0, 0, 1.97e-4, 0, 0, 0),
        velocity=(0, 0, 0.2, 0, 0, 0),
        duration=4e-4,
    )
    return run.execute().audit.energy_residual


def test_energy_residual_of_an_impact_falls_at_least_at_first_order(free_mass):
    """delta^(3/2) has no second derivative at the onset: rk4 does not keep its order there."""
    steps = np.array([8e-6, 4e-6, 2e-6])
    euler, rk4 = (
        [impact_residual(free_mass, step, name) for step in steps] for name in INTEGRATORS
    )
    assert order_of(euler, steps) == pytest.approx(1.0, abs=0.25)
    assert order_of(rk4, steps) > 1.5
    assert np.all(np.array(rk4) < 0.02 * np.array(euler))


def test_vanishing_clearance_converges_to_the_ideal_robot():
    ideal = short(scara(None, LOADED), 0.25).run()["tool_position"].values
    errors = []
    for clearance in (4e-4, 2e-4, 1e-4, 5e-5):
        worn = short(scara(clearance, LOADED), 0.25, step=5e-6, record_every=20).run()
        errors.append(np.linalg.norm(worn["tool_position"].values[-1] - ideal[-1]))
    assert np.all(np.diff(errors) < 0.0)
    # A wedged journal's droop is proportional to the clearance.
    slope = np.polyfit(np.log([4e-4, 2e-4, 1e-4, 5e-5]), np.log(errors), 1)[0]
    assert slope == pytest.approx(1.0, abs=0.1)


def test_mirrored_scene_gives_the_mirrored_motion():
    """Reflected at the xz plane the arm swings the other way and the journal's y changes sign."""
    results = []
    for sign in (1.0, -1.0):
        simulation = scara(2e-4, LOADED)
        text = simulation.mechanism.description.text
        for product in ("ixy", "iyz"):  # products of inertia that the reflection would flip
            import re

            text = re.sub(rf'{product}="[^"]*"', f'{product}="0"', text)
        description = simulation.mechanism.describe() | {"urdf_text": text}
        mechanism = Mechanism.from_description(description)
        positions = simulation.motion.positions * np.array([sign, sign, 1.0, sign])
        motion = Motion(simulation.motion.joints, simulation.motion.times, positions)
        run = Simulation(mechanism, motion, duration=0.05).prepare()
        at = mechanism.virtual_link("joint_b")
        run.workspace.q[at + 1] += sign * 5e-5
        results.append(run.execute())
    assert results[0].audit.impacts > 2
    flip = np.array([1.0, -1.0, 1.0])
    for name in ("tool_position", "joint_force_peak"):
        a, b = (result[name].values for result in results)
        assert np.allclose(a, b * flip, rtol=1e-6, atol=1e-6 * np.abs(a).max())


def wedge_error(gravity=9.81, arm=0.12, mass=2.0):
    """Relative errors of a wedged arm's contact forces and tilt against statics by hand."""

    def compare(result: Result) -> tuple[float, float, float]:
        joint = result.simulation.mechanism.clearance["pin"]
        forces = result["normal_force"].values[-200:, 0].mean(axis=0)
        weight = mass * gravity
        tilt = result["tilt"].values[-1, 0]
        # The lower face rests on its edge at the side of the overhang; the couple of the two
        # radial forces carries the rest of the overhang's moment.
        lever = arm - joint.rj
        couple = weight * lever / joint.lj
        by_hand = 2.0 * joint.cr / joint.lj
        return (
            abs(forces[3] / weight - 1.0),
            abs(forces[:2].mean() / couple - 1.0),
            abs(tilt / by_hand - 1.0),
        )

    return compare


def wedged(free_mass):
    run = free_mass(
        friction=jp.Ambrosio(0.0),
        restitution=0.3,
        com="0.12 0 0",
        gravity=(0, 0, -9.81),
        step=1e-5,
        duration=1.5,
        record_every=50,
    )
    return run.execute()


def test_wedged_arm_carries_its_weight_as_statics_say(free_mass):
    result = wedged(free_mass)
    axial, radial, tilt = wedge_error()(result)
    assert axial < 0.02
    assert radial < 0.03
    assert tilt < 0.06  # penetration and the second order of the tilt add to 2 C_r / L_j
    assert jp.Form(result["form"].values[-1, 0]).letter == "g"


def test_wrong_statics_fail_the_wedge_check(free_mass):
    result = wedged(free_mass)
    assert wedge_error(gravity=1.1 * 9.81)(result)[0] > 0.05
    assert wedge_error(arm=0.14)(result)[1] > 0.1


def test_peaks_between_records_are_kept():
    fine = short(scara(5e-4), 0.1, record_every=1).run()
    coarse = short(scara(5e-4), 0.1, record_every=100).run()
    n = len(coarse.time)
    assert n == 101
    for name in ("normal_force_peak", "gap_min"):
        best = np.maximum if name == "normal_force_peak" else np.minimum
        steps = fine[name].values[1:].reshape(100, 100, 1, 4)
        assert np.array_equal(best.reduce(steps, axis=1), coarse[name].values[1:])
    assert coarse["normal_force_peak"].max() > coarse["normal_force"].max()


def test_same_seed_same_run_other_seed_other_run():
    runs = [short(scara(2e-4, seed=seed), 0.1).run() for seed in (1, 1, 2)]
    journal = [run["journal_centre"].values for run in runs]
    assert np.array_equal(journal[0], journal[1])
    assert not np.array_equal(journal[0], journal[2])


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"step": 0.0}, "step must be greater than zero"),
        ({"step": float("nan")}, "step must be finite"),
        ({"step": 1e-3}, "too large for the contact stiffness at 'joint_b'"),
        ({"duration": -1.0}, "duration"),
        ({"duration": 1e-6}, "shorter than the step"),
        ({"record_every": 0}, "got 0"),
        ({"record_every": 2.5}, "got 2.5"),
        ({"integrator": "euler"}, "semi-implicit-euler, rk4"),
        ({"joint_friction": {"elbow": jp.JointFriction()}}, "joint_a, joint_b, stroke, joint_c"),
        ({"motion": Motion(["joint_a"], [0, 1], [[0], [1]])}, "lacks joint_b, stroke, joint_c"),
    ],
)
def test_impossible_simulations_are_refused(change, named):
    with pytest.raises(JointplayError) as caught:
        dataclasses.replace(scara(2e-4), **change).prepare()
    assert named in str(caught.value)


@pytest.mark.parametrize(
    "make",
    [
        lambda: ComputedTorque(bandwidth=-1.0),
        lambda: ComputedTorque(damping_ratio=float("inf")),
        lambda: jp.JointFriction(coulomb=-1.0),
    ],
)
def test_impossible_drives_are_refused(make):
    with pytest.raises(JointplayError):
        make()


def test_run_away_stops_at_once_and_keeps_its_records():
    simulation = short(scara(2e-4), 0.5, drive=ComputedTorque(bandwidth=1e6))
    with pytest.warns(RuntimeWarning, match=r"stopped at t = .*joint_b\.yaw = "):
        result = simulation.run()
    assert result.status in (Status.RUN_AWAY, Status.BROKE_OUT)
    assert 0 < len(result.time) < 5001
    assert np.isfinite(result["q"].values).all()
    assert "kept" not in result.message or result.message


def test_journal_that_breaks_out_is_named(free_mass):
    run = free_mass(velocity=(0, 0, 80.0, 0, 0, 0), step=2e-6, duration=1e-3, stiffness=1e7)
    with pytest.warns(RuntimeWarning, match=r"'pin' broke out of its bearing \(axial_A\)"):
        result = run.execute()
    assert result.status == Status.BROKE_OUT


def test_ctrl_c_keeps_what_was_computed(monkeypatch):
    from jointplay import simulation as module

    def interrupt(self, now):
        if now > 0.05:
            raise KeyboardInterrupt

    monkeypatch.setattr(module._Bar, "update", interrupt)
    result = short(scara(2e-4), 1.0).run()
    assert result.status == Status.INTERRUPTED
    assert 0.05 < result.time[-1] < 0.1
    assert result.message.startswith("interrupted at t = ")


def test_joint_friction_comes_from_the_urdf_and_dissipates(urdf):
    entry = joint("pin", "base", "arm", at="0 0 0").replace(
        "</joint>", '<dynamics friction="0.3" damping="0.1"/></joint>'
    )
    mechanism = Mechanism(urdf(body("arm"), entry), gravity=(0, 0, 0))
    drive = ComputedTorque(bandwidth=1.0)
    run = release(Simulation(mechanism, still(mechanism, 0.05), drive=drive, step=1e-5).prepare())
    run.workspace.v[0] = 2.0
    result = run.execute()
    # I dw/dt = -0.3 - 0.1 w: w = (w0 + 3) exp(-10 t) - 3 with I = 0.01.
    exact = 5.0 * np.exp(-10.0 * result.time) - 3.0
    assert np.allclose(result["v"].values[:, 0], exact, atol=1e-3)
    lost = 0.5 * 0.01 * (2.0**2 - exact[-1] ** 2)
    assert result["joint_friction_loss"].values[-1] == pytest.approx(lost, rel=1e-3)


def test_under_resolved_contacts_are_counted_and_warned_of(free_mass):
    run = free_mass(
        offset=(0, 0, 1.9e-4, 0, 0, 0), velocity=(0, 0, 0.1, 0, 0, 0), step=4e-5, duration=4e-3
    )
    audit = run.execute().audit
    assert audit.under_resolved == audit.impacts > 0
    assert audit.shortest_contact_steps < 10
    assert any("fewer than 10 steps" in text for text in audit.warnings)


def test_friction_that_the_step_cannot_follow_is_warned_of():
    jammed = short(scara(2e-4), 0.35).run().audit
    assert 1e-6 < jammed.friction_step_limit < 1e-5
    assert any("does not follow friction" in text for text in jammed.warnings)
    fine = short(scara(2e-4), 0.05, step=2e-6).run().audit
    assert not any("friction" in text for text in fine.warnings)


def test_friction_step_limit_is_that_of_a_damper():
    from jointplay.impact import effective_mass, friction_step_limit

    simulation = scara(2e-4)
    mechanism = simulation.mechanism
    q = mechanism.configuration({"joint_b": 0.9})
    damper = 0.1 / 0.9e-3 * 3000.0
    expected = 2.0 * effective_mass(mechanism, "joint_b", q) / damper
    assert friction_step_limit(mechanism, "joint_b", q, 3000.0) == pytest.approx(expected)
    assert friction_step_limit(mechanism, "joint_b", q, 0.0) == np.inf
