"""Linkages drawn by points: their tree, their loops, their masses, and what cannot be."""

import numpy as np
import pytest

import jointplay as jp
from jointplay.accuracy.poses import along_motion
from jointplay.cli.commands.init import LINKAGES
from jointplay.model.linkage_tree import inertia_of, tree_of
from jointplay.scenario import Scenario

CRANK, ROD = 0.05, 0.12


def slider_crank(**changes):
    given = {
        "points": {"O": (0, 0), "A": ("50 mm", 0), "B": (CRANK + ROD, 0)},
        "ground": ["O"],
        "links": {
            "crank": jp.LinkageLink(["O", "A"], mass=0.3, inertia=1e-4),
            "rod": {"points": ["A", "B"], "mass": "0.21 kg", "inertia": 2.5e-4},
            "slider": jp.LinkageLink(["B"], mass=0.14),
        },
        "sliders": {"guide": jp.LinkageSlider("slider", (1, 0))},
    }
    return jp.Linkage(**(given | changes))


def turns(count=1.0, joint="O", speed=10.0):
    end = 2 * np.pi * count / speed
    return jp.Motion([joint], [0, end], [[0], [2 * np.pi * count]], "constant-speed")


def test_a_slider_crank_moves_as_its_closed_form():
    mechanism = jp.Mechanism(slider_crank())
    assert mechanism.tool == "slider"
    q = along_motion(mechanism, turns())
    angle = q[:, mechanism.coordinate("O")]
    place = CRANK * np.cos(angle) + np.sqrt(ROD**2 - (CRANK * np.sin(angle)) ** 2)
    np.testing.assert_allclose(q[:, mechanism.coordinate("guide")], place - CRANK - ROD, atol=1e-9)


def test_it_is_the_machine_that_a_urdf_describes():
    """The shipped slider-crank, written by hand as a URDF with a loop, beside the drawn one."""
    pin = jp.RevoluteClearance.planar(
        bearing_radius=0.01, bearing_length=0.02, radial_clearance=5e-4, restitution=0.9
    )
    speed = 200.0
    drawn = jp.simulate(
        jp.Mechanism(slider_crank(plane="horizontal"), {"B": pin}, gravity="balanced"),
        turns(0.2, speed=speed),
        drive={"O": jp.loads.Prescribed()},
        step=2e-6,
    )
    written = jp.simulate(
        jp.Mechanism(
            jp.shipped("slider_crank.urdf"),
            {"piston_pin": pin},
            loops={"piston_pin": jp.Loop("rod", "slider", bearing_xyz=(ROD, 0, 0))},
            gravity="balanced",
            tool="slider",
        ),
        turns(0.2, "crank_pin", speed),
        drive={"crank_pin": jp.loads.Prescribed()},
        state={"guide": CRANK + ROD},
        step=2e-6,
    )
    for name in ("tool_position", "joint_force"):
        one, other = drawn[name].values, written[name].values
        assert np.abs(one).max() > 0.1
        np.testing.assert_allclose(one, other, atol=1e-6 * np.abs(other).max())


def test_gravity_acts_in_the_plane_of_a_vertical_linkage_only():
    swings = {"points": {"O": (0, 0), "A": (0.1, 0)}, "ground": ["O"]}
    links = {"bar": jp.LinkageLink(["O", "A"], mass=1.0)}
    upright = jp.Mechanism(jp.Linkage(**swings, links=links))
    level = jp.Mechanism(jp.Linkage(**swings, links=links, plane="horizontal"))
    results = [
        jp.simulate(machine, drive={"O": jp.loads.Free()}, duration=0.05)
        for machine in (upright, level)
    ]
    falls, rests = (float(result["q"].values[-1, 0]) for result in results)
    assert falls < -0.1  # the right end sinks: counter-clockwise is positive, as drawn
    assert rests == 0.0


def test_a_link_has_the_mass_of_its_section_and_that_of_its_lines():
    points = {"A": (0, 0), "B": (0.3, 0), "C": (0.3, 0.4)}
    rod = jp.LinkageLink(["A", "B"], section="rod 10 mm", material=jp.material("aluminium"))
    frame = jp.LinkageLink(["A", "B", "C"], mass=1.2)
    drawn = jp.Linkage(points=points, ground=["A"], links={"rod": rod, "frame": frame})
    body = inertia_of(drawn, "rod")
    mass = np.pi * 0.005**2 * 0.3 * jp.material("aluminium").density
    assert body.mass == pytest.approx(mass)
    assert body.inertia[2, 2] == pytest.approx(mass * (0.3**2 / 12 + 0.005**2 / 4))
    assert body.inertia[0, 0] == pytest.approx(0.5 * mass * 0.005**2)
    # A triangle of wires of 0.3, 0.4 and 0.5 m: its centre is the mean of their middles by length.
    middles, lengths = np.array([[0.15, 0], [0.3, 0.2], [0.15, 0.2]]), np.array([0.3, 0.4, 0.5])
    body = inertia_of(drawn, "frame")
    np.testing.assert_allclose(body.lever[:2], lengths @ middles / 1.2)


