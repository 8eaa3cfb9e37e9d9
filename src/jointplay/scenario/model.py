"""What a scenario file can say: its tables, their keys, and the units of their values."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, ConfigDict, Discriminator, Field, Tag, WithJsonSchema

from jointplay.contact import (
    FILM_LAWS,
    FRICTION_LAWS,
    NORMAL_LAWS,
    CustomBristle,
    CustomFilm,
    CustomNormalForce,
    FilmLaw,
    FrictionLaw,
    NormalForceLaw,
)
from jointplay.errors import MissingName
from jointplay.joints import JOINT_KINDS, ClearanceJoint, Material
from jointplay.joints.materials import material, materials
from jointplay.kernel.integrators import DEFAULT, INTEGRATORS
from jointplay.loads.drive import DRIVES, JointFriction
from jointplay.mechanism.gear import Gear
from jointplay.mechanism.mechanism import STANDARD_GRAVITY
from jointplay.mechanism.payload import Payload
from jointplay.motion.reference import INTERPOLATIONS
from jointplay.scenario.tables import (
    ANGLE,
    ANGULAR_SPEED,
    Table,
    mirror,
    one_of,
    quantity,
    trouble,
    vector,
)
from jointplay.units import expected, shown

GRAVITY = {"balanced": (0.0, 0.0, 0.0), "loaded": STANDARD_GRAVITY}
"""Gravity by word [m/s^2]: none, as if the weight were balanced, or 9.81 m/s^2 along -z."""

PATHS = ("joint", "line")
"""Ways between Cartesian waypoints."""


def _word(kind: str, choices: Mapping[str, Any] | tuple[str, ...]) -> Any:
    """Type of a field that takes one of `choices`."""

    def check(value: Any) -> str:
        if not isinstance(value, str) or value not in choices:
            raise trouble(one_of(kind, value, choices))
        return value

    return Annotated[str, BeforeValidator(check), WithJsonSchema({"enum": list(choices)})]


def _choice(
    kind: str, key: str, tables: Mapping[str, type[Table]], default: str | None, short: bool
) -> Any:
    """Type of a field that holds one of `tables`, selected by its `key`.

    With `short`, the bare word stands for the table that has nothing but `key`.
    """

    def check(value: Any) -> Any:
        place = key if isinstance(value, Mapping) else None
        if short and isinstance(value, str):
            value = {key: value}
        if not isinstance(value, Mapping):
            raise trouble(f"{shown(value)} is no table; a {kind} is a table with the key {key}")
        chosen = value.get(key, default)
        if chosen is None:
            raise trouble(f"the key {key} is missing; available: {', '.join(tables)}")
        if not isinstance(chosen, str) or chosen not in tables:
            raise trouble(one_of(kind, chosen, tables), place)
        return value

    def select(value: Any) -> str:
        return str(value.get(key, default) if isinstance(value, Mapping) else getattr(value, key))

    union: Any = None
    for name, table in tables.items():
        member: Any = Annotated[table, Tag(name)]  # type: ignore[valid-type]
        union = member if union is None else union | member
    kinds: Any = Annotated[union, Discriminator(select), BeforeValidator(check)]
    words = [
        n for n, t in tables.items() if not any(f.is_required() for f in t.model_fields.values())
    ]
    return Annotated[kinds, _Words(words)] if short else kinds


class _Words:
    """Tells the JSON schema of bare words that stand for tables."""

    def __init__(self, words: list[str]) -> None:
        self.words = words

    def __get_pydantic_json_schema__(self, core: Any, handler: Any) -> dict[str, Any]:
        return {"anyOf": [{"enum": self.words}, handler(core)]}


def _each(kind: Any) -> Any:
    """Type of a table of `kind` by name."""
    return dict[str, kind]


def _list(kind: Any) -> Any:
    """Type of a list of `kind`."""
    return list[kind]


def _or_none(kind: Any) -> Any:
    """Type of a `kind` that may be left out."""
    return kind | None


def _laws(laws: Mapping[str, type]) -> dict[str, type[Table]]:
    return {
        name: mirror(law, law=(Literal[name], name))  # type: ignore[valid-type]
        for name, law in laws.items()
    }


class CustomLaw(Table):
    """A law of one's own; see docs/laws.md."""

    model_config = ConfigDict(use_attribute_docstrings=True)

    law: Literal["custom"] = "custom"
    function: str
    """``module:function`` of a module beside the scenario; of another with ``--trust MODULE``."""
    parameters: list[quantity("")] = Field([])  # type: ignore[valid-type]
    """Numbers that the function finds in p."""


class CustomBristleLaw(CustomLaw):
    """A friction law with bristles of one's own; see docs/laws.md."""

    law: Literal["custom-bristle"] = "custom-bristle"  # type: ignore[assignment]


