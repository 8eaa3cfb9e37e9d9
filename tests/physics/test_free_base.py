"""Robots whose base is held by nothing: momentum, energy, tumbling, drives, loads."""

import numpy as np
import pinocchio as pin
import pytest
from conftest import body, joint

from jointplay import (
    JointplayError,
    Mechanism,
    Motion,
    Result,
    RevoluteClearance,
    Simulation,
    analysis,
    nonlinear,
)
from jointplay.accuracy.error_budget import budget
from jointplay.accuracy.jacobians import displaced_configuration, tool_place
from jointplay.base.errors import MissingName
from jointplay.bridges.trajectory import joint_trajectory
from jointplay.cli import main
from jointplay.model import free_base
from jointplay.model.loop import Loop
from jointplay.model.payload import Payload
from jointplay.physics.joints import Coordinate
from jointplay.simulation import Run
from jointplay.simulation.loads import Wrench
from jointplay.simulation.loads.drive import Prescribed, Torque
from jointplay.simulation.motion.ideal import IdealMotion
from jointplay.simulation.motion.reference import REFERENCE_NODE_S
from jointplay.study.nonlinear.lyapunov import stretching

BASE = body("base", 2.0, "0.01 0.02 -0.01", 2e-2)
LOOSE = {"hip": RevoluteClearance(radial_clearance=2e-4)}
TUMBLING = {"base.pitch": (0.1, 25.0), "base.yaw": (0.3, 6.0), "base.roll": (0.0, -9.0)}


@pytest.fixture
def walker(urdf):
    """A body with a leg of two links and a tail, about different axes."""

    def make(clearance=None, base="free", gravity="balanced", root=BASE, **more):
        path = urdf(
            body("thigh", 0.8, "0 0 -0.1", 5e-3),
            body("shank", 0.4, "0 0 -0.1", 2e-3),
            body("tail", 0.5, "0.1 0 0", 3e-3),
            joint("hip", "base", "thigh", axis="0 1 0", at="0.1 0.05 0"),
            joint("knee", "thigh", "shank", axis="0 1 0", at="0 0 -0.2"),
            joint("wag", "base", "tail", at="-0.1 0 0"),
            base=root,
        )
        return Mechanism(path, clearance, base=base, gravity=gravity, **more)

    return make


def swing(duration=0.2):
    """There and back in all joints."""
    there, still = [0.8, -0.6, 0.5], [0.0, 0.0, 0.0]
    times = [0.0, duration / 2, duration]
    return Motion(["hip", "knee", "wag"], times, [still, there, still])


def momenta(result):
    """Linear, and angular about the centre of mass; that centre: (n, 3) each."""
    mechanism, found = result.simulation.mechanism, []
    data = mechanism.model.createData()
    for q, v in zip(result.q, result.v, strict=True):
        pin.ccrba(mechanism.model, data, q, v)
        found.append([data.hg.linear.copy(), data.hg.angular.copy(), data.com[0].copy()])
    return np.moveaxis(np.array(found), 1, 0)


def run(mechanism, motion=None, **more):
    """A run by equal steps, its own error not looked for."""
    given = {"step": 1e-5, "record_every": 10} | more
    return Simulation(mechanism, motion, **given).run(estimate=False, check_step=False)


@pytest.mark.parametrize(
    "state", [{}, pytest.param(TUMBLING | {"base.x": (0.0, 0.4)}, marks=pytest.mark.thorough)]
)
def test_momentum_is_kept_whatever_bearings_and_drives_do_within(walker, state):
    result = run(walker(LOOSE), swing(), state=state, integrator="rk4", step=5e-6)
    linear, angular, centre = momenta(result)
    assert len(result["normal_force_peak"].values) > 1000
    assert np.nanmax(result["normal_force_peak"].values) > 1.0, "the journal touches its bearing"
    assert np.nanmax(np.abs(result["friction_force"].values)) > 1e-2
    # Of what the limbs have against each other, some 0.1 kg m/s and 0.01 kg m^2/s.
    assert np.abs(linear - linear[0]).max() < 1e-9
    assert np.abs(angular - angular[0]).max() < 1e-9
    mean = linear[0] / pin.computeTotalMass(result.simulation.mechanism.model)
    assert np.abs(centre - centre[0] - np.outer(result.time, mean)).max() < 1e-9
    dissipated = result["kinetic_energy"].values.max()
    assert np.abs(result["energy_residual"].values).max() < 1e-4 * dissipated


