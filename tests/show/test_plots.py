"""Figures, judged by the artists that matplotlib drew."""

from io import BytesIO
from itertools import pairwise

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.colors import to_hex
from warm import call

import jointplay as jp
from jointplay import analysis
from jointplay.paper import scara
from jointplay.physics.geometry import Mode
from jointplay.scenario.reading import parse
from jointplay.scenario.robot import robot_scenario
from jointplay.show import plots
from jointplay.show.plots import figures
from jointplay.show.plots.chart import Axis, Chart, Curve, Panel
from jointplay.show.plots.draw import draw


def shortened(clearance, duration, judge_from=None):
    one = scara(clearance)
    times = {"duration": duration, "judge_from": judge_from}
    return type(one)(one.mechanism, one.motion, **times).run()


@pytest.fixture(scope="module")
def cases():
    return {
        label: shortened(clearance, 0.12)
        for label, clearance in (("ideal", None), ("0.2 mm", 0.2e-3), ("0.5 mm", 0.5e-3))
    }


def figure_of(name, given):
    return draw(figures.CHARTS[name](given))


def colours(axes):
    return [to_hex(line.get_color()) for line in axes.get_lines()]


RED, BLUE, MAGENTA = map(to_hex, ("#D55E00", "#0072B2", "#CC79A7"))


@pytest.mark.parametrize("name", ["tool_displacement", "tool_velocity"])
def test_tool_histories_show_all_cases_in_the_papers_colours(cases, name):
    figure = figure_of(name, cases)
    for row, axis in enumerate("xyz"):
        panel, difference = figure.axes[2 * row], figure.axes[2 * row + 1]
        assert colours(panel) == [RED, BLUE, MAGENTA]
        assert colours(difference) == [BLUE, MAGENTA]
        assert panel.get_ylabel().endswith("[m]" if name == "tool_displacement" else "[m/s]")
        variable = "tool_position" if name == "tool_displacement" else "tool_velocity"
        drawn = panel.get_lines()[1].get_ydata()
        assert np.array_equal(drawn, cases["0.2 mm"][variable].sel(axis=axis))


def test_a_single_runs_overview_shows_its_tool_error(cases):
    from jointplay import analysis

    figure = figure_of("overview", {"0.5 mm": cases["0.5 mm"]})
    titles = [axes.get_title() for axes in figure.axes]
    assert "contact force at joint_b" in titles
    assert "joint_b: the journal tilts,\nits rims touch, its middle does not" in titles
    assert not figure.legends
    error = next(axes for axes in figure.axes if axes.get_ylabel() == "tool error [mm]")
    line, peak = error.get_lines()
    expected = analysis.difference(cases["0.5 mm"], cases["ideal"]).values
    expected = 1e3 * np.linalg.norm(expected, axis=1)
    assert np.allclose(line.get_ydata(), expected, atol=1e-3 * expected.max())
    assert figure.axes[0] is error
    assert error.get_ylim()[0] == 0.0
    ((time,), (size,)) = peak.get_data()
    assert size == pytest.approx(expected.max(), rel=1e-3)
    (words,) = error.texts
    assert words.get_text() == f"peak {size:.3g} mm at {time:.3g} s"


@pytest.mark.thorough
def test_a_tool_on_a_straight_line_has_no_path_and_one_row(coarse, tmp_path):
    import jointplay as jp

    scenario = jp.Scenario.load("jointplay:slider_crank.toml")
    runs = {
        case: scenario.simulation(case, {"integration": {"duration": "0.014 s"}}).run()
        for case in ("ideal", "0.2 mm")
    }
    written = {path.name for path in plots.save(runs, tmp_path)}
    assert "tool_velocity.png" in written
    assert "tool_path.png" not in written
    figure = figure_of("tool_velocity", runs)
    assert [axes.get_ylabel() for axes in figure.axes] == ["velocity x [m/s]", "x - ideal [mm/s]"]
    assert "does not move along y and z" in figure._supxlabel.get_text()


@pytest.mark.parametrize(("number", "smallest"), [(400, 2.0), (30, 4.0)])
def test_points_of_a_bifurcation_can_be_seen(number, smallest):
    from jointplay.show.plots.nonlinear import bifurcation

    values = np.linspace(0.0, 1.0, number)
    samples = np.zeros((number, 3))
    figure = bifurcation(values, samples, "radial clearance [mm]", "force [N]", caption="40 turns")
    (points,) = figure.axes[0].get_lines()
    assert points.get_markersize() >= smallest
    assert figure._supxlabel.get_text() == "40 turns"


def test_a_run_too_short_for_a_spectrum_is_named_in_the_legend(cases):
    short = shortened(0.2e-3, 1e-3)
    for panel in figures.spectrum_panels({"long": cases["0.2 mm"], "short": short}, None):
        names = [mark.name for mark in panel.marks]
        assert names == ["long", "short: too short for a spectrum"]


