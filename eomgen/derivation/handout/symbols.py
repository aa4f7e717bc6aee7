"""The symbols of the handout's derivation, and vectors in the plane."""

from dataclasses import dataclass
from typing import Any

import sympy as sp

from eomgen.derivation.symbols import Expr, Symbols, make_symbols, real
from eomgen.model.model import Model

Vec = tuple[Expr, Expr]


@dataclass(frozen=True)
class BodySymbols(Symbols):
    """Symbols of a model of pins and free bodies in the plane, one list each over the bodies.

    `x`, `y`, `angle` are the pose of the centre of mass in world axes, `xd`, `yd`, `omega` its
    velocity, `xdd`, `ydd`, `alpha` its acceleration. `force` holds the joint force of the body's
    own joint, acting on its parent (0 if free).
    """

    mass: tuple[Expr, ...]
    inertia: tuple[Expr, ...]
    x: tuple[Expr, ...]
    y: tuple[Expr, ...]
    angle: tuple[Expr, ...]
    xd: tuple[Expr, ...]
    yd: tuple[Expr, ...]
    omega: tuple[Expr, ...]
    xdd: tuple[Expr, ...]
    ydd: tuple[Expr, ...]
    alpha: tuple[Expr, ...]
    force: tuple[Vec, ...]


def body_symbols(model: Model) -> BodySymbols:
    """Symbols for a model. Names of scenes contain no two underscores, so these are different from
    all of them.
    """
    symbols = make_symbols(model)

    words = ("x", "y", "angle", "xd", "yd", "omega", "xdd", "ydd", "alpha")
    own: dict[str, Any] = {
        word: tuple(real(f"{word}__{body.name}") for body in model.bodies) for word in words
    }
    own["tau"] = tuple(real(f"tau__{c.name}") for c in model.coordinates)
    joints = [body.joint.name for body in model.bodies]
    return BodySymbols(
        **{**vars(symbols), **own},
        mass=tuple(symbols.value(body.mass) for body in model.bodies),
        inertia=tuple(symbols.value(body.moment) for body in model.bodies),
        force=tuple((real(f"fx__{joint}"), real(f"fy__{joint}")) for joint in joints),
    )


def rotate(vector: Vec, angle: Expr) -> Vec:
    """A vector of body axes in world axes."""
    c, s = sp.cos(angle), sp.sin(angle)
    return (vector[0] * c - vector[1] * s, vector[0] * s + vector[1] * c)


def cross(r: Vec, f: Vec) -> Expr:
    """z component of r × f."""
    return r[0] * f[1] - r[1] * f[0]


def add(u: Vec, v: Vec) -> Vec:
    """Sum of two vectors."""
    return (u[0] + v[0], u[1] + v[1])


def scale(k: Expr, v: Vec) -> Vec:
    """A vector times a scalar."""
    return (k * v[0], k * v[1])


def over_bodies(model: Model, symbols: BodySymbols) -> dict[Expr, Expr]:
    """Coordinates, velocities and accelerations by those of the bodies: φ = ψ_B - ψ_A.

    Substituted into an expression (`xreplace`), sums along the tree such as θ + φ become one symbol
    of a body, which keeps expressions short.
    """
    result: dict[Expr, Expr] = {}
    for coordinates, x, y, angle in _orders(symbols):
        for k, (body, last) in enumerate(zip(model.bodies, model.angle_index, strict=True)):
            base = angle[body.parent] if body.parent >= 0 else sp.Integer(0)
            result[coordinates[last]] = angle[k] - base
            if len(body.positions) > 1:
                result[coordinates[last - 2]], result[coordinates[last - 1]] = x[k], y[k]
    return result


def over_coordinates(model: Model, symbols: BodySymbols) -> dict[Expr, Expr]:
    """The inverse: the bodies' angles and angular rates as sums of coordinates."""
    result: dict[Expr, Expr] = {}
    for coordinates, x, y, angle in _orders(symbols):
        for k, (body, last) in enumerate(zip(model.bodies, model.angle_index, strict=True)):
            base = result[angle[body.parent]] if body.parent >= 0 else sp.Integer(0)
            result[angle[k]] = base + coordinates[last]
            if len(body.positions) > 1:
                result[x[k]], result[y[k]] = coordinates[last - 2], coordinates[last - 1]
    return result


def _orders(symbols: BodySymbols) -> tuple[tuple[tuple[Expr, ...], ...], ...]:
    """Coordinates with the bodies' x, y and angle: pose, first and second derivative."""
    return (
        (symbols.q, symbols.x, symbols.y, symbols.angle),
        (symbols.v, symbols.xd, symbols.yd, symbols.omega),
        (symbols.a, symbols.xdd, symbols.ydd, symbols.alpha),
    )
