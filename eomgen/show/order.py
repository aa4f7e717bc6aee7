"""In which order a person writes factors and terms: m g l sin θ, θ + φ."""

from typing import Any

import sympy as sp

from eomgen.show.notation import GREEK, parsed

Expr = Any
MASSES = ("m", "M", "I", "J")
TURNING = ("alpha", "beta", "gamma", "theta", "phi", "psi", "omega", "Omega", "W")
"""Letters of angles, of their rates and of rotations, which stand after lengths: l θ, r ω."""
LETTERS = {name: f"{i:02}" for i, name in enumerate(GREEK)}


def ordered_factors(e: Expr) -> list[Expr]:
    """Numbers, masses, g, other constants and coordinates, angles, their rates, sums, functions."""
    return sorted(e.as_ordered_factors(), key=_rank)


def ordered_terms(e: Expr) -> list[Expr]:
    """The terms of a sum: single masses, positions and accelerations first; angles and their rates
    by the Greek alphabet. A sum begins with a positive term if it has one.
    """
    terms = list(e.as_ordered_terms())
    plain = [term.as_coeff_Mul() for term in terms]
    if all(x.is_Symbol and parsed(x.name).base in GREEK for _, x in plain):
        return sorted(terms, key=lambda term: _signed(*term.as_coeff_Mul()))
    found = sorted(terms, key=lambda term: not (term.is_Symbol and _leads(term)))
    if not negative(found[0]):
        return found
    first = next((i for i, term in enumerate(found) if not negative(term)), 0)
    return [found[first], *found[:first], *found[first + 1 :]]


def negative(term: Expr) -> bool:
    """Whether a term of a sum is written with a minus."""
    if isinstance(term, sp.MatMul):
        return bool(term.args[0].is_number and term.args[0] < 0)
    return bool(not term.is_Matrix and term.as_coeff_Mul()[0].is_negative)


def _signed(coefficient: Expr, symbol: Expr) -> tuple[bool, tuple[str, ...]]:
    return bool(coefficient.is_negative), _letter(symbol)


def _leads(symbol: Expr) -> bool:
    name = parsed(symbol.name)
    return name.dots == 2 or name.base in (*MASSES, "x", "y", "z")


def _rank(factor: Expr) -> tuple[int, Any]:
    base = factor.as_base_exp()[0] if factor.is_Pow else factor
    if base.is_Number:
        return 0, ()
    if base.is_Symbol:
        name = parsed(base.name)
        if name.dots:
            return 6, (str(name.base in TURNING), *_letter(base))
        if name.base in MASSES:
            return 1, _letter(base)
        if name.base in TURNING:
            return 4, _letter(base)
        return (2 if name.base in ("g", "gravity") else 3), _letter(base)
    if base.is_Add:
        return 7, ()
    return (8 if base.has(sp.Function) else 5), ()


def _letter(symbol: Expr) -> tuple[str, ...]:
    name = parsed(symbol.name)
    return LETTERS.get(name.base, name.base), *name.below
