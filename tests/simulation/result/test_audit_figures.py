"""The audit's figures from records written by hand: two joints of two contacts, three records."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from jointplay.model.gear import Gear
from jointplay.physics.kernel.layout import FRICTION, POWERS, Quantity
from jointplay.simulation.result import audit
from jointplay.simulation.result import audit as audit_module
from jointplay.simulation.result.audit import Audit
from jointplay.simulation.result.variables import Records
from jointplay.simulation.statics import Rest

TIME = np.array([0.0, 0.1, 0.2])
Q = np.array([[0.3, 0.0, 0.1], [0.2, 0.5, 0.9], [0.1, 0.6, 0.0]])
"""Coordinates: one of the arm's, a motor's, and that of the link behind its gear."""
NORMAL_PEAKS = np.array([[1.0, 2.0, 3.0, 4.0], [5.0, 90.0, 30.0, 8.0], [9.0, 10.0, 11.0, 12.0]])
FORCE_PEAKS = np.array(
    [[3.0, 4.0, 0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 2.0, 6.0, 8.0, 0.0], [0.0, 7.0, 0.0, 1.0, 0.0, 0.0]]
)
"""Sizes 5, 1; 2, 10; 7, 1 [N]."""
FORCES = np.array([[2.0, 0, 0, 0, 0, 1.0], [0, 0, 2.0, 6.0, 8.0, 0], [0, 6.0, 0, 1.0, 0, 0]])
IMPULSES = np.array([[0.1, 0.3, 0.2], [0.65, 0.8, 0.05]])
"""Of all steps, here just what the forces come to by the trapezium rule [N s]."""
STATISTICS = {
    "onsets": np.array([[2, 1], [4, 0]]),
    "shortest_steps": np.array([[np.inf, 12.0], [7.0, np.inf]]),
    "under_resolved": np.array([[0, 1], [2, 0]]),
    "impulse": np.array([[1.0, 3.0], [4.0, 0.0]]),
    "under_resolved_impulse": np.array([[0.0, 0.5], [1.5, 0.0]]),
    "smallest_gap": np.array([[-2e-6, 1e-6], [-1e-6, -3e-6]]),
    "fastest_approach": np.array([[0.1, 0.4], [0.2, 0.3]]),
}


class Law:
    """Tells what it is asked."""

    def warnings(self, contact, *, max_depth, max_speed):
        return [f"{contact} {max_depth:g} m {max_speed:g} m/s"]


class Film:
    contacts = 1

    def warnings(self, film, *, thinnest):
        return [f"thinnest {thinnest:g} m"]


def bearing(*rooms, film=None, kinds=("rim", "rim")):
    return SimpleNamespace(
        contacts=("A", "B"),
        contact_clearances=rooms,
        normal=Law(),
        film=film,
        resultant=None,
        springs=None,
        contact_properties=lambda k: kinds[k],
    )


@pytest.fixture
def mechanism():
    return SimpleNamespace(
        clearance={"b": bearing(1e-4, 2e-4), "c": bearing(1e-5, 1e-6)},
        gears={"g": Gear(play=0.7, rotor_inertia=1.0, stiffness=1.0)},
        motor=lambda name: 1,
        coordinate=lambda name: 2,
    )


@pytest.fixture
def workspace():
    """What the kernels counted."""
    return SimpleNamespace(
        unresolved=4,
        run={"unsolved": [6]},
        joints={"impulse": IMPULSES.copy()},
        contact_statistics=lambda: STATISTICS,
    )


RECORDS = Records(
    np.hstack([TIME[:, None], Q, np.zeros((3, 3)), NORMAL_PEAKS, FORCE_PEAKS, FORCES]),
    {
        "time": Quantity(slice(0, 1), ()),
        "q": Quantity(slice(1, 4), (3,)),
        "v": Quantity(slice(4, 7), (3,)),
        "normal_peak": Quantity(slice(7, 11), (2, 2)),
        "force_peak": Quantity(slice(11, 17), (2, 3)),
        "force": Quantity(slice(17, 23), (2, 3)),
    },
)


@pytest.fixture
def audited(mechanism, workspace, monkeypatch):
    """Audit the records; limit of friction is 1e-3 s N over the force, teeth take as many us as the
    first coordinate has milliradians."""
    asked = []

    def limit(mechanism, name, q, force):
        asked.append((name, *q, force))
        return 1e-3 / force

    monkeypatch.setattr(audit, "friction_step_limit", limit)
    monkeypatch.setattr(audit, "worst", lambda *_: np.array([0]))
    monkeypatch.setattr(audit, "beyond", lambda *_: ("limit",))
    monkeypatch.setattr(audit, "tooth_duration", lambda mechanism, name, q: 1e-3 * q[0])

    def make(
        *,
        integrator="semi-implicit-euler",
        tolerance=None,
        judged_from=0.0,
        rest=None,
        unjudged=None,
        kinetic=None,
        potential=None,
        elastic=None,
        work=None,
        records=RECORDS,
        portion=None,
    ):
        monkeypatch.setattr(audit, "PORTION", portion or 4096)
        simulation = {
            "integrator": integrator,
            "step": 2e-5,
            "tolerance": tolerance,
            "limits": "report",
        }
        kinetic = np.array([0.0, 2.0, 1.0]) if kinetic is None else kinetic
        potential = np.array([1.0, 0.5, 0.5]) if potential is None else potential
        work = np.zeros((3, len(POWERS))) if work is None else work
        residual, drift = np.array([0.01, -0.04, 0.02]), np.array([1e-7, 3e-7, 0.0])
        watching = audit.Auditor(mechanism, simulation, judged_from)
        elastic = np.zeros(3) if elastic is None else elastic
        histories = (kinetic, potential), work, residual, drift, np.zeros((3, 3)), elastic
        state = records.recorded("q"), records.recorded("v")
        watching.add_records(records, state, *histories)
        return watching.audit(workspace, rest, unjudged), asked

    return make


def test_sums_and_extremes_are_over_all_contacts_of_all_joints(audited):
    audit, _ = audited()
    assert (audit.impacts, audit.shortest_contact_steps, audit.under_resolved) == (7, 7, 3)
    assert audit.normal_impulse == 8.0
    assert audit.under_resolved_impulse == 2.0 / 8.0
    assert audit.largest_penetration == 3e-6
    assert audit.penetration_over_clearance == pytest.approx(3.0)
    assert audit.energy_residual == 0.04
    assert audit.loop_drift == 3e-7
    assert (audit.unsolved, audit.unresolved, audit.step) == (6, 4, 2e-5)
    assert audit.limit_warnings == ("limit",)


@pytest.mark.parametrize("portion", [1, 2])
def test_portions_come_to_the_same(audited, portion):
    work = np.zeros((3, len(POWERS)))
    work[:, FRICTION] = [0.0, 4.0, 3.5]
    whole, _ = audited(work=work, judged_from=0.2)
    assert audited(work=work, judged_from=0.2, portion=portion)[0] == whole


def test_a_machine_at_rest_under_load_exchanges_at_least_what_its_speeds_are_unknown_by(audited):
    still = {"kinetic": np.zeros(3), "work": np.zeros((3, len(POWERS)))}
    found = audited(**still, potential=np.ones(3))[0]
    assert found.energy_exchanged == pytest.approx(10.0 * 1e-9 * TIME[-1])


def test_energy_exchanged_is_the_largest_variation(audited):
    assert audited()[0].energy_exchanged == 3.0  # kinetic: up by 2, down by 1
    work = np.zeros((3, len(POWERS)))
    work[:, FRICTION] = [0.0, 4.0, 3.5]
    audit, _ = audited(work=work)
    assert audit.energy_exchanged == 4.5
    assert audit.friction_fed == 0.5
    # Steady motion: rounding is measured against a millionth of its energy.
    assert audited(kinetic=np.full(3, 7e6))[0].energy_exchanged == pytest.approx(7.0)
    assert audited(elastic=np.full(3, 7e6))[0].energy_exchanged == pytest.approx(7.0)


def resting(force, peak, impulse, size=1000):
    """Joint b bears a force along y that the records show all alike, 0.1 s apart; c bears none."""
    rows = np.zeros((size, 23))
    rows[:, 0] = 0.1 * np.arange(size)
    rows[:, 12], rows[:, 18] = peak, force
    return Records(rows, RECORDS.fields), np.array([[0, impulse, 0], [0, 0, 0]])


def miss(mechanism, workspace, records, impulses):
    workspace.joints["impulse"] = impulses
    simulation = {"integrator": "multi-rate", "step": 2e-5, "tolerance": None, "limits": "ignore"}
    watching = audit.Auditor(mechanism, simulation, 0.0)
    n = records.rows
    nothing, efforts = np.zeros(n), np.zeros((n, 3))
    work, energies = np.zeros((n, len(POWERS))), (np.zeros(n), np.zeros(n))
    state = records.recorded("q"), records.recorded("v")
    watching.add_records(records, state, energies, work, nothing, np.zeros(0), efforts, nothing)
    return watching.audit(workspace, None, None).impulse_missed


def test_records_on_one_side_of_a_force_that_alternates_are_seen(mechanism, workspace, audited):
    """7.735 N at every record, 21.88 N between them, 14.807 N on average: half is missing."""
    audited()  # with the limits of friction out of the way
    case = resting(7.735, 21.88, 14.807 * 99.9)
    found = miss(mechanism, workspace, *case)
    whole = (14.807 - 7.735) / 14.807
    unknown = 5.0 * (21.88 - 7.735) / 14.807 / np.sqrt(999)
    assert found == pytest.approx(whole - unknown, rel=1e-9)
    said = Audit(**(audited()[0].describe() | {"impulse_missed": found})).warnings
    assert [text for text in said if f"miss {100 * found:.2g} % of its impulse" in text]


@pytest.mark.parametrize("portion", [1, 7, 4096])
def test_records_that_come_to_the_impulse_miss_nothing(
    mechanism, workspace, audited, monkeypatch, portion
):
    audited()
    monkeypatch.setattr(audit, "PORTION", portion)
    assert miss(mechanism, workspace, *resting(14.807, 14.807, 14.807 * 99.9)) < 1e-12
    # Impacts between records are no lasting miss: that they are seen by chance is reckoned with.
    assert miss(mechanism, workspace, *resting(0.0, 90.0, 90.0, 50)) == 0.0


def test_friction_is_asked_at_the_start_for_each_joints_largest_force(audited):
    audit, asked = audited()
    assert asked == [("b", *Q[0], 90.0), ("c", *Q[0], 30.0)]
    assert audit.friction_step_limit == 1e-3 / 90.0
    asked.clear()
    assert audited(integrator="multi-rate")[0].friction_step_limit == math.inf
    assert not asked


def test_run_without_records_has_no_limit_of_friction_nor_teeth(audited):
    audit, asked = audited(records=RECORDS.part(0, 0))
    assert not asked
    assert audit.friction_step_limit == audit.tooth_steps == math.inf
    assert audit.peak_force == 0.0


def test_teeth_that_touch_are_resolved_by_the_first_records_duration(audited, mechanism):
    assert audited()[0].tooth_steps == pytest.approx(3e-4 / 2e-5)  # 0.6 rad apart, play 0.7
    assert audited(tolerance=1e-6)[0].tooth_steps == math.inf
    mechanism.gears["g"] = Gear(1.2, 1.0, 1.0)
    assert audited()[0].tooth_steps == math.inf  # just not through the play
    mechanism.gears["g"] = Gear(1.1, 1.0, 1.0)
    assert audited()[0].tooth_steps < math.inf


def test_all_is_judged_unless_told_otherwise(audited):
    audit, _ = audited()
    assert (audit.judged_from, audit.judged_impacts, audit.judged_impulse) == (0.0, 7, 8.0)
    assert (audit.peak_force, audit.peak_force_before) == (10.0, None)


def test_what_came_before_is_told_apart(audited):
    before = {"onsets": np.array([[1, 1], [2, 0]]), "impulse": np.array([[0.5, 0.5], [1.0, 0.0]])}
    rest = Rest(np.zeros(3), 1e-9, 5.0, 1, True, {})
    found, _ = audited(judged_from=0.2, rest=rest, unjudged=before)
    assert (found.judged_impacts, found.judged_impulse) == (3, 6.0)
    assert (found.peak_force, found.peak_force_before) == (7.0, 10.0)
    assert (found.start, found.start_residual, found.start_load) == ("rest", 1e-9, 5.0)
    found, _ = audited(judged_from=0.1)
    assert (found.peak_force, found.peak_force_before) == (10.0, 5.0)


def test_small_forces_are_no_less_than_they_are(audited):
    small = RECORDS.rows_of.copy()
    small[:, 7:] *= 0.01
    records = Records(small, RECORDS.fields)
    found, asked = audited(judged_from=0.2, records=records)
    assert (found.peak_force, found.peak_force_before) == pytest.approx((0.07, 0.1))
    assert [force for *_, force in asked] == pytest.approx([0.9, 0.3])


def test_laws_are_asked_at_the_deepest_and_fastest_of_contacts_alike(mechanism):
    said = audit_module.out_of_range(mechanism, STATISTICS)
    # The second contact of c never began; of two contacts alike one line.
    assert said == ("joint 'b': rim 2e-06 m 0.4 m/s", "joint 'c': rim 1e-06 m 0.2 m/s")
    mechanism.clearance["b"].contact_properties = lambda k: ("rim", "end")[k]
    mechanism.clearance["b"].film = Film(), Film()
    assert audit_module.out_of_range(mechanism, STATISTICS)[:3] == (
        "joint 'b': rim 2e-06 m 0.1 m/s",
        "joint 'b': end 0 m 0.4 m/s",
        "joint 'b': thinnest -2e-06 m",
    )
    Film.contacts = 2
    assert "thinnest -2e-06" in audit_module.out_of_range(mechanism, STATISTICS)[2]
    Film.contacts = 1


def test_error_by_the_step_needs_both_figures(audited):
    told = audited()[0].describe()
    for one in ({"step_error": 1e-3}, {"relative_step_error": 1e-3}):
        assert "error by the step" not in str(Audit(**(told | one)))