def test_loops_are_cut_at_joints_with_play_and_never_at_a_slider():
    drawn = slider_crank()
    assert set(tree_of(drawn).loops) == {"B"}
    assert set(tree_of(drawn, ["A"]).loops) == {"A"}
    assert set(tree_of(drawn, ["O"]).loops) == {"O"}
    assert set(tree_of(drawn, ["guide"]).loops) == {"B"}


def test_where_three_links_meet_the_first_carries_the_others():
    drawn = jp.Linkage(
        points={"O": (0, 0), "A": (0.1, 0), "B": (0.2, 0), "C": (0.1, 0.1)},
        ground=["O"],
        links={
            "crank": jp.LinkageLink(["O", "A"], mass=1.0),
            "one": jp.LinkageLink(["A", "B"], mass=1.0),
            "two": jp.LinkageLink(["A", "C"], mass=1.0),
        },
    )
    joints = jp.Mechanism(drawn).joints
    assert set(joints) == {"O", "A_one", "A_two"}


def test_balls_of_a_spatial_linkage_stay_as_far_apart_as_drawn():
    text = LINKAGES["spatial"].read_text(encoding="utf-8").replace('kind = "spherical"', "")
    ideal = Scenario(
        text[: text.index("[joints.B]")] + text[text.index("[integration]") :], "spatial.toml"
    ).simulation()
    q = along_motion(ideal.mechanism, ideal.motion)
    crank, rocker = (q[:, ideal.mechanism.coordinate(name)] for name in ("O", "C"))
    still = np.zeros(len(q))
    near = 0.03 * np.array([np.cos(crank), np.sin(crank), still])
    far = np.array([0.1 + still, 0.1 * np.cos(rocker), 0.12 + 0.1 * np.sin(rocker)])
    assert np.ptp(rocker) > 0.1
    drawn = np.linalg.norm(np.subtract((0.1, 0.1, 0.12), (0.03, 0.0, 0.0)))
    np.testing.assert_allclose(np.linalg.norm(far - near, axis=0), drawn, atol=1e-8)


@pytest.mark.parametrize("name", LINKAGES)
def test_every_linkage_to_start_from_can_be_put_together_and_turns(name):
    scenario = Scenario.load(LINKAGES[name])
    simulation = scenario.simulation()
    assert not scenario.notes
    rods = any("inertia of" in line for line in scenario.assumptions)
    assert rods == (name not in ("spatial", "cam"))  # with sections; with links at one point
    assert np.ptp(along_motion(simulation.mechanism, simulation.motion), axis=0).all()


CRANK_LINK = 'links.crank = { points = ["O", "A"], mass = "0.3 kg" }'
GUIDE = 'sliders.guide = { link = "slider", along = [1, 0] }'


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('A = ["50 mm", 0]', "A = [0, 0]", "line 6, linkage.points.A: points 'O' and 'A' are in"),
        ('A = ["50 mm", 0]', "A = [0.05, 0, 0]", "line 6, linkage.points: points have two"),
        ('ground = ["O"]', 'ground = ["Q"]', "line 7, linkage.ground: no point 'Q'"),
        (CRANK_LINK, 'links.crank = { points = ["O", "A"] }', "line 8, linkage.links.crank.mass"),
        (CRANK_LINK, 'links.crank = { points = ["A", "A"], mass = 1.0 }', "one or several points"),
        ('["B"], mass', '["Z"], mass', "line 10, linkage.links.slider.points: no point 'Z'"),
        (GUIDE, GUIDE.replace("[1, 0]", "[0, 0]"), "linkage.sliders.guide.along: along has no"),
        (GUIDE, GUIDE.replace("[1, 0]", "[1, 0, 0]"), "sliders.guide.along: give 2 components"),
        (GUIDE, GUIDE.replace("guide", "O"), "linkage.sliders.O: two joints are called 'O'"),
        (GUIDE, f"{GUIDE}\noutput = 'rodd'", "linkage.output: no output 'rodd'; did you mean"),
        (GUIDE, f"{GUIDE}\nballs = ['B']", "linkage.balls: balls are of a spatial linkage"),
        ("[motion]", "[robot]\nurdf = 'ur5'\n[motion]", "[robot] urdf or [linkage], not both"),
        ("speeds.O", "speeds.crank", "line 14, motion.speeds.crank: no moving joint 'crank'"),
        ('speeds.O = "600 rpm"', "", "the motion needs one of"),
    ],
)
def test_what_cannot_be_is_refused_with_its_place(old, new, said):
    text = LINKAGES["slider-crank"].read_text(encoding="utf-8")
    assert old in text
    with pytest.raises(jp.JointplayError, match=said.replace("[", r"\[")):
        Scenario(text.replace(old, new), "crank.toml").simulation()


