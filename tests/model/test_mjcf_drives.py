"""Drives that an MJCF has, beside MuJoCo itself; and what is said of those that are not read."""

import numpy as np
import pytest
from scipy.optimize import brentq

import jointplay as jp
from jointplay.base.errors import JointplayError
from jointplay.cli import main
from jointplay.model.formats import read
from jointplay.scenario import Scenario
from jointplay.scenario.reading import Setting
from jointplay.scenario.robot import robot_scenario

pytestmark = pytest.mark.needs("mujoco")

ARM = """<mujoco model="arm"><compiler angle="radian"/>
<option gravity="0 0 {gravity}" integrator="implicitfast"/>
<default><geom type="capsule" size="0.02" contype="0" conaffinity="0"/></default>
<worldbody><body name="a"><joint name="j" axis="0 1 0" {j}/><geom fromto="0 0 0 .3 0 0" mass="1"/>
<body name="b" pos=".3 0 0"><joint name="k" {k}/><geom fromto="0 0 0 .2 0 0" mass=".5"/></body>
</body></worldbody><actuator>{drives}</actuator></mujoco>"""
TURNS = 'axis="0 1 0"'
FIRM = '<position joint="k" kp="50" kv="2"/>'
GENERAL = '<general joint="j" gainprm="100" biastype="affine" biasprm="0 -200 -15" {}/>'
STEP_S = 5e-6


def one(words):
    return f'<position joint="j" {words}/>'


DRIVES = {
    "a limit of force": (0, "", TURNS, one('kp="200" kv="20" forcerange="-20 20"') + FIRM),
    "one far below kv": (0, "", TURNS, one('kp="4500" kv="450" forcerange="-87 87"') + FIRM),
    "two on a joint": (-9.81, 'damping="2"', TURNS, one('kp="50"') + one('kp="70"') + FIRM),
    "a range of control": (0, "", TURNS, one('kp="200" kv="20" ctrlrange="-0.3 0.5"') + FIRM),
    "a gear": (-1.62, "", TURNS, one('kp="2" kv=".3" gear="10" forcerange="-1 1"') + FIRM),
    "a limit of the joint": (0, 'actuatorfrcrange="-9 9"', TURNS, one('kp="200" kv="5"') + FIRM),
    "critical damping": (0, "", TURNS, one('kp="300" dampratio="1" forcerange="-25 25"') + FIRM),
    "a general one": (-9.81, 'stiffness="3"', TURNS, GENERAL.format('forcerange="-30 30"') + FIRM),
    "a slide": (
        0, "", 'type="slide" axis="1 0 0"',
        one('kp="200" kv="20"') + '<position joint="k" kp="900" kv="60" forcerange="-50 50"/>',
    ),
    "none on the second": (
        -9.81, "", TURNS + ' damping=".02" stiffness=".5"', one('kp="90" kv="9"'),
    ),
    "an armature": (0, 'armature="0.05"', TURNS, one('kp="200" kv="20" forcerange="-9 9"') + FIRM),
}  # fmt: skip


def written(folder, gravity, j, k, drives):
    path = folder / "arm.xml"
    path.write_text(ARM.format(gravity=gravity, j=j, k=k, drives=drives))
    return path


def off_beside_mujoco(path, goals, ideal=True, play=()):
    """Largest difference from MuJoCo by joint, whose links have the hinges of `play`, too [rad]."""
    import mujoco

    settings = [
        Setting(("motion",), {"times": [0.0, 0.02, 0.4], "joints": goals}, "test"),
        Setting(("integration", "duration"), 0.4, "test"),
        Setting(("integration", "step"), STEP_S, "test"),
    ]
    simulation = robot_scenario(str(path), ideal=ideal, settings=settings).simulation()
    result = simulation.run(estimate=False)["q"]
    model = mujoco.MjModel.from_xml_path(str(path))
    model.opt.timestep = STEP_S
    data = mujoco.MjData(model)
    steps = round(0.4 / STEP_S)
    reference = simulation.motion((np.arange(steps) + 0.5) * STEP_S)[0]
    names = [model.joint(int(i)).name for i in model.actuator_trnid[:, 0]]
    columns = [simulation.motion.joints.index(name) for name in names]
    scale = -model.actuator_gear[:, 0] * model.actuator_biasprm[:, 1] / model.actuator_gainprm[:, 0]
    moving = simulation.mechanism.joints
    places = {name: [model.joint(one).qposadr[0] for one in (name, *play)] for name in moving}
    for name, place in places.items():
        motor = result.values[0, simulation.mechanism.motor(name)]
        data.qpos[place] = [motor, *(result.sel(coordinate=name).values[0] - motor for _ in play)]
    positions = [data.qpos.copy()]
    for row in reference:
        data.ctrl[:] = scale * row[columns]
        mujoco.mj_step(model, data)
        positions.append(data.qpos.copy())
    times, off = np.arange(steps + 1) * STEP_S, {}
    for name, place in places.items():
        wanted = np.interp(result.time.values, times, np.array(positions)[:, place].sum(axis=1))
        off[name] = np.abs(result.sel(coordinate=name).values - wanted).max()
    return off


