"""Bags written by the library rosbags and datasets laid out as LeRobot does, as measurements."""

import json
import math

import numpy as np
import pytest
from conftest import needed
from test_identify import CLEARANCE, FRICTION, about, arm, planar, seen

from jointplay import JointplayError, Mechanism, Recording, identify
from jointplay.cli import main

pytestmark = needed("pyarrow", "rosbags")
import pyarrow as pa  # noqa: E402 - skipped without them
from pyarrow import parquet  # noqa: E402
from rosbags.rosbag2 import StoragePlugin, Writer  # noqa: E402
from rosbags.typesys import Stores, get_typestore  # noqa: E402

assert arm  # a fixture

JOINTS = {"j": False, "rail": True}
ROS = get_typestore(Stores.ROS2_HUMBLE)
POSE = "geometry_msgs/msg/PoseStamped"
START = 1_700_000_000_000_000_000


def message(kind, time, frame="", **fields):
    """A message with a header; of vectors x, y and z are given, all else is zero."""
    types = ROS.types
    stamp = types["builtin_interfaces/msg/Time"](*divmod(time, 1_000_000_000))
    header = types["std_msgs/msg/Header"](stamp, frame)
    vector, point = types["geometry_msgs/msg/Vector3"], types["geometry_msgs/msg/Point"]
    turn, zero = types["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0), vector(0.0, 0.0, 0.0)
    if kind == "sensor_msgs/msg/JointState":
        parts = [fields.get(k, []) for k in ("position", "velocity", "effort")]
        return types[kind](header, fields["name"], *(np.array(part, float) for part in parts))
    at, one = fields["at"], kind.rpartition("/")[2]
    moved = types["geometry_msgs/msg/Transform"]
    parts = {
        "PoseStamped": lambda: [types["geometry_msgs/msg/Pose"](point(*at), turn)],
        "PointStamped": lambda: [point(*at)],
        "TransformStamped": lambda: ["tool", moved(vector(*at), turn)],
        "WrenchStamped": lambda: [types["geometry_msgs/msg/Wrench"](vector(*at), zero)],
        "Vector3Stamped": lambda: [vector(*at)],
    }
    return types[kind](header, *parts[one]())


def bag(folder, topics):
    """A bag as `ros2 bag record` makes it, of rows (kind, time [s], fields) by topic."""
    with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        for topic, rows in topics.items():
            channel = writer.add_connection(topic, rows[0][0], typestore=ROS)
            for kind, time, fields in rows:
                nano = START + round(1e9 * time)
                fields = dict(fields)
                stamp = 0 if fields.pop("unstamped", False) else nano
                made = message(kind, stamp, **fields)
                writer.write(channel, nano, ROS.serialize_cdr(made, kind))
    return folder


def states(time, torques=None, **columns):
    """Rows of JointState messages of joints' columns; `torques` are those of all."""
    rows = []
    for i, t in enumerate(time):
        fields = {"name": list(columns), "position": [column[i] for column in columns.values()]}
        fields["effort"] = [] if torques is None else [torques[i]] * len(columns)
        rows.append(("sensor_msgs/msg/JointState", t, fields))
    return rows


def vectors(kind, time, table, **fields):
    return [
        (kind, t, {"at": row, **fields}) for t, row in zip(time, np.asarray(table), strict=True)
    ]


def table(measured, kind):
    return np.column_stack(
        [measured.signals.get((kind, axis), np.zeros(len(measured.time))) for axis in "xyz"]
    )


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """The arm's encoder and tracker, 3 ms apart, and half as many forces of a third clock."""
    measured = seen()
    time = measured.time
    angle = measured.signals["motor", "j"]
    forces, later = slice(0, None, 2), time + 3e-3
    return bag(
        tmp_path_factory.mktemp("bag") / "recorded",
        {
            "/joint_states": states(later, j=np.interp(later, time, angle), gripper=time),
            "/tracker": vectors(POSE, time, table(measured, "tool")),
            "/push": vectors(
                "geometry_msgs/msg/WrenchStamped",
                time[forces] + 1e-3,
                table(measured, "force")[forces],
                frame="base_link",
            ),
        },
    )


SOURCES = {"motor": "/joint_states", "tool": "/tracker", "force": "/push"}


def test_a_bag_of_topics_with_times_of_their_own_is_identified(arm, recorded):
    mechanism = Mechanism(arm, {"j": planar(5e-5, 0.1)})
    source = Recording(recorded, SOURCES, world=["base_link"])
    found = identify(mechanism, source, stiffness={"all": math.inf})
    for label, wanted in (("j radial clearance", CLEARANCE), ("j friction", FRICTION)):
        value, half = about(found[label])
        assert abs(value - wanted) < half < 0.4 * wanted
    assert all(one.known for one in found.estimates[:2])


@pytest.mark.thorough
def test_a_tracker_that_is_late_does_not_pass_for_play(arm, tmp_path):
    measured = seen(seed=7)
    time, late = measured.time, 3e-3
    path = bag(
        tmp_path / "late",
        {
            "/s": states(time, j=measured.signals["motor", "j"]),
            "/t": vectors(POSE, time + late, table(measured, "tool")),
            "/f": vectors("geometry_msgs/msg/WrenchStamped", time, table(measured, "force")),
        },
    )
    recording = Recording(path, {"motor": "/s", "tool": "/t", "force": "/f"})
    mechanism = Mechanism(arm, {"j": planar(5e-5, 0.1)})
    for lag in (None, 5e-3):
        found = identify(mechanism, recording, lag=lag)
        value, half = about(found["j radial clearance"])
        assert abs(value - CLEARANCE) < half < 0.4 * CLEARANCE
        words = "an unknown time" if lag is None else "some 5 ms"
        assert f"readings of tool and links are late by {words}" in str(found)
    value, half = about(identify(mechanism, recording, lag=0.0)["j radial clearance"])
    assert value - CLEARANCE > 3.0 * half
    with pytest.raises(JointplayError, match="the lag must not be negative"):
        identify(mechanism, recording, lag=-1e-3)


def test_an_unknown_lag_widens_the_interval(arm):
    mechanism, measured = Mechanism(arm, {"j": planar(5e-5, 0.1)}), seen(stops=False)
    half = [
        identify(mechanism, measured, known=["friction"], lag=lag).estimates[0].half_width
        for lag in (0.0, 1e-2, np.inf)
    ]
    assert half == sorted(half)
    assert half[-1] > 1.5 * half[0]


def test_signals_keep_the_times_of_their_records(recorded):
    read = Recording(recorded, SOURCES, world=["base_link"]).measurement(JOINTS)
    clean = seen()
    assert read.time[0] == 0.0
    n = len(clean.time)
    for key, number in ((("force", "z"), n / 2), (("motor", "j"), n), (("tool", "x"), n)):
        assert number - 3 < np.isfinite(read.signals[key]).sum() <= number
    x = read.signals["tool", "x"]
    known = ~np.isnan(x)
    # Encoder and force begin later than the tracker: its second record is the first that is kept.
    assert np.array_equal(x[known], clean.signals["tool", "x"][1 : 1 + known.sum()])
    steps = np.diff(read.time[known])
    assert steps == pytest.approx(0.01, abs=2e-9)


@pytest.mark.parametrize(
    ("kind", "signal"),
    [
        ("geometry_msgs/msg/PoseStamped", "tool"),
        ("geometry_msgs/msg/PointStamped", "tool"),
        ("geometry_msgs/msg/TransformStamped", "tool"),
        ("geometry_msgs/msg/WrenchStamped", "force"),
        ("geometry_msgs/msg/Vector3Stamped", "force"),
    ],
)
def test_vectors_are_read_from_the_messages_that_have_them(tmp_path, kind, signal):
    rows = np.column_stack([TIME, 2.0 + TIME, 3.0 - TIME])
    found = read(tmp_path, {"/v": vectors(kind, TIME, rows)}, {signal: "/v"})
    assert found.time == pytest.approx(TIME, abs=1e-9)
    assert np.array_equal(table(found, signal), rows)


def read(tmp_path, topics, sources, names=None):
    return Recording(bag(tmp_path / "b", topics), sources, names or {}).measurement(JOINTS)


TIME = 0.01 * np.arange(30)


def test_joints_are_renamed_turned_and_shifted_and_may_have_topics_of_their_own(tmp_path):
    topics = {
        "/s": states(TIME, motor_1=0.1 * TIME, motor_2=TIME, torques=1.0 + TIME),
        "/l": states(TIME, encoder=2.0 * TIME),
    }
    names = {"j": "-2*motor_1 + 90 deg", "rail": "motor_2 - 5 mm"}
    found = read(tmp_path / "a", topics, {"motor": "/s", "torque": "/s"}, names)
    assert found.signals["motor", "j"] == pytest.approx(np.pi / 2 - 0.2 * TIME)
    assert found.signals["motor", "rail"] == pytest.approx(TIME - 5e-3)
    assert found.signals["torque", "j"] == pytest.approx(-0.5 * (1.0 + TIME))  # the same power
    assert found.signals["torque", "rail"] == pytest.approx(1.0 + TIME)
    assert found.sliding == {"rail"}
    names = {"rail": "motor_2", "j": "encoder"}
    found = read(tmp_path / "b", topics, {"motor": "/s", "j link": "/l"}, names)
    assert found.signals["motor", "rail"] == pytest.approx(TIME)
    assert found.signals["link", "j"] == pytest.approx(2.0 * TIME)


def test_a_signal_that_begins_too_late_does_not_hide_the_others(tmp_path):
    topics = {"/s": states(TIME, j=TIME), "/t": vectors(POSE, TIME, np.ones((30, 3)))}
    topics["/l"] = states(TIME + 9.0, j=TIME, torques=TIME)
    found = read(tmp_path, topics, {"motor": "/s", "tool": "/t", "torque": "/l"})
    assert np.isfinite(found.signals["tool", "x"]).all()
    assert np.isnan(found.signals["torque", "j"]).all()


def test_messages_may_have_no_stamps_or_the_same_and_any_order(tmp_path):
    rows = states(TIME, j=TIME)
    bare = [(kind, t, fields | {"unstamped": True}) for kind, t, fields in rows]
    found = read(tmp_path / "a", {"/s": bare}, {"motor": "/s"})
    assert found.time == pytest.approx(TIME, abs=1e-9)
    assert "those of their recording" in found.notes[0]
    found = read(tmp_path / "b", {"/s": [*rows[::-1], *rows[:3]]}, {"motor": "/s"})
    assert found.signals["motor", "j"] == pytest.approx(TIME)
    assert "3 of 33 messages" in found.notes[0]


def dataset(folder, version="v2.1", episodes=2, names="list", unit=np.degrees, **more):
    """A LeRobot dataset in which the last episode is the arm's measurement."""
    measured = seen()
    time = measured.time
    angle = unit(measured.signals["motor", "j"])
    tool, force = 1e3 * table(measured, "tool"), table(measured, "force")
    named = {
        "list": ["j.pos", "gripper.pos"],
        "dict": {"motors": ["j.pos", "gripper.pos"]},
        "none": None,
    }[names]
    features = {
        "observation.state": {"dtype": "float32", "shape": [2], "names": named},
        "observation.tool": {"dtype": "float32", "shape": [3], "names": ["ee.x", "ee.y", "ee.z"]},
        "observation.force": {"dtype": "float32", "shape": [3], "names": {"axes": ["x", "y", "z"]}},
        "observation.images.wrist": {"dtype": "video", "shape": [4, 4, 3], "names": None},
        "action": {"dtype": "float32", "shape": [2], "names": named},
    }
    info = {
        "codebase_version": version, "fps": 100, "total_episodes": episodes, "chunks_size": 1000,
        "data_path": {
            "2": "data/chunk-{episode_chunk:03d}/episode_{episode_index:06d}.parquet",
            "3": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
        }[version[1]],
        "features": features,
    } | more  # fmt: skip
    (folder / "meta").mkdir(parents=True)
    (folder / "meta/info.json").write_text(json.dumps(info))
    tables = []
    for episode in range(episodes):
        real = episode == episodes - 1
        rows = range(len(time) if real else 40)
        columns = {
            "observation.state": [[angle[i] * real, 50.0] for i in rows],
            "observation.tool": [list(tool[i]) for i in rows],
            "observation.force": [list(force[i]) for i in rows],
            "action": [[0.0, 0.0] for _ in rows],
            "timestamp": [i / 100.0 for i in rows],
            "episode_index": [episode] * len(rows),
        }
        tables.append(pa.table(columns))
    (folder / "data/chunk-000").mkdir(parents=True)
    if version.startswith("v2"):
        for episode, one in enumerate(tables):
            parquet.write_table(one, folder / f"data/chunk-000/episode_{episode:06d}.parquet")
    else:
        parquet.write_table(pa.concat_tables(tables), folder / "data/chunk-000/file-000.parquet")
        (folder / "meta/episodes/chunk-000").mkdir(parents=True)
        index = {"episode_index": list(range(episodes))}
        index |= dict.fromkeys(["data/chunk_index", "data/file_index"], [0] * episodes)
        parquet.write_table(pa.table(index), folder / "meta/episodes/chunk-000/file-000.parquet")
    return folder


FEATURES = {
    "motor": "observation.state [deg]",
    "tool": "observation.tool [mm]",
    "force": "observation.force [N]",
}


@pytest.mark.parametrize(
    ("version", "names"), [("v2.0", "dict"), ("v2.1", "list"), ("v3.0", "list"), ("v3.1", "none")]
)
def test_a_dataset_is_read(tmp_path, version, names):
    path = dataset(tmp_path / "d", version, names=names)
    maps = {"j": "0"} if names == "none" else {}
    found, wanted = Recording(path, FEATURES, maps, episode=1).measurement(JOINTS), seen()
    for key, values in wanted.signals.items():
        if key[0] in ("motor", "tool"):
            assert found.signals[key] == pytest.approx(values, abs=1e-6)
    assert "100 a second" in found.notes[0]
    assert "episode 1" in found.notes[0]


def test_grippers_in_per_cent_and_sliders_in_degrees_are_left_out(tmp_path):
    path = dataset(tmp_path / "d", episodes=1)
    joints = {"j": False, "gripper": False}
    source = {"motor": "observation.state [deg]"}
    read = Recording(path, source).measurement(joints)
    assert read.has("motor") == ["j"]
    assert any("per cent" in note for note in read.notes)
    read = Recording(path, source, {"gripper": "1.1*gripper.pos - 10 deg"}).measurement(joints)
    assert read.signals["motor", "gripper"] == pytest.approx(np.radians(45.0))
    read = Recording(path, source, {"rail": "gripper.pos"}).measurement(JOINTS)
    assert read.has("motor") == ["j"]
    assert "'rail motor=observation.state [m]'" in read.notes[-1]


def test_what_cannot_be_read_from_a_bag_is_said_in_one_line(tmp_path, recorded, capsys):
    time, vector = 0.01 * np.arange(30), "geometry_msgs/msg/Vector3Stamped"
    nothing = states(time, j=time)
    late = {"/a": nothing, "/b": vectors(POSE, time + 9, np.ones((30, 3)))}
    later, nothing = bag(tmp_path / "later", late), bag(tmp_path / "nothing", {"/a": nothing})
    void = bag(tmp_path / "void", {"/a": vectors(vector, time, np.full((30, 3), np.nan))})
    motor = {"motor": "/joint_states"}
    for path, sources, more, words in (
        (recorded, {}, {}, r"say which topic is which signal .*/push \(WrenchStamped\)"),
        (recorded, {"motor": "/states"}, {}, r"no topic '/states'; .*available: /joint_states"),
        (recorded, {"speed": "/s"}, {}, "no signal 'speed'; available: motor, link"),
        (recorded, {"tool": "/joint_states"}, {}, "it is read from geometry_msgs/msg/PoseStamped"),
        (recorded, {"goal": "/joint_states"}, {}, "no signal 'goal'; available: motor, link"),
        (recorded, {"j tool": "/tracker"}, {}, "tool is of the tool, not of a joint"),
        (recorded, {"k motor": "/joint_states"}, {}, "no joint 'k'; available: j, rail"),
        (recorded, {"motor": "/joint_states [deg]"}, {}, r"SI units: write '/joint_states'"),
        (recorded, {"force": "/push"}, {}, "in the frame 'base_link'; .*--world base_link"),
        (recorded, motor, {"episode": 1}, "a bag has no episodes"),
        (recorded, motor, {"names": {"j": "elbow"}}, "no recorded name 'elbow'; available: j, gr"),
        (recorded, motor, {"names": {"k": "j"}}, "no joint or axis 'k'"),
        (recorded, motor, {"names": {"xy": "j"}}, "no joint or axis 'xy'"),
        (void, {"force": "/a"}, {}, "there is no force of 'x'"),
        (recorded, motor, {"names": {"j": "2 j"}}, "must read NAME, -NAME or FACTOR"),
        (recorded, motor, {"names": {"j": "0*j"}}, "must read NAME, -NAME or FACTOR"),
        (recorded, motor, {"names": {"j": "j + 3 kg"}}, "offset of 'j': .*kg"),
        (recorded, motor, {"names": {"rail": "j"}}, None),
        (recorded, {"torque": "/joint_states"}, {}, "none of its names is a joint"),
        (later, {"motor": "/a", "tool": "/b"}, {}, "do not overlap in time .*tool x 9 to"),
        (nothing, {"torque": "/a"}, {}, "none of its names is a joint"),
        (tmp_path / "none.mcap", motor, {}, "no bag"),
        (tmp_path / "none", motor, {}, "no recording"),
    ):  # fmt: skip
        if words is None:
            assert Recording(path, sources, **more).measurement(JOINTS).has("motor") == ["rail"]
            continue
        with pytest.raises(JointplayError, match=words) as caught:
            Recording(path, sources, **more).measurement(JOINTS)
        assert "\n" not in str(caught.value)
    for name in ("old.bag", "old.db3", "table.csv"):
        (tmp_path / name).write_text("")
        with pytest.raises(JointplayError, match=r"ros2 bag convert|neither a ROS 2 bag"):
            Recording(tmp_path / name, motor)
    split = tmp_path / "split"
    split.mkdir()
    (split / "metadata.yaml").write_text("")
    with pytest.raises(JointplayError, match=r"must have one file \.mcap, it has none"):
        Recording(split, motor).measurement(JOINTS)
    assert capsys.readouterr() == ("", "")


def test_what_cannot_be_read_from_a_dataset_is_said_in_one_line(tmp_path):
    good = dataset(tmp_path / "good")
    old = dataset(tmp_path / "old", version="v2.1", codebase_version="v1.6")
    moved = dataset(tmp_path / "moved", data_path="../{episode_index}.parquet")
    pointer = dataset(tmp_path / "pointer", episodes=1)
    file = "data/chunk-000/episode_000000.parquet"
    (pointer / file).write_text("version https://git-lfs.github.com/spec/v1\noid sha256:0\n")
    broken = dataset(tmp_path / "broken", episodes=1)
    (broken / file).write_bytes((broken / file).read_bytes()[:500])
    gone = dataset(tmp_path / "gone", episodes=1)
    (gone / file).unlink()
    empty = dataset(tmp_path / "empty", episodes=1)
    (empty / "meta/info.json").write_text("{}")
    odd = dataset(tmp_path / "odd", episodes=1)
    (odd / "meta/info.json").write_text("[1]")
    state = {"motor": "observation.state [deg]"}
    for path, sources, more, words in (
        (good, state, {}, "has 2 episodes: name one by --episode, 0 to 1$"),
        (good, state, {"episode": 7}, "0 to 1, got 7"),
        (good, {"motor": "observation.state"}, {}, "does not say its units"),
        (good, {"motor": "observation.state [kg]"}, {"episode": 1}, "source 'obs.*kg"),
        (good, {"motor": "action [deg]"}, {}, "what was commanded"),
        (good, {"motor": "observation.speed [deg]"}, {}, "available: observation.state, obs"),
        (good, {}, {}, "say which feature is which signal"),
        (good, state, {"world": ["base"]}, "has no frames"),
        (old, state, {"episode": 1}, r"of format 'v1\.6'; v2\.0, v2\.1 and v3\.0 are read"),
        (moved, state, {"episode": 1}, "has its data in '../{episode_index}"),
        (pointer, state, {}, "git lfs pull"),
        (broken, state, {}, "cannot read the LeRobot dataset"),
        (gone, state, {}, "no file of the dataset"),
        (empty, state, {}, "no 'features'"),
        (odd, state, {}, "cannot read the LeRobot dataset"),
    ):  # fmt: skip
        with pytest.raises(JointplayError, match=words) as caught:
            Recording(path, sources, **more).measurement(JOINTS)
        assert "\n" not in str(caught.value)


def test_the_command_reads_bags_and_datasets(arm, recorded, tmp_path, capsys):
    play = ["--joint", "j=0.1 mm", "--tool", "tool", "--quiet"]
    topics = [f"--source={name}={topic}" for name, topic in SOURCES.items()]
    order = ["identify", str(arm), str(recorded), *topics, "--world", "base_link", *play]
    assert main([*order, "--noise", "tool=5 um", "--out", str(tmp_path / "out")]) == 0
    said = capsys.readouterr().out
    assert "j radial clearance" in said
    assert "95 % interval" in said
    assert (tmp_path / "out/identified.csv").read_text().startswith("joint,quantity,")
    path = dataset(tmp_path / "d", "v3.0")
    features = [f"--source={name}={feature}" for name, feature in FEATURES.items()]
    order = ["identify", str(arm), str(path), *features, "--episode", "1", *play]
    assert main([*order, "--detail", "--lag", "0"]) == 0
    said = capsys.readouterr().out
    assert "j radial clearance" in said
    assert "assumed (--lag 0): readings of tool and links are simultaneous" in said
    csv = tmp_path / "m.csv"
    csv.write_text(seen(rate=40.0).csv())
    for order, words in (
        ([recorded], "say which topic is which signal"),
        ([csv, "--source=motor=/s"], "neither a ROS 2 bag"),
        ([recorded, "--source=motor"], "--source must read SIGNAL=TOPIC"),
        ([recorded, "--map=j"], "--map must read JOINT=NAME"),
        ([recorded, "--source=motor=/a", "--source=motor=/b"], "'motor' appears twice"),
    ):
        assert main(["identify", str(arm), *map(str, order), *play]) == 2
        said = capsys.readouterr().err
        assert words in said
        assert said.count("\n") == 1
