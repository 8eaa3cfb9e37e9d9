"""Measured robots: what play, elasticity, offsets and encoder errors explain.

Public measurements, read from clones of their repositories; nothing of them is in this package:

    git clone https://github.com/thanhndv212/figaroh-plus
    git clone https://github.com/platonics-delft/kinematics_calibration
    git clone https://github.com/roboninecom/Measuring-Backlash-in-Popular-UART-Servos
    python benchmarks measured --data .

- TIAGo's arm before a Vicon, encoders on both sides of the gears, 21 poses: CNRS and Toward SAS.
  (The URDFs beside the data are under CC BY-NC-ND 3.0; example-robot-data's is used instead.)
- MUKCa, a ball held in sockets by Pandas, a KUKA and Kinovas: platonics.
- Servos whose lever is pulled by bands: B. Kotov, Robonine; logs under CC BY 4.0, as the table of
  files in the repository's paper says.

Commits and licences are in `SOURCES`. Git directories without work tree will do. A position that
was held back counts as explained if it lies in the 95 % region that the fit of the others predicts;
a state of a servo, if the controller's law of the other states gives its duty within two
thousandths.
"""

from __future__ import annotations

import csv
import io
import math
import subprocess
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter

import numpy as np
from common import COLOURS, DOCS, command, new_figure

import jointplay as jp
from jointplay.base.files import temporary
from jointplay.base.tables import Table
from jointplay.estimate import Calibration, StaticPoses, Term, calibrate, encoder_differences
from jointplay.estimate.static_poses import rigid_body, rotation_vectors
from jointplay.model.payload import Payload
from jointplay.show.plots.design import calibration as picture

PICTURES = DOCS / "images" / "measured"


@dataclass(frozen=True)
class Repository:
    """A clone of a public repository at one commit."""

    owner: str
    name: str
    commit: str
    licence: str
    data: Path

    @property
    def folder(self) -> Path:
        """Where the clone is: by its name, or by owner and name."""
        for path in (self.data / self.name, self.data / f"{self.owner}+{self.name}" / "repo"):
            if path.is_dir():
                return path
        raise SystemExit(
            f"{self.data} has no clone of {self.name}; get it with: git clone "
            f"https://{self.address} {self.data / self.name}"
        )

    @property
    def address(self) -> str:
        return f"github.com/{self.owner}/{self.name}"

    def _git(self, *words: str) -> str:
        order = ["git", "-C", str(self.folder), *words]
        done = subprocess.run(order, capture_output=True, text=True, check=False)
        if done.returncode:
            raise SystemExit(
                f"{self.folder}: git {' '.join(words)}: {done.stderr.strip()}; the commit "
                f"{self.commit} is needed: git -C {self.folder} fetch origin {self.commit}"
            )
        return done.stdout

    def text(self, path: str) -> str:
        """A file at the commit, whose name is the hash of all contents."""
        return self._git("show", f"{self.commit}:{path}")

    def names(self, folder: str) -> list[str]:
        """Files below a folder at the commit."""
        return self._git("ls-tree", "-r", "--name-only", self.commit, folder).split("\n")[:-1]


SOURCES = {
    "tiago": (
        "thanhndv212", "figaroh-plus", "e5f273971bcf3539df6406bfa918ba807736209b", "Apache-2.0"
    ),
    "mukca": (
        "platonics-delft", "kinematics_calibration", "05a05ab4cbbe328c8f5bfcc76479c752ed07b82e",
        "MIT",
    ),
    "servos": (
        "roboninecom", "Measuring-Backlash-in-Popular-UART-Servos",
        "5273b56230f38cae1201103dc30d64b2ceebf3ef", "logs: CC-BY-4.0",
    ),
}  # fmt: skip
"""Owner, name, commit, licence of each."""


def source(key: str, data: Path) -> Repository:
    """One of `SOURCES`, with its clone in a folder."""
    return Repository(*SOURCES[key], data)


@dataclass
class Report:
    """Lines of text, and what counts in the last one."""

    lines: list[str] = field(default_factory=list)
    sets: int = 0
    explained: int = 0
    total: int = 0

    def say(self, *lines: str) -> None:
        """Print and keep."""
        for line in lines:
            print(line, flush=True)
            self.lines.append(line)

    def count(self, name: str, inside: int, total: int) -> None:
        """A data set's predictions that lie in their stated interval."""
        self.explained += inside
        self.total += total
        self.say(f"{name}: {inside} of {total} within their stated interval")


