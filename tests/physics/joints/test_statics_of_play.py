"""The support function of a joint's play, and the contacts that balance a load."""

import numpy as np
import pytest
from conftest import gaps
from hypothesis import given, settings
from hypothesis import strategies as st

from jointplay import JointplayError, PrismaticClearance, RevoluteClearance, SphericalClearance
from jointplay.physics.geometry import touch
from jointplay.physics.joints.play import BlockPlay, JournalPlay

LENGTHS = st.floats(1e-6, 5e-4)
NUMBERS = st.floats(-1.0, 1.0)


def bearing(**changes):
    fields = {"radial_clearance": 1e-4, "axial_clearance": 1e-4} | changes
    return RevoluteClearance(**fields)


def loads(seed, count=40):
    random = np.random.default_rng(seed)
    sizes = 10.0 ** random.uniform(-1.5, 1.5, (count, 6))
    return random.normal(size=(count, 6)) * sizes * [1, 1, 1, 0.02, 0.02, 0.02]


def twist(centre, axis):
    """Displacement of a journal: its centre, and the rotation that leans its axis."""
    lean = np.hypot(axis[0], axis[1])
    angle = np.arctan2(lean, axis[2]) / lean if lean > 0.0 else 1.0
    return np.array([*centre, -axis[1] * angle, axis[0] * angle, 0.0])


def feasible(joint, random, toward=(0.0,) * 5):
    """A random pose, as far out as the gaps allow; `toward` is added to its random direction."""
    way = random.normal(size=5) + toward
    low, high = 0.0, 0.02
    for _ in range(40):
        s = 0.5 * (low + high)
        centre = s * way[:3] * [1.0, 1.0, 1.0]
        lean = s * way[3:] * 40.0
        axis = np.array([*lean, np.sqrt(max(1.0 - lean @ lean, 0.0))])
        fits = lean @ lean < 0.5
        if fits:
            sizes = joint.ri, joint.li, joint.rj, joint.lj
            fits = gaps(centre, axis, *sizes)[0].min() >= 0.0
        low, high = (s, high) if fits else (low, s)
    centre, lean = low * way[:3], low * way[3:] * 40.0
    return twist(centre, np.array([*lean, np.sqrt(1.0 - lean @ lean)]))


@settings(max_examples=25)
@given(radial=LENGTHS, axial=LENGTHS, seed=st.integers(0, 2**31))
def test_no_pose_of_the_journal_without_penetration_is_beyond_the_support_function(
    radial, axial, seed
):
    random = np.random.default_rng(seed)
    joint = bearing(radial_clearance=radial, axial_clearance=axial)
    pushes = loads(seed)
    bound = joint.play().support(pushes).value
    for _ in range(5):
        assert np.all(pushes @ feasible(joint, random) <= bound * (1.0 + 1e-9))


def test_the_bound_of_the_journal_is_reached_but_for_the_second_order():
    joint = bearing()
    random = np.random.default_rng(3)
    found = joint.play()
    for push, way in (
        ([1.0, 0, 0, 0, 0, 0], [9.0, 0, 0, 0, 0]),
        ([0, 0, 1.0, 0, 0, 0], [0, 0, 9.0, 0, 0]),
        ([0, 0, 0, 1.0, 0, 0], [0, 0, 0, 0, -9.0]),
    ):
        points = np.array([feasible(joint, random, way) for _ in range(60)])
        reached = (points @ push).max()
        assert reached > 0.93 * found.support(np.array([push])).value[0]
    assert found.excess < 0.005


@given(seed=st.integers(0, 2**31), along=LENGTHS)
def test_where_the_maximum_is_attained_lies_in_the_set(seed, along):
    one = JournalPlay(1e-4, along, 0.04, 0.01)
    value, point = one.support(loads(seed))
    lean = np.column_stack([point[:, 4], -point[:, 3]])
    for side in (1.0, -1.0):
        rim = np.linalg.norm(point[:, :2] + side * 0.02 * lean, axis=1)
        assert np.all(rim <= 1e-4 * (1.0 + 1e-9))
    walls = np.abs(point[:, 2]) + 0.01 * np.linalg.norm(lean, axis=1)
    assert np.all(walls <= along * (1.0 + 1e-9))
    assert np.allclose(np.einsum("ij,ij->i", loads(seed), point), value)


@pytest.mark.parametrize("along", [2e-5, 5e-5, 1e-4, 1e-3])
def test_the_maximum_is_that_of_a_fine_search(along):
    one = JournalPlay(1e-4, along, 0.04, 0.01)
    a = np.linspace(0.0, 2.0 * np.pi, 121)[:-1]
    rings = [r * np.column_stack([np.cos(a), np.sin(a)]) for r in (0.0, 4e-5, 7e-5, 9e-5, 1e-4)]
    grid = np.concatenate(rings)
    lean = np.linalg.norm(grid[:, None] - grid[None], axis=2) / 0.04
    pushes = loads(5, 25)
    for push, found in zip(pushes, one.support(pushes).value, strict=True):
        bend = np.array([push[4], -push[3]]) / 0.04
        gain = (grid @ (push[:2] / 2 + bend))[:, None] + (grid @ (push[:2] / 2 - bend))[None]
        gain = gain + abs(push[2]) * (along - 0.01 * lean)
        best = gain[0.01 * lean <= along].max()
        assert best <= found * (1.0 + 1e-9)
        assert best > 0.9 * found


