"""Every headline figure of a run with its numerical error, found by running again more finely.

docs/certificates.md says how, and how often the stated error covers the true one.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from jointplay import analysis
from jointplay.analysis.claims import measure
from jointplay.core import signals
from jointplay.core.errors import JointplayError
from jointplay.kernel import Status
from jointplay.kernel.integrators import DEFAULT, integrator
from jointplay.kernel.multirate import LARGEST_TURN, LEAST_STEPS
from jointplay.result.certificate import COUNTS, HEADLINE, Certificate, CertifiedFigure
from jointplay.result.result import Result
from jointplay.result.settings import START_UP
from jointplay.result.variables import LOSSES
from jointplay.simulation.run import Run
from jointplay.simulation.saving import save
from jointplay.simulation.simulation import Simulation

SAFETY = 2.5
"""What differences between runs are multiplied by to make an error of them.

Four draws of a chaotic figure, and a fifth that is the truth: it lies within so many times their
range of the first in 95 to 98 of 100 cases, for normal and for skew distributions.
"""

CONTRACTS = 0.5
"""Refinements contract if they differ by no more than this part of what they have moved."""

OWN_CONTRACTS = 0.75
"""An explicit method contracts if half its step leaves no more than this part of its error."""

OWN_SAFETY = 1.25
"""If it does not: what the spread of all runs, its own among them, is multiplied by."""

SENSITIVE = 5e-3
"""A figure that starts so little aside change by more than this part of it is called sensitive."""

MACRO_STEPS_S = (1e-4, 5e-5)
"""Macro steps of the two refined runs, at most, where an error estimate chose the run's [s]."""

PLAIN = "the run"
FINER, FINEST, OWN = "finer", "finest", "own method"

ASIDE = {
    "1 nm aside": (FINER, (1e-9, 1e-9, 1e-9)),
    "100 nm aside": (FINER, (1e-7, -1e-7, 1e-7)),
    "100 nm aside, finest": (FINEST, (-1e-7, 1e-7, -1e-7)),
}
"""Runs that show whether the motion is sensitive: like which, and how far aside journals start [m].

One small displacement does not: chaos grows from any, but stick-slip hangs on switches that a
nanometre need not reach, and that one step reaches and another does not.
"""

CLAIM_UNITS = {
    "deviation_mm": "mm",
    "path_mm": "mm",
    "speed_mm_s": "mm/s",
    **dict.fromkeys(("free", "continuous", "penetration", "busy"), ""),
    **dict.fromkeys(("fx", "fy", "fz"), "N"),
    "peak_time": "s",
    "rate": "1/s",
    "impulse": "N s",
    "crossings": "1/s",
    "swing_mm": "mm",
}
"""Units of what `claims.measure` finds."""

Begin = Callable[[Run], None]
"""Told of each further run before it begins."""


def certify(
    source: Simulation | Result,
    *,
    progress: bool = False,
    simulation: Simulation | None = None,
    begin: Begin = lambda _: None,
) -> Certificate:
    """Run again more finely and state the numerical error of every headline figure.

    Takes some thirteen times as long as the run. Further runs: two of the multi-rate method with
    steps of a half and a quarter and shorter macro steps; both again with the journals aside, see
    `ASIDE`; and for an explicit method its own with half the step.

    Args:
        source: what is certified; a simulation is run first.
        progress: show a bar that names what runs.
        simulation: what made the result; built from the result if not given.
        begin: told of each further run before it begins.

    Raises:
        KeyboardInterrupt: Ctrl-C.
        JointplayError: the simulation cannot be run.
    """
    if isinstance(source, Simulation):
        simulation, result = source, source.run(progress)
    else:
        simulation, result = simulation or source.simulation, source
    if result.status != Status.COMPLETED:
        return Certificate((), note=f"none, for the run did not complete ({result.message})")
    plans = dict(refinements(simulation, result))
    values = {PLAIN: figures(result, _ideal(result, progress, begin))}
    notes, ideals = [], {}
    for number, (name, finer) in enumerate(plans.items(), 1):
        label = f"certifying, {number} of {len(plans)} ({_words(finer)})"
        like, aside = ASIDE.get(name, (name, None))
        rerun, message = _run(finer, aside, label, progress, begin)
        if rerun is None:
            notes.append(f"with {_words(finer)}, {message}")
            continue
        if like not in ideals:
            ideals[like] = _ideal(rerun, progress, begin)
        values[name] = figures(rerun, ideals[like])
    certified, sensitive = [], []
    for name, (value, unit) in values[PLAIN].items():
        known = {run: of[name][0] for run, of in values.items() if name in of}
        # Where a refined run failed, nobody knows.
        error = math.inf if notes else numerical_error(known)
        if name.startswith(HEADLINE) and not notes and is_sensitive(known):
            sensitive.append(name)
        if name in COUNTS and math.isfinite(error) and value:
            # That runs agree says nothing of a contact that barely touches, or barely not.
            error = max(math.ceil(error), 1)
        certified.append(CertifiedFigure(name, value, float(error), unit))
    runs = tuple(f"{name}: {_words(finer)}" for name, finer in plans.items())
    if sensitive:
        notes.append(
            "the motion is sensitive: starts 1 and 100 nm aside change more than the step does in "
            f"{', '.join(sensitive)}; the errors cover what they change, and one run is one draw"
        )
    return Certificate(tuple(certified), runs, "; ".join(notes))