# TIAGo


JOINTS = ("torso_lift_joint", *(f"arm_{i}_joint" for i in range(1, 8)))
ARM = JOINTS[1:]
IMPOSSIBLE = (
    *("base_antenna_left_link", "base_antenna_right_link", "arm_tool_link", "wrist_ft_link"),
    "wrist_ft_tool_link",
)
"""Links of the URDF whose inertia no body has; they hardly weigh anything."""
GRIPPER = Payload("arm_7_link", 0.94, centre=(0.0004, -0.0082, 0.0996))
"""Which the arm carried and the URDF has not."""
SCATTER = (2.5e-3, 15e-3)
SOFT = dict(zip(ARM, (*[1e-3] * 4, 1e-2, 2e-2, 2e-2), strict=True))
OFFSET, PLACEMENT = Term("offset", ARM, 0.2), Term("placement", ARM[1:], 2e-3)
COMPLIANCE = Term("compliance", ARM[1:], SOFT)
RAIL = Term("rail", ("arm_1_joint",), by="torso_lift_joint")
PLAY = Term("play", ("arm_6_joint",), 6e-2)
PLAY_ELSE = Term("play", ARM[1:5], 1e-2)


def vicon(repository: Repository, name: str, side: str, columns: list[str]) -> np.ndarray:
    """Columns of one of the files."""
    path = "examples/tiago/data/calibration/mocap/vicon/"
    text = repository.text(f"{path}{side}_encoder/vicon_calibration_fc10_{name}.csv")
    rows = list(csv.DictReader(io.StringIO(text)))
    return np.array([[float(row[column]) for column in columns] for row in rows])


def tiago_poses(repository: Repository, frame: str) -> StaticPoses:
    """The hand in the frame of the base's markers, or in that of the torso's."""
    motor = vicon(repository, "gripper3_base1", "relative", list(JOINTS))
    link = vicon(repository, "gripper3_base1", "absolute", list(JOINTS))
    link[:, 0] = np.nan  # the files hold zeros: the lift has no such encoder
    markers = stacked(repository, [f"gripper{i}_base1" for i in range(1, 4)])
    if frame == "base":
        return StaticPoses.from_markers(JOINTS, motor, markers, link=link)
    _, turned, at, _ = rigid_body(torso_markers(repository))
    inside = (markers - at[:, None]) @ turned
    return StaticPoses.from_markers(ARM, motor[:, 1:], inside, link=link[:, 1:])


def stacked(repository: Repository, names: list[str]) -> np.ndarray:
    """Positions of markers, shape (n, markers, 3) [m]."""
    return np.stack([vicon(repository, n, "relative", ["x1", "y1", "z1"]) for n in names], axis=1)


def torso_markers(repository: Repository) -> np.ndarray:
    return stacked(repository, [f"shoulder{i}_base1" for i in range(1, 5)])


def tiago_robot() -> jp.Mechanism:
    """Without its hand."""
    return jp.Mechanism("tiago_no_hand", tool="arm_7_link", allow_unphysical=IMPOSSIBLE)