@given(seed=st.integers(0, 2**31), factor=st.floats(1.0, 5.0))
def test_play_is_symmetric_and_grows_with_the_clearance(seed, factor):
    pushes = loads(seed)
    joints = [
        (bearing(), bearing(radial_clearance=1e-4 * factor, axial_clearance=1e-4 * factor)),
        (
            SphericalClearance(radial_clearance=1e-4),
            SphericalClearance(radial_clearance=1e-4 * factor),
        ),
        (PrismaticClearance(clearance=1e-4), PrismaticClearance(clearance=1e-4 * factor)),
    ]
    for small, large in joints:
        value = small.play().support(pushes).value
        assert np.allclose(small.play().support(-pushes).value, value, rtol=1e-9)
        assert np.all(large.play().support(pushes).value >= value * (1.0 - 1e-9))


@given(seed=st.integers(0, 2**31))
def test_support_functions_are_convex(seed):
    one, other = loads(seed), loads(seed + 1)
    for joint in (bearing(), bearing(axial_clearance=1e-5), PrismaticClearance(clearance=1e-4)):
        h = joint.play().support
        assert np.all(
            h(one + other).value <= (h(one).value + h(other).value) * (1.0 + 1e-9) + 1e-18
        )


def test_an_open_bearing_bears_no_load_along_its_axis():
    joint = bearing(axial_clearance=None, open_ends=True)
    with pytest.raises(JointplayError, match="lock_axial"):
        joint.play().support(np.array([[0.0, 0, 1.0, 0, 0, 0]]))
    assert joint.play().support(np.array([[1.0, 0, 0, 0, 0, 0]])).value[0] > 0.0


@settings(max_examples=25)
@given(seed=st.integers(0, 2**31), x=LENGTHS, y=LENGTHS)
def test_no_pose_of_a_slider_without_penetration_is_beyond_its_support_function(seed, x, y):
    import pinocchio as pin

    joint = PrismaticClearance(clearance=x, clearance_y=y)
    random = np.random.default_rng(seed)
    pushes = loads(seed) * [1, 1, 0, 1, 1, 1]
    bound = joint.play().support(pushes).value
    sizes = np.array(joint.dimensions)
    for _ in range(4):
        way = random.normal(size=6) * [1, 1, 0, 30, 30, 30]
        low, high = 0.0, 0.02
        for _ in range(50):
            s = 0.5 * (low + high)
            turn = np.ascontiguousarray(pin.exp3(s * way[3:])).reshape(-1)
            worst = min(
                touch(int(joint.shape), sizes, 0, k, *(s * way[:3]), turn, 0)[0]
                for k in range(len(joint.contacts))
            )
            low, high = (s, high) if worst >= 0.0 else (low, s)
        assert np.all(pushes @ (low * way) <= bound * (1.0 + 1e-9))


def test_a_slider_trades_yaw_for_room_across():
    one = BlockPlay((1e-4, 1e-4), (0.02, 0.02, 0.04), (True, True, True))
    assert one.support(np.array([[0, 0, 0, 0, 0, 1.0]])).value[0] == pytest.approx(1e-4 / 0.02)
    assert one.support(np.array([[1.0, 0, 0, 0, 0, 0]])).value[0] == pytest.approx(1e-4)
    assert one.support(np.array([[0, 0, 0, 0, 1.0, 0]])).value[0] == pytest.approx(1e-4 / 0.04)


def test_a_worn_bore_is_as_wide_as_its_deepest_place():
    depths = np.zeros(32)
    depths[3] = 5e-5
    push = np.array([[1.0, 0, 0, 0, 0, 0]])
    joint = bearing(worn=depths, lock_tilt=True)
    assert joint.play().support(push).value[0] == pytest.approx(1.5e-4)


PLAYS = {
    "long in the bore": JournalPlay(1e-4, 3e-4, 0.04, 0.01, radius=0.01),
    "held by its walls": JournalPlay(1e-4, 1e-4, 0.05, 0.03, radius=0.03),
    "open": JournalPlay(1e-4, 0.0, 0.04, 0.0, radius=0.01),
    "upright": JournalPlay(1e-4, 2e-4, np.inf, 0.0, radius=0.01),
    "slider": BlockPlay((1e-4, 2e-4), (0.02, 0.015, 0.04), (True, True, True)),
    "ball": SphericalClearance(bearing_radius=0.01, radial_clearance=1e-4).play(),
}
BORNE = {
    "long in the bore": [0, 1, 2, 3, 4],
    "held by its walls": [0, 1, 2, 3, 4],
    "open": [0, 1, 3, 4],
    "upright": [0, 1, 2],
    "slider": [0, 1, 3, 4, 5],
    "ball": [0, 1, 2],
}


@pytest.mark.parametrize("name", PLAYS)
def test_contacts_at_rest_balance_the_load(name):
    one, borne = PLAYS[name], BORNE[name]
    pushes = loads(7, 300)
    free = np.setdiff1d(np.arange(6), borne)
    pushes[:, free] = 0.0
    point = one.support(pushes).point
    found = one.pressed(pushes, point)
    left = pushes + np.einsum("nk,nkd->nd", found.force, found.normal)
    size = np.linalg.norm(pushes * [1, 1, 1, 30, 30, 30], axis=1)
    if name in ("long in the bore", "held by its walls"):
        # A face that lies flat on its wall bears moments, too.
        left[np.abs(point[:, 3:5]).max(axis=1) < 1e-9, 3:5] = 0.0
    assert (
        np.abs(left[:, borne] * np.array([1, 1, 1, 30, 30, 30])[borne]).max(1) < 1e-4 * size
    ).all()
    assert (found.force >= 0.0).all()
    # Friction acts across the normal, its arms no longer than the journal.
    forces = found.across[..., :3]
    assert np.allclose(np.einsum("nkid,nkd->nki", forces, found.normal[..., :3]), 0.0)
    touching = found.force > 0.0
    assert np.allclose(np.linalg.norm(forces, axis=-1)[touching], 1.0)
