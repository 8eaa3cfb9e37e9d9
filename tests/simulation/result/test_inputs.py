"""The inputs of a run: declared once, and taken in Python as scenario files have them."""

import dataclasses
import typing

import numpy as np
import pytest

import jointplay as jp
from jointplay.base.schema import explanations, fields_of
from jointplay.scenario.declarations import IntegrationTable
from jointplay.simulation.result.inputs import Inputs
from jointplay.simulation.result.settings import Integration
from jointplay.simulation.simulation import Settings

SCARA = "jointplay:scara.urdf"
MOTION = jp.Motion(["joint_a"], [0.0, 0.5, 1.0], [[0.0], [0.2], [0.0]])


def test_what_simulate_takes_by_name_are_the_fields_of_a_simulation():
    names = {field.name for field in dataclasses.fields(jp.Simulation)}
    assert set(Settings.__annotations__) == names - {"mechanism", "motion"}
    given, declared = typing.get_type_hints(Settings), typing.get_type_hints(Inputs)
    for name, hint in given.items():
        if typing.get_origin(declared[name]) is None:
            assert declared[name] in {hint, *typing.get_args(hint)}, name
    with pytest.raises(jp.JointplayError, match='"stp" of simulate; did you mean "step"'):
        jp.simulate(jp.Mechanism(SCARA), MOTION, stp=1e-5)


def test_a_scenario_has_the_settings_of_a_simulation_and_their_words():
    assert issubclass(IntegrationTable, Integration)
    for name, text in explanations(Integration).items():
        assert explanations(IntegrationTable)[name] == explanations(jp.Simulation)[name] == text
        assert fields_of(IntegrationTable)[name] == fields_of(jp.Simulation)[name]


def test_values_may_be_written_as_in_files():
    as_text = jp.RevoluteClearance(
        radial_clearance="0.2 mm",
        axial_clearance="200 um",
        bearing_material="bronze",
        normal={"law": "hertz"},
        friction=0.05,
    )
    as_objects = jp.RevoluteClearance(
        radial_clearance=2e-4,
        axial_clearance=2e-4,
        bearing_material=jp.material("bronze"),
        normal=jp.contact.Hertz(),
        friction=jp.contact.Ambrosio(mu_d=0.05),
    )
    assert as_text == as_objects
    one = jp.Mechanism(SCARA, {"joint_b": as_text}, gravity="balanced")
    other = jp.Mechanism(SCARA, {"joint_b": as_objects}, gravity=(0.0, 0.0, 0.0))
    short = {"duration": "2 ms", "step": "20 us", "drive": {"joint_a": "computed-torque"}}
    exact = {"duration": 2e-3, "step": 2e-5, "drive": {"joint_a": jp.loads.ComputedTorque()}}
    assert jp.Simulation(one, MOTION, **short) == jp.Simulation(other, MOTION, **exact)


@pytest.mark.parametrize(
    ("wrong", "where", "words"),
    [
        ({"step": "10 kg"}, ("step",), '"10 kg" is not a time; expected a time such as "10 us"'),
        ({"drive": "fre"}, ("drive",), 'no drive "fre"; did you mean "free"?'),
        ({"drive": {"joint_a": "fre"}}, ("drive", "joint_a"), 'no drive "fre"'),
        ({"start": "above"}, ("start",), "no start 'above'"),
    ],
)
def test_what_cannot_be_names_its_place_the_value_and_the_choices(wrong, where, words):
    with pytest.raises(jp.JointplayError) as caught:
        jp.Simulation(jp.Mechanism(SCARA), MOTION, **wrong)
    assert caught.value.where == where
    assert words in str(caught.value)


def test_robots_have_names_and_gravity_has_words():
    assert jp.Mechanism("ur5").description.path.name.startswith("ur5")
    assert jp.Mechanism(SCARA, gravity="loaded").gravity == (0.0, 0.0, -9.81)
    with pytest.raises(jp.JointplayError, match="no gravity 'none'; available: balanced, loaded"):
        jp.Mechanism(SCARA, gravity="none")
    with pytest.raises(jp.JointplayError, match=r"no robot 'ur55'.*ur5"):
        jp.Mechanism("ur55")


def test_a_motion_that_names_one_joint_holds_the_others():
    simulation = jp.Simulation(jp.Mechanism(SCARA), MOTION, state={"joint_b": 0.3})
    assert set(simulation.motion.joints) == set(simulation.mechanism.joints)
    held = simulation.motion.positions[:, simulation.motion.joints.index("joint_b")]
    assert np.array_equal(held, [0.3, 0.3, 0.3])
    by_joint = jp.Simulation(jp.Mechanism(SCARA), MOTION, {"joint_a": "computed-torque"})
    assert by_joint.motion is MOTION


def test_a_simulation_is_described_and_read_back():
    bearing = jp.RevoluteClearance(radial_clearance=1e-4, axial_clearance=1e-4)
    simulation = jp.Simulation(
        jp.Mechanism(SCARA, {"joint_b": bearing}), MOTION, {"joint_a": "computed-torque"},
        state={"joint_b.x": 1e-5, "joint_c": (0.1, 0.2)}, settle="2 turns",
    )  # fmt: skip
    again = jp.Simulation.from_description(simulation.describe())
    assert again == simulation
    assert again.describe() == simulation.describe()


def test_what_is_shown_at_a_prompt_is_short_and_in_a_notebook_is_escaped():
    bearing = jp.RevoluteClearance(radial_clearance="0.1 mm", axial_clearance="0.1 mm")
    robot = jp.Mechanism(SCARA, {"joint_b": bearing})
    study = jp.Scenario.load("jointplay:scara.toml")
    for value, words in (
        (robot, "joint joint_b    revolute with clearance, play 0.1 mm"),
        (jp.Simulation(robot, MOTION, seed=3), "seed             3"),
        (study, "cases            ideal, 0.2 mm, 0.5 mm"),
    ):
        assert words in repr(value)
        assert len(repr(value).splitlines()) < 15
        assert f"<b>jointplay {type(value).__name__.lower()}</b>" in value._repr_html_()
    study.title = "<script>"
    assert "<script>" not in study._repr_html_()
    assert repr(MOTION) == "<jointplay Motion: joint_a; 3 waypoints in 1 s, rest-to-rest>"


def test_a_run_builds_its_mechanism_once_and_its_ideal_twin_once(tmp_path, monkeypatch, capsys):
    from jointplay.cli import main
    from jointplay.model import mechanism
    from jointplay.simulation import initial

    calls = []
    build, rest = mechanism.build, initial.find_rest
    monkeypatch.setattr(mechanism, "build", lambda *given: calls.append("build") or build(*given))
    monkeypatch.setattr(initial, "find_rest", lambda *given: calls.append("rest") or rest(*given))
    options = ["--duration", "0.002", "--no-figures", "--quiet", "--out", str(tmp_path / "out")]
    assert main(["run", "jointplay:scara.urdf", "--joint", "joint_b=0.2mm", *options]) == 0
    assert "puts the tool" in capsys.readouterr().out
    assert calls.count("build") == 2
    # Of the run, of the three by which its errors are estimated, and of the ideal mechanism, which
    # stands where its drives let it: of that beside the run, whose run the figures have, too, and
    # of that beside the finest.
    assert calls.count("rest") == 6
