"""What has changed between measurements, alarms, and when a limit is reached."""

import json
import math
import re
import shlex
from pathlib import Path

import numpy as np
import pytest

from jointplay import Gear, JointplayError, Mechanism, budget
from jointplay.cli import main
from jointplay.estimate.gauge import Readings, gauge_problems, identify_gauged
from jointplay.estimate.identification import identify_problem
from jointplay.estimate.measurement import Measurement
from jointplay.estimate.servo_joint import RECORD_S, ServoJoint
from jointplay.estimate.watch import Target, in_order, watch
from jointplay.estimate.wiggle_plan import plan_wiggle
from jointplay.scenario.presets import preset
from jointplay.show.plots.design import courses
from jointplay.simulation.loads.drive import Servo

FORCES, ARM = np.array([0.0, 8.0, -8.0, 2.0, -2.0]), 0.1
JOINTS = ("shoulder_pan", "elbow_flex")
MONTHS = [f"dial-2026-{month:02d}-01.csv" for month in range(1, 7)]


def read(plays, seed=0, stiffness=100.0):
    """Readings of joints whose teeth stiffen under load."""
    random, turned = np.random.default_rng(seed), []
    push = np.tile(ARM * FORCES, len(plays))
    for play in plays:
        bent = np.sign(FORCES) * (ARM * abs(FORCES) / stiffness) ** 0.9
        zero, noise = random.normal(), 1e-4 * random.normal(size=5)
        turned.append(zero + np.sign(FORCES) * play / 2.0 + bent + noise)
    names = tuple(name for name in JOINTS[: len(plays)] for _ in FORCES)
    n = len(push)
    return Readings(names, ("",) * n, push, np.ravel(turned), np.full(n, 1e-4))


def series(growth, months=MONTHS):
    """A joint whose play grows by so much a month, and one whose does not."""
    robot = Mechanism("so101")
    return [
        (name, gauge_problems(robot, read([8e-3 + growth * k, 5e-3], seed=k)))
        for k, name in enumerate(months)
    ]


def test_a_change_is_told_where_values_are_not_yet_apart():
    found = watch(series(4e-4))
    last = found.courses["shoulder_pan gear play"].changes[-1]
    assert last.low <= 5 * 4e-4 <= last.high
    assert last.half_width < 1.2e-3
    ends = [
        identify_gauged(Mechanism("so101"), read([8e-3 + 4e-4 * k, 5e-3], seed=k)).estimates[0]
        for k in (0, 5)
    ]
    assert ends[0].high > ends[1].low  # by values nobody could tell
    assert ends[0].half_width > 3.0 * last.half_width
    assert len(found.alarms) == 1
    assert "shoulder_pan gear play has grown by" in found.alarms[0]
    other = found.courses["elbow_flex gear play"].changes[-1]
    assert other.low <= 0.0 <= other.high
    assert not watch(series(0.0)).alarms


def test_growth_is_by_the_day_where_names_have_dates_else_by_the_recording():
    found = watch(series(4e-4))
    rate = next(one for one in found.estimates if one.label == "shoulder_pan gear play per day")
    assert rate.low <= 4e-4 / (151.0 / 5.0) <= rate.high
    assert found.unit == "day"
    assert found.times[-1] == 151.0
    found = watch(series(4e-4, ["b", "a", "c"]))
    assert (found.unit, found.times[-1]) == ("recording", 2.0)
    names = ["on-2026-03-01.csv", "on-20260201.csv", "on-2026_01_09.csv"]
    assert [one.name for one in in_order([Path(one) for one in names])] == names[::-1]


def test_a_limit_is_alarmed_when_it_is_surely_exceeded_or_will_be_before_long():
    some, label = series(4e-4), "shoulder_pan gear play change"
    assert not watch(some, {label: 5e-3}).alarms
    (said,) = [one for one in watch(some, {label: 5e-3}).notes if "reaches" in one]
    expected, first, last = (float(one) for one in said_times(said))
    assert first < (5e-3 - 2e-3) / 4e-4 * 30.2 < last
    assert first < expected < last
    assert watch(some, {label: 5e-3}, ahead=1.2 * expected).alarms
    (alarm,) = watch(some, {label: 5e-4}).alarms
    assert "is above" in alarm
    unsure = watch(some, {"shoulder_pan gear play": 9e-3})
    assert not unsure.alarms
    assert any("may be above 9 mrad already" in one for one in unsure.notes)
    assert watch(some, {"shoulder_pan gear play": 4e-3}).alarms


