"""Formulas as a person would write them: the shortest of a few forms.

The forms are cheap rewritings, not a search: the sum with sin² + cos² = 1, the same with products
of sines and cosines as functions of sums of angles, and each with what its terms share in front.
"""

from collections.abc import Iterator, Sequence
from functools import lru_cache

import sympy as sp

from eomgen.derivation.projected.simplify import canonical
from eomgen.derivation.symbols import Expr, tidy

LONGEST = 90
"""Operations of an expression up to which it is simplified."""
MOST_FACTORED = 8
"""Terms of a sum up to which it is factored as a polynomial."""
MOST_SOLVED = 64
"""The size of equations up to which their solution is written in one line for each unknown."""
MOST_TERMS = 24
"""Terms of an expanded sum up to which it is collected."""


def simplified(e: Expr) -> Expr:
    """The shortest form found, of a scalar or of each entry of a matrix."""
    if isinstance(e, sp.MatrixBase):
        return e.applyfunc(simplified)
    if not isinstance(e, sp.Expr) or e.is_Matrix or e.is_Atom or size(e) > LONGEST:
        return e
    if e.has(sp.Piecewise) or isinstance(e, sp.Function):
        return e
    forms = (_with_signs(form) for form in _forms(e))
    return min(forms, key=lambda form: (size(form), _minus(form), len(sp.Add.make_args(form))))


def _minus(e: Expr) -> int:
    """The minus signs between terms."""
    return sum(bool(x.could_extract_minus_sign()) for add in e.atoms(sp.Add) for x in add.args)


def _with_signs(e: Expr) -> Expr:
    """Minus signs in front of products instead of in all terms of a factor, and the reverse."""
    return e.replace(lambda x: x.is_Mul and any(f.is_Add for f in x.args), _signed)


def _signed(product: Expr) -> Expr:
    factors = []
    minus = product.could_extract_minus_sign() and -1 in product.args
    for x in product.args:
        negative = sum(t.could_extract_minus_sign() for t in x.args) if x.is_Add else 0
        turned = x.is_Add and (negative == len(x.args) or (minus and 2 * negative >= len(x.args)))
        if turned:
            minus = not minus
        factors.append(-x if turned else x)
    plain = [x for x in factors if x != -1]
    return sp.Mul(-1 if minus else 1, *plain)


def tidied(e: Expr) -> Expr:
    """An expression or a matrix simplified where that makes it shorter by a fifth: for equations
    whose terms are to be seen.
    """
    if isinstance(e, sp.MatrixBase):
        return e.applyfunc(tidied)
    found = simplified(e)
    return found if 5 * size(found) <= 4 * size(e) else e


def solved_directly(M: Expr, right: Expr) -> list[Expr] | None:
    """M⁻¹ right for one or two unknowns, simplified; None for more, or if that is long."""
    if M.rows == 1:
        found = [simplified(right[0] / M[0, 0])]
    elif M.rows == 2 and sum(map(size, (*M, *right))) <= MOST_SOLVED:
        (a, b), (c, d) = M.tolist()
        whole = simplified(a * d - b * c)
        p, q = right
        tops = [simplified(d * p - b * q), simplified(a * q - c * p)]
        found = [min((top / whole, simplified(top / whole)), key=size) for top in tops]
    else:
        return None
    return found if sum(map(size, found)) <= MOST_SOLVED else None


def size(e: Expr) -> int:
    """The symbols, numbers and signs of a formula; brackets around sines and cosines, and
    fractions in denominators, are hard to read and count more.
    """
    if e.is_Atom:
        return 1 if not e.is_Rational or e.is_Integer else 2
    if isinstance(e, sp.Pow):
        inside = e.exp.is_negative and e.base.is_Add and any(map(_is_quotient, e.base.args))
        return size(e.base) + (1 if e.exp in (2, -1) else 2) + int(e.base.is_Add) + 3 * inside
    if isinstance(e, sp.Add):
        minus = sum(bool(x.could_extract_minus_sign()) for x in e.args)
        signs = len(e.args) - 1 + (minus if minus < len(e.args) else 0)
        return int(sum(map(size, e.args)) + signs + 2 * sum(map(_holds_wave, e.args)))
    if isinstance(e, sp.Mul):
        sums = any(x.is_Add for x in e.args)
        whole = sum(size(x) + bool(x.is_Add) for x in e.args if x != -1)
        return whole + int(sums and -1 in e.args) + int(_holds_wave(e))
    return 1 + sum(map(size, e.args))


def _is_quotient(term: Expr) -> bool:
    return any(
        x.is_Pow and x.exp.is_negative and not x.base.is_Number for x in sp.Mul.make_args(term)
    )


def _holds_wave(term: Expr) -> bool:
    """Whether a term has a sum with sines or cosines in brackets, which is hard to read."""
    return term.is_Mul and any(x.is_Add and x.has(sp.sin, sp.cos) for x in term.args)


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
    for whole in (over, sp.expand(top)):
        yield sp.Add(*(min(_whole(x), key=size) / under for x in sp.Add.make_args(whole)))


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
    short = canonical(flat)
    yield from _with_cosines(short)
    yield short
    yield _no_even_sines(flat)
    yield tidy(flat)


def _with_cosines(flat: Expr) -> Iterator[Expr]:
    """a + b sin² of one angle as (a + b) sin² + a cos²."""
    angles = {x.args[0] for x in flat.atoms(sp.sin, sp.cos)}
    if len(angles) != 1:
        return
    wave = sp.sin(*angles)
    still, slope = flat.coeff(wave, 0), flat.coeff(wave, 2)
    if slope != 0 and sp.expand(still + slope * wave**2 - flat) == 0 and not still.has(sp.cos):
        yield (
            _factored(sp.expand(still + slope)) * wave**2 + _factored(still) * sp.cos(*angles) ** 2
        )


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


@lru_cache(maxsize=4096)
def _factored(e: Expr) -> Expr:
    """A sum as a product, or with what some of its terms share in front of them."""
    if not e.is_Add:
        return e
    forms = [e, _shared(list(e.args))]
    if len(e.args) <= MOST_FACTORED and not e.has(sp.sin, sp.cos):
        forms.append(sp.factor(e))
    return min(forms, key=size)


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
    product = sp.Mul(best, _factored(sp.Add(*inside)))
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