def tiago(repository: Repository, report: Report) -> dict[str, Calibration]:
    """Encoders, then poses in both frames by both encoders."""
    robot = tiago_robot()
    base = tiago_poses(repository, "base")
    report.say("", "# TIAGo's arm, 21 poses before a Vicon", "")
    report.say("## Encoders on both sides of the gears, link less motor", "")
    for one in encoder_differences(robot, base, [GRIPPER]):
        report.say(str(one), "")
    fits: dict[str, Calibration] = {}
    common = {"payloads": [GRIPPER], "error": SCATTER}
    torso, by_link = tiago_poses(repository, "torso"), base.read_by_link("arm_6_joint")
    for frame, encoder, poses, terms in (
        ("base", "motor", base, [RAIL, COMPLIANCE, PLAY, PLAY_ELSE]),
        ("base", "link of arm_6", by_link, [RAIL, COMPLIANCE, PLAY_ELSE]),
        ("torso", "motor", torso, [COMPLIANCE, PLAY, PLAY_ELSE]),
        ("torso", "link of arm_6", torso.read_by_link("arm_6_joint"), [COMPLIANCE, PLAY_ELSE]),
    ):
        report.say("", f"## Hand in the frame of the {frame}'s markers, encoder: {encoder}", "")
        fit = calibrate(robot, poses, [PLACEMENT, *terms], always=[OFFSET], **common)
        fits[f"{frame}, {encoder}"] = fit
        report.say(str(fit))
        report.count(f"TIAGo, {frame}, {encoder}", int(fit.within.sum()), len(fit.within))
    report.say("", "## Of the placements the forearm's length alone", "")
    always = [OFFSET, RAIL, Term("placement", ("arm_5_joint",), 1e-2, axes="z")]
    soft = Term("compliance", ("arm_6_joint",), 2e-2)
    for words, poses, terms in (("motor", base, [soft, PLAY]), ("link of arm_6", by_link, [])):
        few = calibrate(robot, poses, terms, always=always, **common)
        report.say(f"encoder: {words}", *str(few).split("\n\n")[0].splitlines())
        report.say(str(few["arm_5_joint placement along z"]))
    report.say("", "## Which encoder is right: share of the link's reading in the poses", "")
    always = [OFFSET, PLACEMENT, RAIL, Term("link-encoder", ARM)]
    share = calibrate(robot, base, (), always=always, **common)
    report.say(*(str(one) for one in share.coefficients if one.unknown.name == "link-encoder"))
    report.say("", "## Suspension, errors of the motors' encoders: one after the other", "")
    terms = [Term("suspension", ("arm_1_joint",)), Term("eccentricity", ARM, 2e-2)]
    always = [OFFSET, PLACEMENT, RAIL, COMPLIANCE]
    more = calibrate(robot, by_link, terms, always=always, **common)
    report.say(*str(more).split("\n\n")[0].splitlines(), "")
    lift = vicon(repository, "gripper3_base1", "relative", ["torso_lift_joint"])[:, 0]
    _, turned, _, _ = rigid_body(torso_markers(repository))
    slopes = np.polyfit(lift, rotation_vectors(turned @ turned[0].T), 1)[0]
    report.say(
        "torso's markers: it turns with its lift by "
        + ", ".join(f"{1e3 * s:.1f}" for s in slopes)
        + " mrad/m about the axes of the base's markers"
    )
    report.sets += 1
    return fits


# MUKCa: a ball in sockets


@dataclass(frozen=True)
class Robot:
    """One data set: name, what is left out of it and why."""

    name: str
    out: tuple[str, ...] = ()
    """Placements."""
    reason: str = ""
    tail: tuple[str, int] | None = None
    """Socket and its first row that is left out, with all behind."""

    @property
    def kinova(self) -> bool:
        """Whether it has six joints and is softer."""
        return self.name.startswith("dinova")


ROBOTS = (
    Robot("panda_1"),
    Robot("panda_1_with_sensor"),
    Robot(
        "panda_2", ("high",), "1.1 mm where others have 0.2 to 0.5 (its publishers drop it, too)"
    ),
    Robot("panda_3"),
    Robot("panda_3_bis"),
    Robot("panda_4"),
    Robot("panda_6"),
    Robot("panda_7"),
    Robot("panda_left"),
    Robot("panda_right"),
    Robot("kuka_14"),
    Robot("dinova_1", ("front",), "socket 0 has two places 10 mm apart: it was moved"),
    Robot("dinova_2", (), "the tool fell off after row 11", ("front_rotated/1", 11)),
)


def mukca_poses(repository: Repository, robot: Robot, joints: tuple[str, ...]) -> StaticPoses:
    """The same unknown points again, two sockets 50 mm apart in each placement."""
    motor, points, groups = [], [], []
    for path in repository.names(f"data/{robot.name}/"):
        place, _, file = path.removeprefix(f"data/{robot.name}/").partition("/")
        if file not in ("hole_0.csv", "hole_1.csv") or place in robot.out:
            continue
        point = f"{place}/{file[5]}"
        rows = np.loadtxt(io.StringIO(repository.text(path)), delimiter=",", ndmin=2)
        if robot.tail is not None and point == robot.tail[0]:
            rows = rows[: robot.tail[1]]
        motor.append(rows)
        points += [point] * len(rows)
        groups += [place] * len(rows)
    apart = {
        (f"{place}/0", f"{place}/1"): (50e-3, 0.1e-3)
        for place in dict.fromkeys(groups)
        if {f"{place}/0", f"{place}/1"} <= set(points)
    }
    return StaticPoses(
        joints, np.vstack(motor), point=tuple(points), group=tuple(groups), distances=apart,
        ordered=False, source=robot.name,
    )  # fmt: skip