def said_times(said):
    """Expected, first and last of a sentence."""
    words = said.replace("(", " ").replace(")", " ").split()
    at = words.index("about")
    return words[at + 1], words[at + 3], words[at + 5]


def test_what_differs_from_date_to_date_is_not_taken_for_play():
    """Softer by a tenth, as is assumed: no alarm, and the interval holds none."""
    robot = Mechanism("so101")
    some = [
        (str(k), gauge_problems(robot, read([5e-3], seed=k, stiffness=100.0 * 0.9**k)))
        for k in range(2)
    ]
    found = watch(some)
    (course,) = found.courses.values()
    assert course.changes[-1].low <= 0.0 <= course.changes[-1].high
    assert not found.alarms
    assert "compliances differ by 10 %" in str(found)


def lagging(path, play, seed):
    """Motor, link and torque of a joint whose link trails."""
    time = np.arange(0.0, 12.0, 0.01)
    angle = 0.4 - np.abs((0.2 * time) % 1.6 - 0.8)
    link, trail = angle.copy(), play / 2.0 + 0.5 / 1e3
    for i in range(1, len(angle)):
        link[i] = min(max(link[i - 1], angle[i] - trail), angle[i] + trail)
    random = np.random.default_rng(seed)
    torque = np.sign(angle - link) * np.clip(abs(angle - link) * 1e3 - play / 2.0 * 1e3, 0.0, None)
    signals = {
        ("motor", "shoulder_pan"): angle,
        ("link", "shoulder_pan"): link + random.normal() + 2e-5 * random.normal(size=len(time)),
        ("torque", "shoulder_pan"): torque + 0.02 * random.normal(size=len(time)),
    }
    path.write_text(Measurement(time, signals).csv())
    return path


def test_motions_are_watched_like_readings(tmp_path):
    robot = Mechanism("so101", gears={"shoulder_pan": Gear(1e-3, 0.1, 1e3)})
    some = [
        (path.name, [identify_problem(robot, path, known=["gear_compliance"])])
        for path in (
            lagging(tmp_path / f"{k}.csv", 2e-3 + 1e-4 * k, seed=k) for k in range(2)
        )
    ]  # fmt: skip
    (change,) = watch(some).courses["shoulder_pan gear play"].changes
    assert change.low <= 1e-4 <= change.high
    assert change.half_width < 1e-4


def written(folder, growth=4e-4, months=MONTHS):
    folder.mkdir()
    for k, name in enumerate(months):
        one = read([8e-3 + growth * k, 5e-3], seed=k)
        rows = zip(one.joint, one.push / ARM, one.turned, strict=True)
        lines = ["joint,force [N],arm [mm],angle [deg]"]
        lines += [f"{name},{force:g},100,{math.degrees(turn):.6f}" for name, force, turn in rows]
        (folder / name).write_text("\n".join(lines) + "\n")
    return folder


def test_the_command_tells_a_scheduler(tmp_path, capsys):
    folder = written(tmp_path / "series")
    old, new = folder / MONTHS[0], folder / MONTHS[-1]
    order = ["identify", "so101", "--noise", "link=1e-4"]
    out = tmp_path / "out"
    assert main([*order, "--against", str(folder), "--out", str(out)]) == 3
    said = capsys.readouterr().out
    assert said.startswith("Alarm: shoulder_pan gear play has grown by")
    told = json.loads((out / "watch.json").read_text())
    assert len(told["courses"]["elbow_flex gear play"]["changes"]) == 5
    assert {one.name for one in out.iterdir()} == {"watch.csv", "watch.json", "watch.png"}
    # The newest in its own place, also behind the option, says the same as both behind options.
    both = ["--against", new, "--against", old]
    for ways in (["--against", old, new], [new, "--against", old], both):
        limit = ["--limit", "shoulder_pan gear play change=0.5 deg"]
        assert main([*order, *map(str, ways), *limit]) == 0
        assert capsys.readouterr().out.startswith("No alarm: the play of 2 joints over 2")
    still = written(tmp_path / "still", 0.0)
    assert main([*order, "--against", str(still)]) == 0


WIGGLED = ("shoulder_pan", "elbow_flex")
LOGS = [f"servos-2026-{month:02d}-01.csv" for month in (1, 3, 5)]


