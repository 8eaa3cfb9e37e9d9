"""Scenario files: what they mean, and what they refuse."""

import math
import re
import runpy
import tomllib
from pathlib import Path

import numpy as np
import pytest

import jointplay as jp
from jointplay.paper import CASES, CONDITIONS, scara
from jointplay.physics.contact import (
    FILM_LAWS,
    FRICTION_LAWS,
    NORMAL_LAWS,
    CustomBristle,
    Dahl,
    LuGre,
)
from jointplay.physics.joints import JOINT_WORDS
from jointplay.physics.kernel import Status
from jointplay.scenario import Scenario
from jointplay.scenario.reading import lines, merge
from jointplay.scenario.schema import schema
from jointplay.scenario.summary import summary
from jointplay.simulation.loads.drive import DRIVES

DOCS = Path(__file__).parents[2] / "docs"
TEMPLATE = Path(jp.__file__).parent / "scenario" / "template.toml"
SHIPPED = ("scara.toml", "scara_ab.toml", "slider_crank.toml", "four_bar.toml", "gantry.toml")

ARM = """
[robot]
urdf = "jointplay:scara.urdf"
tool = "suction_cup"
gravity = "balanced"
[joints.joint_b]
radial_clearance = "0.2 mm"
axial_clearance = "0.1 mm"
[motion]
times = [0, "1 s"]
[motion.joints]
joint_a = [0, "30 deg"]
joint_b = [0, 1]
stroke = [0, "-50 mm"]
joint_c = [0, 0]
"""


def load(text, path="here/arm.toml"):
    return Scenario(text, path)


def changed(old, new, text=ARM):
    assert old in text
    return text.replace(old, new, 1)


def refusal(text, path="here/arm.toml"):
    def check():
        scenario = load(text, path)
        return [scenario.ready_run(case) for case in scenario.cases]

    with pytest.raises(jp.JointplayError) as refused:
        check()
    message = str(refused.value)
    assert "\n" not in message
    return message


def test_a_scenario_is_what_python_would_build():
    scenario = load(ARM)
    assert scenario.cases == ("arm",)
    bearing = jp.RevoluteClearance(radial_clearance=0.2e-3, axial_clearance=0.1e-3)
    robot = jp.Mechanism(
        jp.shipped("scara.urdf"), {"joint_b": bearing}, gravity=(0, 0, 0), tool="suction_cup"
    )
    joints = ["joint_a", "joint_b", "stroke", "joint_c"]
    motion = jp.Motion(joints, [0, 1], [[0, 0, 0, 0], [math.radians(30), 1, -0.05, 0]])
    assert scenario.simulation().describe() == jp.Simulation(robot, motion).describe()


@pytest.mark.parametrize("clearance", [None, 0.2e-3, 0.5e-3])
@pytest.mark.parametrize("condition", CONDITIONS, ids=str)
def test_the_papers_study_is_its_shipped_scenario(clearance, condition):
    assert clearance in CASES.values()
    printed = condition.variant == "as printed"
    joint = jp.RevoluteClearance(
        radial_clearance=clearance or 1e-3,
        axial_clearance=clearance or 1e-3,
        restitution=0.9,
        normal=jp.contact.LankaraniNikravesh(),
        friction=jp.contact.Ambrosio(mu_d=0.1),
    )
    robot = jp.Mechanism(
        jp.shipped("scara_as_printed.urdf" if printed else "scara.urdf"),
        {"joint_b": joint} if clearance else {},
        gravity=(0, 0, 0) if condition.gravity == "balanced" else (0, 0, -9.81),
        tool="suction_cup",
        allow_unphysical=("arm1",) if printed else (),
    )
    motion = jp.Motion.from_csv(jp.shipped("scara_motion.csv"))
    settings = {"record_every": 20, "seed": 3, "start": "centred"}
    drive = jp.loads.ComputedTorque(bandwidth=100.0)
    expected = jp.Simulation(robot, motion, drive=drive, **settings).describe()
    assert scara(clearance, condition, 20, 3).describe() == expected


@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_scenarios_run(name):
    scenario = Scenario.load(f"jointplay:{name}")
    for case in scenario.cases:
        changes = {"integration": {"duration": 0.004}}
        if "speeds" not in tomllib.loads(scenario.text)["motion"]:
            changes["integration"]["duration"] = 0.02
        result = scenario.simulation(case, changes).run()
        assert result.status == Status.COMPLETED
        assert np.isfinite(result["q"].values).all()
        loose = result.joints or result.simulation.mechanism.gears
        assert bool(loose) == (case != "ideal")


