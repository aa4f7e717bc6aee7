"""Formulas as a person would write them: the shortest of a few forms.

The forms are cheap rewritings, not a search: the sum with sin² + cos² = 1, the same with products
of sines and cosines as functions of sums of angles, and each with what its terms share in front.
"""

from collections.abc import Iterator, Sequence

import sympy as sp

from eomgen.derivation.projected.simplify import canonical
from eomgen.derivation.symbols import Expr, tidy

LONGEST = 250
"""Operations of an expression up to which it is simplified."""
MOST_TERMS = 60
"""Terms of an expanded sum up to which it is collected."""


def simplified(e: Expr) -> Expr:
    """The shortest form found, of a scalar or of each entry of a matrix."""
    if isinstance(e, sp.MatrixBase):
        return e.applyfunc(simplified)
    if not isinstance(e, sp.Expr) or e.is_Matrix or e.is_Atom or size(e) > LONGEST:
        return e
    if e.has(sp.Piecewise) or isinstance(e, sp.Function):
        return e
    return min(_forms(e), key=lambda form: (size(form), len(sp.Add.make_args(form))))


def size(e: Expr) -> int:
    """The symbols, numbers and signs of a formula."""
    if e.is_Atom:
        return 1 if not e.is_Rational or e.is_Integer else 2
    if isinstance(e, sp.Pow):
        return size(e.base) + (1 if e.exp in (2, -1) else 2) + int(e.base.is_Add)
    if isinstance(e, sp.Add):
        return sum(map(size, e.args)) + len(e.args) - 1
    if isinstance(e, sp.Mul):
        sums = any(x.is_Add for x in e.args)
        return sum(size(x) + int(x.is_Add) for x in e.args if x != -1) + int(sums and -1 in e.args)
    return 1 + sum(map(size, e.args))


def _forms(e: Expr) -> Iterator[Expr]:
    yield e
    top, bottom = sp.fraction(sp.together(e))
    if bottom.is_Number:
        for flat in _flat(e):
            yield flat
            yield from _collected(flat)
        return
    over, under = (min(_whole(x), key=size) for x in (top, bottom))
    yield sp.cancel(over / under) if size(over) + size(under) < LONGEST // 4 else over / under
    yield over / under
    yield sp.Add(*(min(_whole(x), key=size) / under for x in sp.Add.make_args(over)))


def _whole(e: Expr) -> Iterator[Expr]:
    """Forms of what has no denominator but numbers."""
    yield e
    for flat in _flat(e):
        yield flat
        yield from _collected(flat)


def _flat(e: Expr) -> Iterator[Expr]:
    """Expanded sums, equal by trigonometric identities."""
    flat = sp.expand(e)
    if len(sp.Add.make_args(flat)) > MOST_TERMS:
        return
    yield flat
    if not flat.has(sp.sin, sp.cos):
        return
    yield canonical(flat)
    yield _no_even_sines(flat)
    yield tidy(flat)


def _no_even_sines(flat: Expr) -> Expr:
    """sin² as 1 - cos²."""

    def changed(power: Expr) -> bool:
        return isinstance(power.base, sp.sin) and power.exp.is_Integer and power.exp > 1

    return sp.expand(
        flat.replace(
            lambda x: isinstance(x, sp.Pow) and changed(x),
            lambda x: (1 - sp.cos(x.base.args[0]) ** 2) ** (x.exp // 2) * x.base ** (x.exp % 2),
        )
    )


def _collected(flat: Expr) -> Iterator[Expr]:
    """The terms by what moves with sines and cosines, each with its factor in front."""
    terms = sp.Add.make_args(flat)
    if len(terms) < 2:
        return
    by_wave: dict[Expr, list[Expr]] = {}
    for term in terms:
        waves = [x for x in sp.Mul.make_args(term) if x.has(sp.sin, sp.cos)]
        by_wave.setdefault(sp.Mul(*waves), []).append(term / sp.Mul(*waves))
    parts = [wave * _factored(sp.Add(*found)) for wave, found in by_wave.items()]
    yield sp.Add(*parts)
    yield _in_front(sp.Add(*parts))
    yield _shared(list(terms))


def _factored(e: Expr) -> Expr:
    """A sum without sines and cosines: as a product, or with what some terms share in front."""
    if not e.is_Add:
        return e
    return min((e, sp.factor(e), _shared(list(e.args))), key=size)


def _in_front(e: Expr) -> Expr:
    """A sum with the factors that all of its terms share in front."""
    return sp.factor_terms(e) if e.is_Add else e


def _shared(terms: Sequence[Expr]) -> Expr:
    """A sum with, again and again, the factor that most of its terms share in front of them."""
    counts: dict[Expr, int] = {}
    for term in terms:
        for factor in _factors(term):
            counts[factor] = counts.get(factor, 0) + 1
    best = max(
        sorted((f for f in counts if counts[f] > 1), key=sp.default_sort_key),
        key=lambda f: counts[f] * size(f),
        default=None,
    )
    if best is None:
        return sp.Add(*terms)
    inside = [term / best for term in terms if best in _factors(term)]
    outside = [term for term in terms if best not in _factors(term)]
    product = _in_front(sp.Mul(best, _shared(inside)))
    return product + (_shared(outside) if outside else 0)


def _factors(term: Expr) -> list[Expr]:
    """Powers of symbols and functions with whole exponents, as single factors: m², m."""
    found: list[Expr] = []
    for factor in sp.Mul.make_args(term):
        base, power = factor.as_base_exp()
        if base.is_Number:
            continue
        if power.is_Integer and power > 1:
            found += [base**n for n in range(1, int(power) + 1)]
        else:
            found.append(factor)
    return found
