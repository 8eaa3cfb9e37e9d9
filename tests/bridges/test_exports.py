"""Results exported for other programs, read back by their libraries."""

import dataclasses
import io
import re
import sys
from contextlib import suppress

import hypothesis
import hypothesis.strategies as st
import numpy as np
import pandas as pd
import pytest
import yaml
from conftest import body, joint

import jointplay as jp
from jointplay import JointplayError, Motion, Result, cli
from jointplay.paper import scara
from jointplay.physics.joints import SphericalClearance
from jointplay.simulation.motion import rosbag
from jointplay.simulation.result.certificate import alone


@pytest.fixture(scope="module")
def result():
    return dataclasses.replace(scara(2e-4, seed=3), duration=0.1).run()


@pytest.fixture(scope="module")
def saved(result, tmp_path_factory):
    return result.save(tmp_path_factory.mktemp("run") / "r.nc")


@pytest.fixture(scope="module")
def bagged(result, tmp_path_factory):
    return result.export(tmp_path_factory.mktemp("bag") / "r.mcap", every=200)


def bag(path):
    """Topic, log time [s] and message of all messages."""
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    reader = make_reader(io.BytesIO(path.read_bytes()), decoder_factories=[DecoderFactory()])
    found = {}
    for _, channel, record, message in reader.iter_decoded_messages():
        found.setdefault(channel.topic, []).append((1e-9 * record.log_time, message))
    return found


def test_the_table_has_a_row_for_each_record_and_a_column_for_each_number(result):
    table = result.to_dataframe()
    assert len(table) == len(result.time)
    assert np.array_equal(table.index, result.time)
    assert table.index.name == "time"
    assert np.array_equal(table["q.joint_b.yaw"], result["q"].sel(coordinate="joint_b.yaw"))
    peaks = result["normal_force_peak"].sel(joint="joint_b", contact="axial_A")
    assert np.array_equal(table["normal_force_peak.joint_b.axial_A"], peaks)
    assert np.array_equal(table["tool_orientation.w"], result["tool_orientation"][:, 0])
    units = table.attrs["units"]
    assert list(units) == ["time", *table.columns]
    assert units["time"] == "s"
    assert units["q.joint_b.x"] == "m"
    assert units["v.joint_b.yaw"] == "rad/s"
    assert (units["drive.joint_a"], units["drive.stroke"]) == ("N m", "N")
    numbers = sum(
        variable[0].size
        for variable in result.dataset.data_vars.values()
        if "time" in variable.dims
    )
    assert table.shape[1] == numbers  # all columns of the SCARA's one bearing are there


def test_contacts_that_a_joint_does_not_have_give_no_column():
    made = scara(2e-4)
    joints = {
        "joint_a": jp.RevoluteClearance.planar(radial_clearance=2e-4),
        "joint_b": jp.RevoluteClearance(radial_clearance=2e-4, axial_clearance=2e-4),
    }
    mechanism = made.mechanism.with_clearance(joints)
    table = jp.simulate(mechanism, made.motion, duration=2e-3).to_dataframe()
    assert "gap.joint_b.axial_A" in table
    assert "gap.joint_a.axial_A" not in table
    assert not table.isna().to_numpy().any()


def test_fewer_records_keep_the_peaks_between_them(result):
    thin = result.thinned(300)
    assert thin.time.tolist() == pytest.approx([0.0, 0.03, 0.06, 0.09, 0.1])
    force = np.linalg.norm(result["joint_force_peak"].values[:, 0], axis=1)
    kept = np.linalg.norm(thin["joint_force_peak"].values[:, 0], axis=1)
    stretches = ((0, 1), (1, 301), (301, 601), (601, 901), (901, 1001))
    assert kept.tolist() == [force[a:b].max() for a, b in stretches]
    gaps = result["gap_min"].values[301:601].min(axis=0)
    assert np.array_equal(thin["gap_min"].values[2], gaps)
    assert thin["normal_force_peak"].max() == result["normal_force_peak"].max()
    assert np.array_equal(thin["q"], result["q"][[0, 300, 600, 900, 1000]])
    assert len(result.to_dataframe(every=300)) == 5
    for wrong in (0, -1, 2.5, True):
        with pytest.raises(JointplayError, match=r"every must be a whole number"):
            result.thinned(wrong)


