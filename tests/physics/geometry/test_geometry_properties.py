"""What the gaps of every kind of joint must satisfy in any pose, whatever their formulas.

Continuity with the right constant, the gradient, mirror images, other names for the ends, and the
exchange of bearing and journal where that leaves the shapes as they are.
"""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.interpolate import BSpline
from scipy.spatial.transform import Rotation

import jointplay as jp
from jointplay.physics.geometry import EDGE_ROUNDING_M, Form, classify_many, touch

PLAY = {"radial_clearance": 2e-4, "axial_clearance": 2e-4}
AZIMUTHS = 2 * np.pi * np.arange(24) / 24
WORN = 2e-5 * (1.0 + np.cos(AZIMUTHS - 0.7) + 0.3 * np.sin(2 * AZIMUTHS))
ENDS = [WORN, 1.5 * np.roll(WORN, 5)]

KINDS = {
    "cylinder": jp.RevoluteClearance(**PLAY),
    "sleeve": jp.RevoluteClearance(radial_clearance=2e-4, open_ends=True, journal_length=30e-3),
    "aligned": jp.RevoluteClearance(**PLAY, lock_tilt=True),
    "planar": jp.RevoluteClearance.planar(radial_clearance=2e-4),
    "worn": jp.RevoluteClearance(**PLAY, worn=[list(row) for row in ENDS]),
    "worn aligned": jp.RevoluteClearance(**PLAY, lock_tilt=True, worn=list(WORN)),
    "ball": jp.SphericalClearance(radial_clearance=2e-4),
    "slider": jp.PrismaticClearance(clearance=2e-4, clearance_y=3e-4),
    "planar slider": jp.PrismaticClearance(clearance=2e-4, planar=True),
    "straight slider": jp.PrismaticClearance(clearance=2e-4, clearance_y=3e-4, lock_tilt=True),
}
by_kind = pytest.mark.parametrize("kind", KINDS)
ROUND = ["cylinder", "sleeve", "aligned", "planar", "ball"]

small = st.floats(-4e-4, 4e-4)
lean = st.floats(-0.02, 0.02)
poses = st.tuples(small, small, small, lean, lean, st.floats(-3.0, 3.0))


def posed(joint, values):
    """Centre and orientation of a pose that the joint allows."""
    x, y, z, roll, pitch, yaw = values
    free = joint.freedoms
    centre = np.array([x, y, z]) * [part in free for part in "xyz"]
    if "pitch" not in free:
        roll = pitch = 0.0
    if isinstance(joint, jp.PrismaticClearance):
        yaw = 0.0 if "yaw" not in free else 0.005 * yaw
        roll = roll if "roll" in free else 0.0
    return centre, Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_matrix()


def evaluate(joint, centre, rotation):
    """Gaps, contact points and normals of all contacts, in the bearing frame."""
    d, r = np.array(joint.dimensions, float), np.ascontiguousarray(rotation).ravel()
    found = np.array(
        [
            touch(int(joint.shape), d, 0, k, *map(float, centre), r, 0)
            for k in range(len(joint.contacts))
        ]
    )
    return found[:, 0], centre + found[:, 1:4], found[:, 4:]


def reach(joint):
    """Farthest point of the journal from its centre [m]."""
    if isinstance(joint, jp.PrismaticClearance):
        return 0.5 * math.hypot(joint.length, joint.width, joint.height)
    if isinstance(joint, jp.SphericalClearance):
        return joint.rj
    return math.hypot(joint.rj, 0.5 * joint.lj)


@by_kind
@settings(max_examples=60)
@given(start=poses, step=poses, size=st.floats(1e-9, 1e-2))
def test_gaps_change_no_faster_than_the_journals_points_move(kind, start, step, size):
    """A gap is a distance to a body: 1-Lipschitz in every point's motion, so continuous."""
    joint = KINDS[kind]
    end = tuple(a + size * (b - a) for a, b in zip(start, step, strict=True))
    (c0, r0), (c1, r1) = posed(joint, start), posed(joint, end)
    turn = np.linalg.norm(Rotation.from_matrix(r0.T @ r1).as_rotvec())
    moved = np.linalg.norm(c1 - c0) + reach(joint) * turn
    change = np.abs(evaluate(joint, c1, r1)[0] - evaluate(joint, c0, r0)[0])
    # A worn bore's wall leans by the slope of its profile.
    steep = 1.1 if "worn" in kind else 1.0
    assert change.max() <= steep * moved + 1e-12


