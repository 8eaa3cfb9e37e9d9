"""Seats: bearings whose surfaces slide, and that give way in what carries them."""

import math
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

import jointplay as jp
from jointplay import cli
from jointplay.accuracy import poses
from jointplay.accuracy.causes import CAUSES
from jointplay.accuracy.error_budget import budget
from jointplay.base.errors import JointplayError
from jointplay.model.robots import shipped
from jointplay.physics.contact.resultant import NoFriction
from jointplay.scenario import Scenario
from jointplay.simulation.loads.drive import Prescribed

RADIAL, AXIAL, TILT, TORSION = 2e7, 1e7, 4e3, 3e3
SOFT = jp.Elasticity(radial=RADIAL, axial=AXIAL, tilt=TILT, torsion=TORSION)
WEIGHT, GRAVITY, PLAY = 2.0 * 9.81, 9.81, 1e-4
LEVEL = "0 -1.5707963267948966 0"
"""Orientation of a joint whose z is level and whose x points upwards."""

PIN = jp.RevoluteClearance(radial_clearance=PLAY, axial_clearance=PLAY)
FLAT = jp.RevoluteClearance.planar(radial_clearance=PLAY)
SLIDER = jp.PrismaticClearance(clearance=PLAY, planar=True)
BALL = jp.SphericalClearance(radial_clearance=PLAY)
ROD = jp.CylindricalClearance(radial_clearance=PLAY)


def text(kind, axis="0 0 1", centre="0 0 0", rpy="0 0 0.5"):
    direction = "" if kind == "floating" else f'<axis xyz="{axis}"/>'
    return f"""<robot name="arm"><link name="base"/><link name="arm"><inertial>
<origin xyz="{centre}"/><mass value="2.0"/>
<inertia ixx="0.004" iyy="0.02" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="pin" type="{kind}"><origin xyz="0.1 0.2 0.3" rpy="{rpy}"/><parent link="base"/>
<child link="arm"/>{direction}<limit lower="-3" upper="3" effort="100" velocity="10"/></joint>
</robot>"""


@pytest.fixture
def arm(tmp_path):
    """A body of 2 kg on one joint."""

    def made(joint, kind=None, *, options=None, **geometry):
        path = tmp_path / "arm.urdf"
        path.write_text(text(kind or type(joint).replaces[0], **geometry))
        return jp.Mechanism(path, {"pin": joint}, **(options or {}))

    return made


def at_rest(robot, **options):
    """Where the tool rests beside the ideal one, by a run and by the static budget."""
    motion = jp.Motion(["pin"], [0.0, 1.0], [[0.0], [0.0]])
    driven = "pin" in robot.joints and not robot.given_joints["pin"].compound()
    options = {"duration": 0.01, "estimate": False} | options
    options |= {"drive": "prescribed"} if driven else {"drive": "free"}
    result = jp.simulate(robot, motion if driven else None, start="rest", **options)
    assert np.ptp(result["tool_position"].values, axis=0) == pytest.approx(np.zeros(3), abs=1e-10)
    ideal = pin.Data(robot.ideal().model)
    pin.framesForwardKinematics(robot.ideal().model, ideal, np.zeros(robot.ideal().model.nq))
    where = ideal.oMf[robot.ideal().tool_frame].translation
    found = budget(robot, {}, drive=Prescribed()).rest_tool[0, :3]
    run = result["tool_position"].values[-1] - where
    assert run == pytest.approx(found, abs=1e-9)
    return run


@pytest.mark.parametrize(
    ("joint", "rpy", "stiffness"),
    [
        (PIN, "0 0 0", AXIAL),
        (FLAT, LEVEL, RADIAL),
        (SLIDER, LEVEL, RADIAL),
        (BALL, "0 0 0.5", AXIAL),
        (ROD, LEVEL, RADIAL),
    ],
    ids=["pin-upright", "pin-level", "slider", "ball", "rod"],
)
def test_a_seat_gives_way_by_load_over_stiffness_beyond_the_play(arm, joint, rpy, stiffness):
    """Load of the mount: the arm's weight and the bush's; play and contact are as without."""
    alone = at_rest(arm(joint, rpy=rpy))
    assert alone[2] == pytest.approx(-PLAY, rel=2e-2)  # contacts give way by no more
    seated = at_rest(arm(replace(joint, seat=SOFT, seat_mass=0.5), rpy=rpy))
    given = -(WEIGHT + 0.5 * GRAVITY) / stiffness
    assert seated - alone == pytest.approx([0.0, 0.0, given], rel=1e-5, abs=1e-11)


