"""Formulas as a person would write them: the shortest of a few forms.

The forms are cheap rewritings, not a search: the sum with sin² + cos² = 1, the same with products
of sines and cosines as functions of sums of angles, and each with what its terms share in front.
"""

from collections.abc import Iterator, Sequence
from functools import lru_cache, reduce
from typing import Any

import sympy as sp

from eomgen.derivation.rewriting import canonical, tidy
from eomgen.derivation.symbols import Expr

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
    if not isinstance(e, sp.Expr) or e.is_Matrix or e.is_Atom or isinstance(e, sp.Function):
        return e
    return _shortest(e)


@lru_cache(maxsize=4096)
def _shortest(e: Expr) -> Expr:
    if size(e) > LONGEST or e.has(sp.Piecewise):
        return e
    forms = (_with_signs(form) for form in dict.fromkeys(_forms(e)))
    return min(forms, key=lambda form: (size(form), _minus(form), len(sp.Add.make_args(form))))


def _minus(e: Expr) -> int:
    """The minus signs between terms."""
    return sum(bool(x.could_extract_minus_sign()) for add in e.atoms(sp.Add) for x in add.args)


def _with_signs(e: Expr) -> Expr:
    """Minus signs in front of products instead of in all terms of a factor, and the reverse."""
    return e.replace(lambda x: x.is_Mul and any(_sum_of(f) for f in x.args), _signed)


def _sum_of(factor: Expr) -> Any:
    """The sum that is a factor of a product or of its denominator, None for any other."""
    whole = factor.is_Add or (factor.is_Pow and factor.exp == -1 and factor.base.is_Add)
    return factor.as_base_exp()[0] if whole else None


def _signed(product: Expr) -> Expr:
    factors = []
    minus = product.could_extract_minus_sign() and -1 in product.args
    for x in product.args:
        inner = _sum_of(x)
        terms = inner.args if inner is not None else ()
        negative = sum(t.could_extract_minus_sign() for t in terms)
        turned = bool(terms) and (negative == len(terms) or (minus and 2 * negative >= len(terms)))
        if turned:
            minus = not minus
        factors.append(sp.Pow(-inner, x.as_base_exp()[1]) if turned else x)
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
    """M⁻¹ right, simplified, if M consists of blocks of one or two; None if not, or if it is long.

    Rows and columns may be in any order.
    """
    each = range(M.rows)
    blocks = [[i for i in each if M[i, j] != 0 or M[j, i] != 0] for j in each]
    if not all(1 <= len(block) <= 2 for block in blocks):
        return None
    found = [sp.S.Zero] * M.rows
    for j, coupled in enumerate(blocks):
        if len(coupled) == 1:
            found[j] = simplified(right[j] / M[j, j])
        elif j == coupled[0]:
            block = M.extract(coupled, coupled)
            sides = [right[i] for i in coupled]
            if sum(map(size, (*block, *sides))) > MOST_SOLVED:
                return None
            tops, whole = by_cramer(block, sides)
            tops = [simplified(top) for top in tops]
            pairs = [min((top / whole, simplified(top / whole)), key=size) for top in tops]
            found[coupled[0]], found[coupled[1]] = pairs
    return found if sum(map(size, found)) <= MOST_SOLVED else None


def by_cramer(block: Expr, sides: Sequence[Expr]) -> tuple[list[Expr], Expr]:
    """The solution of one or two equations: numerators, and the determinant below them."""
    if block.rows == 1:
        return [sides[0]], block[0, 0]
    (a, b), (c, d) = block.tolist()
    p, q = sides
    return [d * p - b * q, a * q - c * p], simplified(a * d - b * c)


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
    if not _has_quotient(e):
        yield from _whole(e)
        return
    yield e
    top, bottom = sp.fraction(sp.together(e))
    over, under = (min(_whole(x), key=size) for x in (top, bottom))
    if size(over) + size(under) < LONGEST // 4:
        short = sp.cancel(over / under)
        yield short
        (n, first), (m, second) = (x.primitive() for x in sp.fraction(short))
        yield n / m * first / second
    yield over / under
    for whole in dict.fromkeys((over, sp.expand(top))):
        yield sp.Add(*(min(_whole(x), key=size) / under for x in sp.Add.make_args(whole)))


def _whole(e: Expr) -> Iterator[Expr]:
    """Forms of what has no denominator but numbers."""
    yield e
    if not e.has(sp.Add):
        return
    for flat in dict.fromkeys(_flat(e)):
        yield flat
        yield from _collected(flat)


def _has_quotient(e: Expr) -> bool:
    return any(x.exp.could_extract_minus_sign() for x in e.atoms(sp.Pow) if not x.base.is_Number)


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
    yield canonical(flat, sp.sin)
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
    few = 2 < len(e.args) <= MOST_FACTORED
    if few and not e.has(sp.sin, sp.cos) and not _has_lone_symbol(e.args):
        forms.append(sp.factor(e))
    return min(forms, key=size)


def _has_lone_symbol(terms: Sequence[Expr]) -> bool:
    """Whether a term is a symbol, but for a number, that no other has: then no product is equal."""
    lone = [x.as_coeff_Mul()[1] for x in terms]
    return any(
        x.is_Symbol and not any(other.has(x) for other in terms if other is not term)
        for x, term in zip(lone, terms, strict=True)
    )


def _in_front(e: Expr) -> Expr:
    """A sum with the factors that all of its terms share in front."""
    common = _common(sp.Add.make_args(e))
    return e if common == 1 else common * sp.Add(*(x / common for x in e.args))


def _common(terms: Sequence[Expr]) -> Expr:
    """The product of the factors that all terms share; of numbers if they have one denominator."""
    numbers = [term.as_coeff_Mul()[0] for term in terms]
    powers = [dict(x.as_base_exp() for x in sp.Mul.make_args(term)) for term in terms]
    shared = {base for base in powers[0] if all(base in other for other in powers[1:])}
    found = sp.S.One
    if all(x.is_Rational and x.q == numbers[0].q for x in numbers):
        found = reduce(sp.gcd, numbers)
    for base in sorted(shared, key=sp.default_sort_key):
        least = [other[base] for other in powers]
        if not base.is_Number and all(x.is_Rational for x in least):
            found *= base ** min(least)
    return found


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
    inside = [term for term in terms if best in _factors(term)]
    outside = [term for term in terms if best not in _factors(term)]
    common = _common(inside)
    product = sp.Mul(common, _factored(sp.Add(*(term / common for term in inside))))
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
