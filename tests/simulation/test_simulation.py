"""The time loop: the ideal robot, invariants, limits, failures."""

import dataclasses
import warnings

import numpy as np
import pinocchio as pin
import pytest

import jointplay as jp
from jointplay import JointplayError
from jointplay.base.schema import fields_of
from jointplay.paper import Condition, scara
from jointplay.physics.kernel import Status
from jointplay.physics.kernel.constants import INTEGRATORS
from jointplay.simulation.loads import ComputedTorque

LOADED = Condition("loaded", "consistent")


def short(simulation, duration, **changes):
    return dataclasses.replace(simulation, duration=duration, **changes)


@pytest.mark.parametrize("way", ["simulate", "run", "run_to", "ensemble"])
def test_warnings_of_the_audit_are_raised_once_and_only_for_the_run_asked_for(way, tmp_path):
    changes = {"step": 2e-5, "integrator": "rk4", "duration": 0.01, "start": "centred"}
    shipped = jp.Scenario.load("jointplay:slider_crank.toml").simulation("0.5 mm")
    simulation = dataclasses.replace(shipped, **changes)
    ways = {
        "simulate": lambda: jp.simulate(
            shipped.mechanism, shipped.motion, estimate=False, drive=shipped.drive, **changes
        ),
        "run": lambda: simulation.run(estimate=False),
        "run_to": lambda: simulation.run_to(tmp_path / "a.nc"),
        "ensemble": lambda: jp.ensemble([simulation], jobs=1),
    }
    with warnings.catch_warnings(record=True) as raised:
        warnings.simplefilter("always")
        result = ways[way]()
    texts = [str(w.message) for w in raised if w.category is jp.JointplayWarning]
    assert texts == ([] if way == "ensemble" else result.audit.warnings)
    if way != "ensemble":
        assert len(texts) == 3
        assert {w.filename for w in raised} == {__file__}


def test_ideal_robot_is_pinocchios_own():
    """The time loop against the same integration written out with pin.aba and the drive's law."""
    simulation = short(scara(None, LOADED), 0.05, record_every=1, integrator="semi-implicit-euler")
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


def test_peaks_between_records_are_kept():
    fine = short(scara(5e-4), 0.1, record_every=1).run()
    coarse = short(scara(5e-4), 0.1, record_every=100).run()
    n = len(coarse.time)
    assert n == 101
    kept = {"normal_force_peak": ("normal_force", np.max), "gap_min": ("gap", np.min)}
    for name, (instant, best) in kept.items():
        steps = fine[instant].values[1:].reshape(100, 100, 1, 4)
        assert np.allclose(coarse[name].values[1:], best(steps, axis=1), rtol=1e-12, atol=1e-15)
    peak, instant = coarse["normal_force_peak"].values[1:], coarse["normal_force"].values[1:]
    assert np.count_nonzero(peak > instant) > 10


def test_force_peak_is_the_largest_vector_of_its_window(free_mass):
    tumbling = {"velocity": (0.2, 0.13, -0.1, 0.0, 3.0, -2.0), "duration": 5e-3}
    fine, coarse = (free_mass(**tumbling, record_every=n).finish() for n in (1, 100))
    windows = fine["joint_force"].values[1:, 0].reshape(50, 100, 3)
    largest = np.linalg.norm(windows, axis=2).argmax(axis=1)
    expected = windows[np.arange(50), largest]
    assert np.abs(expected).max() > 100.0
    assert np.allclose(coarse["joint_force_peak"].values[1:, 0], expected, rtol=1e-12)


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_what_is_recorded_does_not_change_the_run(integrator):
    worn = short(scara(2e-4, seed=1), 0.02, integrator=integrator)
    ends = [dataclasses.replace(worn, record_every=n).run() for n in (1, 7, 5000)]
    for end in ends[1:]:
        assert np.array_equal(end["q"].values[-1], ends[0]["q"].values[-1])
        assert end.audit.impacts == ends[0].audit.impacts


def test_advised_step_is_one_that_runs():
    import re

    coarse = short(scara(2e-4), 1e-3, step=2e-4)
    with pytest.raises(JointplayError, match="take at most") as caught:
        jp.Run(coarse)
    advised = float(re.search(r"at most (\S+) s", str(caught.value)).group(1))
    assert dataclasses.replace(coarse, step=advised).run().status == Status.COMPLETED