def test_the_bush_of_an_exchanged_joint_hangs_on_the_journal(arm):
    """Then the mount bears the arm alone, and the contact bears the bush as well."""
    one = replace(BALL, exchanged=True, stiffness=1e13)
    alone = at_rest(arm(one), step=1e-6)
    seated = at_rest(arm(replace(one, seat=SOFT, seat_mass=0.5)), step=1e-6)
    assert seated[2] - alone[2] == pytest.approx(-WEIGHT / AXIAL, rel=1e-2)
    robot = arm(replace(PIN, exchanged=True, seat=SOFT), axis="0 0.6 0.8")
    assert robot.description.joints["pin_seat"].parent == "pin_bush"
    assert robot.description.joints["pin"].parent == "base"


@pytest.mark.parametrize("exchanged", [False, True])
def test_bodies_stand_where_they_stood_and_the_mounts_z_is_the_joints_axis(arm, exchanged):
    joint = replace(PIN, exchanged=exchanged)
    plain = arm(joint, axis="0 0.6 0.8")
    seated = arm(replace(joint, seat=SOFT), axis="0 0.6 0.8")
    for robot in (plain, seated):
        pin.framesForwardKinematics(robot.model, robot.data, np.zeros(robot.model.nq))
    for name in ("base", "arm"):
        frames = [one.data.oMf[one.model.getFrameId(name)] for one in (plain, seated)]
        assert frames[0].isApprox(frames[1], 1e-12)
    (index, bearing), _ = plain.frames("pin")
    wanted = plain.data.oMi[index] * bearing
    for name in ("pin", "pin_seat"):
        (index, place), _ = seated.frames(name)
        found = seated.data.oMi[index] * place
        assert found.translation == pytest.approx(wanted.translation, abs=1e-12)
        assert found.rotation[:, 2] == pytest.approx(wanted.rotation[:, 2], abs=1e-12)
    own = pin.computeTotalMass(seated.model) - pin.computeTotalMass(plain.model)
    ring = math.pi * (15e-3**2 - 10e-3**2) * 40e-3 * 7850.0
    assert own == pytest.approx(ring)
    moving = ring if exchanged else 0.0  # without clearance the ground carries the other
    assert pin.computeTotalMass(seated.ideal().model) == pytest.approx(2.0 + moving)
    assert seated.ideal().coordinates == ("pin",)


@pytest.mark.parametrize(
    ("joint", "bodies"),
    [
        (PIN, [(1.0, "tube", 15e-3, 40e-3), (-1.0, "tube", 10e-3, 40e-3)]),
        (BALL, [(1.0, "ball", 15e-3, 0.0), (-1.0, "ball", 10e-3, 0.0)]),
    ],
    ids=["tube", "ball"],
)
def test_a_bush_has_the_inertia_of_its_form(arm, joint, bodies):
    robot = arm(replace(joint, seat=SOFT))
    found = robot.model.inertias[robot.model.getJointId("pin_seat")]
    mass, about = 0.0, np.zeros(3)
    for sign, form, r, length in bodies:
        if form == "ball":
            m = sign * 7850.0 * 4.0 / 3.0 * math.pi * r**3
            about += 0.4 * m * r * r
        else:
            m = sign * 7850.0 * math.pi * r * r * length
            across = m * (r * r / 4.0 + length**2 / 12.0)
            about += [across, across, m * r * r / 2.0]
        mass += m
    assert found.mass == pytest.approx(mass)
    assert np.diag(found.inertia) == pytest.approx(about)


def falling(arm, stiffness, **options):
    """A ball that falls through its clearance without any loss, and bounces."""
    seat = None
    if stiffness is not None:
        turn = 2e-4 * stiffness
        numbers = {"radial": stiffness, "axial": stiffness, "tilt": turn, "torsion": turn}
        seat = jp.Elasticity(**numbers, damping_time=0.0)
    joint = replace(BALL, restitution=1.0, friction=NoFriction(), seat=seat)
    options = {"duration": 0.02, "step": 1e-6, "estimate": False} | options
    return jp.simulate(arm(joint), None, drive="free", start="centred", **options)


def test_without_friction_and_damping_no_energy_is_lost(arm):
    for stiffness in (2e7, 2e8):
        result = falling(arm, stiffness)
        assert result.audit.impacts >= 2
        assert result.audit.relative_energy_residual < 1e-5
        total = result.audit.energy_exchanged
        assert total > 0.015  # the fall itself, and what goes to and fro


def test_a_stiffer_and_stiffer_seat_is_none(arm):
    """The first impact's peak force differs by as much as the seat gives way beside the contact."""
    rigid = float(falling(arm, None)["joint_force_peak"].sel(joint="pin").values.max())
    away = []
    for stiffness in (2e9, 2e10):
        forces = falling(arm, stiffness, duration=6e-3)["joint_force_peak"].sel(joint="pin")
        away.append(1.0 - float(np.linalg.norm(forces.values, axis=1).max()) / rigid)
    assert 0.0 < away[1] < 0.02 < away[0] < 0.12
    assert away[0] / away[1] == pytest.approx(10.0, rel=0.3)


