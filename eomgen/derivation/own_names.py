"""Symbols of a derivation whose names a scene has, too, by other names."""

from collections.abc import Sequence
from dataclasses import replace

from eomgen.derivation.matrices import Matrices
from eomgen.derivation.reading import read, reading_names
from eomgen.derivation.steps import Step
from eomgen.derivation.symbols import OF_SCENE, names_of_scene
from eomgen.model.model import Model


def names_within(model: Model) -> dict[str, str]:
    """How each symbol of a derivation is written, in which those of parameters and inputs are
    marked; see `reading_names`. One of its own whose name the scene has, too, gets another.
    """
    given = names_of_scene(model)
    names = reading_names(model)
    own = {k: own_name(x) if x in given else x for k, x in names.items() if k not in given}
    own |= {name: own_name(name) for name in given}
    return own | {name + OF_SCENE: names.get(name, name) for name in given}


def own_name(name: str) -> str:
    """How a symbol of the derivation is written whose name a scene has, too."""
    return f"{name},own" if "_" in name else f"{name}_own"


def with_names_of_scene(found: Matrices, model: Model) -> Matrices:
    """Matrices over the names of a scene, without marks."""
    given = names_of_scene(model)
    plain = {name: own_name(name) for name in given} | {name + OF_SCENE: name for name in given}
    definitions = tuple((read(s, plain), read(e, plain)) for s, e in found.definitions)
    return replace(found.each(lambda e: read(e, plain)), definitions=definitions)


def other_names(steps: Sequence[Step], model: Model) -> str:
    """A sentence on the derivation's own symbols whose names the scene has, too; "" without any."""
    seen = {s.name for step in steps for line in step.equations
            for e in (line.left, line.right) for s in e.free_symbols}  # fmt: skip
    given = names_of_scene(model)
    found = [name for name in given if own_name(name) in seen]
    if not found:
        return ""
    pairs = ", ".join(f"{own_name(name)} instead of {name}" for name in found)
    return (
        f" Names of the scene are those of symbols of the derivation, too: in equations the latter "
        f"are written {pairs}."
    )
