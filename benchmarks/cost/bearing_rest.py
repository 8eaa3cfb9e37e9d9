"""What it costs to find where a loaded bearing comes to rest, and whether it is always found.

Bearings of the whole catalogue, single and in pairs, with play, fits and preload, some in a seat
that gives way, under random loads up to the static rating: with and without moment, and along
the axes, where single elements bear all. Each place is judged by the forces that the kernel says it
has there, and, where it is the only one, by scipy's root of these forces. CPU times are given as
multiples of a `pin.aba` of the SCARA, taken in the same run.
"""

import math
import time

import numpy as np
import pinocchio as pin
from common import command
from scipy.optimize import root

import jointplay as jp
from jointplay.base.errors import JointplayError
from jointplay.physics.joints.bearings import SECTIONS, catalogue

UNBALANCED = 1e-6
"""Largest force left over, by the load."""
APART = 1e-6
"""Largest distance from scipy's root, by the deflection."""
REGULAR = 1e7
"""Largest condition of a stiffness whose place of rest is looked for a second time."""


def bearing(random):
    """One of the catalogue."""
    section = random.choice(list(SECTIONS))
    name, given = str(random.choice(list(catalogue()[section]))), {}
    kind = jp.CrossedRollerBearing if section == "crossed_roller" else jp.BallBearing
    one = kind(designation=name)
    if section == "angular_contact":
        given["arrangement"] = str(random.choice(["single", "DB", "DF", "DT"]))
        if given["arrangement"] in ("DB", "DF") and random.random() < 0.5:
            given["preload"] = 10 ** random.uniform(-4, -1.5) * one.ratings()[1]
    if "preload" not in given and random.random() < 0.7:
        most = min(20e-6, 0.3 * getattr(one, "distance", 1.0) * (1.0 - math.cos(one.alpha) or 1.0))
        given["radial_clearance"] = random.uniform(-0.2, 1.0) * most
    if random.random() < 0.25:
        stiff = 10 ** random.uniform(7, 9)
        given["seat"] = jp.Elasticity(radial=stiff, axial=stiff, tilt=stiff * one.d_pitch**2)
    return kind(designation=name, **given)


def load(one, random):
    """Force and moment on a bearing, (6,) [N, N m]."""
    size = 10 ** random.uniform(-5, 0) * one.ratings()[1]
    given = np.zeros(6)
    way = random.integers(4)
    given[:3] = random.normal(size=3) if way else np.eye(3)[random.integers(3)]
    if way > 1:
        given[3:5] = 0.5 * one.d_pitch * random.normal(size=2)
    if way == 3:
        given[:3] *= random.uniform(0.0, 0.1)
    return size * given / np.linalg.norm(given * weights(one))


def weights(one):
    """Moments count by half of the pitch diameter."""
    return np.array([1.0, 1.0, 1.0, 2.0 / one.d_pitch, 2.0 / one.d_pitch, 0.0])


def left(one, place, given, cage):
    """Forces that are not balanced, (5,) [N]."""
    return ((one.load(place, cage).wrench + given) * weights(one))[:5]


def apart(one, place, given, cage):
    """How far scipy's root is from a place of rest, by its size; nan where it finds none."""
    size, reach = np.linalg.norm(given * weights(one)), np.abs(place[:3]).max()
    unit = reach * weights(one)[:5]
    scaled = np.diag(weights(one)) @ one.load(place, cage).stiffness @ np.diag(weights(one))
    if np.linalg.cond(scaled[:5, :5]) > REGULAR:
        return np.nan
    found = root(
        lambda x: left(one, np.append(x * unit, 0.0), given, cage) / size,
        place[:5] / unit,
        tol=1e-13,
    )
    if np.abs(found.fun).max() > 1e-9:
        return np.nan
    return float(np.abs(found.x - place[:5] / unit).max())


def aba():
    """CPU time of one forward dynamics of the SCARA [s]."""
    model = pin.buildModelFromUrdf(str(jp.shipped("scara.urdf")))
    data, q, v = model.createData(), pin.neutral(model), np.ones(model.nv)
    many, spent = 2000, []
    for _ in range(5):
        began = time.thread_time()
        for _ in range(many):
            pin.aba(model, data, q, v, v)
        spent.append((time.thread_time() - began) / many)
    return min(spent)


def main():
    """Print the draws that fail, and the last line."""
    parser = command(__doc__)
    parser.add_argument("--draws", type=int, help="how many (default: 10000; quick: 300)")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    draws = options.draws or (300 if options.quick else 10_000)
    spent, failed, unbalanced, distances = [], [], 0.0, []
    for k in range(draws + 1):
        random = np.random.default_rng([options.seed, k])
        one = bearing(random)
        given, cage = load(one, random), random.uniform(0.0, 2.0 * np.pi)
        words = f"draw {k}: {one.designation} {one.summary}, load {given.tolist()}, cage {cage:.6g}"
        began = time.thread_time()
        try:
            place = one.deflection(given[:3], given[3:], cage)
        except JointplayError as error:
            failed.append(words)
            print(f"{words}: {error}", flush=True)
            continue
        if k:  # the first may compile
            spent.append(time.thread_time() - began)
        share = np.linalg.norm(left(one, place, given, cage) / np.linalg.norm(given * weights(one)))
        unbalanced = max(unbalanced, float(share))
        if share > UNBALANCED:
            print(f"{words}: {share:.1e} of the load is not balanced")
        distances.append(apart(one, place, given, cage))
        if distances[-1] > APART:
            print(f"{words}: {distances[-1]:.1e} from scipy's root")
    plain, apart_by = aba(), np.array(distances)
    mean, median, most = (1e3 * f(spent) for f in (np.mean, np.median, np.max))
    print(f"one takes {mean:.3f} ms, median {median:.3f}, at most {most:.3f}")
    print(
        f"bearing_rest {draws} draws: {len(failed)} not found, {unbalanced:.1e} of the load left "
        f"over, {np.nanmax(apart_by):.1e} from scipy's root in {np.isfinite(apart_by).sum()}; mean "
        f"{np.mean(spent) / plain:.0f} of a bare aba of {1e6 * plain:.2f} µs"
    )
    return {"failed": len(failed), "unbalanced": unbalanced, "mean": np.mean(spent) / plain}
