"""Small mechanisms with known answers."""

import io
import json
import os
import signal
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from browsing import browser, open_page  # noqa: F401
from hypothesis import HealthCheck, Phase, settings
from matplotlib.figure import Figure
from scipy.spatial.transform import Rotation
from sweep_scenario import GRID, SCENARIO
from texts import faults
from warm import System, close

from jointplay import JointplayError, Mechanism, Motion, RevoluteClearance, Simulation, simulate
from jointplay.base import compiler, streams
from jointplay.physics.geometry import touch_cylinder
from jointplay.physics.kernel.constants import DEFAULT
from jointplay.simulation import Run
from jointplay.simulation.loads import ComputedTorque
from jointplay.simulation.working_files import CHECKPOINT

# What runs in the background or under nohup ignores these, and so would all that tests start.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
if signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:
    signal.signal(signal.SIGHUP, signal.SIG_DFL)

# The matrices of tests are small: threads of OpenBLAS that wait for each other take more time than
# the work. What is started from here inherits this, workers of pytest-xdist among it.
for library in ("OPENBLAS", "OMP"):
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")

# What commands print is not to depend on what was compiled before.
streams.announced.add(compiler.COMPILES)

# Tests wait for progress: it is to be said often.
os.environ["JOINTPLAY_PROGRESS_S"] = "0"

# A simulation in each example: slow machines must not fail, and a failure must not be shrunk for
# minutes.
settings.register_profile(
    "jointplay",
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow],
    phases=set(Phase) - {Phase.shrink},
)
settings.load_profile("jointplay")


# Fixtures whose tests need libraries of extras.
FIXTURES = {
    "browser": ("playwright",),
    "filmable": ("playwright", "imageio", "imageio_ffmpeg"),
}


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """What opens a browser takes long; what needs a library of an extra is skipped without it."""
    for item in items:
        if "browser" in item.fixturenames:
            item.add_marker("thorough")
        for fixture in FIXTURES.keys() & set(item.fixturenames):
            item.add_marker(pytest.mark.needs(*FIXTURES[fixture]))
        needs = [name for mark in item.iter_markers("needs") for name in mark.args]
        if reason := missing(needs):
            item.add_marker(pytest.mark.skip(reason=reason))


def missing(modules):
    """Which of them are not installed, and how to get them; nothing if all are."""
    absent = sorted({name for name in modules if find_spec(name) is None})
    return f"needs {', '.join(absent)}: pip install '.[test-all]'" if absent else ""


def needed(*modules):
    """The mark of a file of tests that imports these; without them all of it is skipped."""
    if reason := missing(modules):
        pytest.skip(reason, allow_module_level=True)
    return pytest.mark.needs(*modules)


@pytest.fixture(autouse=True)
def no_module_stays_imported():
    """What one test has had imported, no function of another is looked for in."""
    from jointplay.base import modules

    kept = dict(modules.imported)
    yield
    modules.imported.clear()
    modules.imported.update(kept)


@pytest.fixture
def checked_figures(monkeypatch):
    """Every figure that is saved has texts that stand apart and inside, and units."""
    checking, save = False, Figure.savefig

    def checked(figure, *args, **options):
        nonlocal checking
        if not checking:  # which draws it
            checking = True
            wrong.extend(faults(figure))
            checking = False
        save(figure, *args, **options)

    wrong = []
    monkeypatch.setattr(Figure, "savefig", checked)
    yield
    assert not wrong


@pytest.fixture(autouse=True, scope="session")
def warm():
    """Processes that read results begin at once; all kernels are compiled once."""
    with pytest.MonkeyPatch.context() as patch:
        # Further runs after each of thousands: those that are about them ask for them.
        patch.setattr(Simulation.run, "__defaults__", (False, False, False, False, None))
        patch.setattr(Run.finish, "__defaults__", (False, False, None))
        patch.setitem(simulate.__kwdefaults__, "estimate", False)
        patch.setattr("jointplay.base.confined.sys", System())
        yield


def pytest_sessionfinish():
    close()


def checkpoint_arrays(path):
    with np.load(io.BytesIO(path.read_bytes().removeprefix(CHECKPOINT))) as opened:
        return dict(opened)


def save_checkpoint(path, arrays, head=None):
    """With another head, if one is given."""
    if head is not None:
        arrays["head"] = np.frombuffer(json.dumps(head).encode(), np.uint8)
    content = io.BytesIO()
    np.savez(content, **arrays)
    path.write_bytes(CHECKPOINT + content.getvalue())
    return path


def pytest_terminal_summary(terminalreporter, config):
    """Tests run in an order of their own each time: say how to have the same again."""
    seed = getattr(config.option, "randomly_seed", None)
    if seed is not None:
        terminalreporter.write_line(f"in random order; the same again: --randomly-seed={seed}")


BODY = """
  <link name="{name}"><inertial>
    <origin xyz="{com}"/><mass value="{mass}"/>
    <inertia ixx="{i}" iyy="{i}" izz="{i}" ixy="0" ixz="0" iyz="0"/>
  </inertial></link>"""
