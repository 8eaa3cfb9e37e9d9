"""Offsets, compliance, play and encoder errors from static poses: found, told apart, or refused."""

import importlib
import json
import re
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest
from conftest import body, joint, tip

from jointplay import JointplayError, Mechanism, calibrate, encoder_differences
from jointplay.cli import main
from jointplay.estimate import StaticPoses, Term, calibration, inference, plan_calibration
from jointplay.estimate.kinematic_model import Poses
from jointplay.estimate.known import improves
from jointplay.estimate.static_poses import rigid_body, rotation_vectors, rotations_of, same_labels
from jointplay.model.payload import Payload
from jointplay.scenario.presets import preset

JOINTS = ("waist", "shoulder", "elbow", "wrist")
NOISE = 5e-5


@pytest.fixture
def arm(urdf):
    """Four joints that turn, the last across the others; gravity loads three of them both ways."""
    return Mechanism(
        urdf(
            body("turret", mass=4.0),
            joint("waist", "base", "turret", axis="0 0 1", at="0 0 0.3"),
            body("upper", mass=3.0, com="0.2 0 0"),
            joint("shoulder", "turret", "upper", axis="0 1 0", at="0.05 0 0.1"),
            body("lower", mass=2.0, com="0.15 0.02 0"),
            joint("elbow", "upper", "lower", axis="0 1 0", at="0.4 0 0"),
            body("hand", mass=1.0, com="0.05 0 0.04"),
            joint("wrist", "lower", "hand", axis="1 0 0", at="0.3 0 0"),
            tip("hand", at="0.1 0.05 0.03"),
        )
    )


class Truth:
    """What a robot does: positions behind its errors, and where that brings its tool."""

    def __init__(self, mechanism, seed, n=60, still=()):
        self.mechanism, self.random = mechanism, np.random.default_rng(seed)
        self.motor = self.random.uniform(-2.5, 2.5, (n, 4))
        for name in still:  # its load keeps one side
            self.motor[:, JOINTS.index(name)] *= 0.2
        model, data = mechanism.model, mechanism.data
        self.load = -np.array(
            [pin.computeGeneralizedGravity(model, data, q).copy() for q in self.motor]
        )
        self.way = np.vstack([np.zeros(4), np.sign(np.diff(self.motor, axis=0))])
        self.q = self.motor.copy()

    def _errs(self, by, sizes):
        for name, size in sizes.items():
            j = JOINTS.index(name)
            self.q[:, j] += by(self.motor[:, j], self.load[:, j], self.way[:, j], size)
        return self

    def offset(self, **sizes):
        return self._errs(lambda q, load, way, size: size, sizes)

    def compliance(self, **sizes):
        return self._errs(lambda q, load, way, size: size * load, sizes)

    def play(self, friction=0.0, transition=0.3, **halves):
        def lean(q, load, way, half):
            return half * np.clip((load - friction * way) / transition, -1.0, 1.0)

        return self._errs(lean, halves)

    def eccentricity(self, **sizes):
        return self._errs(lambda q, load, way, s: s[0] * np.sin(q) + s[1] * np.cos(q), sizes)

    def tool(self):
        """Positions (n, 3) and rotations (n, 3, 3) in the world."""
        model, data = self.mechanism.model, self.mechanism.data
        places = []
        for q in self.q:
            pin.framesForwardKinematics(model, data, q)
            places.append(data.oMf[self.mechanism.tool_frame].copy())
        return np.array([p.translation for p in places]), np.array([p.rotation for p in places])

    def measured(self, noise=NOISE, orientation=True, **more):
        """By an instrument that stands anywhere."""
        position, rotation = self.tool()
        frame, at = rotations_of(self.random.normal(size=3) * 1.5), self.random.normal(size=3)
        position = at + position @ frame.T + noise * self.random.normal(size=position.shape)
        turned = None
        if orientation:
            small = 5.0 * noise * self.random.normal(size=position.shape)
            turned = rotations_of(small) @ frame @ rotation
        return StaticPoses(JOINTS, self.motor, position=position, orientation=turned, **more)


