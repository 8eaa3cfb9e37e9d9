"""Every figure of four machines: texts apart, inside, with units; colours that all can tell."""

from itertools import pairwise

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from texts import faults

import jointplay as jp
from jointplay import analysis
from jointplay.accuracy.allocation import allocate
from jointplay.accuracy.error_budget import budget
from jointplay.paper import scara
from jointplay.scenario.reading import parse
from jointplay.scenario.robot import robot_scenario
from jointplay.show.picture import picture
from jointplay.show.plots import design, drawings, figures, palette
from jointplay.show.plots.draw import draw
from jointplay.show.plots.palette import look_of


def arm(name, joints, duration="4 ms"):
    scenario = robot_scenario(name, joints, [parse(f"integration.duration={duration}")])
    return {"result": scenario.simulation("result").run(estimate=False)}


def paper_arm():
    def run(clearance):
        whole = scara(clearance)
        return type(whole)(whole.mechanism, whole.motion, duration=0.12).run(estimate=False)

    return {"ideal": run(None), "0.2 mm": run(2e-4), "0.5 mm": run(5e-4)}


def slider_crank():
    scenario, short = jp.Scenario.load("jointplay:slider_crank.toml"), {"duration": "0.014 s"}
    return {
        case: scenario.simulation(case, {"integration": short}).run(estimate=False)
        for case in ("ideal", "0.2 mm")
    }


MACHINES = {
    "ur5": lambda: arm("ur5", ["elbow_joint", "wrist_1_joint"]),
    "so101": lambda: arm("so101", ["shoulder_lift", "elbow_flex"]),
    "slider-crank": slider_crank,
    "scara": paper_arm,
}


def drawn(cases):
    """Name and figure of all that is drawn of runs and of their machine."""
    for name, chart in figures._charts(cases):
        yield name, draw(chart)
    result = list(cases.values())[-1]
    for name in result.plot.available:
        yield name, getattr(result.plot, name)()
    mechanism, poses = result.simulation.mechanism, result["q"].values[[0, len(result.time) // 2]]
    yield "picture", picture(mechanism, poses[0])
    whole = budget(mechanism, poses)
    for plot in (design.bars, design.reachable, design.course, design.workspace_map):
        yield plot.__name__, plot(whole)
    yield "robot", design.robot(mechanism, whole, poses)
    yield "allocation", design.allocation(allocate(mechanism, poses, 0.5 * whole.worst.max()))


@pytest.mark.parametrize(
    "machine",
    [name if name == "" else pytest.param(name, marks=pytest.mark.thorough) for name in MACHINES],
)
def test_no_text_of_a_machines_figures_covers_another_or_lacks_its_unit(machine):
    wrong = {
        name: found for name, figure in drawn(MACHINES[machine]()) if (found := faults(figure))
    }
    assert not wrong


def test_drawings_have_room_for_their_texts():
    wrong = [faults(drawings.contact_forms()), faults(drawings.joint_drawings())]
    assert not any(wrong), wrong