def test_four_bar_turns_as_its_geometry_says():
    """Freudenstein's equation, with the rocker's angle from the positions of the pins."""
    scenario = Scenario.load("jointplay:four_bar.toml")
    result = scenario.simulation("ideal", {"integration": {"duration": 0.02}}).run()
    names = list(result["q"].coordinate.values)
    q = result["q"].values
    crank = q[:, names.index("crank_pin")]
    rocker = q[:, names.index("rocker_pin")] + 1.723  # as the URDF has its frame
    a, b, c, d = 0.05, 0.15, 0.12, 0.16
    left = d**2 + a**2 + c**2 - b**2 - 2 * a * d * np.cos(crank)
    right = 2 * c * (a * np.cos(crank - rocker) - d * np.cos(rocker))
    np.testing.assert_allclose(left - right, 0.0, atol=1e-7)
    np.testing.assert_allclose(crank, 20 * np.pi * result.time, atol=1e-8)


def test_everything_at_once():
    scenario = load(
        ARM
        + """
[joints.joint_a]
kind = "revolute"
bearing_radius = "15 mm"
bearing_length = "60 mm"
journal_radius = "14.9 mm"
lock_tilt = true
open_ends = true
exchanged = true
bearing_material = { young = "70 GPa", poisson = 0.33 }
normal = { law = "hunt-crossley", q = 0.9 }
friction = { law = "lugre", mu_d = 0.08, v_s = "5 mm/s", sigma0 = "1e5 1/m", sigma1 = 5 }
[gears.joint_c]
play = "0.1 deg"
rotor_inertia = "2 kg*cm^2"
stiffness = "500 N*m/rad"
[drive]
kind = "computed-torque"
bandwidth = "20 Hz"
encoder = "motor"
[drives]
joint_c = "prescribed"
[joint_friction.stroke]
coulomb = "2 N"
stribeck_speed = "1 mm/s"
[[payloads]]
mass = "500 g"
pick = "0.4 s"
centre = [0, 0, "-1 cm"]
[integration]
integrator = "rk4"
step = "5 us"
seed = 7
[output]
record_every = 4
"""
    )
    simulation = scenario.ready_run().simulation
    mechanism = simulation.mechanism
    joint = mechanism.clearance["joint_a"]
    assert joint.radial_clearance == pytest.approx(0.1e-3)
    assert (joint.lock_tilt, joint.open_ends, joint.exchanged) == (True, True, True)
    assert joint.bearing_material == jp.Material(70e9, 0.33)
    assert (joint.normal.q, joint.normal.n) == (0.9, 1.5)
    assert joint.friction.describe() == LuGre(0.08, v_s=5e-3, sigma0=1e5, sigma1=5).describe()
    gear = mechanism.gears["joint_c"]
    assert gear.play == pytest.approx(math.radians(0.1))
    assert gear.rotor_inertia == pytest.approx(2e-4)
    assert simulation.drive["joint_c"] == jp.loads.Prescribed()
    assert simulation.drive["joint_a"].bandwidth == pytest.approx(40 * math.pi)
    assert simulation.drive["joint_a"].encoder == "motor"
    assert simulation.joint_friction["stroke"] == jp.loads.JointFriction(2.0, stribeck_speed=1e-3)
    (payload,) = simulation.payloads
    assert payload == jp.Payload("suction_cup", 0.5, 0.4, None, (0.0, 0.0, -0.01))
    assert (simulation.integrator, simulation.step, simulation.seed) == ("rk4", 5e-6, 7)
    assert simulation.record_every == 4


def test_sliders_and_balls():
    scenario = load(
        """
[robot]
urdf = "jointplay:slider_crank.urdf"
gravity = "balanced"
[loops.piston_pin]
bearing = { link = "rod", xyz = ["120 mm", 0, 0] }
journal = { link = "slider" }
[joints.piston_pin]
kind = "spherical"
radial_clearance = "0.1 mm"
[joints.guide]
kind = "prismatic"
clearance = "50 um"
friction = "dahl"
[motion]
speeds.crank_pin = "60 rpm"
[drive]
kind = "prescribed"
[start]
guide = "170 mm"
[integration]
step = "2 us"
duration = "1 ms"
"""
    )
    joints = scenario.simulation().mechanism.clearance
    assert joints["piston_pin"].kind == "spherical"
    assert joints["guide"].clearance == 50e-6
    assert isinstance(joints["guide"].friction, Dahl)
    assert scenario.ready_run().finish().status == Status.COMPLETED


