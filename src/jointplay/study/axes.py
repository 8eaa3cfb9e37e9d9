"""One axis of a sweep: a list, a range, or a distribution of the values of one or several keys."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from jointplay.base.errors import JointplayError, closest, require_positive, require_whole
from jointplay.base.schema import one_of, unknown_key
from jointplay.base.units import convert, toml_text
from jointplay.physics.joints import Fit
from jointplay.scenario.reading import Key, dotted
from jointplay.study.keys import is_whole, kinds, path_of, units_of

SPACINGS = ("linear", "log")
_KEYS = ("key", "keys")
_SOURCES = {
    "values": (),
    "variants": (),
    "from": ("to", "number", "spacing"),
    "distribution": ("from", "to", "mean", "std", "median", "sigma", "mode", "fit"),
}
"""Keys of which an axis has exactly one, with the keys that may go with it."""
MOST_VALUES = 1_000_000
"""Most values of one axis."""
DISTRIBUTIONS: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "uniform": (("from", "to"), ()),
    "log-uniform": (("from", "to"), ()),
    "normal": (("mean", "std"), ("from", "to")),
    "lognormal": (("median", "sigma"), ()),
    "triangular": (("from", "mode", "to"), ()),
    "fit": (("fit",), ()),
}
"""Distributions, with the keys that each needs and may have: `sigma` is that of the logarithm;
`fit` draws the radial clearances of a fit by ISO 286-1."""


@dataclass(frozen=True)
class Axis:
    """The values that one or several keys of the scenario take over a sweep.

    Attributes:
        name: name of the dimension, or of the sampled quantity.
        keys: paths of the keys; empty for variants.
        values: values set there, one after the other; tables of changes for variants; empty for a
            distribution.
        coordinate: the values as numbers in SI, or as text.
        unit: SI unit of the coordinate, empty for pure numbers and text.
        quantile: quantile function of a distribution: probabilities to values in SI; else None.
    """

    name: str
    keys: tuple[Key, ...]
    values: tuple[Any, ...]
    coordinate: np.ndarray
    unit: str
    quantile: Any = None

    @property
    def sampled(self) -> bool:
        return self.quantile is not None


def read(name: str, table: Any) -> Axis:
    """Read an axis from a table of the scenario, or from a list of values of the key `name`.

    Raises:
        JointplayError: keys that do not exist, values of the wrong kind, keys that exclude each
            other.
    """
    if isinstance(table, np.ndarray):
        table = table.tolist()
    if isinstance(table, Sequence) and not isinstance(table, str):
        table = {"values": list(table)}
    if not isinstance(table, Mapping):
        raise JointplayError(f"{toml_text(table)} is not an axis; give a list of values or a table")
    # Which of the sources of values it has, and only keys that go with that one.
    fields = [*_KEYS, *dict.fromkeys(w for s, f in _SOURCES.items() for w in (s, *f))]
    for field in table:
        if field not in fields:
            raise JointplayError(unknown_key(str(field), fields))
    sources = [field for field in _SOURCES if field in table]
    if "distribution" in sources:  # which takes `from` as a bound
        sources = ["distribution"]
    if len(sources) != 1:
        present = " and ".join(sources) or "none"
        raise JointplayError(f"needs one of {', '.join(_SOURCES)}; got {present}")
    (source,) = sources
    for field in table:
        if field not in (*_KEYS, source, *_SOURCES[source]):
            raise JointplayError(f"{field} and {source} exclude each other; give only one of them")
    if source == "variants":
        return _variants(name, table)
    keys = _keys(name, table)
    units = units_of(keys[0])
    for key in keys[1:]:
        if units_of(key) != units:
            pair = f"{dotted(key)} and {dotted(keys[0])}"
            raise JointplayError(f"{pair} take values of different kinds")
    label = name if any(field in table for field in _KEYS) else dotted(keys[0][-1:])
    if source == "values":
        return _list(label, keys, table["values"], units)
    if units is None and not (source == "from" and is_whole(keys[0])):
        raise JointplayError(f"{dotted(keys[0])} is not a quantity; give its values as a list")
    if source == "from":
        return _range(label, keys, table, units)
    return _distribution(label, keys, table, units or ("",))


def _keys(name: str, table: Mapping[str, Any]) -> tuple[Key, ...]:
    if "key" in table and "keys" in table:
        raise JointplayError("key and keys exclude each other; give only one of them")
    texts = table.get("keys", table.get("key", name))
    texts = [texts] if isinstance(texts, str) else texts
    if not isinstance(texts, Sequence) or not texts:
        raise JointplayError(f"{toml_text(texts)} are not keys; give a list of dotted names")
    paths = tuple(path_of(text) for text in texts)
    for path in paths:
        if len(path) == 1 and not any(field in table for field in _KEYS):
            example = f'key = "joints.{name}..."'
            raise JointplayError(f"the key is missing; give the one that varies, such as {example}")
        kinds(path)
    if len(set(paths)) < len(paths):
        raise JointplayError("the same key is named twice")
    return paths


def _variants(name: str, table: Mapping[str, Any]) -> Axis:
    if any(field in table for field in _KEYS):
        raise JointplayError("variants name the keys that they change; leave out key")
    tables = table["variants"]
    if not isinstance(tables, Mapping) or not tables:
        text = toml_text(tables)
        raise JointplayError(f"{text} are not variants; give a table of changes by label")
    for label, changes in tables.items():
        if not isinstance(changes, Mapping):
            text = f"variant {toml_text(label)}: {toml_text(changes)}"
            raise JointplayError(f"{text} is not a table of changes")
        for key in changes:
            kinds((key,))
    labels = np.array(list(tables), dtype=object).astype(str)
    return Axis(name, (), tuple(tables.values()), labels, "")


def _list(name: str, keys: tuple[Key, ...], values: Any, units: tuple[str, ...] | None) -> Axis:
    if not isinstance(values, Sequence) or isinstance(values, str) or not len(values):
        raise JointplayError(f"{toml_text(values)} are not values; give a list of at least one")
    if len(values) > MOST_VALUES:
        raise JointplayError(f"{len(values)} values; at most {MOST_VALUES} are possible")
    coordinate, unit = _coordinate(values, units)
    _, first = np.unique(coordinate, return_index=True)
    if len(first) < len(values):
        twice = values[int(np.setdiff1d(np.arange(len(values)), first)[0])]
        raise JointplayError(f"the value {toml_text(twice)} is given twice")
    return Axis(name, keys, tuple(values), coordinate, unit)


def _coordinate(values: Sequence[Any], units: tuple[str, ...] | None) -> tuple[np.ndarray, str]:
    """Values as numbers in SI and their unit, if all are quantities; else as text, without one."""
    if units is not None:
        try:
            quantities = [convert(value, *units) for value in values]
        except ValueError as error:
            if not any(isinstance(value, str) and value[:1].isalpha() for value in values):
                raise JointplayError(str(error)) from None
        else:
            symbols = {quantity.unit for quantity in quantities if quantity.unit}
            if len(symbols) > 1:
                raise JointplayError(f"values in {' and in '.join(sorted(symbols))}; take one kind")
            unit = symbols.pop() if symbols else units[0] if len(units) == 1 else ""
            return np.array([float(quantity) for quantity in quantities]), unit
    if all(isinstance(v, int | float) and not isinstance(v, bool) for v in values):
        return np.array(values), ""
    return np.array([v if isinstance(v, str) else value_label(v) for v in values]), ""


def value_label(value: Any) -> str:
    """Label of a value in a list; different tables have different labels."""
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{k} = {value_label(v)}" for k, v in value.items()) + "}"
    return toml_text(value)


def _number(table: Mapping[str, Any], field: str, units: tuple[str, ...] | None) -> float:
    if field not in table:
        raise JointplayError(f"the key {field} is missing")
    try:
        return float(convert(table[field], *(units or ("",))))
    except ValueError as error:
        raise JointplayError(f"{field}: {error}") from None


def _unit(table: Mapping[str, Any], fields: Sequence[str], units: tuple[str, ...] | None) -> str:
    """SI unit of the first of `fields` that is given with one."""
    if units is None or len(units) == 1:
        return units[0] if units else ""
    symbols = [convert(table[field], *units).unit for field in fields if field in table]
    return next((unit for unit in symbols if unit), "")


def _range(
    name: str, keys: tuple[Key, ...], table: Mapping[str, Any], units: tuple[str, ...] | None
) -> Axis:
    low, high = _number(table, "from", units), _number(table, "to", units)
    number = require_whole("number", table.get("number"), 2, MOST_VALUES)
    spacing = table.get("spacing", SPACINGS[0])
    if spacing not in SPACINGS:
        raise JointplayError(one_of("spacing", spacing, SPACINGS))
    if low == high:
        raise JointplayError(f"from and to are both {toml_text(table['from'])}")
    if spacing == "log" and not (low > 0.0 and high > 0.0):
        raise JointplayError("spacing log needs from and to greater than zero")
    values = np.geomspace(low, high, number) if spacing == "log" else np.linspace(low, high, number)
    if units is None:
        rounded = np.round(values).astype(int)
        if len(np.unique(rounded)) < number:
            raise JointplayError(f"there are no {number} whole numbers from {low:g} to {high:g}")
        return Axis(name, keys, tuple(rounded.tolist()), rounded, "")
    unit = _unit(table, ("from", "to"), units)
    return Axis(name, keys, tuple(values.tolist()), values, unit)


def _distribution(
    name: str, keys: tuple[Key, ...], table: Mapping[str, Any], units: tuple[str, ...]
) -> Axis:
    kind = table["distribution"]
    if not isinstance(kind, str) or kind not in DISTRIBUTIONS:
        raise JointplayError(one_of("distribution", kind, DISTRIBUTIONS))
    required, optional = DISTRIBUTIONS[kind]
    for field in table:
        if field not in (*_KEYS, "distribution", *required, *optional):
            allowed = ", ".join((*required, *optional))
            hint = closest(field, required)
            raise JointplayError(f"{field} does not go with {kind}; {hint}it takes {allowed}")
    if kind == "fit":
        return Axis(name, keys, (), np.zeros(0), "m", _fit(table, units).quantile)
    numbers = {
        field: _number(table, field, ("",) if field == "sigma" else units)
        for field in (*required, *(field for field in optional if field in table))
    }
    for low, high in (("from", "to"), ("from", "mode"), ("mode", "to")):
        compare = np.less_equal if "mode" in (low, high) else np.less
        if {low, high} <= numbers.keys() and not compare(numbers[low], numbers[high]):
            bounds = f"{numbers[low]:g} and {numbers[high]:g}"
            raise JointplayError(f"{low} must be less than {high}, got {bounds}")
    for field in ("std", "sigma", "median"):
        if field in numbers:
            require_positive(field, numbers[field], "")
    if kind == "log-uniform" and numbers["from"] <= 0.0:
        raise JointplayError("log-uniform needs from greater than zero")
    unit = _unit(table, ("from", "mean", "median"), units)
    return Axis(name, keys, (), np.zeros(0), unit, _frozen(kind, numbers).ppf)


def _fit(table: Mapping[str, Any], units: tuple[str, ...]) -> Fit:
    if units != ("m",):
        raise JointplayError("clearances of a fit are lengths, but the key takes no length")
    if "fit" not in table:
        raise JointplayError('the key fit is missing; give one such as "20H7/g6"')
    fit = Fit(table["fit"])
    fit.require_clearance()
    return fit


def _frozen(kind: str, numbers: Mapping[str, float]) -> Any:
    from scipy import stats

    low, high = numbers.get("from", -np.inf), numbers.get("to", np.inf)
    match kind:
        case "uniform":
            return stats.uniform(low, high - low)
        case "log-uniform":
            return stats.loguniform(low, high)
        case "lognormal":
            return stats.lognorm(numbers["sigma"], scale=numbers["median"])
        case "triangular":
            return stats.triang((numbers["mode"] - low) / (high - low), low, high - low)
    limits = [(end - numbers["mean"]) / numbers["std"] for end in (low, high)]
    return stats.truncnorm(*limits, loc=numbers["mean"], scale=numbers["std"])


# Points in the unit cube, from which the distributions' quantile functions make samples.


METHODS = ("sobol", "latin-hypercube", "random", "saltelli")
"""Sampling methods; `saltelli` is the design for Sobol indices: n (d + 2) points."""
GROWING = ("sobol", "random", "saltelli")
"""Methods whose first points stay the same when more are asked for."""
MOST_SAMPLES = 10_000_000
"""Most samples of a sweep: their points take a gigabyte for ten axes."""
_INSIDE = 1e-12
"""Least distance of a point from the cube's faces, where a normal distribution is infinite."""