def test_momentum_of_the_multi_rate_method_is_kept_better_with_shorter_macro_steps(walker):
    drifts = []
    for macro in (2e-4, 5e-5):
        result = run(walker(), swing(), state=TUMBLING, macro_step=macro)
        linear, angular, _ = momenta(result)
        drifts.append([np.abs(one - one[0]).max() for one in (linear, angular)])
    assert np.all(np.array(drifts) < 1e-4)
    assert np.all(np.array(drifts[1]) < 0.5 * np.array(drifts[0]))


def test_centre_of_mass_falls_along_a_parabola(walker):
    mechanism = walker(LOOSE, gravity="loaded")
    start = {"base.x": (0.0, 0.5), "base.z": (0.2, 1.0)}
    result = run(mechanism, swing(), state=start, integrator="rk4", step=5e-6)
    linear, angular, centre = momenta(result)
    time, mass = result.time[:, None], pin.computeTotalMass(mechanism.model)
    falling = centre[0] + time * linear[0] / mass + 0.5 * time**2 * np.array(mechanism.gravity)
    assert np.abs(centre - falling).max() < 1e-9
    assert np.abs(angular - angular[0]).max() < 1e-9
    assert "falls" in str(mechanism)


def free_flyer(mechanism, torques, state, duration, step=1e-4):
    """Orientation, position and joints of the ideal robot as a Pinocchio free-flyer moves it."""
    source = pin.buildModelFromUrdf(str(mechanism.description.path), pin.JointModelFreeFlyer())
    source.gravity.linear = np.array(mechanism.gravity)
    data = source.createData()
    angles = np.array([state[f"base.{part}"] for part in ("yaw", "pitch", "roll")])
    q, v = pin.neutral(source), np.zeros(source.nv)
    q[3:7] = pin.Quaternion(free_base.rotation(angles[:, 0])).coeffs()
    v[3:6] = free_base.turning(angles[:, 0], angles[:, 1])
    effort = np.concatenate([np.zeros(6), torques])

    def rate(dq, v):
        return v, pin.aba(source, data, pin.integrate(source, q, dq), v, effort)

    for _ in range(round(duration / step)):  # the midpoint rule, on the manifold
        a = rate(np.zeros(source.nv), v)[1]
        middle = v + 0.5 * step * a
        a = rate(0.5 * step * v, middle)[1]
        q, v = pin.integrate(source, q, step * middle), v + step * a
    return pin.Quaternion(q[3:7]).matrix(), q[:3], q[7:]


@pytest.mark.parametrize("more", [{"integrator": "rk4", "step": 5e-5}, {}, {"tolerance": 1e-4}])
def test_tumbling_robot_moves_as_one_on_a_free_flyer(walker, more):
    """Over several turns about all axes, through every pitch."""
    mechanism, torques = walker(gravity="loaded"), [0.3, -0.2, 0.1]
    drives = {
        name: Torque((0.0,), (torque,))
        for name, torque in zip(swing().joints, torques, strict=True)
    }
    given = {"drive": drives, "state": TUMBLING, "duration": 0.4, "record_every": 20}
    result = run(mechanism, **given | more)
    turn, position, joints = free_flyer(mechanism, torques, TUMBLING, 0.4)
    last = result.q[-1]
    assert np.abs(free_base.rotation(last[3:6]) - turn).max() < 1e-3
    assert np.abs(last[:3] - position).max() < 1e-4
    assert np.abs(last[6:] - joints).max() < 1e-3
    assert np.abs(result.q[:, 4]).max() > 1.5, "it has gone past a right angle"
    turns = np.abs(np.diff(free_base.rotation(result.q[:, 3:6]), axis=0)).max()
    assert turns < 60.0 * np.diff(result.time).max(), "no record jumps"
    energy = result["kinetic_energy"].values
    assert np.abs(np.diff(energy)).max() < 0.02 * energy.max()
    assert np.abs(result["energy_residual"].values).max() < 1e-4 * energy.max()


def test_body_that_turns_about_one_axis_keeps_its_chart(walker, monkeypatch):
    replaced = []
    kept = free_base.chart_for
    monkeypatch.setattr(
        "jointplay.simulation.base_chart.chart_for",
        lambda *given: replaced.append(given) or kept(*given),
    )
    mechanism = walker()
    lock = {name: Prescribed() for name in swing().joints}
    still = Motion(list(lock), [0.0, 0.2], [[0.0] * 3] * 2)
    run(mechanism, still, drive=lock, state={"base.pitch": (0.0, 60.0)}, step=2e-5)
    assert 1 <= len(replaced) <= 3, "twelve radians about the pitch"


