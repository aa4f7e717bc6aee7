"""When a run takes compiled steps: at once if its library is in the store; else if it is long.

Compiled steps have the bits of Python's, so a run may change to them at any step, and it does not
matter when. A library is compiled once the run has taken as long in Python as compiling will take:
so it never takes more than about twice as long as with the better of the two from the start on.
"""

import ctypes
import hashlib
import time
from contextlib import suppress
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

from eomgen.errors import RunError
from eomgen.model.model import Model
from eomgen.native.library import compiled_library, kept_library
from eomgen.native.runs import MAIN, CompiledSteps, sources
from eomgen.run.compiled import Compiled, EqualSteps, Steps
from eomgen.run.problem import Problem
from eomgen.store import interfaced_program_of, key_of

STARTING, AN_OPERATION = 0.4, 0.6e-3
"""Time to compile, s: a part for all, and a part for each operation of the derivative. Measured
from 46 to 5,300 operations, within a factor of 2."""


class Accelerator:
    """The compiled steps of a model's module, at given parameters and inputs.

    `used` tells whether a run has taken some. `notice` is why there are none although a run was
    long enough for them, or "".
    """

    def __init__(self, model: Model, module: Any, parameters: Any, inputs: Any) -> None:
        self._model, self._module, self._values = model, module, (parameters, inputs)
        operations = module.COST["derivative"]["total"]
        self._price = STARTING + AN_OPERATION * operations
        self._begun: float | None = None
        self._due = True
        self._library: ctypes.CDLL | None = None
        self.used, self.notice = False, ""

    def of(self, problem: Problem, module: Any = None) -> Problem:
        """The problem of the module, or of one with other constants, with its compiled steps."""
        made: list[CompiledSteps] = []

        def library() -> CompiledSteps | None:
            if self._due:
                self._look()
            if self._library is None:
                return None
            if not made:
                made.append(CompiledSteps(module or self._module, self._library, *self._values))
            return made[0]

        def steps(name: str) -> Steps | None:
            found = held.named(name) if (held := library()) else None
            self.used = self.used or found is not None
            return found

        def equal(name: str) -> EqualSteps | None:
            found = held.equal(name) if (held := library()) else None
            self.used = self.used or found is not None
            return found

        return replace(problem, compiled=Compiled(problem.derivative, steps, equal))

    def compile(self) -> None:
        """Compile now, unless the library is in the store.

        Raises `RunError` if there is no compiler, or if it fails.
        """
        self._due = False
        self._library = compiled_library(
            library_key(self._model), lambda: sources(*interfaced_program_of(self._model)), MAIN
        )

    def _look(self) -> None:
        """Take the library from the store, or compile it if the run has taken long enough."""
        if self._begun is None:
            self._begun = time.perf_counter()
            with suppress(RunError):  # no compiler: said only if the run is a long one
                self._library = kept_library(library_key(self._model))
                self._due = self._library is None
        elif time.perf_counter() - self._begun > self._price:
            try:
                self.compile()
            except RunError as error:
                self.notice = str(error)


def library_key(model: Model) -> str:
    """What determines the sources of a model's compiled steps."""
    return f"runs {key_of(model)} {_digest()}"


@cache
def _digest() -> str:
    """A digest of the files that, beside the model, determine the sources of a library."""
    here = Path(__file__).resolve().parent
    methods = here.parent / "run" / "integrators"
    found = hashlib.sha256()
    for path in (*sorted(here.glob("*.py")), *sorted(methods.glob("*.py"))):
        found.update(path.name.encode() + b"\0" + path.read_bytes())
    return found.hexdigest()
