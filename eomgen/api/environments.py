"""Environments for reinforcement learning: `environment`, one or many that step together."""

from collections.abc import Callable, Mapping, Sequence
from importlib.util import find_spec
from typing import Any

import numpy as np

from eomgen.api.given import check_name
from eomgen.api.options import EnvironmentOptions
from eomgen.api.stepping import stepper
from eomgen.base.errors import RunError
from eomgen.base.options import taking
from eomgen.language.base import identifier
from eomgen.language.formula import FormulaError, evaluate, names_in, parse
from eomgen.results.design import Law
from eomgen.run.module import GeneratedModule
from eomgen.run.problem import FloatArray
from eomgen.scalars.floats import ArrayScalars

NEEDED = "environment: needs Gymnasium; run: pip install 'eomgen[gym]'"
Columns = Callable[[FloatArray, FloatArray, FloatArray], FloatArray]


@taking(EnvironmentOptions)
def environment(options: EnvironmentOptions) -> Any:
    """A `gymnasium.Env` over a scene or, with `lanes`, a `gymnasium.vector.VectorEnv` of so many
    environments that step together.

    A seed determines an episode. A state that is not finite ends an episode, and
    `info["diverged"]` says so. Raises `SceneError`; `RunError` for an unknown name, a formula that
    cannot be read, or if Gymnasium is not installed.
    """
    if find_spec("gymnasium") is None:
        raise RunError(NEEDED)
    dt, parts, t_end, lanes = options.dt, options.parts, options.t_end, options.lanes
    _check_steps(dt, parts, t_end, lanes)
    step = stepper(options.source, dt=dt / parts, lanes=lanes or 1)
    module = step.module
    from eomgen.exports.gymnasium_envs import SceneEnv, SceneVectorEnv, Task

    bounds = {identifier(name): each for name, each in options.actions.items()}
    for name, (low, high) in bounds.items():
        check_name(name, list(module.INPUTS), "actions", "input")
        if not (np.isfinite([low, high]).all() and low < high):
            raise RunError(
                f"actions: {name}: {low:g} to {high:g}; give two numbers, the smaller first"
            )
    if not bounds:
        raise RunError("actions: name at least one input with its bounds")
    task = Task(
        module,
        step.initial()[:, 0],
        lambda y, u, t: step(y, u, t=t, steps=parts),
        step.projected,
        bounds,
        _stacked([_function(text, "observe", module) for text in options.observe or module.STATES]),
        _function(options.reward, "reward", module),
        _function(options.ended, "ended", module),
        _laws(options.start or {}, module),
        dt,
        max(1, round(t_end / dt)),
    )
    return SceneEnv(task) if lanes is None else SceneVectorEnv(task, lanes)


def _check_steps(dt: float, parts: int, t_end: float, lanes: int | None) -> None:
    """Raise `RunError` for numbers out of range."""
    if not (np.isfinite([dt, t_end]).all() and 0 < dt <= t_end):
        raise RunError(f"dt: {dt:g} s is not between 0 and t_end = {t_end:g} s")
    if parts < 1 or (lanes is not None and lanes < 1):
        raise RunError("parts, lanes: give positive numbers")


def _function(text: str, argument: str, module: GeneratedModule) -> Columns:
    """A formula as a function of times (k,), states (ny, k) and inputs (nu, k)."""
    try:
        formula = parse(text)
    except FormulaError as error:
        raise RunError(f"{argument}: '{text}' {error}") from None
    known = ["t", *module.STATES, *module.INPUTS, *module.PARAMETERS]
    for name in names_in(formula):
        check_name(name, known, argument, "state, input or parameter")

    def value(t: FloatArray, y: FloatArray, u: FloatArray) -> FloatArray:
        names = dict(module.PARAMETERS) | {"t": t}
        given = {**names, **dict(zip(module.STATES, y, strict=True))}
        given |= dict(zip(module.INPUTS, u, strict=True))
        with np.errstate(all="ignore"):
            found = evaluate(formula, given, ArrayScalars())
        return np.broadcast_to(np.asarray(found, dtype=float), t.shape)

    return value


def _stacked(parts: Sequence[Columns]) -> Columns:
    return lambda t, y, u: np.array([part(t, y, u) for part in parts])


def _laws(
    start: Mapping[str, Law | tuple[str, float, float]], module: GeneratedModule
) -> dict[int, Callable[[FloatArray], FloatArray]]:
    """The values of each distribution at shares of them, by the index of its state."""
    found: dict[int, Callable[[FloatArray], FloatArray]] = {}
    for given, law in start.items():
        name = identifier(given)
        check_name(name, list(module.STATES), "start", "state")
        found[module.STATES.index(name)] = (law if isinstance(law, Law) else Law(*law)).at
    return found
