"""The benchmarks' guard names what got worse, and only that."""

import pytest
from cost import guard


def test_ratios_within_their_scatter_are_no_worse():
    baseline = {"step cost over a bare aba": 1.0, "scale: cores, two over one": 1.9}
    assert not guard.worse({"step cost over a bare aba": 1.09}, baseline)
    assert not guard.worse({"scale: cores, two over one": 2.0}, baseline)
    assert not guard.worse({"something new": 9.0}, baseline)


@pytest.mark.parametrize(
    ("name", "before", "now"),
    [
        ("step cost over a bare aba", 1.0, 1.2),
        ("accuracy: dissipated energy", 1e-3, 2e-3),
        ("scale: overhead over a 3 s case", 0.01, 0.04),
        ("scale: cores, two over one", 1.9, 1.5),
        ("start-up: import jointplay", 1.0, 1.5),
    ],
)
def test_what_got_worse_is_named_with_both_numbers(name, before, now):
    (said,) = guard.worse({name: now}, {name: before})
    assert said == f"{name}: {now:.4g}, and was {before:.4g}"


def test_the_baseline_has_every_part_and_no_seconds():
    import json

    known = json.loads(guard.BASELINE.read_text())
    for begin in guard.TOLERATED:
        assert any(name.startswith(begin) for name in known), begin
    assert not any("second" in name or name.endswith("_s") for name in known)
