"""Units of co-simulation through FMPy, against the run itself, bit for bit."""

from contextlib import suppress
from dataclasses import replace

import numpy as np
import pytest
from conftest import needed

import jointplay as jp
from jointplay import bridges
from jointplay.bridges.fmu import Inputs, with_torques
from jointplay.cli import main

pytestmark = needed("fmpy", "pythonfmu3")
import fmpy  # noqa: E402 - skipped without it

MS = 1e-3


@pytest.fixture(scope="module")
def result():
    simulation = jp.Scenario.load("jointplay:scara.toml").simulation("0.2 mm")
    return replace(simulation, duration=0.05, macro_step=1e-4).run(estimate=False)


@pytest.fixture(scope="module")
def unit(result, tmp_path_factory):
    return bridges.export(result, tmp_path_factory.mktemp("fmu") / "scara.fmu")


class Opened:
    """A unit that is instantiated and initialised."""

    def __init__(self, path, folder):
        from fmpy.fmi3 import FMU3Slave

        self.description = fmpy.read_model_description(path)
        self.numbers = {v.name: v.valueReference for v in self.description.modelVariables}
        place = fmpy.extract(path, unzipdir=folder)
        self.fmu = FMU3Slave(
            guid=self.description.guid,
            unzipDirectory=place,
            modelIdentifier=self.description.coSimulation.modelIdentifier,
            instanceName="one",
        )
        self.fmu.instantiate(loggingOn=True)
        self.fmu.enterInitializationMode(startTime=0.0)
        self.fmu.exitInitializationMode()

    def get(self, *names):
        return self.fmu.getFloat64([self.numbers[name] for name in names])

    def set(self, name, value):
        self.fmu.setFloat64([self.numbers[name]], [value])

    def step(self, k, size=MS):
        self.fmu.doStep(currentCommunicationPoint=k * size, communicationStepSize=size)

    def close(self):
        self.fmu.terminate()
        self.fmu.freeInstance()


@pytest.fixture
def opened(unit, tmp_path):
    made = Opened(unit, tmp_path / "unit")
    yield made
    made.close()


SEEN = ("joint_b.link.position", "joint_b.link.speed", "tool.x", "tool.y", "joint_b.force.x")


def test_the_description_is_valid_and_says_what_it_needs(unit):
    found = fmpy.read_model_description(unit, validate=True)
    assert found.fmiVersion == "3.0"
    assert "Python with jointplay" in found.description
    units = {v.name: v.unit for v in found.modelVariables}
    assert units["joint_b.motor.position"] == "rad"
    assert units["stroke.link.speed"] == "m/s"
    assert units["joint_b.force.z"] == "N"
    assert found.coSimulation.canGetAndSetFMUstate
    assert found.coSimulation.canSerializeFMUstate
    assert found.coSimulation.needsExecutionTool


def test_a_unit_goes_as_the_run_does_bit_for_bit(opened, result):
    time = result.time
    q = result["q"]
    tool = result["tool_position"].values
    for k in range(20):
        opened.step(k)
        row = int(np.argmin(np.abs(time - (k + 1) * MS)))
        assert time[row] == pytest.approx((k + 1) * MS, abs=1e-9)
        position, x, y = opened.get("joint_b.link.position", "tool.x", "tool.y")
        assert position == float(q.values[row, list(q["coordinate"].values).index("joint_b.yaw")])
        assert (x, y) == pytest.approx(tuple(tool[row, :2]), abs=1e-15)


def test_a_state_is_restored_and_the_same_follows(opened):
    for k in range(5):
        opened.step(k)
    state = opened.fmu.getFMUState()
    kept = opened.fmu.serializeFMUState(state)
    seen = []
    for k in range(5, 9):
        opened.step(k)
        seen.append(opened.get(*SEEN))
    for back in (state, opened.fmu.deserializeFMUState(kept)):
        opened.fmu.setFMUState(back)
        again = []
        for k in range(5, 9):
            opened.step(k)
            again.append(opened.get(*SEEN))
        assert again == seen