def test_checkpoint_amid_tumbling_continues_bit_for_bit(walker, tmp_path):
    given = {"state": TUMBLING, "step": 1e-5, "record_every": 10}
    simulation = Simulation(walker(LOOSE), swing(), **given)
    whole = Run(simulation).finish(check_step=False)
    first = Run(simulation)
    for moment in first.steps(0.01):
        if moment.time > 0.1:
            row = np.searchsorted(whole.time, moment.time - 1e-9)
            assert np.abs(whole.q[row] - moment.q).max() < 0.01, "angles are those of the records"
            break
    again = Simulation.resume(first.checkpoint(tmp_path / "run.checkpoint")).finish()
    assert np.array_equal(again.q, whole.q)
    assert np.array_equal(again.v, whole.v)


@pytest.mark.thorough
def test_records_on_disk_are_those_in_memory(walker, tmp_path, monkeypatch):
    simulation = Simulation(walker(LOOSE), swing(), state=TUMBLING, duration=0.03, record_every=1)
    whole = simulation.run(estimate=False, check_step=False)
    monkeypatch.setattr("jointplay.simulation.spool.MOST_BYTES", 1 << 16)
    monkeypatch.setattr("jointplay.simulation.spool.RECORD_BYTES", 1 << 16)
    disk = simulation.run_to(tmp_path / "run.nc")
    assert np.array_equal(disk["q"].values, whole.q)
    assert np.array_equal(disk["v"].values, whole.v)


@pytest.mark.parametrize("state", [pytest.param({}, marks=pytest.mark.thorough), TUMBLING])
def test_drives_follow_the_motion_though_the_base_gives_way(walker, state):
    result = run(walker(gravity="loaded"), swing(), state=state, integrator="rk4", step=5e-5)
    wanted = swing()(result.time)[0]
    assert np.abs(result.q[:, 6:] - wanted).max() < 1e-5
    assert np.abs(result.q[:, :6] - result.q[0, :6]).max() > 0.01, "the base moves"


def test_heavy_base_is_as_good_as_held(walker):
    heavy = body("base", 1e7, "0 0 0", 1e7)
    free = run(walker(LOOSE, root=heavy), swing(), start="centred")
    held = run(walker(LOOSE, base="held", root=heavy), swing(), start="centred")
    assert np.abs(free.q[:, 6:] - held.q).max() < 1e-6
    assert free.q.shape[1] == held.q.shape[1] + 6


def test_reaction_of_the_ground_that_is_given_carries_the_robot(walker):
    mechanism = walker(gravity="loaded")
    model, data = mechanism.model, mechanism.model.createData()
    centre = pin.centerOfMass(model, data, np.zeros(model.nq))
    weight = 9.81 * pin.computeTotalMass(model)
    carry = Wrench("base", at=tuple(centre), force=(0.0, 0.0, weight))
    lock = {name: Prescribed() for name in swing().joints}
    still = Motion(list(lock), [0.0, 0.2], [[0.0] * 3] * 2)
    carried = run(mechanism, still, drive=lock, loads={"ground": carry})
    assert np.abs(carried.q).max() < 1e-9
    assert np.abs(run(mechanism, still, drive=lock).q[-1, 2] + 0.5 * 9.81 * 0.2**2) < 1e-6


@pytest.mark.thorough
def test_payload_that_a_tumbling_robot_picks_brings_its_energy(walker):
    stone = Payload("shank", mass=0.3, pick=0.08, release=0.15)
    result = run(
        walker(LOOSE, gravity="loaded"), swing(), state=TUMBLING, payloads=[stone],
        integrator="rk4", step=5e-6,
    )  # fmt: skip
    linear, _, _ = momenta(result)
    before = result.time < 0.08
    assert np.abs(np.diff(linear[before, 0])).max() < 1e-9
    scale = result["kinetic_energy"].values.max()
    assert np.abs(result["energy_residual"].values).max() < 1e-3 * scale


