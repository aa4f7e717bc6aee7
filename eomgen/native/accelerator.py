"""When a run takes compiled steps and functions: at once if their library is in the store; else if
it is long.

They have the bits of Python's, so a run may change to them at any time. A library is compiled once
Python has taken as long for what it computes as compiling will take: so that never takes more than
about twice as long as with the better of the two from the start on.
"""

import ctypes
import hashlib
import math
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any

from eomgen.codegen.backends import c
from eomgen.errors import RunError
from eomgen.model.model import Model
from eomgen.native import functions, heyoka, runs, taylor
from eomgen.native.library import compiled_library, kept_library
from eomgen.run.compiled import Compiled, EqualSteps, Series, Steps
from eomgen.run.problem import Problem
from eomgen.store import interfaced_program_of, key_of

STARTING, AN_OPERATION = 0.2, 0.25e-3
"""Time to compile, s: a part for all, and a part for each operation. Measured from 11 to 24,500
operations, within a factor of 3."""

Sources = Callable[[], Mapping[str, str]]


class _Library:
    """A library that is taken from the store, or compiled when that pays.

    about         what determines it, see `native.library.compiled_library`
    sources, main its sources, and the one that includes the others
    price         time to compile, s
    fail          called with the error of a compiler
    """

    def __init__(
        self, about: str, sources: Sources, main: str, price: float, fail: Callable[[str], None]
    ) -> None:
        self._about, self._sources, self._main, self._price = about, sources, main, price
        self._fail = fail
        self._looked, self._over = False, False
        self._found: ctypes.CDLL | None = None

    def after(self, spent: float) -> ctypes.CDLL | None:
        """The library, if it is there or Python has taken so long, s, that compiling pays."""
        if self._over:
            return self._found
        if not self._looked:
            self._looked = True
            with suppress(RunError):  # no compiler: said only if the run is a long one
                self._found = kept_library(self._about)
                self._over = self._found is not None
        if spent > self._price and not self._over:
            try:
                self.compile()
            except RunError as error:
                self._fail(str(error))
        return self._found

    def compile(self) -> None:
        """Compile it now, unless it is in the store. Raises `RunError`."""
        self._over = True
        self._found = compiled_library(self._about, self._sources, self._main)


