"""The time loop between two events: when Pinocchio is called, and the kernels in between.

Pinocchio computes the dynamics of the mechanism, the kernels (compiled code) contacts and all other
forces. Single-rate methods call Pinocchio at every stage of a step. The multi-rate method
(`kernel.multirate`) calls it once a macro step, at the state predicted for its middle, for the
inverse mass matrix and the acceleration without forces; with these the kernel does the micro steps.
It chooses the lengths of macro steps by their error (`MACRO_TOLERANCE`) and ends one early where
the state leaves the predicted path (`LARGEST_DEPARTURE`). Method and measurements:
docs/integrators.md.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from jointplay.model.frames import Frame
from jointplay.model.loop import PROXIMAL
from jointplay.model.tree import Tree
from jointplay.physics.kernel import REACHED, Command, caller_of, layout
from jointplay.physics.kernel.adaptive import STABLE_TURN
from jointplay.physics.kernel.layout import CarriedFrame, JointSite, LoadSite

if TYPE_CHECKING:
    from jointplay.simulation.run import Run

LOOP_CORRECTION = 0.1
"""Frequency of Baumgarte's stabilisation of ideal loops times the step, in single-rate methods."""


def moving_bodies(
    model: pin.Model, frames: Sequence[Frame]
) -> tuple[np.ndarray, list[CarriedFrame]]:
    """The bodies on the ways from some frames (Pinocchio joint and placement in it) to the ground.

    Returns:
        Records of `layout.BODY`, the ground first, parents before their children; and for each
        frame the body that carries it, with its place in that.
    """
    tree = Tree(model)
    bodies = tree.bodies
    carriers, places = tree.frames(frames)
    needed = {0}
    for body in map(int, carriers):
        while body not in needed:
            needed.add(body)
            body = int(bodies.parents[body])
    # Numbered anew among those needed; in a tree a parent's number is below its children's.
    numbers = {body: number for number, body in enumerate(sorted(needed))}
    rows = np.zeros(len(numbers), layout.BODY)
    rows["rotation"][0] = np.eye(3).ravel()
    for body, number in numbers.items():
        row = rows[number]
        row["parent"], row["coordinate"] = numbers[int(bodies.parents[body])], body - 1
        row["slides"] = bodies.slides[body]
        row["turn"], row["shift"] = bodies.turns[body], bodies.shifts[body]
    return rows, [(numbers[int(b)], place) for b, place in zip(carriers, places, strict=True)]


class TimeLoop(ABC):
    """Steps a run from one event to the next; `constraints` hold its ideal loops closed."""

    def __init__(self, run: Run, constraints: list[pin.RigidConstraintModel]) -> None:
        self.model, self.data = model, data = run.model, run.data
        self.workspace, self.method = run.workspace, run.method
        self._models = pin.StdVec_RigidConstraintModel()
        self._models.extend(constraints)
        self._datas = pin.StdVec_RigidConstraintData()
        self._datas.extend([constraint.createData() for constraint in constraints])
        if constraints:
            pin.initConstraintDynamics(model, data, self._models, self._datas)
        # The Python binding of pin.aba tries the form with external forces first: to give it forces
        # that are zero costs less than to leave them out.
        self._none = pin.StdVec_Force()
        self._none.extend([pin.Force.Zero()] * model.njoints)
        self.goes_on = False
        """Whether the next call goes on with what was begun: a macro step that is planned already,
        as after a pause, or single-rate steps from a first state. Checkpoints keep it."""

    def compile(self) -> None:
        """Compile the entries of the kernel that the loop calls."""
        caller_of(self.method.command)

    @abstractmethod
    def begin(self) -> None:
        """Make ready to step from the workspace's state, at first or after an event changed it."""

    @abstractmethod
    def synchronize(self) -> None:
        """Bring q and v of the workspace to one instant, for an event that will change them."""

    def velocity(self) -> np.ndarray:
        """Velocities at the present instant, shape (nv,)."""
        return self.workspace.v

    @abstractmethod
    def stretch(self, steps: int, pause: int) -> bool:
        """Do at most `steps` steps; returns whether all is well.

        `pause`: step at or after which it returns, between macro steps, if that is earlier; what
        follows is the same as without.
        """

    @abstractmethod
    def finish(self) -> None:
        """Record the last state."""


# The multi-rate methods.


