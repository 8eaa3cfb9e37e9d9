"""Objects to plain data and back: what a class says of its fields is all that is needed."""

import dataclasses
import json
import math
import textwrap
from contextlib import suppress
from dataclasses import dataclass, field

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given

import jointplay as jp
from jointplay import JointplayError
from jointplay.base import schema
from jointplay.base.errors import within
from jointplay.base.schema import Described, check_fields, choice, quantity
from jointplay.model.gear import Gear
from jointplay.model.loop import Loop
from jointplay.model.payload import Payload
from jointplay.physics.contact import FRICTION_LAWS, NORMAL_LAWS, NormalForceLaw
from jointplay.physics.joints import Clearance
from jointplay.simulation.loads.drive import Drive, JointFriction


@dataclass(frozen=True)
class Wheel(Described):
    """Something round."""

    radius: float = quantity("m", above=0.0)
    """Of the tread."""
    colour: str = choice("colour", ("red", "black"), default="black")
    spokes: int | None = None

    def __post_init__(self):
        check_fields(self)


@dataclass(frozen=True)
class Cart(Described):
    wheels: tuple[Wheel, ...]
    load: dict[str, float] = quantity("kg", default_factory=dict)
    at: tuple[float, float, float] = quantity("m", default=(0.0, 0.0, 0.0))
    tags: list[str] = field(default_factory=list)


wheels = st.builds(
    Wheel,
    st.floats(1e-6, 1e6),
    st.sampled_from(["red", "black"]),
    st.none() | st.integers(0, 99),
)
carts = st.builds(
    Cart,
    st.lists(wheels, max_size=4).map(tuple),
    st.dictionaries(st.text(), st.floats(-1e9, 1e9)),
    st.tuples(*[st.floats(-1.0, 1.0)] * 3),
    st.lists(st.text()),
)


@given(carts)
def test_what_is_described_is_read_back(cart):
    text = json.dumps(cart.describe())
    assert Cart.from_description(json.loads(text)) == cart


def test_numbers_take_their_units():
    cart = Cart.from_description(
        {"wheels": [{"radius": "30 cm"}], "load": {"hay": "20 g"}, "at": ["1 mm", 0, 0]}
    )
    assert cart == Cart((Wheel(0.3),), {"hay": 0.02}, (1e-3, 0.0, 0.0))


@pytest.mark.parametrize(
    ("data", "where", "message"),
    [
        ({"wheels": [{"radius": 1}, {"radius": -1}]}, ("wheels", 1, "radius"), "greater than zero"),
        ({"wheels": [{"radius": "1 kg"}]}, ("wheels", 0, "radius"), '"1 kg" is not a length'),
        ({"wheels": [{"radius": 1, "color": "red"}]}, ("wheels", 0, "color"), '"colour"?'),
        ({"wheels": [{"radius": 1, "colour": "pink"}]}, ("wheels", 0, "colour"), "no colour"),
        ({"wheels": [{"radius": 1, "spokes": 2.5}]}, ("wheels", 0, "spokes"), "a whole number"),
        ({"wheels": [{"radius": 1, "spokes": True}]}, ("wheels", 0, "spokes"), "a whole number"),
        ({"wheels": [{}]}, ("wheels", 0), "the key radius is missing"),
        ({"wheels": {}}, ("wheels",), "a list in brackets"),
        ({"wheels": [], "load": {"hay": "a lot"}}, ("load", "hay"), "is not a mass"),
        ({"wheels": [], "at": [1, 2]}, ("at",), "are not three components"),
        ({"wheels": [], "tags": [1]}, ("tags", 0), "text in quotes"),
        ([], (), "is not a table; its keys are: wheels, load, at, tags"),
    ],
)
def test_errors_have_their_place(data, where, message):
    with pytest.raises(JointplayError) as caught:
        Cart.from_description(data)
    assert caught.value.where == where
    assert message in str(caught.value)


def test_outer_layers_prepend_their_place():
    with pytest.raises(JointplayError) as caught, within("joints", "joint_b"):
        jp.RevoluteClearance(radial_clearance=-1.0, axial_clearance=1e-4)
    assert caught.value.where == ("joints", "joint_b", "radial_clearance")


def test_a_number_without_a_unit_is_refused_when_it_is_first_read():
    @dataclass
    class Novel:
        length: float

    with pytest.raises(TypeError, match=r"Novel.length is a number without a unit"):
        schema.check(Novel, {"length": 1.0})


