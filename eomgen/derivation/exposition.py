"""The derivation of any scene, as steps to be read.

Small trees of pins and free bodies in the plane follow the handout, other small trees Kane's
method, and everything else the articulated-body algorithm. M, V and G do not depend on the effects:
what depends on the motion enters the derivation as forces with names, and each effect says what its
forces are.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import sympy as sp

from eomgen.base.errors import SceneError
from eomgen.derivation.acting import Parts, effect_steps, used_bodies
from eomgen.derivation.composite import composite_steps, solved_algorithm
from eomgen.derivation.constraints import derived_constraints, tree_of
from eomgen.derivation.dependent_velocities import of_freedoms
from eomgen.derivation.effects import DerivedEffect, derived_effects, with_symbols
from eomgen.derivation.embedding import embedded, solved_for
from eomgen.derivation.euler import euler_steps
from eomgen.derivation.handout.closed import collected_equations
from eomgen.derivation.handout.closed import solved as solved_pins
from eomgen.derivation.handout.steps import handout_steps, readable, symmetry_steps
from eomgen.derivation.impacts import impact_steps
from eomgen.derivation.kane import kane_written
from eomgen.derivation.lagrange import lagrange_written
from eomgen.derivation.linkage import linkage_of
from eomgen.derivation.loops import (
    bias_of,
    constraint_steps,
    elimination_steps,
    freedom_algorithm,
    freedom_steps,
    polygon_steps,
)
from eomgen.derivation.matrices import (
    Matrices,
    of_pins,
    of_projected,
    over_coordinates,
    projected_definitions,
)
from eomgen.derivation.newton_euler import has_named_accelerations, newton_euler_steps
from eomgen.derivation.own_names import names_within, other_names, with_names_of_scene
from eomgen.derivation.partial_motions import kane_steps, lagrange_steps
from eomgen.derivation.poses import poses
from eomgen.derivation.prescribed import (
    PRESCRIBED,
    free_step,
    freed,
    left_free,
    prescribed_motion,
)
from eomgen.derivation.projected.derive import balanced
from eomgen.derivation.projected.derive import solved as solved_projected
from eomgen.derivation.projected.steps import projected_steps, state_words
from eomgen.derivation.reading import (
    brief,
    is_of_handout,
    numbered,
    read_all,
    renumbered,
)
from eomgen.derivation.recursion import recursive_steps
from eomgen.derivation.simplified import simplified, solved_directly, tidied
from eomgen.derivation.state_forms import form_step, momentum_form, plain_form
from eomgen.derivation.steps import Definition, Equation, Kind, Step
from eomgen.derivation.supported import (
    MOST_REPORTED,
    why_not_closed,
    why_not_momenta,
    why_not_pins,
)
from eomgen.derivation.symbols import Expr, real
from eomgen.dynamics.start.assur import with_closed_form
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
RECURSIVE = (
    "The equations of this mechanism written out would be too long to read, so they are given as "
    "an algorithm: named quantities, one frame after another, each computed from those before. "
    "They are M dv/dt + V + G = F, with the symmetric M that `mass_matrix()` of the generated "
    "module returns."
)
SOLVED = "The equations solved for the accelerations."
ELIMINATED = (
    "From the last velocity to the first each is eliminated: d is a pivot, and b what is left of "
    "F - V - G."
)
FREE = "Each body by itself, with its weight, the forces of the effects, and those of its joints."
ALGORITHMS: dict[Method, Callable[..., Iterator[Step]]] = {
    "newton-euler": composite_steps,
    "lagrange": lagrange_steps,
    "kane": kane_steps,
}
"""The steps to M and h_0 of a tree, frame by frame."""


@dataclass(frozen=True)
class Exposition:
    """The steps of a derivation, and its equations as matrices unless they are too long."""

    steps: tuple[Step, ...]
    matrices: Matrices | None
    effects: tuple[DerivedEffect, ...]


def exposition_of(
    model: Model,
    form: Form | None = None,
    method: Method | None = None,
    *,
    shared: Literal["", "written", "algorithm"] = "",
) -> Exposition:
    """Derive a model and explain it in a state form, by default the scene's, and by a method, by
    default that which suits it. With `shared` it has steps in common with those by other methods,
    written out where it is small or as an algorithm.

    Raises `SceneError` for a form or a method that the mechanism does not have.
    """
    found = _explained(model, form, method, shared)
    steps, matrices = list(found.steps), found.matrices
    if words := other_names(steps, model):
        place = _first(steps, "state")
        first, gap, rest = steps[place].words.partition("\n\n")
        steps[place] = replace(steps[place], words=first + words + gap + rest)
    if matrices is not None:
        matrices = with_names_of_scene(matrices, model)
    return replace(found, steps=tuple(steps), matrices=matrices)


def _explained(
    model: Model,
    form: Form | None,
    method: Method | None,
    shared: Literal["", "written", "algorithm"],
) -> Exposition:
    form = form or model.form
    model = with_closed_form(model)
    effects, constraints = derived_effects(model), derived_constraints(model)
    if form != "velocity" and constraints:
        raise SceneError(f"form: no derivation in the form '{form}': {why_not_momenta(model)}")
    bare = replace(tree_of(with_symbols(model, effects)), form=form)
    if not constraints:
        bare = freed(bare)
    parts = Parts(effects, constraints)
    small = len(model.bodies) <= MOST_REPORTED
    long = f"it is written out for up to {MOST_REPORTED} bodies, and there are {len(model.bodies)}"
    why_not = why_not_pins(model) or ("" if small else long)
    if form != "velocity" and why_not:
        module = f"; a module has it: eomgen generate --form {form}" if why_not == long else ""
        raise SceneError(
            f"form: no derivation in the form '{form}': {why_not}; use velocity{module}"
        )
    if form != "velocity" and method not in (None, "newton-euler"):
        raise SceneError(f"method: the form '{form}' is derived by newton-euler, not by {method}")
    if not why_not and method in (None, "newton-euler") and not shared:
        return _of_pins(model, bare, parts, form)
    written = why_not_closed(bare) or ("" if small else long)
    found = None
    if not written and shared != "algorithm":
        found = _of_any(model, bare, parts, method, shared=bool(shared))
    return found or _recursive(model, parts, method)


def _of_pins(model: Model, bare: Model, parts: Parts, form: Form) -> Exposition:
    equations = collected_equations(bare)
    equations = replace(equations, symmetric=_each(equations.symmetric, simplified))
    s, rows = equations.symbols, equations.symmetric
    direct = solved_directly(rows.M, rows.F - rows.V - rows.G) if form == "velocity" else None
    if direct is None:
        equations = solved_pins(equations)
    equations = replace(equations, collected=_each(equations.collected, tidied))
    names = names_within(model)
    names |= {own: names.get(name, name) for own, name in readable(equations).items()}
    names |= {f"angle_{body.name}": f"psi_{body.name}" for body in model.bodies}
    steps = [_renamed(step, names) for step in handout_steps(equations)]
    place = _first(steps, "solution")
    whole = _whole(of_pins(equations), model, parts)
    if direct is not None:
        lines = dict(zip(s.a, direct, strict=True))
        steps[place] = _renamed(_directly(steps[place], lines), names)
        whole = _with(whole, direct)
    last = _last(model, parts)
    if form != "velocity":
        last = form_step(model, form, momentum_form(equations), parts.effects)
    ends = [*symmetry_steps(equations), *impact_steps(model, parts.effects), last]
    inner = _numbered_within(effect_steps(model, parts), "36")
    steps = [
        *steps[:place],
        *(_renamed(step, names) for step in inner),
        *steps[place:],
        *(_renamed(step, names) for step in numbered(ends, 39)),
    ]
    if not is_of_handout(model):
        return Exposition(renumbered(steps), whole, parts.loads)
    return Exposition(
        (Step("introduction", "The handout", HANDOUT, ()), *steps), whole, parts.loads
    )


def _first(steps: Sequence[Step], *kinds: Kind) -> int:
    """The place of the first step of these kinds."""
    return next(i for i, step in enumerate(steps) if step.kind in kinds)


def _directly(step: Step, found: Mapping[Expr, Expr]) -> Step:
    """A step of a solution that is short: a line for each acceleration."""
    return replace(step, words=SOLVED, equations=tuple(Equation(*x) for x in found.items()))


def _with(found: Matrices, direct: Sequence[Expr]) -> Matrices:
    """Matrices with a solution."""
    solution = zip(found.a, direct, strict=True)
    return replace(found, definitions=(*found.definitions, *solution))


def _each(found: Any, change: Callable[[Expr], Expr]) -> Any:
    """M, V, G and F changed."""
    return replace(found, **{x: change(getattr(found, x)) for x in "MVGF"})


def _of_any(
    model: Model, bare: Model, parts: Parts, method: Method | None, *, shared: bool
) -> Exposition | None:
    """A small tree written out; None if its steps by this method would be too long to read.

    With `shared` its steps from the equations of motion on are the same by all methods.
    """
    equations = balanced(bare)
    equations = replace(equations, balance=_each(equations.balance, simplified))
    whole = tree = of_projected(equations)
    if model.prescribed and not parts.constraints:
        tree = left_free(model, whole)
    direct = solved_directly(tree.M, tree.F - tree.V - tree.G) if not parts.constraints else None
    by_gauss = direct is None and method in (None, "kane")
    by_gauss = by_gauss and not (shared or parts.constraints or model.prescribed)
    if by_gauss:
        equations = solved_projected(equations)
        tree = replace(tree, definitions=projected_definitions(equations))
    names = names_within(model)
    said = {**names, **{s.name: text for s, text in tree.formulas.items()}, **_entries(model)}
    found = projected_steps(equations)
    joints, place = _first(found, "balance", "equations"), _first(found, "solution")
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
    way = [_renamed(step, said) for step in way]
    start = [_renamed(step, names) for step in _start(model, found[:joints])]
    if parts.constraints:
        keep = shared or method in ("newton-euler", "kane")
        return _of_tied(model, parts, start, way, over_coordinates(tree), keep_motion=keep)
    solution, matrices = found[place], over_coordinates(tree)
    if not by_gauss:
        words, lines = SOLVED, dict(zip(tree.a, direct or (), strict=direct is not None))
        if direct is None:
            right = tree.F - tree.V - tree.G
            lines = dict(solved_for([x.name for x in tree.a], tree.M, right))
            words = f"{SOLVED} {ELIMINATED}"
        solution = replace(_directly(solution, lines), words=words)
        matrices = replace(matrices, definitions=(*matrices.definitions, *lines.items()))
    left = [free_step(tree)] if model.prescribed else []
    ends = [*impact_steps(model, parts.effects), _last(model, parts)]
    if shared or method == "lagrange":
        ends[-1:-1] = euler_steps(bare, whole, equations.loads.uniform)
    effects = [_renamed(step, said) for step in effect_steps(model, parts)]
    ends = [_renamed(step, said) for step in (*left, solution, *ends)]
    steps = [*start, *effects, *way, *ends]
    return _told("", steps, _whole(matrices, model, parts), parts)


def _start(model: Model, found: Sequence[Step]) -> list[Step]:
    """The state, free bodies, and joints."""
    words = f"{FREE} {PRESCRIBED}" if model.prescribed else FREE
    state = _state(model) if model.prescribed else found[0]
    return [state, Step("bodies", "Free bodies", words, ()), *found[1:]]


def _entries(model: Model) -> dict[str, str]:
    """How the entries of joints' rotations are read."""
    both = [f"{i}{j}" for i in "xyz" for j in "xyz"]
    return {f"R__{b.name}__{ij}": f"R_{b.name},{ij}" for b in model.bodies for ij in both}


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
    matrices = None
    effects = effect_steps(model, parts)
    if model.groups:
        found = embedded(model, parts.constraints)
        solved, reduced = freedom_steps(found, tree, parts.constraints)
        matrices = _whole(reduced, model, parts, len(found.definitions))
        before, ends = [*polygon_steps(model, found), *effects], [*solved]
        if not keep_motion:  # velocities and accelerations follow from the constraints
            start = [replace(x, kind="variant") if x.kind == "motion" else x for x in start]
    else:
        rest, following = of_freedoms(model, tree, parts.constraints)
        matrices = _whole(rest, model, parts, following)
        before, ends = [*effects], [*constraint_steps(model, parts.constraints)]
        ends += elimination_steps(model, parts.constraints, bias_of(len(model.velocities)))
    ends += [*impact_steps(model, parts.effects), _last(model, parts)]
    names = names_within(model)
    names |= {s.name: text for s, text in tree.formulas.items()}
    before, ends = ([_renamed(step, names) for step in x] for x in (before, ends))
    return _told("", [*start, *before, *balance, *ends], matrices, parts)


