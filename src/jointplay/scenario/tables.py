"""Tables of a scenario that mirror the package's classes: their arguments are the keys.

A class that gets a new argument, or a registry a new law, needs no change here but for the unit of
an argument whose name is new: in `UNITS`, or in the class itself as ``units = {"name": "m/s"}``,
``""`` for a pure number.
"""

from __future__ import annotations

import ast
import difflib
import inspect
import re
import textwrap
import types
from collections.abc import Iterable, Mapping
from dataclasses import is_dataclass
from functools import cache
from itertools import pairwise
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

from pydantic import BaseModel, ConfigDict, Field, PlainValidator, WithJsonSchema, create_model
from pydantic import model_validator as checks
from pydantic_core import PydanticCustomError

from jointplay.units import convert, expected, shown

TORQUE = ("N*m", "N")
ANGLE = ("rad", "m")
ANGULAR_SPEED = ("rad/s", "m/s")
"""Of revolute or of prismatic joints; which one it must be shows when the robot has been read."""

UNITS: Mapping[str, Mapping[str, str | tuple[str, ...]]] = {
    "Material": {"young": "Pa", "poisson": "", "density": "kg/m^3", "yield_strength": "Pa"},
    "Clearance": {
        **dict.fromkeys(
            (
                *("bearing_radius", "bearing_length", "journal_radius", "journal_length"),
                *("radial_clearance", "axial_clearance", "clearance", "clearance_y"),
                *("length", "width", "height", "corner_radius"),
            ),
            "m",
        ),
        "stiffness": "N/m^1.5",
        "axial_stiffness": "N/m^1.5",
        "restitution": "",
        "wear_rate": "m^3/(N*m)",
        "worn": "m",
    },
    "NormalForceLaw": {
        "stiffness": "N/m",
        "damping": "N*s/m",
        "mass": "kg",
        **dict.fromkeys(("n", "p", "q"), ""),
    },
    "FrictionLaw": {
        **dict.fromkeys(("mu_d", "mu_s"), ""),
        **dict.fromkeys(("v0", "v1", "v_s", "v_t", "v_r"), "m/s"),
        "sigma0": "1/m",
        **dict.fromkeys(("sigma1", "sigma2", "xi"), "s/m"),
        "dwell_time": "s",
    },
    "FilmLaw": {"viscosity": "Pa*s", "transition": "m", "least_thickness": "m"},
    "Gear": {
        "play": "rad",
        "rotor_inertia": "kg*m^2",
        "stiffness": "N*m/rad",
        "damping": "N*m*s/rad",
    },
    "Drive": {"bandwidth": "rad/s", "damping_ratio": "", "times": "s", "values": TORQUE},
    "JointFriction": {
        "coulomb": TORQUE,
        "static": TORQUE,
        "viscous": ("N*m*s/rad", "N*s/m"),
        "stribeck_speed": ANGULAR_SPEED,
    },
    "Payload": {"mass": "kg", "pick": "s", "release": "s", "centre": "m", "inertia": "kg*m^2"},
}
"""SI units of arguments, by class or base class, empty for pure numbers.

Every argument that is a number is listed, or importing this package fails.
"""


def trouble(message: str, key: str | None = None) -> PydanticCustomError:
    """An error at the table or value being checked, or at its `key`."""
    # Pydantic formats the message; the context takes it through unharmed.
    return PydanticCustomError("scenario", "{text}", {"text": message, "key": key})


def quantity(*units: str) -> Any:
    """Type of a field that holds a quantity in one of `units`."""

    def check(value: Any) -> float:
        try:
            measured = convert(value, *units)
        except ValueError as error:
            raise trouble(str(error)) from None
        return measured if len(units) > 1 else float(measured)

    schema: dict[str, Any] = {"type": ["number", "string"]}
    if units != ("",):
        schema["x-unit"] = " or ".join(units)
    return Annotated[float, PlainValidator(check), WithJsonSchema(schema)]


def vector(*units: str) -> Any:
    """Type of a field that holds three quantities."""
    one = quantity(*units)

    def check(value: Any) -> tuple[float, float, float]:
        if not isinstance(value, list | tuple) or len(value) != 3:
            raise trouble(
                f"{shown(value)} are not three components; give each as {expected(*units)}"
            )
        try:
            x, y, z = (float(convert(part, *units)) for part in value)
        except ValueError as error:
            raise trouble(str(error)) from None
        return x, y, z

    item = get_args(one)[-1].json_schema
    schema = {"type": "array", "items": item, "minItems": 3, "maxItems": 3}
    return Annotated[tuple[float, float, float], PlainValidator(check), WithJsonSchema(schema)]


