"""Laws typed in a script or a notebook: their results, in other processes."""

import subprocess
import sys

import pytest

import jointplay as jp
from jointplay.base.modules import imported
from jointplay.cli import main

LAW = """
def typed(delta, ddelta, ddelta0, stiffness, alpha):
    return stiffness * delta**1.5 * (1.0 + alpha * ddelta)
"""
SCRIPT = f"""
import jointplay as jp
{LAW}
law = jp.contact.CustomNormalForce(typed, {{"stiffness": 1e9, "alpha": 0.08}})
joint = jp.RevoluteClearance(radial_clearance=2e-4, axial_clearance=2e-4, normal=law)
mechanism = jp.Mechanism("scara", {{"joint_b": joint}})
motion = jp.Motion(["joint_a"], [0, 1], [[0], [0.1]])
result = jp.simulate(mechanism, motion, duration=2e-3, estimate=False)
result.save("own.nc")
assert (result.simulation.run(estimate=False)["q"].values == result["q"].values).all()
"""
SAID = (
    "the law 'typed(delta, ddelta, ddelta0, stiffness, alpha)' was typed in another script or "
    "notebook; to run it again, define it here and make "
    "CustomNormalForce(typed, (1000000000.0, 0.08)), or put it into a file, such as laws.py, and "
    "if you know it: --import laws, or jointplay.import_module('laws') in Python"
)


@pytest.fixture(autouse=True)
def nothing_imported():
    imported.clear()


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A result that another process has made, and a module with its law."""
    folder = tmp_path_factory.mktemp("typed")
    (folder / "make.py").write_text(SCRIPT)
    subprocess.run([sys.executable, "make.py"], cwd=folder, check=True)
    (folder / "typed_laws.py").write_text(LAW)
    return folder


def test_what_to_define_is_said_in_one_line(folder, monkeypatch):
    monkeypatch.chdir(folder)
    simulation = jp.Result.load("own.nc").simulation
    law = simulation.mechanism.clearance["joint_b"].normal
    assert law.source in LAW
    assert repr(law) == "CustomNormalForce(typed, (1000000000.0, 0.08))"
    with pytest.raises(jp.JointplayError) as error:
        simulation.run()
    assert SAID in str(error.value)
    with pytest.raises(jp.JointplayError, match="module 'nowhere' cannot be imported"):
        jp.import_module("nowhere")


def test_a_module_that_was_imported_has_the_law_under_its_name(folder):
    jp.import_module(folder / "typed_laws.py")
    stored = jp.Result.load(folder / "own.nc")
    law = stored.simulation.mechanism.clearance["joint_b"].normal
    assert law.function(1.0, 0.0, 0.0, *law.values) == 1e9
    again = stored.simulation.run(estimate=False)
    assert (again["q"].values == stored["q"].values).all()


@pytest.mark.thorough
def test_the_commands_show_the_result_and_say_what_a_repetition_needs(folder, monkeypatch, capsys):
    monkeypatch.chdir(folder)
    assert main(["report", "own.nc", "-o", "plain.html", "--no-pdf"]) == 0
    said = capsys.readouterr()
    assert SAID in said.out + said.err
    assert main(["play", "own.nc", "--html", "play.html", "--quiet"]) == 0
    capsys.readouterr()
    for page in ("plain", "play"):
        text = (folder / f"{page}.html").read_text(encoding="utf-8")
        assert ("return stiffness * delta" in text) == (page == "plain")
    line = ["report", "own.nc", "-o", "known.html", "--no-pdf", "--import", "typed_laws"]
    assert main(line) == 0
    said = capsys.readouterr()
    assert "cannot be repeated" not in said.out + said.err
    assert "No single steps" not in (folder / "known.html").read_text(encoding="utf-8")
