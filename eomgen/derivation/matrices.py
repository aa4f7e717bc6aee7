"""The derived equations as SymPy matrices over the names of a scene."""

from dataclasses import dataclass

import sympy as sp

from eomgen.derivation.definitions import is_turn, written_out
from eomgen.derivation.handout.closed import Equations
from eomgen.derivation.projected.derive import ProjectedEquations
from eomgen.derivation.steps import Definition
from eomgen.derivation.symbols import Expr
from eomgen.derivation.terms import Terms
from eomgen.language.formula import Formula, written


@dataclass(frozen=True)
class Matrices(Terms):
    """M v̇ + V + G = F, and v̇.

    q, v, a      symbols of coordinates, velocities and accelerations v̇
    definitions  the solution in order: each symbol over those before it, in the end all of `a`
    formulas     symbols that stand for formulas of the scene with functions in them, written out
    """

    q: tuple[Expr, ...]
    v: tuple[Expr, ...]
    a: tuple[Expr, ...]
    definitions: tuple[Definition, ...]
    formulas: dict[Expr, str]


def of_pins(equations: Equations) -> Matrices:
    """The matrices of the handout's derivation, with symmetric M."""
    s, rows = equations.symbols, equations.symmetric
    still = dict.fromkeys(s.tau, sp.S.Zero)
    poses = [*_poses(equations), *equations.free_bodies.efforts.items()]
    solved = [(symbol, value.xreplace(still)) for symbol, value in equations.solution.definitions]
    whole = rows.each(lambda m: written_out(m, poses)).whole
    return Matrices(*whole, s.q, s.v, s.a, (*poses, *solved), _formulas(s.formulas))


def _poses(equations: Equations) -> list[Definition]:
    """Poses and velocities of the bodies over q and v; the root of a floating tree has its own."""
    s, k = equations.symbols, equations.kinematics
    pairs = [
        *zip(s.angle, k.angle, strict=True),
        *zip(s.omega, k.omega, strict=True),
        *((a, b) for own, found in zip(zip(s.x, s.y, strict=True), k.position, strict=True)
          for a, b in zip(own, found, strict=True)),
        *((a, b) for own, found in zip(zip(s.xd, s.yd, strict=True), k.velocity, strict=True)
          for a, b in zip(own, found, strict=True)),
    ]  # fmt: skip
    return [(symbol, value) for symbol, value in pairs if symbol != value]


def of_projected(equations: ProjectedEquations) -> Matrices:
    """The matrices of the derivation by projected constraints, over entries of rotations."""
    s, found = equations.symbols, equations.balance
    definitions = projected_definitions(equations)
    motion = [pair for pair in definitions[: equations.motion_definitions] if not is_turn(pair[0])]
    given = _given(equations)
    whole = found.each(lambda m: written_out(m.xreplace(given), motion)).whole
    return Matrices(*whole, s.q, s.v, s.a, definitions, _formulas(s.formulas))


def over_coordinates(found: Matrices) -> Matrices:
    """The same over coordinates: entries of rotations by what they stand for."""
    turns = [pair for pair in found.definitions if is_turn(pair[0])]
    return found.each(lambda e: written_out(e, turns))


def projected_definitions(equations: ProjectedEquations) -> tuple[Definition, ...]:
    """Its solution in order."""
    given, found = _given(equations), equations.solution.definitions
    return tuple((symbol, value.xreplace(given)) for symbol, value in found.items())


def _given(equations: ProjectedEquations) -> dict[Expr, Expr]:
    """Numbers of the scene, and no further generalised forces."""
    s = equations.symbols
    numbers = {symbol: sp.Float(float(x)) for x, symbol in s.numbers.items()}
    return {**numbers, **dict.fromkeys(s.tau, sp.S.Zero)}


def _formulas(symbols: dict[Formula, Expr]) -> dict[Expr, str]:
    return {symbol: written(formula) for formula, symbol in symbols.items()}