def test_csv_reads_back_bit_for_bit_with_units_in_its_header(result, tmp_path):
    path = result.export(tmp_path / "r.csv")
    assert list(pd.read_csv(path).columns[:2]) == ["time [s]", "q.joint_a [rad]"]
    read = np.loadtxt(path, delimiter=",", skiprows=1)
    assert len(read) > 1000  # more than are written at a time
    assert np.array_equal(read, result.to_dataframe().reset_index().to_numpy())


def test_matlab_reads_every_column_and_its_unit(result, tmp_path):
    from scipy.io import loadmat

    read = loadmat(result.export(tmp_path / "r.mat"), simplify_cells=True)
    table = result.to_dataframe()
    np.testing.assert_array_equal(read["time"], table.index.values)
    name = next(name for name in table.columns if name.startswith("joint_force."))
    np.testing.assert_array_equal(read[name.replace(".", "_")], table[name].values)
    assert read["units"][name.replace(".", "_")] == "N"
    assert read["message"] == result.message


@pytest.mark.needs("pyarrow")
def test_parquet_reads_back_with_units_and_types(result, tmp_path):
    import pyarrow.parquet as pq

    path = result.export(tmp_path / "r.parquet")
    read = pd.read_parquet(path)
    pd.testing.assert_frame_equal(read, result.to_dataframe())
    assert read.attrs["units"]["tool_velocity.x"] == "m/s"
    schema = pq.read_schema(path)
    assert schema.field("q.stroke").metadata == {b"units": b"m"}
    assert read["mode.joint_b"].dtype == np.int8


def test_trajectories_have_the_joints_of_the_urdf(result, tmp_path):
    path = result.export(tmp_path / "t.yaml", every=2)  # more points than are written at a time
    read = yaml.load(path.read_text(), getattr(yaml, "CSafeLoader", yaml.SafeLoader))
    assert read["joint_names"] == ["joint_a", "joint_b", "stroke", "joint_c"]
    assert len(read["points"]) == 501
    last, row = read["points"][-1], result.dataset.isel(time=-1)
    assert last["time_from_start"] == {"sec": 0, "nanosec": 100_000_000}
    names = ["joint_a", "joint_b.yaw", "stroke", "joint_c"]
    for key, variable in (("positions", "q"), ("velocities", "v"), ("effort", "drive")):
        assert last[key] == row[variable].sel(coordinate=names).values.tolist()
    motion = Motion.from_csv(result.export(tmp_path / "t.csv", "trajectory"), "spline")
    assert motion.joints == tuple(read["joint_names"])
    assert np.array_equal(motion.positions, result["q"].sel(coordinate=names))


def test_sliders_give_their_way_and_balls_and_motors_nothing(urdf):
    path = urdf(
        *(body(f"l{i}", com="0.1 0 0") for i in range(3)),
        joint("turn", "base", "l0"),
        joint("slide", "l0", "l1", "prismatic", "1 0 0", "0.2 0 0"),
        joint("ball", "l1", "l2", "floating", at="0.2 0 0"),
    )
    mechanism = jp.Mechanism(
        path,
        {
            "slide": jp.PrismaticClearance(clearance=2e-4, clearance_y=2e-4),
            "ball": SphericalClearance(radial_clearance=2e-4),
        },
        gears={"turn": jp.Gear(play=1e-3, rotor_inertia=0.2, stiffness=1e4)},
        gravity=(0, 0, 0),
    )
    from jointplay.bridges.trajectory import joint_trajectory

    found = jp.simulate(mechanism, drive=jp.loads.Free(), duration=1e-3, state={"slide": 0.05})
    trajectory = joint_trajectory(found)
    assert trajectory.joints == ("turn", "slide")
    assert trajectory.position[0].tolist() == [0.0, 0.05]


