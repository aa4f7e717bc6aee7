"""Where the steps and functions of a run are computed: in Python or in compiled code.

The rule, `pays`: in compiled code if its libraries are in the store, or once Python has taken as
long as compiling them will. Then they are compiled, all that it needs together. So a run never
takes more than about twice as long as it would with the better of the two from the start on. Runs
ask for steps before each portion of these; both places make the same ones.
"""

import ctypes
import math
import os
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from copy import copy
from dataclasses import replace
from functools import cache, cached_property, partial
from threading import RLock
from typing import Any, TypeVar

from eomgen.base.errors import RunError
from eomgen.codegen.backends import c
from eomgen.codegen.interface import Interface
from eomgen.codegen.series import recurrences_of
from eomgen.model.model import Model
from eomgen.native import contact_runs, equal_steps, functions, implicit, runs, taylor
from eomgen.native.library import compiled_library, kept_library
from eomgen.native.mechanism import FUNCTIONS, Given, Mechanism, mechanism
from eomgen.program.program import Program
from eomgen.run.compiled import (
    Compiled,
    EqualSteps,
    Series,
    Steps,
    Stretch,
    Stride,
    Strikes,
    Through,
)
from eomgen.run.integrators.strides import OF_STATE
from eomgen.run.problem import Problem
from eomgen.run.projection import PROJECTS
from eomgen.run.through_events import THROUGH_EVENTS
from eomgen.run.works import Powers
from eomgen.store import interfaced_program_of, key_of, package_digest

T = TypeVar("T")
STARTING, AN_OPERATION = 0.2, 0.25e-3
"""Time to compile, s: a part for all, and a part for each operation. Measured from 11 to 24,500
operations, within a factor of 3."""

Sources = Callable[[], Mapping[str, str]]
Libraries = Mapping[str, ctypes.CDLL]
"""Libraries by the names of their functions."""


def pays(spent: float, price: float) -> bool:
    """Whether to compile what takes `price` s to compile: once Python has taken as long. For steps
    this is the time of the run so far, for a single function what Python has spent on it.
    """
    return spent > price


class _Library:
    """A library that is taken from the store, or compiled when that pays.

    about         what determines it, see `native.library.compiled_library`
    sources, main its sources, and the one that includes the others
    price         time to compile, s
    fail          called with the error of a compiler

    `found` is None until it is there. Threads may share it.
    """

    def __init__(
        self, about: str, sources: Sources, main: str, price: float, fail: Callable[[str], None]
    ) -> None:
        self._about, self._sources, self._main = about, sources, main
        self.price, self._fail = price, fail
        self._looked, self._over = False, False
        self.found: ctypes.CDLL | None = None
        self._spent, self._lock = 0.0, RLock()

    @property
    def is_missing(self) -> bool:
        """Whether it would have to be compiled, and this has not failed."""
        if not self._looked:
            with self._lock, suppress(RunError):  # no compiler: said only if the run is a long one
                self.found = self.found or kept_library(self._about)
                self._over = self.found is not None
            self._looked = True
        return not self._over

    def beyond(self, more: float) -> ctypes.CDLL | None:
        """The library, if it is there, or if Python has taken so much more, s, that compiling pays;
        the time of all runs counts.
        """
        self._spent += more
        if self.is_missing and pays(self._spent, self.price):
            with suppress(RunError):
                self.compile()
        return self.found

    def compile(self) -> None:
        """Compile it now, unless it is in the store. Raises `RunError`."""
        with self._lock:
            if self.found is not None:
                return
            self._over = True
            try:
                self.found = compiled_library(self._about, self._sources, self._main)
            except RunError as error:
                self._fail(str(error))
                raise