def _recursive(model: Model, parts: Parts, method: Method | None) -> Exposition:
    linkage = linkage_of(model)
    steps = [_state(model), Step("bodies", "Free bodies", _free_words(model), ())]
    effects = effect_steps(model, parts, every=True)
    tree = ALGORITHMS[method or "newton-euler"](linkage, parts.effects)
    if not parts.constraints and method is None:
        steps += [*effects, *recursive_steps(linkage, parts.effects)]
    elif not parts.constraints:
        steps += [*effects, *tree, solved_algorithm(model)]
    elif model.groups:
        found = embedded(model, parts.constraints)
        steps += [*polygon_steps(model, found), *effects, *tree]
        steps += freedom_algorithm(found, parts.constraints)
    else:
        steps += [*effects, *constraint_steps(model, parts.constraints), *tree]
        steps += elimination_steps(model, parts.constraints)
    steps += [*impact_steps(model, parts.effects), _last(model, parts)]
    names = names_within(model)
    return _told(RECURSIVE, [_renamed(step, names) for step in steps], None, parts)


def _state(model: Model) -> Step:
    """Coordinates and velocities, and those that are prescribed."""
    state = [
        Equation(sp.Symbol(letter), sp.Matrix([[real(c.name) for c in group]]))
        for letter, group in (("q", model.coordinates), ("v", model.velocities))
    ]
    state += [Equation(*pair) for pair in prescribed_motion(model)]
    return Step("state", "State", state_words(model), tuple(state))


