"""Every figure of four machines: texts do not overlap, stay inside, have units; colours differ for
colour-blind readers, too."""

import re
from itertools import pairwise, product

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import to_rgb
from matplotlib.table import Table
from matplotlib.text import Text
from mpl_toolkits.mplot3d.proj3d import proj_transform
from texts import faults

import jointplay as jp
from jointplay.accuracy.allocation import allocate
from jointplay.accuracy.error_budget import budget
from jointplay.model.robots import robot_urdf
from jointplay.paper import scara
from jointplay.scenario.reading import parse
from jointplay.scenario.robot import robot_scenario
from jointplay.show.picture import picture
from jointplay.show.plots import design, drawings, figures, palette
from jointplay.show.plots.chart import Axis, Chart, Label, Panel
from jointplay.show.plots.draw import draw
from jointplay.show.plots.style import style
from jointplay.show.reports import cases, pdf, runs
from jointplay.show.reports.parts import Beside, Block, Grid, Points


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


def drawn(results):
    """Name and figure of everything that is drawn of runs and of their machine."""
    for name, chart in figures._charts(results):
        yield name, draw(chart)
    result = list(results.values())[-1]
    for name in result.plot.available:
        yield name, getattr(result.plot, name)()
    mechanism, poses = result.simulation.mechanism, result["q"].values[[0, len(result.time) // 2]]
    yield "picture", picture(mechanism, poses[0])
    whole = budget(mechanism, poses)
    for plot in (design.bars, design.reachable, design.course, design.workspace_map):
        yield plot.__name__, plot(whole)
    yield "robot", design.robot(mechanism, whole, poses)
    yield "allocation", design.allocation(allocate(mechanism, poses, 0.5 * whole.worst.max()))


@pytest.mark.thorough
@pytest.mark.parametrize("machine", MACHINES)
def test_no_text_of_a_machines_figures_covers_another_or_lacks_its_unit(machine):
    wrong = {
        name: found for name, figure in drawn(MACHINES[machine]()) if (found := faults(figure))
    }
    assert not wrong


@pytest.mark.thorough
@pytest.mark.parametrize("machine", ["so101", "slider-crank"])
def test_the_page_of_a_reports_pdf_is_filled_and_its_texts_stand_apart(machine):
    subject = cases.Runs(cases.build(MACHINES[machine](), lambda _: None))
    with style("screen"):
        page = pdf._answer("Machine", list(runs.glance(subject)), 0.0)
    assert not faults(page)
    lowest = page.subfigs[-1].texts[-1].get_window_extent()
    assert 0.0 < lowest.y0 < 0.1 * page.bbox.y1
    boxes = [axes.get_tightbbox() for axes in page.findobj(Axes) if axes.axison]
    assert min(box.x0 for box in boxes) > 0.04 * page.bbox.x1


def test_wrong_texts_are_found():
    panel = Panel(Axis("time", "s"), Axis("force"), [Label(0.5, 0.5, "here"), Label(0.5, 0.5, "x")])
    figure = draw(Chart([[panel]], (4.0, 3.0)))
    figure.text(0.99, 0.5, "too far to the right")
    found = faults(figure)
    assert any("covers" in fault for fault in found)
    assert any("leaves" in fault for fault in found)
    assert "'force' has no unit" in found


def test_drawings_have_room_for_their_texts():
    wrong = [faults(drawings.contact_forms()), faults(drawings.joint_drawings())]
    assert not any(wrong), wrong


def played_in(joints, q):
    bearing = jp.RevoluteClearance(radial_clearance=5e-5, axial_clearance=5e-5)
    robot = jp.Mechanism(robot_urdf("ur5"), dict.fromkeys(joints, bearing), tool="tool0")
    return robot, np.tile(q, (1, robot.model.nq))


def test_words_of_a_robots_joints_stand_apart():
    names = ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")
    robot, poses = played_in([f"{name}_joint" for name in names], 0.0)
    figure = picture(robot, poses[0])
    assert len(figure.axes[0].texts) == len(names) + 1
    assert not faults(figure)


def test_a_small_picture_of_a_tall_arm_has_room_for_its_numbers_and_its_box():
    robot = jp.Mechanism(robot_urdf("ar4"))
    figure = picture(robot, size_in=(4.4, 3.6))
    assert not faults(figure)
    axes = figure.axes[0]
    limits = (axes.get_xlim(), axes.get_ylim(), axes.get_zlim())
    corners = proj_transform(*np.array([*product(*limits)]).T, axes.get_proj())[:2]
    shares = axes.transLimits.transform(np.column_stack(corners))
    assert shares.min() > -0.01
    assert shares.max() < 1.01


@pytest.mark.parametrize("name", ["scara", "ar4"])
def test_names_of_axes_lie_inside_the_picture(name):
    figure = picture(jp.Mechanism(robot_urdf(name)), scale=(ScalarMappable(), "share [%]"))
    axes = figure.axes[0]
    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        box = axis.label.get_window_extent()
        assert (box.min >= 0.0).all()
        assert (box.max <= figure.bbox.size).all()


def test_a_budget_by_gears_names_their_joints_in_the_picture():
    gear = {"elbow_joint": jp.Gear(play=1e-3), "wrist_1_joint": jp.Gear(play=1e-3)}
    robot = jp.Mechanism(robot_urdf("ur5"), gears=gear, tool="tool0")
    poses = np.zeros((1, robot.model.nq))
    figure = design.robot(robot, budget(robot, poses), poses)
    texts = " ".join(text.get_text() for text in figure.axes[0].texts)
    assert all(f"{name}: " in texts for name in gear)
    assert not faults(figure)


def test_an_allocation_says_first_what_each_joint_may_have():
    robot, poses = played_in(["shoulder_pan_joint", "elbow_joint"], 0.0)
    allotment = allocate(robot, poses, 5e-4)
    figure = design.allocation(allotment, "; assumed: bearings")
    answer = f"for at most 0.5 mm at {robot.tool}: {allotment.chosen}; assumed: bearings"
    assert figure.get_suptitle() == answer
    allowed, added, cost = figure.axes
    assert [axes.get_xlabel().rpartition("[")[2] for axes in figure.axes] == ["µm]", "mm]", "%]"]
    assert np.allclose([bar.get_width() for bar in allowed.patches], 1e6 * allotment.clearance)
    assert sum(bar.get_width() for bar in cost.patches) == pytest.approx(100.0)
    for axes in (allowed, added, cost):  # bars stand on their ticks
        middles = [bar.get_y() + 0.5 * bar.get_height() for bar in axes.patches]
        assert np.allclose(middles, axes.get_yticks())
    assert not faults(figure)


# Machado et al. 2009, severity 1, of linear RGB.
SIGHT = {
    "usual": np.eye(3),
    "deuteranopia": [
        [0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413],
        [-0.011820, 0.042940, 0.968881],
    ],
    "protanopia": [
        [0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216],
        [-0.003882, -0.048116, 1.051998],
    ],
}  # fmt: skip
TELLABLE = 20.0
"""Least CIELAB distance of neighbouring colours (judged: black and white are 100 apart; green and
pink of equal lightness, which protanopes confuse, 18)."""


def lab(colour, sight):
    """CIELAB under D65 of a colour as it is seen (IEC 61966-2-1, CIE 15)."""
    rgb = np.array(to_rgb(colour))
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    seen = np.clip(np.array(SIGHT[sight]) @ linear, 0.0, 1.0)
    matrix = [
        [0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750],
        [0.0193339, 0.1191920, 0.9503041],
    ]  # fmt: skip
    x, y, z = np.array(matrix) @ seen / [0.95047, 1.0, 1.08883]
    x, y, z = (
        np.cbrt(t) if t > (6 / 29) ** 3 else t / (3 * (6 / 29) ** 2) + 4 / 29 for t in (x, y, z)
    )
    return np.array([116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)])


@pytest.mark.parametrize(
    "colours",
    [
        palette.COLOURS,
        palette.CONTACT_COLOURS,
        list(palette.AXIS_COLOURS.values()),
        *(palette.many(number) for number in (4, 7, 12, 20)),
    ],
)
@pytest.mark.parametrize("sight", SIGHT)
def test_neighbouring_series_differ_for_all_eyes(colours, sight):
    seen = [lab(colour, sight) for colour in colours]
    assert min(np.linalg.norm(one - other) for one, other in pairwise(seen)) > TELLABLE


def test_columns_of_a_reports_table_stand_apart():
    long = ["0.06110 ± 0.00018", "6540 ± 1840 uncertain", "0.22904 ± 0.00006", "0.5932 ± 0.0012"]
    grid = Grid(["", "ideal", *"abcd"], [["tool error, peak [mm]", "–", *long]] * 9)
    parts = [Points(["The answer."]), Beside([[grid]]), Points(["word " * 30] * 90)]
    with style("screen"):
        page = pdf._answer("Machine", parts, 0.0)
        page.draw_without_rendering()
    assert page.get_size_inches() == pytest.approx([8.27, 11.69])  # however much there is to say
    (table,) = page.findobj(Table)
    boxes = {at: cell.get_text().get_window_extent() for at, cell in table.get_celld().items()}
    digit = boxes[0, 2].width  # a letter's
    gaps = [boxes[1, k + 1].x0 - boxes[1, k].x1 for k in range(5)]
    assert min(gaps) > 1.5 * digit
    assert min(t.get_window_extent().y0 for t in page.findobj(Text) if t.get_text()) > 0.0
    written = pdf.pdf("Machine", [(Block("At a glance", iter), parts)])
    assert len(re.findall(rb"/Type /Page\b", written)) == 1