def test_the_chain_is_where_pinocchio_says(arm):
    truth = Truth(arm, 1, n=8)
    poses = Poses(arm, truth.measured())
    rotation, place, *_ = poses.forward(truth.q, None)
    position, turned = truth.tool()
    assert rotation @ poses.tool.rotation == pytest.approx(turned)
    assert place + rotation @ poses.tool.translation == pytest.approx(position)
    assert poses.load == pytest.approx(truth.load, abs=1e-12)
    # The moment of the weight beyond a joint, along its axis, is its load.
    along = np.einsum("nja,ja->nj", poses.wrench[:, :, 3:], poses.axis)
    assert along == pytest.approx(truth.load, abs=1e-12)
    loaded = Poses(arm, truth.measured(), [Payload("tool", 2.0)])
    assert loaded.load[:, 0] == pytest.approx(poses.load[:, 0], abs=1e-9)
    assert not np.allclose(loaded.load[:, 1], poses.load[:, 1])


def test_derivatives_are_those_of_finite_differences(arm):
    truth = Truth(arm, 2, n=8).offset(elbow=0.01)
    terms = ["offset", "placement", "compliance", "eccentricity", "suspension waist"]
    terms.append("rail shoulder by waist")
    fit = calibrate(arm, truth.measured(), (), always=terms, folds=2, error=(1e-4, 5e-4))
    fitted = fit.step().fitted
    least, theta = fitted.least, fitted.theta
    slope = least.jacobian(theta)
    for k in range(slope.shape[1]):
        step = np.zeros(slope.shape[1])
        step[k] = 1e-6
        # Of several turns of one placement to first order.
        change = (least.predict(theta + step) - least.predict(theta - step)) / 2e-6
        assert change == pytest.approx(slope[:, k], rel=0.02, abs=0.01), k
    assert slope.shape == (48, 12 + len(fitted.problem.columns))


@pytest.mark.thorough
def test_play_is_found_with_its_friction_and_told_from_compliance(arm):
    truth = Truth(arm, 3).offset(elbow=0.02).compliance(shoulder=4e-4)
    truth.play(friction=1.0, transition=0.4, elbow=4e-3)
    fit = calibrate(arm, truth.measured(), ["offset", "compliance", "play", "eccentricity"])
    kept = {term.kind for term in fit.kept}
    assert kept >= {"offset", "compliance", "play"}
    elbow = fit.play_of("elbow")
    assert elbow.known
    assert elbow.low < 8e-3 < elbow.high
    shoulder = fit.play_of("shoulder")
    assert shoulder.bounded
    assert not shoulder.reason
    assert shoulder.upper < 2e-3
    assert fit["shoulder gear compliance"].low < 4e-4 < fit["shoulder gear compliance"].high
    assert fit.step().held_back[0] < 5e-4 < fit.steps[0].held_back[0] / 10.0
    loops = {one.joint: one for one in fit.loops}
    loop = loops["elbow"]
    assert np.sqrt(np.mean((loop.measured - loop.fitted) ** 2)) < 1e-3
    step = [np.median(loop.measured[side * loop.x > 2.0]) for side in (1, -1)]
    assert step[0] - step[1] == pytest.approx(8e-3, abs=1e-3)
    text = str(fit)
    assert re.search(r"^elbow +gear play ", text, re.M)
    assert text.count(elbow.cells()[1]) == 1
    assert "waist gear play: gravity does not load this joint" in text
    # What is told of play stands in one place, not once more among the coefficients.
    assert not [one for one in fit.coefficients if "play" in one.label]
    played = [row["joint"] for row in fit.data.records() if row["quantity"] == "gear_play"]
    assert played == [*JOINTS]


@pytest.mark.thorough
def test_intervals_of_play_cover_frictions_and_transitions_that_nobody_gave():
    """Robots of the benchmark whose friction and transition lie between those that are tried."""
    benchmark = importlib.import_module("truth.calibrate")
    rows = [row for seed in (1, 10, 13, 21, 45) for row in benchmark.case(seed)]
    found = [row for row in rows if row["kind"] == "joint's play"]
    assert len(found) >= 5
    assert not [row for row in found if row["wrong"]]


@pytest.mark.thorough
@pytest.mark.parametrize(("seed", "joint"), [(100, "joint1"), (105, "joint3")])
def test_intervals_of_gear_compliance_cover_frictions_and_transitions_of_play(seed, joint):
    """Robots of the benchmark whose compliance depends on which friction play is given."""
    robot = importlib.import_module("truth.calibrate").robot(seed)
    fit = calibrate(robot.drawn, robot.poses)
    label = f"{joint} gear compliance"
    truth, told = robot.truth[label], fit[label]
    # With the play of the best friction and transition alone it would not hold the truth.
    assert abs(told.value - truth) > told.half_width
    assert told.low < truth < told.high
    assert told.high - told.low < 5e-4  # compliances are drawn up to 1e-3 rad/(N m)


