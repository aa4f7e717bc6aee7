"""In which order a person writes factors and terms: m g l sin θ, θ + φ."""

from typing import Any

import sympy as sp

from eomgen.show.notation import GREEK, parsed

Expr = Any
MASSES = ("m", "M", "I", "J")
LETTERS = {name: f"{i:02}" for i, name in enumerate(GREEK)}


def ordered_factors(e: Expr) -> list[Expr]:
    """Numbers, masses, g, other constants and coordinates, their rates, sums, functions."""
    return sorted(e.as_ordered_factors(), key=_rank)


def ordered_terms(e: Expr) -> list[Expr]:
    """The terms of a sum: single masses, positions and accelerations first; angles and their rates
    by the Greek alphabet, positive ones first.
    """
    terms = list(e.as_ordered_terms())
    plain = [term.as_coeff_Mul() for term in terms]
    if all(x.is_Symbol and parsed(x.name).base in GREEK for _, x in plain):
        return sorted(terms, key=lambda term: _signed(*term.as_coeff_Mul()))
    return sorted(terms, key=lambda term: not (term.is_Symbol and _leads(term)))


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
            return 5, _letter(base)
        if name.base in MASSES:
            return 1, _letter(base)
        return (2 if name.base in ("g", "gravity") else 3), _letter(base)
    if base.is_Add:
        return 6, ()
    return (7 if base.has(sp.Function) else 4), ()


def _letter(symbol: Expr) -> tuple[str, ...]:
    name = parsed(symbol.name)
    return LETTERS.get(name.base, name.base), *name.below
