"""Driven and locked coordinates: their motion is given, and so are the rows that are left."""

from dataclasses import replace

import sympy as sp

from eomgen.derivation.embedding import projected
from eomgen.derivation.matrices import Matrices
from eomgen.derivation.mechanism import NamingMechanism, Notes
from eomgen.derivation.steps import Definition, Equation, Step
from eomgen.derivation.symbolic_scalars import SymbolicScalars
from eomgen.derivation.symbols import real
from eomgen.derivation.terms import Terms
from eomgen.language.formula import names_in
from eomgen.language.rates import with_rates
from eomgen.model.model import Model

PRESCRIBED = (
    "Driven coordinates follow the formulas above, and their rates are the derivatives of these; "
    "locked coordinates are constant. Neither is a state; the forces on them are whatever this "
    "requires."
)
LEFT = (
    "The motion of driven and locked coordinates is known, so that their rows only say which "
    "forces this requires. In the other rows their accelerations are known numbers: what M has in "
    "their columns joins V. This leaves M_r du/dt + V_r + G_r = F_r for the other velocities u."
)


def prescribed_motion(model: Model) -> list[Definition]:
    """Driven coordinates with their rates and accelerations, and locked ones."""
    names = NamingMechanism(model, Notes()).names
    found: list[Definition] = []
    for c in model.prescribed:
        used = {name: names[name] for name in names_in(c.value) if name != "t"}
        x, v, a = with_rates(c.value, used, names["t"], SymbolicScalars())
        found.append((real(c.position.name), x))
        if not c.locked:
            found += [(real(c.velocity.name), v), (real(c.velocity.acceleration), a)]
    return found


def freed(model: Model) -> Model:
    """The model with all its coordinates as states: without drives and locks."""
    effects = tuple(effect for effect in model.effects if not effect.prescribes())
    return replace(model, effects=effects, locked=(), locked_deg=())


def left_free(model: Model, whole: Matrices) -> Matrices:
    """The equations of the velocities that are not prescribed, from those of all of them."""
    given = {c.velocity.name: c for c in model.prescribed}
    still = {real(name): sp.S.Zero for name, c in given.items() if c.locked}
    free = [j for j, v in enumerate(whole.v) if v.name not in given]
    K, kappa = sp.zeros(len(whole.v), len(free)), sp.zeros(len(whole.v), 1)
    for n, j in enumerate(free):
        K[j, n] = 1
    for j, (v, a) in enumerate(zip(whole.v, whole.a, strict=True)):
        if v.name in given and v not in still:
            kappa[j] = a
    tree = Terms(whole.M, *(e.xreplace(still) for e in whole.whole[1:]))
    states = {c.name for c in model.coordinates}
    return Matrices(
        *projected(K, kappa, tree).whole,
        tuple(x for x in whole.q if x.name in states),
        tuple(whole.v[j] for j in free),
        tuple(whole.a[j] for j in free),
        *(whole.definitions, whole.formulas),
    )


def free_step(left: Matrices) -> Step:
    """What is left, as a step."""
    one = len(left.v) == 1
    parts = {x: getattr(left, x) for x in "MVGF"}
    lines = [Equation(sp.Symbol(f"{x}_r"), e[0] if one else e) for x, e in parts.items()]
    return Step("equations", "One equation for each freedom", LEFT, tuple(lines))
