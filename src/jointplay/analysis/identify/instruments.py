"""The instruments that felt impacts, to look at simulated runs as they looked at the machine."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from jointplay.analysis.identify.impacts import channels, impacts, summary
from jointplay.analysis.identify.parameters import friction_of, with_clearance
from jointplay.analysis.identify.reading import Measurement
from jointplay.analysis.running import run_to_the_end
from jointplay.errors import JointplayError
from jointplay.joints import Clearance
from jointplay.result.result import Result
from jointplay.simulation.simulation import Simulation

_FINER = 2.0
"""Records of a run for each of the measurement."""
_LEAST = 0.05
"""Part of a value below which it is not drawn."""


@dataclass(frozen=True)
class Instruments:
    """What showed impacts, how often and how well."""

    begin: float
    """Of the measurement [s]."""
    end: float
    rate: float
    """Records a second [Hz]."""
    noise: Mapping[str, float]
    """Standard deviation of a record by kind of signal [SI]."""
    joints: tuple[str, ...]
    """Of the channels; empty text for the accelerometer."""
    axes: tuple[str, ...]
    """Of the accelerometer."""

    @classmethod
    def of(cls, measured: Measurement) -> Instruments:
        """Those of a measurement.

        Raises:
            JointplayError: it has no signal that shows impacts.
        """
        seen = channels(measured)
        if not seen:
            raise JointplayError(
                f"{measured.source}: no impacts show: acceleration x (y, z) or JOINT reaction is "
                "needed"
            )
        noise: dict[str, float] = {}
        for one in seen:
            kind = "reaction" if one.joint else "acceleration"
            noise[kind] = max(one.noise, noise.get(kind, 0.0))
        time = measured.time
        return cls(
            float(time[0]),
            float(time[-1]),
            1.0 / float(np.median(np.diff(time))),
            noise,
            tuple(one.joint for one in seen),
            tuple(measured.has("acceleration")),
        )

    def settings(self, simulation: Simulation) -> Simulation:
        """The simulation, as long as the measurement and recorded as finely.

        Raises:
            JointplayError: it has neither motion nor duration.
        """
        if simulation.motion is None and simulation.duration is None:
            raise JointplayError("the scenario needs the motion that was measured, or a duration")
        every = max(int(1.0 / (_FINER * self.rate * simulation.step)), 1)
        return replace(simulation, duration=self.end, record_every=every)

    def look(self, result: Result) -> Measurement:
        """What they see of a run, noise of its own included."""
        kinds = tuple(self.noise)
        seed = result.simulation.seed or 0
        seen = Measurement.from_result(
            result, rate=self.rate, noise=self.noise, kinds=kinds, seed=seed, delay=self.begin
        )
        wanted = {("acceleration", axis) for axis in self.axes}
        wanted |= {("reaction", joint) for joint in self.joints}
        signals = {key: values for key, values in seen.signals.items() if key in wanted}
        return replace(seen, signals=signals, noise=dict(self.noise))

    def statistics(self, measured: Measurement) -> dict[str, float]:
        """Statistics of all channels, by name."""
        seen = replace(measured, noise={**measured.noise, **self.noise})
        return {
            f"{name} of {one.joint + ' reaction' if one.joint else 'the acceleration'}": value
            for one in channels(seen)
            for name, value in summary(one).items()
        }

    def hits(self, measured: Measurement) -> int:
        """Impacts in the channel that has most."""
        return max(len(impacts(one)) for one in channels(measured))


def run(simulation: Simulation) -> Result:
    """A run of which nothing but what instruments see counts.

    Raises:
        JointplayError: it fails.
    """
    return run_to_the_end(simulation, "a run to compare with the measurement")


def drawn(joint: Clearance, spread: Mapping[str, float], random: np.random.Generator) -> Clearance:
    """The joint with clearances and friction as they may be, by their standard deviations."""
    now = {**joint.clearances, "friction": friction_of(joint) or 0.0}
    changed = {
        name: max(now[name] + one * random.standard_normal(), _LEAST * now[name])
        for name, one in spread.items()
        if name in now
    }
    return with_clearance(joint, changed) if changed else joint