def test_torques_from_outside_are_those_of_a_controller(result, tmp_path):
    simulation = with_torques(result.simulation, MS)
    path = bridges.export(result, tmp_path / "t.fmu", inputs="torque", period="1 ms")
    made = Opened(path, tmp_path / "unit")
    run = jp.Run(simulation)
    run.begin()
    own = Inputs.newest
    joints = simulation.loads["fmu_inputs"].joints
    for k in range(8):
        torque = 2.0 * np.sin(0.5 * k)
        made.set("joint_b.torque", torque)
        own.values[0, joints.index("joint_b")] = torque
        made.step(k)
        run.advance(round(MS / simulation.step))
        assert made.get("joint_b.link.position")[0] == run.moment().position("joint_b")
    plain = jp.Run(result.simulation)
    plain.begin()
    plain.advance(run.workspace.steps)
    assert abs(plain.moment().speed("joint_b") - run.moment().speed("joint_b")) > 1e-3
    made.close()


def test_references_from_outside_are_followed(result, tmp_path):
    path = bridges.export(result, tmp_path / "r.fmu", inputs="reference", period="0.5 ms")
    made = Opened(path, tmp_path / "unit")
    begin = made.get("joint_a.link.position", "joint_b.link.position")
    assert made.get("joint_a.reference.position")[0] == begin[0]
    way, off = 0.02, []
    for k in range(45):
        part = (k + 1) / 45
        made.set("joint_a.reference.position", begin[0] + way * part**2 * (3 - 2 * part))
        made.set("joint_a.reference.speed", way * 6 * part * (1 - part) / 0.045)
        made.step(k)
        off.append(made.get("joint_b.link.position")[0] - begin[1])
    # Bandwidth 100 rad/s: what is left of the way after half of a time constant at rest.
    assert made.get("joint_a.link.position")[0] == pytest.approx(begin[0] + way, abs=0.1 * way)
    assert np.abs(off).max() < 0.1 * way
    made.close()


def test_references_of_loops_are_refused(tmp_path):
    simulation = jp.Scenario.load("jointplay:four_bar.toml").simulation("ideal")
    run = replace(simulation, duration=1e-3).run(estimate=False)
    with pytest.raises(jp.JointplayError, match="without loops"):
        bridges.export(run, tmp_path / "a.fmu", inputs="reference")


@pytest.mark.parametrize("size", [1.5e-5, 1e-6])
def test_steps_that_the_run_cannot_take_are_errors(size, opened):
    with pytest.raises(Exception, match=r"fmi3DoStep|status"):
        opened.step(0, size)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--inputs", "voltage"], "invalid choice: 'voltage'"),
        (["--inputs", "torque", "--period", "15 us"], "multiple"),
        (["--period", "1 kg"], "1 kg"),
    ],
)
def test_wrong_options_of_units_are_named(arguments, words, result, tmp_path, capsys):
    result.save(tmp_path / "r.nc")
    made = str(tmp_path / "r.fmu")
    with suppress(SystemExit):  # of the parser
        assert main(["export", "result", str(tmp_path / "r.nc"), "--out", made, *arguments]) == 2
    assert words in capsys.readouterr().err
    assert not (tmp_path / "r.fmu").exists()


def test_inputs_are_for_units_only(result, tmp_path):
    with pytest.raises(jp.JointplayError, match="only an fmu"):
        bridges.export(result, tmp_path / "r.csv", inputs="torque")


def test_the_command_writes_a_unit(result, tmp_path):
    result.save(tmp_path / "r.nc")
    assert main(["export", "result", str(tmp_path / "r.nc"), "--out", str(tmp_path / "r.fmu")]) == 0
    assert fmpy.read_model_description(tmp_path / "r.fmu").modelName == "scara"
