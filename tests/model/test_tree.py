"""Histories against Pinocchio, record by record: motion, energies, poses, forces in joints."""

import dataclasses

import numpy as np
import pinocchio as pin
import pytest
from conftest import joint

import jointplay as jp
from jointplay.model.frames import carried
from jointplay.model.loop import PROXIMAL, Loop, misfit
from jointplay.model.tree import BodyMotion, Tree
from jointplay.physics.joints import PrismaticClearance, SphericalClearance
from jointplay.physics.kernel import Status
from jointplay.simulation.result.histories import histories

RECORDS = 40
PLAY = {"radial_clearance": 2e-4, "axial_clearance": 2e-4}
BALL = {"radial_clearance": 2e-4}
SLIDER = {"clearance": 2e-4, "clearance_y": 3e-4}
BODY = """
  <link name="{name}"><inertial>
    <origin xyz="0.1 0.02 -0.03" rpy="0.3 0.2 0.1"/><mass value="{mass}"/>
    <inertia ixx="0.02" iyy="0.03" izz="0.025" ixy="0.002" ixz="-0.003" iyz="0.001"/>
  </inertial></link>"""


@pytest.fixture
def branched(urdf):
    """Make a tree of six bodies on joints of all kinds and axes, with the given clearance."""
    path = urdf(
        *(BODY.format(name=f"l{i}", mass=1.0 + i) for i in range(6)),
        '<link name="tip"/>',
        joint("j0", "base", "l0", "revolute", "0 0 1", "0 0 0.1", "0.2 0.1 0.3"),
        joint("j1", "l0", "l1", "revolute", "0.6 0 0.8", "0.3 0.1 0", "0 0.4 -0.2"),
        joint("j2", "l1", "l2", "prismatic", "0 -0.6 0.8", "0.2 0 0.1", "1 0 0"),
        joint("j3", "l0", "l3", "revolute", "0 1 0", "0.1 -0.1 0"),
        joint("j4", "l3", "l4", "floating", "0 0 1", "0.3 0.1 0.2", "0.1 0.2 0.3"),
        joint("j5", "l3", "l5", "revolute", "0 0 -1", "0 0.2 0"),
        joint("flange", "l5", "tip", "fixed", at="0.1 0.2 0.3", rpy="0.3 0 1"),
    )

    def make(**clearance):
        joints = {"j4": SphericalClearance(ideal=True, **BALL)} | clearance
        gears = {"j3": jp.Gear(play=1e-3, rotor_inertia=0.2, stiffness=1e4)}
        made = jp.Mechanism(path, joints, gears=gears, gravity=(1.0, 2.0, -9.81))
        made.model.armature[:] = np.linspace(0.1, 0.5, made.model.nv)
        return made

    return make


CLEARANCE = {
    "ideal": {},
    "revolute": {"j1": jp.RevoluteClearance(**PLAY)},
    "revolute, tilt locked": {"j1": jp.RevoluteClearance(lock_tilt=True, **PLAY)},
    "planar, exchanged": {"j3": jp.RevoluteClearance.planar(radial_clearance=2e-4, exchanged=True)},
    "reversed axis": {"j5": jp.RevoluteClearance(**PLAY)},
    "slider": {"j2": PrismaticClearance(**SLIDER)},
    "slider, exchanged": {"j2": PrismaticClearance(exchanged=True, **SLIDER)},
    "ball": {"j4": SphericalClearance(**BALL)},
    "several": {
        "j0": jp.RevoluteClearance(exchanged=True, **PLAY),
        "j2": PrismaticClearance(**SLIDER),
        "j4": SphericalClearance(exchanged=True, **BALL),
    },
}
clearances = pytest.mark.parametrize("clearance", CLEARANCE.values(), ids=CLEARANCE.keys())


def states(mechanism, seed=0):
    rng = np.random.default_rng(seed)
    return (rng.uniform(-1.2, 1.2, (RECORDS, mechanism.model.nv)) for _ in range(3))


def agree(found, expected, limit=1e-12):
    found, expected = np.asarray(found), np.asarray(expected)
    assert found.shape == expected.shape
    assert np.abs(found - expected).max() <= limit * np.abs(expected).max()


