"""The guard of a module's runs: its derivative in extended precision; see `run.guard`."""

from typing import Any

import numpy as np
from gmpy2 import mpfr

from eomgen.program.program import Program
from eomgen.run.guard import LOST, Guard
from eomgen.run.module import GeneratedModule
from eomgen.run.problem import FloatArray
from eomgen.study.precision.extended import BITS
from eomgen.study.precision.precise import digits, precise


def guard_of(
    module: GeneratedModule,
    program: Program,
    parameters: Any = None,
    inputs: Any = None,
    *,
    bound: float = LOST,
    repairs: bool = False,
) -> Guard:
    """A guard for runs of a module, generated from `program`, at given parameters and constant
    inputs, which must be valid.
    """
    initial = module.initial_state(parameters)
    exactly = precise(program, module, parameters, inputs, initial, bits=BITS)

    def exact(t: float, y: FloatArray) -> FloatArray:
        with digits(BITS):
            rates = exactly.derivative(mpfr(t), [mpfr(x) for x in y.tolist()])
            return np.array([float(rate) for rate in rates])

    units = [module.UNITS.get(state, "") for state in module.STATES]
    groups = tuple(
        tuple(
            i
            for i, other in enumerate(units)
            if other == unit and (i in module.POSITIONS) == positions
        )
        for unit in dict.fromkeys(units)
        for positions in (True, False)
    )
    return Guard(exact, tuple(group for group in groups if group), bound, repairs)
