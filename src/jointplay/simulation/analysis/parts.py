"""Causes of the tool error: the shares of play, elasticity and drives, and the sentence on them.

Causes are taken out one after the other, play first, by runs of twins (`twins.without`); the
difference between neighbouring twins is the share of a cause.
"""

from __future__ import annotations

import warnings
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from jointplay.base.errors import JointplayError, JointplayWarning
from jointplay.base.origins import GUESSED, Value
from jointplay.base.tables import few
from jointplay.base.units import readable
from jointplay.model.closed_loops import turns_in_place
from jointplay.model.gear_rules import SPREAD
from jointplay.simulation.analysis import twins
from jointplay.simulation.analysis.tool_error import deviation, difference, error_statistics
from jointplay.simulation.loads.drive import Servo, assign
from jointplay.simulation.loads.gear_pair import GearPair
from jointplay.simulation.result.certificate import alone, shown
from jointplay.simulation.result.result import Result

if TYPE_CHECKING:
    import xarray as xr

    from jointplay.model.mechanism import Mechanism

COUNTS = 0.01
"""Share of the drives in the whole error from which on it is reported; rigid ones leave a
millionth."""
AGAINST = "against the ideal mechanism with the same drives, whose own errors they leave out"
"""The reference of the tool errors in certificates, in words."""
STANDS_M = 1e-9
"""Motion up to which a point stands: that much is rounding [m]."""

DECISIVE = (
    *("radial_clearance", "clearance", "bearing_radius", "bearing_length", "length"),
    *("play", "stiffness"),
)
"""Sizes to which the error is nearly proportional: where one was assumed, three digits are enough.
"""

_BODIES = {
    "bearings": ("bearing_radius", "bearing_length"),
    "guides": ("width", "height", "length"),
}
"""Parts that hold a journal or a slider, and the fields of their size."""

_FIGURES = {
    "peak": "peak tool error",
    "rms": "RMS tool error",
    "peak_turn": "peak tool turn",
    "rms_turn": "RMS tool turn",
}
"""Figures of `ToolError`, and their names in certificates."""