def _last(model: Model, parts: Parts) -> Step:
    """The state and its derivative, the accelerations by the steps before."""
    form = plain_form(model, [real(c.acceleration) for c in model.velocities])
    return form_step(model, "velocity", form, parts.effects)


def _told(intro: str, steps: list[Step], matrices: Matrices | None, parts: Parts) -> Exposition:
    """Steps numbered from one, after an introduction if there is one."""
    whole = numbered(brief(steps))
    first = (Step("introduction", "An algorithm", intro, ()),) if intro else ()
    return Exposition((*first, *whole), matrices, parts.loads)


def _free_words(model: Model) -> str:
    words = (
        "Each body by itself, with its weight, the forces of the effects and those of its joints. "
        "The algorithm below never forms the joint forces: along a joint's own motion they are the "
        "forces of its effects, and in the other directions they do no work."
    )
    return words + (" " + PRESCRIBED if model.prescribed else "")


def _renamed(step: Step, names: dict[str, str]) -> Step:
    return replace(step, equations=read_all(step.equations, names))


def _numbered_within(steps: Iterator[Step], number: str) -> list[Step]:
    return [replace(step, number=f"({number}.{i})") for i, step in enumerate(steps, 1)]


def _whole(found: Matrices, model: Model, parts: Parts, following: int = 0) -> Matrices:
    """The matrices with the forces of effects written out, after `following` definitions."""
    needed = dict.fromkeys(body for derived in parts.effects for body in used_bodies(derived))
    placed, _ = poses(linkage_of(model), needed)
    more = [*prescribed_motion(model), *placed]
    more += [pair for derived in parts.effects for pair in derived.definitions]
    if not more:
        return found
    known = {s.name: s for e in (found.M, found.V, found.G, found.F) for s in e.free_symbols}
    known |= {s.name: s for s in (*found.q, *found.v)}
    definitions: list[Definition] = [
        (symbol, e.xreplace({s: known.get(s.name, s) for s in e.free_symbols}))
        for symbol, e in more
    ]
    before, after = found.definitions[:following], found.definitions[following:]
    return replace(found, definitions=(*before, *definitions, *after))
