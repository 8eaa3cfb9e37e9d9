"""Worn bores, and Archard's law by hand."""

import dataclasses

import numpy as np
import pytest
from conftest import body, joint
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import brentq

import jointplay as jp
from jointplay import geometry
from jointplay.cli import main
from jointplay.study.wear import ground, wear, worn_depth

RI, RJ, HALF = 10e-3, 9.8e-3, 15e-3
N = 72
angles = st.floats(0.0, 2.0 * np.pi)


def turned(tilt, towards):
    """Orientation of a journal whose axis leans by `tilt` towards an azimuth."""
    c, s = np.cos(towards), np.sin(towards)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])
    lean = np.array([[np.cos(tilt), 0, np.sin(tilt)], [0, 1, 0], [-np.sin(tilt), 0, np.cos(tilt)]])
    return turn @ lean


def worn(profile_a, profile_b=None):
    second = profile_a if profile_b is None else profile_b
    profiles = (*geometry.worn_bore(profile_a), *geometry.worn_bore(second))
    return np.array([RI, RJ, HALF + 2e-4, HALF, *profiles])


def touched(shape, dimensions, k, centre, turn):
    return np.array(geometry.touch(int(shape), dimensions, 0, k, *centre, turn.ravel(), 0))


@given(reach=st.floats(0.0, 2.2e-4), at=angles, tilt=st.floats(0, 1.5e-2), towards=angles)
def test_evenly_worn_bore_is_a_wider_one(reach, at, tilt, towards):
    centre = np.array([reach * np.cos(at), reach * np.sin(at), 3e-5])
    turn, depth = turned(tilt, towards), 4e-5
    wide = np.array([RI + depth, RJ, HALF + 2e-4, HALF])
    for k in range(4):
        found = touched(geometry.Shape.WORN_CYLINDER, worn(np.full(N, depth)), k, centre, turn)
        plain = touched(geometry.Shape.CYLINDER, wide, k, centre, turn)
        assert found[0] == pytest.approx(plain[0], abs=1e-13)
        if reach > 1e-5 and tilt < 1e-4:  # otherwise several places are equally deep
            assert found[1:] == pytest.approx(plain[1:], abs=1e-6)


def groove(depth, at, width):
    azimuths = 2 * np.pi * np.arange(N) / N
    away = np.angle(np.exp(1j * (azimuths - at)))
    return depth * np.exp(-((away / width) ** 2))


def rubbing(urdf, spin, *, wear_rate=1e-13, gravity=9.81, duration=0.2, mass=2.0, **fields):
    """A heavy body whose journal turns in one place of its bore, driven steadily."""
    play = {"radial_clearance": 1e-4, "friction": jp.contact.Ambrosio(0.05)} | fields
    bearing = jp.RevoluteClearance.planar(**play, wear_rate=wear_rate)
    path = urdf(body("arm", mass), joint("pin", "base", "arm"))
    robot = jp.Mechanism(path, {"pin": bearing}, gravity=(0, -gravity, 0))
    motion = jp.Motion(["pin"], [0, duration], [[0], [duration * spin]], "constant-speed")
    return jp.Simulation(robot, motion, drive=jp.loads.ComputedTorque(300.0), joint_friction={})


def settled(simulation):
    """The run with the journal starting at the bottom: from the centre it would keep swinging."""
    run = jp.Run(simulation)
    run.workspace.q[1] = -1e-4
    return run.finish()


def test_worn_volume_is_archards_by_hand(urdf):
    """V = k F s for the constant load m g and the sliding distance R_j w t."""
    simulation = rubbing(urdf, 30.0)
    result = settled(simulation)
    bearing = simulation.mechanism.clearance["pin"]
    depth = worn_depth(result, "pin")
    area = bearing.ri * 2 * np.pi / depth.shape[1] * bearing.lj
    way = bearing.rj * 30.0 * 0.2
    assert depth.sum() * area == pytest.approx(1e-13 * 2.0 * 9.81 * way, rel=0.01)
    # At the bottom of the bore, ahead by the friction angle against the direction of turning.
    azimuths = result["azimuth"].values
    place = np.angle((depth[0] * np.exp(1j * azimuths)).sum())
    assert place == pytest.approx(-np.pi / 2 - np.arctan(0.05), abs=5e-3)
    assert not depth[0][np.sin(azimuths) > 0].any()
    half = settled(rubbing(urdf, 15.0))
    assert worn_depth(half, "pin").sum() == pytest.approx(depth.sum() / 2, rel=0.02)


