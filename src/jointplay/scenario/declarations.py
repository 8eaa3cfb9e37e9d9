"""The format of scenario files: tables, their keys, and the units of their values, as classes.

`base.schema` reads files by them; joints, laws, gears, drives and payloads are tables of their own
classes.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Any, ClassVar

from jointplay.accuracy.robot_errors import RobotErrors
from jointplay.base.errors import JointplayError
from jointplay.base.schema import OptionalQuantity, choice, quantity
from jointplay.model.beams import FlexibleLink
from jointplay.model.free_base import BASES, HELD
from jointplay.model.gear import Gearing
from jointplay.model.linkage import Linkage
from jointplay.model.payload import Payload, Vector
from jointplay.model.urdf import GRAVITY, STANDARD_GRAVITY
from jointplay.physics.joints import Clearance
from jointplay.simulation.loads import Load
from jointplay.simulation.loads.drive import Drive, JointFriction
from jointplay.simulation.motion.reference import INTERPOLATIONS
from jointplay.simulation.result.settings import Integration, LimitSettings, RecordSettings

PATHS = ("joint", "line")
"""Kinds of path between Cartesian waypoints."""
MOTION_SOURCES = {
    "file": ("interpolation", "faster"),
    "joints": ("times", "interpolation", "faster"),
    "speeds": (),
    "tool_position": ("times", "tool_rpy", "frame", "path", "driven", "faster"),
}
"""Keys of [motion] of which exactly one is given, and the keys that go with it."""
ANGLE = ("rad", "m")
"""Units of a position, of revolute and of prismatic joints; which one a value must have shows when
the robot has been read."""
ANGULAR_SPEED = ("rad/s", "m/s")
"""Units of a speed, of revolute and of prismatic joints."""


@dataclass(frozen=True, kw_only=True)
class Robot(LimitSettings):
    """The robot or linkage."""

    urdf: str = ""
    """URDF or xacro: a path relative to the scenario's file, ``jointplay:NAME`` for one that ships
    with the package, ``example-robot-data:NAME`` or ``robot_descriptions:NAME``. Left out with a
    [linkage]."""
    xacro: dict[str, str | bool | int | float] = quantity("", default_factory=dict)
    """Arguments of a robot that is written in xacro, by name."""
    tool: str | None = None
    """Frame whose motion is reported; if not given, the end of the chain of moving joints with
    play, or a frame fixed there and named like a tool."""
    gravity: Vector = quantity("m/s^2", default=STANDARD_GRAVITY, choices=("gravity", GRAVITY))
    """``loaded`` (9.81 m/s^2 along -z), ``balanced`` (zero), or three components in world axes."""
    allow_unphysical: tuple[str, ...] = ()
    """Links whose inertias are accepted although they are physically impossible; ``["all"]`` stands
    for all of them."""
    fix: tuple[str, ...] = ()
    """Joints that are held, with the joints that mimic them: at zero, or in the middle of limits
    that exclude it."""
    base: str = choice("base", BASES, default=HELD)
    """``held``: bolted to the ground; or ``free``: held by nothing, so that it moves under the
    forces of joints and loads, and falls under gravity."""


@dataclass(frozen=True, kw_only=True)
class Frame:
    """Frame of the bearing or journal of a joint that closes a loop, in its link."""

    link: str
    """Link that carries the frame."""
    xyz: Vector = quantity("m", default=(0.0, 0.0, 0.0))
    """Centre in the link's frame."""
    rpy: Vector = quantity("rad", default=(0.0, 0.0, 0.0))
    """Roll, pitch and yaw as in a URDF; z is the joint's axis."""


@dataclass(frozen=True, kw_only=True)
class LoopEnds:
    """A joint between two links that closes a loop; ideal and revolute unless [joints] has it."""

    bearing: Frame
    """The outer half."""
    journal: Frame
    """The inner half."""


@dataclass(frozen=True, kw_only=True)
class LinkTable:
    """Properties of a link that the URDF does not have."""

    flexible: FlexibleLink
    """A beam that bends and twists, cut into segments."""


