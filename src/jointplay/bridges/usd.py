"""A robot with the play of its joints as OpenUSD, with UsdPhysics and Newton's and PhysX's schemas.

Play is a revolute joint in series, `J_play`, behind a body that is the motor's rotor; its limits
are the dead band, and their spring the teeth. UsdPhysics has no friction, damping or springs of
limits: they are attributes of Newton's `NewtonJointAPI`, which other programs may ignore; friction
and damping also of `PhysxJointAxisAPI` (Isaac Sim), whose schema need not be installed. Bodies have
masses and no shapes.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pinocchio as pin

from jointplay.base.imports import extra
from jointplay.bridges.reduced_files import LIGHTEST, Body, bodies
from jointplay.bridges.reduction import Reduction
from jointplay.model.mechanism import Mechanism

_PER_DEGREE = math.pi / 180.0


def load_usd() -> tuple[Any, ...]:
    """The modules Gf, Sdf, Tf, Usd, UsdGeom and UsdPhysics, with Newton's schemas registered."""
    with extra("simulators", "OpenUSD with Newton's schemas"):
        import newton_usd_schemas  # noqa: F401 - before the registry of schemas is first used
        from pxr import Gf, Sdf, Tf, Usd, UsdGeom, UsdPhysics
    return Gf, Sdf, Tf, Usd, UsdGeom, UsdPhysics


def to_usd(mechanism: Mechanism, *reductions: Reduction) -> str:
    """The robot as text of a USD stage (.usda): metres, kilograms, z upwards; angles in degrees.

    Raises:
        JointplayError: a package is missing; see `bodies` for robots that cannot be written.
    """
    stage = _Stage(mechanism)
    paths = {"": stage.base}
    for body in bodies(mechanism, reductions):
        paths[body.link] = stage.body(body.link, body.world_placement, body.inertia)
        parent = "" if body.parent is None else body.parent.link
        joint = stage.joint(body, paths[parent], paths[body.link])
        per = 1.0 if body.slides else _PER_DEGREE
        axis = "linear" if body.slides else "angular"
        # https://docs.omniverse.nvidia.com/kit/docs/omni_physics/latest/dev_guide/joints/physx_joint_schema.html
        stage.extend(
            joint, f"PhysxJointAxisAPI:{axis}", f"physxJointAxis:{axis}",
            staticFrictionEffort=body.friction, dynamicFrictionEffort=body.friction,
            viscousFrictionCoefficient=body.damping * per,
        )  # fmt: skip
        newton = {"friction": body.friction, "damping": body.damping * per}
        if body.stop is not None:
            newton = {"limitStiffness": body.stop * per, "limitDamping": body.damping * per}
        stage.extend(joint, "NewtonJointAPI", "newton", **newton)
    return str(stage.stage.GetRootLayer().ExportToString())


