"""Expressions simplified by inexpensive rewriting, in normal forms in which equal terms cancel."""

from collections.abc import Collection, Iterator, Mapping
from typing import Any

import sympy as sp

from eomgen.derivation.symbols import Expr

MOST_TERMS = 400
"""Largest number of terms of an expanded expression that is rewritten."""
MOST_FACTORED = 24
"""Largest number of terms of a numerator that is factored."""


def tidy(expression: Expr) -> Expr:
    """Expand, and write products of sines and cosines as functions of sums of angles.

    In this normal form terms that are equal by a trigonometric identity are the same term, so that
    they cancel without a search for simplifications.
    """
    expanded = sp.expand(expression)
    return sp.Add(*(_linear(term) for term in sp.Add.make_args(expanded)))


def _linear(term: Expr) -> Expr:
    """A product with at most one sine or cosine left in each of its terms."""
    plain, waves = [], []
    for factor in sp.Mul.make_args(term):
        base, power = factor.as_base_exp()
        if isinstance(base, sp.sin | sp.cos) and power.is_Integer and power > 0:
            waves += [base] * int(power)
        else:
            plain.append(factor)
    if len(waves) < 2:
        return term
    sums = waves[0]
    for wave in waves[1:]:
        sums = sp.Add(*(_product(part, wave) for part in sp.Add.make_args(sums)))
    return sp.expand(sp.Mul(*plain) * sums)


def _product(part: Expr, wave: Expr) -> Expr:
    """k · wave₁ · wave₂ by the sum and difference of their angles."""
    k, first = part.as_coeff_Mul()
    if not isinstance(first, sp.sin | sp.cos):
        return part * wave
    a, b = first.args[0], wave.args[0]
    match first, wave:
        case sp.sin(), sp.sin():
            pair = sp.cos(a - b) - sp.cos(a + b)
        case sp.cos(), sp.cos():
            pair = sp.cos(a - b) + sp.cos(a + b)
        case sp.sin(), sp.cos():
            pair = sp.sin(a + b) + sp.sin(a - b)
        case _:
            pair = sp.sin(a + b) - sp.sin(a - b)
    return k / 2 * pair


def canonical(expression: Expr, even: Any = sp.cos) -> Expr:
    """The expanded form with cos² written as 1 - sin², so that terms which are equal cancel; with
    sin for `even` the reverse.
    """
    expanded = sp.expand(expression)
    if not any(p.base.func is even and p.exp.is_Integer for p in expanded.atoms(sp.Pow)):
        return expanded
    return sp.expand(sp.Add(*(_without(t, even) for t in sp.Add.make_args(expanded))))


def _without(term: Expr, even: Any) -> Expr:
    """A term without even powers of cos, or of sin."""
    other, factors = sp.sin if even is sp.cos else sp.cos, []
    for factor in sp.Mul.make_args(term):
        base, power = factor.as_base_exp()
        if isinstance(base, even) and power.is_Integer and power > 1:
            half, odd = divmod(int(power), 2)
            factors += [(1 - other(base.args[0]) ** 2) ** half, base**odd]
        else:
            factors.append(factor)
    return sp.Mul(*factors)


def gathered(
    expression: Expr,
    fixed: Collection[Expr],
    sums: Mapping[Expr, Expr] | None = None,
    *,
    slack: float = 1.0,
) -> Expr:
    """A sum with one term for each product of variables, its coefficient in parameters factored.

    fixed  symbols that depend on parameters alone
    sums   symbols for sums of parameters, substituted before factoring and restored after it
    slack  the result may be this many times as long as the shortest form found
    """
    if expression.is_Atom:
        return expression
    flats = [canonical(expression)]
    if any(wave.args[0].is_Add for wave in expression.atoms(sp.sin, sp.cos)):
        flats.append(tidy(expression))  # products of sines and cosines of sums such as θ + φ
    flat = min(flats, key=sp.count_ops)
    if flat == 0 or len(sp.Add.make_args(flat)) > MOST_TERMS:
        return flat if flat == 0 else expression
    whole = by_variables(flat, fixed, sums)
    least = min((whole, flat, expression), key=sp.count_ops)
    return whole if sp.count_ops(whole) <= slack * sp.count_ops(least) else least


def by_variables(
    flat: Expr, fixed: Collection[Expr], sums: Mapping[Expr, Expr] | None = None
) -> Expr:
    """An expanded sum with one term for each product of variables, as in `gathered`. Terms that
    are equal cancel, such as those of the weight of a tree that floats.
    """
    sums = sums or {}
    still = {*fixed, *sums}
    coefficients: dict[Expr, Expr] = {}
    for term in sp.Add.make_args(flat):
        moving = sp.Mul(*(f for f in sp.Mul.make_args(term) if not f.free_symbols <= still))
        coefficients[moving] = coefficients.get(moving, sp.Integer(0)) + term / moving
    coefficients = _with_cosines(coefficients)
    used = {s: e for s, e in sums.items() if any(c.has(s) for c in coefficients.values())}
    names = {total: symbol for symbol, total in used.items()}
    parts = (
        _factored(c.xreplace(used)).xreplace(names) * moving for moving, c in coefficients.items()
    )
    return sp.Add(*parts)


