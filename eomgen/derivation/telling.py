"""What the expositions of all derivations have in common: their state, their ends, their forces."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import sympy as sp

from eomgen.derivation.acting import Parts, used_bodies
from eomgen.derivation.effects import DerivedEffect
from eomgen.derivation.linkage import linkage_of
from eomgen.derivation.matrices import (
    Matrices,
)
from eomgen.derivation.own_names import names_within
from eomgen.derivation.poses import poses
from eomgen.derivation.prescribed import (
    prescribed_motion,
)
from eomgen.derivation.projected.steps import state_words
from eomgen.derivation.reading import brief, numbered, renamed
from eomgen.derivation.state_forms import form_step, plain_form
from eomgen.derivation.steps import Definition, Equation, Kind, Step
from eomgen.derivation.symbols import Expr, real
from eomgen.model.model import Model
from eomgen.tables.details import All, Method


@dataclass(frozen=True)
class Exposition:
    """The steps of a derivation, and its equations as matrices unless they are too long. The method
    is None where it is that which suits the mechanism.
    """

    steps: tuple[Step, ...]
    matrices: Matrices | None
    effects: tuple[DerivedEffect, ...]
    method: Method | All | None = None


def state_step(model: Model) -> Step:
    """Coordinates and velocities, and those that are prescribed."""
    state = [
        Equation(sp.Symbol(letter), sp.Matrix([[real(c.name) for c in group]]))
        for letter, group in (("q", model.coordinates), ("v", model.velocities))
    ]
    state += [Equation(*pair) for pair in prescribed_motion(model)]
    return Step("state", "State", state_words(model), tuple(state))


def last_step(model: Model, parts: Parts) -> Step:
    """The state and its derivative, the accelerations by the steps before."""
    form = plain_form(model, [real(c.acceleration) for c in model.velocities])
    return form_step(model, "velocity", form, parts.effects)


def names_of_symbols(model: Model, formulas: Mapping[Expr, str]) -> dict[str, str]:
    """How all symbols of a derivation are read; some stand for formulas."""
    names = names_within(model) | {s.name: text for s, text in formulas.items()}
    both = [f"{i}{j}" for i in "xyz" for j in "xyz"]
    return names | {f"R__{b.name}__{ij}": f"R_{b.name},{ij}" for b in model.bodies for ij in both}


def told(
    intro: str,
    steps: Sequence[Step],
    names: Mapping[str, str],
    matrices: Matrices | None,
    parts: Parts,
) -> Exposition:
    """Steps with names that are read, numbered from one, after an introduction if there is one."""
    whole = numbered(brief([renamed(step, names) for step in steps]))
    first = (Step("introduction", "An algorithm", intro, ()),) if intro else ()
    return Exposition((*first, *whole), matrices, parts.loads)


def first_of(steps: Sequence[Step], *kinds: Kind) -> int:
    """The place of the first step of these kinds."""
    return next(i for i, step in enumerate(steps) if step.kind in kinds)


def with_forces(found: Matrices, model: Model, parts: Parts, following: int = 0) -> Matrices:
    """The matrices with the forces of effects written out, after `following` definitions."""
    needed = dict.fromkeys(body for derived in parts.effects for body in used_bodies(derived))
    placed, _ = poses(linkage_of(model), needed)
    more = [*prescribed_motion(model), *placed]
    more += [pair for derived in parts.effects for pair in derived.definitions]
    if not more:
        return found
    known = {s.name: s for e in found.whole for s in e.free_symbols}
    known |= {s.name: s for s in (*found.q, *found.v)}
    definitions: list[Definition] = [
        (symbol, e.xreplace({s: known.get(s.name, s) for s in e.free_symbols}))
        for symbol, e in more
    ]
    before, after = found.definitions[:following], found.definitions[following:]
    return replace(found, definitions=(*before, *definitions, *after))
