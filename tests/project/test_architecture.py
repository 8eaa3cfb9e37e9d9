"""The picture and page of the architecture say what the code is."""

import importlib.util
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def drawing():
    """The script that draws the picture."""
    spec = importlib.util.spec_from_file_location("drawing", ROOT / "docs/site/architecture.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_picture_is_that_of_the_code(drawing):
    """Else: python docs/site/architecture.py."""
    assert drawing.PICTURE.read_text(encoding="utf-8") == drawing.picture()


def test_every_package_is_a_room_that_says_what_it_is_for(drawing):
    rooms = drawing.rooms()
    assert {path.parent.name for path in drawing.SOURCE.glob("*/__init__.py")} == set(rooms)
    for room in rooms:
        assert len(drawing.purpose(room).split()) > 5


def test_every_place_that_the_page_names_is_there():
    text = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    places = re.findall(r"`((?:[a-z_]+/)+(?:[a-z_]+\.[a-z]+)?)`", text)
    assert len(places) > 30
    for place in places:
        where = (
            ROOT
            if place.startswith(("tests/", "src/", "urdf/", "docs/"))
            else ROOT / "src/jointplay"
        )
        assert (where / place).exists(), place