def mukca_robot(
    repository: Repository, robot: Robot, folder: Path
) -> tuple[jp.Mechanism, tuple[str, ...], tuple[float, float, float]]:
    """Mechanism, its joints, and the ball's nominal place in the last link."""
    if robot.name.startswith("panda"):
        reach = 0.279 if "sensor" in robot.name else 0.241
        joints = tuple(f"panda_joint{i}" for i in range(1, 8))
        return jp.Mechanism("panda", tool="panda_link7"), joints, (0.0, 0.0, reach)
    file, tool, joint, reach, count = "iiwa14_epfl.urdf", "iiwa_link_7", "joint_a{}", 0.08, 7
    if robot.kinova:
        file, tool, joint, reach, count = "gen3lite.urdf", "", "joint_{}", 0.18, 6
    path = folder / file
    path.write_text(repository.text(f"urdf/{file}"), encoding="utf-8")
    allowed = _impossible(path)
    if not tool:  # the link behind the sixth joint, by whatever name
        tool = jp.Mechanism(path, allow_unphysical=allowed).description.joints["joint_6"].child
    mechanism = jp.Mechanism(path, tool=tool, allow_unphysical=allowed)
    return mechanism, tuple(joint.format(i) for i in range(1, count + 1)), (0.0, 0.0, reach)


def _impossible(path: Path) -> list[str]:
    """Links whose inertia no body has, as the refusal names them."""
    try:
        jp.Mechanism(path)
    except jp.JointplayError as error:
        words = str(error).rpartition("--allow-unphysical ")[2]
        return [one.strip() for one in words.rstrip(") ").split(",")]
    return []


def mukca_terms(robot: Robot, joints: tuple[str, ...]) -> tuple[list[Term], list[Term]]:
    """What is always in the model, and the candidates."""
    soft, play, smooth = (3e-3, 1e-2, 0.1) if robot.kinova else (2e-4, 2e-3, 0.5)
    always = [Term("offset", joints, 2e-2), Term("placement", joints[1:], 2e-3)]
    return always, [
        Term("compliance", joints, soft),
        Term("eccentricity", joints, 2e-3),
        Term("second-harmonic", joints, 1e-3),
        Term("play", (), play, friction=0.0, transition=smooth),
    ]


def mukca(
    repository: Repository, report: Report, folder: Path, only: set[str]
) -> dict[str, Calibration]:
    """All robots in one table."""
    report.say(
        "", "# MUKCa: a ball in sockets, placements held back (single placements: sockets)", ""
    )
    head = ["robot", "positions", "placements", "calibrated mm (held back)", "+ compliance"]
    head += ["+ play", "kept", "held back", *(f"j{i}" for i in range(1, 8))]
    rows, fits = [head], {}
    for robot in ROBOTS:
        if only and robot.name not in only:
            continue
        began = perf_counter()
        mechanism, joints, ball = mukca_robot(repository, robot, folder)
        poses = mukca_poses(repository, robot, joints)
        always, terms = mukca_terms(robot, joints)
        fits[robot.name] = fit = calibrate(mechanism, poses, terms, always=always, point=ball)
        first = fit.steps[0]
        with_one = {
            one.terms[-1].kind: f"{1e3 * one.held_back[0]:.3f}"
            for one in fit.steps
            if len(one.terms) == len(first.terms) + 1
        }
        bounds = {one.joint: "-" if one.reason else f"{1e3 * one.upper:.2f}" for one in fit.play}
        told = [bounds.get(joint, "-") for joint in joints]
        rows.append(
            [
                robot.name,
                str(len(poses)),
                str(len(set(poses.group or ()))),
                f"{1e3 * first.training[0]:.3f} ({1e3 * first.held_back[0]:.3f})",
                *(with_one.get(kind, "-") for kind in ("compliance", "play")),
                " + ".join(term.kind for term in fit.kept[2:]) or "nothing",
                f"{1e3 * fit.step().held_back[0]:.3f}",
                *(told + [""] * 7)[:7],
            ]
        )
        left = f"; left out: {' '.join(robot.out) or robot.tail}: {robot.reason}"
        left = left if robot.reason else ""
        report.say(f"{robot.name}: {perf_counter() - began:.0f} s{left}", str(fit))
        report.count(robot.name, int(fit.within.sum()), len(fit.within))
        report.say("")
        report.sets += 1
    report.say("upper 95 % bounds of play [mrad]; -: this measurement cannot tell", "")
    report.say(str(Table.of_texts(rows)))
    return fits


