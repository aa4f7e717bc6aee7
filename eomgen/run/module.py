"""Loading a generated module, and its initial-value problem."""

import inspect
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from functools import cache, partial
from types import CodeType
from typing import Any, Protocol, cast

import numpy as np

from eomgen.base.errors import RunError
from eomgen.base.loading import load_source
from eomgen.run.intervals import BY_INTERVALS, Interval
from eomgen.run.noise import step_noise
from eomgen.run.origin import Origin
from eomgen.run.problem import Contacts, Explain, FloatArray, Problem, Switching, unexplained
from eomgen.run.projection import projection_of
from eomgen.run.sampling import sampling_of
from eomgen.run.sizes import mechanism_size, row_sizes, state_sizes
from eomgen.run.solved_loops import solved_loops_of
from eomgen.run.works import Powers

Rate = Callable[[float, FloatArray], FloatArray]
"""A function of time and state."""
COUNTED = frozenset({"derivative", "jacobian"})
"""Functions whose operations determine the cost of a run."""


class GeneratedModule(Protocol):
    """The interface of a generated module, as far as simulation and figures need it."""

    NAME: str
    FORM: str
    DIMENSIONS: int
    STATES: tuple[str, ...]
    POSITIONS: tuple[int, ...]
    QUATERNIONS: tuple[tuple[int, int, int, int], ...]
    INPUTS: dict[str, float]
    PARAMETERS: dict[str, float]
    UNITS: dict[str, str]
    BODIES: tuple[str, ...]
    JOINTS: tuple[str, ...]
    COST: dict[str, dict[str, int]]
    initial_state: Callable[..., FloatArray]
    derivative: Callable[..., FloatArray]
    jacobian: Callable[..., FloatArray]
    kinetic_energy: Callable[..., FloatArray]
    potential_energy: Callable[..., FloatArray]
    body_poses: Callable[..., FloatArray]


def load_module(
    source: str, name: str = "generated", code: CodeType | None = None
) -> GeneratedModule:
    """Load a generated module from its source, which must be written by this program; `code` is the
    same compiled, if it is at hand.

    Raises `RunError` if the equations have no solution at the scene's parameters, or if JAX is not
    installed, which a module of the backend "jax" imports.
    """
    try:
        module = load_source(source, name, code)
    except ModuleNotFoundError as error:
        raise RunError(
            f"backend 'jax': {error.name} is not installed; run: pip install 'eomgen[jax]'"
        ) from None
    except (ValueError, ArithmeticError) as error:
        raise RunError(_unsolvable(error)) from None
    return cast(GeneratedModule, module)


def _by_differences(module: GeneratedModule) -> Rate:
    def jacobian(t: float, y: FloatArray) -> FloatArray:
        steps = 1e-7 * np.maximum(1.0, np.abs(y))
        ahead = module.derivative(t, y[:, None] + np.diag(steps))
        return np.asarray((ahead - module.derivative(t, y)[:, None]) / steps)

    return jacobian


def _unsolvable(error: Exception) -> str:
    """The reason why there is no derivative at the start, as far as the module knows."""
    if isinstance(error, ZeroDivisionError):
        return (
            "the mass matrix is singular at the initial state, or an effect is infinite there: "
            "change that state, "
            "or lengths, masses or inertias"
        )
    return str(error).removeprefix("derivative: ").replace("at this state", "at the initial state")