def test_lubricated_joints():
    oil = 'lubricant = { law = "short-bearing", viscosity = "50 mPa*s", transition = "2 um" }\n'
    text = changed("[motion]", oil + "[motion]")
    made = load(text).simulation().mechanism.clearance["joint_b"].lubricant
    assert made.describe() == jp.contact.ShortBearing(0.05, transition=2e-6).describe()
    assert "function is missing" in refusal(text.replace("short-bearing", "custom-film"))


def test_torque_and_free_need_no_motion(tmp_path):
    text = ARM[: ARM.index("[joints")] + (
        '[drives.joint_a]\nkind = "torque"\ntimes = [0]\nvalues = ["2 N*m"]\n'
        '[start]\njoint_b = "90 deg"\n[start_speed]\nstroke = "1 mm/s"\n'
        '[integration]\nduration = "1 ms"\n'
    )
    result = load(text).simulation().run()
    names = list(result["q"].coordinate.values)
    assert result["q"].values[0, names.index("joint_b")] == pytest.approx(math.pi / 2)
    assert result["v"].values[0, names.index("stroke")] == pytest.approx(1e-3)
    assert result["v"].values[-1, names.index("joint_a")] > 0.0


def test_own_laws_are_found_in_modules_that_were_imported(tmp_path):
    (tmp_path / "laws_of_this_test.py").write_text(
        "def push(delta, ddelta, ddelta0, p):\n    return p[0] * delta\n"
        "def brush(speed, normal, dwell, p, out):\n    out[0] = 1.0\n    out[1] = 0.0\n"
        "    out[2] = p[0] * normal\n    out[3] = out[4] = out[6] = out[7] = 0.0\n"
        "    out[5] = p[1] * normal\n"
    )
    law = '"laws_of_this_test:{}"'
    joint = (
        f'normal = {{ law = "custom", function = {law.format("push")}, parameters = ["1e8"] }}\n'
        f'friction = {{ law = "custom-bristle", function = {law.format("brush")}, '
        "parameters = [1e5, 0.1] }\n"
    )
    text = changed("[motion]", joint + "[motion]")
    assert "--import laws_of_this_test" in refusal(text, tmp_path / "arm.toml")
    jp.import_module(tmp_path / "laws_of_this_test.py")
    made = load(text, tmp_path / "arm.toml").simulation().mechanism.clearance["joint_b"]
    assert made.normal.values == (1e8,)
    assert isinstance(made.friction, CustomBristle)
    assert made.friction.values == (1e5, 0.1)
    wrong = refusal(changed("_test:push", "_test:pull", text), tmp_path / "arm.toml")
    assert "laws_of_this_test:pull" in wrong
    with pytest.raises(jp.JointplayError, match="another module is called 'json'"):
        jp.import_module((tmp_path / "laws_of_this_test.py").rename(tmp_path / "json.py"))


def test_cases_merge_key_by_key():
    base = {"a": {"x": 1, "y": 2}, "l": [1, 2], "f": {"law": "ambrosio", "v0": 1}}
    assert merge(base, {"a": {"y": 3}}) == {**base, "a": {"x": 1, "y": 3}}
    assert merge(base, {"l": [3]})["l"] == [3]
    assert merge(base, {"f": {"mu_d": 2}})["f"] == {"law": "ambrosio", "v0": 1, "mu_d": 2}
    assert merge(base, {"f": {"law": "lugre"}})["f"] == {"law": "lugre"}
    assert base["a"] == {"x": 1, "y": 2}


def test_a_case_with_another_motion_does_not_mix_both():
    scenario = load(
        ARM + '[cases.still]\n[cases.file]\nmotion.file = "jointplay:scara_motion.csv"\n'
    )
    assert len(scenario.simulation("file").motion.times) == 9
    assert len(scenario.simulation("still").motion.times) == 2


