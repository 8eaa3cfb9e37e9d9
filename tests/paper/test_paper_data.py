"""The shipped study has the paper's numbers: Tables 2 to 4, eqs 1 to 3, and the documented motion.

The numbers stand here once more, as the paper prints them (the motion: docs/assumptions.md).
"""

import csv
import tomllib
from xml.etree import ElementTree

import numpy as np
import pytest

import jointplay as jp
from jointplay.base.units import convert
from jointplay.model.robots import shipped
from jointplay.physics.geometry import CONTACT_TOLERANCE_M, touch_cylinder

ARMS = {  # Table 2: length m, mass kg, Jxx, Jyy, Jzz, Jxy, Jxz, Jyz kg m2
    "arm1": (0.329, 5.78, 2.569, 3.080, 2.537, 2.002e-5, 2.384, 0.007e-5),
    "arm2": (0.275, 4.35, 1.346, 0.981, 1.298, 4.871e-4, -2.258e-4, -4.22e-4),
    "arm3": (0.350, 3.03, 2.087e-2, 2.087e-2, 4.726e-5, 1.005e-6, 3.307e-6, 0.489e-6),
}
MOMENTS = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
FACTORS = {  # of the moments, by file and arm (docs/assumptions.md)
    "scara_as_printed.urdf": {},
    "scara.urdf": {
        "arm1": (1e-2, 1e-2, 1e-2, 1.0, 1e-5, 1.0),
        "arm2": (1e-2, 1e-2, 1e-2, 1.0, 1.0, 1.0),
    },
}
AFTER = {"arm1": "joint_b", "arm2": "stroke", "arm3": "suction_cup_mount"}
"""The joint at the far end of each arm."""
ENDS = {
    "arm1": (0.329, 0.0, 0.0),
    "arm2": (0.275, 0.0, 0.140),  # the quill stands 140 mm above arm 2, which is assumed
    "arm3": (0.0, 0.0, -0.350),
}
"""Where it is, in the arm's frame: arms 1, 2 lie along x, arm 3 along -z."""

SIMULATION = {  # Table 3
    "friction coefficient": 0.1,
    "step": 1e-5,
    "E": 207e9,
    "nu": 0.3,
    "restitution": 0.9,
}
ASSUMED = {"R_i": 0.010, "L_i": 0.040, "v0": 1e-4, "v1": 1e-3, "bandwidth": 100.0, "ratio": 1.0}
CASES = {"ideal": None, "0.2 mm": 2e-4, "0.5 mm": 5e-4}  # Table 4

MOTION = [  # time s, A, B rad, stroke m, C rad
    (0.0, -0.3, 0.9, 0.0, 0.0),
    (0.4, -0.3, 0.9, -0.12, 0.0),
    (0.5, -0.3, 0.9, -0.12, 0.0),
    (0.9, -0.3, 0.9, 0.0, 0.0),
    (1.5, 0.7, -0.5, 0.0, 0.5),
    (1.9, 0.7, -0.5, -0.12, 0.5),
    (2.0, 0.7, -0.5, -0.12, 0.5),
    (2.4, 0.7, -0.5, 0.0, 0.5),
    (3.0, -0.3, 0.9, 0.0, 0.0),
]


def of_urdf(name, text):
    """The data of Table 2 as a URDF has them."""
    robot = ElementTree.fromstring(text)
    found = []
    for arm in ARMS:
        inertial = robot.find(f"link[@name='{arm}']/inertial")
        joint = robot.find(f"joint[@name='{AFTER[arm]}']")
        end = [float(x) for x in joint.find("origin").get("xyz").split()]
        com = [float(x) for x in inertial.find("origin").get("xyz").split()]
        moments = [float(inertial.find("inertia").get(key)) for key in MOMENTS]
        found += [*end, float(inertial.find("mass").get("value")), *moments, *com]
    return found


def expected_of_urdf(name):
    numbers = []
    for arm, (length, mass, *moments) in ARMS.items():
        factors = FACTORS[name].get(arm, (1.0,) * 6)
        end = ENDS[arm]
        assert length in (end[0], -end[2])
        com = [0.0, 0.0, end[2] / 2] if arm == "arm3" else [end[0] / 2, 0.0, 0.0]
        numbers += [*end, mass, *np.multiply(moments, factors), *com]
    return numbers


