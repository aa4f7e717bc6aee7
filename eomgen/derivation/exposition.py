"""The derivation of any scene, as steps to be read.

Small trees of pins and free bodies in the plane follow the handout, other small trees Kane's
method, and everything else the articulated-body algorithm. M, V and G do not depend on the effects:
what depends on the motion enters the derivation as forces with names, and each effect says what its
forces are.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Literal

from eomgen.base.errors import SceneError
from eomgen.derivation.acting import Parts, effect_steps
from eomgen.derivation.articulated import recursive_steps
from eomgen.derivation.composite import composite_steps, solved_algorithm
from eomgen.derivation.constraints import derived_constraints, tree_of
from eomgen.derivation.effects import derived_effects, with_symbols
from eomgen.derivation.embedding import embedded
from eomgen.derivation.impacts import impact_steps
from eomgen.derivation.linkage import linkage_of
from eomgen.derivation.loops import constraint_steps, elimination_steps
from eomgen.derivation.own_names import names_within, other_names, with_names_of_scene
from eomgen.derivation.partial_motions import kane_steps, lagrange_steps
from eomgen.derivation.polygons import freedom_algorithm, polygon_steps
from eomgen.derivation.prescribed import (
    PRESCRIBED,
    freed,
)
from eomgen.derivation.steps import Step
from eomgen.derivation.supported import (
    MOST_REPORTED,
    why_not_closed,
    why_not_momenta,
    why_not_pins,
)
from eomgen.derivation.telling import Exposition, first_of, last_step, state_step, told
from eomgen.derivation.written import of_any_written, of_pins_written
from eomgen.dynamics.start.assur import with_closed_form
from eomgen.model.model import Model
from eomgen.scene.schema import Form
from eomgen.tables.details import Method

RECURSIVE = (
    "The equations of this mechanism written out would be too long to read, so they are given as "
    "an algorithm: named quantities, one frame after another, each computed from those before. "
    "They are M dv/dt + V + G = F, with the symmetric M that `mass_matrix()` of the generated "
    "module returns."
)
ALGORITHMS: dict[Method, Callable[..., Iterator[Step]]] = {
    "newton-euler": composite_steps,
    "lagrange": lagrange_steps,
    "kane": kane_steps,
}
"""The steps to M and h_0 of a tree, frame by frame."""


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
        place = first_of(steps, "state")
        first, gap, rest = steps[place].words.partition("\n\n")
        steps[place] = replace(steps[place], words=first + words + gap + rest)
    if matrices is not None:
        matrices = with_names_of_scene(matrices, model)
    return replace(found, steps=tuple(steps), matrices=matrices, method=method)


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
        return of_pins_written(model, bare, parts, form)
    written = why_not_closed(bare) or ("" if small else long)
    found = None
    if not written and shared != "algorithm":
        found = of_any_written(model, bare, parts, method, shared=bool(shared))
    return found or _recursive(model, parts, method)


def _recursive(model: Model, parts: Parts, method: Method | None) -> Exposition:
    linkage = linkage_of(model)
    steps = [state_step(model), Step("bodies", "Free bodies", _free_words(model), ())]
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
    steps += [*impact_steps(model, parts.effects), last_step(model, parts)]
    return told(RECURSIVE, steps, names_within(model), None, parts)


def _free_words(model: Model) -> str:
    words = (
        "Each body by itself, with its weight, the forces of the effects and those of its joints. "
        "The algorithm below never forms the joint forces: along a joint's own motion they are the "
        "forces of its effects, and in the other directions they do no work."
    )
    return words + (" " + PRESCRIBED if model.prescribed else "")
