"""Make the small data files beside this one from what others published, and from Siconos.

    python make.py recurdyn FOLDER   sdf-nsc: assets/rev_joint_clearance
    python make.py siconos FOLDER    siconos-tutorials: its SliderCrank
    python make.py engines           MuJoCo and Exudyn, run here
    python make.py backlash FOLDER   clones of the servos' and the damper's repositories

Backlash: telemetry of a stand in which elastic bands pull the lever of a standing servo one way and
the other (B. Kotov, Robonine; logs under CC BY 4.0, as the table of files in the repository's paper
says); a banded rotary friction device in a testing machine, sinusoidal displacement (D. Coble, P.
Huggins, L. Cao, J. Ricles, A. Downey, ARTS-Lab; CC BY-SA 4.0, and so are the extracts). For
`identify.py`; git directories without work tree will do.

README.md says where the folders are from, and under which licence. Nothing else is read from them.
"""

from __future__ import annotations

import csv
import io
import json
import math
import sys
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parents[2]))
from truth.measured import Repository, source  # noqa: E402
from truth.validation.data import origin  # noqa: E402

DENSE_UNTIL, EVERY = 0.06, 10
"""All samples of RecurDyn up to this time [s], then each tenth."""
BODIES = {"journal": "body3", "arm": "body2", "ideal": "body2_ideal"}
STEPS = (1e-5, 5e-6, 2.5e-6, 1.25e-6, 6.25e-7)
"""Of Siconos [s]."""
PARTS = ("turns", "speed", "y", "energy")
RECORD, DURATION = 1e-3, 0.2

TOLD = "216b5899dc9c1b7264584d7f1388cb4892c2b5f8"
"""The last commit of the servos' repository that has its paper, which names the licence of logs."""
COUNT_RAD = 2.0 * math.pi / 4096
"""Step of the servos' 12-bit encoder."""
BAND_N = 0.15 * 9.80665
"""With which a stretched band pulls the lever of a single servo (their paper: about 0.15 kgf)."""
HOME = 2047
INCH, KIP = 25.4e-3, 4448.2216
KEPT = 8
"""Records of the damper of which one is kept."""

SERVOS = {
    # file: servo under test, pullers towards + and -, and their relaxed targets
    "single": ("backlash_sts3215.csv", "STS3215", 5, (4, 2347), (3, 1747)),
    "single_3250": ("backlash_sts3250.csv", "STS3250", 4, (2, 1747), (1, 2347)),
}
DAMPER = (
    "ARTS-Laboratory", "Dataset-Friction-Damper-with-Backlash",
    "0e09aa9d950760277e31c08cd93fd01f39a5af09", "CC-BY-SA-4.0",
)  # fmt: skip
DAMPERS = ("20", "35", "80")
"""Tension of the band [lb]; dataset 1, 0.5 Hz."""


def write(path: Path, notes: Sequence[str], names: Sequence[str], rows: np.ndarray) -> None:
    """A CSV with its source on top."""
    write_lines(path, notes, [",".join(names), *(",".join(f"{x:.9g}" for x in r) for r in rows)])


def write_lines(path: Path, notes: Sequence[str], lines: Sequence[str]) -> None:
    path.write_text("\n".join([*(f"# {note}" for note in notes), *lines, ""]), encoding="utf-8")
    print(f"written: {path} ({path.stat().st_size} bytes)")


def exported(path: Path) -> dict[str, np.ndarray]:
    """A RecurDyn export: 'Pos_TY' and the like by name, and 'time'."""
    head, *rows = csv.reader(path.open(encoding="utf-8-sig"))
    table = np.array(rows, float)
    found = {"time": table[:, 0]}
    for k, name in enumerate(head):
        if name.startswith("Y:"):
            found[name[2:].split("-")[0]] = table[:, k]
    return found


def triangles(path: Path, radius: float) -> np.ndarray:
    """Facets of a mesh on the cylinder of `radius` about x, and below its axis: (n, 3, 3)."""
    lines = [line.split() for line in path.read_text(encoding="utf-8").splitlines()]
    points = np.array([line[1:4] for line in lines if line[:1] == ["v"]], float)
    faces = [[int(word.split("/")[0]) - 1 for word in x[1:4]] for x in lines if x[:1] == ["f"]]
    found = points[np.array(faces)]
    away = np.abs(np.hypot(found[..., 1], found[..., 2]) - radius)
    return found[(away < 0.006 * radius).all(axis=1) & (found[..., 1] < 0.0).all(axis=1)]


def heights(facets: np.ndarray, x: np.ndarray, z: np.ndarray) -> np.ndarray:
    """y of a faceted surface over a grid."""
    found = np.full(x.shape, np.nan)
    for a, b, c in facets:
        edges = np.array([[b[0] - a[0], c[0] - a[0]], [b[2] - a[2], c[2] - a[2]]])
        if abs(np.linalg.det(edges)) < 1e-12:
            continue
        u, v = np.tensordot(np.linalg.inv(edges), np.array([x - a[0], z - a[2]]), 1)
        inside = (u >= -1e-9) & (v >= -1e-9) & (u + v <= 1 + 1e-9)
        found[inside] = (a[1] + u * (b[1] - a[1]) + v * (c[1] - a[1]))[inside]
    return found