def further_runs(simulation: Simulation) -> int:
    """How many runs `certify` makes, those of the ideal mechanism included."""
    mechanism = simulation.mechanism
    single = integrator(simulation.integrator).single_rate
    ideals = 3 + single if mechanism.clearance or mechanism.gears else 0
    return 2 + len(ASIDE) * bool(mechanism.clearance) + single + ideals


def numerical_error(values: Mapping[str, float]) -> float:
    """Error of a figure, given its value in the run and in the refined runs, by their names."""
    value, finer, finest = (values.get(name, math.nan) for name in (PLAIN, FINER, FINEST))
    if not all(map(math.isfinite, values.values())) or math.isnan(finer + finest):
        return math.inf
    moved = abs(value - finest)
    uncertain = float(np.ptp([of for name, of in values.items() if name not in {PLAIN, OWN}]))
    spread = float(np.ptp(list(values.values())))
    if uncertain > CONTRACTS * moved:
        return SAFETY * spread
    # Two refinements may agree by chance: no error is known to better than a tenth of itself.
    error = max(moved + SAFETY * uncertain, 1.1 * moved)
    if OWN not in values:
        # A quarter of the step leaves a quarter of an error of first order.
        error = max(error, moved * 4.0 / 3.0)
    elif abs(values[OWN] - finest) > OWN_CONTRACTS * moved:
        error = max(error, OWN_SAFETY * spread)
    return error


def is_sensitive(values: Mapping[str, float]) -> bool:
    """Whether starts a little aside change a figure more than the step does, and noticeably."""
    changes = [abs(values[name] - values[like]) for name, (like, _) in ASIDE.items()
               if name in values]  # fmt: skip
    by_step = CONTRACTS * abs(values[PLAIN] - values[FINEST])
    return max(changes, default=0.0) > max(by_step, SENSITIVE * abs(values[PLAIN]))


def refinements(simulation: Simulation, result: Result) -> Iterator[tuple[str, Simulation]]:
    """The further runs that certify `result`, in order."""
    for name, times, macro in zip((FINER, FINEST), (2, 4), MACRO_STEPS_S, strict=True):
        step = simulation.step / times
        if simulation.macro_step is None:
            # At least as short as the run's own where contacts begin and end, and in fast turns.
            own = 2.0 * LEAST_STEPS * simulation.step * 2.0 / times
            turn = LARGEST_TURN / max(_fastest_turn(result), 1e-9) / times
            macro = min(macro, own, turn)
        else:
            macro = simulation.macro_step / times
        tolerance = simulation.tolerance
        finer = replace(
            simulation,
            integrator=DEFAULT,
            step=step,
            record_every=simulation.record_every * times,
            macro_step=max(macro, step),
            tolerance=None if tolerance is None else tolerance / times**2,
            duration=float(result.time[-1]),
        )
        yield name, finer
        if simulation.mechanism.clearance:
            yield from ((aside, finer) for aside, (like, _) in ASIDE.items() if like == name)
    if integrator(simulation.integrator).single_rate:
        yield (
            OWN,
            replace(
                simulation,
                step=simulation.step / 2,
                record_every=simulation.record_every * 2,
                duration=float(result.time[-1]),
            ),
        )


def _fastest_turn(result: Result) -> float:
    """Fastest joint that turns, the journals' own freedoms aside [rad/s]."""
    turns = result.dataset["coordinate_unit"].values == "rad"
    own = np.array(["." not in str(name) for name in result.dataset["coordinate"].values])
    return float(np.abs(result["v"].values[:, turns & own]).max(initial=0.0))