def test_orbit_stays_near_the_clearance_circle(cases):
    figure = figure_of("journal_orbit", cases)
    assert len(figure.axes) == 4
    for axes, radius in zip(figure.axes[2:], (0.2, 0.5), strict=True):
        ideal, circle, *orbit = axes.get_lines()
        assert np.ptp(ideal.get_data()) == 0.0
        assert to_hex(ideal.get_color()) == RED
        assert np.allclose(np.hypot(*circle.get_data()), radius)
        assert max(np.hypot(*line.get_data()).max() for line in orbit) < 1.1 * radius
        assert "[mm]" in axes.get_xlabel()


@pytest.fixture(scope="module")
def judged():
    """Half a second, of which the first 0.15 s are not judged."""
    return {"ideal": shortened(None, 0.5), "0.2 mm": shortened(2e-4, 0.5, 0.15)}


def test_figure_12_can_be_read_for_the_rims_and_not_for_the_middle(judged):
    """Inside the circle free flight, on it continuous contact, outside penetration."""
    result = judged["0.2 mm"]
    lines = {line.get_label(): line for line in result.plot.rims().axes[0].get_lines()}
    reach = {
        name: np.hypot(*lines[label].get_data()) / 0.2
        for label in lines
        for name in ("free flight", "continuous contact", "pseudo-penetration")
        if label.startswith(name)
    }
    assert len(reach) == 3
    assert reach["free flight"].max() < 1.0
    # The tolerance of 0.1 um is magnified, too.
    assert np.quantile(reach["continuous contact"], 0.9) == pytest.approx(1.0, abs=6e-3)
    assert np.mean(reach["pseudo-penetration"] > 1.0) > 0.98
    # The rims' centres and the journal's, without magnification.
    after = result.time >= result.judge_from
    pressed = result["mode"].values[after, 0] == Mode.PSEUDO_PENETRATION
    rims = np.hypot(*analysis.rim_centres(result, "joint_b")[:, after, :2].T).max(axis=1)
    middle = np.hypot(*result["journal_centre"].values[after, 0, :2].T)
    assert np.mean(rims[pressed] >= 2e-4) > 0.98
    assert np.mean(middle[pressed] >= 2e-4) < 0.02
    half = 0.02 - 2e-4
    apart = np.linalg.norm(np.diff(analysis.rim_centres(result, "joint_b"), axis=0)[0], axis=1)
    assert np.allclose(apart, 2.0 * half)


def test_what_is_not_judged_is_marked(judged):
    for name in ("tool_displacement", "tool_velocity", "force_x"):
        figure = figure_of(name, judged)
        for panel in figure.axes:
            (span,) = panel.patches
            assert span.get_x() == 0.0
            assert span.get_width() == pytest.approx(0.15)
        assert "0.15 s" in figure.get_supxlabel()
    assert "constraint force" in figure_of("force_x", judged).get_supxlabel()
    path = figure_of("tool_path", judged)
    assert "0.15 s" in path.get_supxlabel()


def test_force_figures_show_held_peaks(cases):
    figure = figure_of("force_y", cases)
    assert [colours(axes)[0] for axes in figure.axes] == [RED, BLUE, MAGENTA]
    drawn = figure.axes[2].get_lines()[0].get_ydata()
    peaks = cases["0.5 mm"]["joint_force_peak"].sel(axis="y").values[:, 0]
    assert np.array_equal(drawn, peaks)
    assert figure.axes[0].get_ylabel() == "Fy [N]"


@pytest.mark.thorough
def test_files_are_written_and_not_blank(cases, tmp_path):
    import matplotlib.image

    assert {path.suffix for path in plots.save(cases, tmp_path)} == {".png"}
    written = plots.save(cases, tmp_path, pdf=True)
    assert {path.suffix for path in written} == {".png", ".pdf"}
    for path in written:
        if path.suffix == ".png":
            assert matplotlib.image.imread(path)[..., :3].std() > 0.01
        else:
            assert path.read_bytes().startswith(b"%PDF")


@pytest.fixture
def coarse(monkeypatch):
    """Figures are drawn with few points, and files are empty."""

    def drawn(figure, kind, mark):
        figure.savefig(BytesIO(), dpi=20)
        return b""

    monkeypatch.setattr(figures.files, "drawn", drawn)


@pytest.mark.parametrize("label", [pytest.param("0.2 mm", marks=pytest.mark.thorough), "ideal"])
def test_a_single_case_can_be_drawn_without_orbit_if_it_is_ideal(cases, label, coarse, tmp_path):
    written = {path.name for path in plots.save({label: cases[label]}, tmp_path)}
    assert ("fig12.png" in written) == (label != "ideal")
    assert "fig15.png" in written  # in x and y the arm hardly moves so early


def test_a_result_plots_itself(cases):
    plot = cases["0.2 mm"].plot
    assert {"orbit", "forms", "impacts", "spectrum"} <= set(plot.available)
    for name in plot.available:
        figure = getattr(plot, name)()
        assert any("[" in axes.get_ylabel() + axes.get_xlabel() for axes in figure.axes), name
        assert any(len(axes.get_children()) > 10 for axes in figure.axes), name