@by_kind
@settings(max_examples=60)
@given(pose=poses)
def test_every_gap_has_its_normal_for_gradient(kind, pose):
    """d(gap) = normal . velocity of the contact point, for all that the journal can do."""
    joint = KINDS[kind]
    centre, rotation = posed(joint, pose)
    gap, point, normal = evaluate(joint, centre, rotation)
    # Far from touching, a rim on the axis is as deep on either side: a ridge of the gap.
    near = gap < 0.6 * 2e-4
    np.testing.assert_allclose(np.linalg.norm(normal[near], axis=1), 1.0, atol=1e-12)
    tilt = np.hypot(rotation[0, 2], rotation[1, 2])
    if "axial_A" in joint.contacts and tilt < 1e-4 and "pitch" in joint.freedoms:
        return  # within the rounding of the edge
    h = 1e-7
    for k, part in enumerate("xyz"):
        if part in joint.freedoms:
            way = h * np.eye(3)[k]
            slope = (
                evaluate(joint, centre + way, rotation)[0]
                - evaluate(joint, centre - way, rotation)[0]
            ) / (2 * h)
            np.testing.assert_allclose(slope[near], (normal[:, k])[near], atol=2e-3)
    for k, part in enumerate(("roll", "pitch", "yaw")):
        if part in joint.freedoms and ("pitch" in joint.freedoms or part == "yaw"):
            turn = Rotation.from_rotvec(h * np.eye(3)[k])
            slope = (
                evaluate(joint, centre, turn.as_matrix() @ rotation)[0]
                - evaluate(joint, centre, turn.inv().as_matrix() @ rotation)[0]
            ) / (2 * h)
            arm = np.cross(np.eye(3)[k], point - centre)
            expected = np.einsum("ij,ij->i", normal, arm)
            np.testing.assert_allclose(slope[near], expected[near], atol=2e-3 * reach(joint))


def mirrored(kind, axis):
    """The joint seen in a mirror across x (0) or y (1): only a worn bore looks different."""
    if "worn" not in kind:
        return KINDS[kind]
    # Azimuth a goes to pi - a across x, to -a across y.
    order = (12 - np.arange(24)) % 24 if axis == 0 else -np.arange(24) % 24
    if kind == "worn":
        return jp.RevoluteClearance(**PLAY, worn=[list(row[order]) for row in ENDS])
    return jp.RevoluteClearance(**PLAY, lock_tilt=True, worn=list(WORN[order]))


@by_kind
@pytest.mark.parametrize("axis", [0, 1])
@settings(max_examples=40)
@given(pose=poses)
def test_mirrored_pose_has_the_mirrored_gaps(kind, axis, pose):
    joint = KINDS[kind]
    centre, rotation = posed(joint, pose)
    # On the axis the deepest place of a tilted rim is one of two.
    assume(np.hypot(*centre[:2]) > 1e-12 or np.hypot(*centre[:2]) == 0.0 or len(joint.contacts) > 2)
    mirror = np.eye(3)
    mirror[axis, axis] = -1.0
    gap, point, _ = evaluate(joint, centre, rotation)
    gap_2, point_2, _ = evaluate(mirrored(kind, axis), mirror @ centre, mirror @ rotation @ mirror)
    first, second = np.argsort(gap), np.argsort(gap_2)
    np.testing.assert_allclose(gap_2[second], gap[first], atol=1e-13)
    if len(gap) < 3:  # nothing to confuse
        assume(np.hypot(*centre[:2]) > 1e-5)  # else there is no direction to mirror
        np.testing.assert_allclose(point_2, point @ mirror, atol=1e-9)


