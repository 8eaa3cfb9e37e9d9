"""Tables [sweep]: the plans they describe, and the errors of those that are wrong."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import jointplay as jp
from jointplay.study import plan_of, sweeps
from jointplay.study.axes import DISTRIBUTIONS, GROWING, METHODS, points, read
from jointplay.study.keys import path_of, set_key, units_of

MU = "joints.joint_b.friction.mu_d"
CR = "joints.joint_b.radial_clearance"


def test_a_grid_has_a_case_for_every_combination_of_values(planned):
    made = planned()
    assert made.sizes == {"clearance": 3, "friction": 2}
    cases = [made.values(index) for index in np.ndindex(*made.shape)]
    assert len(cases) == made.count == 6
    assert cases[3] == {"clearance": 1e-4, "friction": 0.1}
    assert made.changes((2, 1)) == {
        "joints": {"joint_b": {"radial_clearance": "0.2 mm", "friction": {"mu_d": 0.1}}}
    }


@pytest.mark.parametrize("zero", ["0", "0.0", '"0 mm"', '"0.0 um"', "-0.0"])
def test_a_clearance_of_zero_is_the_ideal_joint_however_it_is_written(zero, planned):
    made = planned(f'c = {{ key = "{CR}", values = [{zero}, "0.1 mm"] }}')
    ideal = {"joints": {"joint_b": {"ideal": True}}}
    found, wanted = (
        made.scenario.simulation(made.case, changes) for changes in (made.changes((0,)), ideal)
    )
    assert found.mechanism == wanted.mechanism
    assert not found.mechanism.clearance


def test_ranges_have_units_and_go_by_equal_steps_or_ratios(planned):
    made = planned(
        f'c = {{ key = "{CR}", from = "0.1 mm", to = "0.4 mm", number = 3, spacing = "log" }}\n'
        'duration = { key = "integration.duration", from = "10 ms", to = "30 ms", number = 3 }'
    )
    clearance, duration = made.axes
    np.testing.assert_allclose(clearance.coordinate, [1e-4, 2e-4, 4e-4])
    np.testing.assert_allclose(duration.coordinate, [0.01, 0.02, 0.03])
    assert (clearance.unit, duration.unit) == ("m", "s")


def test_one_axis_can_set_several_keys(planned):
    keys = f'["{CR}", "joints.joint_b.axial_clearance"]'
    made = planned(f'c = {{ keys = {keys}, values = ["0.1 mm", "0.3 mm"] }}')
    joint = made.scenario.simulation(made.case, made.changes((1,))).mechanism.clearance["joint_b"]
    assert joint.radial_clearance == joint.axial_clearance == 3e-4


def test_variants_change_whole_tables_by_label(planned):
    made = planned(
        'law.variants.hertz.joints.joint_b = { normal = "hertz" }\n'
        'law.variants.ln.joints.joint_b = { normal = "lankarani-nikravesh" }'
    )
    assert list(made.axes[0].coordinate) == ["hertz", "ln"]
    joint = made.scenario.simulation(made.case, made.changes((0,))).mechanism.clearance["joint_b"]
    assert joint.normal.name == "hertz"


def test_words_take_turns_as_well(planned):
    made = planned('gravity = { key = "robot.gravity", values = ["balanced", "loaded", [0,0,-1]] }')
    assert [str(v) for v in made.axes[0].coordinate] == ["balanced", "loaded", "[0, 0, -1]"]


def test_repeats_displace_the_journals_by_seeds_of_their_own(planned):
    made = planned(options="repeats = 3\nseed = 7")
    seeds = [made.changes((0, 0, k))["integration"]["seed"] for k in range(3)]
    assert seeds == [7, 8, 9]


def test_samples_are_a_dimension_whatever_their_number_of_distributions(planned):
    made = planned(
        f'c = {{ key = "{CR}", distribution = "normal", mean = "0.2 mm", std = "0.02 mm" }}\n'
        f'mu = {{ key = "{MU}", distribution = "uniform", from = 0.05, to = 0.15 }}',
        "samples = 512",
    )
    assert made.sizes == {"sample": 512}
    clearance, friction = made.drawn_values.T
    assert clearance.mean() == pytest.approx(2e-4, rel=1e-3)
    assert clearance.std() == pytest.approx(2e-5, rel=0.02)
    assert friction.min() > 0.05
    assert friction.max() < 0.15


def test_elements_of_lists_are_counted_from_one():
    assert path_of("payloads[2].mass") == ("payloads", 1, "mass")
    changes = {}
    set_key(changes, {"payloads": [{"mass": 1}, {"mass": 2}]}, ("payloads", 1, "mass"), 5)
    assert changes == {"payloads": [{"mass": 1}, {"mass": 5}]}
    with pytest.raises(jp.JointplayError, match="has 1 of them"):
        set_key({}, {"payloads": [{"mass": 1}]}, ("payloads", 1, "mass"), 5)


def test_a_key_of_a_law_that_is_a_word_keeps_the_law():
    changes = {}
    base = {"joints": {"b": {"friction": "ambrosio"}}}
    set_key(changes, base, ("joints", "b", "friction", "mu_d"), 0.2)
    assert changes == {"joints": {"b": {"friction": {"law": "ambrosio", "mu_d": 0.2}}}}


@pytest.mark.parametrize(
    ("key", "units"),
    [
        (CR, ("m",)),
        (MU, ("",)),
        ("motion.speeds.crank", ("rad/s", "m/s")),
        ("payloads[1].mass", ("kg",)),
        ("drives.a.bandwidth", ("rad/s",)),
        ("robot.gravity", None),
    ],
)
def test_units_of_a_key_are_those_of_the_scenario(key, units):
    assert units_of(path_of(key)) == units


@pytest.mark.parametrize(
    ("axes", "options", "words"),
    [
        ("", "", "the sweep is empty"),
        (f'c = {{ key = "{CR}", values = [] }}', "", "give a list of at least one"),
        ('a = { key = "integration.step", values = [1e-5] }\nb = 3', "",
         "study.toml, line 23, sweep.axes.b: 3 is not an axis"),
        ('m = { key = "payloads[0].mass", values = [0, 1] }', "",
         "counted from 1; the first is payloads[1]"),
        ('c = { key = "joints.joint_b.radial_clearence", values = [1] }', "",
         'did you mean "radial_clearance"?'),
        ('c = { key = "integratoin.step", values = [1] }', "", 'did you mean "integration"?'),
        ('c = { key = "joints.joint_b.friction.mu_dd", values = [1] }', "", 'did you mean "mu_d"?'),
        (f'c = {{ kye = "{CR}", values = [1] }}', "", 'did you mean "key"?'),
        (f'c = {{ key = "{CR}", values = [1], from = 2 }}', "", "needs one of"),
        (f'c = {{ key = "{CR}", values = [1], number = 2 }}', "", "number and values exclude"),
        (f'c = {{ key = "{CR}", values = ["1 s"] }}', "", "is not a length"),
        (f'c = {{ key = "{CR}", values = ["0.1 mm", 1e-4] }}', "", "is given twice"),
        (f'c = {{ key = "{CR}", from = 1, to = 2 }}', "", "number must be a whole number"),
        (f'c = {{ key = "{CR}", from = 1, to = 1, number = 3 }}', "", "from and to are both 1"),
        (f'c = {{ key = "{CR}", from = 0, to = 1, number = 3, spacing = "log" }}', "",
         "spacing log needs"),
        (f'c = {{ key = "{CR}", from = 0, to = 1, number = 3, spacing = "lin" }}', "",
         "available: linear, log"),
        (f'c = {{ key = "{CR}", distribution = "gauss" }}', "", "no distribution"),
        (f'c = {{ key = "{CR}", distribution = "normal", mean = 1 }}', "samples = 4",
         "the key std is missing"),
        (f'c = {{ key = "{CR}", distribution = "uniform", from = 2, to = 1 }}', "samples = 4",
         "from must be less than to"),
        (f'c = {{ key = "{CR}", distribution = "uniform", from = 1, to = 2 }}', "",
         "samples is missing"),
        (f'c = {{ key = "{CR}", values = [1] }}', "samples = 4", "there is none"),
        (f'c = {{ key = "{CR}", values = [1] }}\nd = {{ key = "{CR}", values = [2] }}', "",
         '"c" and "d" contradict each other'),
        (f'c = {{ key = "{CR}", values = [1] }}\nd = {{ key = "joints.joint_b", values = [{{}}] }}',
         "", "contradict each other: both set joints.joint_b"),
        ('s = { key = "integration.seed", values = [1, 2] }', "repeats = 2", "repeats sets"),
        (f'sample = {{ key = "{CR}", values = [1] }}', "", "cannot be called"),
        (f'c = {{ key = "{CR}", values = [1] }}', "repeat = 2", 'did you mean "repeats"?'),
        (f'c = {{ key = "{CR}", values = [1] }}', "repeats = 0", "whole number from 1"),
        (f'c = {{ key = "{CR}", values = [1] }}', 'sampling = "lhs"', "available: sobol"),
        (f'c = {{ key = "{CR}", values = [1] }}', 'case = "x"', "no case 'x'"),
        (f'c = {{ key = "{CR}", values = [1] }}', 'measures = ["a.b"]', "named module:function"),
        (f'c = {{ key = "{CR}", distribution = "uniform", from = 1, to = 2 }}',
         'samples = 4\nsampling = "latin-hypercube"\n'
         'until = { measure = "peak_force", precision = 0.1 }', "latin-hypercube cannot"),
        (f'c = {{ key = "{CR}", distribution = "uniform", from = 1, to = 2 }}',
         'samples = 5\nsampling = "saltelli"', "power of two"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_said_in_a_line_with_its_place(axes, options, words, unplannable):
    said = unplannable(axes, options)
    assert words in said
    assert "study.toml" in said


def test_samples_grow_without_those_there_are_changing():
    for method in GROWING:
        few, many = (points(method, n, 3, 5) for n in (8, 32))
        np.testing.assert_array_equal(many[: len(few)], few)


@given(st.sampled_from(METHODS), st.integers(0, 5), st.integers(1, 4), st.integers(0, 2**40))
def test_points_lie_inside_the_cube_and_are_the_same_again(method, power, dimensions, seed):
    found = points(method, 2**power, dimensions, seed)
    np.testing.assert_array_equal(found, points(method, 2**power, dimensions, seed))
    assert found.shape[1] == dimensions
    assert ((found > 0.0) & (found < 1.0)).all()


def test_latin_hypercubes_have_one_sample_in_every_slice():
    found = points("latin-hypercube", 50, 3, 1)
    for column in found.T:
        assert sorted(np.floor(50 * column)) == list(range(50))


WIDTHS = {
    "uniform": ({"from": 1.0, "to": 3.0}, 2.0, np.sqrt(4 / 12)),
    "log-uniform": ({"from": 1.0, "to": np.e}, np.e - 1.0, None),
    "normal": ({"mean": 5.0, "std": 2.0}, 5.0, 2.0),
    "lognormal": ({"median": 1.0, "sigma": 0.5}, np.exp(0.125), None),
    "triangular": ({"from": 0.0, "mode": 0.0, "to": 3.0}, 1.0, None),
    "fit": ({"key": CR, "fit": "20H7/g6"}, 12e-6, 0.5e-6 * np.sqrt((21**2 + 13**2) / 12)),
}


@pytest.mark.parametrize("kind", DISTRIBUTIONS)
def test_distributions_have_the_mean_and_width_that_textbooks_give(kind):
    words, mean, std = WIDTHS[kind]
    axis = read("c", {"key": MU, "distribution": kind} | words)
    values = axis.quantile((np.arange(20000) + 0.5) / 20000)
    assert values.mean() == pytest.approx(mean, rel=2e-3)
    if std is not None:
        assert values.std() == pytest.approx(std, rel=2e-3)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ({"key": CR}, "the key fit is missing"),
        ({"key": CR, "fit": "20g6/H7"}, "has its shaft first"),
        ({"key": CR, "fit": "20H7/p6"}, "interference fit"),
        ({"key": CR, "fit": "20H7/g6", "from": 0}, "from does not go with fit; it takes fit"),
        ({"key": MU, "fit": "20H7/g6"}, "of a fit are lengths, but the key takes no length"),
    ],
)
def test_a_fit_that_cannot_be_drawn_from_is_refused(words, said):
    with pytest.raises(jp.JointplayError, match=said):
        read("c", {"distribution": "fit"} | words)


def test_a_normal_distribution_can_be_cut_off():
    words = {"distribution": "normal", "mean": 0, "std": 1, "from": -1, "to": 2}
    values = read("c", {"key": MU, **words}).quantile(np.array([1e-9, 1 - 1e-9]))
    np.testing.assert_allclose(values, [-1.0, 2.0], atol=1e-6)


def test_what_a_sweep_is_changes_with_everything_that_changes_its_results(planned):
    same = planned().identity
    assert planned().identity == same
    for options in ("repeats = 2", "seed = 1", 'start = "1 ms"'):
        assert planned(options=options).identity != same
    assert planned('c = { key = "integration.step", values = [1e-5] }').identity != same


@pytest.mark.parametrize(
    ("axes", "said"),
    [
        (
            'law = { key = "joints.joint_b.friction.law", values = ["ambrosio", "coulmb"] }',
            r"axis 'law' cannot take \"coulmb\": joints.joint_b.friction.law: no friction law "
            r'"coulmb"; did you mean "coulomb"\? available: ambrosio,',
        ),
        (f'c = {{ key = "{CR}", from = -1e-4, to = 1e-4, number = 3 }}', "'c' cannot take -0.0001"),
        (f'c = {{ key = "{CR}", values = ["0.1 mm", "50 mm"] }}', 'cannot take "50 mm".*no room'),
        ("v.variants.none = {}\nv.variants.heavy.payloads = [{ mass = -1 }]", "cannot take heavy"),
    ],
)
def test_a_value_that_no_case_can_take_is_refused_before_anything_runs(
    axes, said, swept, tmp_path, monkeypatch
):
    monkeypatch.setattr(sweeps, "workers_for", lambda *_: pytest.fail("a case was to run"))
    with pytest.raises(jp.JointplayError, match=said):
        jp.sweep(swept(axes), tmp_path / "s")
    assert not (tmp_path / "s").exists()


def test_a_sample_that_no_case_can_take_is_refused_with_its_number(swept, tmp_path):
    axes = f'c = {{ key = "{CR}", distribution = "normal", mean = 1e-4, std = 1e-4 }}'
    with pytest.raises(jp.JointplayError, match=r"cannot take -\S+ m: .*of 8; from and to"):
        jp.sweep(swept(axes, "samples = 8"), tmp_path / "s")


def test_a_value_that_some_case_can_take_is_left_to_the_cases(swept):
    axes = (
        f'c = {{ key = "{CR}", values = ["0.1 mm", "12 mm"] }}\n'
        'r = { key = "joints.joint_b.bearing_radius", values = ["10 mm", "40 mm"] }'
    )
    sweeps.probe(plan_of(swept(axes)))


def test_a_payload_of_zero_is_no_payload(planned, tmp_path):
    made = planned(
        "m.variants.none = {}\n"
        'm.variants.zero.payloads = [{ mass = "0 kg" }]\n'
        'm.variants.one.payloads = [{ mass = "1 kg" }]'
    )
    none, zero, one = (made.scenario.simulation(made.case, made.changes((k,))) for k in range(3))
    assert zero.payloads == none.payloads == ()
    assert [payload.mass for payload in one.payloads] == [1.0]
    assert "payload 1 has a mass of 0 kg: there is none" in made.scenario.notes
    with pytest.raises(jp.JointplayError, match="a payload of 0 kg is none, and has no inertia"):
        jp.Payload("tool", 0.0, inertia=(1.0, 1.0, 1.0))
