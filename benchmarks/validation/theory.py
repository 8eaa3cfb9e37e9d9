"""Theory: single impacts, friction, tops, wedges, pendulums."""

from __future__ import annotations

import numpy as np
from common import COLOURS, new_figure

import jointplay as jp
from validation import Outcome, case
from validation.mechanisms import FREE, body, joint, urdf

SOUND_DEPTH = (5.0 / 4.0) ** 0.4
"""Depth of a Hertz impact is this times (m v^2/k)^(2/5)."""
SOUND_TIME = 2.9432751
"""Its duration is this times depth over speed (W. Goldsmith, Impact, 1960)."""


@case(
    title="Hertz impact",
    compared="Depth and duration of elastic impacts of a journal on its bore against Hertz's "
    "closed form (W. Goldsmith, Impact, Edward Arnold, 1960): depth (5 m v^2/4 k)^(2/5), duration "
    "2.9433 depth/v.",
    measures="largest relative error of depth and duration",
    wrong="the exponent 3/2 of the force is taken for 1.45 in the depth",
)
def hertz_impact(quick: bool = False, wrong: bool = False) -> Outcome:
    mass, stiffness = 2.0, 1e10
    bearing = jp.ClearanceJoint.planar(
        radial_clearance=2e-4, stiffness=stiffness, normal=jp.Hertz(), restitution=1.0,
        friction=jp.Ambrosio(0.0),
    )  # fmt: skip
    robot = jp.Mechanism(
        urdf(body("arm", mass), joint("pin", "base", "arm")), {"pin": bearing}, gravity=(0, 0, 0)
    )
    speeds = np.geomspace(0.01, 1.0, 3 if quick else 9)
    rows, errors = [["speed [m/s]", "depth [um]", "theory", "duration [us]", "theory"]], []
    for speed in speeds:
        power = 0.4 if not wrong else 1.0 / 2.45
        depth = (1.25 * mass * speed**2 / stiffness) ** power
        duration = SOUND_TIME * depth / speed
        run = jp.Simulation(
            robot, duration=3e-4 / speed + duration, step=duration / 400, integrator="rk4",
            record_every=1, **FREE,
        ).prepare()  # fmt: skip
        run.workspace.v[0] = speed
        result = run.execute()
        gap = result["gap"].values[:, 0, 0]
        # Where the gap crosses zero, between the records.
        inside = np.flatnonzero(gap < 0.0)
        first, last = inside[0], inside[-1]
        begin, end = (
            np.interp(0.0, gap[[inner, outer]], result.time[[inner, outer]])
            for inner, outer in ((first, first - 1), (last, last + 1))
        )
        found = -result["gap_min"].values.min(), end - begin
        errors += [abs(found[0] / depth - 1.0), abs(found[1] / duration - 1.0)]
        figures = found[0], depth, found[1], duration
        rows.append([f"{speed:.3g}", *(f"{1e6 * x:.4g}" for x in figures)])
    figure, axes = new_figure(1, 1, 6.0, 3.4)
    values = np.array([[float(x) for x in row] for row in rows[1:]])
    for k, name in enumerate(("depth [um]", "duration [us]")):
        colour, theory = COLOURS[k], values[:, 2 + 2 * k]
        axes[0, 0].loglog(values[:, 0], theory, color=colour, lw=1, label=f"{name}, Hertz")
        axes[0, 0].loglog(values[:, 0], values[:, 1 + 2 * k], "o", color=colour, ms=4)
    axes[0, 0].set(xlabel="approach speed [m/s]", ylabel="depth [um], duration [us]")
    axes[0, 0].legend()
    return Outcome(max(errors), 2e-4, rows, figure)
