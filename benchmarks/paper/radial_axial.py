"""Radial versus axial clearance: which of the two moves the tool and loads the joint.

The SCARA's 3 s cycle with every pair of a radial and an axial clearance in joint B, each an
ensemble of runs, because impacts magnify small differences.
"""

from itertools import product

import numpy as np
from common import QUANTITIES, Benchmark, Case, new_figure, show_grid, spread

CLEARANCES = (0.1e-3, 0.2e-3, 0.35e-3, 0.5e-3)
SHOWN = ("deviation_rms_mm", "peak_force_N", "peak_contact_N", "impacts")


def draw(cases, found):
    figure, axes = new_figure(2, 2, 8.5, 7.0)
    labels = [f"{size:g}" for size in sorted({1e3 * case.radial for case in cases})]
    side = len(labels)
    for panel, name in zip(axes.flat, SHOWN, strict=True):
        # The first axis of the table is the axial clearance, drawn upwards.
        order = np.arange(side * side).reshape(side, side).T
        means = np.array([[found[i][name].mean() for i in row] for row in order])
        texts = [[spread(found[i][name]).replace(" ± ", "\n± ") for i in row] for row in order]
        show_grid(panel, means, texts)
        panel.set_title(QUANTITIES[name], fontsize=10)
        panel.set_xticks(range(side), labels)
        panel.set_yticks(range(side), labels)
        panel.set(xlabel="radial clearance C_r [mm]", ylabel="axial clearance C_a [mm]")
    return figure


def main():
    benchmark = Benchmark("radial_axial", __doc__)
    args = benchmark.parse()
    clearances = CLEARANCES[1::2] if args.quick else CLEARANCES
    cases = [Case(radial=radial, axial=axial) for radial, axial in product(clearances, clearances)]
    heads = {"C_r [mm]": lambda case: 1e3 * case.radial, "C_a [mm]": lambda case: 1e3 * case.axial}
    benchmark.compare(args, cases, heads, SHOWN, draw, "weight balanced")
