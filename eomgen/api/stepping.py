"""Steps of many states at once, with whatever chooses the inputs between them: `stepper`."""

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eomgen.api.generating import compiled
from eomgen.api.given import Source, check_name, model_of, read
from eomgen.api.options import BACKENDS, Backend, check_time
from eomgen.api.public import public
from eomgen.base.displays import Displayed
from eomgen.base.errors import RunError
from eomgen.language.base import identifier
from eomgen.model.clocks import check_no_samples
from eomgen.model.elaborate import in_order
from eomgen.model.model import Model
from eomgen.native.lanes import columns_of
from eomgen.native.stepper import METHODS, Beside, CompiledSteps, Limits
from eomgen.run.columns import ColumnSteps, Given, check_columns, module_for_columns
from eomgen.run.contacts import nothing_held, sizes_of
from eomgen.run.integrators import FixedStep, find_integrator
from eomgen.run.integrators.leapfrog import split_of
from eomgen.run.module import GeneratedModule
from eomgen.run.problem import FloatArray, Problem
from eomgen.run.sizes import mechanism_size
from eomgen.store import bytecode_of, generated_code
from eomgen.study.diagnosis import problem_of
from eomgen.tables.integrators import INTEGRATORS

Set = Mapping[str, ArrayLike] | ArrayLike | None
Mask = NDArray[np.bool_]
NAMES = {"runge_kutta_4": "rk4"}
"""Other names of methods."""


@public
def stepper(
    source: Source,
    *,
    dt: float,
    method: str = "rk4",
    lanes: int | None = None,
    backend: Backend = "auto",
) -> "Stepper":
    """Steps of a scene of equal length, many states at once, for policies and controllers that
    choose the inputs between them: `y = step(y, u)`.

    dt       length of a step, s
    method   "euler", "semi_implicit_euler", "rk4", "leapfrog", "leapfrog_4", "leapfrog_6", or
             "linearly_implicit" for long steps with stiff contacts, stops, springs and gains
    lanes    number of states, the columns of arrays (ny, lanes); None: one state, (ny,)
    backend  "c": compiled now, a state in each lane of vector registers; "numpy": columns in NumPy,
             with the same bits; "auto": "c" if there is a compiler

    Forces of springs, friction, contacts, controllers and all other effects, driven joints and
    loops are a part of the steps. Rigid contacts strike at their time within a step. Raises
    `SceneError`; `RunError` for an unknown method, for one that the scene's motion does not allow,
    or with "c" if there is no compiler.
    """
    scene = read(source)
    model = model_of(scene, source)
    check_time(dt, "dt")
    method = NAMES.get(method, method)
    if method in INTEGRATORS:
        model = replace(model, outputs=in_order((*model.outputs, *INTEGRATORS[method].outputs)))
    if lanes is not None and lanes < 1:
        raise RunError(f"lanes: {lanes} is not a positive number")
    if backend not in BACKENDS:
        raise RunError(f"backend: '{backend}' is not one of auto, numpy, c")
    return _made(model, dt, method, lanes, backend, scene.simulation.rest_speed)


def _made(
    model: Model,
    dt: float,
    method: str,
    lanes: int | None,
    backend: Backend,
    rest: float | None,
) -> "Stepper":
    """The same of a model, for arguments that are known to be right; `rest` is the speed below
    which rigid contacts do not bounce, or None.
    """
    check_no_samples(model, "steps of a stepper")
    _, plain = compiled(model)
    problem = problem_of(plain, model=model)
    check_columns(problem, method, METHODS)
    found = find_integrator(method)
    assert isinstance(found, FixedStep)
    change = found.prepare(problem)
    code = generated_code(model)
    module = module_for_columns(code.module, model.name, bytecode_of(code.module))
    first = dict(zip(module.STATES, problem.initial.tolist(), strict=True))
    size = float(mechanism_size(module.UNITS, module.PARAMETERS, first))
    kernels, notice = None, ""
    if backend != "numpy":
        try:
            kernels = _compiled(model, plain, problem, method, dt, rest)
        except RunError as error:
            if backend == "c":
                raise
            notice = str(error)
    in_python = ColumnSteps(module, problem, change, dt, size, rest)
    asked = (model, dt, method, lanes, backend, rest)
    return Stepper(asked, module, problem.initial, notice, in_python, kernels)