class _Stage:
    """A stage with a robot at its root, to which bodies and joints are added."""

    def __init__(self, mechanism: Mechanism) -> None:
        self.gf, self.sdf, self.tf, usd, geom, physics = load_usd()
        self.geom, self.physics = geom, physics
        self.stage = usd.Stage.CreateInMemory()
        geom.SetStageUpAxis(self.stage, geom.Tokens.z)
        geom.SetStageMetersPerUnit(self.stage, 1.0)
        physics.SetStageKilogramsPerUnit(self.stage, 1.0)
        self.names: set[str] = set()
        self.root = "/" + self._name(mechanism.description.path.stem)
        robot = geom.Xform.Define(self.stage, self.root)
        self.stage.SetDefaultPrim(robot.GetPrim())
        scene = physics.Scene.Define(self.stage, f"{self.root}/physics")
        self.names.add("physics")
        gravity = np.array(mechanism.gravity, float)
        size = float(np.linalg.norm(gravity))
        down = gravity / size if size > 0.0 else np.array([0.0, 0.0, -1.0])
        scene.CreateGravityDirectionAttr(self.gf.Vec3f(*down.tolist()))
        scene.CreateGravityMagnitudeAttr(size)
        physics.ArticulationRootAPI.Apply(robot.GetPrim())
        robot.GetPrim().AddAppliedSchema("NewtonArticulationRootAPI")
        self.base = self.body("base", pin.SE3.Identity(), LIGHTEST)
        fixed = physics.FixedJoint.Define(self.stage, f"{self.root}/{self._name('base_fixed')}")
        fixed.CreateBody1Rel().SetTargets([self.base])

    def _name(self, text: str) -> str:
        name = first = self.tf.MakeValidIdentifier(text)
        number = 1
        while name in self.names:
            number += 1
            name = f"{first}_{number}"
        self.names.add(name)
        return str(name)

    def _turned(self, rotation: np.ndarray, kind: Any) -> Any:
        quaternion = pin.Quaternion(rotation)
        return kind(quaternion.w, quaternion.x, quaternion.y, quaternion.z)

    def body(self, name: str, place: pin.SE3, inertia: pin.Inertia) -> Any:
        """Add a body; returns its path."""
        body = self.geom.Xform.Define(self.stage, f"{self.root}/{self._name(name)}")
        double = self.geom.XformOp.PrecisionDouble
        at, turn = place.translation.tolist(), self._turned(place.rotation, self.gf.Quatd)
        body.AddTranslateOp(precision=double).Set(self.gf.Vec3d(*at))
        body.AddOrientOp(precision=double).Set(turn)
        prim = body.GetPrim()
        self.physics.RigidBodyAPI.Apply(prim)
        moments, axes = np.linalg.eigh(inertia.inertia)
        axes[:, 0] *= np.sign(np.linalg.det(axes))
        mass = self.physics.MassAPI.Apply(prim)
        mass.CreateMassAttr(float(inertia.mass))
        mass.CreateCenterOfMassAttr(self.gf.Vec3f(*inertia.lever.tolist()))
        mass.CreateDiagonalInertiaAttr(self.gf.Vec3f(*moments.tolist()))
        mass.CreatePrincipalAxesAttr(self._turned(axes, self.gf.Quatf))
        return prim.GetPath()

    def joint(self, body: Body, parent: Any, child: Any) -> Any:
        """Add the joint that moves a body, about z of its own frames; returns its prim."""
        kind = self.physics.PrismaticJoint if body.slides else self.physics.RevoluteJoint
        joint = kind.Define(self.stage, f"{self.root}/{self._name(body.name)}")
        joint.CreateBody0Rel().SetTargets([parent])
        joint.CreateBody1Rel().SetTargets([child])
        joint.CreateAxisAttr(self.physics.Tokens.z)
        upright = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), body.axis).matrix()
        joint.CreateLocalPos0Attr(self.gf.Vec3f(*body.placement.translation.tolist()))
        joint.CreateLocalRot0Attr(self._turned(body.placement.rotation @ upright, self.gf.Quatf))
        joint.CreateLocalPos1Attr(self.gf.Vec3f(0.0))
        joint.CreateLocalRot1Attr(self._turned(upright, self.gf.Quatf))
        low, high = body.limits
        if np.isfinite([low, high]).all():
            per = 1.0 if body.slides else 1.0 / _PER_DEGREE
            joint.CreateLowerLimitAttr(low * per)
            joint.CreateUpperLimitAttr(high * per)
        return joint.GetPrim()

    def extend(self, joint: Any, schema: str, prefix: str, **values: float) -> None:
        """Apply a schema beyond UsdPhysics to a joint, and set its attributes ``prefix:name``."""
        joint.AddAppliedSchema(schema)
        kind = self.sdf.ValueTypeNames.Float
        for name, value in values.items():
            joint.CreateAttribute(f"{prefix}:{name}", kind, custom=False).Set(float(value))