class Table(BaseModel):
    """A table that knows its keys, and says which ones it has if another one turns up."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)

    @checks(mode="before")
    @classmethod
    def _known_keys(cls, given: Any) -> Any:
        if not isinstance(given, Mapping):
            raise trouble(f"{shown(given)} is no table; its keys are: {', '.join(cls.keys())}")
        for key in given:
            if key not in cls.model_fields:
                raise trouble(unknown_key(key, cls.keys(), cls._owner()), key)
        return given

    @classmethod
    def _owner(cls) -> str:
        """Whose keys these are, for tables that a word selects."""
        for word in ("law", "kind"):
            if word in cls.model_fields and cls.model_fields[word].default:
                return f" of the {word} {cls.model_fields[word].default}"
        return ""

    @classmethod
    def keys(cls) -> list[str]:
        """Keys that the table can have."""
        return list(cls.model_fields)

    def given(self) -> dict[str, Any]:
        """Values of those keys that the file has."""
        fields = type(self).model_fields
        return {name: getattr(self, name) for name in fields if name in self.model_fields_set}


def unknown_key(key: str, keys: Iterable[str], owner: str = "") -> str:
    """What to say of a key that does not exist."""
    keys = list(keys)
    return f'unknown key "{key}"{owner}; {closest(key, keys)}valid keys: {", ".join(keys)}'


def one_of(kind: str, value: Any, choices: Iterable[str]) -> str:
    """What to say of a choice that does not exist."""
    choices = list(choices)
    return f"no {kind} {shown(value)}; {closest(value, choices)}available: {', '.join(choices)}"


def closest(word: Any, choices: Iterable[str]) -> str:
    """Question after the one of `choices` that `word` resembles; empty if none does."""
    plain = {choice.lower().replace("-", "_"): choice for choice in choices}
    given = str(word).lower().replace("-", "_")
    found = difflib.get_close_matches(given, plain, 1)
    return f'did you mean "{plain[found[0]]}"? ' if found else ""


def unit_of(owner: type, name: str) -> tuple[str, ...]:
    """SI units that argument `name` of the class `owner` can have; empty text: a pure number."""
    return _declared(owner, name) or ("",)


def _declared(owner: type, name: str) -> tuple[str, ...] | None:
    for base in owner.__mro__:
        for table in (vars(base).get("units", {}), UNITS.get(base.__name__, {})):
            if isinstance(table, Mapping) and name in table:
                unit = table[name]
                return (unit,) if isinstance(unit, str) else tuple(unit)
    return None


def mirror(
    owner: type,
    title: str | None = None,
    omit: Iterable[str] = (),
    replace: Mapping[Any, Any] | None = None,
    **extra: Any,
) -> type[Table]:
    """Table whose keys are the arguments of the class `owner`; defaults are left to the class.

    Args:
        owner: the class.
        title: name of the table in the schema; None takes the class's.
        omit: arguments that are no keys.
        replace: types of fields by the types of arguments that have tables of their own.
        extra: further fields, as pydantic takes them.
    """
    made: Any = owner
    if not is_dataclass(owner):
        made = next(vars(base)["__init__"] for base in owner.__mro__ if "__init__" in vars(base))
    hints = get_type_hints(made)
    fields, texts = dict(extra), _explanations(owner)
    for name, parameter in inspect.signature(owner).parameters.items():
        if name in omit:
            continue
        required = parameter.default is inspect.Parameter.empty
        hint = hints.get(name, Any)
        if _measures(hint) and _declared(owner, name) is None:
            raise TypeError(f"{owner.__name__}.{name} is a number without a unit; see UNITS")
        kind = _type(hint, unit_of(owner, name), replace or {})
        text = texts.get(name)
        fields[name] = (kind, Field(... if required else None, description=text))
    model = create_model(title or owner.__name__, __base__=Table, **fields)
    model.__doc__ = inspect.getdoc(owner)
    return model


@cache
def _explanations(owner: type) -> dict[str, str]:
    """What the class says of its arguments: below its fields, or in its docstring."""
    found: dict[str, str] = {}
    for base in reversed(owner.__mro__):
        if not is_dataclass(base):
            continue
        (body,) = ast.parse(textwrap.dedent(inspect.getsource(base))).body
        assert isinstance(body, ast.ClassDef)
        for field, text in pairwise(body.body):
            match field, text:
                case ast.AnnAssign(target=ast.Name(name)), ast.Expr(ast.Constant(str(said))):
                    found[name] = said
    for base in reversed(owner.__mro__):
        doc = inspect.cleandoc(base.__doc__ or "")
        for names, words in re.findall(r"^    (\w+(?:, \w+)*): (.+(?:\n {8,}.+)*)", doc, re.M):
            if not words.startswith("see "):
                found |= dict.fromkeys(names.split(", "), words)
    return {name: " ".join(text.split()) for name, text in found.items()}


def _measures(hint: Any) -> bool:
    """Whether a type holds numbers that can have a unit."""
    return hint is float or any(_measures(part) for part in get_args(hint))


def _type(hint: Any, units: tuple[str, ...], replace: Mapping[Any, Any]) -> Any:
    """Type of a field for an argument with the type `hint`."""
    if hint in replace:
        return replace[hint]
    if hint in (float, int) and units != ("",):
        return quantity(*units)
    if hint is float:
        return quantity("")
    origin, parts = get_origin(hint), get_args(hint)
    if origin in (Union, types.UnionType):
        inner = [part for part in parts if part is not type(None)]
        return _type(inner[0], units, replace) if len(inner) == 1 else Any  # TOML has no None
    if hint == tuple[float, float, float]:
        return vector(*units)
    if hint == tuple[float, ...]:
        return list[quantity(*units)]  # type: ignore[misc]
    return hint if hint in (bool, int, str) or origin is Literal else Any