def test_cases_need_a_choice():
    scenario = load(ARM + "[cases.a]\n[cases.b]\n")
    with pytest.raises(jp.JointplayError, match="choose a case: a, b"):
        scenario.simulation()
    with pytest.raises(jp.JointplayError, match="no case 'c'; available: a, b"):
        scenario.simulation("c")


LAST = "joint_c = [0, 0]"
REFUSED = [
    (("radial_clearance", "radial_clearence"),
     "here/arm.toml, line 7, joints.joint_b.radial_clearence: unknown key",
     'did you mean "radial_clearance"? valid keys: kind,'),
    (("[motion]", "[motoin]"), "line 9, motoin", 'did you mean "motion"?'),
    (("0.2 mm", "0.2 mmm"), "line 7, joints.joint_b.radial", "unknown unit"),
    (("0.2 mm", "0.2 kg"), "line 7", '"0.2 kg" is not a length', '"0.2 mm"'),
    (("-50 mm", "50 deg"), "line 14, motion.joints.stroke", "is prismatic"),
    (("30 deg", "30 mm"), "line 12", '"30 mm" is not an angle', "is revolute"),
    (("0.2 mm", "-0.2 mm"), "line 7, joints.joint_b.radial_clearance", "-0.2 mm"),
    (("[motion]", '[joints.joint_b]\nkind = "planar"\n[motion]'),
     "line 9", "joints.joint_b is given twice"),
    (("joints.joint_b", "joints.elbow"), "joints.elbow", "joint_a, joint_b"),
    (("joints.joint_b", "joints.jont_b"), 'did you mean "joint_b"? available: joint_a, joint_b,'),
    (("[motion]", 'friction = "lugree"\n[motion]'), "line 9, joints.joint_b.friction",
     'did you mean "lugre"? available: ambrosio, coulomb, threlfall,'),
    (("[motion]", 'friction = { law = "dahl", v0 = 1 }\n[motion]'),
     "line 9, joints.joint_b.friction.v0", "valid keys: law, mu_d, sigma0"),
    (("radial", 'kind = "hinge"\nradial'), "line 7", "planar"),
    (("radial", 'kind = "spherical"\nradial'), "axial_clearance"),
    (("jointplay:scara", "nowhere"), "line 3, robot.urdf", "nowhere.urdf"),
    (("scara.urdf", "scaro.urdf"), "line 3, robot.urdf", "scara.urdf"),
    (("suction_cup", "hammer"), "line 4, robot.tool", "'hammer'", "arm1"),
    (('"balanced"', '"balance"'), "line 5, robot.gravity", "balanced, loaded"),
    (('"1 s"]', '"-1 s"]'), "motion.times[2]", "must increase"),
    ((LAST, "[start_speed]\njoint_c = 1"), "motion", "lacks joint_c"),
    ((LAST, "joint_c = [0]"), "line 15", "1 positions for 2"),
    (("times = [0", 'file = "x.csv"\ntimes = [0'), "motion.joints",
     "one of file, joints, speeds, tool_position; got file and joints"),
    (("[joints", "[output]\nrecord_every = 2.5\n[joints"),
     "line 7, output.record_every: expected a whole number, got 2.5"),
    (("[joints", "[integration]\nstep = 0.001\n[joints"),
     "line 7, integration.step", "too large for the contact stiffness"),
    (("[motion]", '[drives]\njoint_d = "prescribed"\n[motion]'),
     "line 10, drives.joint_d", "joint_a, joint_b"),
    (("[robot]", "[robot"), "line 2, column 7"),
    (("[robot]", "[rob]"), "line 2, rob", 'did you mean "robot"?'),
    ((LAST, f"{LAST}\n[cases.a]\nintegration.stepp = 1"),
     "line 17, cases.a.integration.stepp", 'did you mean "step"?'),
    ((LAST, f"{LAST}\n[cases.a]\njoints.joint_b.restitution = 2"),
     "line 17, cases.a.joints.joint_b.restitution", "[0, 1], got 2"),
    ((LAST, f'{LAST}\n[cases.a]\ntitle = "x"'), "title"),
    (("[motion]", '[[payloads]]\nmass = "1 kg"\n[[payloads]]\nmass = "1 m"\n[motion]'),
     "line 12, payloads[2].mass", "is not a mass"),
]  # fmt: skip


@pytest.mark.parametrize(("change", "words"), [(c, w) for c, *w in REFUSED], ids=repr)
def test_bad_input_is_refused_in_one_line(change, words):
    message = refusal(changed(*change))
    assert message.startswith("here/arm.toml")
    for word in words:
        assert word in message