def points(method: str, samples: int, dimensions: int, seed: int) -> np.ndarray:
    """Points in the unit cube, shape (rows, dimensions); the same for the same arguments.

    With `saltelli`, `samples` counts the base points, each of which gives `dimensions` + 2 rows.

    Raises:
        JointplayError: a number of samples out of range.
    """
    samples = require_whole("samples", samples, 1, MOST_SAMPLES)
    from scipy.stats import qmc  # which takes half a second that workers need not spend

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # Sobol sequences: no power of two
        if method == "saltelli":
            design = _saltelli(samples, dimensions, seed)
        elif method == "random":
            design = np.random.default_rng(seed).random((samples, dimensions))
        elif method == "latin-hypercube":
            design = qmc.LatinHypercube(dimensions, seed=seed).random(samples)
        else:
            design = qmc.Sobol(dimensions, seed=seed).random(samples)
    return np.clip(design, _INSIDE, 1.0 - _INSIDE)


def _saltelli(samples: int, dimensions: int, seed: int) -> np.ndarray:
    """Saltelli's design for two base samples A and B (Saltelli et al. 2010).

    A block for each base point has d + 2 rows: that of A, d times that of A with one column of B,
    and that of B.
    """
    if samples & (samples - 1):
        raise JointplayError(f"samples must be a power of two with saltelli, got {samples}")
    from scipy.stats import qmc

    design = qmc.Sobol(2 * dimensions, seed=seed).random(samples)
    a, b = design[:, :dimensions], design[:, dimensions:]
    blocks = np.repeat(a[:, None], dimensions + 2, axis=1)
    for k in range(dimensions):
        blocks[:, k + 1, k] = b[:, k]
    blocks[:, -1] = b
    return blocks.reshape(-1, dimensions)
