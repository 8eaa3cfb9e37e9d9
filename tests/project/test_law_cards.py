"""Law cards: every law has one, and what the benchmark measures for them."""

import io
import runpy
import sys
from pathlib import Path

import numpy as np
import pytest
from pictures import laws
from PIL import Image

from jointplay.physics.contact import FILM_LAWS, FRICTION_LAWS, NORMAL_LAWS

Cards = runpy.run_path(str(Path(__file__).parents[2] / "docs" / "site" / "law_cards.py"))["Cards"]
EVERY = [
    (family, name)
    for family, laws in (("normal", NORMAL_LAWS), ("friction", FRICTION_LAWS), ("film", FILM_LAWS))
    for name in laws
]
CHOSEN = {"normal": "zhang-sharf", "friction": "dahl", "film": "short-bearing"}


@pytest.fixture(scope="module")
def kept():
    """The documentation's."""
    return Cards()


def test_every_law_has_a_card(kept):
    assert list(kept.laws) == EVERY
    index = kept.index()
    assert all(f"]({family}_{name.replace('-', '_')}.md)" in index for family, name in EVERY)


@pytest.mark.parametrize(("family", "name"), EVERY, ids=lambda word: word)
def test_card_has_what_the_law_says_of_itself(kept, family, name):
    law = {"normal": NORMAL_LAWS, "friction": FRICTION_LAWS, "film": FILM_LAWS}[family][name]
    page = kept.page(family, name)
    for text in (law.formula, law.reference, law.validity, "## In mechanisms", "SCARA", "arning"):
        assert text
        assert text in page


@pytest.mark.parametrize("family", CHOSEN)
def test_every_panel_has_coloured_lines(kept, family):
    drawn = Image.open(io.BytesIO(kept.picture(family, CHOSEN[family]))).convert("RGB")
    picture = np.asarray(drawn, float)
    across = 3 if family == "film" else 2
    for k, panel in enumerate(np.array_split(picture, across, axis=1)):
        assert (np.ptp(panel, axis=2) > 60).sum() > 200, k


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """Quick cards of one law of each family."""
    folder = tmp_path_factory.mktemp("cards")
    with pytest.MonkeyPatch.context() as patch:
        words = ["laws.py", "--quick", "--jobs", "1", "--out", str(folder)]
        for family, name in CHOSEN.items():
            words += ["--law", f"{family}:{name}"]
        patch.setattr(sys, "argv", words)
        laws.main()
    return Cards(folder / "law_cards.json")


def rows(cards, family):
    """Cells of the table of a law alone, by row."""
    return cards.laws[family, CHOSEN[family]]["table"][1:]


@pytest.mark.thorough
def test_benchmark_writes_a_card_of_each_family(written):
    assert list(written.laws) == list(CHOSEN.items())
    files = dict(written.files())
    assert len(files) == 1 + 2 * len(CHOSEN)
    assert "zhang-sharf" in files["README.md"]


@pytest.mark.thorough
def test_normal_card_shows_what_its_law_delivers(written):
    """Zhang and Sharf's delivers what it is asked for, and so must the impacts on the card."""
    found = np.array(rows(written, "normal"), float)
    assert found.shape == (3, 4)
    assert found[:, 1:] == pytest.approx(np.repeat(found[:, :1], 3, axis=1), abs=2e-3)


@pytest.mark.thorough
def test_friction_card_shows_hysteresis(written):
    """Dahl's friction is still that of sliding back when the speed turns its sign."""
    largest, turning, top, lasting = (float(row[1]) for row in rows(written, "friction"))
    assert (largest, top, lasting) == pytest.approx((0.1, 0.1, 0.1), abs=1e-3)
    assert turning == pytest.approx(-0.1, abs=2e-3)


@pytest.mark.thorough
def test_film_card_agrees_with_ocvirk(written):
    e, number, _, attitude, *_ = np.array(rows(written, "film"), float).T
    root = np.sqrt(1 - e**2)
    exact = root**4 / (np.pi * e * np.sqrt(np.pi**2 * root**2 + 16 * e**2))
    assert number == pytest.approx(exact, rel=2e-3)
    assert attitude == pytest.approx(np.degrees(np.arctan(np.pi * root / (4 * e))), abs=0.06)


@pytest.mark.thorough
def test_data_has_every_run(written):
    trials = written.data["trials"]
    assert len(trials) == 2 * 5  # the paper's, three laws, the film's joint without oil
    for trial in trials:
        assert {len(values) for values in trial["figures"].values()} == {2}
        assert max(trial["figures"]["relative_energy_residual"]) < 0.1
    peaks = {
        peak
        for trial in trials
        if trial["mechanism"] == "SCARA"
        for peak in trial["figures"]["peak_force_N"]
    }
    assert len(peaks) > len(trials) / 2  # the laws and the seeds do make a difference
