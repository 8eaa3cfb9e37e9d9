"""Numbers of things in words."""

import pytest

from jointplay.base.words import counted


@pytest.mark.parametrize(
    ("number", "words"), [(0, "0 blocks"), (1, "1 block"), ("1", "1 block"), ("1.2", "1.2 blocks")]
)
def test_one_thing_is_singular(number, words):
    assert counted(number, "block") == words


def test_a_plural_can_be_given():
    assert counted(2, "mesh", "meshes") == "2 meshes"