def as_problem(
    module: GeneratedModule,
    parameters: Any = None,
    inputs: Any = None,
    *,
    explain: Explain = unexplained,
    origin: Origin | None = None,
    start: Callable[[FloatArray], FloatArray] | None = None,
) -> Problem:
    """The initial-value problem of a module, at given parameters and constant inputs.

    `explain` and `origin` are kept in the problem. `start` gives the initial state from that of the
    module. If the module has no Jacobian, it is computed by
    differences, which suffices for Newton's iteration.

    Raises `RunError` if the module refuses parameters or inputs, or if it has no derivative at the
    initial state.
    """
    exactly, jacobian = _rates(module, parameters, inputs)
    solved_loops = solved_loops_of(module, parameters, inputs)
    derivative = _rejecting(exactly, solved_loops is not None)
    try:
        initial = module.initial_state(parameters)
        initial = start(initial) if start else initial
    except (ValueError, ArithmeticError) as error:
        raise RunError(_unsolvable(error)) from None
    try:
        slope = exactly(0.0, initial)
    except (ValueError, ArithmeticError) as error:
        why = explain(0.0, initial, initial)
        raise RunError(f"at the initial state {why}" if why else _unsolvable(error)) from None
    values = {**module.PARAMETERS, **given_values(module, parameters)[0]}
    first = dict(zip(module.STATES, initial.tolist(), strict=True))
    size = float(mechanism_size(module.UNITS, values, first))
    switching = _switching(module, parameters, inputs)
    projection = projection_of(module, parameters, inputs, size)
    return Problem(
        name=module.NAME,
        states=module.STATES,
        positions=module.POSITIONS,
        derivative=derivative,
        jacobian=jacobian,
        initial=initial,
        quaternions=module.QUATERNIONS,
        contacts=_contacts(module, parameters, inputs, size),
        explain=explain,
        corners=switching is not None,
        switching=switching,
        sizes=tuple(state_sizes(module.STATES, module.UNITS, initial, slope, size).tolist()),
        origin=origin,
        noise=cache(partial(step_noise, derivative, jacobian, 0.0, initial)),
        operations={name: module.COST[name]["total"] for name in COUNTED & set(module.COST)},
        columns=hasattr(module, "_along"),
        timed=_depends_on_time(module),
        projection=projection,
        solved_loops=solved_loops,
        sampling=sampling_of(module, parameters, inputs),
        implicit_step=_implicit_step(module, parameters, inputs),
    )


def _implicit_step(
    module: Any, parameters: Any, inputs: Any
) -> Callable[[float, FloatArray, float], FloatArray] | None:
    """The change of the state in a step that is implicit in stiff forces; None without it."""
    function = getattr(module, "implicit_step", None)
    return function and (lambda t, y, h: np.asarray(function(t, y, h, parameters, inputs)))


def _rates(module: GeneratedModule, parameters: Any, inputs: Any) -> tuple[Rate, Rate]:
    """The derivative of a module, and its Jacobian."""
    if parameters is None and inputs is None:  # the module's fastest call
        return module.derivative, getattr(module, "jacobian", _by_differences(module))

    def derivative(t: float, y: FloatArray) -> FloatArray:
        return module.derivative(t, y, parameters, inputs)

    def jacobian(t: float, y: FloatArray) -> FloatArray:
        return module.jacobian(t, y, parameters, inputs)

    return derivative, jacobian


def _rejecting(exactly: Rate, closes: bool) -> Rate:
    """A derivative that is not a number where y is too large, or loops cannot be closed in closed
    form: then a method rejects the step.
    """
    refused = (FloatingPointError, ValueError) if closes else FloatingPointError

    def derivative(t: float, y: FloatArray) -> FloatArray:
        try:
            return exactly(t, y)
        except refused:
            return np.full(len(y), np.nan)

    return derivative


def as_powers(module: Any, parameters: Any = None, inputs: Any = None) -> Powers | None:
    """The powers of a module's effects at given parameters and constant inputs; None if it has no
    effects, or was generated without their powers or without the kinetic energy.
    """
    wanted = ("effect_powers", "kinetic_energy")
    if not (module.EFFECT_NAMES and all(hasattr(module, name) for name in wanted)):
        return None
    return Powers(
        names=tuple(module.EFFECT_NAMES),
        powers=lambda t, y: module.effect_powers(t, y, parameters, inputs),
        kinetic_energy=lambda t, y: float(module.kinetic_energy(t, y, parameters, inputs)),
    )


