"""The localising functions of a model's derivative: see `run.localised`."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from eomgen.language.base import formulas_in
from eomgen.language.formula import Apply, Formula, names_in
from eomgen.model.model import Model
from eomgen.program.kernel import Kernel, kernel
from eomgen.program.localising import OF_STATE, OF_TIME, with_local_arguments
from eomgen.program.program import Program
from eomgen.program.tape import TIME
from eomgen.run.intervals import BY_INTERVALS, Interval
from eomgen.run.localised import Localised, Scrutiny
from eomgen.run.module import GeneratedModule, given_values
from eomgen.run.problem import FloatArray, Problem
from eomgen.scalars.floats import BY_NUMPY, FloatScalars
from eomgen.store import program_of


def under_scrutiny(
    problem: Problem,
    model: Model,
    module: GeneratedModule,
    parameters: Any = None,
    inputs: Any = None,
) -> Problem:
    """A model's problem whose runs are checked for what may lie between their steps, and for
    sliding modes.
    """
    found = localised(model, program_of(model), module, parameters, inputs)
    return replace(problem, scrutiny=Scrutiny(found))


def localised(
    model: Model,
    program: Program,
    module: GeneratedModule,
    parameters: Any = None,
    inputs: Any = None,
) -> Localised | None:
    """The localising functions of a program's derivative at given parameters and constant inputs;
    None if it has none. `module` was generated from it.
    """
    found = with_local_arguments(program, module.STATES, divides_by_motion(model))
    if not (found.of_state or found.of_time):
        return None
    given, constants = given_values(module, parameters, inputs)
    values = {**module.PARAMETERS, **given}
    fixed = {**module.INPUTS, **constants}
    kernels = [
        kernel(found.program, name)
        for name, kinds in ((OF_STATE, found.of_state), (OF_TIME, found.of_time))
        if kinds
    ]
    known = [one.known_values(values, FloatScalars()) for one in kernels]

    def arguments(t: FloatArray, y: FloatArray) -> FloatArray:
        at = {**fixed, TIME: t, **dict(zip(module.STATES, y.T, strict=True))}
        with np.errstate(all="ignore"):
            rows = [
                row
                for one, own in zip(kernels, known, strict=True)
                for row in _moving(one, own, at, BY_NUMPY)
            ]
        return np.array([np.broadcast_to(row, t.shape) for row in rows]).T

    def over(t: Interval) -> Sequence[Interval]:
        if not found.of_time:
            return ()
        return _moving(kernels[-1], known[-1], {**fixed, TIME: t}, BY_INTERVALS)

    kinds = (*found.of_state, *found.of_time)
    return Localised(kinds, arguments, len(found.of_time), over)


def _moving(
    one: Kernel,
    known: Sequence[Any],
    given: Mapping[str, Any],
    functions: Mapping[str, Callable[..., Any]],
) -> list[Any]:
    return one.moving(
        known, [given[name] for name in one.inputs], [functions[f] for f in one.functions]
    )


def divides_by_motion(model: Model) -> bool:
    """Whether a formula of a model's effects divides by something that is not constant. Only then
    may a quotient be localised: inertias, by which recursions divide, change slowly.
    """
    constant = {parameter.name for parameter in model.parameters}
    return any(
        formula.operation == "/" and not set(names_in(formula.operands[1])) <= constant
        for effect in model.effects
        for whole in formulas_in(effect)
        for formula in _applied(whole)
    )


def _applied(formula: Formula) -> Iterator[Apply]:
    """All operations in a formula."""
    if isinstance(formula, Apply):
        yield formula
        for part in formula.operands:
            yield from _applied(part)
