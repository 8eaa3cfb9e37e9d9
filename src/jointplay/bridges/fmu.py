"""A simulation as a Functional Mock-up Unit: FMI 3 co-simulation, by PythonFMU3.

The unit holds the simulation's description, and no code: where it runs, Python, jointplay of the
same version and the libraries that it needs must be installed. Each communication step advances a
`Run` by as many of its own steps. The states of the unit are the run's checkpoints.
"""

from __future__ import annotations

import base64
import json
import re
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
import pinocchio as pin

from jointplay.base import files
from jointplay.base.errors import JointplayError, require_known
from jointplay.base.imports import extra
from jointplay.base.units import convert
from jointplay.simulation.checkpoint import continue_run, save
from jointplay.simulation.loads.controller import Controller
from jointplay.simulation.loads.drive import ComputedTorque
from jointplay.simulation.run import Run
from jointplay.simulation.simulation import Simulation

if TYPE_CHECKING:
    from jointplay.model.mechanism import Mechanism
    from jointplay.simulation.result.result import Result

INPUTS = ("none", "torque", "reference")
"""What a unit takes from outside: nothing; torques of motors beside those of the drives; or, in
place of motion and drives, positions and speeds that computed torque follows."""
NEEDS = (
    "Needs Python with jointplay and the libraries of its extra fmu where it runs; "
    "the file holds a description of the machine, no code."
)
_DESCRIPTION = "simulation.json"
_SCRIPT = """from pythonfmu3 import Fmi3Slave

from jointplay.bridges.fmu import Machine


class {name}(Machine, Fmi3Slave):
    pass
"""
_UNITS = {
    "rad": {"rad": 1},
    "m": {"m": 1},
    "rad/s": {"rad": 1, "s": -1},
    "m/s": {"m": 1, "s": -1},
    "N": {"kg": 1, "m": 1, "s": -2},
    "N m": {"kg": 1, "m": 2, "s": -2},
}
_CONTROLLER = "fmu_inputs"


