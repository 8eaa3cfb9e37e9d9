"""Flexible links: beams of segments against beam theory, in runs, statics and scenarios."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest
import scipy.linalg
from scipy.optimize import brentq

import jointplay as jp
from jointplay import cli
from jointplay.accuracy.error_budget import budget
from jointplay.base.errors import JointplayError
from jointplay.model.beams import CLAMPED_FREE, section
from jointplay.simulation.loads.drive import Prescribed

LENGTH = 1.0
STRIP = jp.FlexibleLink(section="bar 30x5 mm", material="aluminium", tip=(LENGTH, 0, 0))
HUB = """<robot name="strip"><link name="base"/><link name="arm"/>
<joint name="hub" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/>
<limit lower="-3" upper="3" effort="1000" velocity="10"/></joint></robot>"""
HELD = jp.Motion(["hub"], [0.0, 1.0], [[0.0], [0.0]])


@pytest.fixture
def strip(tmp_path):
    """A strip along x on a hub about y; its height is along z."""
    path = tmp_path / "strip.urdf"
    path.write_text(HUB)

    def made(flexible=STRIP, gravity=(0.0, 0.0, 0.0), **changes):
        return jp.Mechanism(path, flexible={"arm": replace(flexible, **changes)}, gravity=gravity)

    return made


def modes(robot, part=None):
    """Frequencies [Hz] of the linearised robot, its joints held; of the hinges' `part` only."""
    q = np.zeros(robot.model.nq)
    mass = pin.crba(robot.model, robot.model.createData(), q)
    mass = np.triu(mass) + np.triu(mass, 1).T
    stiff = np.zeros_like(mass)
    for name in robot.mounts:
        moves = robot.relative_jacobian(name, q)
        stiff += moves.T @ robot.clearance[name].elasticity.stiffness @ moves
    own = [
        k
        for k, one in enumerate(robot.coordinates)
        if one.joint in robot.mounts and part in (None, one.part)
    ]
    block = np.ix_(own, own)
    squares = scipy.linalg.eigh(stiff[block], mass[block], eigvals_only=True)
    return np.sqrt(squares) / (2.0 * np.pi)


def errors(found, theory):
    return np.abs(np.asarray(found)[: len(theory)] / theory - 1.0)


def test_the_roots_of_the_clamped_free_beam_are_those_of_its_equation():
    for guess, root in zip((1.8, 4.7, 7.8), CLAMPED_FREE, strict=True):
        found = brentq(lambda x: math.cos(x) * math.cosh(x) + 1.0, guess - 0.2, guess + 0.2)
        assert root == pytest.approx(found, rel=1e-10)


def test_three_bending_frequencies_in_both_planes_agree_with_theory_within_two_per_cent(strip):
    robot, beam = strip(), STRIP.beam
    theory = beam.frequencies(LENGTH)
    assert theory[0] == pytest.approx(
        3.516015 / (2 * np.pi) * math.sqrt(71.7e9 * 0.03 * 0.005**3 / 12 / (2710 * 1.5e-4)),
        rel=1e-6,
    )
    about_y, about_x = modes(robot, "pitch"), modes(robot, "roll")
    ratio = math.sqrt(beam.bending[1] / beam.bending[0])
    assert ratio == pytest.approx(6.0)  # width over height
    assert errors(about_x, theory).max() < 0.02
    assert errors(about_y, ratio * theory).max() < 0.02


def test_the_error_of_frequencies_falls_faster_than_the_square_of_the_segment(strip):
    theory = STRIP.beam.frequencies(LENGTH)
    found = {n: errors(modes(strip(segments=n), "roll"), theory) for n in (4, 8, 16)}
    for coarse, fine in ((4, 8), (8, 16)):
        assert (found[coarse] / found[fine] > 5.0).all(), found
    assert found[16].max() < 0.0015


