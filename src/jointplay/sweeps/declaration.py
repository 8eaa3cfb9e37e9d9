"""From the table [sweep] of a scenario, or what is given in its place, to a plan."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from jointplay.analysis.uncertainty import read_until
from jointplay.core.errors import JointplayError, MissingName, require_whole
from jointplay.core.schema import one_of, unknown_key
from jointplay.core.units import convert, toml_text
from jointplay.scenario import Scenario
from jointplay.scenario.places import Key, dotted
from jointplay.sweeps.axes import GROWING, METHODS, Axis, read
from jointplay.sweeps.plan import REPEAT, SAMPLE, WORDS, Plan

RESERVED = (SAMPLE, REPEAT, "time", "joint", "contact", "axis", "coordinate", "state", "error")
"""Names that no axis can have."""

MOST_CASES = 100_000_000


def plan_of(
    source: Scenario | str | Path,
    axes: Mapping[str, Any] | None = None,
    *,
    trust: Collection[str] = (),
    **options: Any,
) -> Plan:
    """Read the table [sweep] of a scenario, or what is given in its place, and check it.

    Args:
        source: a scenario or its file.
        axes: instead of those of the file: by name, see docs/sweeps.md.
        trust: modules from which a file may take laws and measures.
        options: other keys of the table [sweep], instead of those of the file.

    Raises:
        JointplayError: an empty or contradictory sweep, keys that do not exist.
    """
    scenario = source if isinstance(source, Scenario) else Scenario.load(source, trust)
    given = {**scenario.sweep, **{k: v for k, v in options.items() if v is not None}}
    if axes is not None:
        given["axes"] = dict(axes)
    for word in given:
        if word not in WORDS:
            raise scenario.error(("sweep", word), unknown_key(str(word), WORDS))
    if axes is not None or not isinstance(given.get("axes", {}), Mapping):
        all_axes = _axes(scenario, given.get("axes", {}), ())
    else:
        all_axes = _axes(scenario, given.get("axes", {}), ("sweep", "axes"))
    made = Plan(
        scenario,
        _case(scenario, given.get("case")),
        tuple(axis for axis in all_axes if not axis.sampled),
        tuple(axis for axis in all_axes if axis.sampled),
        given=given,
        **_numbers(scenario, given),
    )
    try:
        _check(made)
    except JointplayError as error:
        raise scenario.error(("sweep",), str(error)) from None
    return made


def _axes(scenario: Scenario, tables: Any, place: Key) -> list[Axis]:
    if not isinstance(tables, Mapping):
        raise scenario.error(("sweep", "axes"), f"{toml_text(tables)} is no table of axes by name")
    axes: list[Axis] = []
    for name, table in tables.items():
        where = (*place, name) if place else ()
        try:
            axis = read(str(name), table)
            taken = [other.name for other in axes]
            if axis.name in taken:
                axis = replace(axis, name=str(name).replace(".", "_"))
            if axis.name in RESERVED or not axis.name:
                raise JointplayError(f"an axis cannot be called {toml_text(axis.name)}")
            axes.append(axis)
        except JointplayError as error:
            message = str(error) if place else f"axis {toml_text(str(name))}: {error}"
            raise scenario.error(where, message) from None
    return axes


def _case(scenario: Scenario, case: Any) -> str:
    if case is None:
        if len(scenario.cases) > 1:
            listed = ", ".join(scenario.cases)
            raise scenario.error(
                ("sweep",), f"case is missing: which of the file's cases is swept? ({listed})"
            )
        return scenario.cases[0]
    if case not in scenario.cases:
        raise scenario.error(("sweep", "case"), str(MissingName("case", case, scenario.cases)))
    return str(case)


def _whole(given: Mapping[str, Any], word: str, default: int, least: int) -> int:
    return require_whole(word, given.get(word, default), least, 2**62 - 1)


def _numbers(scenario: Scenario, given: Mapping[str, Any]) -> dict[str, Any]:
    """Everything of the table but its axes and its case."""
    word = ""
    try:
        fields: dict[str, Any] = {}
        for word, default, least in (("samples", 0, 1), ("seed", 0, 0), ("repeats", 1, 1)):
            fields[word] = _whole(given, word, default, least) if word in given else default
        word = "sampling"
        fields[word] = given.get(word, METHODS[0])
        if fields[word] not in METHODS:
            raise JointplayError(one_of("sampling", fields[word], METHODS))
        for word in ("measures", "histories"):
            names = given.get(word, ())
            names = [names] if isinstance(names, str) else names
            if not isinstance(names, Sequence) or not all(isinstance(n, str) for n in names):
                raise JointplayError(f"{toml_text(names)} are no {word}; give a list of names")
            fields[word] = tuple(names)
        word = "start"
        fields[word] = float(convert(given[word], "s")) if word in given else None
        if fields[word] is not None and not fields[word] >= 0.0:
            raise JointplayError(f"must not be negative, got {toml_text(given[word])}")
        word = "tool_error"
        if not isinstance(given.get(word, True), bool):
            raise JointplayError(f"expected true or false, got {toml_text(given[word])}")
        fields[word] = given.get(word, True)
        word = "until"
        fields[word] = read_until(given[word]) if word in given else None
    except (JointplayError, ValueError) as error:
        raise scenario.error(("sweep", word), f"{word}: {error}") from None
    return fields


def _check(made: Plan) -> None:
    """Refuse what is empty or contradicts itself."""
    if not made.axes and not made.drawn and made.repeats == 1:
        raise JointplayError(
            "the sweep is empty: give [sweep.axes], such as "
            'clearance = { key = "joints.JOINT.radial_clearance", values = ["0.1 mm", "0.2 mm"] }, '
            "or repeats"
        )
    if made.drawn and not made.samples:
        names = ", ".join(axis.name for axis in made.drawn)
        raise JointplayError(f"samples is missing: how many, of the distribution of {names}?")
    if made.samples and not made.drawn:
        raise JointplayError("samples needs an axis with a distribution; there is none")
    _check_keys(made)
    if made.until is not None:
        if not made.drawn:
            raise JointplayError("until needs an axis with a distribution; there is none")
        if made.sampling not in GROWING:
            raise JointplayError(
                f"until adds samples, which {made.sampling} cannot; take {' or '.join(GROWING)}"
            )
        if made.until.most < made.samples:
            raise JointplayError(
                f"until stops at {made.until.most} samples, but samples is {made.samples}"
            )
    if made.count > MOST_CASES:
        raise JointplayError(f"{made.words}; at most {MOST_CASES} are possible")
    if made.drawn:
        _ = made.points
    for name in made.measures:
        module, _, function = name.partition(":")
        if not function.isidentifier() or not all(p.isidentifier() for p in module.split(".")):
            raise JointplayError(f"a measure is named module:function, got {toml_text(name)}")


def _check_keys(made: Plan) -> None:
    """Refuse two axes that put their values at the same place."""
    places: dict[Key, str] = {}
    for axis in (*made.axes, *made.drawn):
        keys = axis.keys or tuple({(str(k),) for change in axis.values for k in change})
        for key in axis.keys:
            for other, name in places.items():
                size = min(len(key), len(other))
                if key[:size] == other[:size]:
                    raise JointplayError(
                        f"axes {toml_text(name)} and {toml_text(axis.name)} contradict each other: "
                        f"both set {dotted(min(key, other, key=len))}"
                    )
        places |= dict.fromkeys(keys if axis.keys else (), axis.name)
    seed: Key = ("integration", "seed")
    if made.repeats > 1 and seed in places:
        raise JointplayError(
            f"repeats sets integration.seed, and so does axis {toml_text(places[seed])}"
        )
