"""The names of a scene as they are read: a dot over a rate, a subscript for what it belongs to."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace

import sympy as sp

from eomgen.derivation.dots import dotted
from eomgen.derivation.steps import LEVELS, Equation, Step
from eomgen.derivation.symbols import OF_SCENE, Expr
from eomgen.model.model import Model
from eomgen.tables.details import DETAILS, Detail

AXES = "xyz"
MOST_GIVEN = 16
"""Parameters up to which each of them is told."""
LETTERS = {"angle": "theta", "slide": "s"}
"""Letters of coordinates that have no name in the scene."""


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
    brief_of = brief_coordinates(model)
    names |= brief_of
    for body in model.bodies:
        for c in body.positions[body.plain :]:  # a quaternion, named <prefix>_qw
            stem, _, part = c.name.rpartition("_")
            names[c.name] = f"q_{stem},{part[1:]}"
            names[f"{c.name}_dot"] = dotted(f"q_{stem},{part[1:]}")
        for c in body.velocities:
            stem = c.name.removesuffix("_dot")
            if stem != c.name:
                brief_stem = brief_of.get(stem, stem)
                for dots, name in ((1, c.name), (2, c.acceleration)):
                    names[name] = names[dotted(stem, dots)] = dotted(brief_stem, dots)
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


def brief_coordinates(model: Model) -> dict[str, str]:
    """The names that coordinates have by default, in brief: `arm_angle` as θ of `arm`."""
    taken = {p.name for p in model.parameters} | {i.name for i in model.inputs}
    taken |= {c.name for c in model.coordinates}
    bodies = {body.name for body in model.bodies}
    found: dict[str, str] = {}
    for body in model.bodies:
        whole = body.joint.type in ("free", "particle")
        for c in body.positions[: body.plain]:
            for stem in {body.name: None, body.joint.name: None}:
                match = re.fullmatch(rf"{stem}_(angle|slide|x|y|z)(?:_(\d))?", c.name)
                if not match or (match[1] in AXES and stem in bodies and not whole):
                    continue
                number = f",{match[2]}" if match[2] else ""
                name = f"{LETTERS.get(match[1], match[1])}_{stem}{number}"
                if name not in taken:
                    found[c.name] = name
                    taken.add(name)
    return found


def words_on_names(model: Model) -> str:
    """What coordinates that are written in brief are, and what is given; "" without any."""
    words = ""
    if found := brief_coordinates(model):
        name, written = next(iter(found.items()))
        likewise = ", the others likewise" if len(found) > 1 else ""
        words = f" {written.replace('theta', 'θ')} is the coordinate `{name}`{likewise}."
    if not 0 < len(model.parameters) <= MOST_GIVEN:
        return words
    names = reading_names(model)
    given = []
    for p in model.parameters:
        size = f"{p.default:.6g} {p.unit if p.unit != '1' else ''}".rstrip()
        about = f"{p.about}, " if p.about else ""
        given.append(f"{names.get(p.name, p.name)} ({about}{size})")
    return f"{words}\n\nGiven: {'; '.join(given)}."


def short_name(velocity: str) -> str:
    """A velocity as an index: its coordinate, or of a ball's the prefix and the axis."""
    coordinate = velocity.removesuffix("_dot")
    return coordinate if coordinate != velocity else ",".join(velocity.rsplit("_w", 1))


def read(expression: Expr, names: Mapping[str, str]) -> Expr:
    """An expression with its symbols by the names that are read."""
    renamed = {}
    for symbol in expression.free_symbols:
        if (name := names.get(symbol.name)) is not None:
            shaped = isinstance(symbol, sp.MatrixSymbol)
            kept = symbol.assumptions0 if OF_SCENE in symbol.name else {}
            renamed[symbol] = (
                sp.MatrixSymbol(name, *symbol.shape) if shaped else sp.Symbol(name, **kept)
            )
    if isinstance(expression, sp.MatrixBase):
        return expression.applyfunc(lambda e: e.xreplace(renamed))
    return expression.xreplace(renamed)


def read_all(equations: Sequence[Equation], names: Mapping[str, str]) -> tuple[Equation, ...]:
    """Equations with the names that are read, but for those that then say nothing."""
    found = (Equation(read(e.left, names), read(e.right, names)) for e in equations)
    return tuple(e for e in found if e.left != e.right)


def renamed(step: Step, names: Mapping[str, str]) -> Step:
    """A step with the names that are read."""
    return replace(step, equations=read_all(step.equations, names))