@pytest.mark.thorough
@pytest.mark.parametrize("case", DRIVES)
def test_ten_driven_arms_follow_a_step_as_in_mujoco(tmp_path, case):
    """To 1e-4 of the step."""
    path = written(tmp_path, *DRIVES[case])
    goals = {"j": [0.0, 0.8, 0.8], "k": [0.0, -0.4, -0.4]}
    if 'joint="k"' not in path.read_text():
        del goals["k"]
    off = off_beside_mujoco(path, goals)
    assert off.keys() == {"j", "k"}
    assert max(off.values()) < 1e-4 * 0.8


def test_what_no_actuator_acts_on_is_free_by_each_way_and_said(tmp_path):
    path = written(tmp_path, -1.62, "", TURNS, one('kp="50" kv="5"'))
    said = "no actuator of the MJCF acts on k: free"
    scenario = robot_scenario(str(path), ideal=True)
    assert said in " ".join(scenario.assumptions)
    file = tmp_path / "arm.toml"
    motion = "[motion]\ntimes = [0.0, 0.1]\njoints = { j = [0.0, 0.1] }\n"
    file.write_text(f'[robot]\nurdf = "arm.xml"\n{motion}[gears.j]\nplay = 0.01\n')
    motion = jp.Motion(["j"], [0.0, 0.1], [[0.0], [0.1]])
    for simulation in (
        scenario.simulation(),
        Scenario.load(file).simulation(),
        jp.Simulation(jp.Mechanism(path), motion),
    ):
        assert {name: one.kind for name, one in simulation.drive.items()}.get("k", "free") == "free"
        assert simulation.motion.joints == ("j",)
    assert main(["check", str(path)]) == 0


@pytest.mark.parametrize(
    ("drives", "free"),
    [
        ('<motor joint="j"/>', ["k"]),
        ("", []),
        ('<position tendon="t" kp="3"/><motor joint="j"/>', []),
        ('<motor site="s" gear="0 0 1 0 0 0"/>', []),
    ],
)
def test_motors_tendons_and_sites_act_too(tmp_path, drives, free):
    path = written(tmp_path, 0, "", TURNS, drives)
    tendon = '<tendon><fixed name="t"><joint joint="k" coef="2"/></fixed></tendon><actuator>'
    text = path.read_text().replace("<actuator>", tendon)
    path.write_text(
        text.replace("</body>\n</body>", '<site name="s" pos=".2 .1 0"/></body></body>')
    )
    beyond = read(path).beyond
    assert list(beyond.tables.get("drives", {})) == free
    assert ("the MJCF has no actuators" in " ".join(beyond.notes)) == (not drives)


LOOSE = """<mujoco model="loose"><compiler angle="radian"/><option integrator="implicitfast"/>
<worldbody><body name="m"><joint name="j" axis="0 1 0" armature="0.05" damping="0.1"/>
<joint name="j_play" axis="0 1 0"/>
<geom type="capsule" fromto="0 0 0 .3 0 0" size=".02" mass="1" contype="0" conaffinity="0"/></body>
</worldbody><tendon><fixed springlength="-.01 .01" stiffness="2000"><joint joint="j_play" coef="1"/>
</fixed></tendon><actuator><position joint="j" kp="200" kv="20" forcerange="-20 20"/></actuator>
</mujoco>"""