def drop(folder: Path) -> float:
    """How far the journal's mesh falls until it meets the bore's [m]."""
    x, z = np.meshgrid(np.linspace(-0.999, 0.999, 200), np.linspace(-0.12, 0.12, 481))
    bore = triangles(folder / "models" / "body1_subtract1_centered.obj", 0.46)
    journal = triangles(folder / "models" / "body3_cylinder1_centered.obj", 0.45)
    return float(np.nanmin(heights(journal, x, z) - heights(bore, x, z)))


def recurdyn(folder: Path) -> None:
    data = {name: exported(folder / "data" / f"{file}.csv") for name, file in BODIES.items()}
    time = data["journal"]["time"]
    kept = np.union1d(np.flatnonzero(time <= DENSE_UNTIL), np.arange(0, len(time), EVERY))
    names, columns = ["time"], [time]
    for body, found in data.items():
        assert np.array_equal(found["time"], time)
        for part in ("Y", "Z"):
            names += [f"{body}_{part.lower()}"]
            columns.append(found[f"Pos_T{part}"])
    for body in ("journal", "arm"):
        for part in ("Y", "Z"):
            names += [f"{body}_a{part.lower()}"]
            columns.append(data[body][f"Acc_T{part}"])
    names.append("arm_x")
    columns.append(data["arm"]["Pos_TX"] - data["journal"]["Pos_TX"])
    notes = (
        "RecurDyn 2023 on a revolute joint with clearance, and on the ideal joint [s, m, m/s^2].",
        *origin(
            "github.com/W-Moorer/sdf-nsc",
            "b01316190241bdbd6528cf58500836099ed20aba",
            "assets/rev_joint_clearance",
            "(c) 2026, W-Moorer",
            "BSD-3-Clause",
            " (recurdyn_revolute.LICENSE)",
        ),
        "Changed: samples and columns left out by make.py; y is up, x the bearing's axis.",
        f"mesh_gap = {drop(folder):.6g}",
    )
    write(HERE / "recurdyn_revolute.csv", notes, names, np.column_stack(columns)[kept])
    (HERE / "recurdyn_revolute.LICENSE").write_bytes((folder.parents[1] / "LICENSE").read_bytes())


def siconos(folder: Path) -> None:
    from truth.peer_engines import siconos_engine, siconos_guide

    runs = [siconos_guide.run(step, DURATION, RECORD) for step in STEPS]
    powers = np.vander(STEPS, 2, increasing=True)
    every = np.stack(runs).reshape(len(STEPS), -1)
    limit = np.linalg.lstsq(powers, every, rcond=None)[0][0].reshape(runs[0].shape)
    names, columns = ["time"], [runs[0][:, 0]]
    for name, table in (
        ("limit", limit),
        *((f"h{step * 1e6:g}us", run) for step, run in zip(STEPS, runs, strict=True)),
    ):
        names += [f"{name}_{part}" for part in PARTS]
        columns += list(table[:, 1:].T)
    for scheme in ("DirectProjection", "CombinedProjection"):
        path = folder / f"SliderCrankMoreauJean{scheme}OSI.ref"
        states = np.loadtxt(path, skiprows=1)[:: round(RECORD / 1e-4)]
        states[:, 1] *= 2 * np.pi
        found = np.array([siconos_guide.record(x[0], x[1:4], x[4:7]) for x in states])
        assert np.allclose(found[:, 0], columns[0])
        names += [f"{scheme.removesuffix('Projection').lower()}_{part}" for part in PARTS]
        columns += list(found[:, 1:].T)
    notes = (
        f"Siconos {siconos_engine.VERSION}, Moreau-Jean, at five steps, run by",
        "truth/peer_engines/siconos_guide.py; `limit` is the straight line through them at",
        "h = 0. `direct` and `combined`: the reference results of Siconos's own example at 0.1 ms.",
        *origin(
            "github.com/siconos/siconos-tutorials",
            "b6c9bfd1940a69dae512a3e39cf5f1a951e3eebe",
            "examples/mechanics/SliderCrank (of `direct` and `combined`)",
            "2021 INRIA",
            "Apache-2.0",
            " (LICENSES/Apache-2.0.txt)",
        ),
        "Changed: of each tenth row what follows.",
        "time [s], crank's turns, its speed [rad/s], slider's y over the clearance, energy [J].",
    )
    write(HERE / "siconos_guide.csv", notes, names, np.column_stack(columns))


