"""Whatever commands are given, they do their work or say in one line why they cannot."""

import tempfile
from pathlib import Path

import pytest
from generators import judge, make

CASES, CHUNK = 300, 30


@pytest.mark.parametrize("first", range(0, CASES, CHUNK))
def test_no_input_brings_a_traceback_or_is_taken_in_silence(first, monkeypatch):
    found = []
    for seed in range(first, first + CHUNK):
        with tempfile.TemporaryDirectory() as folder:
            monkeypatch.chdir(folder)
            case = make(seed, Path(folder))
            outcome = judge(case)
            if outcome:
                found.append(f"{seed} ({case.kind}): {outcome}; {case.arguments}")
    monkeypatch.undo()
    assert not found, "\n".join(found)
