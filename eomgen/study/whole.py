"""States of all coordinates of a model, and those of its module, which may have fewer.

Where loops are closed in closed form, coordinates and velocities that follow from others are no
states of the module: `FOLLOWING` names them, and `coordinates` and `velocities` compute them.
"""

from typing import Any

import numpy as np

from eomgen.base.errors import SceneError
from eomgen.model.model import Model
from eomgen.run.problem import FloatArray
from eomgen.tables.outputs import DYNAMICS, OUTPUTS

OWN = (
    "constraint_residuals",
    "constraint_rates",
    "constraint_jacobian",
    "constraint_margins",
)
"""Functions of the state beside `OUTPUTS`."""
SAME = 1e-6
"""The largest difference of a coordinate, rad or m, or relative, that is one of rounding."""


def names_of(model: Model) -> list[str]:
    """The names of all coordinates, velocities and extra states, [q, v, x]."""
    names = [c.name for c in (*model.coordinates, *model.velocities)]
    return [*names, *(x.name for x in model.extra)]


def has_all(module: Any) -> bool:
    """Whether the state of a module has all of them."""
    return not getattr(module, "FOLLOWING", ())


def initial_of(module: Any, model: Model, parameters: Any = None) -> FloatArray:
    """The initial state of all coordinates, or of a model of another form that of the module."""
    if has_all(module):
        return np.asarray(module.initial_state(parameters))
    extra = (x.initial for x in model.extra)
    return np.array([*model.initial_q, *model.initial_v, *extra])


def own_of(module: Any, model: Model, whole: FloatArray) -> FloatArray:
    """The state of a module for one of all coordinates, (n,) or (n, k)."""
    if has_all(module):
        return whole
    names = names_of(model)
    return whole[[names.index(name) for name in module.STATES]]


def whole_of(
    module: Any, model: Model, t: Any, y: FloatArray, parameters: Any = None, inputs: Any = None
) -> FloatArray:
    """The state of all coordinates for one of a module, (n,) or (n, k)."""
    if has_all(module):
        return y
    extra = y[len(y) - len(model.extra) :]
    found = (module.coordinates, module.velocities)
    return np.concatenate([*(each(t, y, parameters, inputs) for each in found), extra])


def following(
    module: Any, model: Model, t: Any, y: FloatArray, parameters: Any = None, inputs: Any = None
) -> FloatArray:
    """What a module names in `FOLLOWING`, (nf,) or (nf, k)."""
    names = names_of(model)
    whole = whole_of(module, model, t, y, parameters, inputs)
    return whole[[names.index(name) for name in module.FOLLOWING]]


class Viewed:
    """A module as if all coordinates of its model were states: its functions take such states, of
    which they read those that the module has. It has no `jacobian`.
    """

    def __init__(self, module: Any, model: Model) -> None:
        self.own, self._model = module, model
        self.STATES = tuple(names_of(model))
        self.POSITIONS = tuple(range(len(model.coordinates)))
        self.QUATERNIONS = model.quaternions

    def derivative(self, t: Any, y: FloatArray, p: Any = None, u: Any = None) -> FloatArray:
        """ẏ (n,) or (n, k)."""
        module, model = self.own, self._model
        own = own_of(module, model, y)
        found = np.asarray(module.derivative(t, own, p, u))
        names = names_of(model)
        rates = np.empty((len(names), *found.shape[1:]))
        nq, nv = len(model.coordinates), len(model.velocities)
        speeds = module.velocities(t, own, p, u)
        for index in model.joint_indices:
            for i, j in index.plain:
                rates[i] = speeds[j]
        rates[nq : nq + nv] = module.accelerations(t, own, p, u)
        for name, row in zip(module.STATES, found, strict=True):
            rates[names.index(name)] = row
        return rates

    def __getattr__(self, name: str) -> Any:
        if name in ("jacobian", "parameter_jacobian", "input_jacobian"):
            raise AttributeError(name)
        found = getattr(self.own, name)
        if name in DYNAMICS:
            return lambda q, v, *extra, **more: self._split(found, q, v, *extra, **more)
        if name not in (*OUTPUTS, *OWN):
            return found
        return lambda t, y, *given: found(t, own_of(self.own, self._model, y), *given)

    def _split(self, function: Any, q: FloatArray, v: FloatArray, *extra: Any, **more: Any) -> Any:
        """A function of q and v apart."""
        names = names_of(self._model)
        whole = dict(zip(names, (*q, *v), strict=False))
        parts = self.own.STATES[: len(self.own.POSITIONS)], self.own.STATES
        q = np.array([whole[name] for name in parts[0]])
        v = np.array([whole[name] for name in parts[1][len(q) :] if name in whole])
        return function(q, v, *extra, **more)


def viewed(module: Any, model: Model) -> Any:
    """A module whose states are all coordinates of its model: itself, or a view of it."""
    return module if has_all(module) else Viewed(module, model)


def on_branch(
    module: Any, model: Model, whole: FloatArray, parameters: Any = None, inputs: Any = None
) -> FloatArray:
    """The state of a module for one of all coordinates, which is to be on the module's branch.

    Raises `SceneError` if it is on another.
    """
    y = own_of(module, model, whole)
    if has_all(module):
        return y
    try:
        found = whole_of(module, model, 0.0, y, parameters, inputs)
    except (ArithmeticError, ValueError):
        found = np.full(len(whole), np.nan)
    off = np.abs(found - whole) <= SAME * np.maximum(1.0, np.abs(whole))
    if not off.all():
        name = names_of(model)[int(np.argmin(off))]
        raise SceneError(
            f"initial: {name} is on another branch of its loop, or in another turn, than in the "
            "scene, whose branch is part of the equations; write this start into the scene, or "
            "give loops = 'projected' there"
        )
    return y