def engines() -> None:
    from truth.peer_engines import common, exudyn_engine, mujoco_engine
    from truth.peer_engines.trace import offset

    duration, step, every = 1e-3, 2e-8, 500
    elastic = common.slider_crank(mu=0.0, restitution=1.0)
    damped = common.slider_crank()
    runs = {
        "exudyn": (elastic, exudyn_engine.run_own(elastic, step, duration, every)),
        "mujoco": (damped, mujoco_engine.run_law(damped, step, duration, every)),
    }
    times = np.arange(0.0, 0.995 * duration, step * every)
    names, columns = ["time"], [times]
    for name, (task, trace) in runs.items():
        names += [f"{name}_x", f"{name}_y"]
        columns += list(offset(task, trace.at(times))[:, :2].T / task.clearance)
    notes = (
        f"Exudyn {exudyn_engine.VERSION} (own contact, elastic, no friction, RK44) and",
        f"MuJoCo {mujoco_engine.VERSION} (law of jointplay applied, damped, friction 0.01, Euler)",
        "on the shipped slider-crank with 0.2 mm of clearance, run by truth/peer_engines at",
        "steps of 20 ns: journal's centre in the bearing over the clearance; time [s].",
        "SPDX-License-Identifier: MIT",
    )
    write(HERE / "engines_slider_crank.csv", notes, names, np.column_stack(columns))


def servo(repository: Repository, name: str) -> None:
    """One log: command and encoder of the servo, pull of the bands."""
    target, kind, tested, plus, minus = SERVOS[name]
    path = f"logs/motor_telemetry_{name}.csv"
    rows = list(csv.DictReader(io.StringIO(repository.text(path))))
    about = [
        f"Feetech {kind} in a stand that pulls its lever (0.1 m) both ways; encoder 4096 counts.",
        "Changed: counts to rad about 2047; force: 0.15 kgf (their calibration) by the way of",
        "the puller that stretches; the servo's own drives, and rest before the first pull after",
        "them, left out.",
    ]
    origins = (
        repository.address, repository.commit, path, "2026 B. Kotov, Robonine", "CC-BY-4.0",
        f" (said of logs/ by paper/main_teststand.tex at {TOLD})",
    )  # fmt: skip
    lines = ["time [s],servo motor [rad],servo link [rad],force y [N]"]
    start, pulled = None, False
    for row in rows:
        needed = [row[f"{what} ({tested})"] for what in ("target pos", "pos")]
        pulls = [row[f"pos ({number})"] for number, _ in (plus, minus)]
        if not all((*needed, *pulls)):
            continue
        at = datetime.fromisoformat(row["timestamp"].replace("Z", "+00:00")).timestamp()
        start = at if start is None else start
        force = 0.0
        for sign, text, (_, relaxed) in zip((1, -1), pulls, (plus, minus), strict=True):
            part = abs(float(text) - relaxed) / 400.0
            force += sign * BAND_N * (part if part > 0.05 else 0.0)
        # Between its drives home and the first pull nobody knows where in its play the servo is.
        pulled = float(needed[0]) == HOME and (pulled or force != 0.0)
        if pulled:
            command, place = ((float(text) - HOME) * COUNT_RAD for text in needed)
            lines.append(f"{at - start:.3f},{command:.6f},{place:.6f},{force:.4f}")
    write_lines(HERE / target, [about[0], *origin(*origins), *about[1:]], lines)


def damper(repository: Repository, tension: str) -> None:
    """One test: displacement and force, as angle and torque at a radius of one metre."""
    path = f"data/dataset-1/characterization datasets/0.5Hz{tension}lbtension.json"
    table = np.array(json.loads(repository.text(path))["data"])[::KEPT]
    about = [
        f"Banded rotary friction device, band tension {tension} lb, displaced at 0.5 Hz.",
        f"Changed: every {KEPT}th record; inch and kip to SI; as an angle and a torque at a",
        "radius of 1 m.",
    ]
    origins = (
        repository.address, repository.commit, path,
        "2022 D. Coble, P. Huggins, L. Cao, J. Ricles, A. Downey, ARTS-Lab", "CC-BY-SA-4.0",
        " (this extract stays under it)",
    )  # fmt: skip
    lines = ["time [s],drum motor [rad],drum torque [N*m]"]
    lines += [f"{t:.4f},{INCH * x:.7f},{KIP * force:.1f}" for t, x, force in table[:, :3]]
    target = HERE / f"backlash_damper_{tension}lb.csv"
    write_lines(target, [about[0], *origin(*origins), *about[1:]], lines)


def backlash(folder: Path) -> None:
    for name in SERVOS:
        servo(source("servos", folder), name)
    for tension in DAMPERS:
        damper(Repository(*DAMPER, folder), tension)


if __name__ == "__main__":
    made = {"recurdyn": recurdyn, "siconos": siconos, "backlash": backlash}
    if sys.argv[1] == "engines":
        engines()
    else:
        made[sys.argv[1]](Path(sys.argv[2]))
