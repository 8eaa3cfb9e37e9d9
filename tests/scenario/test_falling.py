"""A robot that nothing holds is warned of, before it falls."""

import pytest

from jointplay.cli import main

SCENARIO = """
[robot]
urdf = "example-robot-data:ur5"
[joints.elbow_joint]
radial_clearance = "0.05 mm"
[integration]
duration = "1 ms"
"""


@pytest.mark.parametrize(
    ("more", "warned"),
    [("", True), ("[drives]\nelbow_joint = 'free'\n", False)],
)
def test_an_arm_that_nothing_holds_is_warned_of(more, warned, tmp_path, capsys):
    (tmp_path / "s.toml").write_text(SCENARIO + more)
    assert main(["check", str(tmp_path / "s.toml"), "--no-picture"]) == 0
    assert ("no motion and no drive: the arm falls" in capsys.readouterr().out) == warned


def test_a_law_that_is_not_the_default_is_named_and_restitution_only_where_it_counts():
    from jointplay.physics.contact import Hertz
    from jointplay.physics.joints import RevoluteClearance
    from jointplay.simulation.values import of_joint

    usual = [*of_joint(RevoluteClearance(radial_clearance=1e-4, axial_clearance=1e-4), ())]
    assert ("restitution", "0.9", False) in usual
    assert not any(field == "normal" for field, *_ in usual)
    elastic = RevoluteClearance(radial_clearance=1e-4, axial_clearance=1e-4, normal=Hertz())
    parts = [*of_joint(elastic, ())]
    assert ("normal", Hertz.name, True) in parts
    assert not any(field == "restitution" for field, *_ in parts)
