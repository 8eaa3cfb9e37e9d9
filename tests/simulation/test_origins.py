"""Values with their origin: what was given, by which file, preset or rule, and what was assumed."""

import pytest

import jointplay as jp
from jointplay.base.origins import from_text, to_text
from jointplay.cli import main
from jointplay.scenario.robot import robot_scenario
from jointplay.simulation.values import values


def by_key(scenario):
    simulation = scenario.simulation()
    return {one.key: one for one in values(simulation, scenario.origins(scenario.cases[0]))}


def test_each_value_says_who_gave_it():
    settings = ["gears.joint_2.play=1 deg", "gears.joint_2.damping=3", "drive.bandwidth=50"]
    found = by_key(robot_scenario("ar4", settings=[*settings, "drive.kind=computed-torque"]))
    assert found["gears.joint_2.play"].origin == "given"
    assert found["gears.joint_2.play"].source == "--set gears.joint_2.play"
    assert found["gears.joint_2.damping"].value == "3 N m s/rad"
    assert found["gears.joint_2.stiffness"].origin == "guessed"  # its file has no efforts
    assert found["gears.joint_2.rotor_inertia"].source.startswith("rule rotor inertia")
    assert found["drives.joint_2.encoder"].assumed
    bandwidth = next(one for key, one in found.items() if key.endswith(".bandwidth"))
    assert (bandwidth.value, bandwidth.origin) == ("50 rad/s", "given")
    assert found["motion"].assumed


@pytest.mark.parametrize("name", ["slider-crank", "four-bar"])
def test_of_a_linkage_no_value_is_of_a_urdf_or_of_python(name, tmp_path):
    path = tmp_path / "drawn.toml"
    assert main(["init", "--linkage", name, str(path)]) == 0
    by_name = by_key(jp.Scenario.load(path))
    sources = {value.source for value in by_name.values() if not value.assumed}
    assert sources == {"drawn.toml"}
    assert by_name["robot.tool"].assumed == (name == "slider-crank")  # which names no output
    friction = [value for key, value in by_name.items() if key.endswith(".coulomb")]
    assert friction
    assert all(value.assumed for value in friction)


def test_numbers_of_a_preset_have_its_origins():
    robot = jp.presets.preset("so101")
    description = robot.mechanism().description
    found = by_key(robot_scenario("so101", settings=robot.settings(description)))
    play = next(one for key, one in found.items() if key.endswith(".play"))
    stiffness = next(one for key, one in found.items() if key.endswith(".stiffness"))
    assert (play.origin, stiffness.origin) == ("seen", "estimated")
    assert "--preset so101" in play.source
    constant = next(one for key, one in found.items() if key.endswith(".torque_constant"))
    assert (constant.origin, "bam" in constant.source) == ("seen", True)


def test_a_result_keeps_what_was_assumed(tmp_path):
    gears = {"joint_2": jp.Gear("1 deg")}
    robot = jp.Mechanism("ar4", gears=gears)
    motion = jp.Motion(["joint_2"], [0.0, 0.01], [[0.0], [1e-3]])
    result = jp.simulate(robot, motion, step=1e-4)
    result.save(tmp_path / "r.nc")
    again = jp.Result.load(tmp_path / "r.nc")
    assert again.values == result.values
    assert from_text(to_text(again.values)) == again.values
    assert "gears.joint_2.stiffness" in str(again.assumed)
    assert "gears.joint_2.play" not in str(again.assumed)


def test_what_is_assumed_is_listed_when_asked_for(capsys, tmp_path):
    words = ["run", "ar4", "--gear", "joint_2=1 deg", "--duration", "0.002", "--no-figures"]
    assert main([*words, "--assumed", "--quiet", "--out", str(tmp_path / "o")]) == 0
    said = capsys.readouterr().out
    assert "result: assumed" in said
    assert "rule gear stiffness" in said
    assert "another would change" in said


@pytest.mark.parametrize(
    ("joint", "stiffness", "inertia"),
    [("panda_joint1", 2.0e4, 0.606), ("panda_joint5", 1e3, 0.206)],
)
def test_rules_for_gears_are_near_what_makers_state(joint, stiffness, inertia):
    """Franka's own numbers; within the factors that the rules state."""
    gear = jp.Mechanism("panda", gears={joint: jp.Gear(1e-3)}).gears[joint]
    assert 1.0 / 4.0 < gear.stiffness / stiffness < 4.0
    assert 1.0 / 5.0 < gear.rotor_inertia / inertia < 5.0
    critical = 2.0 * (gear.stiffness * gear.rotor_inertia) ** 0.5
    assert gear.damping == pytest.approx(0.05 * critical, rel=0.01)


def test_gears_of_a_robot_without_efforts_are_sized_by_its_weight():
    plays = {name: jp.Gear(1e-3) for name in ("joint_1", "joint_2", "joint_6")}
    robot = jp.Mechanism("ar4", gears=plays)
    assert robot.gears["joint_2"].stiffness > 10.0 * robot.gears["joint_6"].stiffness
    assert all(rule.guess for (_, field), rule in robot.rules.items() if field == "stiffness")
    told = robot.with_clearance({}, {"joint_2": jp.Gear(1e-3, 0.1, 1e4)})
    assert not any(name == "joint_2" for name, _ in told.rules)
    assert told.gears["joint_2"].damping == 0.0