def moved_by_pinocchio(mechanism, model, q, v, pairs):
    """Tool, energy, bearings and poses of one state, as in `Motion`."""
    data = model.createData()
    pin.forwardKinematics(model, data, q, v)
    tool = mechanism.tool_frame
    place = pin.updateFramePlacement(model, data, tool)
    speed = pin.getFrameVelocity(model, data, tool, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
    mass = pin.crba(model, model.createData(), q)  # Pinocchio's energy misses armature of balls
    energy = 0.5 * v @ mass @ v, pin.computePotentialEnergy(model, data)
    bearings, poses = [], []
    for (i, one), (j, two) in pairs:
        bearing, journal = data.oMi[i] * one, data.oMi[j] * two
        pose = bearing.actInv(journal)
        bearings.append(bearing.rotation.ravel())
        poses.append(np.concatenate([pose.translation, pose.rotation.ravel()]))
    turned = np.concatenate([place.rotation.ravel(), speed.angular])
    return np.concatenate([place.translation, speed.linear]), turned, energy, bearings, poses


def reactions_by_pinocchio(model, q, v, effort, joints, constraints):
    """Forces of the joints and of the constraints in one state, world axes."""
    data, models = model.createData(), pin.StdVec_RigidConstraintModel()
    models.extend(constraints)
    datas = pin.StdVec_RigidConstraintData()
    datas.extend([constraint.createData() for constraint in models])
    external = pin.StdVec_Force()
    external.extend([pin.Force.Zero()] * model.njoints)
    holds = []
    if constraints:
        pin.initConstraintDynamics(model, data, models, datas)
        a = pin.constraintDynamics(model, data, q, v, effort, models, datas, PROXIMAL).copy()
        pin.forwardKinematics(model, data, q)
        for constraint, found in zip(models, datas, strict=True):
            one, two = constraint.joint1_id, constraint.joint2_id
            push = constraint.joint1_placement.act(found.contact_force)
            world = data.oMi[one].act(push)
            external[one] += push
            external[two] -= data.oMi[two].actInv(world)
            holds.append(world.linear.copy())
    else:
        a = pin.aba(model, data, q, v, effort)
    pin.rnea(model, data, q, v, a, external)
    pin.forwardKinematics(model, data, q)
    forces = [data.oMi[index].rotation @ data.f[index].linear for index in joints]
    return np.array(forces), np.array(holds).reshape(-1, 3)


@clearances
def test_bodies_move_as_in_pinocchio(branched, clearance):
    mechanism = branched(**clearance)
    model = mechanism.model
    q, v, _ = states(mechanism)
    names = [*clearance, "j0", "j2", "j5"]
    pairs = [mechanism.frames(n) for n in dict.fromkeys(names)]
    motion, tool = BodyMotion.of(RECORDS, len(pairs)), carried(model, mechanism.tool_frame)
    for first, end in ((0, 7), (7, RECORDS)):
        Tree(model).move(motion, first, end, q, v, tool, pairs)
    expected = [
        moved_by_pinocchio(mechanism, model, *state, pairs) for state in zip(q, v, strict=True)
    ]
    tool, turned, energy, bearings, poses = (np.array(part) for part in zip(*expected, strict=True))
    agree(motion.tool, tool)
    rotations = [pin.Quaternion(w, x, y, z).toRotationMatrix() for w, x, y, z in motion.orientation]
    agree(np.reshape(rotations, (RECORDS, 9)), turned[:, :9])
    agree(np.linalg.norm(motion.orientation, axis=1), np.ones(RECORDS))
    agree(motion.spin, turned[:, 9:])
    agree(motion.energy, energy)
    agree(motion.bearings, bearings.transpose(1, 0, 2))
    agree(motion.poses, poses.transpose(1, 0, 2))


def test_forces_in_joints_are_those_of_pinocchio(branched):
    mechanism = branched()
    model = mechanism.model
    q, v, effort = states(mechanism, 1)
    joints = list(range(1, model.njoints))
    forces, holds = Tree(model).reactions(0, RECORDS, q, v, 50 * effort, joints, [])
    expected = [
        reactions_by_pinocchio(model, *state, joints, [])[0]
        for state in zip(q, v, 50 * effort, strict=True)
    ]
    agree(forces, expected, 1e-12)
    assert holds.shape == (RECORDS, 0, 3)


@pytest.mark.parametrize("kind", ["ball", "revolute", "ball twice"])
def test_forces_in_spatial_loops_are_those_of_pinocchio(branched, kind):
    """Between branches, and to the ground; a loop given twice is redundant."""
    mechanism = branched()
    points = {"l2": (0.3, 0.1, 0.2), "l4": (-0.1, 0.2, 0.1), "base": (0.5, -0.2, 0.4)}
    ends = [("l2", "l4")] * 2 if kind == "ball twice" else [("l2", "l4"), ("base", "l2")]
    loops = {
        f"c{k}": Loop(a, b, bearing_xyz=points[a], journal_xyz=points[b], journal_rpy=(k, 1, 0))
        for k, (a, b) in enumerate(ends[: 1 if kind == "revolute" else 2])
    }
    joints = {"j4": SphericalClearance(ideal=True, **BALL)}
    if kind != "revolute":
        joints |= {name: SphericalClearance(ideal=True, **BALL) for name in loops}
    closed = jp.Mechanism(mechanism.description.path, joints, loops=loops)
    q, v, effort = states(closed, 2)
    held = closed.constraints(q[0], 0.0)
    assert len(held) == 2
    wanted = [1, 2, 3, 4, 5, 6]
    found = Tree(closed.model).reactions(0, RECORDS, q, v, effort, wanted, held)
    expected = [
        reactions_by_pinocchio(closed.model, *state, wanted, held)
        for state in zip(q, v, effort, strict=True)
    ]
    forces, holds = (np.array(part) for part in zip(*expected, strict=True))
    agree(found[0], forces, 1e-10)
    agree(found[1], holds, 1e-4 if kind == "ball twice" else 1e-10)  # shared to rounding only
    if kind == "ball twice":
        agree(found[1].sum(axis=1), holds.sum(axis=1), 1e-10)
        agree(found[1][:, 0], found[1][:, 1], 1e-6)


def shipped_case(name, case):
    return jp.Scenario.load(f"jointplay:{name}.toml").simulation(case)


def scara(worn, **options):
    clearance = {name: jp.RevoluteClearance(**PLAY) for name in worn}
    robot = jp.Mechanism(jp.shipped("scara.urdf"), clearance, tool="suction_cup")
    return jp.Simulation(robot, jp.Motion.from_csv(jp.shipped("scara_motion.csv")), **options)


def grasping(worn):
    load = jp.Payload("suction_cup", 0.5, pick=2e-3, release=6e-3, centre=(0.02, 0.01, -0.05))
    return scara(worn, payloads=[load, jp.Payload("suction_cup", 1.0, pick=4e-3)])


def geared():
    gears = {"joint_a": jp.Gear(play=1e-3, rotor_inertia=0.2, stiffness=1e4)}
    robot = jp.Mechanism(jp.shipped("scara.urdf"), gears=gears, tool="suction_cup")
    return jp.Simulation(robot, jp.Motion.from_csv(jp.shipped("scara_motion.csv")))


RUNS = {
    "SCARA, ideal": lambda: scara([]),
    "SCARA, B": lambda: scara(["joint_b"]),
    "SCARA, A and B": lambda: scara(["joint_a", "joint_b"]),
    "SCARA with payloads, ideal": lambda: grasping([]),
    "SCARA with payloads, B": lambda: grasping(["joint_b"]),
    "SCARA with a gear": geared,
    "slider-crank, ideal": lambda: shipped_case("slider_crank", "ideal"),
    "slider-crank, 0.5 mm": lambda: shipped_case("slider_crank", "0.5 mm"),
    "four-bar, ideal": lambda: shipped_case("four_bar", "ideal"),
    "four-bar, 0.2 mm": lambda: shipped_case("four_bar", "0.2 mm"),
}


@pytest.mark.parametrize("make", RUNS.values(), ids=RUNS.keys())
def test_a_result_has_what_pinocchio_says_of_its_states(make):
    run = jp.Run(dataclasses.replace(make(), duration=0.01, record_every=20))
    mechanism = run.mechanism
    result = run.finish()
    q, v, drive = (result[name].values for name in ("q", "v", "drive"))
    starts = [phase.row for phase in run.phases]
    pairs = [mechanism.frames(name) for name in mechanism.clearance]
    moved, forces, drift = [], [], []
    trees, loops = mechanism.joints, list(mechanism.loops)
    effort = drive.copy()
    for name, friction in run.friction.items():
        at = mechanism.coordinate(name)
        effort[:, at] -= friction.torque(v[:, at])
    for i in range(len(q)):
        phase = run.phases[np.searchsorted(starts, i, side="right") - 1]
        model = phase.model
        moved.append(moved_by_pinocchio(mechanism, model, q[i], v[i], pairs))
        if mechanism.clearance:
            continue
        held = mechanism.constraints(q[min(phase.row, len(q) - 1)], 0.0)
        joints = [model.getJointId(name) for name in trees]
        force, holds = reactions_by_pinocchio(model, q[i], v[i], effort[i], joints, held)
        total = np.zeros((len(loops), 3))
        for constraint, hold in zip(held, holds, strict=True):
            total[loops.index(constraint.name)] += hold
        forces.append(np.concatenate([force, total]))
        drift.append([np.abs(part).max() for part in misfit(mechanism, q[i]).values()])
    tool, turned, energy, _, poses = (np.array(part) for part in zip(*moved, strict=True))
    agree(result["tool_angular_velocity"], turned[:, 9:], 1e-12)
    agree(result["tool_position"], tool[:, :3], 1e-12)
    agree(result["tool_velocity"], tool[:, 3:], 1e-12)
    agree(result["kinetic_energy"], energy[:, 0], 1e-12)
    agree(result["potential_energy"], energy[:, 1], 1e-12)
    if mechanism.clearance:
        centres = result["journal_centre"].values
        assert np.abs(centres - poses[:, :, :3]).max() < 1e-15  # of metres beyond
    else:
        agree(result["reaction_force"], forces, 1e-11)
    if "loop_drift" in result.dataset:
        assert np.abs(result["loop_drift"].values - drift).max() < 1e-15
        assert result.audit.loop_drift == result["loop_drift"].values.max()


@pytest.mark.parametrize("make", RUNS.values(), ids=RUNS.keys())
def test_a_run_without_records_gives_an_empty_result(make):
    made = histories(jp.Run(make()), Status.INTERRUPTED)
    assert len(made.time) == 0
    assert made.audit.loop_drift == 0.0


@pytest.mark.parametrize("rpy", ["0 0 0", "3.1 0 0", "0 3.1 0", "0 0 3.1", "2 2 2"])
@pytest.mark.parametrize("axis", ["1 0 0", "0 0.6 0.8"])
def test_orientations_are_right_at_any_angle_and_turn_without_jumps(urdf, rpy, axis):
    path = urdf(
        BODY.format(name="l0", mass=1.0), joint("j0", "base", "l0", "continuous", axis, rpy=rpy)
    )
    mechanism = jp.Mechanism(path)
    q = np.linspace(-7.0, 7.0, 141)[:, None]
    model = mechanism.model
    motion = Tree(model).motion(q, tool=carried(model, mechanism.tool_frame))
    for (w, x, y, z), angle in zip(motion.orientation, q, strict=True):
        pin.framesForwardKinematics(mechanism.model, mechanism.data, angle)
        expected = mechanism.data.oMf[mechanism.tool_frame].rotation
        assert np.abs(pin.Quaternion(w, x, y, z).toRotationMatrix() - expected).max() < 1e-14
    # A tenth of a radian is a twentieth on the sphere of quaternions.
    steps = np.linalg.norm(np.diff(motion.orientation, axis=0), axis=1)
    assert steps == pytest.approx(2.0 * np.sin(0.1 / 4.0), rel=1e-9)