@pytest.mark.thorough
def test_eccentric_encoders_are_not_taken_for_play(arm):
    truth = Truth(arm, 4).eccentricity(elbow=(2e-3, -1e-3))
    fit = calibrate(arm, truth.measured(), ["offset", "play", "eccentricity"])
    assert "eccentricity" in {term.kind for term in fit.kept}
    assert fit.play_of("elbow").bounded
    assert fit["elbow eccentricity sin"].low < 2e-3 < fit["elbow eccentricity sin"].high


@pytest.mark.thorough
def test_a_cause_that_is_not_there_is_kept_no_more_often_than_chance_allows(arm):
    kept = 0
    for seed in range(5):
        truth = Truth(arm, 200 + seed, n=24).offset(elbow=0.01)
        terms = ["compliance", Term("play", JOINTS[1:3], friction=0.0, transition=0.3)]
        fit = calibrate(arm, truth.measured(), terms, always=["offset"])
        kept += bool(fit.kept[1:])
    assert kept <= 2  # two candidates at 10 %: 1 expected at most


def test_a_load_on_one_side_or_smaller_than_friction_cannot_tell_play(arm):
    truth = Truth(arm, 5, still=("shoulder", "elbow")).play(shoulder=3e-3)
    assert (truth.load[:, 1] > 0.3).all()
    play = Term("play", ("shoulder", "elbow"), friction=0.0, transition=0.3)
    stuck = Term("play", ("wrist",), friction=10.0, transition=0.3)
    fit = calibrate(arm, truth.measured(), ["offset", play, stuck])
    assert "on the other side never" in fit.play_of("shoulder").reason
    assert "this measurement cannot tell" in str(fit.play_of("shoulder"))
    assert "is smaller than the friction of 10 N m" in fit.play_of("wrist").reason
    with pytest.raises(JointplayError, match="no joint 'knee'"):
        fit.play_of("knee")


def test_same_point_again_is_enough_and_scale_comes_from_known_distances(arm):
    """Closure: the tool is at two unknown points 0.1 m apart, in two placements."""
    random = np.random.default_rng(7)
    model, data = arm.model, arm.data
    offset = np.array([0.0, 0.01, -0.02, 0.0])
    rows, points, groups = [], [], []
    for group, centre in enumerate(([0.45, 0.1, 0.35], [0.3, -0.35, 0.5])):
        for hole, at in enumerate((centre, np.add(centre, [0.0, 0.1, 0.0]))):
            found = 0
            while found < 10:
                q = random.uniform(-2.0, 2.0, 4)
                for _ in range(60):
                    pin.framesForwardKinematics(model, data, q + offset)
                    off = at - data.oMf[arm.tool_frame].translation
                    frame = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
                    jacobian = pin.computeFrameJacobian(
                        model, data, q + offset, arm.tool_frame, frame
                    )[:3]
                    q = q + np.linalg.lstsq(jacobian, off, rcond=1e-3)[0]
                if np.linalg.norm(off) < 1e-9 and np.abs(q).max() < 3.1:
                    rows.append(q)
                    points.append(f"{group}{hole}")
                    groups.append(group)
                    found += 1
    motor = np.array(rows) + 2e-5 * random.normal(size=(40, 4))
    apart = {(f"{g}0", f"{g}1"): (0.1, 1e-4) for g in range(2)}
    poses = StaticPoses(JOINTS, motor, point=points, group=groups, distances=apart, ordered=False)
    fit = calibrate(arm, poses, ["offset"])
    assert fit.folds == "each of 2 groups"
    assert fit.steps[0].held_back[0] > 1e-3
    assert fit.step().added == "+ offset"
    assert fit.step().held_back[0] < 2e-4
    for name, size in (("shoulder", 0.01), ("elbow", -0.02)):
        assert fit[f"{name} offset"].low < size < fit[f"{name} offset"].high
    assert not fit["waist offset"].known
    assert "not determined" in str(fit)