@dataclass(frozen=True, kw_only=True)
class MotionTable:
    """Reference motion: a file, joint positions, constant speeds, or positions of the tool."""

    file: str | None = None
    """CSV with the header ``time_s,<joint>,...``, in rad and m, or ``time [s],<joint> [deg],...``;
    or ROS 2 bag (.mcap). A scenario's path is relative to its file, as the URDF's is."""
    times: list[float] | None = quantity("s", default=None)
    """Times of the waypoints."""
    joints: dict[str, list[float]] | None = quantity(*ANGLE, default=None)
    """Position at each time, by joint."""
    speeds: dict[str, float] | None = quantity(*ANGULAR_SPEED, default=None)
    """Constant speed, by joint, from the position in [start]; needs a duration."""
    interpolation: str | None = choice("interpolation", INTERPOLATIONS, default=None)
    """Interpolation between waypoints; if not given, the file's, or by the points: ``spline`` for
    samples, ``rest-to-rest`` for waypoints."""
    tool_position: list[Vector] | None = quantity("m", default=None)
    """Position of the frame at each time, in world axes; inverse kinematics finds the joints'."""
    tool_rpy: list[Vector] | None = quantity("rad", default=None)
    """Roll, pitch and yaw of the frame at each time; free if not given."""
    frame: str | None = None
    """Frame that follows these positions; if not given, the tool."""
    faster: OptionalQuantity = quantity("", default=None)
    """Factor by which the motion is run faster than given."""
    path: str | None = choice("path", PATHS, default=None)
    """Path between Cartesian waypoints: ``joint`` moves all joints in step, ``line`` moves the
    frame on a straight line."""
    driven: list[str] | None = None
    """In closed loops, joints whose drives lead the frame; if not given, those nearest to the base
    that determine the others."""

    def given(self) -> dict[str, Any]:
        """Values of the keys that are given."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        return {name: value for name, value in values.items() if value is not None}


@dataclass(frozen=True, kw_only=True)
class IntegrationTable(Integration):
    """Time integration, the start, and certificates."""

    certify: bool = False
    """Whether the case is repeated with finer steps to bound the numerical errors of its figures.
    """
    estimate_errors: bool = True
    """Whether the case is run once more, in about half its time, to estimate these errors."""


@dataclass(frozen=True, kw_only=True)
class Output(RecordSettings):
    """Records of a run, and figures."""

    figures: bool = True
    """Whether figures that compare the cases are drawn; the overview, if there is one case."""


@dataclass(frozen=True, kw_only=True)
class HeldPayload(Payload):
    """A payload whose frame may be left out."""

    frame: str = field(default="", kw_only=True)
    """Frame that holds the payload; if not given, the tool."""


@dataclass(frozen=True, kw_only=True)
class Model:
    """A scenario, cases aside. Tables of the package's objects are checked, but not yet objects."""

    further_keys: ClassVar[tuple[str, ...]] = ("cases", "sweep")

    title: str = ""
    """Title of the scenario, a line."""
    robot: Robot = Robot()
    """The robot or linkage."""
    linkage: Linkage | None = None
    """A linkage by its points, links and sliders, instead of a URDF."""
    loops: dict[str, LoopEnds] = field(default_factory=dict)
    """Joints that close loops, by name."""
    joints: dict[str, Clearance] = field(default_factory=dict)
    """Joints with clearance, by the name of a joint of the URDF or of a loop."""
    gears: dict[str, Gearing] = field(default_factory=dict)
    """Gears between motors and joints, by joint."""
    links: dict[str, LinkTable] = field(default_factory=dict)
    """Flexible links, by the name of a link of the URDF."""
    drive: Drive | None = None
    """Drive of all joints of the motion; ``computed-torque`` if it or its kind is not given."""
    drives: dict[str, Drive] = field(default_factory=dict)
    """Drives of single joints; if this table is given, joints with neither motion nor drive are
    free."""
    joint_friction: dict[str, JointFriction] = field(default_factory=dict)
    """Friction by joint; joints not named have the friction of the URDF."""
    motion: MotionTable | None = None
    """Reference motion."""
    start: dict[str, float] = quantity(*ANGLE, default_factory=dict)
    """Position at the start of joints without reference, or of single coordinates such as
    ``"joint_b.x"``; with ``tool_position``, where inverse kinematics begins."""
    start_speed: dict[str, float] = quantity(*ANGULAR_SPEED, default_factory=dict)
    """Speed at the start of joints without reference, or of single coordinates."""
    loads: dict[str, Load] = field(default_factory=dict)
    """Other loads, each under a name of your choice."""
    payloads: list[HeldPayload] = field(default_factory=list)
    """Bodies that the tool picks up and releases."""
    errors: RobotErrors | None = None
    """Errors besides play, for the whole error budget; runs have none of them."""
    integration: IntegrationTable = IntegrationTable()
    """Time integration, and the start."""
    output: Output = Output()
    """Records and figures."""


def require_machine(model: Model) -> None:
    """Raise unless a scenario has either a robot's file or a linkage."""
    if model.robot.urdf and model.linkage is not None:
        raise JointplayError("give [robot] urdf or [linkage], not both", where=("linkage",))
    if not model.robot.urdf and model.linkage is None:
        raise JointplayError(
            "the machine is missing: give [robot] urdf, or a [linkage] of points and links",
            where=("robot",),
        )
    if model.linkage is not None and model.robot.xacro:
        raise JointplayError("a [linkage] takes no xacro", where=("robot", "xacro"))


NOT_IN_A_CASE = ("title", "cases", "sweep")
"""Keys that a case must not have."""