# Servos


LOGS = {
    # file: servos under test, and pullers towards + and - with their relaxed and stretched targets
    "single": ((5,), (4, 2347, 1947), (3, 1747, 2147)),
    "single_3250": ((4,), (2, 1747, 2147), (1, 2347, 1947)),
    "nocomp2": ((1, 2), (4, 2347, 1847), (3, 1747, 2247)),
    "comp2": ((1, 2), (4, 2347, 1847), (3, 1747, 2247)),
    "pgain_zero_db": ((1, 2), (4, 2347, 1847), (3, 1747, 2247)),
}
HOME, DEGREES = 2047, 360.0 / 4096.0
FRICTION = 15.7
"""Friction of an STS3215 in thousandths of its torque at 7.4 V (the package's servos)."""


def signed(text: str, bit: int) -> int:
    """Sign and magnitude, as the servos send it."""
    raw = int(float(text))
    return (-1 if raw >> bit & 1 else 1) * (raw & ((1 << bit) - 1))


def at_rest(rows: list[dict[str, str]], name: str, number: int) -> np.ndarray:
    """Error [counts] and duty [1/1000] of a servo that stands and was told to be at home."""
    tested, *pullers = LOGS[name]
    found = []
    for i, row in enumerate(rows):
        needed = [f"pos ({n})" for n in (*tested, *(one[0] for one in pullers))]
        if not all(row[column] for column in needed):
            continue
        home = all(
            row[f"target pos ({n})"] and float(row[f"target pos ({n})"]) == HOME for n in tested
        )
        parts = [
            (float(row[f"pos ({n})"]) - relaxed) / (stretched - relaxed)
            for n, relaxed, stretched in pullers
        ]
        settled = all(part < 0.05 or part > 0.6 for part in parts)
        last = [rows[k][f"pos ({number})"] for k in range(max(i - 2, 0), i + 1)]
        if not home or not settled or len(last) < 3 or not all(last):
            continue
        if np.ptp([float(x) for x in last]) > 1.0 or signed(row[f"speed ({number})"] or "0", 15):
            continue
        error = float(row[f"pos ({number})"]) - HOME
        if abs(error) < 30:
            found.append((error, signed(row[f"load ({number})"] or "0", 10)))
    return np.array(found)