def test_exchanged_labels_of_markers_are_found_and_put_right():
    random = np.random.default_rng(8)
    shape = np.array([[0.0, 0.0, 0.0], [0.14, 0.0, 0.0], [0.03, 0.05, 0.0]])
    turns = rotations_of(random.normal(size=(20, 3)))
    markers = np.einsum("nij,kj->nki", turns, shape) + random.normal(size=(20, 1, 3))
    markers += 1e-4 * random.normal(size=markers.shape)
    broken = markers.copy()
    for i in (2, 3, 11):
        broken[i] = broken[i][[1, 0, 2]]
    mended, exchanged = same_labels(broken)
    assert exchanged == (2, 3, 11)
    assert mended == pytest.approx(markers)
    found, rotations, _, off = rigid_body(mended)
    assert np.abs(off).max() < 5e-4
    sides = [np.linalg.norm(np.diff(body, axis=0), axis=1) for body in (found, shape)]
    assert sides[0] == pytest.approx(sides[1], abs=1e-4)
    between = [[a @ b.T for a, b in pairwise(ways)] for ways in (rotations, turns)]
    assert np.array(between[0]) == pytest.approx(np.array(between[1]), abs=1e-2)
    equal = np.einsum("nij,kj->nki", turns, np.eye(3))
    assert same_labels(equal)[1] == ()
    with pytest.raises(JointplayError, match="at least three markers"):
        rigid_body(markers[:, :2])


def test_bounds_hold_for_other_transitions_than_the_given_one(arm, monkeypatch):
    measured, told = Truth(arm, 21).measured(), []
    play = Term("play", JOINTS[1:3], friction=0.0, transition=0.3)
    for factors in ((1.0,), (4.0,)):
        monkeypatch.setattr(inference, "SMOOTHINGS", factors)
        fit = calibrate(arm, measured, ["offset", play], error=(NOISE, 5.0 * NOISE))
        told.append(fit.play_of("shoulder").upper)
    assert told[1] > 1.05 * told[0]


@pytest.mark.thorough
def test_encoders_on_both_sides_tell_play_compliance_and_their_own_errors_apart(arm):
    truth = Truth(arm, 9, n=40).eccentricity(shoulder=(3e-3, 1e-3))
    truth.play(friction=1.0, transition=0.4, elbow=5e-3).compliance(wrist=2e-2)
    link = truth.q + 2e-4 * truth.random.normal(size=truth.q.shape)
    poses = StaticPoses(JOINTS, truth.motor, link=link)
    found = {one.play[0].joint: one for one in encoder_differences(arm, poses)}
    kinds = {joint: [term.kind for term in one.kept] for joint, one in found.items()}
    assert kinds["waist"] == []
    assert "predicted by nothing here" in str(found["waist"])
    assert "waist gear play: gravity does not load this joint" in str(found["waist"])
    assert kinds["shoulder"] in (["eccentricity"], ["eccentricity", "second-harmonic"])
    assert kinds["elbow"] == ["play"]
    (half,) = found["elbow"].play
    assert half.low < 10e-3 < half.high
    ((friction, _),) = [
        column.choices[choice]
        for step in [found["elbow"].step()]
        for column, choice in zip(step.fitted.problem.columns, step.chosen.values(), strict=True)
    ]
    assert friction == pytest.approx(1.0, abs=0.7)
    assert kinds["wrist"][0] == "compliance"
    assert found["wrist"].step().held_back[0] == pytest.approx(2e-4, rel=0.4)
    assert "left when predicted by compliance" in str(found["wrist"])
    with pytest.raises(JointplayError, match="no joint has encoders on both sides"):
        encoder_differences(arm, replace(poses, link=None))


def test_an_encoder_that_jumps_is_told_though_poses_beside_the_jump_are_left_out(arm):
    truth = Truth(arm, 9, n=25)
    q = truth.motor[:, 0]
    # The jump lies where two poses are nearer to each other than to their other neighbours: with
    # one of them left out, the others say as well that it lies behind the other.
    place = 0.5 * np.sort(q)[11:13].sum()
    saw = np.zeros_like(truth.q)
    saw[:, 0] = -0.025 * q + 0.17 * (q > place) + 2e-4 * truth.random.normal(size=25)
    poses = StaticPoses(JOINTS, truth.motor, link=truth.motor + saw)
    waist = encoder_differences(arm, poses)[0]
    assert [term.kind for term in waist.kept] == ["sawtooth"]
    assert waist.step().held_back[0] < 1e-3
    gain, jump = waist.coefficients
    assert gain.low < -0.025 < gain.high
    assert jump.low < 0.17 < jump.high


