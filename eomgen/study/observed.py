"""A run with the functions of its module, from which outputs are computed after the run."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from eomgen.base.errors import RunError
from eomgen.dynamics.start.assembly import assembled
from eomgen.model.elaborate import available_in, elaborate, in_order, outputs_for
from eomgen.model.model import Model
from eomgen.run.module import load_module
from eomgen.run.problem import FloatArray
from eomgen.run.setup import Setup
from eomgen.run.sizes import mechanism_size
from eomgen.run.trajectory import Trajectory
from eomgen.scene.reader import read_tables
from eomgen.scene.schema import SHOWN, Scene
from eomgen.scene.tables import tables_of
from eomgen.store import Code, generated_code


def setup_of(
    scene: Scene,
    model: Model,
    parameters: Mapping[str, float],
    inputs: Mapping[str, float],
    *,
    varying: FloatArray | None = None,
) -> Setup:
    """What outputs of a run of a scene are computed from; form and route are those of `model`."""
    tables = {**tables_of(scene), "form": model.form, "route": model.route}
    if model.loops_kept != "auto":
        tables["loops"] = model.loops_kept
    text = json.dumps(tables, ensure_ascii=False, separators=(",", ":"))
    return Setup(text, dict(parameters), dict(inputs), varying)


@dataclass(frozen=True, eq=False)
class Observed:
    """A run that can be asked for outputs.

    scene       the scene of the run
    model       its model, with the scene's own values of parameters
    code        its generated code
    functions   its module, loaded
    trajectory  times and states
    """

    scene: Scene
    model: Model
    code: Code
    functions: Any
    trajectory: Trajectory

    @cached_property
    def setup(self) -> Setup:
        """The values of the run."""
        assert self.trajectory.setup is not None
        return self.trajectory.setup

    @cached_property
    def parameters(self) -> dict[str, float]:
        """The values of all parameters in the run."""
        return {**self.model.defaults, **self.setup.parameters}

    @cached_property
    def length(self) -> float:
        """A typical length of the mechanism, m."""
        first = dict(zip(self.trajectory.states, self.trajectory.y[0].tolist(), strict=True))
        values = {**self.functions.PARAMETERS, **self.setup.parameters}
        return float(mechanism_size(self.functions.UNITS, values, first))

    def values(self, t: FloatArray) -> tuple[Any, Any]:
        """Parameters and inputs at times (n,), as the functions of the module take them.

        Inputs that are tables or functions of time are known at the rows of the run; between them
        they are taken as linear.
        """
        varying = self.setup.varying
        if varying is None:
            return self.setup.parameters or None, self.setup.inputs or None
        rows = self.trajectory.t
        return self.setup.parameters or None, np.array([np.interp(t, rows, u) for u in varying.T])

    def output(self, name: str, t: FloatArray, y: FloatArray) -> FloatArray:
        """An output at states `y` (n, ny), (n, …); also "derivative".

        Raises `RunError` if the module refuses these states.
        """
        try:
            with np.errstate(all="ignore"):
                found = getattr(self.functions, name)(t, y.T, *self.values(t))
        except (ValueError, ArithmeticError) as error:
            raise RunError(f"{self.trajectory.name}: no {name} of this run: {error}") from None
        return np.moveaxis(np.asarray(found), -1, 0)


def observed(trajectory: Trajectory, outputs: Sequence[str] = ()) -> Observed:
    """A run with a module that has what figures need and `outputs`.

    Raises `RunError` if the run does not hold its scene, `SceneError` if the scene cannot be read
    or lacks what an output is about.
    """
    if trajectory.setup is None:
        raise RunError(
            f"{trajectory.name}: this run does not hold its scene; simulate again, and its file "
            "will"
        )
    try:
        tables = trajectory.setup.tables()
    except (ValueError, RecursionError):
        raise RunError(f"{trajectory.name}: the scene of this run is damaged") from None
    scene = read_tables(tables, trajectory.name)
    model = assembled(elaborate(scene))
    wanted = outputs_for(outputs, trajectory.name, available_in(model))
    model = replace(model, outputs=in_order((*model.outputs, *SHOWN, *wanted)))
    code = generated_code(model)
    functions = load_module(code.module, model.name)
    found = Observed(scene, model, code, functions, trajectory)
    _check(found)
    return found


def _check(run: Observed) -> None:
    """Raise `RunError` for a file in which states or values are not those of its scene."""
    trajectory, setup, inputs = run.trajectory, run.setup, run.functions.INPUTS
    shape = (len(trajectory.t), len(inputs))
    values = [*setup.parameters.values(), *setup.inputs.values()]
    if (
        tuple(run.functions.STATES) != trajectory.states
        or not setup.parameters.keys() <= run.model.defaults.keys()
        or not setup.inputs.keys() <= inputs.keys()
        or not np.isfinite(values).all()
        or (setup.varying is not None and setup.varying.shape != shape)
    ):
        raise RunError(f"{trajectory.name}: states or values of this run are not of its scene")