@pytest.mark.parametrize("kind", ["cylinder", "sleeve", "aligned", "ball", "slider"])
@settings(max_examples=40)
@given(pose=poses)
def test_upside_down_the_ends_change_their_names(kind, pose):
    """Bearing and journal both turned about x: end A becomes B, and nothing else changes."""
    joint = KINDS[kind]
    centre, rotation = posed(joint, pose)
    over = np.diag([1.0, -1.0, -1.0])
    gap = evaluate(joint, centre, rotation)[0]
    other = evaluate(joint, over @ centre, over @ rotation @ over)[0]
    if kind == "cylinder":
        other = other[[1, 0, 3, 2]]
    elif kind == "sleeve":
        other = other[[1, 0]]
    elif kind == "aligned":
        other = other[[0, 2, 1]]
    else:
        gap, other = np.sort(gap), np.sort(other)
    np.testing.assert_allclose(other, gap, atol=1e-13)


@pytest.mark.parametrize("kind", ROUND)
@settings(max_examples=40)
@given(pose=poses, turn=st.floats(-3.0, 3.0), spin=st.floats(-3.0, 3.0))
def test_round_joints_know_no_azimuth(kind, pose, turn, spin):
    """The scene turned about the bore, or the journal about itself: the same gaps."""
    joint = KINDS[kind]
    centre, rotation = posed(joint, pose)
    about = Rotation.from_euler("z", turn).as_matrix()
    own = Rotation.from_euler("z", spin).as_matrix()
    gap = evaluate(joint, centre, rotation)[0]
    other = evaluate(joint, about @ centre, about @ rotation @ own)[0]
    np.testing.assert_allclose(other, gap, atol=1e-13)


@pytest.mark.parametrize("kind", ["aligned", "planar", "ball", "straight slider"])
@settings(max_examples=40)
@given(pose=poses)
def test_seen_from_the_journal_the_bearing_is_as_far_away(kind, pose):
    """Exchange of bearing and journal: the pose inverted. Shapes that do not tilt cannot tell."""
    joint = KINDS[kind]
    centre, rotation = posed(joint, pose)
    gap = np.sort(evaluate(joint, centre, rotation)[0])
    other = np.sort(evaluate(joint, -rotation.T @ centre, rotation.T)[0])
    np.testing.assert_allclose(other, gap, atol=1e-13)


@pytest.mark.parametrize("kind", ["cylinder", "sleeve", "slider"])
@settings(max_examples=40)
@given(pose=poses)
def test_tilting_only_narrows_a_centred_journal(kind, pose):
    """Centred, every tilt brings some point nearer to the bearing than the clearance leaves it."""
    joint = KINDS[kind]
    _, rotation = posed(joint, (0.0, 0.0, 0.0, *pose[3:]))
    straight = evaluate(joint, np.zeros(3), np.eye(3))[0].min()
    assert evaluate(joint, np.zeros(3), rotation)[0].min() <= straight + EDGE_ROUNDING_M


waves = st.lists(st.floats(-1.5e-5, 1.5e-5), min_size=6, max_size=6)


@settings(max_examples=60)
@given(wave=waves, pose=poses)
def test_worn_gap_is_the_least_over_all_directions(wave, pose):
    """g(u) = R_i + w(u) - p.u - R_j sqrt(1 - (u.a)^2), w a B-spline, by brute force.

    For smooth wear of three harmonics; of a jagged profile only its two lowest places are tried.
    """
    azimuths = 2 * np.pi * np.arange(24) / 24
    orders = [f(k * azimuths) for k in (1, 2, 3) for f in (np.cos, np.sin)]
    depths = list(1e-4 + np.array(wave) @ orders)
    joint = jp.RevoluteClearance(**PLAY, worn=depths)
    centre, rotation = posed(joint, pose)
    found = evaluate(joint, centre, rotation)[0]
    n = len(depths)
    phi = np.linspace(0.0, 2 * np.pi, 7201)
    node, t = np.divmod(phi / (2 * np.pi) * n, 1.0)
    at = [np.array(depths)[(node.astype(int) + k) % n] for k in (-1, 0, 1, 2)]
    weights = (
        (1 - t) ** 3 / 6,
        (3 * t**3 - 6 * t**2 + 4) / 6,
        (-3 * t**3 + 3 * t**2 + 3 * t + 1) / 6,
        t**3 / 6,
    )
    wear = sum(w * d for w, d in zip(weights, at, strict=True))
    axis = rotation[:, 2]
    across = np.sqrt(1 - (axis[0] * np.cos(phi) + axis[1] * np.sin(phi)) ** 2)
    for k, side in enumerate((1.0, -1.0)):
        end = centre + side * joint.lj / 2 * axis
        gap = joint.ri + wear - end[0] * np.cos(phi) - end[1] * np.sin(phi) - joint.rj * across
        # Sampled at 0.9 mrad; what two rival valleys leave undecided is a fraction of a micrometre.
        assert found[k] == pytest.approx(gap.min(), abs=2e-7)


