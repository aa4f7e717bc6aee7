"""What acts on a mechanism, told step by step: each effect with its forces."""

from collections.abc import Iterator
from dataclasses import dataclass

import sympy as sp

from eomgen.derivation.constraints import DerivedConstraint
from eomgen.derivation.effects import DerivedEffect, equations_of
from eomgen.derivation.linkage import linkage_of
from eomgen.derivation.poses import poses
from eomgen.derivation.steps import Equation, Step
from eomgen.derivation.symbols import real
from eomgen.model.model import Model
from eomgen.scene.effects.base import Load
from eomgen.scene.joints.base import WORLD


@dataclass(frozen=True)
class Parts:
    """What acts on a mechanism: its effects, and the constraints with their forces."""

    effects: tuple[DerivedEffect, ...]
    constraints: tuple[DerivedConstraint, ...]

    @property
    def loads(self) -> tuple[DerivedEffect, ...]:
        """All that has loads."""
        return (*self.effects, *(c.force for c in self.constraints))


def effect_steps(model: Model, parts: Parts, *, every: bool = False) -> Iterator[Step]:
    """Poses and motions that effects and constraints use, and each of them with its forces.

    The recursion needs the poses of bodies with forces that no motion changes as well (`every`).
    """
    used = [t for t in parts.effects if every or not t.kept]
    needed = dict.fromkeys(body for t in used for body in used_bodies(t))
    if not model.groups:
        needed |= dict.fromkeys(body for c in parts.constraints for body in c.bodies)
    if needed:
        words = (
            "The forces below depend on where bodies are in the world and how they move. o is the "
            "position of a joint; "
        )
        words += (
            "ψ is a body's angle from the world's x axis, ω its rate, x and y the position of its "
            "centre of mass."
            if model.dimensions == 2
            else "W rotates a body's axes into the world's, Ω is its angular velocity in world "
            "axes, x, y, z the position of its centre of mass."
        )
        _, equations = poses(linkage_of(model), needed)
        yield Step("pose", "Where the bodies are, and how they move", words, tuple(equations))
    for derived in parts.effects:
        lines = equations_of(derived.definitions)
        if derived.kept:
            lines = _loads_as_they_are(derived)
        lines += [Equation(*pair) for pair in derived.samples or derived.rates]
        yield Step(
            "force" if derived.falls else "effect",
            f"Effect `{derived.effect.name}` ({derived.effect.type.replace('_', ' ')})",
            f"{derived.words}{_inputs_of(model, derived)}",
            tuple(lines),
        )


def _inputs_of(model: Model, derived: DerivedEffect) -> str:
    """Which names of an effect are inputs."""
    names = [f"`{x.name}`" for x in derived.effect.inputs(model.dimensions)]
    if not names:
        return ""
    return f" {' and '.join(names)} {'is an input' if len(names) == 1 else 'are inputs'}."


def used_bodies(derived: DerivedEffect) -> Iterator[str]:
    """The bodies whose pose or motion the formulas of an effect, or its use, need."""
    yield from derived.bodies
    loads = [*(() if derived.falls else derived.loads)]
    for contact in derived.contacts:
        loads += [*contact.normal, *(load for tangent in contact.tangents for load in tangent)]
    yield from (load.body for load in loads if isinstance(load, Load) and load.body != WORLD)


def _loads_as_they_are(derived: DerivedEffect) -> list[Equation]:
    """The loads of an effect that no motion changes, with the names of the scene."""
    lines = []
    for load in derived.loads:
        parts = load.force if isinstance(load, Load) else (load.force,)
        if all(part == 0 or part.is_Symbol for part in parts):
            continue  # inputs or parameters, which stand in F by their own names
        if isinstance(load, Load):
            lines.append(
                Equation(real(f"f_{derived.effect.name},{load.body}"), sp.Matrix(load.force))
            )
        else:
            lines.append(Equation(real(f"tau_{derived.effect.name}"), load.force))
    return lines