def test_a_wrong_ratio_is_called_a_ratio_and_sag_is_called_sag(arm):
    truth = Truth(arm, 9, n=25).compliance(wrist=5e-2)
    link = truth.q + 1e-3 * truth.random.normal(size=truth.q.shape)
    link[:, 1] -= truth.motor[:, 1] / 3.0
    poses = StaticPoses(JOINTS, truth.motor, link=link)
    found = {one.play[0].joint: one for one in encoder_differences(arm, poses)}
    assert [term.kind for term in found["shoulder"].kept] == ["ratio"]
    assert "shoulder: its link turns 0.666" in str(found["shoulder"])
    assert "predicted by compliance (sag under its load)" in str(found["wrist"])
    # Only what is asked for is tried, but a wrong ratio, beside which nothing could be told.
    asked = encoder_differences(arm, poses, terms=[Term("offset"), Term("play", ("shoulder",))])
    found = {one.play[0].joint: one for one in asked}
    assert [term.kind for term in found["shoulder"].kept] == ["ratio"]
    assert "shoulder: its link turns 0.666" in str(found["shoulder"])
    assert found["shoulder"].play[0].bounded
    assert [len(found[name].steps) for name in ("shoulder", "wrist")] == [2, 1]


def test_the_right_one_of_two_encoders_is_told_by_the_tool(arm):
    truth = Truth(arm, 10).play(elbow=4e-3, transition=0.3)
    link = truth.motor.copy()
    link[:, 2] = truth.q[:, 2]
    link[:, 1] += 3e-3 * np.sin(truth.motor[:, 1])
    poses = truth.measured(link=link)
    fit = calibrate(arm, poses, (), always=["offset", "link-encoder"])
    assert fit["elbow link-encoder"].value == pytest.approx(1.0, abs=0.1)
    assert fit["shoulder link-encoder"].value == pytest.approx(0.0, abs=0.1)
    read = calibrate(arm, poses.read_by_link("elbow"), (), always=["offset"])
    assert read.step().held_back[0] < 2.0 * np.sqrt(3.0) * NOISE
    with pytest.raises(JointplayError, match="no joint 'knee'"):
        poses.read_by_link("knee")


def test_chance_does_not_count_as_an_improvement():
    before, units = np.array([1.0, 2.0, 1.5, 1.2]), np.arange(4)
    assert improves(before, 0.5 * before, units).counts
    assert not improves(before, before, units).counts
    assert not improves(before, before + np.array([-1.0, 1.2, -1.0, 0.7]), units).counts
    assert not improves(before, 0.5 * before, np.zeros(4, int)).counts  # one unit tells nothing


def written(path, head, rows):
    lines = [",".join(x if isinstance(x, str) else f"{x:.9f}" for x in row) for row in rows]
    path.write_text("# static poses\n" + "\n".join([",".join(head), *lines]) + "\n")
    return path


def table(poses, path):
    """Poses as a CSV file in other units."""
    turned = np.degrees(rotation_vectors(poses.orientation))
    head = [f"{j} motor [deg]" for j in JOINTS]
    head += [f"tool {axis} [mm]" for axis in "xyz"] + [f"tool r{axis} [deg]" for axis in "xyz"]
    rows = np.column_stack([np.degrees(poses.motor), 1e3 * poses.position, turned])
    return written(path, head, rows)


@pytest.mark.usefixtures("checked_figures")
def test_the_command_prints_and_writes_what_the_function_finds(arm, tmp_path, capsys):
    truth = Truth(arm, 12).play(elbow=4e-3, transition=0.3).offset(elbow=0.01)
    path = table(truth.measured(), tmp_path / "poses.csv")
    order = ["calibrate", str(arm.description.path), str(path), "--out", str(tmp_path / "out")]
    order += ["--term", "offset", "--term", "play elbow", "--quiet"]
    assert main([*order, "--detail"]) == 0
    said = capsys.readouterr().out
    assert "+ play elbow" in said
    assert "tool: 'tool' (chosen: named like a tool, at the end of the chain of moving" in said
    fit = json.loads((tmp_path / "out" / "calibration.json").read_text())
    assert fit["kept"] == ["offset", "play elbow"]
    elbow = next(
        one for one in fit["unknowns"] if (one["joint"], one["quantity"]) == ("elbow", "gear_play")
    )
    assert elbow["low"] < 8e-3 < elbow["high"]
    tables = {one.name for one in (tmp_path / "out").iterdir()}
    assert tables == {
        "calibration.csv", "calibration.json", "residuals.csv", "calibration.png", "loops.png"
    }  # fmt: skip
    assert len((tmp_path / "out" / "residuals.csv").read_text().splitlines()) == 61
    assert main(order) == 2
    assert "calibration.csv" in capsys.readouterr().err


