"""Make the small data files beside this one from what others published, and from Siconos.

    python make.py recurdyn FOLDER   sdf-nsc: assets/rev_joint_clearance
    python make.py siconos FOLDER    siconos-tutorials: its SliderCrank
    python make.py engines           MuJoCo and Exudyn, run here

README.md says where the folders are from, and under which licence. Nothing else is read from them.
"""

from __future__ import annotations

import csv
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parents[2]))
from truth.validation.data import origin  # noqa: E402

DENSE_UNTIL, EVERY = 0.06, 10
"""All samples of RecurDyn up to this time [s], then each tenth."""
BODIES = {"journal": "body3", "arm": "body2", "ideal": "body2_ideal"}
STEPS = (1e-5, 5e-6, 2.5e-6, 1.25e-6, 6.25e-7)
"""Of Siconos [s]."""
PARTS = ("turns", "speed", "y", "energy")
RECORD, DURATION = 1e-3, 0.2


def write(path: Path, notes: Sequence[str], names: Sequence[str], rows: np.ndarray) -> None:
    """A CSV with its source on top."""
    with path.open("w", encoding="utf-8", newline="") as file:
        file.writelines(f"# {note}\n" for note in notes)
        file.write(",".join(names) + "\n")
        file.writelines(",".join(f"{x:.9g}" for x in row) + "\n" for row in rows)
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


if __name__ == "__main__":
    if sys.argv[1] == "engines":
        engines()
    else:
        {"recurdyn": recurdyn, "siconos": siconos}[sys.argv[1]](Path(sys.argv[2]))
