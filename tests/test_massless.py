"""Links that nothing gives inertia: named, all at once, the right ones."""

import numpy as np
import pytest
from conftest import body, joint

from jointplay import JointplayError, Mechanism, PrismaticClearance, RevoluteClearance, shipped
from jointplay.mechanism.massless import massless_motions, require_inertia

PLAY = {"radial_clearance": 1e-4, "axial_clearance": 1e-4}
CHAIN = (
    joint("j1", "base", "a"),
    joint("j2", "a", "b"),
    joint("j3", "b", "c", axis="1 0 0"),
    joint("j4", "c", "d", axis="0 1 0"),
)


def bare(*names):
    return [f'<link name="{name}"/>' for name in names]


def chain(urdf, play, *massless):
    links = [body(name) for name in "abcd" if name not in massless]
    path = urdf(*links, *bare(*massless), *CHAIN)
    return Mechanism(path, {name: RevoluteClearance(**PLAY) for name in play})


@pytest.mark.parametrize(
    ("play", "massless", "blamed", "innocent"),
    [
        (["j2"], "b", ["b"], "acd"),
        (["j3"], "b", ["b"], "acd"),
        (["j2"], "bc", ["b", "c"], "ad"),
        ([], "cd", ["c", "d"], "ab"),
        ([], "d", ["d"], "abc"),
    ],
)
def test_links_that_move_without_inertia_are_named_and_no_others(
    urdf, play, massless, blamed, innocent
):
    mechanism = chain(urdf, play, *massless)
    with pytest.raises(JointplayError) as caught:
        require_inertia(mechanism, np.full(mechanism.model.nq, 0.1))
    message = str(caught.value)
    assert "\n" not in message
    assert ", ".join(map(repr, blamed)) in message.split(" moved by")[0]
    assert not any(repr(link) in message for link in innocent)
    assert "<inertial>" in message
    assert all(f"{name!r} has clearance" in message for name in play)


@pytest.mark.parametrize(("play", "massless"), [([], ""), (["j2"], ""), (["j1"], "b"), ([], "bc")])
def test_a_link_without_mass_that_carries_one_with_mass_is_no_fault(urdf, play, massless):
    mechanism = chain(urdf, play, *massless)
    q = np.full(mechanism.model.nq, 0.1)
    assert not massless_motions(mechanism, q).size
    require_inertia(mechanism, q)


def test_light_links_are_links(urdf):
    path = urdf(body("a"), body("b", mass=1e-6, inertia=1e-10), *CHAIN[:2])
    mechanism = Mechanism(path, {"j2": RevoluteClearance(**PLAY)})
    require_inertia(mechanism, np.zeros(mechanism.model.nq))


def test_the_scaras_quill_is_what_its_stroke_cannot_do_with_play():
    mechanism = Mechanism(shipped("scara.urdf"), {"stroke": PrismaticClearance(clearance=1e-4)})
    with pytest.raises(JointplayError, match=r"link 'quill' .*'stroke' has clearance"):
        require_inertia(mechanism, np.zeros(mechanism.model.nq))


def test_a_point_mass_that_joints_turn_is_named(urdf):
    path = urdf(body("a"), body("b", inertia=1e-300), *CHAIN[:2])
    with pytest.raises(JointplayError, match="link 'b'"):
        require_inertia(Mechanism(path), np.zeros(2))