def test_the_corrected_urdf_has_the_tool_where_the_fit_has_it(tmp_path, capsys):
    """The paper's SCARA: joints that turn and one that slides, fixed joints between them."""
    robot = Mechanism("scara")
    names, model = robot.joints, robot.model
    random = np.random.default_rng(4)
    motor = random.uniform(-0.1, 0.1, (40, 4)) + random.uniform(-1, 1, (40, 4)) * [1, 1, 0, 1]
    places = []
    for q in motor + np.array([0.01, -0.02, 1e-3, 0.03]):
        pin.framesForwardKinematics(model, robot.data, q)
        places.append(robot.data.oMf[robot.tool_frame].translation + 1e-5 * random.normal(size=3))
    head = [f"{n} motor [{'m' if robot.description.joints[n].slides else 'rad'}]" for n in names]
    rows = np.column_stack([motor, places])
    path = written(tmp_path / "p.csv", head + [f"tool {x} [m]" for x in "xyz"], rows)
    corrected = tmp_path / "corrected.urdf"
    terms = ["--always", "offset", "--always", "placement", "--quiet"]
    assert main(["calibrate", "scara", str(path), *terms, "--urdf", str(corrected)]) == 0
    assert f"written: {corrected}: 4 joints corrected" in capsys.readouterr().out
    fitted = calibrate(robot, path, always=["offset", "placement"]).step().fitted
    problem, every = fitted.problem, np.zeros(12)
    every[problem._free[problem._free < 12]] = fitted.theta[: len(problem.frame)]
    points = problem._place(fitted.theta, np.arange(40))[1]
    new, base = Mechanism(corrected), rotations_of(every[3:6]) @ problem.turned[0]
    last = model.frames[robot.tool_frame].parentJoint
    for q, seen in zip(motor, points, strict=True):
        pin.forwardKinematics(new.model, new.data, q)
        reached = every[:3] + base @ new.data.oMi[last].act(every[6:9])
        assert reached == pytest.approx(seen, abs=1e-9)
    # All else is the same, byte for byte.
    joints, origin = re.compile(r"<joint.*?</joint>", re.S), re.compile(r"<origin[^>]*/>")
    texts = robot.description.text, corrected.read_text()
    bare = [joints.sub(lambda one: origin.sub("", one[0]), text) for text in texts]
    assert texts[0] != texts[1]
    assert bare[0] == bare[1]
    order = ["calibrate", "scara", str(path), *terms, "--urdf", str(corrected)]
    assert main(order) == 2
    assert "already exists" in capsys.readouterr().err
    order = ["calibrate", "scara", "--plan", "--urdf", str(tmp_path / "new.urdf")]
    assert main(order) == 2
    assert "--urdf needs measured poses" in capsys.readouterr().err


@pytest.mark.thorough
def test_what_a_urdf_and_a_preset_cannot_have_is_said(arm, tmp_path, capsys):
    truth = Truth(arm, 12).play(elbow=4e-3, transition=0.3).offset(elbow=0.01)
    path = table(truth.measured(), tmp_path / "poses.csv")
    robot, urdf, own = str(arm.description.path), tmp_path / "new.urdf", tmp_path / "my.toml"
    order = ["calibrate", robot, str(path), "--quiet"]
    both = ["--term", "offset", "--term", "play elbow", "--urdf", str(urdf)]
    assert main([*order, *both, "--write-preset", str(own)]) == 0
    said = capsys.readouterr().out
    assert "not in it, as they vary with pose or load: play elbow" in said
    assert f"--preset {own}" in said
    (gear,) = preset(own).mechanism(urdf, tool="tool").gears.values()
    assert gear.play == pytest.approx(8e-3, rel=0.1)
    assert main(["budget", str(urdf), "--preset", str(own), "--tool", "tool"]) == 0
    assert "elbow (gear)" in capsys.readouterr().out
    none = tmp_path / "none.urdf"
    assert main([*order, "--term", "compliance", "--urdf", str(none)]) == 2
    assert "neither offset nor placement was kept" in capsys.readouterr().err
    none = tmp_path / "none.toml"
    assert main([*order, "--term", "offset", "--write-preset", str(none)]) in (0, 2)
    assert not urdf.read_text().count("nan")


@pytest.mark.thorough
@pytest.mark.usefixtures("checked_figures")
def test_the_command_tells_of_the_encoders_alone(arm, tmp_path, capsys):
    truth = Truth(arm, 13, n=30).play(elbow=4e-3, transition=0.3)
    head = [f"{j} motor [rad]" for j in JOINTS] + ["elbow link [rad]"]
    rows = np.column_stack([truth.motor, truth.q[:, 2]])
    path = written(tmp_path / "poses.csv", head, rows)
    robot = str(arm.description.path)
    assert main(["calibrate", robot, str(path), "--out", str(tmp_path / "out")]) == 0
    said = capsys.readouterr().out
    assert said.startswith("link less motor, elbow: differs by")
    assert "left when predicted by play" in said
    assert {one.name for one in (tmp_path / "out").iterdir()} == {"encoders.csv", "loops.png"}


