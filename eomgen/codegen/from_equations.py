"""Systems of planar pendulum trees by the symbolic route, in any form of the state."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import sympy as sp

from eomgen.codegen.from_recursion import output
from eomgen.codegen.recording import Recording
from eomgen.codegen.system import OutputNodes, System, names_of_inputs, output_shape, recorded
from eomgen.derivation.handout.closed import Equations, conditions, written_out_forces
from eomgen.derivation.handout.forms import StateForm, state_form
from eomgen.derivation.handout.symbols import Vec, rotate
from eomgen.derivation.joint_loads import TIME as TIME_SYMBOL
from eomgen.derivation.joint_loads import mechanism_over
from eomgen.language.formula import evaluate
from eomgen.model.bodies import Point
from eomgen.program.differentiate import jacobian as slopes_of
from eomgen.program.lower import Lowering
from eomgen.program.program import Check
from eomgen.program.scalars import TapeScalars
from eomgen.program.tape import TIME, Node, Stage, Tape
from eomgen.scene.effects.base import JointLoad
from eomgen.tables.outputs import OUTPUTS


def from_equations(equations: Equations, *, jacobian: bool = True) -> System:
    """The system of the equations, with or without the Jacobian of the derivative."""
    model, symbols, form = equations.model, equations.symbols, state_form(equations)
    tape = Tape()
    made = _lowerings(equations, form, tape)
    unforced, starting = made.unforced, made.starting

    def rows(lowering: Lowering, expressions: Iterable[Any]) -> list[Node]:
        return [lowering.lower(e.xreplace(form.replaced)) for e in expressions]

    for pivot in equations.solution.pivots:  # first, so that each gets its own variable name
        unforced.lower(pivot)
    rates = rows(unforced, form.rates)
    by = {
        "jacobian": list(made.states.values()),
        "input_jacobian": list(made.inputs.values()),
        "parameter_jacobian": list(made.parameters.values()),
    }
    nodes: OutputNodes = {
        "initial_state": ((len(form.states),), [starting.lower(e) for e in form.initial]),
        "derivative": ((len(rates),), rates),
    }
    recipes = _recipes(equations)
    extra = {
        "forward_dynamics": names_of_inputs(made.tau.values()),
        "inverse_dynamics": names_of_inputs(made.vd.values()),
    }
    lowerings = {"forward_dynamics": made.forced, "inverse_dynamics": made.inverse}
    for name in (*["jacobian"] * jacobian, *model.outputs):
        if name in by:
            slopes = slopes_of(rates, by[name])
            nodes[name] = ((len(rates), len(by[name])), [node for row in slopes for node in row])
        elif name == "point_jacobians" and model.form == "velocity":
            slopes = slopes_of(
                rows(unforced, recipes["point_velocities"]), [made.states[s] for s in symbols.v]
            )
            nodes[name] = (output_shape(name, model), [node for row in slopes for node in row])
        elif name not in recipes and model.form == "velocity":
            entries = output(Recording(model, "aba", tape=tape), name, extra)
            nodes[name] = (output_shape(name, model), entries)
        elif name in recipes and (model.form == "velocity" or OUTPUTS[name].forms):
            entries = rows(lowerings.get(name, unforced), recipes[name])
            nodes[name] = (output_shape(name, model), entries)
    checks = [
        Check(what, starting.lower(value).index, may_vanish)
        for what, value, may_vanish in conditions(equations)
    ]
    program = recorded(tape, nodes, checks)
    return System(model, "closed", tuple(form.states), program, extra, frozenset(), ())


@dataclass(frozen=True)
class _Lowerings:
    """The inputs of a program, and what puts expressions on its tape: without generalised forces,
    with them, with accelerations in place of them, and at the start.
    """

    parameters: Mapping[str, Node]
    states: Mapping[Any, Node]
    inputs: Mapping[Any, Node]
    tau: Mapping[Any, Node]
    vd: Mapping[Any, Node]
    unforced: Lowering
    forced: Lowering
    inverse: Lowering
    starting: Lowering


def _lowerings(equations: Equations, form: StateForm, tape: Tape) -> _Lowerings:
    model, symbols = equations.model, equations.symbols
    named = {name: tape.input(name, Stage.PARAMETERS) for name in symbols.parameters}
    parameters = {symbol: named[name] for name, symbol in symbols.parameters.items()}
    for formula, symbol in symbols.formulas.items():
        parameters[symbol] = evaluate(formula, named, TapeScalars(tape))
    states = {
        symbol: tape.input(s.name, Stage.POSITIONS if s.position else Stage.VELOCITIES)
        for symbol, s in zip(form.symbols, form.states, strict=True)
    }
    inputs = {s: tape.input(n, Stage.INPUTS) for n, s in symbols.inputs.items()}
    tau = {s: tape.input(s.name, Stage.INPUTS) for s in symbols.tau}
    vd = {s: tape.input(s.name, Stage.INPUTS) for s in symbols.a}
    forces = written_out_forces(equations) if "joint_forces" in model.outputs else ()
    efforts = equations.free_bodies.efforts
    definitions = (*efforts.items(), *equations.solution.definitions, *forces)
    defined = {
        s: e.xreplace(form.replaced) for s, e in {**dict(definitions), **form.defined}.items()
    }
    given = parameters | states | inputs | {TIME_SYMBOL: tape.input(TIME, Stage.INPUTS)}
    zero = tape.constant(0.0)
    start = {
        s: tape.constant(value)
        for s, value in zip(
            (*symbols.q, *symbols.v), (*model.initial_q, *model.initial_v), strict=True
        )
    }
    return _Lowerings(
        named,
        states,
        inputs,
        tau,
        vd,
        unforced=Lowering(tape, given | dict.fromkeys(tau, zero), defined),
        forced=Lowering(tape, given | tau, defined),
        inverse=Lowering(tape, given | vd, defined),
        starting=Lowering(tape, parameters | start, {}),
    )


def _recipes(equations: Equations) -> dict[str, list[Any]]:
    """The entries of each output as expressions in the symbols of bodies and coordinates."""
    s, symmetric, bodies = equations.symbols, equations.symmetric, equations.model.bodies
    balance = symmetric.M * sp.Matrix(s.a) + symmetric.V + symmetric.G - symmetric.F
    jointed = [k for k, body in enumerate(bodies) if body.joint.holds]
    wrenches = [(*s.force[k], -equations.free_bodies.motor[k]) for k in jointed]
    points = [_point(equations, point) for point in equations.model.points]
    each = range(len(bodies))
    return {
        "forward_dynamics": list(s.a),
        "inverse_dynamics": list(balance),
        "mass_matrix": list(symmetric.M),
        "velocity_force": list(symmetric.V),
        "gravity_force": list(symmetric.G),
        "bias_force": list(symmetric.V + symmetric.G),
        "applied_force": list(symmetric.F),
        "kinetic_energy": [_kinetic_energy(equations)],
        "potential_energy": [equations.free_bodies.potential_energy],
        "effect_powers": _powers(equations),
        "momentum": _momentum(equations),
        "centre_of_mass": _centre_of_mass(equations),
        "joint_forces": [component for wrench in wrenches for component in wrench],
        "body_poses": [z for k in each for z in (s.x[k], s.y[k], s.angle[k])],
        "body_velocities": [z for k in each for z in (s.xd[k], s.yd[k], s.omega[k])],
        "point_positions": [z for position, _ in points for z in position],
        "point_velocities": [z for _, velocity in points for z in velocity],
    }


def _point(equations: Equations, point: Point) -> tuple[Vec, Vec]:
    """World position and velocity of a named point."""
    s, k = equations.symbols, point.body
    rx, ry = rotate((s.value(point.at[0]), s.value(point.at[1])), s.angle[k])
    return (s.x[k] + rx, s.y[k] + ry), (s.xd[k] - s.omega[k] * ry, s.yd[k] + s.omega[k] * rx)


def _powers(equations: Equations) -> list[Any]:
    """The power of each effect: Σ f · v of its forces plus Σ τ ω of its torques at joints."""
    s, model = equations.symbols, equations.model
    mechanism: Any = mechanism_over(model, s, s.y)
    index = {body.name: k for k, body in enumerate(model.bodies)}
    joint = {body.joint.name: k for k, body in enumerate(model.bodies)}
    powers = []
    for effect in model.effects:
        power = sp.Integer(0)
        for load in effect.loads(mechanism):
            if isinstance(load, JointLoad):
                k = joint[load.joint]
                above = model.bodies[k].parent
                power += load.force * (s.omega[k] - (s.omega[above] if above >= 0 else 0))
            else:
                k = index[load.body]
                rx, ry = rotate((load.at[0], load.at[1]), s.angle[k])
                power += load.force[0] * (s.xd[k] - s.omega[k] * ry)
                power += load.force[1] * (s.yd[k] + s.omega[k] * rx)
        powers.append(power)
    return powers


def _centre_of_mass(equations: Equations) -> list[Any]:
    """Σ m x / Σ m."""
    s = equations.symbols
    return [
        sp.Add(*(m * z for m, z in zip(s.mass, component, strict=True))) / sp.Add(*s.mass)
        for component in (s.x, s.y)
    ]


def _kinetic_energy(equations: Equations) -> Any:
    """Σ ½ m |ẋ|² + ½ I ω²."""
    s = equations.symbols
    return sp.Add(
        *(m * (xd**2 + yd**2) / 2 for m, xd, yd in zip(s.mass, s.xd, s.yd, strict=True)),
        *(i * w**2 / 2 for i, w in zip(s.inertia, s.omega, strict=True)),
    )


def _momentum(equations: Equations) -> list[Any]:
    """Σ m ẋ, Σ m ẏ, and Σ m (x ẏ - y ẋ) + I ω about the world's origin."""
    s = equations.symbols
    bodies = list(zip(s.mass, s.inertia, s.x, s.y, s.xd, s.yd, s.omega, strict=True))
    return [
        sp.Add(*(m * xd for m, _, _, _, xd, _, _ in bodies)),
        sp.Add(*(m * yd for m, _, _, _, _, yd, _ in bodies)),
        sp.Add(*(m * (x * yd - y * xd) + i * w for m, i, x, y, xd, yd, w in bodies)),
    ]