def _compiled(
    model: Model,
    module: GeneratedModule,
    problem: Problem,
    method: str,
    dt: float,
    rest: float | None,
) -> CompiledSteps:
    rates = np.ascontiguousarray(split_of(problem).rates) if method.startswith("leapfrog") else None
    limits: Limits = ((), ())
    if problem.contacts:
        held = nothing_held(problem.contacts, len(problem.states), rest)
        limits = (sizes_of(problem.contacts).tolist(), held.rest.tolist())
    return CompiledSteps(model, module, method, dt, rates, problem.projection, limits)


class _Reset(NamedTuple):
    """The lanes that begin again, and the states that they begin with."""

    again: Mask | None
    first: FloatArray


class Stepper(Displayed):
    """Steps of equal length of a scene: see `stepper`.

    states, inputs, parameters  their names, in the order of rows
    method, dt, lanes           as given; dt in s
    compiled                    whether steps are made in compiled code
    notice                      why not, if a compiler was looked for, or ""
    module                      the generated code, whose functions take columns, too

    Calls do not depend on one another, and several threads may make them at once: the interpreter's
    lock is released in compiled code.
    """

    shown = ("method", "dt", "lanes", "states", "inputs", "parameters", "compiled", "notice")

    def __init__(
        self,
        asked: tuple[Model, float, str, int | None, Backend, float | None],
        module: GeneratedModule,
        initial: FloatArray,
        notice: str,
        in_python: ColumnSteps,
        kernels: CompiledSteps | None,
    ) -> None:
        self.states, self.inputs = tuple(module.STATES), tuple(module.INPUTS)
        self.parameters = tuple(module.PARAMETERS)
        _, self.dt, self.method, self.lanes, *_ = self._asked = asked
        self.compiled, self.notice = kernels is not None, notice
        self.module, self._in_python, self._kernels = module, in_python, kernels
        self._initial = initial[:, None]
        self._inputs = np.array([*module.INPUTS.values()], dtype=np.float64)[:, None]
        self._own = self._constants(np.array([*module.PARAMETERS.values()], dtype=np.float64))
        self._start = np.zeros((1, 1))
        self._columns = columns_of(self._start, self._inputs, self._initial)
        self._own_columns = columns_of(*([] if self._own is None else [self._own]))
        self._last: tuple[FloatArray, FloatArray | None] | None = None

    def __reduce__(self) -> tuple[Any, ...]:
        return _made, self._asked

    @property
    def shape(self) -> tuple[int, ...]:
        """The shape of states: (ny, lanes), or (ny,)."""
        return (len(self.states),) if self.lanes is None else (len(self.states), self.lanes)

    def initial(self) -> FloatArray:
        """The scene's initial state, in each lane, (ny, lanes) or (ny,)."""
        return np.repeat(self._initial, self.lanes or 1, axis=1).reshape(self.shape)

    def __call__(
        self,
        y: FloatArray,
        u: Set = None,
        p: Set = None,
        *,
        t: float | FloatArray = 0.0,
        steps: int = 1,
        out: FloatArray | None = None,
        reset: Mask | None = None,
        first: FloatArray | None = None,
        lost: FloatArray | None = None,
    ) -> FloatArray:
        """The states after some steps from the states `y` at t, (ny, lanes) or (ny,).

        u, p   inputs and parameters, the same during all steps: None, for the scene's; by name,
               numbers or arrays (lanes,); or arrays in the order of `inputs` and `parameters`,
               (nu,) or (nu, lanes), (np,) or (np, lanes)
        t      time, s, of all or of each lane, (lanes,)
        steps  number of steps
        out    where the result is put, and returned: an array of floats, which may be `y` itself
        reset  (lanes,) of bools: where it is true, the result is the state `first`
        first  (ny,) or (ny, lanes); None: the scene's initial state
        lost   (ny, lanes) or (ny,), zeros at the beginning, updated: what rounding took from the
               sums so far, which is added to the next step's change. With it many calls make
               exactly the steps of a single one; None: the sums of each call begin without

        A lane depends on no other. One that is not finite, or whose loops come apart, becomes nan.
        Raises `RunError` for wrong shapes, names, or values that are no numbers.
        """
        before, y = y, self._state(y)
        k = y.shape[1]
        if not isinstance(steps, int | np.integer) or steps < 1:
            raise RunError(f"steps: {steps!r} is not a positive whole number")
        given = Given(self._times(t), *self._sets(u, p, k))
        again = None if reset is None else self._mask(reset, k)
        start = self._initial if first is None else self._first(first, k)
        made = np.empty_like(y) if out is None else self._out(out, given, start)
        if out is not None and out is not before and np.may_share_memory(made, y):
            y = y.copy()
        memory = None if lost is None else self._place(lost, "lost")
        begun = _Reset(again, start)
        left = self._make(y, made, given, int(steps), memory, begun)
        if left is None or left.size:
            self._finish(left, y, made, given, int(steps), memory, begun)
        return made.reshape(self.shape) if out is None else out

    def projected(self, y: FloatArray, *, t: float | FloatArray = 0.0) -> FloatArray:
        """The nearest states with unit quaternions that meet the constraints at t, s, for states
        (ny,) or (ny, k) that were drawn or changed; nan where none is near.
        """
        array = _numbers(y, "y")
        if array.ndim not in (1, 2) or len(array) != len(self.states):
            raise RunError(f"y: shape {array.shape} is not ({len(self.states)},) or with columns")
        columns = array.reshape(len(array), -1).copy()
        return self._in_python.projected(columns, Given(self._times(t))).reshape(array.shape)

    def _make(
        self,
        y: FloatArray,
        out: FloatArray,
        given: Given,
        steps: int,
        lost: FloatArray | None,
        begun: "_Reset",
    ) -> NDArray[np.intp] | None:
        """Make steps in compiled code; the columns that are left, or None for all."""
        kernels = self._kernels
        constants = self._own if given.p is None else self._constants_of(given.p)
        if kernels is None or constants is None:
            return None
        t, u, start = self._columns
        if given.t.__class__ is not float or given.t:
            times = np.asarray(given.t, dtype=np.float64).reshape(1, -1)
            (t,) = columns_of(times)
        if given.u is not None:
            (u,) = columns_of(given.u if given.u.ndim == 2 else given.u[:, None])
        if begun.again is not None and begun.first is not self._initial:
            (start,) = columns_of(begun.first)
        (k,) = self._own_columns if constants is self._own else columns_of(constants)
        beside = Beside(t, k, u, start)
        sound = kernels(y, out, beside, p=given.p, steps=steps, lost=lost, again=begun.again)
        return np.empty(0, np.intp) if sound.all() else np.flatnonzero(sound == 0)

    def _finish(
        self,
        left: NDArray[np.intp] | None,
        y: FloatArray,
        out: FloatArray,
        given: Given,
        steps: int,
        lost: FloatArray | None,
        begun: "_Reset",
    ) -> None:
        """Make steps of the columns that are left, or of all, in NumPy."""
        again, first = begun
        chosen: Any = slice(None) if left is None else left
        y = y[:, chosen].copy()
        memory = np.zeros_like(y) if lost is None else lost[:, chosen].copy()
        start = first if first.shape[1] == 1 else first[:, chosen]
        if again is not None:
            again = again[chosen]
            y = np.where(again, start, y)
            memory[:, again] = 0.0
        y, memory = self._in_python(y, memory, given.of(chosen), steps)
        if again is not None:
            y = np.where(again, start, y)
            memory[:, again] = 0.0
        out[:, chosen] = y
        if lost is not None:
            lost[:, chosen] = memory

    def _constants(self, p: FloatArray) -> FloatArray | None:
        """The constants of parameters (np,) or (np, k); None if NumPy must compute with them.

        Raises `RunError` for parameters that the scene does not allow.
        """
        if self._kernels is None:
            self._allowed(p)
            return None
        rows = np.ascontiguousarray(p[None] if p.ndim == 1 else p.T)
        k, _, good = self._kernels.prepare(rows)
        for row in rows[~good]:
            self._allowed(row)
        return k if good.all() else None

    def _allowed(self, p: FloatArray) -> None:
        module: Any = self.module
        try:
            module._parameters(p, p.shape[1:])
        except (ValueError, ArithmeticError) as error:
            raise RunError(f"p: {error}") from None

    def _constants_of(self, p: FloatArray) -> FloatArray | None:
        """The same; those of the last call are kept."""
        last = self._last
        if last is None or last[0].shape != p.shape or not np.array_equal(last[0], p):
            last = p.copy(), self._constants(p)
            self._last = last
        return last[1]

    def _state(self, y: Any) -> FloatArray:
        """A state, or columns of them, as columns."""
        array = _numbers(y, "y")
        if array.shape != self.shape:
            raise RunError(
                f"y: shape {array.shape} is not {self.shape}: a row for each of "
                f"{', '.join(self.states)}" + (", a column for each lane" if self.lanes else "")
            )
        return np.ascontiguousarray(array.reshape(len(self.states), -1))

    def _place(self, array: FloatArray, what: str) -> FloatArray:
        """An array of the caller's as columns, to be written to."""
        fits = isinstance(array, np.ndarray) and array.dtype == np.float64
        if not (fits and array.shape == self.shape and array.flags.c_contiguous):
            raise RunError(f"{what}: give a contiguous array of floats of shape {self.shape}")
        if not array.flags.writeable:
            raise RunError(f"{what}: is read-only; give an array that can be written to")
        return array.reshape(len(self.states), -1)

    def _out(self, out: FloatArray, given: Given, first: FloatArray) -> FloatArray:
        """Where the result is put, as columns."""
        made = self._place(out, "out")
        for what, array in (("u", given.u), ("p", given.p), ("first", first)):
            if array is not None and np.may_share_memory(made, array):
                raise RunError(f"out: shares memory with {what}; give another array")
        return made

    def _first(self, first: Any, k: int) -> FloatArray:
        array, ny = _numbers(first, "first"), len(self.states)
        if array.shape not in ((ny,), self.shape):
            raise RunError(f"first: shape {array.shape} is not ({ny},) or {self.shape}")
        if not np.isfinite(array).all():
            raise RunError("first: not all are finite numbers")
        return np.ascontiguousarray(array.reshape(ny, -1))

    def _mask(self, reset: Any, k: int) -> Mask:
        array = np.asarray(reset)
        if array.dtype != np.bool_ or (array.shape != (k,) and (self.lanes or array.ndim)):
            raise RunError(f"reset: give an array of {k} bools, one for each lane")
        return np.ascontiguousarray(array.reshape(k))

    def _times(self, t: Any) -> float | FloatArray:
        if t.__class__ is float and math.isfinite(t):
            return float(t)
        array = _numbers(t, "t")
        if array.shape not in ((), (self.lanes,)) or not np.isfinite(array).all():
            raise RunError("t: give a finite number of seconds, or one for each lane")
        return float(array) if array.ndim == 0 else np.ascontiguousarray(array)

    def _sets(self, u: Set, p: Set, k: int) -> tuple[FloatArray | None, FloatArray | None]:
        module = self.module
        if p is not None and self.method.startswith("leapfrog") and module.FORM != "velocity":
            raise RunError("p: leapfrog drifts with the scene's own masses; take form = 'velocity'")
        return (
            None if u is None else _set(u, module.INPUTS, "u", "input", k),
            None if p is None else _set(p, module.PARAMETERS, "p", "parameter", k),
        )