@pytest.mark.parametrize("azimuth", [0.0, 0.8, math.pi / 2, 2.5, -math.pi / 2])
@pytest.mark.parametrize(("tilt", "form"), [(2e-6, Form.SURFACE), (2e-5, Form.ONE_AXIAL)])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_face_is_a_surface_while_its_far_side_is_within_the_tolerance(azimuth, tilt, form, side):
    """2 R_j sin(tilt) is 4e-8 m or 4e-7 m here, whatever way the journal leans."""
    joint = KINDS["cylinder"]
    turn = Rotation.from_rotvec(tilt * np.array([-math.sin(azimuth), math.cos(azimuth), 0.0]))
    pose = np.concatenate([[0.0, 0.0, side * joint.ca], turn.as_matrix().ravel()])
    dimensions = np.array(joint.dimensions, float)
    _, _, forms = classify_many(int(joint.shape), dimensions, 4, pose[None])
    assert Form(int(forms[0])) is form


@pytest.mark.parametrize("kind", ["aligned", "worn aligned"])
@given(x=small, y=small, z=small)
def test_a_journal_that_cannot_tilt_has_the_end_walls_of_its_axial_clearance(kind, x, y, z):
    """Gaps C_a - z at end A and C_a + z at end B, touched at the journal's ends."""
    gap, point, normal = evaluate(KINDS[kind], np.array([x, y, z]), np.eye(3))
    half = 0.5 * KINDS[kind].lj
    np.testing.assert_allclose(gap[1:], [2e-4 - z, 2e-4 + z], atol=1e-15)
    np.testing.assert_allclose(point[1:, 2], [z + half, z - half], atol=1e-15)
    np.testing.assert_allclose(normal[1:], [[0, 0, -1], [0, 0, 1]])


JAGGED = WORN + 5e-6 * np.random.default_rng(3).uniform(0.0, 1.0, 24)
"""As uneven as a bore may be between azimuths that have two lowest places at most [m]."""


@settings(max_examples=60)
@given(x=small, y=small, roll=lean, pitch=lean)
def test_the_gap_of_a_jagged_bore_is_the_least_over_all_directions(x, y, roll, pitch):
    """Against g(u) = R_i + w(u) - p.u - R_j sqrt(1 - (u.a)^2) over 24,000 directions."""
    joint = jp.RevoluteClearance(**PLAY, worn=[list(JAGGED), list(JAGGED)])
    rotation = Rotation.from_euler("ZYX", [0.0, pitch, roll]).as_matrix()
    centre, axis = np.array([x, y, 0.0]), rotation[:, 2]
    gap = evaluate(joint, centre, rotation)[0][:2]
    turn = 2.0 * np.pi * np.arange(24_000) / 24_000
    u = np.column_stack([np.cos(turn), np.sin(turn)])
    knots = np.arange(-5, len(JAGGED) + 6)  # the cubic B-spline whose coefficients they are
    depth = BSpline(knots, JAGGED[(knots[:-4] + 2) % len(JAGGED)], 3)
    for end, side in enumerate((1.0, -1.0)):
        p = centre[:2] + side * 0.5 * joint.lj * axis[:2]
        all_gaps = (
            joint.ri
            + depth(turn * 24 / (2 * np.pi))
            - u @ p
            - joint.rj * np.sqrt(1.0 - (u @ axis[:2]) ** 2)
        )
        assert gap[end] == pytest.approx(all_gaps.min(), abs=2e-9)