class ToolError:
    """Distance of the tool from that of the ideal mechanism, from `Result.judge_from` on.

    `print` shows it in a sentence, by cause.

    Args:
        result: the run; if its tool's error is not known yet, its ideal mechanism is simulated.

    Attributes:
        vector: error along x, y, z over time (time, axis) [m].
        distance: its size over time (time,) [m].
        turn: angle between the two tools over time (time,) [rad].

    Raises:
        JointplayError: the result has no play, or its ideal mechanism cannot be simulated.
    """

    def __init__(self, result: Result) -> None:
        self._result = result
        self.vector = deviation(result)
        self.distance, self.turn = result["tool_error"], result["tool_turn"]
        self._off = error_statistics(self.vector)
        self._turned = error_statistics(deviation(result, "tool_orientation"))

    @property
    def peak(self) -> float:
        """Largest distance [m]."""
        return float(self._off.peak[-1])

    @property
    def rms(self) -> float:
        """RMS distance [m]."""
        return float(self._off.rms[-1])

    @property
    def peak_turn(self) -> float:
        """Largest angle [rad]."""
        return float(self._turned.peak[-1])

    @property
    def rms_turn(self) -> float:
        """RMS angle [rad]."""
        return float(self._turned.rms[-1])

    @property
    def time_of_peak(self) -> float:
        """Time at which the distance is largest [s]."""
        return _time_of_peak(self.vector)

    @property
    def numerical_errors(self) -> dict[str, float]:
        """Numerical errors of ``peak`` and ``rms`` [m], ``peak_turn`` and ``rms_turn`` [rad], as
        far as they are known.
        """
        certificate = self._result.certificate
        known = {fig.name: fig.error for fig in (certificate.headline if certificate else ())}
        return {name: known[of] for name, of in _FIGURES.items() if of in known}

    @cached_property
    def parts(self) -> dict[str, xr.DataArray]:
        """Displacement of the tool by each cause that there is (time, axis) [m]: ``drive``,
        ``elasticity``, ``play``.

        They add up to the displacement from where the motion sends the tool, or without ``drive``
        to `vector`. Where the machine does not run without play alone, there is ``play and
        elasticity``; against the motion as it was meant (`Result.beside`), all is ``left``.
        """
        if self._result.beside is not None:
            return {"left": self.vector}
        mechanism = self._result.simulation.mechanism
        plays = mechanism.without("play") is not mechanism
        by_cause = {"play" if plays else "elasticity": self.vector}
        if has_both(mechanism):
            try:
                twin = twins.without(self._result, "play")
                assert twin is not None
                play = difference(self._result, twin)
                by_cause = {"elasticity": self.vector - play, "play": play}
            except JointplayError as error:
                text = f"play and elasticity are not told apart: {error}"
                warnings.warn(text, JointplayWarning, stacklevel=2)
                by_cause = {"play and elasticity": self.vector}
        sent = twins.without(self._result, "drive")
        if sent is not None:
            by_cause = {"drive": difference(self._result, sent) - self.vector} | by_cause
        attrs = self.vector.attrs
        return {name: vectors.assign_attrs(attrs) for name, vectors in by_cause.items()}

    # The error in words.

    @cached_property
    def _causes(self) -> dict[str, xr.DataArray]:
        """Parts that are reported: that of the drives only if it is noticeable."""
        drive = self.parts.get("drive")
        if drive is not None and _peak(drive) > COUNTS * _peak(drive + self.vector):
            return self.parts
        return {name: vectors for name, vectors in self.parts.items() if name != "drive"}

    @cached_property
    def _guessed(self) -> str:
        """How sure a rule is of the gears' stiffness: ``usual`` or ``unknown``; empty if given."""
        if "elasticity" not in self.parts:
            return ""
        stiffness = [
            value for value in _values_of(self._result, "gears", "stiffness") if value.assumed
        ]
        unknown = any(value.origin == GUESSED for value in stiffness)
        return "unknown" if unknown else "usual" if stiffness else ""

    @property
    def _known(self) -> dict[str, xr.DataArray]:
        """Parts of which `reported` is the sum."""
        left = "elasticity" if self._guessed else ""
        return {name: vectors for name, vectors in self._causes.items() if name != left}

    @cached_property
    def reported(self) -> xr.DataArray:
        """The displacement with which the sentence begins (time, axis) [m].

        It is from where the tool was sent, if the drives leave it noticeably, else `vector`;
        without the part of elasticity where a rule gave the stiffness of gears.
        """
        error = self.vector
        if "drive" in self._causes:
            error = error + self.parts["drive"]
        if self._guessed:
            error = error - self.parts["elasticity"]
        return error if error is self.vector else error.assign_attrs(self.vector.attrs)

    @property
    def against(self) -> str:
        """The reference of `reported`, in the words of the sentence."""
        where = "from where it was sent" if "drive" in self._causes else "off"
        return f"{where}, elasticity aside" if self._guessed else where

    @property
    def is_restated(self) -> bool:
        """Whether the sentence measures it against something other than the ideal mechanism: where
        the drives were sent, or without elasticity that a rule assumed."""
        return self.reported is not self.vector

    @property
    def _is_exact(self) -> bool:
        """Whether all that decides its size was given, so that its numerical error counts."""
        return sizes_are_given(self._result) and not self.is_restated

    def texts(self, exact: bool) -> dict[str, str]:
        """The figures by their names in certificates, with their numerical errors if `exact`."""
        by_figure = {}
        for (name, of), unit in zip(_FIGURES.items(), ("m", "m", "rad", "rad"), strict=True):
            certificate = self._result.certificate if exact else None
            by_figure[of] = shown(certificate, of, getattr(self, name), unit)
        if self.is_restated:
            by_figure |= {"peak tool error": _mm(_peak(self.reported))}
            by_figure |= {"RMS tool error": _mm(_rms(self.reported))}
        return by_figure

    def columns(self) -> dict[str, str]:
        """The figures for a table of several runs, by column."""
        by_column = self.texts(self._is_exact)
        del by_column["RMS tool turn"]
        if self._guessed:
            del by_column["peak tool turn"]
        if len(known := self._known) > 1:
            by_column |= {f"by {name}": _mm(_peak(vectors)) for name, vectors in known.items()}
        return by_column

    def sentence(self, detail: bool = False) -> str:
        """The tool's error by cause, in a sentence; `detail`: with numerical errors if known."""
        result, causes = self._result, self._causes
        tool = result.simulation.mechanism.tool
        exact = self._is_exact or (detail and not self.is_restated)
        peak, rms, peak_turn, rms_turn = self.texts(exact).values()
        since = since_words(result)
        turned = f"by up to {peak_turn}, RMS {rms_turn}"
        when = f"{since} (at t = {_time_of_peak(self.reported):.4g} s), RMS {rms}"
        if max(_peak(self.reported), self.peak_turn) < STANDS_M and "left" not in causes:
            line = f"{cause(result)} does not move the tool {tool!r}{self._outputs}"
        elif self.is_angle:
            line = f"{cause(result)} turns {tool!r} {turned}{since}, and "
            shifted = _peak(self.vector) >= STANDS_M
            line += (
                f"shifts its origin by up to {peak}" if shifted else "leaves its origin in place"
            )
        elif "left" in causes:
            line = f"The tool {tool!r} is up to {peak} from where the ideal mechanism's is on the "
            line += f"motion as it was meant{when}, and turned {turned}"
        elif len(causes) == 1 and not self._guessed:
            also = ", with elasticity," if "play and elasticity" in causes else ""
            line = f"{cause(result)}{also} puts the tool {tool!r} up to {peak} off{when}"
            line += f", and turns it {turned}" if self.peak_turn > 0.0 else ""
        elif self._guessed and "drive" not in causes:
            line = "No play"
            if "play" in causes:
                line = f"{cause(result)} puts the tool {tool!r} up to {peak} off{when}"
            line += f"; {self._elasticity()}"
        else:
            parts = list(map(self._part, causes))
            parts = parts if "drive" in causes else parts[::-1]
            line = f"The tool {tool!r} is up to {peak} {self.against}{when}: {', '.join(parts)}"
        return f"{line}{_assumptions(result)}{ended_words(result, self.vector)}"

    @property
    def _outputs(self) -> str:
        """A hint at other tools of a linkage: links that turn or slide on the ground and follow."""
        simulation = self._result.simulation
        mechanism, led = simulation.mechanism, simulation.motion
        entries = mechanism.description.joints
        if not mechanism.loops:
            return ""
        names = [
            entries[name].child
            for name in mechanism.joints
            if not (led is not None and name in led.joints)
            and all(
                above.kind == "fixed" for above in mechanism.description.above(entries[name].parent)
            )
        ]
        names = [name for name in names if name != mechanism.tool]
        return f"; what moves on the ground: --tool {' or '.join(names)}" if names else ""

    def _part(self, name: str) -> str:
        """A cause with its largest value and its RMS, in words."""
        vectors, result = self.parts[name], self._result
        if name == "elasticity" and self._guessed:
            return self._elasticity()
        peak, rms = (_in_mm(figure(vectors)) for figure in (_peak, _rms))
        if name == "play":
            return f"play {peak} (RMS {rms}), of {_sizes(result)}"
        stiffness = "; stiffness estimated" if name == "elasticity" and any(
            value.origin == "estimated" for value in _values_of(result, "gears", "stiffness")
        ) else ""  # fmt: skip
        return f"{_label(result, name)} {peak} (RMS {rms}{stiffness})"

    def _elasticity(self) -> str:
        """The part of elasticity where a rule gave the stiffness, with its range, in words."""
        about = 1e3 * _peak(self.parts["elasticity"])
        least, most = (f"{about * factor:.2g}" for factor in (1.0 / SPREAD, SPREAD))
        condition = "if the gears are as stiff as usual"
        if self._guessed == "unknown":
            condition = "by a guess of the gears' stiffness, --gear-stiffness"
        return f"elasticity about {about:.2g} mm {condition} (assumed; {least} to {most})"

    def further(self) -> list[str]:
        """Lines beside the sentence: the parts at the peak, which add up, and the turn."""
        causes, error = self._causes, self.reported
        if self.is_angle or len(causes) == 1 or _peak(error) == 0.0:
            return []
        lines = []
        if len(known := self._known) > 1:
            at = _time_of_peak(error)
            direction = error.sel(time=at).values / _peak(error)
            along = {name: part.sel(time=at).values @ direction for name, part in known.items()}
            listed = ", ".join(
                f"{_label(self._result, name)} {_in_mm(float(size))}"
                for name, size in along.items()
            )
            lines.append(f"of the {_mm(_peak(error))}, along the error at its peak: {listed}")
        if not self._guessed and self.peak_turn > 0.0:
            *_, peak, rms = self.texts(self._is_exact).values()
            others = " and ".join(name for name in causes if name != "drive")
            lines.append(f"turned by {others} by up to {peak}, RMS {rms}")
        return lines

    @property
    def is_angle(self) -> bool:
        """Whether the angle is what counts: of a rocker, or where play does not move the origin."""
        if self.peak_turn <= STANDS_M:
            return False
        mechanism = self._result.simulation.mechanism
        return _peak(self.vector) < STANDS_M or turns_in_place(mechanism, self._result.q[0])

    def __str__(self) -> str:
        return self.sentence()

    __repr__ = __str__