FOUR_BAR = jp.shipped("four_bar.toml")
LOOPS_REFUSED = [
    (("150 mm", "350 mm"), "line 10, loops.rocker_end", "stays open by 0.12 m"),
    (('"coupler"', '"couple"'), "loops.rocker_end", "'couple'", "coupler, rocker"),
    (("loops.rocker_end", "loops.end"), "'rocker_end'", "available: ", "end"),
    (("loops.rocker_end", "loops.crank_pin"), "the name of a joint"),
    (('duration = "0.5 s"', ""), "motion.speeds", "give duration"),
    (('"prescribed"', '"torque"\ntimes = [0]\nvalues = [1]'), "drive.kind", "give [drives.JOINT]"),
    (('"prescribed"', '"torque"'), "drive", "the keys times, values are missing"),
]  # fmt: skip


@pytest.mark.parametrize(("change", "words"), [(c, w) for c, *w in LOOPS_REFUSED], ids=repr)
def test_bad_loops_are_refused_in_one_line(change, words):
    text = FOUR_BAR.read_text(encoding="utf-8")
    message = refusal(changed(*change, text), FOUR_BAR.parent / "bar.toml")
    for word in words:
        assert word in message


def test_missing_files():
    with pytest.raises(jp.JointplayError, match=r"cannot read the scenario 'none.toml'"):
        Scenario.load("none.toml")
    with pytest.raises(jp.JointplayError, match=r"'none.toml'; .*available: .*four_bar.toml"):
        Scenario.load("jointplay:none.toml")


CARTESIAN = ARM[: ARM.index("[motion]")] + (
    '[motion]\ntimes = [0, "0.1 s"]\n'
    'tool_position = [["500 mm", 0.1, -0.2], ["510 mm", 0.1, -0.2]]\n'
    '[start]\njoint_b = "60 deg"\n'
)


def test_cartesian_waypoints_are_reached_and_unreachable_ones_named():
    for start, sign in (("60 deg", 1), ("-60 deg", -1)):
        simulation = load(changed("60 deg", start, CARTESIAN)).simulation()
        ideal = simulation.mechanism.ideal()
        assert np.sign(simulation.motion.positions[0, 1]) == sign
        import pinocchio as pin

        for q, x in zip(simulation.motion.positions[[0, -1]], (0.5, 0.51), strict=True):
            pin.framesForwardKinematics(ideal.model, ideal.data, q)
            place = ideal.data.oMf[ideal.tool_frame].translation
            np.testing.assert_allclose(place, [x, 0.1, -0.2], atol=1e-6)
    message = refusal(changed('"510 mm"', '"5 m"', CARTESIAN))
    assert "motion.tool_position[2]" in message
    assert "waypoint 2 at (5, 0.1, -0.2) m is out of reach" in message


def test_waypoints_of_wrong_size_are_named():
    message = refusal(changed('["510 mm", 0.1, -0.2]', '["510 mm", 0.1]', CARTESIAN))
    assert 'line 11, motion.tool_position[2]: ["510 mm", 0.1] are not three' in message
    message = refusal(changed(', ["510 mm", 0.1, -0.2]', "", CARTESIAN))
    assert "1 waypoints for 2 times" in message


def test_keys_know_their_lines():
    text = (
        'a = 1\n[t]\nb = [\n 1,\n]\nc.d = 2\n[[p]]\nx = 1\n[[p]]\nx = 2\n[p.q]\ny = """\n[z]\n"""\n'
    )
    found = lines(text)
    assert found["a",] == 1
    assert found["t", "b"] == 3
    assert found["t", "c", "d"] == 6
    assert (found["p", 0, "x"], found["p", 1, "x"], found["p", 1, "q", "y"]) == (8, 10, 12)
    assert ("z",) not in found