def test_worn_bore_is_what_the_next_run_meets(urdf):
    profile = groove(3e-5, -np.pi / 2, 1.0)
    deep = rubbing(urdf, 0.0, worn=profile, friction=jp.contact.Ambrosio(0.0), duration=0.5)
    sunk = deep.run()["journal_centre"].values[-1, 0, 1]
    plain = rubbing(urdf, 0.0, friction=jp.contact.Ambrosio(0.0), duration=0.5)
    level = plain.run()["journal_centre"].values[-1, 0, 1]
    assert level - sunk == pytest.approx(profile.max(), rel=0.05)


def test_energy_balances_in_a_worn_bore(urdf):
    profile = groove(2e-5, 0.7, 1.0) + groove(1e-5, 3.0, 0.8)
    bearing = jp.RevoluteClearance(
        radial_clearance=1e-4, axial_clearance=1e-4, restitution=1.0, normal=jp.contact.Hertz(),
        friction=jp.contact.Ambrosio(0.0), worn=profile,
    )  # fmt: skip
    path = urdf(body("arm", com="0.03 0.02 0.01"), joint("pin", "base", "arm"))
    robot = jp.Mechanism(path, {"pin": bearing}, gravity=(0, 0, 0))
    residuals = []
    for step in (4e-6, 1e-6):
        run = jp.Run(
            jp.Simulation(
                robot, duration=10e-3, step=step, integrator="rk4", drive={}, joint_friction={}
            )
        )
        run.workspace.v[:] = 0.25, -0.15, 0.2, 2.0, 3.0, -2.0
        result = run.finish()
        assert result.audit.impacts > 4
        residuals.append(result.audit.energy_residual / result["kinetic_energy"].values[0])
    assert residuals[1] < 1e-4
    assert residuals[1] < 0.2 * residuals[0]


def sickle(volume, bearing):
    """Depth to which a round journal grinds itself into its bore, in closed form [m]."""
    c = bearing.cr

    def left(depth):
        half = np.arccos(c / (c + depth))
        return 2 * bearing.ri * bearing.lj * ((c + depth) * np.sin(half) - c * half) - volume

    return brentq(left, 1e-9, 1e-3)


@pytest.mark.parametrize("blocks", [1, 5])
def test_worn_bore_after_cycles_is_archards_by_hand(urdf, blocks):
    """Constant load and sliding distance: the volume is k F s, its shape the journal's sickle."""
    simulation = rubbing(urdf, 30.0, duration=0.1, friction=jp.contact.Ambrosio(0.0))
    cycles = 21400
    life = wear(simulation, "pin", cycles=cycles, blocks=blocks)
    assert life.reached
    assert life.cycles[-1] == pytest.approx(cycles)
    bearing = simulation.mechanism.clearance["pin"]
    volume = 1e-13 * 2.0 * 9.81 * bearing.rj * 30.0 * 0.1 * cycles
    area = bearing.ri * 2 * np.pi / life.profiles.shape[-1] * bearing.lj
    assert life.profiles[-1].sum() * area == pytest.approx(volume, rel=2e-3)
    assert life.deepest[-1] == pytest.approx(sickle(volume, bearing), rel=0.03)
    assert not life.journal.any()
    assert "After 21400 cycles the clearance of 'pin' has grown by" in str(life)


def test_life_is_when_the_sickle_is_so_deep(urdf):
    """The depth grows ever more slowly, as the sickle widens."""
    growth = 2e-5
    simulation = rubbing(urdf, 30.0, duration=0.1, friction=jp.contact.Ambrosio(0.0))
    life = wear(simulation, "pin", growth, blocks=4)
    assert life.reached
    assert life.deepest == pytest.approx(growth * np.arange(5) / 4)
    bearing = simulation.mechanism.clearance["pin"]
    volume = 1e-13 * 2.0 * 9.81 * bearing.rj * 3.0 * life.cycles
    found = [sickle(one, bearing) for one in volume[1:]]
    assert found == pytest.approx(life.deepest[1:], rel=0.03)
    assert "estimate" in str(life)
    assert f"{life.cycles[-1]:.3g}" in str(life)