def sizes_are_given(result: Result) -> bool:
    """Whether all sizes that decide figures were given: only then numerical errors matter."""
    return not any(value.assumed for name in DECISIVE for value in _values_of(result, "", name))


def has_both(mechanism: Mechanism) -> bool:
    """Whether there is play as well as elasticity, which a run without play can separate."""
    if not mechanism.runs_ideal:
        return False
    still = mechanism.without("play")
    return still is not mechanism and still is not mechanism.without("elasticity")


def counted_causes(result: Result) -> str:
    """The causes whose errors are in the certificates' figures of the tool, as `run` names them."""
    if result.beside is not None:
        return "all that is left of the motion as it was meant"
    mechanism = result.simulation.mechanism
    plays = mechanism.without("play") is not mechanism
    both = " and elasticity" if has_both(mechanism) else ""
    return f"play{both}" if plays else "elasticity"


def cause(result: Result) -> str:
    """The play and its joints, or what gives way without play, as the subject of a sentence."""
    if sizes := _sizes(result):
        return f"Play of {sizes}"
    mechanism, hinged = result.simulation.mechanism, twins.hinges(result)
    soft = [name for name in mechanism.clearance if name not in hinged]
    soft += [f"link {name}" for name in mechanism.hinges]
    return f"Elasticity of {few(soft + _geared(list(mechanism.gears)))}"