def _switching(module: Any, parameters: Any, inputs: Any) -> Switching | None:
    """The switching functions of a module; None if its derivative has none."""
    of_state = getattr(module, "switching_functions", None)
    of_time = getattr(module, "_switching_functions_of_time", None)
    if of_state is None and of_time is None:
        return None
    positions = [module.STATES[i] for i in module.POSITIONS]
    u = module._NO_INPUT if inputs is None else module._inputs(inputs, 0)
    return Switching(
        of_state and (lambda t, y: np.asarray(of_state(t, y, parameters, inputs))),
        of_state is not None and "t" in inspect.signature(module._switching_functions).parameters,
        tuple(i for i, name in enumerate(positions) if module.UNITS[name] == "rad"),
        of_time and over_intervals(module, of_time, parameters, lambda t: u),
    )


def _depends_on_time(module: Any) -> bool:
    """Whether a module's derivative depends on time, as far as known."""
    kernel = getattr(module, "_derivative", None)
    if kernel is None or hasattr(module, "inputs_of_time"):
        return True
    return "t" in inspect.signature(kernel).parameters


def over_intervals(
    module: Any, kernel: Any, parameters: Any, inputs: Callable[[Interval], Sequence[Any]]
) -> Callable[[Interval], Sequence[Interval]]:
    """A kernel that depends on time and inputs alone, as a function of intervals of time. At a
    single time it has the values that the derivative has there, where these can be evaluated.

    inputs  gives the inputs in an interval of time, as intervals or numbers
    """
    wanted = inspect.signature(kernel).parameters
    functions = {name: BY_INTERVALS[name] for name in BY_INTERVALS if name in wanted}
    name = kernel.__name__.removeprefix("_")
    constants = (module._DEFAULT if parameters is None else module._parameters(parameters))[name]

    def values(t: Interval) -> Sequence[Interval]:
        u = inputs(t)
        if t.low == t.high:
            with suppress(ArithmeticError, ValueError):
                now = [(x.low + x.high) / 2 if isinstance(x, Interval) else x for x in u]
                return [Interval(x, x) for x in kernel((), constants, now, t=t.low)]
        return cast(Sequence[Interval], kernel((), constants, u, t=t, **functions))

    return values


def _contacts(module: Any, parameters: Any, inputs: Any, size: float) -> Contacts | None:
    """The rigid contacts of a module of this size, m; None if it has none."""
    names = getattr(module, "CONTACTS", None)
    if not names:
        return None
    return Contacts(
        names=tuple(names),
        effects=tuple(names.values()),
        gaps=lambda t, y: module.gaps(t, y, parameters, inputs),
        rates=lambda t, y: module.gap_rates(t, y, parameters, inputs),
        impact=lambda t, y, k, bounce: module.impact(t, y, k, bounce, parameters, inputs),
        held=lambda t, y, forces: module.held(t, y, forces, parameters, inputs),
        drives=tuple(
            name
            for name, kind in zip(module.EFFECT_NAMES, module.EFFECTS, strict=True)
            if kind == "driven"
        ),
        sizes=tuple(row_sizes(module.UNITS, "contact", names, "m", size)),
    )


def given_values(
    module: GeneratedModule, parameters: Any = None, inputs: Any = None
) -> tuple[dict[str, float], dict[str, float]]:
    """The given parameters and inputs of a module by name, from any form that it accepts."""
    return _by_name(module.PARAMETERS, parameters), _by_name(module.INPUTS, inputs)


def _by_name(names: Iterable[str], values: Any) -> dict[str, float]:
    """Values by name, from a mapping or in the order of the names; empty if None."""
    if values is None:
        return {}
    pairs = values.items() if hasattr(values, "keys") else zip(names, values, strict=False)
    return {name: float(value) for name, value in pairs}
