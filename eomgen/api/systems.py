"""Systems for python-control: `state_space` about a state, `nonlinear_system` for all states."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from eomgen.api.generating import compiled
from eomgen.api.given import Source, Values, values_of
from eomgen.api.inputs import constant_inputs
from eomgen.api.linearising import Linearised, linearisable, linearised_at, plant_of
from eomgen.api.options import SpaceOptions
from eomgen.api.public import public
from eomgen.api.states import state_names
from eomgen.base.errors import RunError, nearest
from eomgen.base.options import taking
from eomgen.model.model import Model
from eomgen.program.program import Program, interpret
from eomgen.program.tape import TIME
from eomgen.run.module import GeneratedModule
from eomgen.run.problem import FloatArray
from eomgen.scalars.duals import Dual, Duals
from eomgen.scalars.floats import ArrayScalars
from eomgen.store import program_of
from eomgen.study.quantities import components
from eomgen.tables.outputs import SAVED

NEEDED = "control: python-control is not installed; run: pip install 'eomgen[control]'"


@public
@taking(SpaceOptions)
def state_space(options: SpaceOptions) -> Any:
    """The linearised scene as a `control.StateSpace`: ẋ = A x + B u, y = C x + D u.

    It is the `reduced` system of `linearise`, so with three states for a quaternion, and only
    independent ones with constraints. Signals have the names of the scene, components with _ for
    each dot. C and D are exact derivatives. Raises `SceneError`, or `RunError` as `linearise`, for
    an unknown output, or if python-control is not installed.
    """
    control = library()
    model, outputs = linearisable(plant_of(options.source)), options.outputs
    wanted = _outputs_of(outputs, _states(model))
    model = replace(model, outputs=(*model.outputs, *wanted))
    found = linearised_at(model, options)
    linear, least = found.linearisation, found.linearisation.reduced()
    if outputs:
        values = values_of(model, options.parameters, constant_inputs(options.inputs))[0]
        names, by_state, by_input = _observed(model, found, outputs, values)
        C, D = by_state @ linear.basis, by_input
    else:
        names = list(least.state_names)
        C, D = np.eye(len(names)), np.zeros((len(names), len(least.input_names)))
    sampled = None if options.period is None else least.discrete(options.period)
    return control.ss(
        *((sampled or least).A, (sampled or least).B, C, D),
        *([sampled.period] if sampled else []),
        states=list(least.state_names),
        inputs=list(least.input_names),
        outputs=names,
        name=model.name,
    )


@public
def nonlinear_system(source: Source, *, outputs: Sequence[str] = ()) -> Any:
    """The scene as a `control.NonlinearIOSystem`: ẋ = f(t, x, u), y = h(t, x, u).

    outputs  as for `state_space`

    x is the state of the module: [q, v] and the states of controllers. The scene's parameters, by
    name, are the `params` of python-control. Forces of rigid contacts that are held are left out.
    Raises `SceneError`, or `RunError` for an unknown output or if python-control is not installed.
    """
    control = library()
    model = plant_of(source)
    wanted = _outputs_of(outputs, _states(model))
    _, module = compiled(replace(model, form="velocity", outputs=wanted))
    states = list(module.STATES)
    chosen = list(_chosen(outputs or states, model, module))
    needed = dict.fromkeys(f for f, *_ in chosen if f)

    def rates(t: float, x: FloatArray, u: FloatArray, params: Mapping[str, float]) -> FloatArray:
        return module.derivative(t, x, params or None, u)

    def observed(t: float, x: FloatArray, u: FloatArray, params: Mapping[str, float]) -> FloatArray:
        arrays = {f: np.ravel(getattr(module, f)(t, x, params or None, u)) for f in needed}
        return np.array([arrays[f][i] if f else x[i] for f, i, _ in chosen])

    return control.nlsys(
        rates,
        observed,
        states=states,
        inputs=list(module.INPUTS),
        outputs=[name for *_, name in chosen],
        params=dict(module.PARAMETERS),
        name=model.name,
    )


def _states(model: Model) -> tuple[str, ...]:
    """The names of [q, v, x]."""
    count = len(model.coordinates) + len(model.velocities) + len(model.extra)
    return state_names(model)[:count]


def _outputs_of(names: Sequence[str], states: Sequence[str]) -> tuple[str, ...]:
    """The outputs that the module must have for quantities of these names."""
    found: dict[str, None] = {}
    for name in names:
        head = name.partition(".")[0]
        if name in states:
            continue
        if head not in SAVED:
            hint = nearest(head, (*states, *SAVED)) or f"; states: {', '.join(states[:12])}"
            raise RunError(f"outputs: no state or output '{name}'{hint}")
        found[head] = None
    return tuple(found)


def _chosen(
    names: Sequence[str], model: Model, module: GeneratedModule
) -> list[tuple[str, int, str]]:
    """For each signal its output, "" for a state, its place in it, and its own name."""
    found = []
    y, u = module.initial_state(), list(module.INPUTS.values())
    for name in names:
        head = name.partition(".")[0]
        if name in module.STATES:
            found.append(("", module.STATES.index(name), name))
            continue
        if name in getattr(module, "FOLLOWING", ()):
            found.append((*_following(name, model), name))
            continue
        shape = np.shape(getattr(module, head)(0.0, y, None, u))
        for i, whole in components(name, shape, model, module, "outputs"):
            found.append((head, i, whole.replace(".", "_")))
    return found


def _following(name: str, model: Model) -> tuple[str, int]:
    """The output with a coordinate or velocity that follows from the state, and its place there."""
    for output, parts in (("coordinates", model.coordinates), ("velocities", model.velocities)):
        for i, part in enumerate(parts):
            if part.name == name:
                return output, i
    raise AssertionError(name)


def _observed(
    model: Model, found: Linearised, names: Sequence[str], parameters: Values
) -> tuple[list[str], FloatArray, FloatArray]:
    """The names of signals, and their derivatives by the states (n, ny) and inputs (n, nu)."""
    chosen = _chosen(names, model, found.module)
    slopes = _slopes(
        program_of(model), found, parameters, dict.fromkeys(f for f, *_ in chosen if f)
    )
    ny, nu = len(found.linearisation.y), len(found.linearisation.u)
    slopes[""] = np.eye(ny + nu)
    table = np.array([slopes[f][i] for f, i, _ in chosen])
    return [name for *_, name in chosen], table[:, :ny], table[:, ny:]


def _slopes(
    program: Program, found: Linearised, values: Values, outputs: Iterable[str]
) -> dict[str, FloatArray]:
    """The derivatives of the entries of outputs by states and inputs, (n, ny + nu) each."""
    linear, module = found.linearisation, found.module
    names, point = (*module.STATES, *module.INPUTS), [*linear.y, *linear.u]
    given = {
        **{name: Dual(value, 0.0) for name, value in {**module.PARAMETERS, **values}.items()},
        **{n: Dual(x, seed) for n, x, seed in zip(names, point, np.eye(len(names)), strict=True)},
        TIME: Dual(0.0, 0.0),
    }
    slopes = {}
    for output in outputs:
        try:
            with np.errstate(all="ignore"):
                entries = interpret(program, output, given, Duals(ArrayScalars()))
        except (ValueError, ArithmeticError) as error:
            raise RunError(f"outputs: {output}: {error}") from None
        slopes[output] = np.array([np.broadcast_to(x.rate, len(names)) for x in entries])
        if not np.all(np.isfinite(slopes[output])):
            raise RunError(f"outputs: {output} has no derivative at this state")
    return slopes


def library() -> Any:
    """The package of python-control. Raises `RunError` if it is not installed."""
    try:
        import control
    except ImportError:
        raise RunError(NEEDED) from None
    return control