def _sizes(result: Result) -> str:
    """Sizes of play and their joints, in words; empty without play."""
    mechanism = result.simulation.mechanism
    loose: dict[str, list[str]] = {}
    for name, joint in mechanism.clearance.items():
        if joint.has_play:
            loose.setdefault(joint.play_words, []).append(name)
    geared: dict[str, list[str]] = {}
    for name, gear in mechanism.gears.items():
        if gear.play > 0.0:
            size = readable(gear.play, mechanism.description.joints[name].unit)
            geared.setdefault(size, []).append(name)
    for name, load in result.simulation.loads.items():
        if isinstance(load, GearPair) and load.play > 0.0:
            size = readable(load.play, mechanism.description.joints[load.joint].unit)
            loose.setdefault(size, []).append(name)
    for size, names in geared.items():
        loose.setdefault(size, []).extend(_geared(names))
    unsure = any(
        value.assumed
        for name in ("radial_clearance", "clearance")
        for value in _values_of(result, "joints", name)
    )
    mark = " (assumed)" if unsure else ""
    return " and of ".join(f"{size}{mark} in {few(names)}" for size, names in loose.items())


def _geared(names: list[str]) -> list[str]:
    return [f"the gear{'s' if len(names) > 1 else ''} of {few(names)}"] if names else []


