"""The mutation runner: what it changes, and that it tells a killed mutant from a survivor."""

import ast

import pytest
from robustness import mutation

TOY = '''
import math

EPS = 1e-9


def area(radius: float) -> float:
    """Of a circle."""
    if radius < 0.0 or radius > 9.0:
        raise ValueError(f"radius {radius + 1}")
    total = 0.0
    for _ in range(3):
        total += math.sin(radius) * 2.5
    return -total
'''


def test_every_operator_and_number_is_changed_once():
    found = mutation.mutants("toy.py", TOY)
    changes = [mutant.change for mutant in found]
    for expected in ("Lt to GtE", "Gt to LtE", "and/or exchanged", "Add to Sub", "left out",
                     "Mult to Div", "sin to cos", "2.5 to 5.0", "USub left out", "0.0 to 1.0",
                     "9.0 to 18.0"):  # fmt: skip
        assert expected in changes, expected
    assert changes.count("Add to Sub") == 1  # not the one in the error's text
    assert not any("3 to 4" in change or "e-09" in change for change in changes)
    assert len({mutant.text for mutant in found}) == len(found)
    assert named_changes(TOY) == {(mutant.source, mutant.change) for mutant in found}
    for mutant in found:
        ast.parse(mutant.text)
        assert mutant.text != ast.unparse(ast.parse(TOY))
        assert mutant.source in TOY


def named_changes(text):
    """Line and change of all mutants; the text of each would take long to write."""
    lines = text.splitlines()
    return {
        (lines[getattr(node, "lineno", 0) - 1].strip(), change)
        for node in mutation.sites(ast.parse(text))
        for change, _ in mutation.changes(node)
    }


def test_every_target_exists_and_survivors_are_explained_where_they_are():
    for modules, tests in mutation.TARGETS.values():
        for name in modules:
            assert (mutation.PACKAGE / name).exists()
        for name in tests:
            assert (mutation.ROOT / name).exists()
    possible = {}
    for (module, line, change), reason in mutation.explanations().items():
        if module not in possible:
            possible[module] = named_changes((mutation.PACKAGE / module).read_text("utf-8"))
        assert (line, change) in possible[module], (module, line, change)
        assert len(reason) > 20


@pytest.mark.nightly
def test_a_wrong_factor_dies_and_the_same_factor_lives():
    module = "physics/contact/hertzian.py"
    text = (mutation.PACKAGE / module).read_text("utf-8")
    tests = ["tests/physics/contact/test_restitution.py"]
    flores = "lambda c: 1.6 * (1.0 - c) / c,"
    (wrong,) = [
        m for m in mutation.mutants(module, text) if m.source == flores and m.change == "1.6 to 3.2"
    ]
    same = mutation.Mutant(module, 0, "", "nothing", ast.unparse(ast.parse(text)))
    with mutation.copied() as where:
        assert mutation.survives(same, tests, where)
        assert not mutation.survives(wrong, tests, where)


@pytest.mark.nightly
@pytest.mark.parametrize("target", mutation.TARGETS)
def test_mutants_die(target):
    assert mutation.main(["--target", target, "--sample", "60"]) == 0