@pytest.fixture(scope="module")
def plan():
    robot = preset("so101").mechanism()
    servo = Servo.of(
        "STS3215", voltage=7.4, p_gain=38.6, dead_band_counts=1.0, resolution=math.tau / 4096,
        encoder="link",
    )  # fmt: skip
    return plan_wiggle(robot, dict.fromkeys(robot.gears, servo), WIGGLED)


def wiggled(path, plan, plays):
    """What the servos of joints of such plays [deg] log of a plan."""
    now = np.arange(0.0, plan.time[-1], RECORD_S)
    goal = {
        n: np.interp(now, plan.time, x) for n, x in zip(plan.joints, plan.position.T, strict=True)
    }
    seen = {name: x.copy() for name, x in goal.items()}
    for one, play in zip(plan.steps, plays, strict=True):
        at = slice(*np.searchsorted(now, [one.begin - 0.5, one.end + 0.5]))
        joint = ServoJoint.of(
            one.known.servo, one.known.rotor_inertia, one.known.link_inertia,
            play=math.radians(play), stiffness=300.0, damping=0.4, link_friction=0.03,
        )  # fmt: skip
        seen[one.joint][at] = joint.move(goal[one.joint][at])[1]
    count, rows = math.tau / 4096, slice(None, None, 5)
    heads = ["time [s]", *(f"{n} {w} [rad]" for n in goal for w in ("goal", "position"))]
    angles = (x[n] for n in goal for x in (goal, seen))
    table = np.column_stack([now, *(count * np.round(x / count) for x in angles)])[rows]
    np.savetxt(path, table, "%.6f", ",", header=",".join(heads), comments="")
    return path


def test_logs_of_servos_are_watched_like_readings(plan, tmp_path, capsys):
    folder, out = tmp_path / "logs", tmp_path / "out"
    folder.mkdir()
    for name, grown in zip(LOGS, (0.0, 0.6, 1.2), strict=True):
        wiggled(folder / name, plan, (0.2 + grown, 0.5))
    order = ["identify", "so101", "--encoder", "output", "--against"]
    assert main([*order, str(folder), "--out", str(out)]) == 3
    said = capsys.readouterr().out
    assert said.startswith("Alarm: shoulder_pan gear play has grown by")
    told = json.loads((out / "watch.json").read_text())
    assert told["unit"] == "day"
    (first, last), still = (told["courses"][f"{name} gear play"]["changes"] for name in WIGGLED)
    assert first["low"] <= math.radians(0.6) <= first["high"]
    assert 0.0 < last["low"] <= math.radians(1.2) <= last["high"]
    assert all(one["low"] < 0.0 < one["high"] for one in still)
    rate = next(one for one in told["unknowns"] if one["quantity"] == "gear_play per day")
    assert rate["low"] == pytest.approx(last["low"] / told["times"][-1])
    assert (out / "watch.png").stat().st_size > 10_000
    limits = ["--limit", "shoulder_pan gear play change=1.6 deg"]
    assert main([*order, *(str(folder / name) for name in LOGS[::2]), *limits]) == 0
    assert "reaches 1.6 deg" in capsys.readouterr().out


def test_a_log_that_cannot_tell_is_no_change(plan, tmp_path, capsys):
    old, new = (wiggled(tmp_path / f"{k}.csv", plan, (0.4, 0.5)) for k in range(2))
    rows = np.loadtxt(new, delimiter=",", skiprows=1)
    rows[:, 0] *= 4.0
    np.savetxt(new, rows, "%.6f", ",", header=old.read_text().split("\n")[0], comments="")
    order = ["identify", "so101", "--encoder", "output", "--against", str(old), str(new)]
    assert main(order) == 0
    said = capsys.readouterr().out
    assert "of shoulder_pan, elbow_flex no change can be told" in said
    assert "records a second, and at least 80 are needed" in said
    assert "nan" not in said


def test_a_target_of_the_tool_is_alarmed_before_it_is_missed():
    """Of plays that grow in proportion, the tool's error too: by a line the time is known."""
    some = series(4e-4)
    arms = {("shoulder_pan", "gear_play"): 0.3, ("elbow_flex", "gear_play"): 0.1}

    def error(plays):
        return sum(arms[key] * play / 2.0 for key, play in plays.items())

    plays = [one for one in watch(some).estimates if one.unknown.name == "gear_play"]
    now = error({(one.joint, "gear_play"): one.value for one in plays})
    left = 2.0 * 0.3 / 2.0 * 4e-4  # two months
    found = watch(some, target=Target(now + left, error))
    assert not found.alarms  # growth of its own is none where a target is given
    (said,) = [one for one in found.notes if one.startswith("error of the tool reaches")]
    expected, first, last = map(float, said_times(said))
    assert first < 60.4 < last
    assert expected == pytest.approx(60.4, rel=0.5)
    (alarm,) = watch(some, ahead=90.0, target=Target(now + left, error)).alarms
    assert alarm.startswith("error of the tool reaches")
    (alarm,) = watch(some, target=Target(0.3 * now, error)).alarms
    assert "is above" in alarm


