"""What the public functions and classes say of an argument of the wrong kind."""

import enum
import inspect
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import jointplay as jp
from jointplay.base.errors import require_a

FUNCTIONS = [
    name
    for name in sorted(jp.__all__)
    if inspect.isfunction(getattr(jp, name)) and inspect.signature(getattr(jp, name)).parameters
]
CALLS = {
    **{name: getattr(jp, name) for name in FUNCTIONS},
    **{name: getattr(jp, name) for name in ("Simulation", "Run", "Motion", "Result", "Recording")},
    "Scenario.load": jp.Scenario.load,
    "Result.load": jp.Result.load,
    "Result.open": jp.Result.open,
}


@pytest.mark.parametrize("name", CALLS)
@pytest.mark.parametrize("value", [3, np.nan, object(), None], ids=["int", "nan", "object", "None"])
def test_a_first_argument_of_the_wrong_kind_is_named(name, value):
    call = CALLS[name]
    first, *others = inspect.signature(call).parameters.values()
    if value is None and "None" in str(first.annotation):
        pytest.skip("can be left out")
    needed = {one.name: 3 for one in others if one.default is one.empty and one.kind < 4}
    with pytest.raises(jp.JointplayError) as caught:
        call(value, **{key: given for key, given in needed.items() if key != "options"})
    assert first.name in str(caught.value)
    assert "must be" in str(caught.value)


def test_text_is_no_list_of_names_and_no_mechanism():
    for call, place in ((jp.budget, "mechanism"), (jp.reduce, "mechanism"), (jp.ensemble, "sim")):
        with pytest.raises(jp.JointplayError, match=f"{place}.* must be .* not 'joint_b'"):
            call("joint_b", "joint_b") if call is not jp.ensemble else call("joint_b")


@pytest.mark.parametrize("settings", ["a=1", 3, ["a=1"], [3]])
def test_settings_are_not_text(settings):
    with pytest.raises(jp.JointplayError, match=r"setting.* must be"):
        jp.Scenario.load(jp.shipped("scara.toml"), settings=settings)


@pytest.mark.parametrize(
    ("call", "wrong", "meant"),
    [
        (partial(jp.simulate, None), "progres", "progress"),
        (jp.budget, "forse", "force"),
        (jp.allocate, "targt", "target"),
        (jp.RevoluteClearance, "radial", "radial_clearance"),
        (jp.Gear, "backlash", "play"),
        (jp.Mechanism, "gravty", "gravity"),
        (jp.contact.Flores, "resttution", ""),
        (jp.Scenario, "pth", "path"),
        (jp.Motion.from_csv, "pat", "path"),
        (jp.Result.load, "evry", "every"),
        (jp.Simulation.resume, "pth", "path"),
        (jp.Run, "simulatoin", "simulation"),
        (partial(jp.play, {}), "jont", "joint"),
    ],
)
def test_a_wrong_keyword_is_answered_with_the_nearest_as_in_a_file(call, wrong, meant):
    with pytest.raises(jp.JointplayError, match=f'unknown key "{wrong}" of ') as caught:
        call(**{wrong: 1})
    assert (f'did you mean "{meant}"?' in str(caught.value)) == bool(meant)


def _made_by_users():
    """Functions, classes and class methods of the package's first level."""
    for name in sorted(jp.__all__):
        made = getattr(jp, name)
        if inspect.isfunction(made) and len(inspect.signature(made).parameters) > 1:
            yield name, made
        if inspect.isclass(made) and not issubclass(made, BaseException | enum.Enum):
            if made is not jp.Cause:  # only a protocol of what has its name
                yield name, made
            methods = [key for key, method in vars(made).items() if type(method) is classmethod]
            yield from ((f"{name}.{key}", getattr(made, key)) for key in sorted(methods))


@pytest.mark.parametrize(("name", "made"), list(_made_by_users()))
def test_whatever_a_user_calls_answers_a_wrong_keyword(name, made):
    if inspect.getfullargspec(made).varkw:
        pytest.skip("hands keywords on")
    with pytest.raises(jp.JointplayError, match=r'unknown key "zzz" of .*; valid keys: '):
        made(zzz=1)


def test_what_fits_is_accepted():
    require_a("path", Path("a"), "str", "Path")
    require_a("path", "a", "str", "Path")
    require_a("names", ["a"], "Iterable")
    require_a("names", np.zeros(2), "Iterable")
    require_a("table", {"a": 1}, "Mapping")
    require_a("law", jp.contact.Flores(), "LankaraniNikravesh", "Flores")
    with pytest.raises(jp.JointplayError, match="names must be a list of them, not 'a'"):
        require_a("names", "a", "Iterable")