@pytest.mark.parametrize(
    ("change", "options", "said"),
    [
        (lambda t: t.replace("waist motor [deg]", "waist motor"), "", "has no unit"),
        (lambda t: t.replace("waist motor", "knee motor"), "", "'knee motor [deg]' is unknown"),
        (lambda t: t.replace("waist motor", "elbow motor"), "", "'elbow motor' appears twice"),
        (lambda t: t.replace("[mm]", "[s]"), "", "columns 'tool x [s]'"),
        (lambda t: t.replace("tool y", "marker a y"), "", "not both"),
        (lambda t: "\n".join(t.splitlines()[:5]), "", "3 poses; at least 6 are needed"),
        (lambda t: t + t.splitlines()[-1].replace(".", "x", 1) + "\n", "", "line 15: 'waist motor"),
        (
            lambda t: t + ",".join(["1e999"] * 10) + "\n",
            "",
            "line 15: 'waist motor [deg]' is at",
        ),
        (
            lambda t: t + ",".join(["1e300"] * 10) + "\n",
            "",
            "line 15: 'waist motor [deg]' is at",
        ),
        (lambda t: re.sub(r"(?m)^(?=[^#\n])", "group,group,", t), "", "'group' appears twice"),
        (str, "--term|magic", "no kind of term 'magic'"),
        (str, "--term|play knee", "'knee'"),
        (str, "--term|rail elbow", "rail ARM by LIFT"),
        (str, "--term|link-encoder elbow", "no encoder on the link's side"),
        (str, "--folds|1", "folds must be a number from 2"),
        (str, "--folds|groups", "at least two are needed, got 0"),
        (str, "--scatter|0mm", "--scatter must be positive"),
        (str, "--point|1,2", "--point must be three numbers"),
        (str, "--link|elbow", "has no column 'elbow link'"),
    ],
)
def test_tables_and_options_that_cannot_be_are_refused(
    arm, tmp_path, capsys, change, options, said
):
    path = table(Truth(arm, 14, n=12).measured(), tmp_path / "poses.csv")
    path.write_text(change(path.read_text()))
    order = ["calibrate", str(arm.description.path), str(path)]
    assert main([*order, *options.split("|")] if options else order) == 2
    assert said in capsys.readouterr().err


def test_arrays_that_cannot_be_are_refused(arm):
    poses = Truth(arm, 16, n=10).measured()
    for change, said in (
        ({"position": poses.position[:5]}, "position must have the shape"),
        ({"orientation": 2.0 * poses.orientation}, "is not a rotation matrix"),
        ({"point": ["a"] * 10}, "not both"),
        ({"group": ["a"]}, "10 names, one a row, got 1"),
        ({"position": None, "point": ["a"] * 10, "distances": {("a", "b"): (1, 1)}}, "point 'b'"),
    ):
        with pytest.raises(JointplayError, match=said):
            replace(poses, **change)
    with pytest.raises(JointplayError, match="nothing measured"):
        calibrate(arm, replace(poses, position=None, orientation=None))


def test_markers_groups_and_points_are_read_from_tables(arm, tmp_path, capsys):
    truth = Truth(arm, 17, n=12).offset(elbow=0.02)
    position, rotation = truth.tool()
    shape = np.array([[0.0, 0.0, 0.0], [0.14, 0.0, 0.0], [0.03, 0.05, 0.0]])
    markers = position[:, None] + np.einsum("nij,kj->nki", rotation, shape)
    markers[4] = markers[4][[1, 0, 2]]
    head = [f"{j} motor [rad]" for j in JOINTS] + ["elbow link [rad]", "group"]
    head += [f"marker {name} {axis} [mm]" for name in "abc" for axis in "xyz"]
    rows = [
        [*truth.motor[i], "" if i == 3 else truth.q[i, 2], f"day {i % 3}", *row]
        for i, row in enumerate(1e3 * markers.reshape(12, 9))
    ]
    path = written(tmp_path / "poses.csv", head, rows)
    poses = StaticPoses.from_csv(path, dict.fromkeys(JOINTS, False))
    assert poses.exchanged == (4,)
    assert poses.group[:4] == ("day 0", "day 1", "day 2", "day 0")
    assert np.isnan(poses.link[3, 2])
    assert not poses.approach().any()  # each row is of another day than the one before
    order = ["calibrate", str(arm.description.path), str(path), "--term", "offset"]
    order += ["--folds", "groups", "--payload", "0.5", "--point", "0,0,10 mm"]
    assert main([*order, "--detail", "--scatter", "0.1 mm, 1 mrad"]) == 0
    said = capsys.readouterr().out
    assert "labels of markers are exchanged in 1 of 12 rows (5)" in said
    assert "held back: each of 3 groups" in said
    assert re.search(r"elbow +offset +20 mrad", said)
    with pytest.raises(JointplayError, match="elbow has no encoder on the link's side in every"):
        poses.read_by_link("elbow")
    path = written(
        path, [*head[:4], "point"], [[*row[:4], f"p{i % 2}"] for i, row in enumerate(rows)]
    )
    assert main([*order[:5], "--detail"]) == 0
    assert "held back: each of 2 points" in capsys.readouterr().out


