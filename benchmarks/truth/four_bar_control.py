"""The controlled four-bar of Akhadkar, Acary and Brogliato, compared with its authors' own result.

    python benchmarks four_bar_control [--out docs/images/four_bar_control] [--quick]

N. Akhadkar, V. Acary, B. Brogliato: Analysis of collocated feedback controllers for four-bar planar
mechanisms with joint clearances, Multibody System Dynamics 38 (2016) 101-136 (title and place from
memory; the paper was not seen). The model is that of the example of Siconos, whose authors they
are: github siconos/siconos-tutorials, Apache-2.0, examples/mechanics/FourBarLinkageWith3clearance,
commit 1d9dc81; REFERENCE are numbers of its result file, FourBarClearance.ref.

Three of the four joints have 5 mm of clearance; a passivity-based controller turns the crank by
theta_d = 6 sin(0.75 pi t), from 1.57 rad aside, and knows nothing of the clearance:

    u = M(theta) (theta_d'' - lambda e') + C(theta, theta') (theta_d' - lambda e) + g(theta)
        - K_p (e' + lambda e),    e = theta - theta_d.

The example's code has theta' where this has theta_d', and the rocker's inertia about its centre in
one of the four places of C where that about its pin belongs; both laws are run. Siconos has
rigid bodies that do not rebound and Coulomb's friction; here they are steel, with a restitution of
0.1, because a continuous law cannot have none.
Writes four_bar_control.txt and four_bar_control.png.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from common import command, folder_of
from robots import body, joint, urdf

import jointplay as jp
from jointplay.base.tables import Table
from jointplay.model.urdf import Description
from jointplay.physics.contact import Ambrosio, Flores

LENGTHS = {"ground": 3.0, "crank": 1.0, "coupler": 4.0, "rocker": 2.5}
"""[m]; each link is a rod of 1 kg."""
JOURNAL_M, CLEARANCE_M = 0.055, 5e-3
START_RAD = 1.570823772407980
K_P, LAMBDA = 200.0, 10.0
RESTITUTION = 0.1
DOCS = Path("docs/images/four_bar_control")
QUICK_S = 0.05
REFERENCE = (
    # t [s], theta [rad], theta' [rad/s] of the crank
    (0.05, 1.667922928591141, 4.395065412241380),
    (0.10, 1.985176417328212, 7.926083177617856),
    (0.15, 2.431354739952732, 9.923176377300230),
    (0.20, 2.944230400525073, 10.49045338963956),
    (0.25, 3.469429757921141, 10.43246250026954),
    (0.30, 3.979969252292267, 9.922275739490578),
    (0.40, 4.882149682028348, 7.953747422392869),
    (0.50, 5.545612442795652, 5.285048107783350),
    (0.60, 5.928500734317016, 2.190553571589951),
    (0.70, 5.982468356535284, -1.115200220980927),
    (0.80, 5.707530859754471, -4.377498489758237),
)


def robot() -> Description:
    parts = [
        body(name, 1.0, f"{length / 2} 0 0", (1e-4, length**2 / 12, length**2 / 12))
        for name, length in LENGTHS.items()
        if name != "ground"
    ]
    for name, parent, child, x in (
        ("crank_pin", "ground", "crank", 0.0),
        ("coupler_pin", "crank", "coupler", LENGTHS["crank"]),
        ("rocker_pin", "ground", "rocker", LENGTHS["ground"]),
    ):
        parts.append(joint(name, parent, child, "continuous", at=f"{x} 0 0"))
    return urdf(*parts, base="ground")


def controller(time, q, v, p, out):
    """The torque on the crank; p: K_p, lambda, 1.0 for the law as it should be."""
    l0, l1, l2, l3, gravity = 3.0, 1.0, 4.0, 2.5, 9.81
    rate = 0.75 * math.pi
    theta, speed = q[0], v[0]
    e = theta - 6.0 * math.sin(rate * time)
    de = speed - 6.0 * rate * math.cos(rate * time)
    # Directions of the rocker and of the coupler, whose loop closes with the rocker above.
    x, y = l1 * math.cos(theta) - l0, l1 * math.sin(theta)
    size = math.sqrt(x * x + y * y)
    phi = math.atan2(y, x) - math.acos((size * size + l3 * l3 - l2 * l2) / (2.0 * size * l3))
    alpha = math.atan2(l3 * math.sin(phi) - y, l3 * math.cos(phi) - x)
    # Their speeds by the crank's, and how these change with the crank's angle.
    sine, cosine = math.sin(alpha - phi), math.cos(alpha - phi)
    s1 = l1 * math.sin(phi - theta) / (l2 * sine)
    s2 = l1 * math.sin(alpha - theta) / (l3 * sine)
    ds1 = l1 * math.cos(phi - theta) * (s2 - 1.0) / (l2 * sine) - s1 * cosine * (s1 - s2) / sine
    ds2 = l1 * math.cos(alpha - theta) * (s1 - 1.0) / (l3 * sine) - s2 * cosine * (s1 - s2) / sine
    c1, dc1 = math.cos(theta - alpha), -math.sin(theta - alpha) * (1.0 - s1)
    first, second, third = l1 * l1 / 3.0 + l1 * l1, l2 * l2 / 3.0, l3 * l3 / 3.0
    inertia = first + second * s1 * s1 + third * s2 * s2 + l1 * l2 * c1 * s1
    in_change = third if p[2] > 0.5 else l3 * l3 / 6.0
    half = second * s1 * ds1 + in_change * s2 * ds2 + 0.5 * l1 * l2 * (c1 * ds1 + s1 * dc1)
    weight = gravity * (
        1.5 * l1 * math.cos(theta) + 0.5 * l2 * math.cos(alpha) * s1 + 0.5 * l3 * math.cos(phi) * s2
    )
    aim = 6.0 * rate * math.cos(rate * time) if p[2] > 0.5 else speed
    wanted = -6.0 * rate * rate * math.sin(rate * time) - p[1] * de
    out[0] = inertia * wanted + half * speed * (aim - p[1] * e) + weight - p[0] * (de + p[1] * e)


def machine(corrected: bool, duration: float, clearance: float = CLEARANCE_M) -> jp.Simulation:
    """The four-bar, all journals centred, at rest."""
    bearing = jp.RevoluteClearance.planar(
        bearing_radius=JOURNAL_M + clearance,
        radial_clearance=clearance,
        bearing_length=0.02,
        restitution=RESTITUTION,
        normal=Flores(),
        friction=Ambrosio(0.1, 1e-3, 1e-2),
    )
    loop = jp.Loop("coupler", "rocker", (LENGTHS["coupler"], 0, 0), journal_xyz=(2.5, 0, 0))
    mechanism = jp.Mechanism(
        robot(),
        dict.fromkeys(("coupler_pin", "rocker_pin", "rocker_end"), bearing),
        loops={"rocker_end": loop},
        gravity=(0.0, -9.81, 0.0),
    )
    law = jp.loads.Controller(["crank_pin"], controller, (K_P, LAMBDA, 1.0 if corrected else 0.0))
    return jp.Simulation(
        mechanism,
        drive="free",
        loads={"controller": law},
        duration=duration,
        step=5e-6,
        start="centred",
        state={
            "crank_pin": (START_RAD, 0.0),
            "coupler_pin.yaw": (0.353284202062446 - START_RAD, 0.0),
            "rocker_pin.yaw": (1.264872058968431, 0.0),
        },
        record_every=20,
    )


def crank(result: jp.Result) -> tuple[np.ndarray, np.ndarray]:
    """Angle [rad] and speed [rad/s] of the crank at the times of `REFERENCE`."""
    at = result.simulation.mechanism.coordinate("crank_pin")
    times = [row[0] for row in REFERENCE]
    q, v = (np.interp(times, result.time, result[name].values[:, at]) for name in "qv")
    return q, v


def draw(results: dict[str, jp.Result], path: Path) -> None:
    """Tracking errors, and the journal's way in the bore at the rocker's end."""
    import matplotlib.pyplot as plt

    figure, (left, right) = plt.subplots(1, 2, figsize=(9.0, 4.0), layout="constrained")
    rate = 0.75 * math.pi
    for words, result in results.items():
        at = result.simulation.mechanism.coordinate("crank_pin")
        error = result["q"].values[:, at] - 6.0 * np.sin(rate * result.time)
        left.semilogy(result.time, np.abs(error), lw=1, label=words)
    times, angles, _ = np.array(REFERENCE).T
    left.semilogy(times, np.abs(angles - 6.0 * np.sin(rate * times)), "kx", label="Siconos' result")
    left.set_ylim(bottom=1e-5)
    left.set(xlabel="time [s]", ylabel="error of the crank's angle [rad]")
    left.legend()
    result = results["controller as in the example"]
    centre = 1e3 * result["journal_centre"].sel(joint="rocker_end").values
    right.plot(centre[:, 0], centre[:, 1], lw=0.7)
    right.set(aspect="equal", xlabel="x [mm]", ylabel="y [mm]")
    right.set_title("journal's centre in the bore between coupler and rocker", fontsize=10)
    figure.savefig(path, dpi=130)


def main() -> None:
    where = f"{DOCS}; --quick: results/benchmarks"
    options = command(__doc__, f"the first {QUICK_S:g} s", where).parse_args()
    out = folder_of(options, "four_bar_control", DOCS)
    laws = {"controller as in the example": False, "controller as it should be": True}
    results = {
        words: machine(corrected, QUICK_S if options.quick else 1.0)
        .run(progress=True, estimate=False)
        .completed()
        for words, corrected in laws.items()
    }
    differences = [
        np.column_stack(crank(result)) - np.array(REFERENCE)[:, 1:] for result in results.values()
    ]
    ends = min(result.time[-1] for result in results.values()) + 1e-9
    rows = [["t [s]", "Siconos: angle [rad], speed [rad/s]", *laws]]
    for k, (time, angle, speed) in enumerate(row for row in REFERENCE if row[0] <= ends):
        cells = [f"{1e3 * one[k, 0]:+.2f} mrad, {one[k, 1]:+.3f}" for one in differences]
        rows.append([f"{time:g}", f"{angle:.4f}, {speed:.3f}", *cells])
    text = Table.of_texts(rows).markdown() + "\n"
    (out / "four_bar_control.txt").write_text(text)
    draw(results, out / "four_bar_control.png")
    print(text, end="")