def test_with_a_mass_at_its_tip_the_first_frequency_agrees_with_theory(tmp_path):
    beam = STRIP.beam
    tip_mass = beam.mass * LENGTH
    path = tmp_path / "tipped.urdf"
    path.write_text(
        HUB.replace(
            "</robot>",
            f'<link name="tip"><inertial><mass value="{tip_mass}"/><inertia ixx="1e-9" iyy="1e-9"'
            ' izz="1e-9" ixy="0" ixz="0" iyz="0"/></inertial></link><joint name="end" type="fixed">'
            f'<parent link="arm"/><child link="tip"/><origin xyz="{LENGTH} 0 0"/></joint></robot>',
        )
    )
    robot = jp.Mechanism(path, flexible={"arm": replace(STRIP, tip=None)})

    def equation(x):
        return (
            1.0 + math.cosh(x) * math.cos(x)
            + x * (math.cos(x) * math.sinh(x) - math.sin(x) * math.cosh(x))
        )  # fmt: skip

    root = brentq(equation, 1.0, 1.5)
    theory = beam.frequencies(LENGTH)[0] * (root / CLAMPED_FREE[0]) ** 2
    assert modes(robot, "roll")[0] == pytest.approx(theory, rel=1e-3)


def test_torsion_agrees_with_the_clamped_free_shaft(strip):
    beam = STRIP.beam
    theory = 0.25 / LENGTH * math.sqrt(beam.torsion / sum(beam.turning))
    assert modes(strip(), "yaw")[0] == pytest.approx(theory, rel=0.01)
    assert not [one for one in strip(torsion=False).coordinates if one.part == "yaw"]


def test_a_force_at_the_tip_bends_it_as_theory_says(strip):
    force, (about_x, about_y) = 0.05, STRIP.beam.bending
    theory = np.array([force / about_y, -force / about_x]) * LENGTH**3 / 3.0
    off = []
    for n in (3, 7):
        result = jp.simulate(
            strip(segments=n), HELD, drive="prescribed", duration=1e-3, start="rest",
            estimate=False, loads={"push": jp.loads.Wrench("arm_tip", force=(0, force, -force))},
        )  # fmt: skip
        tip = result["tool_position"].values
        assert np.ptp(tip, axis=0).max() < 1e-9  # it rests
        off.append(errors(tip[-1, 1:], theory).max())
    assert off[0] < 0.01
    assert off[1] < 0.001


def test_static_budgets_have_its_sag_under_its_weight(strip):
    robot, beam = strip(gravity="loaded"), STRIP.beam
    found = budget(robot, {}, drive=Prescribed())
    theory = -beam.mass * 9.81 * LENGTH**4 / (8.0 * beam.bending[0])
    assert found.rest_tool[0, 2] == pytest.approx(theory, rel=0.01)
    assert found.worst[0] == 0.0


def test_a_run_rings_at_its_first_frequency_with_its_damping_ratio(strip):
    robot = strip()
    run = jp.Run(jp.Simulation(
        robot, HELD, drive="prescribed", duration=1.5, start="centred", step=3e-5, record_every=10,
    ))  # fmt: skip
    for k, place in enumerate(STRIP.hinges(LENGTH)):  # bent as by a force at its tip
        at = robot.coordinates.index(f"arm_hinge_{k + 1}.roll")
        run.workspace.q[at] = 1e-3 * (LENGTH - place)
    result = run.finish(check_step=False)
    z, time = result["tool_position"].sel(axis="z").values, result.time
    rises = np.flatnonzero((z[:-1] < 0.0) & (z[1:] >= 0.0))
    assert len(rises) >= 5
    frequency = (len(rises) - 1) / (time[rises[-1]] - time[rises[0]])
    assert frequency == pytest.approx(STRIP.beam.frequencies(LENGTH)[0], rel=2e-3)
    peaks = [z[a:b].max() for a, b in pairwise(rises)]
    falls = np.log(peaks[1] / peaks[-1]) / (len(peaks) - 2)
    assert falls / (2.0 * np.pi) == pytest.approx(STRIP.damping_ratio, rel=0.05)
    assert abs(result.audit.relative_energy_residual) < 1e-5
    assert result.audit.judged_impacts == 0  # springs touch from the start on


def test_shear_adds_what_timoshenko_says(strip):
    stout = jp.FlexibleLink(section="tube 80x4 mm", material="steel", tip=(0.4, 0, 0))
    sag = []
    for shear in (False, True):
        robot = strip(stout, shear=shear)
        result = jp.simulate(
            robot, HELD, drive="prescribed", duration=1e-4, start="rest", step=1e-6,
            estimate=False, loads={"push": jp.loads.Wrench("arm_tip", force=(0, 0, -100.0))},
        )  # fmt: skip
        sag.append(float(result["tool_position"].values[-1, 2]))
    assert sag[1] / sag[0] - 1.0 == pytest.approx(stout.beam.shear_share(0.4), rel=0.01)
    assert stout.beam.shear_share(0.4) > 0.05