def test_budgets_have_play_and_elasticity_of_a_seat(arm):
    robot = arm(replace(PIN, seat=SOFT, seat_mass=0.5), axis="0 1 0", centre="0.1 0.05 0")
    push = np.array([30.0, -20.0, 50.0])
    static = budget(robot, {"pin": 0.3}, force=push)
    assert static.joints == ("pin", "pin_seat")
    assert static.worst_parts[0, 0] == pytest.approx(static.worst[0])
    assert static.worst_parts[0, 1] == 0.0
    found = budget(robot, {"pin": 0.3}, force=push, kind="industrial", causes=CAUSES)
    by = {(one.joint, one.cause): one for one in found.model.contributions}
    at = found.model.names.index("pin_seat")
    assert by["pin", "play"].set is not None
    assert by["pin", "elasticity"].shift.any()
    seat = by["pin_seat", "elasticity"]
    # J K^-1 J^T W, with Jacobians of the mechanism itself.
    q = robot.configuration({"pin": 0.3})
    model, data = robot.model, robot.data
    pin.computeJointJacobians(model, data, q)
    pin.framesForwardKinematics(model, data, q)
    axes = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    first = robot.virtual_link("pin_seat")
    tool = np.array(pin.getFrameJacobian(model, data, robot.tool_frame, axes))[:, first : first + 6]
    moment = tool[:3].T @ push - pin.computeGeneralizedGravity(model, data, q)[first : first + 6]
    compliance = np.diag([1 / RADIAL, 1 / RADIAL, 1 / AXIAL, 1 / TORSION, 1 / TILT, 1 / TILT])
    away = tool @ compliance @ moment  # yaw, pitch, roll: about z, y, x
    assert (found.model.jacobian[at, 0] @ seat.shift[0]) == pytest.approx(away, rel=1e-9, abs=1e-15)


@pytest.mark.thorough
def test_a_pin_in_a_seat_closes_a_loop():
    """The rod bears push / cos(rod), its mount gives way along it, the slider by 1 / cos(rod)."""
    loops = Scenario.load("jointplay:slider_crank.toml").simulation("ideal").mechanism.loops
    still = {"loops": loops, "tool": "slider", "gravity": (0.0, 0.0, 0.0)}

    def rests(exchanged, seat, push):
        joint = replace(PIN, stiffness=1e14, exchanged=exchanged, seat=seat)
        robot = jp.Mechanism(shipped("slider_crank.urdf"), {"piston_pin": joint}, **still)
        q = poses.at_pose(robot, {"crank_pin": 1.0}, near={"guide": 0.17})
        return budget(robot, q, drive=Prescribed(), force=(push, 0, 0)).rest_tool[0, 0]

    rod = math.asin(0.05 / 0.12 * math.sin(1.0))
    for exchanged in (False, True):
        for push in (200.0, -200.0):
            more = rests(exchanged, SOFT, push) - rests(exchanged, None, push)
            assert more == pytest.approx(push / RADIAL / math.cos(rod) ** 2, rel=1e-3)


def test_a_loop_with_a_seat_runs_and_agrees_with_its_statics():
    loops = Scenario.load("jointplay:slider_crank.toml").simulation("ideal").mechanism.loops
    robot = jp.Mechanism(
        shipped("slider_crank.urdf"), {"piston_pin": replace(PIN, seat=SOFT)}, loops=loops,
        tool="slider",
    )  # fmt: skip
    motion = jp.Motion(["crank_pin"], [0.0, 1.0], [[0.7], [0.7]])
    result = jp.simulate(
        robot, motion, drive="prescribed", start="rest", duration=5e-3, step=5e-6, estimate=False
    )
    assert np.ptp(result["tool_position"].values, axis=0) == pytest.approx(np.zeros(3), abs=1e-10)
    assert result.audit.relative_energy_residual < 1e-2 or result.audit.energy_residual < 1e-14


def test_a_joint_that_locks_freedoms_of_a_loop_can_have_no_seat():
    loops = Scenario.load("jointplay:slider_crank.toml").simulation("ideal").mechanism.loops
    with pytest.raises(JointplayError, match=r"piston_pin.*seat and locks z, pitch, roll"):
        jp.Mechanism(
            shipped("slider_crank.urdf"), {"piston_pin": replace(FLAT, seat=SOFT)}, loops=loops
        )


