"""The projected-constraints derivation, step by step, like the handout's by `derivation.steps`."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import sympy as sp

from eomgen.derivation.definitions import is_turn, needed_by
from eomgen.derivation.dots import dotted
from eomgen.derivation.projected.constraints import Constraint
from eomgen.derivation.projected.derive import ProjectedEquations
from eomgen.derivation.reading import brief_coordinates, short_name, words_on_names
from eomgen.derivation.rewriting import gathered
from eomgen.derivation.steps import Equation, Pairs, Step
from eomgen.derivation.symbols import Expr
from eomgen.derivation.terms import terms_steps
from eomgen.language.formula import written
from eomgen.model.model import Model
from eomgen.scene.joints.base import WORLD

DIGITS = 6
"""Digits of a number of the scene as it is shown."""
LONGEST = 160
"""Operations of an expression up to which it is gathered for reading."""
SLACK = 2.5
"""How much longer than its shortest form a sum may be whose terms are to be seen."""
PARTS = "Parts of the motion"
PARTS_ARE = (
    "These parts have names, to keep what follows short. ω, u with a velocity as index are the "
    "partial velocities: the motion of a body while this velocity is 1 and all others are 0. α^0, "
    "a^0 are the accelerations that remain while all derivatives of velocities are 0. g is the "
    "acceleration of gravity, and W rotates axes of a body into the world's."
)


def projected_steps(equations: ProjectedEquations) -> tuple[Step, ...]:
    """Every step from the state to the closed form, in symbols meant for reading."""
    joints = tuple(_joints(equations))
    steps = (*joints, *_balance(equations, joints), *_solution(equations))
    return tuple(read_step(equations, step) for step in steps)


def read_step(equations: ProjectedEquations, step: Step, *, moving: bool = False) -> Step:
    """A step in symbols meant for reading, without lines that then say nothing. Unless it is on a
    motion as a whole (`moving`), α^0 and a^0 are accelerations where v̇ = 0.
    """
    shown = readable_symbols(equations)
    if not moving and step.kind not in ("state", "joint", "motion"):
        shown |= _without_rates(equations, shown)
    given = equations.symbols.numbers.items()
    numbers = {symbol: sp.Float(float(x), DIGITS) for x, symbol in given}
    pairs = [(line.left, line.right) for line in step.equations]
    lines = [Equation(*(x.xreplace(numbers).xreplace(shown) for x in pair)) for pair in pairs]
    return replace(step, equations=tuple(line for line in lines if line.left != line.right))


def _without_rates(equations: ProjectedEquations, shown: dict[Expr, Expr]) -> dict[Expr, Expr]:
    """Accelerations where the derivatives of velocities are 0, as α^0 and a^0."""
    found = {}
    for symbol in equations.solution.definitions:
        kind, _, _ = symbol.name.partition("__")
        if kind in ("alpha", "a") and symbol in shown:
            letter, _, rest = shown[symbol].name.partition("_")
            found[symbol] = sp.Symbol(f"{letter}^0_{rest}")
    return found


def _joints(equations: ProjectedEquations) -> Iterator[Step]:
    """The state, and each joint as a constraint with its derivatives."""
    s, model = equations.symbols, equations.model
    plane = model.dimensions == 2
    yield Step.of(
        "state",
        "State",
        state_words(model),
        [
            (sp.Symbol("q"), sp.Matrix([s.q])),
            (sp.Symbol("v"), sp.Matrix([s.v])),
            (sp.Symbol(dotted("v")), sp.Matrix([s.a])),
        ],
    )
    definitions, still = _motion(equations), still_symbols(equations)
    for body, c in zip(model.bodies, equations.constraints, strict=True):
        parent = WORLD if body.parent < 0 else model.bodies[body.parent].name
        own = [(symbol, e) for symbol, e in definitions if symbol.name.split("__")[1] == body.name]
        whole = c.axes * c.rotation
        position = c.axes * c.reach - whole * c.arm
        pairs = [(symbol, e) for symbol, e in own if is_turn(symbol)]
        size = 2 if plane else 3
        if whole != sp.eye(3):
            pairs.append((sp.Symbol(f"R_{body.name}"), whole[:size, :size]))
        pairs.append((sp.Symbol(f"r_{body.name}"), position[:size, :].applyfunc(_short)))
        yield Step.of(
            "joint",
            f"Joint `{body.joint.name}`: {body.joint.type}, `{parent}` to `{body.name}`",
            _joint_words(body.name, parent, turns=whole != sp.eye(3)),
            pairs,
        )
        yield Step.of(
            "motion",
            f"Joint `{body.joint.name}`, differentiated twice",
            f"Angular velocity ω and velocity u of the centre of mass of `{body.name}`, and their "
            f"derivatives α and a, in axes of `{body.name}`"
            + (f", by those of `{parent}`." if body.parent >= 0 else "."),
            _differentiated(c, still),
        )


def state_words(model: Model) -> str:
    """What q and v are."""
    spins = "; those of a quaternion are the angular velocity in the axes of the body to which it "
    spins += "belongs"
    return (
        f"Coordinates q and velocities v{spins if model.quaternions else ''}."
        f"{words_on_names(model)}"
    )


def _joint_words(name: str, parent: str, *, turns: bool) -> str:
    """What the rotation R and the vector r of a joint are."""
    of_parent = "the world's" if parent == WORLD else f"those of `{parent}`"
    axes = f"R_{name} rotates axes of `{name}` into {of_parent}, and"
    if not turns:
        axes = f"Axes of `{name}` are parallel to {of_parent}, and"
    if parent == WORLD:
        return f"{axes} r_{name} is the position of the centre of mass of `{name}` in the world."
    runs = f"r_{name} runs from the centre of mass of `{parent}` to that of `{name}`"
    return f"{axes} {runs}, axes of `{parent}`."


def _differentiated(c: Constraint, still: dict[Expr, Expr]) -> Pairs:
    """Components of the child's motion that do not vanish."""
    pairs: Pairs = []
    for symbols, vector in (
        (c.own.omega, c.omega),
        (c.own.velocity, c.velocity),
        (c.own.alpha, c.alpha),
        (c.own.acceleration, c.acceleration),
    ):
        for symbol, e in zip(symbols, vector, strict=True):
            if symbol not in still:
                pairs.append((symbol, _short(e.xreplace(still))))
    return pairs