@pytest.mark.parametrize(
    ("text", "area", "about_x", "about_y", "torsion"),
    [
        ("rod 20 mm", math.pi * 1e-4, math.pi / 4 * 1e-8, math.pi / 4 * 1e-8, math.pi / 2 * 1e-8),
        ("bar 0.02x0.02 m", 4e-4, 0.02**4 / 12, 0.02**4 / 12, 0.140577 * 0.02**4),
        ("bar 10 x 100 mm", 1e-3, 0.01 * 0.1**3 / 12, 0.1 * 0.01**3 / 12, 0.3123 * 0.1 * 0.01**3),
        ("box 80x60x4 mm", 80e-3 * 60e-3 - 72e-3 * 52e-3,
         (80 * 60**3 - 72 * 52**3) / 12e12, (60 * 80**3 - 52 * 72**3) / 12e12,
         4 * (76e-3 * 56e-3) ** 2 * 4e-3 / (2 * (76e-3 + 56e-3))),
    ],
)  # fmt: skip
def test_sections_have_the_moments_of_the_textbook(text, area, about_x, about_y, torsion):
    found = section(text)
    assert found.area == pytest.approx(area)
    assert (found.about_x, found.about_y) == pytest.approx((about_x, about_y))
    assert found.torsion == pytest.approx(torsion, rel=1e-4)


def test_a_tube_is_a_rod_less_a_rod():
    tube, outer, inner = map(section, ("tube 80x4 mm", "rod 80 mm", "rod 72 mm"))
    for name in ("area", "about_x", "torsion"):
        assert getattr(tube, name) == pytest.approx(getattr(outer, name) - getattr(inner, name))


def test_explicit_stiffness_is_that_of_the_section_it_is_taken_from(strip):
    rod = jp.FlexibleLink(section="rod 20 mm", material="steel", tip=(LENGTH, 0, 0))
    given = jp.FlexibleLink(
        bending_stiffness=rod.beam.bending[0],
        torsion_stiffness=rod.beam.torsion,
        line_mass=rod.beam.mass,
        gyration_radius=10e-3 / math.sqrt(2.0),
        tip=(LENGTH, 0, 0),
    )
    assert modes(strip(given)) == pytest.approx(modes(strip(rod)), rel=1e-9)


FOREARM = jp.FlexibleLink(section="tube 80x4 mm", material="aluminium", segments=3)


def test_a_ur5_stands_where_it_stood_and_weighs_what_it_weighed():
    rigid, robot = jp.Mechanism("ur5"), jp.Mechanism("ur5", flexible={"forearm_link": FOREARM})
    assert robot.tool == rigid.tool
    assert robot.joints == rigid.joints
    assert robot.ideal().coordinates == rigid.coordinates
    assert pin.computeTotalMass(robot.model) == pytest.approx(pin.computeTotalMass(rigid.model))
    bent = {name: 0.1 * k for k, name in enumerate(rigid.joints)}
    for one in (rigid, robot):
        pin.framesForwardKinematics(one.model, one.data, one.configuration(bent))
    places = [one.data.oMf[one.tool_frame] for one in (rigid, robot)]
    assert places[0].isApprox(places[1], 1e-12)
    assert "of the URDF's 2.27 kg" in robot.flexible["forearm_link"]


def test_the_pieces_together_have_the_inertia_of_the_whole_beam(strip):
    robot, beam = strip(), STRIP.beam
    held = robot.ideal()
    found = held.model.inertias[held.model.getJointId("hub")]
    mass = beam.mass * LENGTH
    assert found.mass == pytest.approx(mass)
    assert found.lever == pytest.approx([LENGTH / 2, 0, 0], abs=1e-12)
    about_y = mass * LENGTH**2 / 12.0 + beam.turning[0] * LENGTH
    assert found.inertia[1, 1] == pytest.approx(about_y)  # the section's x lies along y
    assert found.inertia[0, 0] == pytest.approx(sum(beam.turning) * LENGTH)


def test_results_bring_it_back_without_the_original_urdf(strip):
    robot = strip()
    again = jp.Mechanism.from_description(robot.describe())
    assert again == robot
    assert again.hinges == {"arm": [f"arm_hinge_{k + 1}" for k in range(STRIP.segments)]}