@pytest.fixture
def scenario_file(tmp_path, arm):
    """A scenario with a seat, in its first case."""
    arm(PIN)
    file = tmp_path / "seat.toml"
    file.write_text(
        '[robot]\nurdf = "arm.urdf"\n[joints.pin]\nradial_clearance = "0.1 mm"\n'
        'axial_clearance = "0.1 mm"\nseat_mass = "300 g"\n'
        'seat = { radial = "20 N/um", axial = 1e7, tilt = 4e3, torsion = 3e3 }\n'
        "[integration]\nduration = 0.01\n[cases.seat]\n[cases.rigid]\njoints.pin.ideal = true\n"
    )
    return file


@pytest.mark.parametrize("whole", [False, True])
def test_a_scenarios_budget_has_a_row_for_its_seat(scenario_file, whole, capsys):
    options = ["--whole", "industrial"] if whole else []
    assert cli.main(["budget", str(scenario_file), "--case", "seat", *options]) == 0
    rows = [line for line in capsys.readouterr().out.splitlines() if line.startswith("pin_seat")]
    assert len(rows) == 1
    assert ("elasticity" in rows[0]) == whole


def test_a_scenario_has_seats_and_a_result_keeps_them(tmp_path, arm, scenario_file):
    scenario = Scenario.load(scenario_file)
    robot = scenario.simulation("seat").mechanism
    assert robot == arm(replace(PIN, seat=SOFT, seat_mass=0.3))
    assert robot.clearance["pin"] == PIN
    assert robot.clearance["pin_seat"] == jp.CompliantMount(elasticity=SOFT)
    assert scenario.simulation("rigid").mechanism.coordinates == ("pin",)
    result = scenario.simulation("seat").run()
    result.save(tmp_path / "seat.h5")
    again = jp.Result.load(tmp_path / "seat.h5")
    assert again.joints == ["pin", "pin_seat"]
    assert jp.Mechanism.from_description(robot.describe()) == robot
    assert robot.with_clearance(robot.clearance) == robot
    path = tmp_path / "robot.urdf"
    path.write_text(jp.to_urdf(robot))
    assert jp.Mechanism(path, {}).description.joints["pin_seat"].kind == "fixed"


def test_views_show_a_joint_in_its_seat(tmp_path, arm):
    from jointplay.show.player import save_html

    robot = arm(replace(PIN, seat=SOFT))
    result = jp.simulate(robot, None, drive="free", duration=0.01, estimate=False)
    jp.report({"seat": result}, tmp_path / "report.html", pdf=False)
    assert "pin_seat" in (tmp_path / "report.html").read_text()
    save_html({"seat": result}, tmp_path / "page.html")
    assert (tmp_path / "page.html").stat().st_size > 1e5


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"seat": {"radial": -1e7, "axial": 1e7, "tilt": 1.0, "torsion": 1.0}}, "got -1e"),
        ({"seat": {"radial": 1e7, "axial": 1e7, "tilt": 1e3}}, "give radial, axial, tilt and tors"),
        ({"seat": {"matrix": np.eye(6).tolist(), "torsion": 5.0}}, "not both"),
        ({"seat": {"matrix": np.eye(5).tolist()}}, r"\(6, 6\), got \(5, 5\)"),
        ({"seat": {"radial": 1e7, "stiff": 1e7}}, "stiff"),
        ({"seat": 1e7}, "seat must be an Elasticity, not 10000000.0"),
        ({"seat_mass": 0.1}, "seat_mass 0.1 kg is of a bush in a seat"),
        ({"seat": SOFT, "seat_mass": -0.1}, "mass of the bush.*-0.1"),
    ],
)
def test_seats_that_cannot_be_are_refused(given, says):
    with pytest.raises(JointplayError, match=says):
        replace(PIN, **given)


def test_names_that_a_seat_needs_must_be_free(tmp_path, arm):
    robot = arm(replace(PIN, seat=SOFT))
    with pytest.raises(JointplayError, match=r"already has a 'pin_bush'.*from its own URDF again"):
        robot.with_clearance({"pin": replace(PIN, seat=SOFT)})


def test_allocation_decides_on_play_and_leaves_seats_as_given(arm):
    from jointplay.accuracy.allocation import allocate

    tip = {"axis": "0 1 0", "centre": "0.1 0.05 0"}
    seated, plain = (
        allocate(arm(one, **tip), {"pin": 0.3}, 5e-5) for one in (replace(PIN, seat=SOFT), PIN)
    )
    assert seated.joints == ("pin",)
    assert seated.clearance == pytest.approx(plain.clearance, rel=1e-6)
    assert seated.mechanism.clearance["pin_seat"] == jp.CompliantMount(elasticity=SOFT)


def test_a_seat_can_be_a_table_of_numbers(arm):
    numbers = {"radial": RADIAL, "axial": "10 N/um", "tilt": TILT, "torsion": TORSION}
    assert replace(PIN, seat=numbers).seat == SOFT
    plain = {**numbers, "axial": AXIAL}
    assert replace(BALL, seat=plain).seat == SOFT
