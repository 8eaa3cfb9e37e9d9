import importlib
import sys

import pytest

from jointplay.moved import MOVED


@pytest.mark.parametrize("old", sorted(MOVED))
def test_a_module_is_still_found_under_its_old_name_with_a_notice(old):
    sys.modules.pop(old, None)
    with pytest.warns(DeprecationWarning, match=MOVED[old].replace(".", r"\.")):
        module = importlib.import_module(old)
    assert module is importlib.import_module(MOVED[old])


def test_names_that_never_were_are_not_found():
    with pytest.raises(ModuleNotFoundError):
        importlib.import_module("jointplay.nowhere")