def test_what_a_link_carries_half_way_bends_with_the_piece_below_it(tmp_path):
    path = tmp_path / "strip.urdf"
    carried = (
        '<link name="lamp"/><joint name="clamp" type="fixed"><parent link="arm"/>'
        '<child link="lamp"/><origin xyz="0.5 0 0.01"/></joint></robot>'
    )
    path.write_text(HUB.replace("</robot>", carried))
    robot = jp.Mechanism(path, flexible={"arm": replace(STRIP, segments=4)})
    assert robot.description.joints["clamp"].parent == "arm_3"  # hinges at 1/8, 3/8, 5/8, 7/8
    pin.framesForwardKinematics(robot.model, robot.data, np.zeros(robot.model.nq))
    lamp = robot.data.oMf[robot.model.getFrameId("lamp")]
    assert lamp.translation == pytest.approx([0.5, 0.0, 0.01])
    assert lamp.rotation == pytest.approx(np.eye(3), abs=1e-12)


def test_the_height_of_a_section_lies_where_it_is_asked_to(strip):
    upright, flat = strip(), strip(height_along=(0, 1, 0))
    force = {"push": jp.loads.Wrench("arm_tip", force=(0, 0, -0.01))}
    sags = [
        float(
            jp.simulate(
                one, HELD, drive="prescribed", duration=1e-4, start="rest", estimate=False,
                loads=force,
            )["tool_position"].values[-1, 2]
        )
        for one in (upright, flat)
    ]  # fmt: skip
    assert sags[0] / sags[1] == pytest.approx(36.0, rel=1e-3)


SCENARIO = """
[robot]
urdf = "example-robot-data:ur5"

[links.forearm_link]
flexible = {section = "tube 80x4 mm", material = "aluminium", segments = 3}

[joints.elbow_joint]
radial_clearance = "0.05 mm"

[motion]
times = [0, "0.1 s", "0.2 s"]
joints.shoulder_lift_joint = ["-60 deg", "-59 deg", "-60 deg"]
joints.elbow_joint = ["90 deg", "89 deg", "90 deg"]

[integration]
step = "5 us"
duration = "0.02 s"
estimate_errors = false

[output]
figures = false
"""


def test_a_ur5_with_a_flexible_forearm_and_play_in_its_elbow_runs(tmp_path, capsys):
    path = tmp_path / "ur5.toml"
    path.write_text(SCENARIO)
    assert cli.main(["run", str(path), "--out", str(tmp_path / "out")]) == 0
    captured = capsys.readouterr()
    said = captured.out + captured.err
    assert "link forearm_link: flexible, tube 80x4 mm, aluminium, 392.25 mm long" in said
    assert "the rest rigid at its centre of mass" in said
    assert "shear, left out, would add 7.1 %" in said
    assert ": play 0.797 (RMS 0.791), of 0.05 mm in elbow_joint, elasticity" in said
    assert "peak force in elbow_joint" in said
    assert "hinge" not in said