def brief(steps: Sequence[Step]) -> tuple[Step, ...]:
    """Steps in which poses and motions that are a number or one symbol, and forces that are 0, are
    put in wherever a later line has them. A pose that is nothing else is no line of its own, nor is
    a matrix without rows, as where no freedom is left.
    """
    found: list[Step] = []
    plain: dict[str, Expr] = {}
    for step in steps:
        lines = []
        for e in step.equations:
            right = _filled(e.right, plain)
            pairs = _entries(e.left, right)
            if step.kind in ("pose", "effect"):
                short = [(a, b) for a, b in pairs if _is_plain(a, b, pose=step.kind == "pose")]
                plain |= {a.name: b for a, b in short}
                turn = isinstance(e.left, sp.MatrixSymbol)
                if step.kind == "pose" and pairs and len(short) == len(pairs) and not turn:
                    continue
            lines.append(Equation(e.left, right))
        lines = [e for e in lines if step.kind == "form" or not _is_empty(e.right)]
        if lines or step.kind not in ("pose", "equations", "solution"):
            found.append(replace(step, equations=tuple(lines)))
    return tuple(found)


def _entries(left: Expr, right: Expr) -> list[tuple[Expr, Expr]]:
    """What an equation defines: a symbol, those of a column, the entries of a rotation W."""
    if not isinstance(right, sp.MatrixBase):
        return [(left, right)]
    if isinstance(left, sp.MatrixSymbol) and right.shape == (3, 3):
        left = sp.Matrix(3, 3, lambda i, j: sp.Symbol(f"{left.name},{AXES[i]}{AXES[j]}"))
    return list(zip(left, right, strict=True)) if isinstance(left, sp.MatrixBase) else []


def _is_empty(e: Expr) -> bool:
    """Whether it is a matrix without rows, as where no freedom is left."""
    return isinstance(e, sp.MatrixBase) and 0 in e.shape


def _is_plain(symbol: Expr, value: Expr, *, pose: bool) -> bool:
    return symbol.is_Symbol and (value.is_Number or (pose and value.is_Symbol))


def _filled(e: Expr, plain: Mapping[str, Expr]) -> Expr:
    """An expression with values for those of its symbols that have one."""
    known = {s: plain[s.name] for s in e.free_symbols if s.name in plain}
    if not known:
        return e
    return (
        e.applyfunc(lambda x: x.xreplace(known))
        if isinstance(e, sp.MatrixBase)
        else e.xreplace(known)
    )


def numbered(steps: Sequence[Step], start: int = 1) -> tuple[Step, ...]:
    """Steps with numbers in brackets, from `start`, for those that have none."""
    found, n = [], start
    for step in steps:
        found.append(step if step.number else replace(step, number=f"({n})"))
        n += not step.number
    return tuple(found)


def at_detail(steps: Sequence[Step], detail: Detail) -> tuple[Step, ...]:
    """The steps of a level, numbered without gaps. The handout's numbers stay, and so do those of
    steps that speak of one that is left out.
    """
    last = DETAILS.index(detail)
    shown = tuple(step for step in steps if DETAILS.index(LEVELS[step.kind]) <= last)
    left_out = [step.number for step in steps if step not in shown]
    spoken_of = any(number in step.words for step in shown for number in left_out)
    own = all(re.fullmatch(r"(\(\d+\))?", step.number) for step in steps)
    return renumbered(shown) if own and not spoken_of else shown


def renumbered(steps: Sequence[Step]) -> tuple[Step, ...]:
    """Steps counted from one, but for an introduction; references in their words too."""
    of: dict[int, int] = {}
    count = 0
    own = []
    for step in steps:
        ends = [int(x) for x in re.findall(r"\((\d+)\)", step.number)]
        count += step.kind != "introduction"
        own.append(f"({count})" if step.kind != "introduction" else "")
        for n in range(ends[0], ends[-1] + 1) if ends else ():
            of.setdefault(n, count)

    def said(match: re.Match[str]) -> str:
        found = sorted({of[int(x)] for x in re.findall(r"\d+", match[0]) if int(x) in of})
        return " and ".join(f"({i})" for i in found) or match[0]

    pattern = re.compile(r"\(\d+\)(?:(?:, | to | and )\(\d+\))*")
    return tuple(
        replace(step, number=number, words=pattern.sub(said, step.words))
        for number, step in zip(own, steps, strict=True)
    )
