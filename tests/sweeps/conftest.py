"""A small sweep: the SCARA for 20 ms."""

import pytest

import jointplay as jp

SCENARIO = """
[robot]
urdf = "jointplay:scara.urdf"
tool = "suction_cup"
gravity = "balanced"

[joints.joint_b]
radial_clearance = "0.2 mm"
axial_clearance = "0.2 mm"
friction = {{ law = "ambrosio", mu_d = 0.1 }}

[motion]
file = "jointplay:scara_motion.csv"

[integration]
duration = "{duration}"

[sweep]
{options}

[sweep.axes]
{axes}
"""

GRID = """
clearance = { key = "joints.joint_b.radial_clearance", values = [0, "0.1 mm", "0.2 mm"] }
friction = { key = "joints.joint_b.friction.mu_d", from = 0.0, to = 0.1, number = 2 }
"""


@pytest.fixture
def scenario(tmp_path):
    """Write a scenario with a sweep; returns its path."""

    def write(axes=GRID, options="", duration="0.02 s", name="study.toml"):
        path = tmp_path / name
        path.write_text(SCENARIO.format(axes=axes, options=options, duration=duration))
        return path

    return write


@pytest.fixture
def planned(scenario):
    """The plan of such a scenario."""

    def make(axes=GRID, options="", **given):
        from jointplay.sweeps import plan

        return plan(scenario(axes, options), **given)

    return make


@pytest.fixture
def refused(planned):
    """What is said of a sweep that cannot be."""

    def make(axes=GRID, options="", **given):
        with pytest.raises(jp.JointplayError) as error:
            planned(axes, options, **given)
        assert "\n" not in str(error.value)
        return str(error.value)

    return make