class Accelerator:
    """The compiled steps and functions of a model's module, at given parameters and inputs.

    `used` tells whether a run has taken some. `notice` is why there are none although a run was
    long enough for them, or "".
    """

    def __init__(self, model: Model, module: Any, parameters: Any, inputs: Any) -> None:
        self._model, self._module, self._values = model, module, (parameters, inputs)
        self._begun: float | None = None
        self._at_once = False
        self._libraries: dict[str, _Library] = {}
        self.used, self.notice = False, ""

    def of(self, problem: Problem, module: Any = None) -> Problem:
        """The problem of the module, or of one with other constants, with its compiled steps and
        functions.
        """
        perturbed, module = module is not None, module or self._module
        made: list[runs.CompiledSteps] = []
        compilable = functions.Compilable(module, self._values, perturbed, self._look, self._start)
        problem = compilable.problem(problem)

        def compiled() -> runs.CompiledSteps | None:
            library = self._of_steps(0.0)
            if library is not None and not made:
                made.append(runs.CompiledSteps(module, library, *self._values))
            return made[0] if made else None

        @cache
        def series() -> taylor.CompiledTaylor | None:
            return self._taylor(module)

        def steps(name: str) -> Steps | None:
            if name == "taylor":
                return of.steps if (of := series()) else None
            found = held.named(name) if (held := compiled()) else None
            self.used = self.used or found is not None
            return found

        def equal(name: str) -> EqualSteps | None:
            found = held.equal(name) if (held := compiled()) else None
            self.used = self.used or found is not None
            return found

        def of_solutions() -> Series:
            found = series()
            return found.series if found else plain()

        problem = with_series(problem, self._model, module, self._values)
        plain = problem.series["taylor"]
        made_of = {**problem.series, "taylor": of_solutions}
        return replace(problem, compiled=Compiled(problem.derivative, steps, equal), series=made_of)

    def compile(self) -> None:
        """Compile the steps now, unless they are in the store, and each function at its first call.

        Raises `RunError` if there is no compiler, or if it fails.
        """
        self._at_once = True
        self._library("derivative").compile()

    def _taylor(self, module: Any) -> taylor.CompiledTaylor | None:
        """The Taylor series of a module; None without a compiler. They are compiled at once: other
        code would compute other bits, so a run must not change over to them.
        """
        program, interface = interfaced_program_of(self._model)
        taylor.system_of(program, interface)
        try:
            library = self._library("taylor")
            library.compile()
            found = library.after(0.0)
        except RunError as error:
            self._fail(str(error))
            return None
        assert found is not None
        self.used = True
        return taylor.CompiledTaylor(program, interface, module, found, self._values)

    def _start(self) -> None:
        self.used = True

    def _look(self, name: str) -> functions.Look:
        """When the library of a function is there; that of the derivative also makes steps."""
        if name == "derivative":
            return self._of_steps
        if self._at_once:
            return lambda spent: self._library(name).after(math.inf)
        return lambda spent: self._library(name).after(spent)

    def _of_steps(self, spent: float) -> ctypes.CDLL | None:
        """The library of the steps; they take as long as the run."""
        now = time.perf_counter()
        if self._begun is None:
            self._begun = now
        return self._library("derivative").after(now - self._begun)

    def _library(self, name: str) -> _Library:
        if name not in self._libraries:
            self._libraries[name] = _Library(
                library_key(self._model, name),
                partial(_sources, self._model, name),
                {"derivative": runs.MAIN, "taylor": taylor.MAIN}.get(name, c.MAIN),
                STARTING + AN_OPERATION * self._module.COST.get(name, {"total": 0})["total"],
                self._fail,
            )
        return self._libraries[name]

    def _fail(self, why: str) -> None:
        self.notice = why


def with_series(problem: Problem, model: Model, module: Any, values: tuple[Any, Any]) -> Problem:
    """A problem with the Taylor series of its solutions that need no compiler."""

    def plain() -> Series:
        return taylor.plain_series(*interfaced_program_of(model), module, *values)

    def by_heyoka() -> Series:
        given = heyoka.parameter_values(*interfaced_program_of(model), module, *values)
        key = key_of(model)
        if key not in _BY_HEYOKA:  # they take long to compile
            _BY_HEYOKA[key] = heyoka.integrators_of(*interfaced_program_of(model))
        return heyoka.heyoka_series(_BY_HEYOKA[key], given)

    return replace(problem, series={"taylor": cache(plain), "heyoka": cache(by_heyoka)})


def without_compiler(model: Model, module: Any, values: tuple[Any, Any]) -> Callable[..., Problem]:
    """The same as `Accelerator.of` for runs in Python."""

    def of(problem: Problem, other: Any = None) -> Problem:
        return with_series(problem, model, other or module, values)

    return of


_BY_HEYOKA: dict[str, Callable[[int], Any]] = {}
"""heyoka's integrators of each model so far, by its key."""


def _sources(model: Model, name: str) -> Mapping[str, str]:
    """The sources of a function's library; with the derivative are the steps."""
    program, interface = interfaced_program_of(model)
    if name == "derivative":
        return runs.sources(program, interface)
    if name == "taylor":
        return taylor.sources(program, interface)
    return functions.sources(program, interface, name)


def library_key(model: Model, name: str = "derivative") -> str:
    """What determines these sources."""
    return f"{name} {key_of(model)} {_digest()}"


@cache
def _digest() -> str:
    """A digest of the files that, beside the model, determine the sources of a library."""
    here = Path(__file__).resolve().parent
    methods = here.parent / "run" / "integrators"
    found = hashlib.sha256()
    for path in (*sorted(here.glob("*.py")), *sorted(methods.glob("*.py"))):
        found.update(path.name.encode() + b"\0" + path.read_bytes())
    return found.hexdigest()