def test_a_turning_journal_wears_evenly_all_around(urdf):
    """Bore and journal wear by their own rates; the journal's whole turns spread what it loses."""
    turn = 2 * np.pi / 30.0
    simulation = rubbing(
        urdf, 30.0, wear_rate=1e-13, journal_wear_rate=3e-13, duration=turn,
        friction=jp.contact.Ambrosio(0.0),
    )  # fmt: skip
    life = wear(simulation, "pin", cycles=20000, blocks=2)
    bearing = simulation.mechanism.clearance["pin"]
    work = 2.0 * 9.81 * bearing.rj * 2 * np.pi * 20000
    node = 2 * np.pi / life.profiles.shape[-1] * bearing.lj
    bore, journal = life.profiles[-1, :, 0]
    assert bore.sum() * bearing.ri * node == pytest.approx(1e-13 * work, rel=5e-3)
    assert journal.sum() * bearing.rj * node == pytest.approx(3e-13 * work, rel=5e-3)
    assert journal.min() > 0.8 * journal.mean()
    assert life.deepest[-1] == pytest.approx(bore.max() + journal.max())
    assert "; bore " in str(life)
    rows = life.table.csv().splitlines()
    assert [row.split(",")[2] for row in rows[1:3] + rows[-1:]] == ["bore", "bore", "journal"]


def test_a_journal_that_turns_with_its_load_wears_in_one_place(urdf):
    """The bearing turns about a journal that stands: the place is its own, not the bore's."""
    bearing = jp.RevoluteClearance.planar(
        radial_clearance=1e-4, friction=jp.contact.Ambrosio(0.0), wear_rate=1e-13,
        journal_wear_rate=1e-13, exchanged=True,
    )  # fmt: skip
    path = urdf(body("arm", 2.0), joint("pin", "base", "arm"))
    robot = jp.Mechanism(path, {"pin": bearing}, gravity=(0, -9.81, 0))
    turn = 2 * np.pi / 30.0
    motion = jp.Motion(["pin"], [0, turn], [[0], [2 * np.pi]], "constant-speed")
    drive = jp.loads.ComputedTorque(300.0)
    result = jp.Simulation(robot, motion, drive=drive, joint_friction={}).run()
    bore, journal = (worn_depth(result, "pin", part)[0] for part in ("bore", "journal"))
    assert bore.min() > 0.5 * bore.mean()
    worn_at = np.angle((journal * np.exp(1j * result["azimuth"].values)).sum())
    assert worn_at == pytest.approx(np.pi / 2, abs=0.02)  # the bore hangs on the journal's top
    assert np.count_nonzero(journal > 1e-3 * journal.max()) <= 4
    with pytest.raises(jp.JointplayError, match="bore, journal"):
        worn_depth(result, "pin", "ball")


@given(at=st.integers(0, N - 1), volume=st.floats(1e-8, 1e-3), before=st.floats(0, 3e-5))
def test_what_is_ground_off_is_found_in_the_profile(at, volume, before):
    start = groove(before, 1.0, 0.5)
    share = np.zeros(N)
    share[at], share[(at + 3) % N] = volume, 0.3 * volume
    after = ground(start, share, 1e-4)
    assert after.sum() - start.sum() == pytest.approx(1.3 * volume)
    assert (after >= start).all()


def test_scatter_of_perturbed_runs_is_reported(urdf):
    life = wear(rubbing(urdf, 30.0, duration=0.02), "pin", 1e-6, blocks=1, runs=2)
    assert 0.0 <= life.scatter[1] < 1.0
    assert "+-" in str(life)


def test_interrupted_life_keeps_what_is_known(urdf, monkeypatch):
    import jointplay.simulation.run as module

    simulation, calls, original = rubbing(urdf, 30.0, duration=0.05), [], module.Run.finish

    def finish(self, progress=False, *options):
        calls.append(1)
        if len(calls) == 3:
            raise KeyboardInterrupt
        return original(self, progress)

    monkeypatch.setattr(module.Run, "finish", finish)
    life = wear(simulation, "pin", 1e-6, blocks=5)
    assert not life.reached
    assert len(life.cycles) == 3
    assert "Interrupted: after about" in str(life)
    assert "by 2 blocks of equal cycles" in str(life)


def test_wear_survives_a_result_file(urdf, tmp_path):
    profile = groove(1e-5, 1.0, 0.5)
    result = rubbing(urdf, 30.0, duration=0.02, worn=profile).run()
    again = jp.Result.load(result.save(tmp_path / "r.nc"))
    assert worn_depth(again, "pin") == pytest.approx(worn_depth(result, "pin"))
    assert again.simulation.mechanism.clearance["pin"].worn[0] == pytest.approx(profile)