def _numbers(values: Any, what: str) -> FloatArray:
    """Values as an array of floats. Raises `RunError` if they are none."""
    if values.__class__ is np.ndarray and values.dtype == np.float64:
        return np.asarray(values)
    try:
        array = np.asarray(values)
    except ValueError:
        raise RunError(f"{what}: rows differ in length; give an array of floats") from None
    if array.dtype.kind not in "iuf" or np.ma.is_masked(values):
        raise RunError(f"{what}: of type {array.dtype.name}; give an array of floats")
    return array.astype(np.float64)


def _set(
    values: Any, defaults: Mapping[str, float], argument: str, what: str, k: int
) -> FloatArray:
    """Inputs or parameters of k lanes, (n,) or (n, k)."""
    if isinstance(values, Mapping):
        named = {identifier(name): value for name, value in values.items()}
        for name in named:
            check_name(name, defaults, argument, what)
        parts = [
            _numbers(named.get(name, default), f"{argument}: {name}")
            for name, default in defaults.items()
        ]
        for name, part in zip(defaults, parts, strict=True):
            if part.shape not in ((), (k,)):
                raise RunError(f"{argument}: {name} has shape {part.shape}, not () or ({k},)")
        many = any(part.ndim for part in parts)
        rows = [np.broadcast_to(part, k) if many else part for part in parts]
        array = np.array(rows, dtype=np.float64).reshape(len(defaults), *((k,) if many else ()))
    else:
        array = _numbers(values, argument)
    shapes = ((len(defaults),), (len(defaults), k))
    if array.shape not in shapes:
        raise RunError(
            f"{argument}: shape {array.shape} is not {shapes[0]} or {shapes[1]}: "
            f"{', '.join(defaults) or 'the scene has none'}"
        )
    if array.ndim == 1 and not np.isfinite(array).all():
        raise RunError(f"{argument}: not all are finite numbers")
    return np.ascontiguousarray(array)