def test_a_driven_link_with_play_follows_a_step_as_in_mujoco(tmp_path):
    path = tmp_path / "loose.xml"
    path.write_text(LOOSE)
    off = off_beside_mujoco(path, {"j": [0.0, 0.8, 0.8]}, ideal=False, play=("j_play",))
    assert off["j"] < 1e-4 * 0.8


@pytest.mark.parametrize(
    ("drive", "words"),
    [
        ('<intvelocity joint="j" kp="5" actrange="-1 1"/>', "with a state"),
        (one('kp="5" timeconst="0.1"'), "with a state"),
        (GENERAL.format("").replace('"0 -200', '"3 -200'), "with a constant bias"),
        (one('kp="5"') + one('kp="6" forcerange="-1 1"'), "several actuators with limits"),
        ('<motor joint="j"/>', "without position gains"),
        ('<velocity joint="j" kv="3"/>', "without position gains"),
    ],
)
def test_drives_that_are_not_read_are_named(tmp_path, drive, words):
    beyond = read(written(tmp_path, 0, "", TURNS, drive + FIRM)).beyond
    assert list(beyond.tables["drives"]) == ["k"]
    assert words in beyond.notes[-1]
    assert "actuator 1" in beyond.notes[-1]


def test_two_drives_of_a_joint_add_up(tmp_path):
    beyond = read(written(tmp_path, 0, "", TURNS, one('kp="50"') + one('kp="70"'))).beyond
    assert beyond.tables["drives"]["j"]["p_gain"] == 120.0


def test_an_uneven_limit_of_force_is_said(tmp_path):
    path = written(tmp_path, 0, "", TURNS, one('kp="50" forcerange="-5 20"'))
    assert "here to 5 both ways" in " ".join(read(path).beyond.notes)
    path = written(tmp_path, 0, "", TURNS, one('kp="50" forcerange="0 20"'))
    with pytest.raises(JointplayError, match="drive of 'j' no force one way"):
        read(path)


def test_what_a_ball_has_besides_freedom_is_named(tmp_path):
    ball = 'type="ball" damping="1" stiffness="2" range="0 1" armature="0.1"'
    note = read(written(tmp_path, 0, "", ball, "")).beyond.notes[-1]
    for what in ("armature", "damping", "springs", "limits"):
        assert f"{what} of balls" in note
    assert "slides" not in note


@pytest.mark.parametrize("words", ['range="nan 90"', 'pos="nan 0 0"', 'armature="1e300"'])
def test_numbers_that_are_none_are_refused(tmp_path, words):
    path = written(tmp_path, 0, words, TURNS, FIRM)
    with pytest.raises(JointplayError, match="not finite"):
        read(path)


def test_a_range_the_wrong_way_round_is_said(tmp_path):
    notes = read(written(tmp_path, 0, 'range="1 -1"', TURNS, FIRM)).beyond.notes
    assert "note: a range from above to below is none in MuJoCo: j" in notes


def test_a_servo_without_play_is_run_for_its_sag(tmp_path, capsys):
    """kp (target - q) = m g l sin q where it comes to rest."""
    path, motion = tmp_path / "arm.xml", tmp_path / "hold.csv"
    path.write_text(
        '<mujoco><compiler angle="radian"/><worldbody><body><joint name="j" axis="0 -1 0" '
        'damping="2"/><inertial pos="0 0 -0.4" mass="3.5" diaginertia="0.02 0.02 0.002"/>'
        '<site name="hand" pos="0 0 -0.4"/></body></worldbody>'
        '<actuator><position joint="j" kp="20" kv="2.75"/></actuator></mujoco>'
    )
    motion.write_text("time_s,j\n0,0\n1,0.8\n4,0.8\n")
    command = ["run", str(path), "--tool", "hand", "--motion", str(motion), "--quiet"]
    assert main([*command, "--no-figures", "--out", str(tmp_path / "out")]) == 0
    assert "from where it was sent" in capsys.readouterr().out
    rests = brentq(lambda q: 20.0 * (0.8 - q) - 3.5 * 9.81 * 0.4 * np.sin(q), 0.0, 0.8)
    result = jp.Result.load(tmp_path / "out" / "result.nc")
    assert float(result["q"].values[-1, 0]) == pytest.approx(rests, abs=1e-4)
