"""The state that a form names, and its time derivative written out."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import sympy as sp

from eomgen.derivation.definitions import needed_by
from eomgen.derivation.dots import dotted
from eomgen.derivation.effects import DerivedEffect
from eomgen.derivation.handout.closed import Equations
from eomgen.derivation.handout.forms import state_form
from eomgen.derivation.rotations import quaternion_rates
from eomgen.derivation.steps import Equation, Step
from eomgen.derivation.symbols import Expr, real
from eomgen.model.model import Model

FORMS = {
    "redundant": "The redundant state (1): all that is known of every body, {count} numbers.",
    "momentum": "The state without what (21) gives: {count} numbers. Each further body of a tree "
    "adds its angle and its angular momentum.",
    "velocity": "The state of coordinates q and velocities v: {count} numbers.",
}


QUATERNION = ("_qw", "_qx", "_qy", "_qz", "_wx", "_wy", "_wz")
"""How the names of quaternions and of their angular velocities end."""


BELOW = "; the quantities that the lines use are below"
OWN = ", written in the numbers of this state. The lines on bodies are (4) to (11)."
BEFORE = "; the quantities that the lines use are in the steps before"


@dataclass(frozen=True)
class WrittenForm:
    """A state by its symbols, its derivative, and what that is written with, in order."""

    states: tuple[Expr, ...]
    rates: tuple[Expr, ...]
    definitions: tuple[tuple[Expr, Expr], ...]


def momentum_form(equations: Equations) -> WrittenForm:
    """The handout's states, in the order of (1): Ẏ by (4) to (11), with the joint forces of (38)
    and the closed form (37) in the numbers of this state.
    """
    form = state_form(equations)
    s, bodies = equations.symbols, equations.model.bodies
    given = {**form.replaced, **form.defined}
    accelerations: dict[Expr, Expr] = {}
    lines = equations.free_bodies.equations
    still = dict.fromkeys(s.tau, sp.Integer(0))
    for k in range(len(bodies)):
        (_, fx), (_, fy), (_, torque) = lines[3 * k : 3 * k + 3]
        accelerations |= {
            s.mass[k] * s.xdd[k]: fx,
            s.mass[k] * s.ydd[k]: fy,
            s.inertia[k] * s.alpha[k]: torque,
        }
    rates = tuple(_in_state(accelerations.get(rate, rate), given) for rate in form.rates)
    needed = [
        *((symbol, e.xreplace(still)) for symbol, e in equations.solution.definitions),
        *equations.joint_force,
    ]
    coordinates = {*s.a}
    definitions = [
        (symbol, _in_state(e, given)) for symbol, e in needed if symbol not in coordinates
    ]
    return WrittenForm(form.symbols, rates, needed_by(rates, definitions))


def _in_state(expression: Expr, given: Mapping[Expr, Expr]) -> Expr:
    """An expression over the symbols of a state: what is defined is put in until none is left."""
    while True:
        inner = expression.xreplace(given)
        if inner == expression:
            return inner
        expression = inner


def form_step(
    model: Model, form: str, written: WrittenForm, extra: Iterable[DerivedEffect]
) -> Step:
    """The last step: Y, and Ẏ line by line."""
    states, rates = list(written.states), list(written.rates)
    states += (real(x.name) for x in model.extra)
    rates += (rate for derived in extra for _, rate in derived.rates)
    words = (
        FORMS[form].format(count=len(states))
        + " Its time derivative follows, one line for each number"
    )
    words += BELOW if written.definitions else BEFORE
    words += "." if form == "velocity" else OWN
    named = [rate_symbol(state) for state in states]
    own = {*states}
    plain = [rate if rate in own else symbol for symbol, rate in zip(named, rates, strict=True)]
    equations = [
        Equation(sp.Symbol("Y"), sp.Matrix([states])),
        Equation(sp.Symbol(dotted("Y")), sp.Matrix([plain])),
    ]
    equations += [Equation(s, rate) for s, rate in zip(plain, rates, strict=True) if s != rate]
    equations += [Equation(symbol, e) for symbol, e in written.definitions]
    return Step("form", f"State form {form}: Y and its derivative", words, tuple(equations))


def rate_symbol(state: Expr) -> Expr:
    """The time derivative of a state: its name with one more dot."""
    if state.name.endswith("_dot"):
        return real(state.name.removesuffix("dot") + "ddot")
    if state.name.endswith(QUATERNION):
        return real(f"{state.name}_dot")
    return real(dotted(state.name))


def plain_form(model: Model, accelerations: Sequence[Expr]) -> WrittenForm:
    """[q, v] of any mechanism, its accelerations by the steps before."""
    states: list[Expr] = []
    rates: list[Expr] = []
    for index in model.joint_indices:
        if max(index.v, default=-1) >= len(model.velocities):
            continue
        body = index.body
        pairs = zip(body.positions[: body.plain], body.velocities, strict=False)
        for position, velocity in pairs:
            states.append(real(position.name))
            rates.append(real(velocity.name))
        if not index.quaternion:
            continue
        q = [real(c.name) for c in body.positions[body.plain :]]
        states += q
        rates += quaternion_rates(q, [real(v.name) for v in body.velocities[body.plain :]])
    order = {c.name: i for i, c in enumerate(model.coordinates)}
    both = sorted(zip(states, rates, strict=True), key=lambda pair: order[pair[0].name])
    both += zip((real(c.name) for c in model.velocities), accelerations, strict=True)
    own = {*model.states}
    states, rates = ([pair[i] for pair in both if pair[0].name in own] for i in (0, 1))
    return WrittenForm(tuple(states), tuple(rates), ())
