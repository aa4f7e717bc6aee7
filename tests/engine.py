"""Scenes compiled by a given route, for tests: as loaded modules, and as programs in 60 digits."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from eomgen.codegen import jacobians
from eomgen.codegen.system import System
from eomgen.dynamics.start.assembly import assembled
from eomgen.language.formula import names_in
from eomgen.model.elaborate import elaborate
from eomgen.model.model import Model
from eomgen.pipeline import compile_program, generate, python_module
from eomgen.program.extended import evaluator
from eomgen.program.tape import TIME
from eomgen.run.module import load_module
from eomgen.scalars.extended import MP, Digits, exact
from eomgen.scene.reader import built_in_names, parse_scene, read_scene
from eomgen.scene.schema import Scene
from eomgen.study.verification.states import random_state

__all__ = [
    "MP", "STEP", "Digits", "Engine", "along", "apart", "engine", "exact", "motion", "plain",
    "quick", "read", "slopes", "text_of", "unit_state", "varied",
]  # fmt: skip

STEP = MP.mpf(10) ** -20
"""Of central differences, which are off by its square."""
DERIVATIVES = ("jacobian", "input_jacobian", "parameter_jacobian")


@dataclass(frozen=True, eq=False, repr=False)
class Engine:
    """A scene's model, its program by one route, and the module written of it."""

    model: Model
    system: System
    source: str
    module: Any
    _runs: dict[str, Callable[[Mapping[str, Any]], list[Any]]] = field(
        init=False, default_factory=dict
    )

    def exactly(
        self,
        output: str,
        y: Sequence[Any],
        u: Mapping[str, Any] | None = None,
        p: Mapping[str, Any] | None = None,
        extra: Sequence[Any] = (),
        t: Any = 0,
    ) -> np.ndarray:
        """An output in 60 digits, in its shape; `extra` are tau or vd, one a velocity."""
        given = {**self.module.PARAMETERS, **(p or {}), **self.module.INPUTS, **(u or {})}
        given |= {TIME: MP.mpf(t), **dict(zip(self.module.STATES, y, strict=True))}
        names = self.system.extra.get(output, ())
        if output not in self.system.tangents:
            given |= dict(zip(names, extra or [0.0] * len(names), strict=True))
            return self._run(output, given).reshape(self.system.program.outputs[output].shape)
        columns = []
        for i in range(len(names)):  # what is written computes a change along a direction
            ahead = {name: float(i == j) for j, name in enumerate(names)}
            columns.append(self._run(output, given | ahead))
        return np.array(columns, dtype=object).T

    def _run(self, output: str, given: Mapping[str, Any]) -> np.ndarray:
        if output not in self._runs:
            self._runs[output] = evaluator(self.system.program, output)
        return np.array(self._runs[output](given), dtype=object)

    def random_state(self, rng: np.random.Generator) -> np.ndarray:
        """Angles over two turns, slides within 0.6 m, unit quaternions; 3 rad/s, 1 m/s."""
        return random_state(self.module, rng)

    def random_inputs(self, rng: np.random.Generator) -> dict[str, float]:
        """A value for every input."""
        return {name: float(rng.uniform(-9.0, 9.0)) for name in self.module.INPUTS}


def varied(model: Model, rng: np.random.Generator, least: float, most: float) -> dict[str, float]:
    """Each parameter times a factor of its own; but those that break a condition together, those of
    a lamina for example, stay as they are.
    """
    p = {x.name: x.default * float(rng.uniform(least, most)) for x in model.parameters}
    while broken := [c for c in model.conditions if c.problem(p)]:
        p |= {name: model.defaults[name] for c in broken for name in names_in(c.value)}
    return p


def read(scene: str) -> Scene:
    """A built-in scene by its name, or one from its text."""
    return read_scene(scene) if scene in built_in_names() else parse_scene(scene)


def engine(
    scene: str, route: str = "", *, leave_out: tuple[str, ...] = (), tangents: bool = False
) -> Engine:
    """Compile a scene, once, with all outputs but some, by a route or by its own; a text that names
    none by `aba`, without judging the others, and its loops by projection unless it says otherwise.

    Without "jacobian" and what else is in `DERIVATIVES`, most of the work is left out. `tangents`:
    as large models have it, no matrix of derivatives is written out.
    """
    return _engine(scene, route, leave_out, tangents)