def still_symbols(equations: ProjectedEquations) -> dict[Expr, Expr]:
    """Components of motion that are always 0, such as those out of the plane."""
    zero = sp.Integer(0)
    found: dict[Expr, Expr] = {}
    for c, motion in zip(equations.constraints, equations.motions, strict=True):
        for i in range(3):
            rotates = any(vector[i] != 0 for vector in motion.partial_omegas.values())
            moves = any(vector[i] != 0 for vector in motion.partial_velocities.values())
            if not rotates:
                found[c.own.omega[i]] = zero
                if motion.alpha[i] == 0:
                    found[c.own.alpha[i]] = zero
            if not moves:
                found[c.own.velocity[i]] = zero
                if motion.acceleration[i] == 0:
                    found[c.own.acceleration[i]] = zero
    return found


def _flat(expression: Expr, fixed: frozenset[Expr]) -> Expr:
    """A sum as one term for each product of what moves, unless it is long; quotients stay."""
    if not expression.is_Add or sp.count_ops(expression) > LONGEST:
        return expression
    return gathered(expression, fixed, slack=SLACK)


def _short(expression: Expr) -> Expr:
    if sp.count_ops(expression) > LONGEST:
        return expression
    return gathered(expression, frozenset())


def _balance(equations: ProjectedEquations, before: Sequence[Step]) -> Iterator[Step]:
    """M, V, G, F; what is said `before` of angular velocities is not said again."""
    said = {line.left for step in before for line in step.equations}
    said = {symbol for symbol in said if symbol.name.startswith("omega__")}
    terms, model = equations.balance, equations.model
    named = named_parts(equations, terms.whole)
    named = [pair for pair in named if pair[0] not in said]
    if named:
        yield Step.of("balance", PARTS, PARTS_ARE, named)
    weights = "" if model.dimensions == 2 else ", and I α + ω × I ω for its torque"
    words = (
        "For every velocity that the joints leave free, the forces of inertia do the work of "
        f"the loads: m a for each body's force{weights}. Forces in the joints do none. This is "
        "M dv/dt + V + G = F; first the mass matrix, which is symmetric (entries that are not "
        "written are 0, or stand on the other side of the diagonal),"
    )
    yield from terms_steps("Virtual power", words, terms)