@pytest.mark.thorough
def test_error_is_seen_from_a_body(walker):
    result = run(walker(LOOSE), swing(), state=TUMBLING)
    ideal = analysis.twin(result)
    seen = analysis.difference(result, ideal, relative_to="thigh").values
    mechanism = result.simulation.mechanism
    frames = [mechanism.model.getFrameId(name) for name in ("thigh", mechanism.tool)]
    row, places = 700, []
    for one in (result, ideal):
        model = one.simulation.mechanism.model
        data = model.createData()
        pin.framesForwardKinematics(model, data, one.q[row])
        thigh, tool = (data.oMf[model.getFrameId(model.frames[i].name)] for i in frames)
        places.append(thigh.actInv(tool).translation)
    assert seen[row] == pytest.approx(places[0] - places[1], abs=1e-12)
    assert np.abs(seen).max() < np.abs(analysis.deviation(result).values).max()
    held = run(walker(LOOSE, base="held"), swing())
    twin = analysis.twin(held)
    for of in analysis.tool_error.TOOL_MOTIONS:
        world = analysis.difference(held, twin, of).values
        assert analysis.difference(held, twin, of, "base").values == pytest.approx(world, abs=1e-12)
    with pytest.raises(MissingName, match=r"no body .leg.; available: .*thigh"):
        analysis.difference(held, twin, relative_to="leg")


def test_two_triples_of_angles_join_without_a_jump():
    angles = np.linspace([0.3, -1.0, 0.2], [0.9, 9.0, -0.5], 400)
    found = free_base.angles_of(free_base.rotation(angles))
    assert found == pytest.approx(angles, abs=1e-9)
    spin = free_base.turning(angles, np.ones_like(angles))
    assert free_base.rates(angles, spin) == pytest.approx(np.ones_like(angles), rel=1e-6)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"base": "loose"}, "no base 'loose'; available: held, free"),
        ({"root": '<link name="base"/>'}, "a free base needs mass.*'base'.* has 0 kg"),
        (
            {"loops": {"pin": Loop("shank", "tail")}},
            "loops cannot have a free base yet.*must be held; loops: pin",
        ),
    ],
)
def test_what_cannot_be_free_is_refused(walker, change, words):
    with pytest.raises(JointplayError, match=words) as error:
        walker(**change)
    assert error.value.where == ("base",)


def test_joint_that_is_called_base_is_refused(urdf):
    path = urdf(body("arm"), joint("base", "base", "arm"), base=BASE)
    Mechanism(path)
    with pytest.raises(JointplayError, match="a joint called 'base'"):
        Mechanism(path, base="free")


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"start": "rest"}, "start 'rest' is for a base that is held"),
        ({"state": {"base.pitch": np.pi / 2}}, "base.pitch = 1.5708 rad is a right angle"),
        ({"state": {"base.yow": 1.0}}, "base.yaw"),
    ],
)
def test_start_that_a_free_base_cannot_have_is_refused(walker, given, words):
    with pytest.raises(JointplayError, match=words):
        Run(Simulation(walker(LOOSE), swing(), **given))


def test_budget_seen_from_a_body_is_that_of_the_joints_between(walker):
    """Twists of the journals, by the kinematics of Pinocchio, at a pose that is nothing special."""
    loose = RevoluteClearance(radial_clearance=1e-4)
    mechanism = walker(dict.fromkeys(("hip", "knee", "wag"), loose), base="held", tool="shank")
    q = mechanism.configuration({"hip": 0.4, "knee": -0.7, "wag": 0.9})
    random = np.random.default_rng(1)
    for seat, still in (("tail", []), ("thigh", ["hip", "wag"]), ("base", ["wag"])):
        found = budget(mechanism, q, relative_to=seat)
        model = found.model
        assert [n for n, m in zip(model.names, model.jacobian, strict=True) if not m.any()] == still
        twists = 1e-7 * random.uniform(-1.0, 1.0, (3, 6))
        aside = dict(zip(model.names, twists, strict=True))
        moved = displaced_configuration(mechanism, q, aside)
        before, after = (tool_place(mechanism, one, seat) for one in (q, moved))
        linear = np.einsum("jik,jk->i", model.jacobian[:, 0], twists)
        assert after.translation - before.translation == pytest.approx(linear[:3], abs=1e-12)
        assert found.positions[0] == pytest.approx(before.translation)
        assert found.relative_to == seat
    world, root = budget(mechanism, q), budget(mechanism, q, relative_to="base")
    assert root.worst == pytest.approx(world.worst)
    assert root.rest_tool == pytest.approx(world.rest_tool)
    with pytest.raises(MissingName, match="no body 'leg'"):
        budget(mechanism, q, relative_to="leg")
    with pytest.raises(JointplayError, match="'shank' is the tool itself"):
        budget(mechanism, q, relative_to="shank")
    with pytest.raises(JointplayError, match="need a base that is held"):
        budget(walker(LOOSE), {})


