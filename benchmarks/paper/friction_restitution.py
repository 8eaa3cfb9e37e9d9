"""Effect of friction and restitution on joint force, impacts, losses and the tool.

The SCARA's 3 s cycle with 0.2 mm clearance in joint B, for every pair of a friction coefficient
and a coefficient of restitution, each an ensemble of runs.
"""

from itertools import product

from common import COLOURS, MARKERS, QUANTITIES, Benchmark, Case, draw_ensembles, new_figure

FRICTION = (0.0, 0.05, 0.1, 0.2, 0.3)
RESTITUTION = (0.5, 0.7, 0.9, 1.0)
SHOWN = (
    *("deviation_rms_mm", "peak_force_N", "peak_contact_N"),
    *("impacts", "normal_loss_J", "friction_loss_J"),
)


def draw(cases, found):
    friction, restitution = (
        sorted({getattr(case, name) for case in cases}) for name in ("friction", "restitution")
    )
    figure, axes = new_figure(2, 3, 11.0, 6.5)
    for panel, name in zip(axes.flat, SHOWN, strict=True):
        for index, value in enumerate(restitution):
            # Side by side, so that error bars do not hide each other.
            x = [mu + 0.006 * (index - (len(restitution) - 1) / 2) for mu in friction]
            values = [group[name] for group in found[index :: len(restitution)]]
            look = {"color": COLOURS[index], "marker": MARKERS[index]}
            draw_ensembles(panel, x, values, label=f"{value:g}", **look)
        panel.set(ylabel=QUANTITIES[name], xlabel="friction coefficient [1]", xticks=friction)
        panel.set_ylim(bottom=0)
    handles, labels = axes[0, 0].get_legend_handles_labels()
    title, at = "coefficient of restitution [1]", "outside lower center"
    figure.legend(handles, labels, title=title, loc=at, ncols=len(labels), frameon=False)
    return figure


def main():
    benchmark = Benchmark("friction_restitution", __doc__, clearance=(0.2, "C_r = C_a [mm]"))
    args = benchmark.parse()
    every = 4 if args.quick else 1
    clearance = 1e-3 * args.clearance
    cases = [
        Case(clearance, clearance, friction=mu, restitution=c_e)
        for mu, c_e in product(FRICTION[::every], RESTITUTION[::every])
    ]
    heads = {"friction": lambda case: case.friction, "restitution": lambda case: case.restitution}
    words = f"weight balanced, C_r = C_a = {args.clearance:g} mm"
    benchmark.compare(args, cases, heads, SHOWN, draw, words)