VALUES = [
    (
        Clearance,
        jp.RevoluteClearance.planar(radial_clearance=1e-4, bearing_material=jp.material("bronze")),
    ),
    (Clearance, jp.PrismaticClearance(clearance=1e-4, friction=jp.contact.LuGre(0.08))),
    (Clearance, jp.SphericalClearance(radial_clearance=1e-4, ideal=True)),
    (Drive, jp.loads.ComputedTorque(40.0, encoder="motor")),
    (Drive, jp.loads.Prescribed()),
    (JointFriction, jp.loads.JointFriction(1.0, 0.1, static=2.0)),
    (Gear, jp.Gear(1e-3, 1e-4, 1e4)),
    (Loop, jp.Loop("rod", "slider", (0.12, 0.0, 0.0))),
    (Payload, jp.Payload("tool", 0.5, 0.1, 0.2, (0.0, 0.0, -0.01))),
    (jp.Motion, jp.Motion(["a", "b"], [0.0, 1.0], [[0.0, 1.0], [2.0, 3.0]], "spline")),
]


@pytest.mark.parametrize(("kind", "value"), VALUES, ids=lambda one: type(one).__name__)
def test_values_are_equal_when_equal_and_shown_as_one_writes_them(kind, value):
    again = schema.read(kind, json.loads(json.dumps(value.describe())))
    assert again == value
    assert hash(again) == hash(value)
    if kind is not jp.Motion:  # which may have thousands of waypoints
        names = vars(jp) | {type(value).__name__: type(value)}
        assert eval(repr(value), names | vars(jp.physics.joints) | vars(jp.contact)) == value


NO_NUMBERS = (True, np.True_, math.nan, math.inf, "one", 10**400)


def _made(law):
    """A law of a kind with whatever number it cannot do without."""
    for one in ({}, {"mass": 1.0}, {"stiffness": 1e8}, {"damping": 1e8}):
        with suppress(jp.JointplayError, TypeError):
            return law(**one)
    return pytest.fail(f"{law} needs more")


EVERY_KIND = [
    *(value for _, value in VALUES),
    *(_made(law) for law in (*NORMAL_LAWS.values(), *FRICTION_LAWS.values())),
    jp.loads.Spring("a", free_length=0.1, stiffness=1e3),
    jp.loads.TorsionSpring("a", stiffness=1.0),
    jp.loads.Stop("a", upper=1.0, stiffness=1e3),
    jp.loads.Wrench("a", force=(1.0, 0.0, 0.0)),
    jp.material("bronze"),
    jp.oil("ISO VG 32"),
]


@pytest.mark.parametrize("value", EVERY_KIND, ids=lambda one: type(one).__name__)
def test_nothing_but_finite_numbers_passes_for_a_number(value):
    for one in dataclasses.fields(value):
        now, kind = getattr(value, one.name), str(one.type)
        vector = isinstance(now, tuple) and now and all(isinstance(n, float) for n in now)
        if not (vector or kind in ("float", "float | None", "<class 'float'>")):
            continue
        for wrong in NO_NUMBERS:
            given = (wrong, *now[1:]) if vector else wrong
            with pytest.raises(jp.JointplayError):
                dataclasses.replace(value, **{one.name: given})


def test_the_example_of_fields_has_a_field_that_may_be_left_out():
    text = textwrap.dedent(schema.__doc__.partition("\n\n")[2].partition("\n\n1. ")[0])
    space = {"dataclass": dataclasses.dataclass, "__name__": __name__, **vars(schema)}
    exec(text, space)
    spring = space["LinearSpring"]
    assert spring().stiffness is None
    assert spring(5).stiffness == 5.0
    stiffness = schema.fields_of(spring)["stiffness"]
    assert stiffness.units == ("N/m",)
    assert not stiffness.required
    with pytest.raises(jp.JointplayError, match="stiffness must be greater than zero"):
        spring(0.0)


def test_a_default_in_the_place_of_a_unit_is_refused():
    with pytest.raises(TypeError, match="units are text"):
        schema.quantity("N/m", None)
    with pytest.raises(TypeError, match="units are text"):
        schema.quantity(default=1.0)


def test_mechanisms_are_equal_when_they_are_built_alike():
    def robot(radial=2e-4):
        joint = jp.RevoluteClearance(radial_clearance=radial, axial_clearance=1e-4)
        return jp.Mechanism(jp.shipped("scara.urdf"), {"joint_b": joint}, gravity=(0, 0, 0))

    assert robot() == robot()
    assert hash(robot()) == hash(robot())
    assert robot() != robot(3e-4)
    assert jp.Mechanism.from_description(robot().describe()) == robot()


def push(delta, ddelta, ddelta0, p):
    return p[0] * delta


@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_a_users_law_that_differs_from_the_one_in_the_result_is_reported():
    described = jp.contact.CustomNormalForce(push, (1e8,)).describe()
    schema.read(NormalForceLaw, described)
    with pytest.warns(RuntimeWarning, match="here differs from the one in the result"):
        schema.read(NormalForceLaw, described | {"source": "def push(): ..."})
