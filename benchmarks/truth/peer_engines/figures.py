"""Figures of the page."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from truth.peer_engines.common import Problem
from truth.peer_engines.trace import Trace, offset

COLOURS = {
    **{"jointplay": "#0072B2", "jointplay, rk4": "#56B4E9"},
    **{"jointplay, error-controlled": "#003A5C", "jointplay, macro steps of 0.1 ms": "#004C8C"},
    **{"MuJoCo, same law": "#D55E00", "MuJoCo, own limit": "#E69F00"},
    **{"MuJoCo, own limit, implicitfast": "#F0C060", "MuJoCo, own limit, discrete": "#8C6100"},
    **{"Exudyn, own contact": "#009E73", "Exudyn, same law": "#009E73", "Siconos": "#CC79A7"},
    **{"Pinocchio, ADMM": "#000000", "Pinocchio, PGS": "#888888"},
    **{"Drake, constant steps": "#C9A0DC", "Drake, CENIC": "#7B2CBF"},
}
"""Okabe and Ito's, told apart by colour-blind readers; kin in shades of one."""
DPI = 95


def draw_orbits(traces: dict[str, Trace], task: Problem, path: Path) -> None:
    figure = Figure(figsize=(1.9 * len(traces), 2.2), layout="constrained")
    around = np.linspace(0.0, 2.0 * np.pi, 200)
    axes = figure.subplots(1, len(traces), sharex=True, sharey=True, squeeze=False)[0]
    for axis, (name, trace) in zip(axes, traces.items(), strict=True):
        turn = trace.time < 0.012
        x, y = 1e3 * offset(task, trace.q[turn])[:, :2].T
        axis.plot(x, y, lw=0.4, color=COLOURS[name])
        radius = 1e3 * task.clearance
        axis.plot(radius * np.cos(around), radius * np.sin(around), color="0.3", lw=0.7)
        axis.set(title=name.replace(", ", ",\n"), xlabel="x [mm]", aspect="equal")
        axis.title.set_fontsize(8)
    axes[0].set_ylabel("y [mm]")
    figure.savefig(path, dpi=DPI)


def draw_work(found: dict, path: Path) -> None:
    figure = Figure(figsize=(7.8, 4.2), layout="constrained")
    axis = figure.subplots()
    for marker, (name, work) in zip("osvD^P<>XhdHp*", found.items(), strict=False):
        axis.loglog(
            work.costs, work.errors, marker=marker, ms=4, lw=1, color=COLOURS[name], label=name
        )
    for level in (1e-3, 1e-2, 1e-1):
        axis.axhline(level, color="0.7", lw=0.7, zorder=0)
    axis.set(xlabel="CPU time per simulated second [s/s]", ylabel="error of the journal / $C_r$")
    figure.legend(loc="outside right upper", fontsize=7)
    figure.savefig(path, dpi=DPI)


def draw_growth(apart: dict[str, tuple[np.ndarray, np.ndarray]], path: Path) -> None:
    figure = Figure(figsize=(6.0, 2.6), layout="constrained")
    axis = figure.subplots()
    for name, (times, values) in apart.items():
        engine = name.split(" against")[0]
        axis.semilogy(times, np.maximum(values, 1e-17), lw=0.8, color=COLOURS[engine], label=name)
    axis.set(xlabel="time [s]", ylabel="difference of the\njournal's centre / $C_r$")
    axis.legend(fontsize=7)
    figure.savefig(path, dpi=DPI)
