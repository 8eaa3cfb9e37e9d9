"""Joints and links whose names have dots, blanks, quotes and other signs, through the commands."""

import csv
import json
from xml.sax.saxutils import quoteattr

import pytest

import jointplay as jp
from jointplay.cli import main

INERTIAL = (
    '<inertial><origin xyz="0.1 0 0"/><mass value="1"/>'
    '<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>'
)
JOINT = (
    '<joint name={} type="revolute"><parent link={}/><child link={}/><origin xyz="0.3 0 0"/>'
    '<axis xyz="0 1 0"/><limit lower="-2" upper="2" effort="100" velocity="3"/></joint>'
)
SCENARIO = """
[robot]
urdf = "r.urdf"
[joints.{name}]
radial_clearance = "0.2 mm"
axial_clearance = "0.2 mm"
[motion]
times = [0, 0.01]
[motion.joints]
{name} = [0, 0.001]
k = [0, 0.001]
[drives.{name}]
kind = "computed-torque"
[integration]
duration = "2 ms"
[sweep]
results = true
[sweep.axes]
c = {{ key = {key}, values = ["0.1 mm", "0.2 mm"] }}
"""
NAMES = ["joint_0.0", 'a/b [1] "ü"=x,y']
MORE = ["0.1", "a b", "-lead", "a'b", "a:b", "#c", "50%", "x=1"]


@pytest.fixture(params=[*NAMES, *(pytest.param(n, marks=pytest.mark.nightly) for n in MORE)])
def odd(request, tmp_path):
    """A name, and an arm and a scenario with a joint of this name."""
    name = request.param
    link, base, tip = quoteattr(f"link {name}"), quoteattr("base"), quoteattr("tip")
    (tmp_path / "r.urdf").write_text(
        f'<robot name="r"><link name={base}/><link name={link}>{INERTIAL}</link>'
        f"<link name={tip}>{INERTIAL}</link>{JOINT.format(quoteattr(name), base, link)}"
        f"{JOINT.format(quoteattr('k'), link, tip)}</robot>"
    )
    text = json.dumps(name, ensure_ascii=False)
    key = json.dumps(f"joints.{text}.radial_clearance", ensure_ascii=False)
    (tmp_path / "s.toml").write_text(SCENARIO.format(name=text, key=key))
    return name, tmp_path


@pytest.mark.thorough
def test_an_odd_name_goes_through_the_commands(odd, capsys):
    name, folder = odd
    robot, scenario = str(folder / "r.urdf"), str(folder / "s.toml")
    quoted = json.dumps(name, ensure_ascii=False)
    result = str(folder / "out" / "result.nc")
    play = f"--joint={quoted if '=' in name else name}=0.1mm"
    steps = [
        ["check", scenario, "--no-picture"],
        ["run", robot, play, "--duration", "2 ms", "--out", str(folder / "out"), "--quiet",
         "--set", f"joints.{quoted}.restitution=0.8"],
        ["run", scenario, "--out", str(folder / "two"), "--quiet", "--no-figures"],
        ["report", result, "-o", str(folder / "p.html"), "--quiet", "--no-pdf"],
        ["export", "result", result, "--out", str(folder / "a.csv"), "--quiet"],
        ["play", result, "--html", str(folder / "play.html"), "--quiet"],
        ["budget", robot, play, "--out", str(folder / "budget")],
        ["allocate", robot, "--clearance", "0.1mm", "--target", "1mm"],
        ["export", "urdf", robot, play, "--out", str(folder / "x.urdf")],
        ["study", "sweep", scenario, "--out", str(folder / "sweep"), "--quiet", "--jobs", "1"],
    ]  # fmt: skip
    for step in steps:
        assert main(step) == 0, (step, capsys.readouterr().err)
    loaded = jp.Result.load(result)
    assert list(loaded.joints) == [name]
    assert loaded["joint_force"].sel(joint=name).sizes["axis"] == 3
    assert loaded.simulation.mechanism.clearance[name].restitution == 0.8
    with (folder / "budget" / "budget.csv").open(encoding="utf-8", newline="") as file:
        assert any(name in cell for cell in next(csv.reader(file)))


def test_names_with_dots_need_no_quotes_in_settings_for_shells_take_them_away(tmp_path, capsys):
    from jointplay.scenario.reading import parse, with_names

    names = ["joint_0.0", "joint_0.0.x", "k"]
    for text, key in (
        ("joints.joint_0.0.ideal=true", ("joints", "joint_0.0", "ideal")),
        ('joints."joint_0.0".ideal=true', ("joints", "joint_0.0", "ideal")),
        ("joints.joint_0.0.x.ideal=true", ("joints", "joint_0.0.x", "ideal")),
        ("motion.joints.joint_0.0=[0, 1]", ("motion", "joints", "joint_0.0")),
        ("joints.k.ideal=true", ("joints", "k", "ideal")),
    ):
        assert with_names([parse(text)], names)[0].key == key
    with pytest.raises(jp.JointplayError, match=r"--set 'joints.\"left elbow\".restitution=0.8'"):
        parse("joints.a b.ideal=true")