def _with_cosines(coefficients: dict[Expr, Expr]) -> dict[Expr, Expr]:
    """c w - c w sin² as c w cos²."""
    found = dict(coefficients)
    for moving in coefficients:
        for factor in sp.Mul.make_args(moving):
            base, power = factor.as_base_exp()
            if not (isinstance(base, sp.sin) and power.is_Integer and power > 1):
                continue
            low = moving / base**2
            if {low, moving} <= {*found} and sp.expand(found[low] + found[moving]) == 0:
                found[low * sp.cos(base.args[0]) ** 2] = found.pop(low)
                del found[moving]
                break
    return found


def nested(expression: Expr) -> Expr:
    """A sum with the sine or cosine that most terms share factored out, if that is shorter."""
    return min((expression, _nested(expression)), key=sp.count_ops)


def _nested(expression: Expr) -> Expr:
    terms = sp.Add.make_args(expression)
    counts: dict[Expr, int] = {}
    for term in terms:
        for factor in sp.Mul.make_args(term):
            base = factor.as_base_exp()[0]
            if isinstance(base, sp.sin | sp.cos) and factor.as_base_exp()[1].is_positive:
                counts[base] = counts.get(base, 0) + 1
    wave = max(sorted(counts, key=sp.default_sort_key), key=lambda w: counts[w], default=None)
    if wave is None or counts[wave] < 2:
        return expression
    parts: dict[bool, list[Expr]] = {True: [], False: []}
    for term in terms:
        inside = any(f.as_base_exp()[0] == wave for f in sp.Mul.make_args(term))
        parts[inside].append(term / wave if inside else term)
    return wave * _nested(sp.Add(*parts[True])) + _nested(sp.Add(*parts[False]))


def _factored(coefficient: Expr) -> Expr:
    """A coefficient over one denominator, with its numerator factored if it is short."""
    if coefficient.is_Atom:
        return coefficient
    top, bottom = sp.fraction(sp.together(coefficient))
    top = sp.expand(top)
    if len(sp.Add.make_args(top)) > MOST_FACTORED:
        return top / bottom
    whole = sp.factor(top / bottom)
    if bottom.is_Number and sp.fraction(whole)[0].is_Add:
        return sp.expand(coefficient)  # m/3 + M, no (m + 3 M)/3
    return whole


def sum_of_squares(
    total: Expr, fixed: Collection[Expr], sums: Mapping[Expr, Expr], longest: int
) -> Expr:
    """A pivot, given as a sum of weighted squares, in a short form that is manifestly positive.

    A + B sin² + C cos² of one angle has several shorter forms; the first that is a sum of positive
    terms is chosen. If there is none, or the pivot is long, the sum of squares is returned.
    """
    if sp.count_ops(total) > longest:
        return total
    written = canonical(total.xreplace(dict(sums)))
    for form in _over_one_angle(written, {e: s for s, e in sums.items()}):
        if is_sum_of_positive_terms(form):
            return form
    short = gathered(total, fixed, sums)
    return short if is_sum_of_positive_terms(short) else total


def _over_one_angle(written: Expr, names: Mapping[Expr, Expr]) -> Iterator[Expr]:
    """A + B sin² + C cos² of one angle in its shorter forms; `names` has symbols for sums."""
    angles = {wave.args[0] for wave in written.atoms(sp.sin, sp.cos)}
    if len(angles) != 1:
        return
    sine = sp.sin(*angles)
    constant, slope = written.coeff(sine, 0), written.coeff(sine, 2)
    if sp.expand(constant + slope * sine**2 - written) != 0:
        return

    def tight(e: Expr) -> Expr:
        return _factored(e).xreplace(names)

    yield _joined(tight(constant), tight(slope), sine**2)
    cosine, both = sp.cos(*angles), tight(constant + slope)
    yield _joined(both, tight(-slope), cosine**2)
    yield tight(constant) * cosine**2 + both * sine**2


def _joined(constant: Expr, slope: Expr, square: Expr) -> Expr:
    """constant + slope square, over one denominator if they share one."""
    (top, bottom), (rise, under) = sp.fraction(constant), sp.fraction(slope)
    if bottom == under and not bottom.is_Number:
        return (top + rise * square) / bottom
    return constant + slope * square


def is_sum_of_positive_terms(expression: Expr) -> bool:
    """Whether an expression is built of positive symbols and even powers by +, *, / alone."""
    if expression.is_Add or expression.is_Mul:
        return all(is_sum_of_positive_terms(part) for part in expression.args)
    if expression.is_Pow:
        base, power = expression.args
        if not power.is_Integer:
            return False
        return bool(power % 2 == 0 and base.is_real) or is_sum_of_positive_terms(base)
    return bool(expression.is_positive)