def _words(simulation: Simulation) -> str:
    """The settings of a run in a few words."""
    words = f"{simulation.integrator}, step {1e6 * simulation.step:g} us"
    if simulation.macro_step is not None:
        words += f", macro step {1e6 * simulation.macro_step:.3g} us"
    if simulation.tolerance is not None:
        words += f", tolerance {simulation.tolerance:g}"
    return words


def _run(
    simulation: Simulation,
    aside: tuple[float, float, float] | None,
    label: str,
    progress: bool,
    begin: Begin,
) -> tuple[Result | None, str]:
    """A refined run, or None and why there is none."""
    try:
        prepared = Run(simulation, progress)
    except JointplayError as error:
        return None, f"the run is refused: {error}"
    if aside is not None:
        prepared.displace(aside)
    prepared.label = label
    begin(prepared)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # said in the certificate
        result = prepared.finish(progress, check_step=False)
    if result.status == Status.INTERRUPTED:
        raise KeyboardInterrupt
    if result.status != Status.COMPLETED:
        return None, f"the run {result.message}"
    return result, ""


def _ideal(result: Result, progress: bool, begin: Begin) -> Result | None:
    """The ideal mechanism's run with the same settings; None where there is none."""
    if not analysis.has_play(result):
        return None
    ideal, why = _run(
        analysis.ideal_simulation(result), None, "certifying (ideal)", progress, begin
    )
    if ideal is None:
        text = f"the tool error is not certified: the ideal mechanism cannot be simulated ({why})"
        warnings.warn(text, RuntimeWarning, stacklevel=3)
    return ideal


def figures(result: Result, ideal: Result | None) -> dict[str, tuple[float, str]]:
    """Headline figures of a run from `Result.judge_from` on, and what the claims use.

    Returns:
        Value and unit by name.
    """
    headlines: dict[str, tuple[float, str]] = {}
    judged = result.time >= result.judge_from
    if result.joints:
        forces = {"peak": result["joint_force_peak"], "RMS": result["joint_force"]}
        names: Sequence[str] = result.joints
    else:
        forces = dict.fromkeys(("peak", "RMS"), result["reaction_force"])
        names = [str(name) for name in result["moving_joint"].values]
    for how, force in forces.items():
        sizes = np.linalg.norm(force.values, axis=2)
        for k, name in enumerate(names):
            at = "" if len(names) == 1 else f", {name}"
            size = sizes[judged, k]
            value = size.max() if how == "peak" else np.sqrt(np.mean(size**2))
            headlines[f"{how} joint force{at}"] = float(value), "N"
    if ideal is not None:
        error = analysis.accuracy(analysis.deviation(result, ideal), result.judge_from)
        headlines["peak tool error"] = float(error.peak[3]), "m"
        headlines["RMS tool error"] = float(error.rms[3]), "m"
    if result.joints:
        headlines["impacts"] = float(result.audit.judged_impacts or 0), ""
    losses = [result[name].values[judged] for name in LOSSES if name in result.dataset]
    lost = sum(float(values[-1] - values[0]) for values in losses)
    if "load_work" in result.dataset:
        work = result["load_work"].values[judged]
        lost += float(np.maximum(work[0] - work[-1], 0.0).sum())
    headlines["dissipated energy"] = lost, "J"
    if ideal is not None and len(result.joints) == 1 and result.time[-1] > 2.0 * START_UP:
        measures = measure(result, ideal)
        headlines |= {name: (float(measures[name]), CLAIM_UNITS[name]) for name in CLAIM_UNITS}
    return headlines


def add_certificate(
    result: Result,
    path: Path,
    simulation: Simulation,
    progress: bool = False,
    begin: Begin = lambda _: None,
) -> None:
    """Certify a saved result and save it again; until then the file is as it was.

    A run that was told to stop, or while it was saved, is not certified.

    Args:
        result, path: what `run_and_save` gave, and its file.
        simulation: what was run.
        progress, begin: see `certify`.

    Raises:
        JointplayError: the file cannot be written again; the message says where the result is.
        KeyboardInterrupt: told to stop; the result is there without certificate.
    """
    if result.status == Status.INTERRUPTED or signals.stop_requested():
        return
    certificate = certify(result, simulation=simulation, progress=progress, begin=begin)
    with signals.keeping(f"the certificate of {path}"):
        result.certificate = certificate
        save(result, path, overwrite=True)