def test_check_says_what_is_made_of_a_link(tmp_path, capsys):
    path = tmp_path / "ur5.toml"
    path.write_text(SCENARIO)
    assert cli.main(["check", str(path)]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "link forearm_link" in said
    assert "bending, torsion, rigid otherwise" in said
    assert "hinge" not in said


@pytest.mark.thorough
def test_check_shows_the_matrix_and_locks_of_a_mount(tmp_path, capsys):
    path = tmp_path / "ur5.toml"
    rows = [[2e6 * (i == j) for j in range(6)] for i in range(6)]
    mount = (
        f'[joints.world_joint]\nkind = "compliant-mount"\nlocked = ["x", "yaw"]\n'
        f"elasticity = {{matrix = {rows}}}\n"
    )
    path.write_text(SCENARIO.replace("[motion]", f"{mount}\n[motion]"))
    assert cli.main(["check", str(path)]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "locked (x, yaw)" in said
    assert "matrix ((2e+06, 0, 0, 0, 0, 0)," in said


def test_playback_marks_the_joint_with_play_and_no_hinges(tmp_path):
    from jointplay.show.player.playback import build

    scenario = jp.Scenario(SCENARIO, tmp_path / "ur5.toml")
    result = scenario.simulation().run(check_step=False)
    contents = build({"one": result}, ghosts=False).contents
    marked = {one["name"]: one["marked"] for one in contents["cases"][0]["joints"]}
    assert [name for name, shown in marked.items() if shown] == ["elbow_joint"]
    assert len(marked) == 4
    assert contents["joint"] == "elbow_joint"


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("links.forearm_link", "links.forarm", "no link 'forarm'; did you mean"),
        ('"aluminium"', '"alumnium"', 'did you mean "aluminium"?'),
        ('"tube 80x4 mm"', '"pipe 80x4 mm"', 'possible are "tube 80x4 mm" (outside diameter'),
        ('"tube 80x4 mm"', '"tube 80 mm"', 'a tube has outside diameter and wall, as in "tube'),
        ('"tube 80x4 mm"', '"tube 80x4 kg"', '"80 kg" is not a length'),
        ('"tube 80x4 mm"', '"tube 80x40 mm"', "twice the wall must be less than"),
        ('"tube 80x4 mm"', '"bar 0x4 mm"', "sizes must be positive"),
        ("segments = 3", "segments = 0", "segments must be a whole number from 1 to 50, got 0"),
        ("segments = 3", "segments = 20", "is too large for the stiffness of 'forearm_link_hinge"),
        ("segments = 3", 'to = "elbow"', "no joint that link 'forearm_link' carries 'elbow'"),
        ("segments = 3", "tip = [0, 0, 0]", "has no length"),
        ("segments = 3", "height_along = [0, 0, 1]", "height_along lies along the beam"),
        (', material = "aluminium"', "", "a section needs a material"),
        (', material = "aluminium"', ", material = {}", "has no density"),
        ("segments = 3", "line_mass = 2", "give a section or line_mass, not both"),
        ('section = "tube 80x4 mm"', 'line_mass = "2 kg/m"', "missing: bending_stiffness, tors"),
        ("links.forearm_link", "links.tool0", "carries no joint at which its beam could end"),
    ],
)
def test_what_cannot_be_is_refused_with_file_and_line(old, new, words, tmp_path, capsys):
    assert old in SCENARIO
    path = tmp_path / "ur5.toml"
    path.write_text(SCENARIO.replace(old, new))
    assert cli.main(["check", str(path)]) != 0
    said = " ".join(capsys.readouterr().err.split())
    assert words in said
    assert "ur5.toml, line " in said


def test_a_link_that_carries_several_joints_asks_at_which_it_ends(tmp_path):
    path = tmp_path / "fork.urdf"
    more = "".join(
        f'<link name="{name}"/><joint name="to_{name}" type="continuous"><parent link="arm"/>'
        f'<child link="{name}"/><origin xyz="{x} 0 0"/></joint>'
        for name, x in (("left", 0.3), ("right", 0.6))
    )
    path.write_text(HUB.replace("</robot>", f"{more}</robot>"))
    with pytest.raises(JointplayError, match="give to, one of to_left, to_right, or tip"):
        jp.Mechanism(path, flexible={"arm": replace(STRIP, tip=None)})
    robot = jp.Mechanism(path, flexible={"arm": replace(STRIP, tip=None, to="to_right")})
    assert robot.description.joints["to_right"].parent == "arm_8"
    assert robot.description.joints["to_left"].parent == "arm_4"


@pytest.mark.thorough
def test_the_rod_of_a_slider_crank_bends_within_its_loop(tmp_path):
    scenario = jp.Scenario.load("jointplay:slider_crank.toml")
    rod = {"rod": {"flexible": {
        "section": "bar 8x12 mm", "material": "steel", "segments": 3, "tip": [0.12, 0, 0],
    }}}  # fmt: skip
    changes = {
        "links": rod, "integration": {"duration": 2e-3, "step": 2e-7, "estimate_errors": False},
    }  # fmt: skip
    simulation = scenario.simulation("0.1 mm", changes)
    assert simulation.mechanism.loops["piston_pin"].bearing_link == "rod_4"
    result = simulation.run(check_step=False)
    assert result.status == jp.Status.COMPLETED
    assert np.abs(result["q"].sel(coordinate="rod_hinge_2.pitch").values).max() > 1e-6
    assert abs(result.audit.relative_energy_residual) < 1e-3


def test_a_mount_that_locks_all_or_an_unknown_direction_is_refused():
    springs = jp.Elasticity(radial=1e6, axial=1e6, tilt=1e3, torsion=1e3)
    with pytest.raises(JointplayError, match="no direction to lock 'w'"):
        jp.CompliantMount(elasticity=springs, locked=("w",))
    with pytest.raises(JointplayError, match="must give way in some direction"):
        jp.CompliantMount(elasticity=springs, locked=("x", "y", "z", "yaw", "pitch", "roll"))