class CustomFilmLaw(CustomLaw):
    """A film law of one's own; see docs/lubrication.md."""

    law: Literal["custom-film"] = "custom-film"  # type: ignore[assignment]
    viscosity: quantity("Pa*s") = 1.0  # type: ignore[valid-type]
    """Dynamic viscosity."""
    hybrid: bool = True
    """Dry contact takes over where the journal touches the bore."""
    transition: quantity("m") = 1e-6  # type: ignore[valid-type]
    """Depth of penetration at which nothing of the film is left."""
    least_thickness: quantity("m") = 1e-6  # type: ignore[valid-type]
    """Thickness below which a film is no thinner."""


CUSTOM_LAWS = (CustomNormalForce.name, CustomBristle.name, CustomFilm.name)
NORMAL = _choice("normal-force law", "law", _laws(NORMAL_LAWS) | {"custom": CustomLaw}, None, True)
FRICTION = _choice(
    "friction law",
    "law",
    _laws(FRICTION_LAWS) | {"custom": CustomLaw, "custom-bristle": CustomBristleLaw},
    None,
    True,
)
FILM = _choice("film law", "law", _laws(FILM_LAWS) | {"custom-film": CustomFilmLaw}, None, True)


def _material() -> Any:
    """Type of a field that holds a material: a table, or the name of one of the data file."""

    names = materials(aliases=True)

    def check(value: Any) -> Any:
        if not isinstance(value, str):
            return value
        try:
            known = asdict(material(value))
        except MissingName:
            raise trouble(one_of("material", value, names)) from None
        return {key: one for key, one in known.items() if one is not None}

    return Annotated[mirror(Material), BeforeValidator(check), _Words(names)]


MATERIAL = _material()

_PARTS = {NormalForceLaw: NORMAL, FilmLaw: FILM, FrictionLaw: FRICTION, Material: MATERIAL}

KINDS: dict[str, tuple[type, Callable[..., Any], tuple[str, ...]]] = {
    **{kind: (owner, owner, ()) for kind, owner in JOINT_KINDS.items()},
    "planar": (ClearanceJoint, ClearanceJoint.planar, ("lock_tilt", "lock_axial")),
}
"""Class, constructor, and arguments that it sets itself, of each kind of joint."""

JOINT = _choice(
    "kind of joint",
    "kind",
    {
        kind: mirror(
            owner,
            "PlanarJoint" if kind == "planar" else None,
            omit,
            _PARTS,
            kind=(Literal[kind], kind),  # type: ignore[valid-type]
        )
        for kind, (owner, _, omit) in KINDS.items()
    },
    ClearanceJoint.kind,
    False,
)

DRIVE = _choice(
    "drive",
    "kind",
    {
        kind: mirror(owner, kind=(Literal[kind], kind))  # type: ignore[valid-type]
        for kind, owner in DRIVES.items()
    },
    None,
    True,
)
GEAR = mirror(Gear)
JOINT_FRICTION = mirror(JointFriction)
PAYLOAD = mirror(Payload, omit=("frame",), frame=(str, None))
"""Held by the tool if no frame is given."""


class Written(Table):
    """A table that mirrors no class."""

    model_config = ConfigDict(use_attribute_docstrings=True)


def _gravity(value: Any) -> Any:
    if isinstance(value, str):
        if value not in GRAVITY:
            raise trouble(
                f"no gravity {shown(value)}; available: {', '.join(GRAVITY)}, or three components, "
                f"each {expected('m/s^2')}"
            )
        return list(GRAVITY[value])
    return value


class Robot(Written):
    """The robot or linkage."""

    urdf: str
    """URDF: a path relative to the scenario's file, ``jointplay:NAME`` for one that ships with the
    package, or ``example-robot-data:NAME``."""
    tool: str | None = None
    """Frame whose motion is reported; the last one of the URDF if not given."""
    gravity: Annotated[
        vector("m/s^2"),  # type: ignore[valid-type]
        BeforeValidator(_gravity),
        WithJsonSchema(
            {
                "anyOf": [
                    {"enum": list(GRAVITY)},
                    {"type": "array", "items": {"type": ["number", "string"]}, "minItems": 3},
                ],
                "x-unit": "m/s^2",
            }
        ),
    ] = STANDARD_GRAVITY
    """``loaded`` (9.81 m/s^2 along -z), ``balanced`` (none), or three components in world axes."""
    allow_unphysical: list[str] = Field([])
    """Links whose inertia is used although no rigid body has it."""


class Frame(Written):
    """Where one half of a joint that closes a loop sits in its link."""

    link: str
    """Link that carries it."""
    xyz: vector("m") = (0.0, 0.0, 0.0)  # type: ignore[valid-type]
    """Centre in the link's frame."""
    rpy: vector("rad") = (0.0, 0.0, 0.0)  # type: ignore[valid-type]
    """Roll, pitch and yaw as in a URDF; z is the joint's axis."""


