"""The examples of docs/drives.md do what they say."""

import re
from pathlib import Path

import pytest

import jointplay as jp

TEXT = (Path(__file__).parents[3] / "docs" / "drives.md").read_text(encoding="utf-8")


def test_the_scenario_can_be_run():
    (block,) = (
        one for one in re.findall(r"```toml\n(.*?)```", TEXT, re.S) if "[loads.cable]" in one
    )
    scenario = jp.Scenario(block, jp.shipped("scara.urdf").parent / "docs.toml")
    (case,) = scenario.cases
    simulation = scenario.simulation(case)
    assert simulation.loads["cable"] == jp.loads.Spring(
        "arm2", 200.0, 0.5, other_at=(0.0, 0.0, 1.0), damping=1.0
    )
    assert simulation.loads["buffer"].upper == pytest.approx(100 * 3.14159265 / 180)
    scenario.ready_run(case)
