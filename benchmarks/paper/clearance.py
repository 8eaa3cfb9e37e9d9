"""How much clearance costs: tool deviation, joint force, impacts and losses from 0 to 1 mm.

The SCARA's 3 s cycle with C_r = C_a in joint B. Zero is the ideal robot, whose joint force is the
constraint force. Every clearance is an ensemble of runs, because impacts magnify small differences.
"""

from common import COLOURS, MARKERS, QUANTITIES, Benchmark, Case, draw_ensembles, new_figure

CLEARANCES = (0.0, 0.05e-3, 0.1e-3, 0.2e-3, 0.3e-3, 0.5e-3, 0.7e-3, 1.0e-3)
PANELS = (
    ("tool deviation [mm]", {"deviation_rms_mm": "RMS", "deviation_max_mm": "largest"}),
    ("peak force [N]", {"peak_force_N": "whole joint", "peak_contact_N": "one contact"}),
    ("impacts", {"impacts": None}),
    ("energy lost [J]", {"normal_loss_J": "normal damping", "friction_loss_J": "friction"}),
)


def draw(cases, every):
    (_, *clearances), (ideal, *found) = [1e3 * case.radial for case in cases], every
    figure, axes = new_figure(2, 2)
    for panel, (label, names) in zip(axes.flat, PANELS, strict=True):
        for (name, text), colour, marker in zip(names.items(), COLOURS, MARKERS, strict=False):
            values = [ensemble[name] for ensemble in found]
            draw_ensembles(panel, clearances, values, label=text, color=colour, marker=marker)
        panel.set_ylabel(label)
        panel.set_xlim(left=0)
        if name == "friction_loss_J":
            panel.set_yscale("log")
        else:
            panel.set_ylim(bottom=0)
        if name == "peak_contact_N":
            force = ideal["peak_force_N"][0]
            panel.axhline(force, color="black", ls=":", label=f"ideal robot, {force:.0f} N")
        if len(names) > 1:
            panel.legend(frameon=False)
    for panel in axes[-1]:
        panel.set_xlabel("clearance C_r = C_a [mm]")
    return figure


def main():
    words = "with gravity (default: weight balanced)"
    benchmark = Benchmark("clearance", __doc__, loaded=(False, words))
    args = benchmark.parse()
    clearances = (0.0, 0.2e-3, 0.5e-3) if args.quick else CLEARANCES
    cases = [Case(radial=c, axial=c, loaded=args.loaded) for c in clearances]
    heads = {"C_r = C_a [mm]": lambda case: 1e3 * case.radial}
    weight = "with gravity" if args.loaded else "weight balanced"
    benchmark.compare(args, cases, heads, tuple(QUANTITIES), draw, weight)