def test_terms_and_unknowns_are_named_by_what_there_is(arm):
    fit = calibrate(arm, Truth(arm, 18, n=20).measured(), ["offset"], folds="rows")
    assert fit.folds == "each of 20 poses"
    with pytest.raises(JointplayError, match="no unknown 'knee offset'"):
        fit["knee offset"]
    for text in ("placement elbow.z", "rail waist by lift", "play elbow, wrist"):
        assert str(Term.parse(text)) == text


def test_the_effect_of_a_term_is_what_it_moves_the_tool_by(arm):
    """What is left of the tool's way by compliance when base and tool are placed best."""
    plain, _ = Truth(arm, 11).tool()
    truth = Truth(arm, 11).compliance(shoulder=1e-3, elbow=2e-3)
    position, rotation = truth.tool()
    n = len(plain)
    turns = np.array([np.cross(np.eye(3), one).T for one in plain])
    freedoms = np.concatenate([np.tile(np.eye(3), (n, 1, 1)), turns, rotation], axis=2)
    freedoms, way = freedoms.reshape(3 * n, 9), (position - plain).ravel()
    left = way - freedoms @ np.linalg.lstsq(freedoms, way, rcond=None)[0]
    wanted = np.linalg.norm(left) / np.sqrt(n)
    fit = calibrate(arm, truth.measured(orientation=False), ["compliance"])
    (effect,) = fit.effects
    assert effect.value == pytest.approx(wanted, rel=0.05)
    assert effect.low <= wanted <= effect.high
    assert effect.cells()[1] in str(fit)
    assert "compliance,m," in fit.data.csv(6)


@pytest.mark.thorough
def test_a_plan_chooses_among_many_more_poses_than_it_needs(monkeypatch):
    """Poses that are nearly all that there are would be as they come."""
    robot, widths = Mechanism("so101"), []
    for candidates in (calibration.CANDIDATES, 32):
        monkeypatch.setattr(calibration, "CANDIDATES", candidates)
        widths.append(plan_calibration(robot, count=30).half_width[-1])
    assert np.exp(np.mean(np.log(widths[1] / widths[0]))) > 1.05


def test_a_plan_promises_what_its_poses_then_tell(arm):
    terms, error = ("offset", "placement", "compliance"), (NOISE, 5.0 * NOISE)
    plan = plan_calibration(arm, terms, count=16, error=error)
    expected = dict(zip((one.label for one in plan.unknowns), plan.half_width[-1], strict=True))
    truth = Truth(arm, 5, n=16)
    truth.motor = np.array([one.positions for one in plan.experiments])
    truth.q = truth.motor.copy()
    fit = calibrate(arm, truth.measured(), (), always=terms, folds=2, error=error)
    found = [one.half_width / expected[one.label] for one in fit.coefficients if not one.reason]
    assert 0.6 < np.median(found) < 1.7
    assert (plan.half_width[1:] <= 1.001 * plan.half_width[:-1]).all()


def test_the_command_plans_poses_or_measures(tmp_path, capsys):
    order = ["calibrate", "ur5", "--tool", "tool0", "--term", "offset"]
    plan = [
        "--plan",
        "--count",
        "2",
        "--scatter",
        "0.1 mm, 0.5 mrad",
        "--out",
        str(tmp_path / "to"),
    ]
    assert main([*order, *plan]) == 0
    said = capsys.readouterr().out
    assert "2. measure the tool at: shoulder_pan_joint=" in said
    assert (tmp_path / "to" / "plan.txt").read_text() in said
    for wrong, words in ((order, "give a table"), ([*order, "--plan", "--count", "0"], "got 0")):
        assert main(wrong) == 2
        assert words in capsys.readouterr().err
