"""Expositions of mechanisms whose equations are written out: pins in the plane by the handout, any
small tree, and what constraints leave free of one.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from eomgen.derivation.acting import Parts, effect_steps
from eomgen.derivation.dependent_velocities import of_freedoms
from eomgen.derivation.embedding import embedded, solved_for
from eomgen.derivation.euler import euler_steps
from eomgen.derivation.handout.closed import collected_equations
from eomgen.derivation.handout.closed import solved as solved_pins
from eomgen.derivation.handout.steps import handout_steps, readable, symmetry_steps
from eomgen.derivation.impacts import impact_steps
from eomgen.derivation.kane import kane_written
from eomgen.derivation.lagrange import lagrange_written
from eomgen.derivation.loops import bias_of, constraint_steps, elimination_steps
from eomgen.derivation.matrices import (
    Matrices,
    of_pins,
    of_projected,
    over_coordinates,
    projected_definitions,
)
from eomgen.derivation.newton_euler import has_named_accelerations, newton_euler_steps
from eomgen.derivation.own_names import names_within
from eomgen.derivation.polygons import freedom_steps, polygon_steps
from eomgen.derivation.prescribed import (
    PRESCRIBED,
    free_step,
    left_free,
)
from eomgen.derivation.projected.derive import balanced
from eomgen.derivation.projected.derive import solved as solved_projected
from eomgen.derivation.projected.steps import projected_steps
from eomgen.derivation.reading import (
    is_of_handout,
    numbered,
    renamed,
    renumbered,
)
from eomgen.derivation.simplified import simplified, solved_directly, tidied
from eomgen.derivation.state_forms import form_step, momentum_form
from eomgen.derivation.steps import Equation, Step
from eomgen.derivation.symbols import Expr
from eomgen.derivation.telling import (
    Exposition,
    first_of,
    last_step,
    names_of_symbols,
    state_step,
    told,
    with_forces,
)
from eomgen.model.model import Model
from eomgen.scene.schema import Form
from eomgen.tables.details import Method

HANDOUT = (
    'Numbers in brackets up to (36) are those of the handout that this derivation follows: "CS229 '
    'Dynamics Handout", a university handout on dynamics for computer graphics, section 2: two '
    "rigid bodies, one rotational joint, free in the plane. What is different here: the bodies and "
    "joints are those of the scene, ψ is the orientation of a body and ω its rate, sin and cos are "
    "written out where the handout has S and C, and each effect of the scene has its own forces "
    "beside (29) to (36). Numbers from (37) on are not in the handout: it leaves the solution to "
    "the computer."
)
SOLVED = "The equations solved for the accelerations."
ELIMINATED = (
    "From the last velocity to the first each is eliminated: d is a pivot, and b what is left of "
    "F - V - G."
)
FREE = "Each body by itself, with its weight, the forces of the effects, and those of its joints."


def of_pins_written(model: Model, bare: Model, parts: Parts, form: Form) -> Exposition:
    """A small tree of pins and free bodies in the plane by the handout; `bare` is it alone."""
    equations = collected_equations(bare)
    equations = replace(equations, symmetric=equations.symmetric.each(simplified))
    s, rows = equations.symbols, equations.symmetric
    direct = solved_directly(rows.M, rows.right) if form == "velocity" else None
    if direct is None:
        equations = solved_pins(equations)
    equations = replace(equations, collected=equations.collected.each(tidied))
    names = names_within(model)
    names |= {own: names.get(name, name) for own, name in readable(equations).items()}
    names |= {f"angle_{body.name}": f"psi_{body.name}" for body in model.bodies}
    steps = [*handout_steps(equations)]
    place = first_of(steps, "solution")
    whole = with_forces(of_pins(equations), model, parts)
    if direct is not None:
        lines = dict(zip(s.a, direct, strict=True))
        steps[place] = _directly(steps[place], lines)
        whole = _with(whole, direct)
    last = last_step(model, parts)
    if form != "velocity":
        last = form_step(model, form, momentum_form(equations), parts.effects)
    ends = [*symmetry_steps(equations), *impact_steps(model, parts.effects), last]
    inner = [
        replace(step, number=f"(36.{i})") for i, step in enumerate(effect_steps(model, parts), 1)
    ]
    steps = [*steps[:place], *inner, *steps[place:], *numbered(ends, 39)]
    steps = [renamed(step, names) for step in steps]
    if not is_of_handout(model):
        return Exposition(renumbered(steps), whole, parts.loads)
    introduction = Step("introduction", "The handout", HANDOUT, ())
    return Exposition((introduction, *steps), whole, parts.loads)


def _directly(step: Step, found: Mapping[Expr, Expr]) -> Step:
    """A step of a solution that is short: a line for each acceleration."""
    return replace(step, words=SOLVED, equations=tuple(Equation(*x) for x in found.items()))


def _with(found: Matrices, direct: Sequence[Expr]) -> Matrices:
    """Matrices with a solution."""
    solution = zip(found.a, direct, strict=True)
    return replace(found, definitions=(*found.definitions, *solution))


def of_any_written(
    model: Model, bare: Model, parts: Parts, method: Method | None, *, shared: bool
) -> Exposition | None:
    """A small tree written out; None if its steps by this method would be too long to read.

    With `shared` its steps from the equations of motion on are the same by all methods.
    """
    equations = balanced(bare)
    equations = replace(equations, balance=equations.balance.each(simplified))
    whole = tree = of_projected(equations)
    if model.prescribed and not parts.constraints:
        tree = left_free(model, whole)
    direct = solved_directly(tree.M, tree.right) if not parts.constraints else None
    by_gauss = direct is None and method in (None, "kane")
    by_gauss = by_gauss and not (shared or parts.constraints or model.prescribed)
    if by_gauss:
        equations = solved_projected(equations)
        tree = replace(tree, definitions=projected_definitions(equations))
    found = projected_steps(equations)
    joints, place = first_of(found, "balance", "equations"), first_of(found, "solution")
    by_power = found[joints:place]
    way: Sequence[Step] | None = by_power
    if method == "lagrange":
        way = lagrange_written(bare, whole, equations.loads.uniform, equations.ledger.rates)
    elif method == "newton-euler":
        way = newton_euler_steps(equations)
    elif method == "kane" and not has_named_accelerations(equations):
        way = (*kane_written(equations), *by_power)
    if way is None:
        return None
    start = _start(model, found[:joints])
    if parts.constraints:
        keep = shared or method in ("newton-euler", "kane")
        return _of_tied(model, parts, start, [*way], over_coordinates(tree), keep_motion=keep)
    solution, matrices = found[place], over_coordinates(tree)
    if not by_gauss:
        words, lines = SOLVED, dict(zip(tree.a, direct or (), strict=direct is not None))
        if direct is None:
            lines = dict(solved_for([x.name for x in tree.a], tree))
            words = f"{SOLVED} {ELIMINATED}"
        solution = replace(_directly(solution, lines), words=words)
        matrices = replace(matrices, definitions=(*matrices.definitions, *lines.items()))
    left = [free_step(tree)] if model.prescribed else []
    ends = [*impact_steps(model, parts.effects), last_step(model, parts)]
    if shared or method == "lagrange":
        ends[-1:-1] = euler_steps(bare, whole, equations.loads.uniform)
    steps = [*start, *effect_steps(model, parts), *way, *left, solution, *ends]
    names = names_of_symbols(model, tree.formulas)
    return told("", steps, names, with_forces(matrices, model, parts), parts)


def _start(model: Model, found: Sequence[Step]) -> list[Step]:
    """The state, free bodies, and joints."""
    words = f"{FREE} {PRESCRIBED}" if model.prescribed else FREE
    state = state_step(model) if model.prescribed else found[0]
    return [state, Step("bodies", "Free bodies", words, ()), *found[1:]]


def _of_tied(
    model: Model,
    parts: Parts,
    start: list[Step],
    balance: list[Step],
    tree: Matrices,
    *,
    keep_motion: bool,
) -> Exposition:
    """A small mechanism with constraints: the tree, then what the constraints leave free."""
    effects = effect_steps(model, parts)
    if model.groups:
        found = embedded(model, parts.constraints)
        solved, reduced = freedom_steps(found, tree, parts.constraints)
        matrices = with_forces(reduced, model, parts, len(found.definitions))
        before, ends = [*polygon_steps(model, found), *effects], [*solved]
        if not keep_motion:  # velocities and accelerations follow from the constraints
            start = [replace(x, kind="variant") if x.kind == "motion" else x for x in start]
    else:
        rest, following = of_freedoms(model, tree, parts.constraints)
        matrices = with_forces(rest, model, parts, following)
        before, ends = [*effects], [*constraint_steps(model, parts.constraints)]
        ends += elimination_steps(model, parts.constraints, bias_of(len(model.velocities)))
    ends += [*impact_steps(model, parts.effects), last_step(model, parts)]
    names = names_of_symbols(model, tree.formulas)
    return told("", [*start, *before, *balance, *ends], names, matrices, parts)
