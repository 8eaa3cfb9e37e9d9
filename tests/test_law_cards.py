"""The generator of the law cards: what it writes, and that every law has a card."""

import csv
import re
import sys
from pathlib import Path

import numpy as np
import pytest
from pictures import law_cards
from PIL import Image

from jointplay.physics.contact import FILM_LAWS, FRICTION_LAWS, NORMAL_LAWS

ROOT = Path(__file__).resolve().parents[1]
CARDS = ROOT / "docs" / "law_cards"
EVERY = [
    (family, name)
    for family, laws in (("normal", NORMAL_LAWS), ("friction", FRICTION_LAWS), ("film", FILM_LAWS))
    for name in laws
]
CHOSEN = {"normal": "zhang-sharf", "friction": "dahl", "film": "short-bearing"}


def listed(folder):
    """Family and name of the laws that README.md lists, each with a card that is there."""
    found = []
    text = (folder / "README.md").read_text(encoding="utf-8")
    for name, page in re.findall(r"^\| \[`([\w-]+)`\]\((\w+\.md)\)", text, re.MULTILINE):
        assert (folder / page).exists()
        assert (folder / page).with_suffix(".png").exists()
        found.append((page.split("_")[0], name))
    return found


def test_every_law_has_a_card():
    assert listed(CARDS) == EVERY
    assert sum(path.stat().st_size for path in CARDS.iterdir()) < 4e6


@pytest.mark.parametrize(("family", "name"), EVERY, ids=lambda word: word)
def test_card_has_what_the_law_says_of_itself(family, name):
    law = {"normal": NORMAL_LAWS, "friction": FRICTION_LAWS, "film": FILM_LAWS}[family][name]
    page = (CARDS / f"{family}_{name.replace('-', '_')}.md").read_text(encoding="utf-8")
    for text in (law.formula, law.reference, law.validity):
        assert text
        assert text in page


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """Folder of the quick cards of one law of each family."""
    folder = tmp_path_factory.mktemp("cards")
    with pytest.MonkeyPatch.context() as patch:
        words = ["law_cards.py", "--quick", "--jobs", "1", "--out", str(folder)]
        for family, name in CHOSEN.items():
            words += ["--law", f"{family}:{name}"]
        patch.setattr(sys, "argv", words)
        law_cards.main()
    return folder


def rows(folder, family, heading):
    """Cells of the first table after `heading` in a card, by row."""
    name = CHOSEN[family].replace("-", "_")
    text = (folder / f"{family}_{name}.md").read_text(encoding="utf-8")
    lines = text[text.index(heading) :].splitlines()
    first = next(i for i, line in enumerate(lines) if line.startswith("|"))
    cells = []
    for line in lines[first + 2 :]:
        if not line.startswith("|"):
            break
        cells.append([cell.strip().strip("*") for cell in line.strip("|").split("|")])
    return cells


@pytest.mark.thorough
def test_generator_writes_a_card_of_each_family(written):
    assert listed(written) == list(CHOSEN.items())
    for family, name in CHOSEN.items():
        path = written / f"{family}_{name.replace('-', '_')}"
        page = path.with_suffix(".md").read_text(encoding="utf-8")
        for part in (
            "**Reference:**",
            "**Valid for:**",
            "## Alone",
            "## At work",
            "SCARA",
            "arning",
        ):
            assert part in page
        picture = np.asarray(Image.open(path.with_suffix(".png")).convert("RGB"), float)
        height, width, _ = picture.shape
        across = 3 if family == "film" else 2
        for i in range(2):  # every panel has lines in it, and in colour
            for k in range(across):
                panel = picture[
                    i * height // 2 : (i + 1) * height // 2,
                    k * width // across : (k + 1) * width // across,
                ]
                coloured = np.ptp(panel, axis=2) > 60
                assert coloured.sum() > 200, (name, i, k)


@pytest.mark.thorough
def test_normal_card_shows_what_its_law_delivers(written):
    """Zhang and Sharf's delivers what it is asked for, and so must the impacts on the card."""
    found = np.array(rows(written, "normal", "## Alone"), float)
    assert found.shape == (3, 4)
    assert found[:, 1:] == pytest.approx(np.repeat(found[:, :1], 3, axis=1), abs=2e-3)


@pytest.mark.thorough
def test_friction_card_shows_hysteresis(written):
    """Dahl's friction is still that of sliding back when the speed turns its sign."""
    largest, turning, top, lasting = (
        float(row[1]) for row in rows(written, "friction", "## Alone")
    )
    assert (largest, top, lasting) == pytest.approx((0.1, 0.1, 0.1), abs=1e-3)
    assert turning == pytest.approx(-0.1, abs=2e-3)


@pytest.mark.thorough
def test_film_card_agrees_with_ocvirk(written):
    e, number, _, attitude, *_ = np.array(rows(written, "film", "## Alone"), float).T
    root = np.sqrt(1 - e**2)
    exact = root**4 / (np.pi * e * np.sqrt(np.pi**2 * root**2 + 16 * e**2))
    assert number == pytest.approx(exact, rel=2e-3)
    assert attitude == pytest.approx(np.degrees(np.arctan(np.pi * root / (4 * e))), abs=0.06)


@pytest.mark.thorough
def test_data_has_every_run(written):
    with (written / "law_cards.csv").open(encoding="utf-8") as file:
        runs = list(csv.DictReader(file))
    trials = {(run["mechanism"], run["family"], run["law"]) for run in runs}
    assert len(trials) == 2 * 5  # the paper's, three laws, the film's joint without oil
    assert len(runs) == 2 * len(trials)
    assert all(float(run["relative_energy_residual"]) < 0.1 for run in runs)
    peaks = {run["peak_force_N"] for run in runs if run["mechanism"] == "SCARA"}
    assert len(peaks) > len(trials) / 2  # the laws and the seeds do make a difference