def of_scenario(name, text):
    """The data of Tables 3 and 4 as the scenario has them, and those that the paper leaves out."""
    tables = tomllib.loads(text)
    joint, drive = tables["joints"]["joint_b"], tables["drive"]
    friction = joint["friction"]
    both = [joint[part] for part in ("bearing_material", "journal_material")]
    numbers = [friction["mu_d"], convert(tables["integration"]["step"], "s")]
    numbers += [convert(one["young"], "Pa") for one in both] + [one["poisson"] for one in both]
    numbers += [joint["restitution"]]
    numbers += [convert(joint[key], "m") for key in ("bearing_radius", "bearing_length")]
    numbers += [convert(friction[key], "m/s") for key in ("v0", "v1")]
    numbers += [convert(drive["bandwidth"], "rad/s"), drive["damping_ratio"]]
    for case in CASES:
        given = tables["cases"][case]["joints"]["joint_b"]
        keys = ("radial_clearance", "axial_clearance")
        numbers += [0.0, 0.0] if given.get("ideal") else [convert(given[key], "m") for key in keys]
    assert joint["normal"] == "lankarani-nikravesh"
    assert friction["law"] == "ambrosio"
    return numbers


def expected_of_scenario(name):
    given, assumed = SIMULATION, ASSUMED
    numbers = [given["friction coefficient"], given["step"], given["E"], given["E"]]
    numbers += [given["nu"], given["nu"], given["restitution"], assumed["R_i"], assumed["L_i"]]
    numbers += [assumed["v0"], assumed["v1"], assumed["bandwidth"], assumed["ratio"]]
    return numbers + [clearance or 0.0 for clearance in CASES.values() for _ in range(2)]


def of_motion(name, text):
    lines = [line for line in text.splitlines() if not line.startswith("#")]
    head, *rows = csv.reader(lines)
    assert head == ["time_s", "joint_a", "joint_b", "stroke", "joint_c"]
    return [float(cell) for row in rows for cell in row]


def expected_of_motion(name):
    return [number for row in MOTION for number in row]


FILES = {
    "scara.urdf": (of_urdf, expected_of_urdf),
    "scara_as_printed.urdf": (of_urdf, expected_of_urdf),
    "scara.toml": (of_scenario, expected_of_scenario),
    "scara_motion.csv": (of_motion, expected_of_motion),
}


@pytest.mark.parametrize("name", FILES)
def test_the_shipped_file_has_the_papers_numbers(name):
    read, expected = FILES[name]
    found = read(name, shipped(name).read_text())
    assert found == pytest.approx(expected(name), rel=1e-12, abs=0.0)


def test_equations_1_to_3_and_the_tolerance_of_table_3():
    for clearance in (2e-4, 5e-4):
        joint = jp.RevoluteClearance(
            radial_clearance=clearance,
            axial_clearance=clearance,
            bearing_radius=ASSUMED["R_i"],
            bearing_length=ASSUMED["L_i"],
        )
        bore, journal, half_bearing, half_journal = joint.dimensions
        assert bore == ASSUMED["R_i"]
        assert 2.0 * half_bearing == ASSUMED["L_i"]
        assert bore - journal == pytest.approx(clearance, rel=1e-12)  # eq. 1
        # eqs 2, 3: C_a = (L_i - L_j) / 2
        assert 0.5 * (2 * half_bearing - 2 * half_journal) == pytest.approx(clearance, rel=1e-9)
        # Moved by its clearance along the axis, or across it, the journal just touches.
        for contact, at in ((2, (0.0, 0.0, clearance)), (0, (clearance, 0.0, 0.0))):
            gap = touch_cylinder(contact, *at, 0.0, 0.0, 1.0, *joint.dimensions)[0]
            assert gap == pytest.approx(0.0, abs=1e-10)
    assert CONTACT_TOLERANCE_M == 1e-7