def test_bags_hold_joint_states_trajectory_tool_and_forces(result, tmp_path):
    found = bag(result.export(tmp_path / "r.mcap", every=10))
    assert sorted(found) == [
        "/clearance/joint_b/force",
        "/clearance/joint_b/journal_centre",
        "/joint_states",
        "/joint_trajectory",
        "/tool_pose",
        "/tool_twist",
    ]
    ((_, trajectory),) = found["/joint_trajectory"]
    assert trajectory.joint_names == ["joint_a", "joint_b", "stroke", "joint_c"]
    assert len(trajectory.points) == 101
    at, state = found["/joint_states"][37]
    row = result.dataset.isel(time=370)
    assert at == pytest.approx(0.037)
    assert (state.header.stamp.sec, state.header.stamp.nanosec) == (0, 37_000_000)
    assert state.position[1] == float(row["q"].sel(coordinate="joint_b.yaw"))
    assert state.effort[2] == float(row["drive"].sel(coordinate="stroke"))
    pose = found["/tool_pose"][37][1].pose
    assert [getattr(pose.position, axis) for axis in "xyz"] == row["tool_position"].values.tolist()
    turn = [getattr(pose.orientation, name) for name in "wxyz"]
    assert turn == row["tool_orientation"].values.tolist()
    twist = found["/tool_twist"][37][1].twist
    spin = [getattr(twist.angular, axis) for axis in "xyz"]
    assert spin == row["tool_angular_velocity"].values.tolist()
    force = found["/clearance/joint_b/force"][37][1].vector
    assert [force.x, force.y, force.z] == row["joint_force"].values[0].tolist()


@pytest.mark.needs("rosbags")
def test_messages_are_those_of_ros(result, bagged):
    """Checked with the definitions and the reader of another implementation."""
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    from jointplay.simulation.motion.rosbag import _MESSAGES, definition

    store = get_typestore(Stores.ROS2_HUMBLE)
    for kind in _MESSAGES:
        for name, (_, fields) in get_types_from_msg(definition(kind), kind).items():
            assert fields == store.fielddefs[name][1], name
    with AnyReader([bagged], default_typestore=store) as reader:
        assert reader.message_count == 1 + 5 * len(result.thinned(200).time)
        for connection, _, raw in reader.messages():
            kind = connection.msgtype
            assert store.deserialize_cdr(raw, kind).header.stamp.sec == 0


def test_bags_come_back_as_motions(result, tmp_path):
    path = result.export(tmp_path / "r.mcap", every=10)
    names = ["joint_a", "joint_b.yaw", "stroke", "joint_c"]
    expected = result.thinned(10)["q"].sel(coordinate=names)
    for topic in (None, "/joint_states", "/joint_trajectory"):
        motion = Motion.from_mcap(path, topic)
        assert motion.joints == ("joint_a", "joint_b", "stroke", "joint_c")
        assert np.abs(motion.times - expected["time"].values).max() < 1e-9
        assert np.array_equal(motion.positions, expected)
        assert motion.interpolation == "spline"
    with pytest.raises(JointplayError, match=r"topic.*'/nothing'.*/joint_states"):
        Motion.from_mcap(path, "/nothing")


def test_a_giant_bag_is_not_read(tmp_path):
    path = tmp_path / "r.mcap"
    with path.open("wb") as file:
        file.truncate(rosbag.MOST_BYTES + 1)
    with pytest.raises(JointplayError, match=r"it has 4295 MB; at most 4294\.97 MB are read"):
        Motion.from_mcap(path)
    with pytest.raises(JointplayError, match="it is a folder"):
        Motion.from_mcap(tmp_path)


def written(path, *messages):
    """A bag of the given topics, kinds and contents, one each second."""
    from mcap_ros2.writer import Writer

    from jointplay.simulation.motion.rosbag import definition

    sink = io.BytesIO()
    with Writer(sink) as writer:
        for second, (topic, kind, content) in enumerate(messages):
            schema = writer.register_msgdef(kind, definition(kind))
            stamp = {"sec": 1_700_000_000 + second, "nanosec": 500_000_000}
            header = {"header": {"stamp": stamp, "frame_id": ""}}
            writer.write_message(topic, schema, content | header, second)
    path.write_bytes(sink.getvalue())
    return path


def test_recorded_joint_states_begin_at_zero_and_keep_what_all_messages_name(tmp_path):
    kind = "sensor_msgs/msg/JointState"
    states = [
        ("/joint_states", kind, {"name": names, "position": values, "velocity": [], "effort": []})
        for names, values in (
            (["a", "b", "gripper"], [0.1, 0.2, 9.0]),
            (["b", "a"], [0.4, 0.3]),
            (["a", "b"], [0.5, 0.6]),
        )
    ]
    motion = Motion.from_mcap(written(tmp_path / "s.mcap", *states))
    assert motion.joints == ("a", "b")
    assert motion.times.tolist() == [0.0, 1.0, 2.0]
    assert motion.positions.tolist() == [[0.1, 0.2], [0.3, 0.4], [0.5, 0.6]]


