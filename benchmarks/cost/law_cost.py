"""What each contact law costs: the whole time step of the SCARA, relative to the paper's law.

The SCARA with 0.2 mm clearance in joint B goes through its cycle with the paper's laws
(Lankarani-Nikravesh, eq. 21). After every 200 steps each other law is put into the state just
reached, approach speeds included, and takes the next steps of the real loop with it (drive,
contact, velocity solve, Pinocchio, integration, a record every 10 steps). So all laws meet the same
contacts on the same machine. The table gives medians of the ratios to the paper's laws in the same
state, over all states and over those with at least one contact. Times are CPU times. A film is
computed whether the journal touches or not, in addition to the paper's laws.

"own" are users' functions in this file, copies of the paper's laws.
"""

import dataclasses
import math
import sys
import time

import numpy as np
from common import COLOURS, JOINT, Benchmark, Case, new_figure
from cost.step_cost import CHUNK, touching

import jointplay as jp
from jointplay.base.progress import ProgressBar
from jointplay.physics.contact import FILM_LAWS, FRICTION_LAWS, NORMAL_LAWS
from jointplay.physics.contact.line_contact import LineContactLaw

PAPER = "lankarani-nikravesh, ambrosio"
VISCOSITY = 0.05
"""Of the films' oil [Pa s]; the cost of a film does not depend on it, nor on the slenderness."""
EXPLICIT, IMPLICIT = 1.3, 2.0
"""Largest ratios: of laws that are formulas, of those that solve for the force."""


def own_force(delta, ddelta, ddelta0, p):
    return p[0] * delta * math.sqrt(delta) * (1.0 + p[1] * ddelta / ddelta0)


def own_friction(speed, p):
    if speed <= p[1]:
        return 0.0
    if speed >= p[2]:
        return p[0]
    return p[0] * (speed - p[1]) / (p[2] - p[1])


def bearings():
    """The paper's joint, and one for each other law: by name, with the limit of its ratio."""
    paper = Case().bearing()
    made = {PAPER: (paper, EXPLICIT), "lankarani-nikravesh again": (paper, EXPLICIT)}
    needed = {"kelvin-voigt": {"damping": 3e3}, "anagnostopoulos": {"mass": 2.0}}
    for name, law in NORMAL_LAWS.items():
        if name != paper.normal.name:
            limit = IMPLICIT if issubclass(law, LineContactLaw) else EXPLICIT
            made[name] = (dataclasses.replace(paper, normal=law(**needed.get(name, {}))), limit)
    own = jp.contact.CustomNormalForce(own_force, paper.normal.parameters(paper.radial_contact))
    made["own normal force"] = dataclasses.replace(paper, normal=own), EXPLICIT
    for name, law in FRICTION_LAWS.items():
        if name != paper.friction.name:
            made[f"{name} friction"] = dataclasses.replace(paper, friction=law()), EXPLICIT
    for name, law in FILM_LAWS.items():
        made[f"{name} film"] = dataclasses.replace(paper, lubricant=law(VISCOSITY)), EXPLICIT
    own = jp.contact.CustomFriction(own_friction, paper.friction.parameters())
    made["own friction"] = dataclasses.replace(paper, friction=own), EXPLICIT
    return made


def prepared(bearing, **options):
    robot = jp.Mechanism(jp.shipped("scara.urdf"), {JOINT: bearing}, gravity=(0, 0, 0))
    motion = jp.Motion.from_csv(jp.shipped("scara_motion.csv"))
    run = jp.Run(jp.Simulation(robot, motion, **options))
    run.begin()
    return run


def measure(made, duration):
    """Seconds per step, shape (states, laws), and the number of contacts in each state."""
    main = prepared(made[PAPER][0], duration=duration)
    pieces = main.total_steps // CHUNK
    probes = [prepared(bearing, duration=duration) for bearing, _ in made.values()]
    costs, contacts = np.empty((pieces, len(probes))), np.empty(pieces, int)
    for piece in ProgressBar(range(pieces), unit="state"):
        w = main.workspace
        contacts[piece] = touching(w)
        remembered = {name: w.contacts[name].copy() for name in ("ddelta0", "steps")}
        state = w.q.copy(), w.v.copy()
        # Each state begins with another law, so that none always pays for a cold cache.
        for k in np.roll(np.arange(len(probes)), -piece):
            at = probes[k].workspace
            probes[k].synchronize()
            at.q[:], at.v[:] = state
            for name, values in remembered.items():
                at.contacts[name] = values
            probes[k].begin()
            started = time.thread_time()
            good = probes[k].advance(CHUNK)
            costs[piece, k] = (time.thread_time() - started) / CHUNK
            if not good:
                raise SystemExit(f"{list(made)[k]}: {probes[k].message(at.status)}")
        if not main.advance(CHUNK):
            raise SystemExit(main.message(main.workspace.status))
    return costs, contacts


def draw(names, ratios, limits):
    figure, axes = new_figure(1, 1, 8.0, 7.0)
    panel = axes[0, 0]
    low, middle, high = np.percentile(ratios, (25, 50, 75), axis=0)
    colours = [COLOURS[int(limit > EXPLICIT)] for limit in limits]
    rows = np.arange(len(names))[::-1]
    panel.barh(rows, middle, color=colours, xerr=(middle - low, high - middle), capsize=2)
    panel.set_yticks(rows, names, fontsize=8)
    panel.axvline(1.0, color="black", ls=":", lw=1)
    panel.set_xlabel("step in contact, relative to the paper's laws: median, quartiles")
    panel.grid(False, axis="y")
    return figure


def main():
    above = f"{EXPLICIT} ({IMPLICIT} where the law is solved for its force)"
    words = f"exit with status 1 if a ratio is above {above}"
    benchmark = Benchmark("law_cost", __doc__, runs=0, check=(False, words))
    args = benchmark.parse()
    made = bearings()
    names, limits = list(made), [limit for _, limit in made.values()]
    costs, contacts = measure(made, 0.1 if args.quick else 3.0)
    ratios = costs / costs[:, :1]
    whole, contact = np.median(ratios, axis=0), np.median(ratios[contacts > 0], axis=0)
    rows = [
        [
            name,
            f"{1e6 * np.median(costs[contacts > 0, k]):.2f}",
            f"{whole[k]:.2f}",
            f"{contact[k]:.2f}",
            f"{limits[k]:g}",
        ]
        for k, name in enumerate(names)
    ]
    data = [
        {"law": name, "contacts": int(contacts[i]), "cost_us": 1e6 * costs[i, k]}
        for k, name in enumerate(names)
        for i in range(len(costs))
    ]
    header = ["law", "step in contact [µs]", "ratio, all states", "ratio, in contact", "limit"]
    benchmark.finish(header, rows, data, draw(names, ratios[contacts > 0], limits))
    print(f"{np.count_nonzero(contacts)} of {len(contacts)} states in contact")
    above = [name for name, ratio, top in zip(names, contact, limits, strict=True) if ratio > top]
    print(f"above the limit: {', '.join(above) or 'none'}")
    if args.check and above:
        sys.exit(1)