def test_budget_command_names_the_body(walker, tmp_path, capsys):
    path = str(walker().description.path)
    line = ["budget", path, "--clearance", "0.1 mm", "--tool", "shank", "--relative-to"]
    out = tmp_path / "out"
    assert main([*line, "tail", "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert "seen from 'tail', in its axes" in said
    assert all(name in said for name in ("hip", "knee", "wag"))
    assert sorted(file.name for file in out.iterdir()) == ["bars.png", "budget.csv"]
    assert main([*line, "thigh", "--detail"]) == 0
    assert "play: knee: " in capsys.readouterr().out
    assert main([*line, "leg"]) == 2
    assert "no body 'leg'" in capsys.readouterr().err
    assert main([*line, "thigh", "--whole", "printed"]) == 0
    assert "seen from 'thigh', in its axes" in capsys.readouterr().out


def test_run_command_frees_the_base_and_says_so(walker, tmp_path, capsys):
    path = str(walker().description.path)
    line = ["run", path, "--joint", "hip", "--duration", "0.02", "--no-figures", "--base"]
    out = tmp_path / "out"
    assert main([*line, "free", "--out", str(out)]) == 0
    said = capsys.readouterr()
    assert "the base 'base' is free: nothing holds it, and it falls unless" in said.err
    assert "seen from the free base 'base'" in said.out
    result = Result.load(out / "result.nc")
    assert result.simulation.mechanism.base == "free"
    assert result["coordinate"].values.tolist()[:2] == ["base.x", "base.y"]
    assert result["coordinate_unit"].values.tolist()[:6] == ["m"] * 3 + ["rad"] * 3
    assert np.isclose(result.q[-1, 2], -0.5 * 9.81 * 0.02**2, rtol=0.2)
    assert joint_trajectory(result).joints == ("hip", "knee", "wag")
    assert main([*line, "loose", "--out", str(tmp_path / "other")]) == 2
    assert 'no base "loose"; available: held, free' in capsys.readouterr().err
    page = tmp_path / "report.html"
    assert main(["report", str(out / "result.nc"), "--out", str(page), "--no-pdf"]) == 0
    assert "free: nothing holds it" in page.read_text(encoding="utf-8")
    capsys.readouterr()
    assert main(["robots", path]) == 0
    assert "is held fast, as if bolted to the ground; --base free" in capsys.readouterr().out


@pytest.mark.thorough
def test_player_moves_the_free_base(walker):
    result = run(walker(LOOSE, gravity="loaded"), swing(), state=TUMBLING)
    at = [0, 900, 2000]
    mechanism = result.simulation.mechanism
    shown = mechanism.visualizer()
    for row in at:
        shown.display(result.q[row])
        pin.forwardKinematics(mechanism.model, mechanism.data, result.q[row])
        base = mechanism.data.oMi[mechanism.base_joint]
        turn = free_base.rotation(result.q[row, 3:6])
        assert base.rotation == pytest.approx(turn)
        names = [one.name for one in shown.visual_model.geometryObjects]
        own = next(i for i, name in enumerate(names) if name.startswith("base"))
        parent = shown.visual_model.geometryObjects[own].parentJoint
        assert parent == mechanism.base_joint


def test_free_base_repeats_nothing(walker):
    simulation = Simulation(walker(LOOSE), swing(), step=1e-5)
    with pytest.raises(JointplayError, match="a free base drifts away"):
        nonlinear.Turning.of(simulation, 0, 1)
    with pytest.raises(JointplayError, match="a free base drifts away"):
        stretching(simulation, 1e-3)


@pytest.mark.parametrize("spinning", [False, True])
def test_efforts_are_the_same_whatever_blocks_they_come_in(walker, spinning):
    mechanism, motion = walker(), swing()
    start, speed = np.zeros(mechanism.model.nq), np.zeros(mechanism.model.nv)
    speed[mechanism.coordinates.index(Coordinate("base", "pitch"))] = 3.0 * spinning
    ideal = IdealMotion(mechanism, motion, motion.joints, 0.2, start, speed)
    times = np.arange(41) * REFERENCE_NODE_S
    blocks = [ideal.efforts(part) for part in (times[:1], times[1:20], times[20:40], times[40:])]
    np.testing.assert_allclose(np.concatenate(blocks), ideal.efforts(times), rtol=1e-9)
