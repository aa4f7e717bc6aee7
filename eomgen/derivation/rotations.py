"""Rotations over symbols, and derivatives by the time.

Rotations take vectors of a body's axes to its parent's.
"""

from collections.abc import Mapping, Sequence

import sympy as sp

from eomgen.derivation.symbols import Expr


def rate(e: Expr, rates: Mapping[Expr, Expr]) -> Expr:
    """Time derivative of an expression or vector; symbols without a rate are constant. A sum that a
    function depends on stays one: cos(θ + φ) gives -(θ̇ + φ̇) sin(θ + φ).
    """
    if isinstance(e, sp.MatrixBase):
        return e.applyfunc(lambda x: rate(x, rates))
    if not rates.keys() & e.free_symbols:
        return sp.S.Zero
    if e.is_Symbol:
        return rates[e]
    if e.is_Add:
        return sp.Add(*(rate(x, rates) for x in e.args))
    if e.is_Mul:
        factors = list(e.args)
        terms = [(i, rate(x, rates)) for i, x in enumerate(factors)]
        products = (sp.Mul(*factors[:i], x, *factors[i + 1 :]) for i, x in terms if x != 0)
        return sp.Add(*products)
    if isinstance(e, sp.Function) and len(e.args) == 1:
        return e.fdiff() * rate(e.args[0], rates)
    moving = sorted((s for s in e.free_symbols if s in rates), key=str)
    return sp.Add(*(sp.diff(e, s) * rates[s] for s in moving))


def quaternion_rates(q: Sequence[Expr], spin: Sequence[Expr]) -> tuple[Expr, ...]:
    """½ q ∘ ω of w, x, y, z, with ω in the rotated axes."""
    w, x, y, z = q
    a, b, c = spin
    half = sp.Rational(1, 2)
    return (
        -half * (x * a + y * b + z * c),
        half * (w * a + y * c - z * b),
        half * (w * b + z * a - x * c),
        half * (w * c + x * b - y * a),
    )


def quaternion_scale(q: Sequence[Expr]) -> Expr:
    """2/|q|², by which a quaternion of any length gives a rotation; it has no rate."""
    return 2 / sum(x**2 for x in q)


def about(axis: Expr, angle: Expr) -> Expr:
    """The rotation about a unit vector: n nᵀ + cos (1 - n nᵀ) + sin [n]x.

    1 - n_x² is n_y² + n_z², of which nothing cancels where n is nearly x.
    """
    along = axis * axis.T
    x, y, z = (along[i, i] for i in range(3))
    across = sp.diag(y + z, x + z, x + y) + sp.diag(x, y, z) - along
    return along + sp.cos(angle) * across + sp.sin(angle) * hat(axis)


def hat(a: Sequence[Expr]) -> Expr:
    """The matrix of a x."""
    x, y, z = a
    return sp.Matrix([[0, -z, y], [z, 0, -x], [-y, x, 0]])


def of_quaternion(q: Sequence[Expr], k: Expr) -> Expr:
    """The rotation of w, x, y, z with k = 2/|q|²: 1 + k (w [v]x + [v]x²), whatever its length."""
    w, x, y, z = q
    return sp.Matrix(
        [
            [1 - k * (y**2 + z**2), k * (x * y - w * z), k * (x * z + w * y)],
            [k * (x * y + w * z), 1 - k * (x**2 + z**2), k * (y * z - w * x)],
            [k * (x * z - w * y), k * (y * z + w * x), 1 - k * (x**2 + y**2)],
        ]
    )