def test_plots_go_into_axes_of_ones_own(cases):
    from matplotlib.figure import Figure

    figure = Figure()
    panel = figure.subplots()
    assert cases["0.2 mm"].plot.orbit(ax=panel, color="green") is figure
    assert to_hex("green") in colours(panel)
    played = cases["0.2 mm"]
    error = played.plot.deviation()
    drawn = error.axes[0].get_lines()[0].get_ydata()
    expected = played["tool_position"].values - cases["ideal"]["tool_position"].values
    assert any(np.allclose(drawn, scale * expected[: len(drawn), 0]) for scale in (1.0, 1e3, 1e6))


def test_paper_style_has_serifs_and_its_own_width(cases):
    figure = cases["0.2 mm"].plot.orbit(style="paper")
    assert figure.get_size_inches()[0] < 4.0
    with pytest.raises(ValueError, match="style"):
        cases["0.2 mm"].plot.orbit(style="comic")


def test_a_single_runs_overview_has_the_forces_of_all_its_joints():

    joints = ["elbow_joint", "wrist_1_joint"]
    settings = [parse("integration.duration=2 ms")]
    result = robot_scenario("ur5", joints, settings).simulation("result").run(estimate=False)
    figure = figure_of("overview", {"result": result})
    force = next(axes for axes in figure.axes if axes.get_title() == "contact forces")
    assert [line.get_label() for line in force.get_lines()] == joints
    for line, joint in zip(force.get_lines(), joints, strict=True):
        peak = np.linalg.norm(result["joint_force_peak"].sel(joint=joint).values, axis=1)
        assert np.allclose(line.get_ydata(), peak)
    assert [text.get_text() for text in figure.legends[0].get_texts()] == joints
    shown = {axes.get_title() or axes.get_ylabel(): colours(axes) for axes in figure.axes}
    assert set(shown["tool error against the ideal mechanism"]) == {"#000000"}
    title = "elbow_joint: the journal tilts,"
    (orbit,) = (tones for name, tones in shown.items() if name.startswith(title))
    assert shown["contact forces"][0] in orbit


def test_an_overview_shows_the_error_that_the_first_line_states(tmp_path):
    """From where a servo's arm was sent, not from the ideal arm on the same servos."""
    done = call("run", "so101", "--preset", "--duration", "2 ms", "--no-figures", "--out", tmp_path)
    assert done.returncode == 0, done.stderr
    result = jp.Result.load(tmp_path / "result.nc")
    error = figure_of("overview", {"result": result}).axes[0]
    assert error.get_title() == "tool error from where it was sent"
    line, peak = error.get_lines()
    stated = 1e3 * np.linalg.norm(result.tool_error.reported.values, axis=1)
    assert np.allclose(line.get_ydata(), stated)
    (shown,) = peak.get_ydata()
    assert f"up to {shown:.3g} mm from where it was sent" in str(result.tool_error)
    assert shown > 2.0 * 1e3 * result.tool_error.peak


def test_an_ideal_run_has_no_orbit_to_plot(cases):
    assert "orbit" not in cases["ideal"].plot.available
    with pytest.raises(ValueError, match="clearance"):
        cases["ideal"].plot.orbit()


def test_names_that_begin_with_an_underscore_stand_in_the_legend(cases):
    named = {f"_{label}": result for label, result in cases.items()}
    for name in ("tool_displacement", "overview"):
        texts = [text.get_text().strip() for text in figure_of(name, named).legends[0].get_texts()]
        assert len(texts) >= 2
        assert set(texts) <= set(named)


@pytest.mark.parametrize("number", [2, 5, 6])
def test_legends_are_read_in_the_order_of_the_cases(number):
    names = [f"case {i}" for i in range(number)]
    panel = Panel(Axis("x"), Axis("y"), [Curve([0, 1], [0, 1], name) for name in names])
    figure = draw(Chart([[panel]], (8.0, 4.0), key=3))
    figure.canvas.draw()
    places = []
    for text in figure.legends[0].get_texts():
        box = text.get_window_extent()
        places.append((-round(box.y0), box.x0, text.get_text()))
    assert [name for *_, name in sorted(places)] == names


@pytest.mark.thorough
def test_ticks_of_orbits_do_not_overlap_however_small(cases):
    figure = figure_of("journal_orbit", {f"{i}": cases["0.2 mm"] for i in range(6)})
    figure.canvas.draw()
    for panel in figure.axes:
        boxes = [
            label.get_window_extent()
            for label in panel.get_xticklabels()
            if label.get_visible() and label.get_text()
        ]
        inside = sorted((box.x0, box.x1) for box in boxes)
        assert all(right <= left for (_, right), (left, _) in pairwise(inside))


def test_letters_that_the_usual_typeface_has_not_come_from_one_that_is_installed(monkeypatch):
    from matplotlib import font_manager

    from jointplay.show.plots import style as module

    monkeypatch.setattr(font_manager, "get_font_names", lambda: ["DejaVu Sans", "PingFang SC"])
    module._fallbacks.cache_clear()
    with module.style("screen"):
        assert mpl.rcParams["font.family"] == ["sans-serif", "PingFang SC"]
    module._fallbacks.cache_clear()
    monkeypatch.undo()
    with module.style("paper"):
        assert mpl.rcParams["font.family"][0] == "STIXGeneral"
    module._fallbacks.cache_clear()
