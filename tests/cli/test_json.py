"""Answers as JSON: the numbers of the printed answer, in SI, and the origin of each input."""

import json
import re
import subprocess

import pytest

from jointplay.cli import main

UR5 = ["ur5", "--clearance", "0.1 mm"]


def answer(capsys, *words):
    assert main([*words, "--json"]) == 0
    return json.loads(capsys.readouterr().out, parse_constant=pytest.fail)


def test_a_budget_has_the_numbers_of_its_sentence_and_the_origin_of_its_inputs(capsys):
    found = answer(capsys, "budget", *UR5)
    worst = float(re.search(r"up to (\S+) mm", found["answer"])[1])
    assert 1e3 * found["poses"][0]["worst_m"] == pytest.approx(worst, rel=1e-2)
    parts = [row["part_of_worst_case_m"] for row in found["joints"]]
    assert sum(parts) == pytest.approx(found["poses"][0]["worst_m"], rel=1e-6)
    origins = {row["key"].rpartition(".")[2]: row["origin"] for row in found["values"]}
    assert origins["radial_clearance"] == "given"
    assert origins["bearing_length"] == "assumed"


def test_a_whole_budget_an_allocation_and_a_plan_are_json(capsys):
    whole = answer(capsys, "budget", "ur5", "--whole", "industrial")
    assert {"play", "elasticity"} & {row["cause"] for row in whole["causes"]}
    geared = ("ar4", "--gear", "all=1 arcmin")
    allotted = answer(capsys, "allocate", *geared, "--target", "0.2 mm")
    assert allotted["error_m"] <= 0.2e-3 * (1 + 1e-6)
    assert all(row["play_rad"] > 0.0 for row in allotted["choices"])
    loop = answer(capsys, "budget", "jointplay:slider_crank.toml", "--case", "0.2 mm")
    assert any(row["key"] == "joints.piston_pin.radial_clearance" for row in loop["values"])
    plan = answer(capsys, "identify", *UR5, "--plan", "dial")
    assert "shoulder_pan_joint" in plan["plan"][0]


def test_a_run_has_its_measures_with_their_units_and_nothing_else_on_standard_output(
    tmp_path, capsys
):
    line = ["run", "--duration", "0.05", "--no-figures", "--quiet", "--assumed", "--out"]
    (run,) = answer(capsys, *line, str(tmp_path / "out"))["cases"].values()
    peak = float(re.search(r"up to (\S+) mm", run["answer"])[1])
    assert run["measures"]["tool_error_peak_total"]["unit"] == "m"
    assert 1e3 * run["measures"]["tool_error_peak_total"]["value"] == pytest.approx(peak, rel=1e-2)
    assert run["status"].startswith("completed")
    assert {row["origin"] for row in run["values"]} >= {"assumed"}


def test_a_check_has_the_inputs_of_each_case_and_a_bare_robot_its_joints(capsys):
    cases = answer(capsys, "check", "jointplay:scara_ab.toml", "--no-picture")["cases"]
    for case in cases.values():
        assert case["simulation"]["step"] > 0.0
        assert case["values"]
    joints = answer(capsys, "check", "ur5", "--no-picture")["joints"]
    assert [one["unit"] for one in joints] == ["rad"] * 6


def test_what_is_wrong_is_said_as_without_json(capsys):
    assert main(["budget", "ur5", "--json", "--joint", "elbw_joint"]) == 2
    said = capsys.readouterr()
    assert not said.out
    assert 'did you mean "elbow_joint"' in said.err


@pytest.mark.parametrize("shell", ["bash", "zsh"])
def test_a_shell_completes_commands_options_and_their_words(shell, capsys):
    pytest.importorskip("shtab")
    assert main(["--completion", shell]) == 0
    text = capsys.readouterr().out
    assert all(word in text for word in ("iso9283", "--axial-clearance", "reciprocal-squared"))
    if shell == "bash":
        subprocess.run(["bash", "-n"], input=text, text=True, check=True)