class LoopEnds(Written):
    """A joint between two links that closes a loop; ideal and revolute unless [joints] has it."""

    bearing: Frame
    """The outer half."""
    journal: Frame
    """The inner half."""


class MotionTable(Written):
    """Reference motion: a file, joint positions, constant speeds, or positions of the tool."""

    file: str | None = None
    """CSV with the header ``time_s,<joint>,...``, in rad and m; a path like that of the URDF."""
    times: list[quantity("s")] | None = None  # type: ignore[valid-type]
    """Times of the waypoints."""
    joints: dict[str, list[quantity(*ANGLE)]] | None = None  # type: ignore[valid-type]
    """Position at each time, by joint."""
    speeds: dict[str, quantity(*ANGULAR_SPEED)] | None = None  # type: ignore[valid-type]
    """Constant speed, by joint, from the position in [start]; needs a duration."""
    interpolation: _word("interpolation", INTERPOLATIONS) = INTERPOLATIONS[0]  # type: ignore[valid-type]
    """How joints move between waypoints."""
    tool_position: list[vector("m")] | None = None  # type: ignore[valid-type]
    """Position of the frame at each time, in world axes; inverse kinematics finds the joints'."""
    tool_rpy: list[vector("rad")] | None = None  # type: ignore[valid-type]
    """Its roll, pitch and yaw at each time; free if not given."""
    frame: str | None = None
    """Frame that moves like this; the tool if not given."""
    faster: quantity("") = 1.0  # type: ignore[valid-type]
    """How many times as fast as given the motion is; it takes so much less time."""
    path: _word("path", PATHS) = "joint"  # type: ignore[valid-type]
    """Between Cartesian waypoints: joints in step, or the frame on a straight line."""


class Integration(Written):
    """Time integration, and the start."""

    step: quantity("s") = 1e-5  # type: ignore[valid-type]
    """Time step."""
    integrator: _word("integrator", INTEGRATORS) = DEFAULT  # type: ignore[valid-type]
    """Method."""
    macro_step: quantity("s") | None = None  # type: ignore[valid-type]
    """Interval at which `multi-rate` asks for the arm's inertia; an error estimate's choice if not
    given."""
    tolerance: quantity("") | None = None  # type: ignore[valid-type]
    """Error of a macro step, relative, by which `multi-rate` chooses its micro steps; all as long
    as the step if not given."""
    duration: quantity("s") | None = None  # type: ignore[valid-type]
    """Simulated time; the motion's if not given."""
    seed: int | None = None
    """Displaces each journal at the start by a random vector of up to half its clearances."""
    certify: bool = False
    """Whether the case is run again more finely, for the numerical errors of its figures."""


class Output(Written):
    """What is kept."""

    record_every: int = 10
    """Steps between two records; peaks in between are held."""
    figures: bool = True
    """Whether figures that compare the cases are drawn."""


class Model(Written):
    """A scenario, cases aside."""

    @classmethod
    def keys(cls) -> list[str]:
        """Keys that the file can have."""
        return [*cls.model_fields, "cases", "sweep"]

    title: str = ""
    """What the scenario is about, in a line."""
    robot: Robot
    """The robot or linkage."""
    loops: dict[str, LoopEnds] = Field({})
    """Joints that close loops, by name."""
    joints: _each(JOINT) = Field({})  # type: ignore[valid-type]
    """Joints with clearance, by the name of a joint of the URDF or of a loop."""
    gears: _each(GEAR) = Field({})  # type: ignore[valid-type]
    """Gears with play, by joint."""
    drive: _or_none(DRIVE) = None  # type: ignore[valid-type]
    """Of all joints of the motion; ``computed-torque`` if not given."""
    drives: _each(DRIVE) = Field({})  # type: ignore[valid-type]
    """Of single joints; those with neither motion nor drive are then free."""
    joint_friction: _each(JOINT_FRICTION) = Field({})  # type: ignore[valid-type]
    """By joint; those not named have that of their URDF."""
    motion: MotionTable | None = None
    """Reference motion."""
    start: _each(quantity(*ANGLE)) = Field({})  # type: ignore[valid-type]
    """Position at the start of joints without reference; with ``tool_position``, where inverse
    kinematics begins."""
    start_speed: _each(quantity(*ANGULAR_SPEED)) = Field({})  # type: ignore[valid-type]
    """Speed at the start of joints without reference."""
    payloads: _list(PAYLOAD) = Field([])  # type: ignore[valid-type]
    """Bodies that the tool picks up and releases."""
    integration: Integration = Integration()
    """Time integration, and the start."""
    output: Output = Output()
    """What is kept."""


NOT_IN_A_CASE = ("title", "cases", "sweep")
"""Keys that a case does not have."""