def test_schema_accepts_what_ships_and_marks_mistakes():
    jsonschema = pytest.importorskip("jsonschema")
    validator = jsonschema.Draft7Validator(schema())
    jsonschema.Draft7Validator.check_schema(schema())
    for path in (*map(jp.shipped, SHIPPED), TEMPLATE):
        data = tomllib.loads(path.read_text(encoding="utf-8"))
        assert not list(validator.iter_errors(data)), path
    base = tomllib.loads(ARM)
    for wrong in (
        {"robots": {}},
        {"joints": {"a": {"kind": "hinge"}}},
        {"joints": {"a": {"radial_clearence": 1}}},
        {"joints": {"a": {"friction": "lugree"}}},
        {"cases": {"a": {"step": 1}}},
        {"integration": {"integrator": "rk5"}},
    ):
        assert list(validator.iter_errors({**base, **wrong})), wrong


def test_schema_has_units_and_explanations():
    of = schema()["$defs"]
    radial = of["RevoluteClearance"]["properties"]["radial_clearance"]["description"]
    assert radial.startswith("Radial (not diametral) clearance C_r [m]; 0: an ideal joint.")
    speed = of["LuGre"]["properties"]["v_s"]["description"]
    assert speed == "Speed over which the friction falls from static to dynamic [m/s]."


def test_documentation_has_every_key_and_word():
    keys = runpy.run_path(str(DOCS / "site" / "keys.py"))["page"]()
    text = (DOCS / "scenarios.md").read_text(encoding="utf-8") + keys
    words = set(re.findall(r'`"?([\w-]+)"?', text))
    for name, table in schema()["$defs"].items():
        if name != "Case":
            assert not set(table["properties"]) - words - {"law", "source"}, name
    assert not {*NORMAL_LAWS, *FRICTION_LAWS, *FILM_LAWS, *DRIVES, *JOINT_WORDS} - words
    for table in schema()["properties"]:
        assert f"[{table}" in text or f"[[{table}" in text or table in words, table
    for block in re.findall(r"```toml\n(.*?)```", text, re.S):
        scenario = Scenario(block, jp.shipped("slider_crank.urdf").parent / "docs.toml")
        assert [scenario.ready_run(case) for case in scenario.cases]


def test_every_quantity_has_a_unit_that_is_known():
    """A field that is new in a class and no pure number has its unit, or `codec` refuses it."""
    pure = {
        *("poisson", "restitution", "mu_d", "mu_s", "n", "p", "q", "damping_ratio"),
        *("parameters", "seed", "record_every", "tolerance", "coefficient", "faster"),
        *("elements", "rolling_friction", "inner_groove", "outer_groove"),
        *("ratio", "efficiency", "back_driving_efficiency", "error_orders"),
        *("dead_band_counts", "stiffness_spread"),
    }
    for name, table in schema()["$defs"].items():
        for key, value in table["properties"].items():
            is_quantity = value.get("type") == ["number", "string"]
            if is_quantity and key not in pure:
                assert "[" in value.get("description", ""), f"{name}.{key}"


def test_materials_by_name_or_with_units():
    words = changed(
        'axial_clearance = "0.1 mm"',
        'axial_clearance = "0.1 mm"\nbearing_material = "bronze"\n'
        'journal_material = { young = "207 GPa", yield_strength = "1.2 GPa", density = 7800 }',
    )
    joint = load(words).simulation().mechanism.clearance["joint_b"]
    assert joint.bearing_material == jp.material("bronze")
    assert joint.journal_material == jp.Material(207e9, yield_strength=1.2e9, density=7800.0)
    wrong = refusal(words.replace('"bronze"', '"bronce"'))
    assert "line 9, joints.joint_b.bearing_material" in wrong
    assert 'did you mean "bronze"' in wrong


def test_a_motion_can_be_faster_than_given():
    scenario = Scenario.load("jointplay:scara.toml")
    plain, fast = (
        scenario.simulation("0.2 mm", {"motion": {"faster": times}}).motion for times in (1.0, 2.0)
    )
    assert fast.duration == plain.duration / 2.0
    at = np.linspace(0.0, 1.4, 20)
    np.testing.assert_allclose(fast(at)[0], plain(2.0 * at)[0], atol=1e-12)
    np.testing.assert_allclose(fast(at)[1], 2.0 * plain(2.0 * at)[1], atol=1e-9)
    with pytest.raises(jp.JointplayError, match=r"motion.faster.*greater than zero"):
        scenario.simulation("0.2 mm", {"motion": {"faster": 0.0}})