class Accelerator:
    """The compiled steps and functions of a model's module, at given parameters and inputs.

    `program` is that of the model with its interface; None takes it from the store, or derives it.
    `used` says whether a run has taken some. `notice` is why there are none although a run was
    long enough for them, or "".
    """

    def __init__(
        self,
        model: Model,
        module: Any,
        parameters: Any,
        inputs: Any,
        *,
        program: tuple[Program, Interface] | None = None,
    ) -> None:
        self._model, self._module, self._values = model, module, (parameters, inputs)
        self._of_model = cache(lambda: program or interfaced_program_of(model))
        self._lock = RLock()
        self._begun: float | None = None
        self._at_once = False
        self._libraries: dict[str, _Library] = {}
        self.used, self.notice = False, ""

    def at(self, parameters: Any, inputs: Any) -> "Accelerator":
        """The same at other values. Both have the same libraries, and the time that runs take is
        that of both.
        """
        self._begun = self._begun or time.perf_counter()
        made = copy(self)
        made._values = (parameters, inputs)
        return made

    def function(self, name: str, python: functions.Value) -> functions.Value:
        """An output as a function of time and state, which is compiled once that pays."""
        return self._compilable(self._module, None).function(name, python)

    def of(self, problem: Problem, module: Any = None) -> Problem:
        """The problem of the module, or of one with other constants, with its compiled steps and
        functions.
        """
        origin, module = module and self._module, module or self._module
        problem = self._compilable(module, origin).problem(problem)
        found = _Steps(self, problem, Given(module, {}, self._values, origin))
        problem = with_series(problem, self._model, module, self._values)
        plain = problem.series["taylor"]

        def of_solutions() -> Series:
            return found.series.series if found.series else plain()

        compiled = Compiled(
            problem.derivative, found.steps, found.equal, found.strikes, found.through
        )
        return replace(
            problem, compiled=compiled, series={**problem.series, "taylor": of_solutions}
        )

    def powers(self, powers: Powers) -> Powers:
        """The same powers, which are compiled once that pays."""
        return replace(powers, powers=self.function("effect_powers", powers.powers))

    def compile(self, names: Sequence[str] = ("derivative",)) -> None:
        """Compile the steps now, with the functions of these names, at the same time, unless they
        are in the store; and each other function at its first call.

        Raises `RunError` if there is no compiler, or if it fails.
        """
        self._at_once = True
        self._compile([self._library(name) for name in names])

    def _compile(self, libraries: Sequence[_Library]) -> None:
        if any(library.is_missing for library in libraries):
            self._of_model()  # which all of them need
        with ThreadPoolExecutor(min(len(libraries), os.cpu_count() or 1)) as pool:
            list(pool.map(_Library.compile, libraries))

    def _compilable(self, module: Any, origin: Any) -> functions.Compilable:
        return functions.Compilable(module, self._values, origin, self._look, self._start)

    def taylor(self, module: Any) -> taylor.CompiledTaylor | None:
        """The Taylor series of a module; None without a compiler. They are compiled at once: steps
        in Python take far longer than that.
        """
        program, interface = self._of_model()
        recurrences_of(program, interface)
        try:
            library = self._library("taylor")
            library.compile()
        except RunError:
            return None
        found = library.found
        assert found is not None
        self.used = True
        return taylor.CompiledTaylor(program, interface, module, found, self._values)

    def _start(self) -> None:
        self.used = True

    def _look(self, name: str) -> functions.Look:
        """When the library of a function is there; that of the derivative also makes steps."""
        if name == "derivative":
            return lambda spent: (self.found((name,)) or {}).get(name)
        if self._at_once:
            return lambda spent: self._library(name).beyond(math.inf)
        return self._library(name).beyond

    def found(self, names: Sequence[str]) -> Libraries | None:
        """The libraries of steps, if they are in the store, or once the run has taken as long as
        compiling them will; None before that, and if there are none.
        """
        begun = self._begun = self._begun or time.perf_counter()
        of_method = names[-1].startswith(implicit.LIBRARY)
        if of_method and not all(hasattr(self._module, name) for name in names[:-1]):
            return None
        needed = {name: self._library(name) for name in names}
        missing = [library for library in needed.values() if library.is_missing]
        price = sum(library.price for library in missing)
        spent = math.inf if self._at_once else time.perf_counter() - begun
        if missing and pays(spent, price):
            with suppress(RunError):
                self._compile(missing)
        there = {name: x.found for name, x in needed.items() if x.found is not None}
        return there if len(there) == len(needed) else None

    def _library(self, name: str) -> _Library:
        """That of a function, or that of an implicit method, which many models share."""
        with self._lock:
            if name not in self._libraries:
                self._libraries[name] = self._made(name)
            return self._libraries[name]

    def _made(self, name: str) -> _Library:
        if name.startswith(implicit.LIBRARY):
            states = len(self._module.STATES)
            price = STARTING + AN_OPERATION * implicit.OPERATIONS[states >= implicit.MANY]
            about = f"{name} {states} {package_digest()}"
            make = partial(implicit.sources, name, states)
            return _Library(about, make, implicit.MAIN, price, self._fail)
        return _Library(
            library_key(self._model, name),
            partial(self._sources, name),
            {"derivative": runs.MAIN, "taylor": taylor.MAIN}.get(name, c.MAIN),
            STARTING + AN_OPERATION * self._module.COST.get(name, {"total": 0})["total"],
            self._fail,
        )

    def _sources(self, name: str) -> Mapping[str, str]:
        """The sources of a function's library; with the derivative are the steps."""
        program, interface = self._of_model()
        if name == "derivative":
            return runs.sources(program, interface)
        if name == "taylor":
            return taylor.sources(program, interface)
        return functions.sources(program, interface, name)

    def _fail(self, why: str) -> None:
        self.notice = why


