"""Controllers that sample, given to a run beside its scene: tables, or functions of Python."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eomgen.api.reporter import SILENT, Reporter
from eomgen.base.errors import RunError, nearest
from eomgen.language.base import Table
from eomgen.run.problem import FloatArray
from eomgen.run.sampling import Function
from eomgen.scene.entries import maker
from eomgen.scene.schema import Scene

State = Mapping[str, Any]
"""Numbers and arrays by name."""
Returned = Mapping[str, Any] | tuple[Mapping[str, Any], State]


@dataclass(frozen=True, kw_only=True)
class Controller:
    """A controller that samples and is a function of Python, for `simulate(…, controllers=[…])`.

    function  (t, sensed, state) -> inputs, or inputs and state, all by name: what it holds until
              the next sample, and those states that change. It should remember nothing else, so
              that a run can be repeated
    period    time from one sample to the next, s
    inputs    names of the inputs of the scene that it drives
    sensors   by name a formula of what it measures, or a table of `value`, `noise`, `quantum` and
              `unit`
    states    its states at the start by name: numbers or arrays
    delay     time from a sample to the change of the inputs, s
    seed      whole number from which the noise follows
    name      its own
    """

    function: Callable[[float, Mapping[str, float], State], Returned]
    period: float
    inputs: Sequence[str]
    sensors: Mapping[str, Any] = field(default_factory=dict)
    states: Mapping[str, ArrayLike] = field(default_factory=dict)
    delay: float = 0.0
    seed: int = 1
    name: str = "controller"

    @property
    def table(self) -> Table:
        """The same as a table of a scene, whose inputs and states stay as they are."""
        first = {name: np.asarray(x, dtype=float) for name, x in self.states.items()}
        flat = {n: float(x) for name, a in first.items() for n, x in _entries(name, a)}
        return _table(
            {
                "name": self.name,
                "period": self.period,
                "delay": self.delay,
                "seed": self.seed,
                "sensors": {
                    name: given if isinstance(given, Mapping) else {"value": given}
                    for name, given in self.sensors.items()
                },
                "states": {name: {"initial": x, "next": name} for name, x in flat.items()},
                "inputs": {name: name for name in self.inputs},
            }
        )

    @property
    def size(self) -> int:
        """How many numbers its states have."""
        return sum(np.size(x) for x in self.states.values())

    def called(self, t: float, sensed: FloatArray, state: FloatArray) -> FloatArray:
        """The states after a sample, then the inputs, as numbers in a row. Raises `RunError` for
        what is not that.
        """
        known = self._states(state)
        named = dict(zip(self.sensors, sensed.tolist(), strict=True))
        found = self.function(t, named, dict(known))
        inputs, after = found if isinstance(found, tuple) else (found, {})
        parts = [self._array(after, name, old.shape, old) for name, old in known.items()]
        parts += [self._array(inputs, name, (), None) for name in self.inputs]
        self._check_names(after, known, "state")
        self._check_names(inputs, self.inputs, "input")
        return np.concatenate(parts)

    def _states(self, flat: FloatArray) -> dict[str, NDArray[np.float64]]:
        found, place = {}, 0
        for name, given in self.states.items():
            shape = np.shape(given)
            size = int(np.prod(shape))
            found[name] = flat[place : place + size].reshape(shape)
            place += size
        return found

    def _array(self, given: Any, name: str, shape: tuple[int, ...], default: Any) -> FloatArray:
        if not isinstance(given, Mapping):
            raise RunError(f"{self._place}: returned {given!r}; return inputs by name")
        value = given.get(name, default)
        if value is None:
            raise RunError(f"{self._place}: returned no '{name}'")
        array = np.asarray(value, dtype=float)
        if array.shape not in (shape, (*shape, 1)) or not np.isfinite(array).all():
            raise RunError(
                f"{self._place}: returned {name} = {value!r}; return finite numbers, shape {shape}"
            )
        return array.ravel()

    def _check_names(self, given: Mapping[str, Any], known: Any, what: str) -> None:
        for name in given:
            if name not in known:
                hint = nearest(name, known) or f"; known: {', '.join(known) or 'none'}"
                raise RunError(f"{self._place}: returned {what} '{name}', which is none{hint}")

    @property
    def _place(self) -> str:
        return f"controllers: the function of '{self.name}'"


Controllers = Sequence[Controller | Table | Mapping[str, Any]]
"""Controllers of a run."""


def with_controllers(
    scene: Scene, controllers: Controllers, reporter: Reporter = SILENT
) -> tuple[Scene, dict[str, Function]]:
    """The scene with controllers, and the functions of some of them, by name.

    Raises `SceneError` for what is wrong in a table, `RunError` for what is no controller.
    """
    tables, functions = list[Any](), dict[str, Function]()
    for given in controllers:
        if isinstance(given, Controller):
            tables.append(given.table)
            functions[given.name] = Function(len(given.sensors), given.size, given.called)
        elif isinstance(given, Table | Mapping):
            tables.append(_table(given) if isinstance(given, Mapping) else given)
        else:
            raise RunError(
                f"{reporter.argument('controllers')}: {type(given).__name__} is none; give tables "
                "or eomgen.Controller(...)"
            )
    return (scene.replaced(effects=(*scene.effects, *tables)) if tables else scene), functions


def _table(keys: Mapping[str, Any]) -> Table:
    make = maker("SampledController")
    assert make is not None
    return make(**{key: value for key, value in keys.items() if key != "type"})


def _entries(name: str, array: NDArray[np.float64]) -> list[tuple[str, float]]:
    """The entries of an array with names of their own, counted from 1; of a number its name."""
    if not array.shape:
        return [(name, float(array))]
    return [
        ("_".join([name, *(str(i + 1) for i in index)]), float(x))
        for index, x in np.ndenumerate(array)
    ]
