"""Runs and ensembles for pandas and xarray: the numbers, names and units of the run."""

import numpy as np
import pytest

import eomgen
from eomgen.results import labelled


def test_a_run_as_table_and_dataset() -> None:
    """The same columns as the table on disk, with units."""
    run = eomgen.simulate("cart_pole", t_end=0.3, save=["energy", "joint_forces"], works=True)
    table, data = run.to_dataframe(), run.to_xarray()
    assert list(table.columns) == [name for name in data.variables if name != "t"]
    for name in run.states:
        assert np.array_equal(table[name], run[name])
        assert np.array_equal(data[name], run[name])
    assert np.array_equal(table.index, run.t) and np.asarray(run) is run.y
    assert np.array_equal(np.asarray(run, np.float32), run.y.astype(np.float32))
    assert np.array_equal(data.sel(t=run.t[3])["theta"], run["theta"][3])
    units = table.attrs["units"]
    assert {name: data[name].attrs["units"] for name in units} == units
    assert [units[name] for name in ("theta", "x_dot", "energy")] == ["rad", "m/s", "J"]
    forces = run.saved["joint_forces"][:, -1, :]
    last = [name for name in table.columns if name.startswith("joint_forces")][-3:]
    assert np.array_equal(table[last], forces)
    assert [units[name] for name in last] == ["N", "N", "N m"]
    assert next(units[name] for name in table.columns if name.startswith("work_")) == "J"


def test_rotation_matrices_have_no_unit() -> None:
    """Of a pose in space only the position is in metres."""
    run = eomgen.simulate("spinning_top", t_end=0.1, samples=3, save=["poses"])
    units = run.to_dataframe().attrs["units"]
    poses = [name for name in run.to_dataframe().columns if name.startswith("body_poses")]
    assert {name[-1] for name in poses if name in units} == {"4"}
    assert {name[-1] for name in poses} == set("1234")


def test_times_of_impacts_stand_twice() -> None:
    """As in the table: two rows, of which one is the impact's."""
    run = eomgen.simulate("bouncing_two_body", t_end=1.0)
    assert run.to_dataframe().index.has_duplicates
    assert np.array_equal(run.to_xarray()["event"], run.trajectory.struck)


def test_a_grid_has_its_parameters_as_dimensions() -> None:
    """Values, times and units; a varied state keeps its start apart from its run."""
    axes = {"m_pole": [0.1, 0.2], "theta": [0.1, 0.2, 0.3]}
    many = eomgen.ensemble(
        "cart_pole", eomgen.grid(axes), t_end=0.2, samples=3, outputs=["momentum"]
    )
    data = many.to_xarray()
    assert data["x"].dims == ("m_pole", "theta", "t")
    assert data["momentum"].shape == (2, 3, 3, 3)
    assert data["m_pole"].attrs["units"] == "kg"
    member = data["theta_run"].sel(m_pole=0.2, theta=0.1)
    assert member.attrs["units"] == "rad"
    assert many.rows is not None
    assert np.array_equal(member, many.rows[3, :, 1])
    assert (data["status"] == "finished").all()


def test_members_without_a_grid_are_one_dimension() -> None:
    """Drawn values are coordinates along `member`."""
    drawn = eomgen.sampled({"bob_mass": ("uniform", 1.0, 2.0)}, 4)
    many = eomgen.ensemble("pendulum", drawn, t_end=0.1)
    data = many.to_xarray()
    assert data["theta"].dims == ("member",)
    assert np.array_equal(data["theta"], many.final[:, 0])
    assert np.array_equal(data["bob_mass"], drawn.values[:, 0])


def test_a_missing_package_is_a_line(monkeypatch: pytest.MonkeyPatch) -> None:
    """It says what to install."""
    run = eomgen.simulate("pendulum", t_end=0.1)
    monkeypatch.setattr(labelled, "find_spec", lambda name: None)
    with pytest.raises(eomgen.RunError, match=r"needs xarray; run: pip install 'eomgen\[tables\]'"):
        run.to_xarray()
    with pytest.raises(eomgen.RunError, match="needs pandas"):
        run.to_dataframe()