@pytest.mark.parametrize(
    ("fields", "text"),
    [
        ({"worn": [1e-5] * 5}, "azimuths"),
        ({"worn": [-1e-5] * 20}, "depths >= 0"),
        ({"worn": [[1e-5] * 20] * 3}, "shape"),
        ({"worn": "deep"}, "expected a list"),
        ({"worn": [5e-3] * 20}, "tenth"),
        ({"worn": [1e-5] * 20, "lubricant": jp.contact.ShortBearing(0.1)}, "round bores"),
        ({"wear_rate": 0.0}, "wear rate"),
        ({"journal_wear_rate": -1.0}, "wear rate of the journal"),
    ],
)
def test_wrong_values_are_named(fields, text):
    with pytest.raises(jp.JointplayError, match=text):
        jp.RevoluteClearance.planar(radial_clearance=1e-4, **fields)


def test_wrong_questions_are_answered(urdf):
    simulation = rubbing(urdf, 30.0, duration=0.01)
    still = dataclasses.replace(rubbing(urdf, 0.0, gravity=0.0, duration=0.01), seed=None)
    for machine, name, growth, more, text in (
        (simulation, "elbow", 1e-5, {}, "pin"),
        (simulation, "pin", -1.0, {}, "growth"),
        (simulation, "pin", float("nan"), {}, "growth"),
        (simulation, "pin", 1e-5, {"blocks": 0}, "blocks"),
        (simulation, "pin", 1e-5, {"cycles": 10}, "either"),
        (simulation, "pin", None, {}, "either"),
        (simulation, "pin", None, {"cycles": -1}, "cycles"),
        (still, "pin", 1e-5, {}, "does not slide"),
        (
            rubbing(urdf, 30.0, wear_rate=None),
            "pin",
            1e-5,
            {},
            r"give --set 'joints.pin.wear_rate=",
        ),
    ):
        with pytest.raises(jp.JointplayError, match=text):
            wear(machine, name, growth, **more)


SCENARIO = """
[robot]
urdf = "robot.urdf"
gravity = [0, "-9.81 m/s^2", 0]
[joints.pin]
kind = "planar"
radial_clearance = "0.1 mm"
wear_rate = "1e-4 mm^3/(N*m)"
[motion]
times = [0, "50 ms"]
interpolation = "constant-speed"
[motion.joints]
pin = [0, "1.5 rad"]
"""


def test_command_takes_the_clearance_with_the_joint(capsys):
    command = ["study", "wear", "scara", "--quiet", "--jobs", "1", "--cycles", "1e5"]
    command += ["--blocks", "1", "--joint"]
    assert main([*command, "joint_b"]) == 2
    said = capsys.readouterr().err
    assert "nothing has play: give --set 'joints.NAME.radial_clearance" in said
    assert main([*command, "joint_b=0.1mm"]) == 2
    assert "joint 'joint_b' has no wear rate: give --set" in capsys.readouterr().err
    rate = ["--set", "joints.joint_b.wear_rate=1e-14", "--set", "integration.duration=0.05"]
    assert main([*command, "joint_b=0.1mm", *rate]) == 0
    assert "After 100000 cycles the clearance of 'joint_b' has grown" in capsys.readouterr().out


def test_command_estimates_and_writes(urdf, tmp_path, monkeypatch, capsys):
    urdf(body("arm"), joint("pin", "base", "arm"))
    (tmp_path / "s.toml").write_text(SCENARIO)
    monkeypatch.chdir(tmp_path)
    command = ["study", "wear", "s.toml", "--joint", "pin", "--quiet", "--jobs", "1", "--growth"]
    assert main([*command, "2 um", "--blocks", "2", "--out", "life.csv"]) == 0
    assert "an estimate" in capsys.readouterr().out
    rows = (tmp_path / "life.csv").read_text().splitlines()
    assert rows[0] == "block,cycles,part,end,azimuth_rad,depth_m"
    assert len(rows) == 1 + 3 * 72
    assert max(float(row.split(",")[5]) for row in rows[1:]) == pytest.approx(2e-6)
    assert main([*command[:-1], "--cycles", "21400", "--blocks", "2"]) == 0
    assert "After 21400 cycles the clearance of 'pin' has grown by" in capsys.readouterr().out
    for more, text in ((("2 um", "--out", "life.csv"), "life.csv"), (("0",), "growth")):
        assert main([*command, *more]) == 2
        assert text in capsys.readouterr().err