def test_a_link_that_nothing_holds_is_named():
    loose = {"points": {"O": (0, 0), "A": (1, 0), "B": (2, 0), "C": (3, 0)}, "ground": ["O"]}
    links = {
        "bar": jp.LinkageLink(["O", "A"], mass=1.0),
        "other": jp.LinkageLink(["B", "C"], mass=1.0),
    }
    with pytest.raises(jp.JointplayError, match="link 'other' is not connected to the ground"):
        jp.Mechanism(jp.Linkage(**loose, links=links))


def test_a_crank_that_cannot_turn_all_the_way_is_said_to_be():
    text = LINKAGES["four-bar"].read_text(encoding="utf-8")
    text = text.replace('A = ["40 mm", 0]', 'A = ["90 mm", 0]')
    with pytest.raises(jp.JointplayError, match=r"cannot be closed with O .*prescribed"):
        Scenario(text, "crank.toml").simulation()
    scenario = Scenario(f'drive.kind = "computed-torque"\n{text}', "crank.toml")
    scenario.simulation()
    assert "cannot be closed with O" in " ".join(scenario.notes)


def test_a_pin_can_be_the_output_and_is_the_point_of_the_first_link_there():
    """The pen of a five-bar is where its two arms meet."""
    drawn = jp.Linkage(
        points={"O": (0, 0), "A": (-0.08, 0.1), "P": (0.06, 0.24), "B": (0.2, 0.1), "C": (0.12, 0)},
        ground=["O", "C"],
        links={
            name: jp.LinkageLink(tuple(ends), mass=0.1)
            for name, ends in {"left": "OA", "right": "CB", "one": "AP", "other": "PB"}.items()
        },
        output="P",
    )
    mechanism = jp.Mechanism(drawn)
    assert mechanism.tool == "P"
    result = jp.simulate(
        mechanism,
        jp.Motion(["O", "C"], [0, 0.1], [[0, 0], [0.1, 0.1]], "constant-speed"),
        duration=1e-3,
        estimate=False,
    )
    np.testing.assert_allclose(result["tool_position"].values[0], (0.06, 0, 0.24), atol=1e-12)


def test_what_a_slider_drives_is_followed_in_steps_that_suit_its_lengths():
    """An elliptic trammel of 200 mm, driven along one of its lines past the middle."""
    drawn = jp.Linkage(
        points={"A": (0.16, 0), "B": (0, 0.12)},
        ground=[],
        links={
            "across": jp.LinkageLink(["A"], mass=0.2),
            "up": jp.LinkageLink(["B"], mass=0.2),
            "bar": jp.LinkageLink(["A", "B"], mass=0.3),
        },
        sliders={
            "row": jp.LinkageSlider("across", (1, 0)),
            "column": jp.LinkageSlider("up", (0, 1)),
        },
    )
    mechanism = jp.Mechanism(drawn)
    motion = jp.Motion(["row"], [0, 1], [[0], [-0.3]], "constant-speed")
    q = along_motion(mechanism, motion, 9)
    across, up = (q[:, mechanism.coordinate(name)] for name in ("row", "column"))
    np.testing.assert_allclose(np.hypot(0.16 + across, 0.12 + up), 0.2, atol=1e-9)
    assert (0.12 + up).min() > 0.1  # it stays on its side


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("B = [", "Q = [1, 1], B = [", "linkage.points.Q: no link has the point 'Q'"),
        (
            CRANK_LINK,
            f'{CRANK_LINK[:-2]}, section = "rod 5 mm" }}',
            "a mass or a section, not both",
        ),
    ],
)
def test_what_would_be_left_out_in_silence_is_refused(old, new, said):
    text = LINKAGES["slider-crank"].read_text(encoding="utf-8")
    assert old in text
    with pytest.raises(jp.JointplayError, match=said):
        Scenario(text.replace(old, new), "crank.toml").simulation()


def test_an_axis_without_direction_is_refused():
    text = LINKAGES["spatial"].read_text(encoding="utf-8").replace("C = [1, 0, 0]", "C = [0, 0, 0]")
    with pytest.raises(jp.JointplayError, match=r"linkage.axes.C: an axis without a direction"):
        Scenario(text, "spatial.toml").simulation()
