"""Impacts on the stops of joints: how often they are struck, and how hard."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from jointplay.base.tables import counted
from jointplay.base.units import readable
from jointplay.simulation.loads.spring import Stop
from jointplay.simulation.result.result import Result


@dataclass(frozen=True)
class StruckStop:
    """Impacts on a load of the kind ``stop``, from `Result.judge_from` on.

    Forces are those at the records: a contact that is shorter than their interval is missed.
    """

    name: str
    joint: str
    impacts: int
    """Number of contacts that began."""
    rate: float
    """Impacts a second [1/s]."""
    peak: float
    """Largest force or torque [N or N m]."""
    time: float
    """Time of the largest force [s]."""
    unit: str
    shortest: int
    """Number of records in the shortest contact; 0 without contacts."""

    def __str__(self) -> str:
        text = (
            f"stop {self.name!r} of {self.joint}: {counted(f'{self.rate:.3g}', 'impact')} a second"
        )
        if self.impacts:
            text += f", at most {readable(self.peak, self.unit, 3)} at t = {self.time:.4g} s"
            if self.shortest < RESOLVED:
                text += (
                    f" (its contacts last {counted(self.shortest, 'record')}: record more often)"
                )
        return text


RESOLVED = 6
"""Number of records in a contact from which on its largest force is known to 3 % (derived: in half
a sine that is sampled six times, the sample nearest to the top is at most a twelfth of its length
away)."""


def struck_stops(result: Result) -> list[StruckStop]:
    """Every stop of a run; see `StruckStop`."""
    mechanism, start = result.simulation.mechanism, result.judge_from
    judged = result.time >= start
    time = result.time[judged]
    struck = []
    for name, load in result.simulation.loads.items():
        if not isinstance(load, Stop) or len(time) < 2:
            continue
        push = np.abs(result["load_record"].sel(load_part=f"{name}.torque").values[judged])
        pressed = push > 0.0
        edges = np.diff(pressed.astype(int), prepend=0, append=0)
        begins, ends = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
        at = int(push.argmax())
        impacts = len(begins) - int(pressed[0])  # a stop pressed at the start is not struck
        struck.append(
            StruckStop(
                name, load.joint, impacts, impacts / float(time[-1] - time[0]),
                float(push[at]), float(time[at]),
                "N" if mechanism.description.joints[load.joint].slides else "N*m",
                int((ends - begins).min(initial=len(time))) if len(begins) else 0,
            )
        )  # fmt: skip
    return struck