def servos(repository: Repository, report: Report) -> None:
    """The controller's output is an exact function of the error, so the error is no play."""
    report.say("", "# Servos: duty at rest over the encoder's error from the target", "")
    for name, (tested, *_) in LOGS.items():
        text = repository.text(f"logs/motor_telemetry_{name}.csv")
        rows = list(csv.DictReader(io.StringIO(text)))
        for number in tested:
            states = at_rest(rows, name, number)
            size, duty = np.abs(states[:, 0]), np.abs(states[:, 1])
            pushing = duty > 0.0
            # Of every second state that pushes; the others are predicted.
            law = np.polyfit(size[pushing][::2], duty[pushing][::2], 1)
            said = np.polyval(law, size[pushing][1::2])
            inside = int((np.abs(said - duty[pushing][1::2]) <= 2.0).sum())
            idle = size[~pushing].max(initial=0.0)
            stops = (FRICTION - law[1]) / law[0]
            report.say(
                f"{name}, servo {number}: {len(states)} records at rest, duty "
                f"{law[0]:.2f} |error| {law[1]:+.1f} of 1000, none up to {idle:.0f} counts; "
                f"friction of {FRICTION} of 1000 stops it {max(stops, idle):.1f} counts from home: "
                f"{2.0 * max(stops, idle):.1f} counts ({2.0 * DEGREES * max(stops, idle):.2f} deg) "
                "between the sides without any play"
            )
            report.count(f"{name}, servo {number}", inside, int(pushing.sum() // 2))
    report.say(
        "play cannot be told: the encoder is inside the loop, and the law of the controller and "
        "friction give the published lost motion; a second encoder, on the motor, or two small "
        "loads on the lever of a servo without torque, would tell"
    )
    report.sets += 1


def draw(fits: dict[str, Calibration], fits_mukca: dict[str, Calibration]) -> None:
    """Held-back errors by model: TIAGo's ladder, and all robots before and after."""
    PICTURES.mkdir(parents=True, exist_ok=True)
    picture(fits["base, link of arm_6"]).savefig(PICTURES / "tiago.png", dpi=120)
    figure, (axes,) = new_figure(1, 2, 9.0, 3.6)
    place, names = np.arange(len(fits_mukca)), list(fits_mukca)
    for shift, pick, label in (
        (-0.2, lambda fit: fit.steps[0], "offsets and placements"),
        (0.2, lambda fit: fit.step(), "with what was kept"),
    ):
        sizes = [1e3 * pick(fit).held_back[0] for fit in fits_mukca.values()]
        axes[0].barh(place + shift, sizes, 0.38, label=label, color=COLOURS[shift > 0])
    axes[0].legend(fontsize=7)
    ticks = [0.1, 0.2, 0.5, 1.0, 2.0, 5.0]
    axes[0].set(xscale="log", xlim=(0.1, 6.0), xlabel="held-back scatter of the ball [mm] (RMS)")
    axes[0].set_xticks(ticks, [f"{x:g}" for x in ticks])
    axes[0].minorticks_off()
    for row, fit in enumerate(fits_mukca.values()):
        for j, one in enumerate(fit.play):
            if not one.reason and math.isfinite(one.upper):
                axes[1].plot(1e3 * one.upper, row, "o", ms=4, color=COLOURS[j % len(COLOURS)],
                             label=f"joint {j + 1}")  # fmt: skip
    handles = dict(zip(*axes[1].get_legend_handles_labels()[::-1], strict=True))
    axes[1].legend(handles.values(), handles, fontsize=6)
    axes[1].set(xscale="log", xlabel="play at most [mrad], 95 %")
    for panel, labels in zip(axes, (names, []), strict=True):
        panel.set_yticks(place, labels, fontsize=7)
        panel.invert_yaxis()
    figure.savefig(PICTURES / "mukca.png", dpi=120)


def main() -> None:
    parser = command(__doc__ or "", "the servos alone; nothing is written")
    parser.add_argument("--data", type=Path, metavar="DIR", help="folder with the clones")
    only = "tiago, servos or a robot of MUKCa (repeatable); nothing is written"
    parser.add_argument("--only", action="append", default=[], metavar="NAME", help=only)
    args = parser.parse_args()
    if args.data is None:
        if not args.quick:
            parser.error("--data is needed: the folder with the clones")
        print("skipped: no --data DIR with clones of the measurements; see --help")
        return
    if args.quick:
        args.only = ["servos"]
    known = {"tiago", "servos", *(robot.name for robot in ROBOTS)}
    if wrong := set(args.only) - known:
        raise SystemExit(
            f"no data set {', '.join(sorted(wrong))}; there are {', '.join(sorted(known))}"
        )
    only, report = set(args.only), Report()
    wanted = {"servos"} if only == {"servos"} else set(SOURCES)
    sources = {key: source(key, args.data) for key in SOURCES if key in wanted}
    for one in sources.values():
        report.say(f"{one.address} at {one.commit}, {one.licence}")
    fits = tiago(sources["tiago"], report) if not only or "tiago" in only else {}
    found: dict[str, Calibration] = {}
    if not only or only - {"tiago", "servos"}:
        with temporary() as folder:
            found = mukca(sources["mukca"], report, Path(folder), only)
    if not only or "servos" in only:
        servos(sources["servos"], report)
    report.say(
        "",
        f"measured {report.sets} data sets, explained {report.explained} of {report.total} within "
        "their stated interval",
    )
    if not only:
        draw(fits, found)
        (PICTURES / "measured.txt").write_text("\n".join(report.lines) + "\n", encoding="utf-8")
