"""Evaluation of programs with 60 decimal digits."""

from collections.abc import Callable, Mapping
from typing import Any

import gmpy2
from gmpy2 import mpfr

from eomgen.program.program import Program, interpreter
from eomgen.scalars.extended import MP, Bits, out_of_bits, sixty_digits


def evaluator(program: Program, output: str) -> Callable[[Mapping[str, Any]], list[Any]]:
    """A function that evaluates one output of a program with 60 digits.

    It takes the values of inputs by name, doubles or 60-digit numbers. It computes what `interpret`
    computes over `Digits`, faster. It raises `ArithmeticError` or `ValueError` where a value is not
    real or not finite.
    """
    steps = interpreter(program, output, Bits())

    def run(inputs: Mapping[str, Any]) -> list[Any]:
        # The precision of MPFR operations is that of the context in which they run.
        with sixty_digits():
            return out_of_bits(steps({name: _in_bits(value) for name, value in inputs.items()}))

    return run


def _in_bits(value: Any) -> Any:
    if isinstance(value, float):
        return mpfr(value)
    minus, significand, exponent, _ = MP.mpf(value)._mpf_
    if not significand:  # zero, infinity or nan
        return mpfr(float(value))
    scaled = gmpy2.mul_2exp if exponent >= 0 else gmpy2.div_2exp
    return scaled(mpfr(-significand if minus else significand), abs(exponent))