class Inputs:
    """What a unit was given last, as a controller of its machine samples it.

    Args:
        number: of joints.
        bandwidth, damping_ratio: of computed torque that follows references [rad/s, -]; without
            them the values are torques.
    """

    newest: ClassVar[Inputs | None] = None
    """The one that the run made last has."""

    def __init__(self, number: float, bandwidth: float = 0.0, damping_ratio: float = 1.0) -> None:
        self.values = np.zeros((2 if bandwidth else 1, int(number)))
        self.gains = bandwidth**2, 2.0 * damping_ratio * bandwidth
        self.ideal: Mechanism | None = None
        """The mechanism without play, by which references are followed."""
        Inputs.newest = self

    def __call__(self, time: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        if not self.gains[0]:
            return self.values[0]
        if self.ideal is None:  # before anything was given
            return np.zeros(len(q))
        model, data = self.ideal.model, self.ideal.data
        acceleration = self.gains[0] * (self.values[0] - q) + self.gains[1] * (self.values[1] - v)
        return np.asarray(pin.rnea(model, data, np.array(q), np.array(v), acceleration))

    def memory(self) -> list[list[float]]:
        return self.values.tolist()  # type: ignore[no-any-return]

    def recall(self, memory: Sequence[Sequence[float]]) -> None:
        self.values[:] = memory


def fmu(
    result: Result, suffix: str, progress: bool, inputs: str = INPUTS[0], period: float | str = 1e-3
) -> bytes:
    """The unit's content, of a result's simulation.

    Args:
        inputs: one of `INPUTS`.
        period: sampling period of the inputs [s]; communication steps are multiples of it.

    Raises:
        JointplayError: PythonFMU3 is not installed, no such inputs, a period that is no multiple of
            the step, or a law of the user's own, which a unit cannot bring along.
    """
    with extra("fmu", "pythonfmu3"):
        from pythonfmu3.builder import FmuBuilder
    require_known("kind of inputs", inputs, INPUTS)
    simulation = result.simulation
    if inputs != INPUTS[0]:
        change = with_torques if inputs == "torque" else with_references
        simulation = change(simulation, float(convert(period, "s")))
    description = json.dumps(simulation.describe())
    own = sorted({name for name in re.findall(r'"function": "([\w.]+):', description)})
    own = [module for module in own if not module.startswith("jointplay.")]
    if own:
        raise JointplayError(
            f"the simulation has functions of the modules {', '.join(own)}: a unit holds no code, "
            "so it cannot bring them along"
        )
    label = re.sub(r"\W+", "_", Path(simulation.mechanism.description.path).stem) or "machine"
    name = label if label[0].isalpha() else f"machine_{label}"
    with files.temporary("fmu") as place:
        folder = Path(place)
        files.write(folder / _DESCRIPTION, description, announced=False)
        script = folder / f"{name}.py"
        files.write(script, _SCRIPT.format(name=name), announced=False)
        made = FmuBuilder.build_FMU(
            script,
            dest=folder / "made",
            project_files=[folder / _DESCRIPTION],
            canGetAndSetFMUState=True,
            canSerializeFMUState=True,
            needsExecutionTool=True,
        )
        return Path(made).read_bytes()


def driven(mechanism: Mechanism) -> tuple[str, ...]:
    """Joints that turn about an axis or slide along one, of which each can have a motor."""
    entries = mechanism.description.joints
    return tuple(
        name
        for name in mechanism.joints
        if name in entries and (entries[name].turns or entries[name].slides)
    )


def with_torques(simulation: Simulation, period: float) -> Simulation:
    """The simulation with a controller that applies the torques that it is given."""
    joints = driven(simulation.mechanism)
    return _controlled(simulation, Controller(joints, Inputs, (float(len(joints)),), period=period))


def with_references(simulation: Simulation, period: float) -> Simulation:
    """The simulation with a controller that follows references in place of motion and drives.

    Computed torque of the ideal mechanism, sampled and held, with the gains of the simulation's
    drive, or those of `ComputedTorque` by default. It begins at the motion's first positions and
    lasts as long.

    Raises:
        JointplayError: closed loops, a free base, or joints without an axis, whose torques the
            ideal mechanism's equations do not give one by one; see `with_torques`.
    """
    mechanism = simulation.mechanism
    joints, ideal = driven(mechanism), mechanism.ideal()
    if mechanism.loops or [c.joint for c in ideal.coordinates] != list(joints):
        raise JointplayError(
            "references are followed by machines without loops and with joints that turn about an "
            "axis or slide along one, whose base is held; take torque as the inputs"
        )
    drive = simulation.drive if isinstance(simulation.drive, ComputedTorque) else ComputedTorque()
    numbers = float(len(joints)), drive.bandwidth, drive.damping_ratio
    motion, state = simulation.motion, dict(simulation.state)
    if motion is not None:
        for name, start in zip(motion.joints, motion.positions[0], strict=True):
            state[name] = (float(start), 0.0)
    made = replace(
        simulation,
        motion=None,
        drive={},
        state=state,
        duration=simulation.duration or (motion.duration if motion else None),
    )
    return _controlled(made, Controller(joints, Inputs, numbers, period=period))


def _controlled(simulation: Simulation, reader: Controller) -> Simulation:
    if _CONTROLLER in simulation.loads:
        raise JointplayError(f"the simulation has a load {_CONTROLLER!r} already")
    return replace(simulation, loads={**simulation.loads, _CONTROLLER: reader})


class Machine:
    """A simulation that advances by communication steps; with PythonFMU3's slave it is a unit."""

    resources: str
    register_variable: Callable[..., None]
    register_units: Callable[..., None]
    log: Callable[..., None]

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        self.author = "jointplay"
        self.description = f"A machine whose joints have play. {NEEDS}"
        text = (Path(self.resources) / _DESCRIPTION).read_text(encoding="utf-8")
        self.simulation = Simulation.from_description(json.loads(text))
        self._start()
        self._declare()

    def _start(self) -> None:
        Inputs.newest = None
        self.run = Run(self.simulation)
        self.inputs = Inputs.newest
        if self.inputs is not None and self.inputs.gains[0]:
            mechanism = self.simulation.mechanism
            self.inputs.ideal = mechanism.ideal()
            q = self.run.workspace.q
            self.inputs.values[0] = [q[mechanism.coordinate(name)] for name in driven(mechanism)]
        self.run.begin()
        self._see()

    def _see(self) -> None:
        self.moment = self.run.moment()
        mechanism = self.simulation.mechanism
        pin.framesForwardKinematics(mechanism.model, mechanism.data, self.moment.q)
        pose = mechanism.data.oMf[mechanism.tool_frame]
        self._seen = {
            "q": self.moment.q,
            "v": self.moment.v,
            "place": pose.translation.copy(),
            "turn": pin.Quaternion(pose.rotation).coeffs(),
            **{f"force {name}": self.moment.force(name) for name in mechanism.clearance},
        }

    def _read(self, what: str, k: int) -> float:
        return float(self._seen[what][k])

    def _declare(self) -> None:
        from pythonfmu3 import Float64, Fmi3Causality, Fmi3Variability
        from pythonfmu3.unit import Unit

        self.register_units([Unit(name, **base) for name, base in _UNITS.items()])
        mechanism = self.simulation.mechanism
        self.time = 0.0
        how = {"causality": Fmi3Causality.independent, "variability": Fmi3Variability.continuous}
        self.register_variable(Float64("time", **how))

        def declare(causality: Any, name: str, unit: str | None, words: str, **how: Any) -> None:
            variable = Float64(name, causality=causality, unit=unit, description=words, **how)
            self.register_variable(variable, nested=False)

        rows: list[tuple[str, str | None, str, str, int]] = []
        for name in driven(mechanism):
            unit = "rad" if mechanism.description.joints[name].turns else "m"
            for side, at in (
                ("motor", mechanism.motor(name)),
                ("link", mechanism.coordinate(name)),
            ):
                place = f"{name}.{side}"
                rows.append((f"{place}.position", unit, f"encoder of the {side}", "q", at))
                rows.append((f"{place}.speed", f"{unit}/s", f"speed of the {side}", "v", at))
        words = f"place of the frame {mechanism.tool}, world axes"
        rows += [(f"tool.{axis}", "m", words, "place", k) for k, axis in enumerate("xyz")]
        words = f"orientation of the frame {mechanism.tool}, a unit quaternion"
        rows += [(f"tool.q{axis}", None, words, "turn", k) for k, axis in enumerate("xyzw")]
        words = "contact force on the journal, bearing axes"
        for name in mechanism.clearance:
            for k, axis in enumerate("xyz"):
                rows.append((f"{name}.force.{axis}", "N", words, f"force {name}", k))
        for name, unit_of, words, what, k in rows:
            getter = partial(self._read, what, k)
            declare(Fmi3Causality.output, name, unit_of, words, getter=getter)
        controller = self.simulation.loads.get(_CONTROLLER)
        if not isinstance(controller, Controller):
            return
        for k, name in enumerate(controller.joints):
            turns = mechanism.description.joints[name].turns
            unit = "rad" if turns else "m"
            torque = ("torque", "N m" if turns else "N", "on the motor, beside its drive")
            followed = [
                ("reference.position", unit, "position to be followed"),
                ("reference.speed", f"{unit}/s", "speed to be followed"),
            ]
            assert self.inputs is not None
            kinds = followed if self.inputs.gains[0] else [torque]
            for row, (what, unit, words) in enumerate(kinds):
                declare(
                    Fmi3Causality.input, f"{name}.{what}", unit, f"{words}; held between samples",
                    start=self._given(row, k), getter=partial(self._given, row, k),
                    setter=partial(self._give, row, k),
                )  # fmt: skip

    def _given(self, row: int, k: int) -> float:
        assert self.inputs is not None
        return float(self.inputs.values[row, k])

    def _give(self, row: int, k: int, value: float) -> None:
        assert self.inputs is not None
        self.inputs.values[row, k] = value

    def do_step(self, current_time: float, step_size: float) -> Any:
        from pythonfmu3 import Fmi3StepResult
        from pythonfmu3.enums import Fmi3Status

        own = self.simulation.step
        now, steps = round(current_time / own), round(step_size / own)
        reason = ""
        if now != self.run.workspace.steps:
            reason = (
                f"the unit is at {self.run.workspace.time:g} s, but was asked to go on from "
                f"{current_time:g} s; restore a state to go back"
            )
        elif steps < 1 or abs(steps - step_size / own) > 1e-6 * steps:
            reason = f"a step of {step_size:g} s is no multiple of the run's step, {own:g} s"
        elif now + steps > self.run.total_steps:
            reason = (
                f"the simulation ends at {self.run.total_steps * own:g} s; give it a longer "
                "duration before it is exported"
            )
        elif not self.run.advance(steps):
            reason = self.run.message(self.run.workspace.status)
        if reason:
            self.log(reason, Fmi3Status.error)
            return Fmi3StepResult(status=Fmi3Status.error)
        self.time = current_time + step_size
        self._see()
        return Fmi3StepResult()

    def _get_fmu_state(self) -> dict[str, Any]:
        with files.temporary("fmu") as place:
            path = save(self.run, Path(place) / "state")
            given = None if self.inputs is None else self.inputs.memory()
            kept = base64.b64encode(path.read_bytes()).decode("ascii")
        return {"checkpoint": kept, "given": given, "time": self.time}

    def _set_fmu_state(self, state: dict[str, Any]) -> None:
        self._start()
        with files.temporary("fmu") as place:
            path = Path(place) / "state"
            files.write(path, base64.b64decode(state["checkpoint"]), announced=False)
            continue_run(self.run, path)
        if self.inputs is not None:
            self.inputs.recall(state["given"])
        self.time = state["time"]
        self._see()

    def terminate(self) -> None:
        with suppress(AttributeError):
            del self.run
