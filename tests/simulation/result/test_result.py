"""Results: what they hold, saving, loading, running again."""

import dataclasses

import numpy as np
import pytest

import jointplay as jp
from jointplay import JointplayError, Result
from jointplay.paper import scara
from jointplay.simulation.result import FORMAT, netcdf
from jointplay.simulation.result.histories import compile_histories


@pytest.fixture(scope="module")
def result():
    return dataclasses.replace(scara(2e-4, seed=3), duration=0.1).run()


def test_dimensions_and_units(result):
    assert result["q"].dims == ("time", "coordinate")
    assert result["gap"].dims == ("time", "joint", "contact")
    assert result["joint_force"].dims == ("time", "joint", "axis")
    assert result["tool_position"].attrs["units"] == "m"
    assert result["normal_force"].attrs["units"] == "N"
    assert result.dataset["time"].attrs["units"] == "s"
    assert list(result.dataset["coordinate_unit"].values[:5]) == ["rad", "m", "m", "m", "rad"]
    for variable in result.dataset.data_vars.values():
        assert "units" in variable.attrs
        assert variable.attrs["long_name"]


def test_joint_force_is_the_sum_of_the_contacts(result):
    # In free flight nothing; with one contact normal and friction force at right angles.
    normal = result["normal_force"].values[:, 0]
    friction = result["friction_force"].values[:, 0]
    force = np.linalg.norm(result["joint_force"].values[:, 0], axis=1)
    touching = (normal > 0).sum(axis=1)
    assert (force[touching == 0] == 0.0).all()
    single = touching == 1
    assert single.sum() > 5
    expected = np.hypot(normal.sum(axis=1), friction.sum(axis=1))
    assert np.allclose(force[single], expected[single])


def test_modes_and_forms_agree_with_the_gaps(result):
    smallest = result["gap"].values.min(axis=2)
    mode = result["mode"].values
    assert np.array_equal(mode == 0, smallest > 1e-7)
    assert np.array_equal(mode == 2, smallest < -1e-7)
    assert np.array_equal(result["form"].values == 0, mode == 0)
    assert result["mode"].attrs["flag_meanings"].split()[2] == "pseudo_penetration"


def test_tool_velocity_is_the_derivative_of_its_position(result):
    position, velocity = (result[f"tool_{name}"].values for name in ("position", "velocity"))
    slope = np.gradient(position, result.time, axis=0)
    assert np.abs(slope - velocity)[1:-1].max() < 0.02 * np.abs(velocity).max()


def test_save_load_and_rerun_bit_for_bit(result, tmp_path):
    loaded = Result.load(result.save(tmp_path / "r.nc"))
    assert loaded.status == result.status
    assert loaded.audit == result.audit
    again = loaded.simulation.run()
    for name, variable in result.dataset.data_vars.items():
        assert np.array_equal(variable.values, loaded[name].values), name
        assert np.array_equal(variable.values, again[name].values), name
        assert variable.attrs["units"] == loaded[name].attrs["units"]
    assert "jointplay" in loaded.dataset.attrs["versions"]


def test_unwritable_and_unreadable_files_are_named(result, tmp_path):
    with pytest.raises(JointplayError, match="cannot write"):
        result.save(tmp_path / "nowhere" / "r.nc")
    with pytest.raises(JointplayError, match="no result file"):
        Result.load(tmp_path / "none.nc")
    damaged = tmp_path / "damaged.nc"
    damaged.write_bytes(result.save(tmp_path / "r.nc").read_bytes()[:3000])
    with pytest.raises(JointplayError, match="damaged or not a result"):
        Result.load(damaged)
    foreign = tmp_path / "foreign.nc"
    foreign.write_bytes(netcdf.pack(result.dataset.drop_attrs()))
    with pytest.raises(JointplayError, match="not a jointplay result"):
        Result.load(foreign)


def test_a_result_of_another_format_is_refused_with_both_formats(result, tmp_path):
    other = Result(result.dataset.assign_attrs(jointplay_format=FORMAT - 1)).save(tmp_path / "o.nc")
    with pytest.raises(JointplayError, match=f"format {FORMAT - 1}; .* only format {FORMAT}:"):
        Result.load(other)


@pytest.mark.thorough
def test_orientations_of_another_convention_are_refused(result, tmp_path):
    swapped = Result(result.dataset.assign_coords(quaternion=["x", "y", "z", "w"]))
    with pytest.raises(JointplayError, match=r"it has \['x', 'y', 'z', 'w'\], not w, x"):
        Result.load(swapped.save(tmp_path / "swapped.nc"))
    turned = result.dataset.copy()
    turned["tool_orientation"] = turned["tool_orientation"].T
    with pytest.raises(JointplayError, match=r"tool_orientation has the dimensions"):
        Result.load(Result(turned).save(tmp_path / "turned.nc"))


def test_the_orientation_says_its_convention_and_agrees_with_the_angular_velocity(result):
    turn = result["tool_orientation"]
    assert "scalar comes first" in turn.attrs["comment"]
    assert turn["quaternion"].values.tolist() == ["w", "x", "y", "z"]
    # With the scalar first, dq/dt = (0, omega) q / 2.
    w, v = turn.values[:, :1], turn.values[:, 1:]
    omega = result["tool_angular_velocity"].values
    rate = np.hstack([-(omega * v).sum(axis=1, keepdims=True), w * omega + np.cross(omega, v)]) / 2
    slope = np.gradient(turn.values, result.time, axis=0)
    assert np.abs(slope - rate)[1:-1].mean() < 0.02 * np.abs(rate).max()


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("name", ["scara", "four_bar", "gantry"])
def test_histories_that_are_compiled_ahead_leave_no_trace(name):
    scenario = jp.Scenario.load(jp.shipped(f"{name}.toml"))
    simulation = dataclasses.replace(scenario.simulation(scenario.cases[-1]), duration=2e-3)
    ahead = jp.Run(simulation)
    compile_histories(ahead)
    found = [run.finish(check_step=False).dataset for run in (ahead, jp.Run(simulation))]
    assert found[0].drop_attrs().identical(found[1].drop_attrs())


def test_a_file_that_is_deleted_after_what_it_writes_to_says_nothing(tmp_path):
    """Python 3.13 prints what goes wrong there."""
    with (tmp_path / "result.nc").open("wb") as file:
        behind = netcdf._CheckedFile(file)
    behind.close()