@pytest.mark.parametrize("seed", range(5))
def test_perturbed_journals_start_free_in_their_bearings(seed):
    simulation = scara(2e-4, seed=seed)
    run = jp.Run(simulation)
    at = simulation.mechanism.virtual_link("joint_b")
    start = run.workspace.q[at : at + 6]
    assert (np.abs(start[:3]) > 0.0).all()
    assert (np.abs(start[:3]) < 1e-4).all()
    assert start[3] == simulation.motion(np.zeros(1))[0][0, 1]
    assert not start[4:].any()


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
        (
            {"joint_friction": {"elbow": jp.loads.JointFriction()}},
            "joint_a, joint_b, stroke, joint_c",
        ),
    ],
)
def test_impossible_simulations_are_refused(change, named):
    with pytest.raises(JointplayError) as caught:
        jp.Run(dataclasses.replace(scara(2e-4), **change))
    assert named in str(caught.value)


def test_run_away_stops_at_once_and_keeps_its_records():
    simulation = short(scara(2e-4), 0.5, drive=ComputedTorque(bandwidth=1e6))
    with pytest.warns(RuntimeWarning, match=r"stopped at t = .*joint_b\.\w+ = "):
        result = simulation.run()
    assert result.status in (Status.RUN_AWAY, Status.BROKE_OUT)
    assert 0 < len(result.time) < 5001
    assert np.isfinite(result["q"].values).all()
    assert "kept" not in result.message or result.message


def test_journal_that_breaks_out_is_named(free_mass):
    run = free_mass(velocity=(0, 0, 80.0, 0, 0, 0), step=2e-6, duration=1e-3, stiffness=1e7)
    with pytest.warns(RuntimeWarning, match=r"'pin' broke out of its bearing \(axial_A\)"):
        result = run.finish()
    assert result.status == Status.BROKE_OUT


def test_ctrl_c_keeps_what_was_computed(monkeypatch):
    from jointplay.simulation import run as module

    def interrupt(self, now):
        if now > 0.05:
            raise KeyboardInterrupt

    monkeypatch.setattr(module.Simulated, "reach", interrupt)
    result = short(scara(2e-4), 1.0).run()
    assert result.status == Status.INTERRUPTED
    assert 0.05 <= result.time[-1] < 0.1
    assert result.message.startswith("interrupted at t = ")


def test_friction_that_the_step_cannot_follow_is_warned_of():
    jammed = short(scara(2e-4), 0.35, integrator="semi-implicit-euler").run().audit
    assert 1e-6 < jammed.friction_step_limit < 1e-5
    assert any("does not follow friction" in text for text in jammed.warnings)
    implicit = short(scara(2e-4), 0.35).run().audit
    assert not any("friction" in text for text in implicit.warnings)


def test_journal_of_a_loop_is_displaced_at_a_dead_centre_too():
    scenario = jp.Scenario.load("jointplay:slider_crank.toml")
    clearance = 0.2e-3
    offsets = []
    for seed in range(5):
        run = jp.Run(
            scenario.simulation("0.2 mm", {"integration": {"seed": seed, "start": "centred"}})
        )
        mechanism, q = run.mechanism, run.workspace.q
        assert q[mechanism.coordinate("crank_pin")] == 0.0
        pin.forwardKinematics(mechanism.model, mechanism.data, q)
        offsets.append(mechanism.journal_pose("piston_pin").translation[:2])
    assert (np.abs(offsets) <= 0.5 * clearance + 1e-9).all()
    assert np.ptp(offsets, axis=0).min() > 0.1 * clearance


def test_files_know_every_input_of_a_simulation():
    assert set(fields_of(jp.Simulation)) == {
        field.name for field in dataclasses.fields(jp.Simulation)
    }


@pytest.mark.parametrize("wrong", [np.zeros(3), [1.0], [None], 5])
@pytest.mark.parametrize("field", ["payloads", "loads", "drive", "joint_friction"])
def test_tables_of_other_things_are_refused_in_a_line(field, wrong):
    from jointplay.paper import scara

    with pytest.raises(jp.JointplayError) as caught:
        dataclasses.replace(scara(2e-4), **{field: wrong})
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("wrong", [None, 5, []])
def test_identify_and_scenarios_of_robots_refuse_arguments_of_another_kind(wrong):
    from jointplay.estimate import identify
    from jointplay.scenario.robot import robot_scenario

    robot = jp.Mechanism(jp.shipped("scara.urdf"))
    with pytest.raises(jp.JointplayError, match="measured must be a Measurement or"):
        identify(robot, wrong)
    with pytest.raises(jp.JointplayError, match="a setting must be a Setting"):
        robot_scenario("scara", ["joint_b"], [wrong])