LONGEST_MACRO_STEP_S = 2e-4
"""Longest macro step that the error estimate chooses [s]."""
LONGEST_ADAPTIVE_MACRO_STEP_S = 3e-4
"""Longest macro step where micro steps too are chosen by their error [s].

SCARA, 3 s, tolerance 1e-3: the peak is 0.6 % off with 0.5 ms, 0.4 % with 0.3 ms, and 0.1 % with
0.2 ms, which costs an eighth more than 0.3 ms.
"""
MACRO_TOLERANCE = 1e-3
"""Error of a macro step above which the next one is shorter: distance of the acceleration at its
predicted middle from the parabola through the last middles, relative.

The error between the middles is a small part of that. Measured: docs/integrators.md.
"""
LARGEST_DEPARTURE = 3.0
"""Angle by which the state may leave the predicted path of a macro step, over the micro step
[rad/s]: in proportion, so that smaller micro steps bring this error down with their own."""
LOOP_TOLERANCE = 3e-5
"""`MACRO_TOLERANCE` with ideal loops, which drift apart by the error of the parabola."""
USUAL_TOLERANCE = 1e-3
"""Tolerance of micro steps for which the limits of macro steps above are meant. With a smaller one
the error of macro steps shrinks in proportion, and their longest by its fourth root."""
SHORTEST_MICRO_STEP_S = 2e-8
"""Shortest micro step that is chosen by its error [s]."""

_aba, _inverse, _WORLD = pin.aba, pin.computeMinverse, pin.Convention.WORLD

_PLAN = int(Command.PLAN)