class _Steps:
    """The compiled steps of a problem of a module, which is given without libraries. What is made
    of libraries is made once.
    """

    def __init__(self, accelerator: Accelerator, problem: Problem, given: Given) -> None:
        self._of, self._problem, self._given = accelerator, problem, given
        self._made: dict[Any, Any] = {}
        self._projects = PROJECTS if problem.projection else ()
        self._contacts = contact_runs.FUNCTIONS if problem.contacts else ()
        switching = problem.switching
        self._switching = OF_STATE if switching and switching.of_state else ()

    @cached_property
    def series(self) -> taylor.CompiledTaylor | None:
        """The Taylor series; None without a compiler."""
        return self._of.taylor(self._given.module)

    def steps(self, name: str, needed: tuple[str, ...]) -> Steps | None:
        """See `Compiled`."""
        if name == "taylor":
            return self._by_series(needed)
        if name == "DOP853":
            return self._once(name, ("derivative", *needed), partial(partial, runs.dop853))
        problem, meets = self._problem, set(self._contacts) & set(needed)
        own = implicit.needed(name, problem if meets else replace(problem, contacts=None))
        further = tuple(x for x in needed if x not in own)
        make = partial(partial, implicit.rodas_5p, problem)
        return self._once(name, (*further, *own), make)

    def _by_series(self, needed: tuple[str, ...]) -> Steps | None:
        """Steps by Taylor series, and by DOP853 while contacts are held, whose forces have none."""
        series = self.series
        if series is None or not needed:
            return None if series is None else series.steps

        def make(of: Mechanism, _: ctypes.CDLL) -> Steps:
            return partial(series.steps, of=of)

        def make_held(of: Mechanism, library: ctypes.CDLL) -> Steps:
            return partial(runs.held, of, library)

        free = self._once("taylor", ("derivative", *needed, "taylor"), make)
        if not self._contacts:
            return free
        held = self._once("held", ("derivative", *needed), make_held)

        def steps(stretch: Stretch) -> Stride:
            assert free and held
            is_held = stretch.touched and stretch.touched.now.holds.any()
            return (held if is_held else free)(stretch)

        return steps if free and held else None

    def through(self, name: str) -> Through | None:
        """See `Compiled`."""
        if not (self._contacts or self._switching) or name not in THROUGH_EVENTS:
            return None
        if name == "DOP853":
            needed: tuple[str, ...] = ("derivative", *self._switching, *self._contacts)
            return self._once("through", needed, partial(partial, runs.through))
        make = partial(partial, implicit.through, self._problem)
        needed = (*self._switching, *implicit.needed(name, self._problem))
        return self._once("through", needed, make)

    def equal(self, name: str) -> EqualSteps | None:
        """See `Compiled`."""
        needed, make = ("derivative", *self._projects, *self._contacts), equal_steps.steps
        leaps = self._projects and name in equal_steps.LEAPFROGS
        if leaps or name in (*implicit.GAUSS, implicit.OWN_STEPS):
            needed, make = implicit.needed(name, self._problem), implicit.equal
        return self._once(name, needed, partial(make, name, self._problem))

    def strikes(self) -> Strikes | None:
        """See `Compiled`."""

        def make(of: Mechanism, library: ctypes.CDLL) -> Strikes:
            return partial(contact_runs.strikes, library.strikes, of)

        return self._once("strikes", ("derivative", *self._contacts), make)

    def _once(self, name: str, needed: tuple[str, ...], make: Callable[..., T]) -> T | None:
        """What is made of a mechanism and of the library of a method, as soon as all libraries are
        there; None before that, and if kernels cannot compute what steps need.
        """
        made = self._made
        if (name, needed) not in made and (libraries := self._of.found(needed)):
            of = mechanism(self._given._replace(libraries=libraries))
            own = libraries[needed[-1] if needed[-1] not in FUNCTIONS else "derivative"]
            made[name, needed] = of and make(of, own)
        found: T | None = made.get((name, needed))
        self._of.used = self._of.used or found is not None
        return found


def with_series(problem: Problem, model: Model, module: Any, values: tuple[Any, Any]) -> Problem:
    """A problem with the Taylor series of its solutions that need no compiler."""

    def plain() -> Series:
        return taylor.plain_series(*interfaced_program_of(model), module, *values)

    return replace(problem, series={"taylor": cache(plain)})


def without_compiler(model: Model, module: Any, values: tuple[Any, Any]) -> Callable[..., Problem]:
    """The same as `Accelerator.of` for runs in Python."""

    def of(problem: Problem, other: Any = None) -> Problem:
        return with_series(problem, model, other or module, values)

    return of


def library_key(model: Model, name: str = "derivative") -> str:
    """What determines these sources."""
    return f"{name} {key_of(model)} {package_digest()}"
