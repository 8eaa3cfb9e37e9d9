"""What is whole, for the generators to break: a result, a checkpoint, a sweep's store, small files.

Made once, into a folder, by `build`; generators read them from there (`use`), so that no process
that is forked for a case need have run a sweep before.
"""

import shutil
import tempfile
from dataclasses import replace
from functools import cache
from math import cos, sin
from pathlib import Path
from unittest import mock

from sweep_scenario import ARM

from jointplay.scenario import Scenario
from jointplay.simulation import spool
from jointplay.simulation.working_files import working_paths

SCENARIO = (
    ARM.replace("friction", 'wear_rate = "1e-5 mm^3/(N*m)"\nfriction')
    + """
[integration]
duration = "0.002 s"
step = "10 us"

[output]
record_every = 2
"""
)
"""A run of 2 ms."""

LONG = SCENARIO.replace("0.002 s", "0.06 s").replace("record_every = 2", "record_every = 1")
"""One whose records go to disk with `small_memory`."""

SWEEP = """
[sweep]
samples = 4
sampling = "random"

[sweep.axes]
mu = { key = "joints.joint_b.friction.mu_d", distribution = "uniform", from = 0.0, to = 0.2 }
cr = { key = "joints.joint_b.radial_clearance", values = ["0.1 mm", "0.2 mm"] }
"""

MEASURED = "time [s],joint_a motor [rad],joint_b motor [rad],tool x [mm],tool y [mm]\n" + "".join(
    f"{0.01 * k:.2f},{0.1 * (k // 20 % 2):.1f},{0.01 * (k % 20):.3f},{500 + k % 20},{60 + k % 7}\n"
    for k in range(120)
)
"""A measurement of nothing in particular."""

POSES = "joint_a motor [rad],joint_b motor [rad],tool x [m],tool y [m],tool z [m]\n" + "".join(
    f"{a:.1f},{b:.1f},{0.4 * c + 0.3 * cos(a + b):.4f},{0.4 * s + 0.3 * sin(a + b):.4f},0\n"
    for a, c, s in ((a, cos(a), sin(a)) for a in (-0.9, -0.3, 0.3, 0.9))
    for b in (0.2, 0.8, 1.4)
)
"""Poses of an arm of two links."""

FEW_BYTES = 1 << 12
"""With so little memory for records, those of the short run go to disk."""


def small_memory() -> mock._patch:
    """Have runs put their records on disk as long ones do."""
    return mock.patch.multiple(spool, MOST_BYTES=FEW_BYTES, RECORD_BYTES=FEW_BYTES)


def build(folder: Path) -> None:
    """Make all of it."""
    from jointplay.study import sweep

    (folder / "s.toml").write_text(SCENARIO, encoding="utf-8")
    (folder / "sweep.toml").write_text(SCENARIO + SWEEP, encoding="utf-8")
    sweep(folder / "sweep.toml", folder / "store", jobs=1, progress=False)
    (folder / "long.toml").write_text(LONG, encoding="utf-8")
    (folder / "measured.csv").write_text(MEASURED, encoding="utf-8")
    (folder / "poses.csv").write_text(POSES, encoding="utf-8")
    short = Scenario.load(folder / "s.toml")
    replace(short.simulation(short.cases[0]), seed=1).run().save(folder / "result.nc")
    interrupt(short, folder / "s.nc", 120)
    with small_memory():
        interrupt(Scenario.load(folder / "long.toml"), folder / "long.nc", 4321)


def interrupt(scenario: Scenario, path: Path, steps: int) -> None:
    """Leave of the scenario's run what one leaves that is told to stop after so many steps."""
    records, kept = working_paths(path)
    run = scenario.ready_run(scenario.cases[0], False, records)
    next(moment for moment in run.steps() if moment.step >= steps)
    run.checkpoint(kept)


_folder: list[Path] = []


def use(folder: Path) -> None:
    """Take them from a folder in which they have been made."""
    _folder[:] = [folder]
    content.cache_clear()


def place() -> Path:
    """The folder with all of it; made now if need be."""
    if not _folder:
        made = Path(tempfile.mkdtemp(prefix="fuzz-"))
        build(made)
        import atexit

        atexit.register(shutil.rmtree, made, ignore_errors=True)
        use(made)
    return _folder[0]


@cache
def content(name: str) -> bytes:
    """Bytes of one of the files."""
    return (place() / name).read_bytes()
