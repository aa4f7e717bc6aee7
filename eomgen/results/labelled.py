"""Runs as tables of pandas and datasets of xarray, with names and units."""

from collections.abc import Mapping
from importlib.util import find_spec
from typing import TYPE_CHECKING

from eomgen.base.errors import RunError
from eomgen.model.model import Model
from eomgen.run.trajectory import Trajectory, table_of
from eomgen.tables.outputs import OUTPUTS

if TYPE_CHECKING:
    import pandas
    import xarray


def units_of(trajectory: Trajectory, model: Model, states: Mapping[str, str]) -> dict[str, str]:
    """The unit of each column of the table of a run, by name, without those that have none.

    states  units of states, and of coordinates and velocities that follow from them
    """
    found = {"t": "s"} | {f"work_{name}": "J" for name in trajectory.work_names}
    found |= {f"input_{each.name}": each.unit for each in model.inputs}
    for name, saved in trajectory.saved.items():
        if spec := OUTPUTS.get("kinetic_energy" if name == "energy" else name):
            for column in saved.columns:
                found[column] = spec.unit(column.rpartition("_")[2], model.dimensions)
    found |= states
    return {name: found[name] for name in table_of(trajectory) if found.get(name)}


def dataframe(trajectory: Trajectory, units: Mapping[str, str]) -> "pandas.DataFrame":
    """The table that `save_csv` writes, as pandas' DataFrame with `t` as its index; units are in
    `attrs["units"]`. Raises `RunError` without pandas.
    """
    need_package("pandas", "to_dataframe")
    import pandas

    table = pandas.DataFrame(table_of(trajectory)).set_index("t")
    table.attrs |= {"scene": trajectory.name, "units": dict(units)}
    return table


def dataset(trajectory: Trajectory, units: Mapping[str, str]) -> "xarray.Dataset":
    """The same as an xarray.Dataset over `t`, each variable with its `units`. Raises `RunError`
    without xarray.
    """
    need_package("xarray", "to_xarray")
    import xarray

    columns = table_of(trajectory)
    variables = {
        name: ("t", values, {"units": units[name]} if name in units else {})
        for name, values in columns.items()
    }
    return xarray.Dataset(variables, attrs={"scene": trajectory.name}).set_coords("t")


def need_package(package: str, what: str) -> None:
    """Raise `RunError`, which says what to install for `what`, if a package is absent."""
    if find_spec(package) is None:
        raise RunError(f"{what}: needs {package}; run: pip install 'eomgen[tables]'")