def test_a_mechanism_is_built_whole_yet_errors_name_their_part():
    scenario = Scenario.load("jointplay:scara_ab.toml")
    joints = {"joint_a": {}, "joint_b": {"bearing_radius": "-1 mm"}}
    with pytest.raises(jp.JointplayError, match=r"joints.joint_b.bearing_radius"):
        scenario.simulation("A and B", {"joints": joints})
    with pytest.raises(jp.JointplayError, match=r"joints.joint_x.*no joint"):
        scenario.simulation("A and B", {"joints": {"joint_x": {"ideal": True}}})


def test_a_start_that_is_rounding_is_said_as_zero():
    """Loops are closed by iteration: 1.5e-20 m is no place."""
    scenario = jp.Scenario.load("jointplay:four_bar.toml")
    run = scenario.ready_run("ideal")
    run.workspace.q[:] = [1.5182e-20, -3e-17, 0.25][: len(run.workspace.q)]
    (line,) = [one for one in summary(scenario, {"ideal": run}).splitlines() if "  start " in one]
    assert " 0 rad" in line
    assert not re.search("e-|-0 ", line)


def test_planar_play_across_which_a_mechanism_cannot_move_is_asked_about(tmp_path):
    """A slider in the plane x, y: its frame's z goes along x, and its x is down or across."""
    for turned, asked in ((0.0, True), (1.5707963267948966, False)):
        (tmp_path / "slider.urdf").write_text(
            '<robot name="s"><link name="base"/><link name="block"><inertial><mass value="1"/>'
            '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
            '<joint name="guide" type="prismatic"><parent link="base"/><child link="block"/>'
            f'<origin rpy="{turned} 0 0"/><axis xyz="1 0 0"/>'
            '<limit lower="-1" upper="1" effort="9" velocity="9"/></joint>'
            '<link name="rod"><inertial><origin xyz="-0.1 0 0"/><mass value="1"/>'
            '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
            '<joint name="pin" type="continuous"><parent link="block"/><child link="rod"/>'
            f'<origin rpy="{-turned} 0 0"/><axis xyz="0 0 1"/></joint></robot>'
        )
        path = tmp_path / "slider.toml"
        path.write_text(
            '[robot]\nurdf = "slider.urdf"\ngravity = [0, -9.81, 0]\n'
            '[joints.guide]\nkind = "prismatic"\nclearance = "1 mm"\nplanar = true\n'
            '[drives]\npin = "free"\n'
            'guide = "free"\n[integration]\nduration = "1 ms"\n'
        )
        scenario = Scenario.load(path)
        scenario.simulation()
        assert any("has planar play along x" in note for note in scenario.notes) == asked


@pytest.mark.parametrize(
    ("turned", "asked"), [('[0, "90 deg", 0]', True), ('["-90 deg", 0, "-90 deg"]', False)]
)
def test_planar_play_of_a_loop_across_which_nothing_moves_is_asked_about(tmp_path, turned, asked):
    """A slider-crank in the plane x, y whose guide closes the loop, along x; its x is z, or y."""
    bodies = [("crank", "base", 0.0), ("rod", "crank", 0.1), ("block", "rod", 0.3)]
    parts = "".join(
        f'<link name="{name}"><inertial><origin xyz="0.1 0 0"/><mass value="1"/>'
        '<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        f'<joint name="{name}_pin" type="continuous"><parent link="{parent}"/>'
        f'<child link="{name}"/><origin xyz="{at} 0 0"/><axis xyz="0 0 1"/></joint>'
        for name, parent, at in bodies
    )
    (tmp_path / "crank.urdf").write_text(f'<robot name="s"><link name="base"/>{parts}</robot>')
    path = tmp_path / "crank.toml"
    path.write_text(
        '[robot]\nurdf = "crank.urdf"\ngravity = [0, -9.81, 0]\n[loops.guide]\n'
        f'bearing = {{link = "base", xyz = [0.3, 0, 0], rpy = {turned}}}\n'
        f'journal = {{link = "block", xyz = [0, 0, 0], rpy = {turned}}}\n'
        '[joints.guide]\nkind = "prismatic"\nlength = "40 mm"\nwidth = "20 mm"\n'
        'height = "20 mm"\nclearance = "0.1 mm"\nplanar = true\n[drives]\ncrank_pin = "free"\n'
        'rod_pin = "free"\nblock_pin = "free"\n[integration]\nduration = "1 ms"\n'
    )
    scenario = Scenario.load(path)
    scenario.simulation()
    assert any("has planar play along x" in note for note in scenario.notes) == asked