def _assumptions(result: Result) -> str:
    """Assumed values that decide the error, in words: bearing sizes, encoder side, bandwidth."""
    mechanism, notes = result.simulation.mechanism, []
    for body, names in _BODIES.items():
        if any(value.assumed for name in names for value in _values_of(result, "joints", name)):
            sizes: dict[str, None] = {}
            for joint in mechanism.clearance.values():
                if all(hasattr(joint, name) for name in names):
                    # A bore is stated by its diameter.
                    extents = [
                        (1 + (name == "bearing_radius")) * getattr(joint, name) for name in names
                    ]
                    sizes[" x ".join(f"{1e3 * size:.3g}" for size in extents)] = None
            notes.append(f"in {body} of {few(list(sizes))} mm, assumed")
    sides = {value.value for value in _values_of(result, "drives", "encoder") if value.assumed}
    if sides and any(gear.play for gear in mechanism.gears.values()):
        notes.append(f"encoder on the {' or '.join(sorted(sides))}, assumed")
    lowered = [
        value.value
        for value in _values_of(result, "drives", "bandwidth")
        if value.assumed and value.source.startswith("rule")
    ]
    if lowered:
        notes.append(f"drives of {few(lowered, 2)} by what their teeth allow, assumed")
    return "".join(f"; {note}" for note in notes)


def _values_of(result: Result, table: str, field: str) -> list[Value]:
    """The result's values of a field, in a table if one is named."""
    return [
        value
        for value in result.values
        if value.key.startswith(table) and value.key.rpartition(".")[2] == field
    ]


def drives_alone(result: Result) -> list[str]:
    """The error by servos alone, of a machine without play: a line, or none."""
    servos = _label(result, "drive")
    if servos == "drives" or not len(result.time):
        return []
    sent = twins.without(result, "drive")
    if sent is None:
        return []
    off, tool = difference(result, sent), result.simulation.mechanism.tool
    return [
        f"The tool {tool!r} is up to {_mm(_peak(off))} from where it was sent"
        f"{since_words(result)} (at t = {_time_of_peak(off):.4g} s), RMS {_mm(_rms(off))}: {servos}"
    ]


def _label(result: Result, name: str) -> str:
    """Name of a cause in sentences: drives are servos if any of them is."""
    if name != "drive":
        return name
    simulation = result.simulation
    drives = assign(simulation.mechanism, simulation.motion, simulation.drive).values()
    return "servos" if any(isinstance(drive, Servo) for drive in drives) else "drives"


def since_words(result: Result) -> str:
    """The time from which a run is judged, in words; empty if from the beginning."""
    return f" from {result.judge_from:g} s on" if result.judge_from > 0.0 else ""


def ended_words(result: Result, error: xr.DataArray) -> str:
    """The end of an ideal run that is shorter than the run, in words; else empty."""
    last = float(error["time"][-1])
    short = last < 0.999 * result.time[-1]  # records of another step may end a little earlier
    return f", against the ideal mechanism, whose run ends at {last:.4g} s" if short else ""


def _time_of_peak(vectors: xr.DataArray) -> float:
    judged = vectors.sel(time=vectors["time"] >= vectors.attrs["judge_from"])
    return float(judged["time"][int(np.linalg.norm(judged.values, axis=1).argmax())])


def _peak(vectors: xr.DataArray) -> float:
    return float(error_statistics(vectors).peak[-1])


def _rms(vectors: xr.DataArray) -> float:
    return float(error_statistics(vectors).rms[-1])


def _in_mm(metres: float) -> str:
    return alone(1e3 * metres) if abs(metres) > STANDS_M else "0"


def _mm(metres: float) -> str:
    return f"{_in_mm(metres)} mm"