def named_parts(equations: ProjectedEquations, expressions: Sequence[Expr]) -> Pairs:
    """The parts of the motion that expressions need, by their names."""
    parts = needed_by(expressions, _motion(equations))
    return [pair for pair in parts if not is_turn(pair[0])]


def _motion(equations: ProjectedEquations) -> Pairs:
    """The definitions of the motion."""
    return [*equations.solution.definitions.items()][: equations.motion_definitions]


def _solution(equations: ProjectedEquations) -> Iterator[Step]:
    """The closed form without the generalised forces, which only `forward_dynamics` has."""
    s, terms = equations.symbols, equations.balance
    still = dict.fromkeys(s.tau, sp.Integer(0))
    every = [(x, e.xreplace(still)) for x, e in equations.solution.definitions.items()]
    said = {x for x, _ in named_parts(equations, [terms.M, terms.V])}
    pairs = [
        (x, _flat(e, s.fixed)) for x, e in needed_by(s.a, every) if not is_turn(x) and x not in said
    ]
    yield Step.of(
        "solution",
        "Closed form",
        "Gauss: of all motions that the joints allow, the true one has the least sum of weighted "
        "squares of the differences between the bodies' accelerations and those of free bodies. "
        "Velocities are eliminated one by one, from the leaves inwards. Each pivot d is a sum of "
        "weighted squares, so it vanishes at no pose at which the mass matrix is regular. c "
        "couples "
        "one velocity to another, β is the acceleration that it would need to stay behind, Q is "
        "the force on it, and f the part of Q that is left.",
        pairs,
    )


KINDS = {
    "omega": "omega", "alpha": "alpha", "a": "a", "u": "u", "g": "g", "R": "R", "k": "k", "W": "W",
    "turn": "omega", "move": "u", "pivot": "d", "coupling": "c", "bias": "beta", "rest": "b",
    "row": "j", "load": "Q", "drive": "f", "effort": "tau",
    "mass": "M", "mean": "h", "apart": "j", "weight": "w", "ratio": "l",
}  # fmt: skip
"""What the kinds of derived symbols are written with."""


def readable_symbols(equations: ProjectedEquations) -> dict[Expr, Expr]:
    """Symbols by ones whose names that printers know how to write."""
    s, model = equations.symbols, equations.model
    taken = {*s.parameters, *s.inputs, *(q.name for q in s.q)}
    shown = {symbol: sp.Symbol(written(formula)) for formula, symbol in s.formulas.items()}
    for c in equations.constraints:  # a body that turns freely in the world
        turning = zip(c.own.omega, c.omega, strict=True)
        shown |= {symbol: e for symbol, e in turning if e in s.v}
    words: dict[str, str] = {}
    short = {c: name.partition("_")[2] for c, name in brief_coordinates(model).items()}
    for index in model.joint_indices:
        for j in index.v:
            velocity = s.v[j].name
            name = velocity.removesuffix("_dot")
            word = index.body.name if len(index.v) == 1 else short.get(name, name)
            words[velocity] = word if name != velocity else short_name(velocity)
    own = (c.own for c in equations.constraints)
    moving = [x for m in own for vector in vars(m).values() for x in vector]
    for symbol in (*moving, *equations.solution.definitions):
        kind, _, rest = symbol.name.partition("__")
        if symbol in shown or kind not in KINDS:
            continue
        parts = [words.get(part, part) for part in rest.split("__")]
        if kind in ("turn", "move", "mean", "apart"):  # the body first, then the velocity
            parts = [*parts[1:], parts[0]]
        name = f"{KINDS[kind]}_{','.join(parts)}"
        while name in taken:
            name = f"{name},own"
        taken.add(name)
        shown[symbol] = sp.Symbol(name)
    return shown
