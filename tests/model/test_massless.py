"""Links that nothing gives inertia: named, all at once, the right ones."""

import numpy as np
import pinocchio as pin
import pytest
from conftest import body, joint

from jointplay import JointplayError, Mechanism, PrismaticClearance, RevoluteClearance, shipped
from jointplay.model.massless import massless_motions, require_inertia
from jointplay.model.survey import survey
from jointplay.scenario import Scenario

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


def test_negative_moments_that_are_allowed_are_named_as_what_they_are(tmp_path, urdf):
    hip = body("b", inertia=-1.2e-3)
    path = urdf(body("a"), hip, body("c"), *CHAIN[:3])
    mechanism = Mechanism(path, {"j3": RevoluteClearance(**PLAY)}, allow_unphysical=["b"])
    blame = r"indefinite, .*j2.*: link 'b' has .*-0.0012"
    with pytest.raises(JointplayError, match=blame) as told:
        require_inertia(mechanism, np.zeros(mechanism.model.nq))
    assert "'a'" not in str(told.value)
    assert "no mass" not in str(told.value)
    seen = survey(urdf(body("a"), hip, *CHAIN[:2]))
    assert "indefinite" in seen.remarks[0]
    assert not seen.massless


def test_the_scaras_quill_is_what_its_stroke_cannot_do_with_play():
    mechanism = Mechanism(shipped("scara.urdf"), {"stroke": PrismaticClearance(clearance=1e-4)})
    with pytest.raises(JointplayError, match=r"link 'quill' .*'stroke' has clearance"):
        require_inertia(mechanism, np.zeros(mechanism.model.nq))


def test_a_point_mass_that_joints_turn_is_named(urdf):
    path = urdf(body("a"), body("b", inertia=1e-300), *CHAIN[:2])
    with pytest.raises(JointplayError, match="link 'b'"):
        require_inertia(Mechanism(path), np.zeros(2))


@pytest.mark.parametrize(("massless", "held"), [("d", "j4"), ("cd", "j3,j4")])
def test_links_without_mass_at_the_end_of_a_chain_are_cured_by_holding_their_joints(
    urdf, massless, held
):
    mechanism = chain(urdf, ["j1"], *massless)
    q = np.full(mechanism.model.nq, 0.1)
    with pytest.raises(
        JointplayError,
        match=f"or hold (its joint|their joints) .--fix {held}.; jointplay budget needs none$",
    ):
        require_inertia(mechanism, q)
    cured = Mechanism(mechanism.description.path, mechanism.clearance, fix=held.split(","))
    require_inertia(cured, np.full(cured.model.nq, 0.1))
    assert cured.joints == tuple(one for one in mechanism.joints if one not in held)
    assert cured.with_clearance(cured.clearance) == cured
    assert cured.ideal().joints == cured.joints
    assert cured.facts()[1]["held joints"] == held.replace(",", ", ")


def test_holding_the_joint_that_has_the_clearance_is_not_advised(urdf):
    mechanism = chain(urdf, ["j4"], "d")
    with pytest.raises(
        JointplayError,
        match=r"when 'j4' has clearance: .* in the URDF; jointplay budget needs none$",
    ):
        require_inertia(mechanism, np.full(mechanism.model.nq, 0.1))


def test_held_joints_stand_at_zero_or_midway_between_limits_and_what_mimics_them_follows(urdf):
    place = {"at": "0.1 0.2 0.3", "rpy": "0.3 -0.5 0.7"}
    turning = joint("turn", "a", "b", axis="0 2 1", **place)
    sliding = joint("slide", "b", "c", "prismatic", axis="1 0 2", **place)
    mimic = '<mimic joint="turn" multiplier="0.5" offset="-0.1"/></joint>'
    path = urdf(
        *map(body, "abc"),
        joint("base_joint", "base", "a"),
        turning.replace('lower="-9"', 'lower="0.4"').replace('upper="9"', 'upper="0.8"'),
        sliding.replace("</joint>", mimic),
    )
    free, held = Mechanism(path), Mechanism(path, fix=["turn"])
    assert held.joints == ("base_joint",)
    places = []
    for one, q in (
        (free, {"base_joint": 0.2, "turn": 0.6, "slide": 0.2}),
        (held, {"base_joint": 0.2}),
    ):
        pin.framesForwardKinematics(one.model, one.data, one.configuration(q))
        places.append(one.data.oMf[one.model.getFrameId("c")].homogeneous)
    np.testing.assert_allclose(*places, atol=1e-12)
    assert Mechanism(path, fix=["slide"]).joints == ("base_joint", "turn")
    with pytest.raises(JointplayError, match="no joint 'turm'; did you mean \"turn\""):
        Mechanism(path, fix=["turm"])


def test_a_scenario_holds_joints_and_says_where_one_is_misspelt(urdf, tmp_path):
    path = chain(urdf, [], "d").description.path
    text = f'[robot]\nurdf = "{path}"\nallow_unphysical = ["all"]\nfix = ["j4"]\n'
    assert Scenario(text, tmp_path / "s.toml").simulation().mechanism.joints == ("j1", "j2", "j3")
    with pytest.raises(JointplayError, match=r"robot\.fix.*no joint 'j5'"):
        Scenario(text.replace("j4", "j5"), tmp_path / "s.toml").simulation()