def test_bags_without_a_motion_are_refused_in_one_line(tmp_path):
    point = {"velocities": [], "accelerations": [], "effort": []}
    zero = {"sec": 0, "nanosec": 0}
    short = {"joint_names": ["a", "b"], "points": [point | {"positions": [1.0]}]}
    short["points"][0]["time_from_start"] = zero
    trajectory = "trajectory_msgs/msg/JointTrajectory"
    force = {"vector": {"x": 0.0, "y": 0.0, "z": 0.0}}
    state = {"name": ["a"], "position": [], "velocity": [], "effort": []}
    cases = {
        "point 1 has 1 positions for 2 joints": [("/t", trajectory, short)],
        "it holds geometry_msgs/msg/Vector3Stamped": [
            ("/f", "geometry_msgs/msg/Vector3Stamped", force)
        ],
        "name one of the topics /t, /u": [("/t", trajectory, short), ("/u", trajectory, short)],
        "message 1 has 0 positions for 1 joints": [("/s", "sensor_msgs/msg/JointState", state)],
    }
    for number, (text, messages) in enumerate(cases.items()):
        path = written(tmp_path / f"{number}.mcap", *messages)
        with pytest.raises(JointplayError, match=text) as caught:
            Motion.from_mcap(path)
        assert "\n" not in str(caught.value)
    with pytest.raises(JointplayError, match="no bag"):
        Motion.from_mcap(tmp_path / "none.mcap")
    whole = written(tmp_path / "whole.mcap", ("/t", trajectory, short)).read_bytes()
    for number, content in enumerate(
        (b"", b"no bag at all", whole[:-20], whole[: len(whole) // 2])
    ):
        broken = tmp_path / f"broken{number}.mcap"
        broken.write_bytes(content)
        with pytest.raises(JointplayError, match="broken") as caught:
            Motion.from_mcap(broken)
        assert "\n" not in str(caught.value)


@hypothesis.given(st.data())
@hypothesis.settings(
    max_examples=60,
    suppress_health_check=[
        hypothesis.HealthCheck.function_scoped_fixture,
        hypothesis.HealthCheck.too_slow,
    ],
)
def test_damaged_bags_are_read_or_refused_in_one_line(bagged, capsys, data):
    content = bytearray(bagged.read_bytes())
    for place in data.draw(st.lists(st.integers(0, len(content) - 1), min_size=1, max_size=4)):
        content[place] = data.draw(st.integers(0, 255))
    damaged = bagged.with_name("damaged.mcap")
    damaged.write_bytes(content[: data.draw(st.integers(1, len(content)))])
    try:
        Motion.from_mcap(damaged, data.draw(st.sampled_from([None, "/joint_states"])))
        said = ""
    except JointplayError as error:
        said = str(error)
    assert "\n" not in said
    assert capsys.readouterr() == ("", "")


def test_a_scenario_takes_a_bag_for_its_motion(result, tmp_path):
    result.export(tmp_path / "moved.mcap", every=20)
    scenario = tmp_path / "s.toml"
    scenario.write_text('[robot]\nurdf = "jointplay:scara.urdf"\n[motion]\nfile = "moved.mcap"\n')
    motion = jp.Scenario.load(scenario).simulation().motion
    assert motion.joints == ("joint_a", "joint_b", "stroke", "joint_c")
    assert motion.interpolation == "spline"
    scenario.write_text(scenario.read_text() + 'interpolation = "rest-to-rest"\n')
    assert jp.Scenario.load(scenario).simulation().motion.interpolation == "rest-to-rest"


def test_the_command_writes_and_says_what(saved, tmp_path, capsys):
    out = tmp_path / "r.csv"
    assert cli.main(["export", "result", str(saved), "--out", str(out), "--every", "100"]) == 0
    assert len(pd.read_csv(out)) == 11
    assert str(out) in capsys.readouterr().out
    for wrong, text in (
        (["--to", "mcap", "--out", "r.txt"], "must end in .mcap"),
        (["--out", "r.xlsx"], "must end in one of .csv, .parquet"),
        (["--out", str(out)], "exists"),
        (["--out", str(tmp_path / "x.csv"), "--every", "0"], "every must be a whole number"),
    ):
        assert cli.main(["export", "result", str(saved), *wrong]) == 2
        said = capsys.readouterr().err
        assert text in said
        assert said.count("\n") == 1


@pytest.mark.parametrize(
    ("name", "module", "extra"),
    [
        ("r.parquet", "pyarrow.parquet", "tables"),
        ("r.yaml", "yaml", "ros"),
        ("r.mcap", "mcap_ros2.writer", "ros"),
    ],
)
def test_a_missing_library_is_named_with_its_remedy(
    result, tmp_path, monkeypatch, name, module, extra
):
    for part in (module, module.split(".")[0]):
        monkeypatch.setitem(sys.modules, part, None)
    with pytest.raises(JointplayError, match=rf"pip install '\.\[{extra}\]'"):
        result.export(tmp_path / name)
    assert not list(tmp_path.iterdir())


def test_a_notebook_shows_figures_and_a_picture(result):
    page = result._repr_html_()
    judged = result.time >= result.judge_from
    peak = np.linalg.norm(result["joint_force_peak"].values[judged, 0], axis=1).max()
    assert "<th style='text-align:left'>peak force in joint_b</th>" in page
    assert f"{alone(peak)} N" in page
    assert "data:image/png;base64," in page
    assert "http" not in page
    judged = Result(result.dataset.copy())
    judged.certificate = jp.certify(judged, strict=False)
    names = re.findall(r"<th[^>]*>([^<]*)</th>", judged._repr_html_())
    assert len(set(names)) == len(names) > 10
    ideal = dataclasses.replace(scara(None), duration=0.01).run()
    assert "no joint" in ideal._repr_html_()


def test_at_a_prompt_results_and_answers_are_a_line(result):
    shown = repr(result)
    assert shown.startswith("<jointplay Result: scara, play of 0.2 mm in joint_b, 1001 records to ")
    assert "\n" not in shown
    robot = result.simulation.mechanism
    for answer in (jp.budget(robot), jp.allocate(robot, {}, 1e-3)):
        assert repr(answer) == f"<jointplay {type(answer).__name__}: {answer.sentence}>"
        assert str(answer.table()) in str(answer)
        assert "<table" in answer._repr_html_()
    signals = {("motor", "joint_a"): np.zeros(50)}
    measured = jp.Measurement(np.linspace(0.0, 1.0, 50), signals, source="a.csv")
    assert repr(measured) == (
        "<jointplay Measurement: a.csv, 50 records, 0 to 1 s; motor of joint_a>"
    )


def test_a_notebook_takes_no_markup_from_a_file(result):
    evil = Result(result.dataset.assign_attrs(message="<script>alert(1)</script>"))
    assert "<script>" not in evil._repr_html_()


@pytest.fixture
def summed(result, tmp_path):
    """A bag, its content, where its summary begins, and its motion."""
    path = result.export(tmp_path / "r.mcap", every=100)
    content = path.read_bytes()
    begin = int.from_bytes(content[-28:-20], "little")
    return path, content, begin, Motion.from_mcap(path, "/joint_states")


def test_no_flipped_bit_of_a_bag_gives_another_motion(summed):
    """The library checks the blocks alone; what lists them, their topics and counts is checked."""
    path, content, begin, reference = summed
    for k in range(120):
        changed = bytearray(content)
        at = begin + (len(content) - begin) * k // 120 if k % 2 else len(content) * k // 120
        changed[at] ^= 1 << k % 8
        path.write_bytes(changed)
        with suppress(JointplayError):
            assert Motion.from_mcap(path, "/joint_states") == reference


def without_checksum(path, content, at=0, changed=b""):
    """Write the bag as a writer leaves it that makes no checksum of its summary, changed there."""
    bare = bytearray(content[:-12] + bytes(4) + content[-8:])
    bare[at : at + len(changed)] = changed
    path.write_bytes(bare)


def test_definitions_of_a_bag_without_checksum_are_those_of_ros(summed):
    path, content, begin, reference = summed
    without_checksum(path, content)
    assert Motion.from_mcap(path, "/joint_states") == reference
    at = content.index(b"float64[] position\n", begin)
    without_checksum(path, content, at, b"float64[] velocity\nfloat64[")
    with pytest.raises(JointplayError, match="no checksum, and its definition of sensor_msgs/msg"):
        Motion.from_mcap(path, "/joint_states")


def test_messages_of_a_bag_are_as_many_as_its_statistics_say(summed):
    path, content, begin, _ = summed
    with rosbag.opened(path) as found:
        number = found.messages["/joint_states"]
    at = content.index(number.to_bytes(8, "little"), begin)
    without_checksum(path, content, at, (number + 1).to_bytes(8, "little"))
    with pytest.raises(JointplayError, match=f"there are {number} messages, and {number + 1} by"):
        Motion.from_mcap(path, "/joint_states")