def test_the_command_tells_when_the_tool_misses_its_target(tmp_path, capsys):
    folder = written(tmp_path / "series")
    order = ["identify", "so101", "--noise", "link=1e-4", "--against", str(folder), "--detail"]
    assert main([*order, "--target", "9 mm"]) == 0
    said = capsys.readouterr().out
    assert "error of the tool reaches 9 mm in about" in said
    assert "tool at: " in said
    now = float(re.search(r"now ([\d.]+) mm to", said)[1])
    robot = Mechanism("so101", gears={n: Gear(8e-3, 0.1, 1e4) for n in JOINTS})
    assert 0.3 < now / (1e3 * budget(robot, {}).worst.max()) < 1.2
    assert main([*order, "--target", "0.1 mm"]) == 3
    assert capsys.readouterr().out.startswith("Alarm: error of the tool is above 0.1 mm")


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ("--against {old}", "at least two measurements, got 1"),
        ("--against {folder}/none.csv {old}", "there is no file"),
        ("--against {old} {moving}", "is a measurement in motion, and"),
        ("--against {folder} --limit 'knee gear play=1 deg'", "no play 'knee gear play'"),
        ("--against {folder} --limit 'elbow_flex gear play=1 mm'", "is not an angle"),
        ("--against {folder} --target 0", "--target must be positive"),
        ("--against {folder} --target '1 deg'", "is not a length"),
        ("--against {folder} --write-preset {folder}/my.toml", "--write-preset is of one"),
        ("--against {servos} {servos}", "encoder sits nobody says"),
        ("--against {servos} {servos} --encoder output --lag 0", "--lag is not for a wiggle"),
        ("--against {servos} {old}", "is a table of a dial gauge, and"),
        ("--against {folder} --plan dial", "--plan is of one"),
        ("--against {empty}", "holds no measurements"),
        ("{old} --limit 'elbow_flex gear play=1 deg'", "--limit needs earlier measurements"),
        ("{old} {old} {old}", "unrecognized arguments"),
    ],
)
def test_what_cannot_be_is_refused_in_a_line(tmp_path, capsys, options, said):
    folder, empty = written(tmp_path / "series", months=MONTHS[:2]), tmp_path / "empty"
    empty.mkdir()
    moving, servos = lagging(tmp_path / "moving.csv", 2e-3, 0), tmp_path / "servos.csv"
    servos.write_text("time [s],elbow_flex goal [deg],elbow_flex position [deg]\n0,0,0\n")
    places = {"folder": folder, "old": folder / MONTHS[0], "moving": moving, "empty": empty}
    places["servos"] = servos
    words = shlex.split(options.format(**places))
    try:
        status = main(["identify", "so101", *words])
    except SystemExit as refused:
        status = refused.code
    err = capsys.readouterr().err
    assert status == 2
    assert said in err
    assert err.count("\n") == 1


def test_measurements_of_different_things_are_not_compared():
    robot = Mechanism("so101")
    one, other = (gauge_problems(robot, read([8e-3] * n)) for n in (1, 2))
    with pytest.raises(JointplayError, match="no play was measured twice"):
        watch([("a", one), ("b", other[1:])])
    found = watch([("a", one), ("b", other)])
    assert "elbow_flex" in found.notes[0]
    assert "measured once" in found.notes[0]


def test_the_figure_has_each_play_with_its_changes():
    figure = courses(watch(series(4e-4)))
    assert [axes.get_title().partition("\n")[0] for axes in figure.axes[:2]] == [
        "shoulder_pan gear play", "elbow_flex gear play"
    ]  # fmt: skip


def test_a_joint_that_the_last_log_lacks_is_drawn_where_it_was_measured():
    some = series(4e-4)
    some[-1] = some[-1][0], some[-1][1][:1]
    found = watch(some)
    lacking = found.courses["elbow_flex gear play"]
    assert [*lacking.times] == [*found.times[1:-1]]
    drawn = courses(found).axes[1].lines[-1].get_xdata()
    assert max(drawn) == found.times[-2]