JOINT = """
  <joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>
    <origin xyz="{at}" rpy="{rpy}"/><axis xyz="{axis}"/>
    <limit lower="-9" upper="9" effort="1e3" velocity="1e3"/></joint>"""


def body(name, mass=2.0, com="0 0 0", inertia=1e-2):
    return BODY.format(name=name, mass=mass, com=com, i=inertia)


def tip(parent, at="0.5 0 0"):
    """A tool at the end of a link."""
    return (
        '<link name="tool"/>'
        f'<joint name="tip" type="fixed"><parent link="{parent}"/><child link="tool"/>'
        f'<origin xyz="{at}"/></joint>'
    )


def joint(name, parent, child, kind="revolute", axis="0 0 1", at="0 0 0", rpy="0 0 0"):
    return JOINT.format(name=name, parent=parent, child=child, kind=kind, axis=axis, at=at, rpy=rpy)


ARM_WITH_HAND = (
    '<robot name="r"><link name="base"/>'
    + body("arm", mass=2.0, com="0.3 0 0", inertia=0.02)
    + body("hand", mass=0.5, com="0 0 0")
    + joint("j", "base", "arm")
    + joint("k", "arm", "hand", axis="0 1 0", at="0.5 0 0")
    + "</robot>"
)
"""An arm about an upright axis, with a hand."""


@pytest.fixture
def urdf(tmp_path):
    """Write a robot of the given elements to a file."""

    def write(*elements: str, base: str = '<link name="base"/>') -> Path:
        path = tmp_path / "robot.urdf"
        path.write_text(f'<robot name="r">{base}{"".join(elements)}</robot>')
        return path

    return write


def still(mechanism: Mechanism, duration: float) -> Motion:
    """All joints commanded to stand at zero."""
    joints = mechanism.joints
    return Motion(joints, [0.0, duration], np.zeros((2, len(joints))))


def release(run: Run) -> Run:
    """Switch all drives off."""
    run.workspace.drives["kp"] = run.workspace.drives["kd"] = 0.0
    run.workspace.reference[:] = 0.0
    return run


@pytest.fixture
def free_mass(urdf):
    """A run of a single undriven body whose journal plays in a bearing fixed to the ground.

    Options: those of the clearance joint, and `offset`, `velocity` of its six coordinates.
    """

    def make(
        *,
        offset=(0.0,) * 6,
        velocity=(0.0,) * 6,
        duration=2e-3,
        mass=2.0,
        com="0 0 0",
        inertia=1e-2,
        gravity=(0.0, 0.0, 0.0),
        step=1e-6,
        integrator=DEFAULT,
        tolerance=None,
        record_every=1,
        **bearing,
    ) -> Run:
        clearance = {"radial_clearance": 2e-4, "axial_clearance": 2e-4} | bearing
        path = urdf(body("arm", mass, com, inertia), joint("pin", "base", "arm"))
        mechanism = Mechanism(path, {"pin": RevoluteClearance(**clearance)}, gravity=gravity)
        simulation = Simulation(
            mechanism,
            still(mechanism, duration),
            drive=ComputedTorque(bandwidth=1.0),
            step=step,
            integrator=integrator,
            tolerance=tolerance,
            record_every=record_every,
        )
        run = release(Run(simulation))
        run.workspace.q[:] = offset
        run.workspace.v[:] = velocity
        return run

    return make


@pytest.fixture
def swept(tmp_path):
    """Write a scenario with a sweep; returns its path."""

    def write(axes=GRID, options="", duration="0.02 s", name="study.toml"):
        path = tmp_path / name
        path.write_text(SCENARIO.format(axes=axes, options=options, duration=duration))
        return path

    return write


@pytest.fixture
def planned(swept):
    """The plan of such a scenario."""

    def make(axes=GRID, options="", **given):
        from jointplay.study import plan_of

        return plan_of(swept(axes, options), **given)

    return make


@pytest.fixture
def unplannable(planned):
    """What is said of a sweep that cannot be."""

    def make(axes=GRID, options="", **given):
        with pytest.raises(JointplayError) as error:
            planned(axes, options, **given)
        assert "\n" not in str(error.value)
        return str(error.value)

    return make


def journal_axis(angles):
    """Axis of a journal in the bearing frame, of its yaw, pitch and roll (3,) [rad]."""
    return Rotation.from_euler("ZYX", angles).as_matrix()[:, 2]


def gaps(centre, axis, bore_radius, bore_length, journal_radius, journal_length):
    """Gap (4,), point (4, 3) and normal (4, 3) of a cylinder's contacts in the bearing frame."""
    half = bore_length / 2, journal_length / 2
    found = np.array(
        [touch_cylinder(k, *centre, *axis, bore_radius, journal_radius, *half) for k in range(4)]
    )
    return found[:, 0], found[:, 1:4] + centre, found[:, 4:]