class MultiRate(TimeLoop):
    """Pinocchio once a macro step; the micro steps in compiled code."""

    advancing = Command.ADVANCE
    longest_macro_step_s = LONGEST_MACRO_STEP_S

    def __init__(self, owner: Run, constraints: list[pin.RigidConstraintModel]) -> None:
        super().__init__(owner, constraints)
        w, run, macro_step = self.workspace, self.workspace.run, owner.simulation.macro_step
        self._dt = float(run["dt"][0])
        self._middle = w.middle
        self._zero = np.zeros(self.model.nv)
        self._until = run["until"]
        # Coordinates that are angles, which limit macro steps by how far they turn.
        for joint in self.model.joints[1:]:
            if joint.nv == 1 and "P" not in joint.shortname()[len("JointModel") :][:1]:
                w.angular[joint.idx_v] = 1.0
            if joint.shortname() == "JointModelSphericalZYX":
                w.angular[joint.idx_v : joint.idx_v + 3] = 1.0
        fixed = macro_step is not None
        run["fixed"], run["unit"] = fixed, 1
        run["departure_limit"] = np.inf if fixed else LARGEST_DEPARTURE * self._dt
        longest = self.longest_macro_step_s if macro_step is None else macro_step
        run["longest"] = max(round(longest / self._dt), 1)
        run["suggested"] = run["longest"] if fixed else max(int(run["longest"][0]) // 10, 1)
        run["tolerance"] = LOOP_TOLERANCE if len(self._models) else MACRO_TOLERANCE
        if w.needs_jacobians or len(self._models):
            self._place_bodies()

    def shorten_macro_steps(self, factor: float) -> None:
        """Divide macro steps by `factor`; their error falls with its square."""
        run = self.workspace.run
        for name in ("longest", "suggested"):
            run[name] = max(round(int(run[name][0]) / factor), 1)
        run["tolerance"] /= factor**2

    def _place_bodies(self) -> None:
        """Give the kernels the bodies that carry cut joints, loads between frames and ideal loops.

        Their poses are needed at every micro step, for which no call of Pinocchio is cheap enough.
        """
        w = self.workspace
        sites: list[JointSite | LoadSite] = [*w.sites, *w.load_sites]
        reached = [frame for site in sites for frame in site.carriers or ()]
        held = [
            frame
            for pair in self._models
            for frame in (
                (pair.joint1_id, pair.joint1_placement),
                (pair.joint2_id, pair.joint2_placement),
            )
        ]
        bodies, carried = moving_bodies(self.model, [*reached, *held])
        w.place(bodies, carried[: len(reached)])
        if held:
            pairs = zip(carried[len(reached) :: 2], carried[len(reached) + 1 :: 2], strict=True)
            points = [(i, j, first[9:], second[9:]) for (i, first), (j, second) in pairs]
            w.set_held_pairs(np.array(points, layout.HOLD))

    def begin(self) -> None:
        w, self.goes_on = self.workspace, False
        w.execute(Command.RESTART)
        _aba(self.model, self.data, w.q, w.v, self._zero, self._none, _WORLD)
        _inverse(self.model, self.data)
        w.execute(Command.START_HALF_STEP)

    def synchronize(self) -> None:
        if not self.workspace.run["fresh"][0]:
            self.workspace.execute(Command.SYNCHRONIZE)

    def velocity(self) -> np.ndarray:
        w = self.workspace
        velocity: np.ndarray = w.half + 0.5 * float(w.run["dt_before"][0]) * w.acceleration
        return velocity

    def stretch(self, steps: int, pause: int) -> bool:
        address, (q, v) = self.workspace.address, self._middle
        enter, advance = caller_of(self.advancing), int(self.advancing)
        model, data, zero, none = self.model, self.data, self._zero, self._none
        if not self.goes_on:
            self._until[0] = self.workspace.steps + steps
            caller_of()(self.workspace.address, _PLAN)
        self.goes_on = False
        state = 0
        while state == 0:
            _aba(model, data, q, v, zero, none, _WORLD)
            _inverse(model, data)
            state = enter(address, advance)
            if state == 0 and self.workspace.steps >= pause:
                self.goes_on = True
                return True
        return bool(state == REACHED)

    def finish(self) -> None:
        self.workspace.execute(Command.RECORD_LAST_STATE)


class Adaptive(MultiRate):
    """The multi-rate method with adaptive micro steps (`kernel.adaptive`).

    The simulation's tolerance bounds the error of a micro step's change of momentum, relative to
    the momentum that contacts and inertia exchange in it.
    """

    advancing = Command.ADVANCE_ADAPTIVELY
    longest_macro_step_s = LONGEST_ADAPTIVE_MACRO_STEP_S

    def __init__(self, owner: Run, constraints: list[pin.RigidConstraintModel]) -> None:
        super().__init__(owner, constraints)
        run, tolerance = self.workspace.run, owner.simulation.tolerance
        assert tolerance is not None
        run["micro_tolerance"], run["shortest_micro"] = tolerance, SHORTEST_MICRO_STEP_S
        run["micro_step"] = self._dt
        if owner.simulation.macro_step is None and tolerance < USUAL_TOLERANCE:
            less = USUAL_TOLERANCE / tolerance
            self.shorten_macro_steps(less**0.25)
            run["tolerance"] /= less**0.5  # with the above in proportion to the tolerance
        highest = owner.highest_frequency()
        run["longest_micro"] = STABLE_TURN / highest if highest > 0.0 else np.inf
        self.workspace.keep_copies()

    def compile(self) -> None:
        super().compile()
        caller_of(self.advancing)


class SingleRate(TimeLoop):
    """Explicit methods: Pinocchio at every stage."""

    def __init__(self, run: Run, constraints: list[pin.RigidConstraintModel]) -> None:
        super().__init__(run, constraints)
        w = self.workspace
        state = (self.model, self.data, w.q, w.v, w.tau)
        self._call: tuple[Any, tuple[Any, ...]] = pin.aba, (*state, self._none, _WORLD)
        if len(self._models):
            self._call = pin.constraintDynamics, (*state, self._models, self._datas, PROXIMAL)

    def begin(self) -> None:
        self.workspace.execute(Command.REFRESH if self.goes_on else Command.BEGIN)
        self.goes_on = True
        if self.workspace.needs_jacobians:
            pin.computeJointJacobians(self.model, self.data, self.workspace.q)
            self.workspace.execute(Command.EVALUATE_FORCES)
        dynamics, state = self._call
        dynamics(*state)

    def synchronize(self) -> None:
        self.workspace.execute(Command.COMPLETE_STEP)

    def stretch(self, steps: int, pause: int) -> bool:
        steps = min(steps, max(pause - self.workspace.steps, 1))
        enter, address = caller_of(self.method.command), self.workspace.address
        command, load = int(self.method.command), int(Command.EVALUATE_FORCES)
        dynamics, state = self._call
        jacobians, place = pin.computeJointJacobians, (self.model, self.data, self.workspace.q)
        through_frames = self.workspace.needs_jacobians
        for _ in range(steps * self.method.stages):
            if enter(address, command):
                return False
            if through_frames:
                jacobians(*place)
                if enter(address, load):
                    return False
            dynamics(*state)
        return True

    def finish(self) -> None:
        self.workspace.execute(Command.RECORD)
