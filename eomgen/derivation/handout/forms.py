"""State forms: the numbers that a state vector consists of.

`velocity` is [q, v]. `momentum` and `redundant` are the handout's: position, momentum, angle and
angular momentum of all bodies (1), or of the roots of floating trees, with angle and angular
momentum only for the other bodies, since (21) gives the rest.
"""

from dataclasses import dataclass

import sympy as sp

from eomgen.base.errors import SceneError
from eomgen.derivation.handout.closed import Equations
from eomgen.derivation.symbols import Expr
from eomgen.model.states import State, velocity_states
from eomgen.scene.joints.base import WORLD


@dataclass(frozen=True)
class StateForm:
    """A state vector, what the body symbols are in it, and its time derivative.

    `symbols` stand for the states in order.
    `replaced` is put into expressions before they are lowered (angles, so that differences of
    angles become one coordinate); `defined` is looked up when asked for. `rates` is ẏ over the
    accelerations of the solution, `initial` the state over `q` and `v`.
    """

    states: tuple[State, ...]
    symbols: tuple[Expr, ...]
    replaced: dict[Expr, Expr]
    defined: dict[Expr, Expr]
    rates: tuple[Expr, ...]
    initial: tuple[Expr, ...]


def state_form(equations: Equations) -> StateForm:
    """The form that the model asks for. Raises `SceneError` if the model has no such form."""
    if equations.model.form == "velocity":
        return _velocity_form(equations)
    return _momentum_form(equations, redundant=equations.model.form == "redundant")


def _velocity_form(equations: Equations) -> StateForm:
    symbols = equations.symbols
    turned = equations.kinematics.outward
    return StateForm(
        states=velocity_states(equations.model),
        symbols=(*symbols.q, *symbols.v),
        replaced={angle: turned[angle] for angle in symbols.angle},
        defined={
            **_positions(equations),
            **{omega: turned[omega] for omega in symbols.omega},
        },
        rates=(*symbols.v, *symbols.a),
        initial=(*symbols.q, *symbols.v),
    )


def _positions(equations: Equations) -> dict[Expr, Expr]:
    """Position and velocity of every body by those of its parent: (21) and its derivative."""
    symbols, kinematics = equations.symbols, equations.kinematics
    inward = kinematics.inward
    defined: dict[Expr, Expr] = {}
    model = equations.model
    for k, (body, last) in enumerate(zip(model.bodies, model.angle_index, strict=True)):
        if not body.joint.holds:
            defined |= {symbols.x[k]: symbols.q[last - 2], symbols.y[k]: symbols.q[last - 1]}
            defined |= {symbols.xd[k]: symbols.v[last - 2], symbols.yd[k]: symbols.v[last - 1]}
        else:
            x, y = (e.xreplace(inward) for e in kinematics.position[k])
            xd, yd = (e.xreplace(inward) for e in kinematics.velocity[k])
            defined |= {symbols.x[k]: x, symbols.y[k]: y, symbols.xd[k]: xd, symbols.yd[k]: yd}
    return defined


def _momentum_form(equations: Equations, *, redundant: bool) -> StateForm:
    model, symbols = equations.model, equations.symbols
    inward, outward = equations.kinematics.inward, equations.kinematics.outward
    states: list[State] = []
    own: list[Expr] = []
    rates: list[Expr] = []
    initial: list[Expr] = []
    replaced: dict[Expr, Expr] = {}
    defined = _positions(equations)
    for k, body in enumerate(model.bodies):
        if model.value(body.moment) == 0.0:
            raise SceneError(
                f"form: '{model.form}' needs an angular momentum of body '{body.name}', whose "
                "inertia_com is 0; use form = 'velocity' or give it an inertia"
            )
        m, inertia, name = symbols.mass[k], symbols.inertia[k], body.name
        free = not body.joint.holds
        if free or redundant:
            words = [c.name for c in body.positions[:2]] if free else [f"x_{name}", f"y_{name}"]
            x, y = (sp.Symbol(word, real=True) for word in words)
            px, py = (sp.Symbol(f"P_{name}_{axis}", real=True) for axis in "xy")
            states += [
                State(x.name, "m", f"x of the centre of mass of {name}", True),
                State(y.name, "m", f"y of the centre of mass of {name}", True),
                State(px.name, "kg m/s", f"momentum of {name}, x", False),
                State(py.name, "kg m/s", f"momentum of {name}, y", False),
            ]
            own += [x, y, px, py]
            initial += [symbols.x[k], symbols.y[k], m * symbols.xd[k], m * symbols.yd[k]]
            defined |= {symbols.x[k]: x, symbols.y[k]: y}
            defined |= {symbols.xd[k]: px / m, symbols.yd[k]: py / m}
            rates += [symbols.xd[k], symbols.yd[k], m * symbols.xdd[k], m * symbols.ydd[k]]
        word = body.positions[-1].name if body.parent < 0 else f"angle_{name}"
        angle, spin = sp.Symbol(word, real=True), sp.Symbol(f"L_{name}", real=True)
        states += [
            State(word, "rad", f"angle of {name} from the {WORLD}'s x axis", True),
            State(spin.name, "kg m^2/s", f"angular momentum of {name} about its centre", False),
        ]
        own += [angle, spin]
        initial += [symbols.angle[k].xreplace(outward), inertia * symbols.omega[k]]
        replaced[symbols.angle[k]] = angle
        defined[symbols.omega[k]] = spin / inertia
        rates += [symbols.omega[k], inertia * symbols.alpha[k]]
    _check_names(equations, states)
    # A root's coordinate and its state are the same symbol; other coordinates follow from bodies.
    known = set(own)
    defined |= {s: e for s, e in inward.items() if s not in known}
    defined = {s: e for s, e in defined.items() if s not in known}
    return StateForm(
        tuple(states), tuple(own), replaced, defined, tuple(rates), _over_q(equations, initial)
    )


def _over_q(equations: Equations, expressions: list[Expr]) -> tuple[Expr, ...]:
    """Expressions of body symbols over `q` and `v` alone."""
    outward = equations.kinematics.outward
    positions = _positions(equations)
    result = []
    for expression in expressions:
        for _ in equations.model.bodies:  # one substitution climbs one joint
            expression = expression.xreplace(positions)
        result.append(expression.xreplace(outward))
    return tuple(result)


def _check_names(equations: Equations, states: list[State]) -> None:
    model = equations.model
    taken = {p.name: "a parameter" for p in model.parameters}
    taken |= {i.name: "an input" for i in model.inputs}
    for state in states:
        if state.name in taken:
            raise SceneError(
                f"'{state.name}' is the name of {taken[state.name]} and of a state of "
                f"form '{model.form}'; rename the parameter or input"
            )
        taken[state.name] = "another state"
