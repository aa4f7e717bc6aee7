"""Programs in 60 digits."""

from collections.abc import Callable, Mapping
from typing import Any

import gmpy2
from gmpy2 import mpfr

from eomgen.program.program import Program, interpreter
from eomgen.scalars.extended import MP, Bits, out_of_bits, sixty_digits


def evaluator(program: Program, output: str) -> Callable[[Mapping[str, Any]], list[Any]]:
    """One output of a program in 60 digits, for many inputs: doubles, or 60-digit numbers.

    It takes the steps that `interpret` takes over `Digits`, faster. It raises `ArithmeticError` or
    `ValueError` where there is no finite real value.
    """
    steps = interpreter(program, output, Bits())

    def run(inputs: Mapping[str, Any]) -> list[Any]:
        # Only here, since MPFR's numbers are as exact as the context of whoever uses them.
        with sixty_digits():
            found = steps({name: _in_bits(value) for name, value in inputs.items()})
            return out_of_bits(found)

    return run


def _in_bits(value: Any) -> Any:
    if isinstance(value, float):
        return mpfr(value)
    minus, significand, exponent, _ = MP.mpf(value)._mpf_
    if not significand:  # of 0, and of what is not finite
        return mpfr(float(value))
    scaled = gmpy2.mul_2exp if exponent >= 0 else gmpy2.div_2exp
    return scaled(mpfr(-significand if minus else significand), abs(exponent))