def quick(scene: str, route: str = "", *, tangents: bool = False) -> Engine:
    """The same without derivatives by inputs and parameters, which take longest to make."""
    left = ("input_jacobian", "parameter_jacobian")
    return engine(scene, route, leave_out=left, tangents=tangents)


def plain(scene: str, route: str = "") -> Engine:
    """The same without any matrix of derivatives, in half the time."""
    return engine(scene, route, leave_out=DERIVATIVES)


@cache
def _engine(scene: str, route: str, leave_out: tuple[str, ...], tangents: bool) -> Engine:
    model = assembled(elaborate(read(scene).replaced(outputs="all")))
    outputs = tuple(name for name in model.outputs if name not in leave_out)
    if not route and model.route == "auto" and model.form == "velocity":
        route = "auto" if scene in built_in_names() else "aba"
    model = replace(model, outputs=outputs, route=route or model.route)
    if model.loops_kept == "auto" and scene not in built_in_names():
        model = replace(model, loops_kept="projected")
    with pytest.MonkeyPatch.context() as patch:
        if tangents:
            patch.setattr(jacobians, "LARGEST_JACOBIAN", -1)
        system = compile_program(model, jacobian="jacobian" not in leave_out).system
    source = python_module(system)
    return Engine(model, system, source, load_module(source, f"tested_{model.name}"))


def text_of(source: Scene | Model) -> str:
    """The module that is written of a scene, or of a model as it is."""
    model = assembled(elaborate(source)) if isinstance(source, Scene) else source
    return generate(model).module


def unit_state(module: Any, seed: int) -> np.ndarray:
    """A state of a module, normally distributed, with quaternions of length 1."""
    y = np.random.default_rng(seed).normal(size=len(module.STATES))
    for indices in map(list, module.QUATERNIONS):
        y[indices] /= np.linalg.norm(y[indices])
    return y


def motion(
    made: Engine, times: np.ndarray, start: Any = None, rtol: float = 1e-12, atol: float = 1e-13
) -> np.ndarray:
    """The states at some times, (ny, n), from the initial one at 0 or another, by SciPy."""
    start = made.module.initial_state() if start is None else start
    f, span = made.module.derivative, (0.0, times[-1])
    found = solve_ivp(f, span, start, "DOP853", times, rtol=rtol, atol=atol)
    assert found.success
    return found.y


def along(f: Callable[[np.ndarray], np.ndarray], x: np.ndarray, way: np.ndarray) -> np.ndarray:
    """The derivative of f at x in a direction: a central difference, some 40 digits."""
    return (f(x + STEP * way) - f(x - STEP * way)) / (2 * STEP)


def slopes(
    made: Engine,
    output: str,
    y: Sequence[Any],
    u: Mapping[str, Any] | None = None,
    p: Mapping[str, Any] | None = None,
    t: Any = 0,
) -> np.ndarray:
    """The rates of the state, differentiated in 60 digits by the state, by inputs or by parameters,
    as an output of `DERIVATIVES` is.
    """
    u, p = u or {}, p or dict(made.module.PARAMETERS)
    given = dict(zip(DERIVATIVES, (y, [*u.values()], [*p.values()]), strict=True))

    def rates(x: np.ndarray) -> np.ndarray:
        state, *others = {**given, output: x}.values()
        named = (dict(zip(of, each, strict=True)) for of, each in zip((u, p), others, strict=True))
        return made.exactly("derivative", state, *named, t=t)

    start = exact(given[output])
    return np.array([along(rates, start, way) for way in exact(np.eye(len(start)))]).T


def apart(actual: Any, expected: Any, *terms: Any) -> float:
    """Greatest difference, relative to the greatest value, of terms too if given, or to 1."""
    actual, expected = np.asarray(actual), np.asarray(expected)
    assert actual.shape == expected.shape, f"{actual.shape} is not {expected.shape}"
    sizes = (np.max(np.abs(x), initial=0) for x in (expected, *(np.asarray(t) for t in terms)))
    difference = np.max(np.abs(actual - expected), initial=0)
    assert difference == difference, "not a number"
    return float(difference / max(1, *sizes))
