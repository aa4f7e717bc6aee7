"""The names of a scene as they are read: a dot over a rate, a subscript for what it belongs to."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace

import sympy as sp

from eomgen.derivation.dots import dotted
from eomgen.derivation.steps import Equation, Step
from eomgen.derivation.symbols import Expr
from eomgen.model.model import Model


def is_of_handout(model: Model) -> bool:
    """Whether a mechanism is the handout's: two bodies with one pin, free in the plane."""
    if len(model.bodies) != 2 or model.dimensions != 2:
        return False
    first, second = model.bodies
    return not first.joint.holds and second.parent == 0


def reading_names(model: Model) -> dict[str, str]:
    """How each name of a scene is written: `theta_dot` as θ with a dot; the handout's mechanism has
    the handout's names for the joint force and its arms.
    """
    names: dict[str, str] = {}
    if is_of_handout(model):
        (first, second), pin = model.bodies, model.bodies[1].joint.name
        whole = {f"f_{pin}": "f_j", f"r_{pin},parent": f"r_{first.name}"}
        whole[f"r_{pin},child"] = f"r_{second.name}"
        names = {f"{a}{end}": f"{b}{end}" for a, b in whole.items() for end in ("", ",x", ",y")}
    taken = {p.name for p in model.parameters} | {i.name for i in model.inputs}
    for body in model.bodies:
        for c in body.positions[body.plain :]:  # a quaternion, named <prefix>_qw
            stem, _, part = c.name.rpartition("_")
            names[c.name] = f"q_{stem},{part[1:]}"
            names[f"{c.name}_dot"] = dotted(f"q_{stem},{part[1:]}")
        for c in body.velocities:
            stem = c.name.removesuffix("_dot")
            if stem != c.name:
                names[c.name], names[c.acceleration] = dotted(stem), dotted(stem, 2)
            else:
                prefix, _, axis = c.name.rpartition("_w")
                names[c.name] = f"omega_{prefix},{axis}"
                names[c.acceleration] = dotted(f"omega_{prefix},{axis}")
        own, joint = body.name, body.joint.name
        brief = {f"{own}_mass": f"m_{own}", f"{own}_inertia_com": f"I_{own}"}
        for axis in "xyz":
            brief[f"{joint}_r_parent_{axis}"] = f"b_{joint},{axis}"
            brief[f"{joint}_r_child_{axis}"] = f"c_{joint},{axis}"
        names |= {long: x for long, x in brief.items() if long in taken and x not in taken}
    for effect in model.effects:
        if effect.uniform and f"{effect.name}_g" in taken and "g" not in taken:
            names[f"{effect.name}_g"] = "g"
    return names


def read(expression: Expr, names: Mapping[str, str]) -> Expr:
    """An expression with its symbols by the names that are read."""
    renamed = {}
    for symbol in expression.free_symbols:
        if (name := names.get(symbol.name)) is not None:
            shaped = isinstance(symbol, sp.MatrixSymbol)
            renamed[symbol] = sp.MatrixSymbol(name, *symbol.shape) if shaped else sp.Symbol(name)
    if isinstance(expression, sp.MatrixBase):
        return expression.applyfunc(lambda e: e.xreplace(renamed))
    return expression.xreplace(renamed)


def read_all(equations: Sequence[Equation], names: Mapping[str, str]) -> tuple[Equation, ...]:
    """Equations with the names that are read, but for those that then say nothing."""
    found = (Equation(read(e.left, names), read(e.right, names)) for e in equations)
    return tuple(e for e in found if e.left != e.right)


def numbered(steps: Sequence[Step], start: int = 1) -> tuple[Step, ...]:
    """Steps with numbers in brackets, from `start`, for those that have none."""
    found, n = [], start
    for step in steps:
        found.append(step if step.number else replace(step, number=f"({n})"))
        n += not step.number
    return tuple(found)


def renumbered(steps: Sequence[Step]) -> tuple[Step, ...]:
    """Steps numbered from one instead of as in the handout, references in their words too."""
    of: dict[int, int] = {}
    for i, step in enumerate(steps, 1):
        ends = [int(x) for x in re.findall(r"\((\d+)\)", step.number)]
        for n in range(ends[0], ends[-1] + 1) if ends else ():
            of.setdefault(n, i)

    def said(match: re.Match[str]) -> str:
        found = sorted({of[int(x)] for x in re.findall(r"\d+", match[0]) if int(x) in of})
        return " and ".join(f"({i})" for i in found) or match[0]

    pattern = re.compile(r"\(\d+\)(?:(?:, | to | and )\(\d+\))*")
    return tuple(
        replace(step, number=f"({i})", words=pattern.sub(said, step.words))
        for i, step in enumerate(steps, 1)
    )
