"""Robots of the package robot_descriptions: from the cache, and nothing is downloaded."""

import sys
from dataclasses import replace

import pytest

from jointplay import JointplayError, Mechanism
from jointplay.base.errors import MissingName
from jointplay.cli import main
from jointplay.model import robot_descriptions, robots

pytestmark = pytest.mark.needs("robot_descriptions", "xacro")

XACRO = """<robot name="arm" xmlns:xacro="http://www.ros.org/wiki/xacro">
<xacro:arg name="dof" default="7"/>
<link name="base"/>
<link name="arm$(arg dof)"><inertial><mass value="1"/>
  <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="joint" type="revolute"><parent link="base"/><child link="arm$(arg dof)"/>
  <axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
</robot>"""


@pytest.fixture
def cache(tmp_path, monkeypatch):
    """An empty cache, into which `lay` puts what would be cloned: files at the pinned commit."""
    git = pytest.importorskip("git")
    from robot_descriptions import _cache, _repositories

    def refuse(*_):
        raise AssertionError("nothing may be downloaded")

    monkeypatch.setenv("ROBOT_DESCRIPTIONS_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(_cache, "_fetch_revision_shallow", refuse)
    before = set(sys.modules)

    def lay(repository, files, pinned=True):
        entry = _repositories.REPOSITORIES[repository]
        clone = git.Repo.init(tmp_path / "cache" / entry.cache_path)
        for name, text in files.items():
            path = tmp_path / "cache" / entry.cache_path / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)
        clone.git.add(all=True)
        who = git.Actor("test", "test@example.org")
        commit = clone.index.commit("all", author=who, committer=who).hexsha
        if pinned:
            entry = replace(entry, commit=commit)
            monkeypatch.setitem(_repositories.REPOSITORIES, repository, entry)

    yield lay
    for name in set(sys.modules) - before:
        if name.startswith("robot_descriptions."):
            del sys.modules[name]


def test_xacro_with_its_usual_arguments_is_found_by_any_name(cache, capsys):
    cache("xarm_ros2", {"xarm_description/urdf/xarm_device.urdf.xacro": XACRO})
    for name in ("robot_descriptions:xarm6_description", "robot_descriptions:xarm6", "xarm6"):
        assert Mechanism(name).description.links == ("base", "arm6")
    assert Mechanism("xarm6", xacro={"dof": 5}).description.links == ("base", "arm5")
    assert main(["robots", "xarm6"]) == 0
    assert "arm6" in capsys.readouterr().out
    assert main(["check", "xarm6", "--joint", "joint", "--no-picture"]) == 0
    assert "robot_descriptions:xarm6_description" in capsys.readouterr().out


def test_urdf_and_mjcf_are_told_apart_by_name(cache):
    place = "data/a1"
    files = {f"{place}/urdf/a1.urdf": "<robot/>", f"{place}/xml/a1.xml": "<mujoco/>"}
    cache("unitree_mujoco", files)
    path, usual = robot_descriptions.find("a1_mj_description")
    assert path.suffix == ".xml"
    assert not usual


@pytest.mark.parametrize("clone", [None, "other commit", "no clone"])
def test_what_the_cache_lacks_is_said_and_not_downloaded(clone, cache, tmp_path, capsys):
    folder = tmp_path / "cache" / "xarm_ros2"
    if clone == "other commit":
        cache("xarm_ros2", {"README": "old"}, pinned=False)
    elif clone == "no clone":
        folder.mkdir(parents=True)
    assert main(["robots", "xarm6"]) != 0
    said = capsys.readouterr().err
    assert "not in the cache" in said
    assert str(folder) in said
    assert said.count("\n") == 1
    assert "python -m robot_descriptions pull xarm6_description" in said
    assert "robot_descriptions.xarm6_description" not in sys.modules
    assert folder.is_dir() == (clone is not None)


def test_unknown_and_missing_package_are_said(monkeypatch):
    with pytest.raises(MissingName, match=r"xarm6_description"):
        Mechanism("robot_descriptions:xarm")
    with pytest.raises(MissingName, match=r"no robot 'xarm'.* robot_descriptions:xarm6_desc"):
        Mechanism("xarm")
    monkeypatch.setitem(sys.modules, "robot_descriptions", None)
    with pytest.raises(JointplayError, match=r"not installed; install it with: pip install"):
        Mechanism("robot_descriptions:xarm6")
    assert not robots.is_robot("xarm6")


def test_robots_are_known_by_name_before_they_are_there(cache):
    assert robots.is_robot("xarm6")
    assert robots.is_robot("robot_descriptions:xarm6")
    assert robots.with_package("panda") == "example-robot-data:panda"
    assert not robots.is_robot("no_such_robot")
