import pytest

from jointplay import JointplayError, Scenario
from jointplay.cli import main
from jointplay.scenario.reading import Setting, given_by, parse, setting_texts, tree

SCARA = "jointplay:scara.toml"


@pytest.mark.parametrize(
    ("text", "key", "value"),
    [
        ("integration.step=5e-6", ("integration", "step"), 5e-6),
        ('joints.b.radial_clearance="0.3 mm"', ("joints", "b", "radial_clearance"), "0.3 mm"),
        ("joints.b.radial_clearance=0.3 mm", ("joints", "b", "radial_clearance"), "0.3 mm"),
        ('joints."my joint".ideal = true', ("joints", "my joint", "ideal"), True),
        ("motion.times=[0, '1 s']", ("motion", "times"), [0, "1 s"]),
        ("title=a = b", ("title",), "a = b"),
    ],
)
def test_a_setting_is_read_as_toml_and_text_needs_no_quotes(text, key, value):
    setting = parse(text)
    assert (setting.key, setting.value) == (key, value)
    assert [(one.key, one.value) for one in map(parse, setting_texts([setting]))] == [(key, value)]


@pytest.mark.parametrize("text", ["", "=", "step", "step=", "=3", "a b=1", "a..b=1", "[a]\nb=1"])
def test_what_is_no_setting_is_refused_with_an_example(text):
    with pytest.raises(JointplayError, match="--set"):
        parse(text)


def test_later_settings_count_more_and_are_blamed():
    settings = [parse("a.b=1"), parse("a.c=2"), parse("a.b=3")]
    assert tree(settings) == {"a": {"b": 3, "c": 2}}
    assert given_by(settings, ("a", "c", 0)) == "--set a.c"
    assert given_by(settings, ("a",)) is None


def test_settings_reach_every_case_and_errors_name_them():
    scenario = Scenario.load(SCARA, settings=[parse("joints.joint_b.normal.law=flores")])
    for case in scenario.cases:
        assert scenario.model(case).joints["joint_b"].fields["normal"].word == "flores"
    with pytest.raises(JointplayError, match=r"^--set integration\.step: .*negative|^--set"):
        Scenario.load(SCARA, settings=[parse("integration.step=wide")])


def test_a_key_of_a_law_keeps_the_law_that_a_word_chose():
    text = "joints.joint_b.friction.mu_d=0.3"
    scenario = Scenario.load("jointplay:scara.toml", settings=[parse(text)])
    friction = scenario.model("0.2 mm").joints["joint_b"].fields["friction"]
    assert (friction.word, friction.fields["mu_d"]) == ("ambrosio", 0.3)


def test_later_settings_leave_the_values_of_earlier_ones_as_they_are():
    material = {"young": 207e9}
    first = Setting(("joints", "a"), {"bearing_material": material}, "--joint a")
    found = tree([first, parse("joints.a.bearing_material.young=1e9")])
    assert found["joints"]["a"]["bearing_material"]["young"] == 1e9
    assert material == {"young": 207e9}


def test_a_clearance_that_nobody_gave_is_said_to_be_assumed(capsys):
    for joint, said in (("joint_b", True), ("joint_b=0.1 mm", False), ("joint_b=20 H7/f7", False)):
        assert main(["budget", "scara", "--joint", joint]) == 0
        assert ("assumed: clearance of 0.2 mm, bearings of" in capsys.readouterr().out) == said


@pytest.mark.parametrize(
    ("joint", "size"),
    [
        ("joint_b=20 H7/f7", "bearings 40 mm long"),
        ("joint_b=0.1 mm", "bearings of 20 x 40 mm"),
    ],
)
def test_of_a_bearing_what_nobody_gave_decides_where_it_rests(joint, size, capsys):
    assert main(["budget", "scara", "--joint", joint, "--detail"]) == 0
    printed = capsys.readouterr()
    assert size in printed.out + printed.err
