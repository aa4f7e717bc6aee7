"""The same mechanism by every method, side by side, and what agrees and what differs."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import sympy as sp

from eomgen.derivation.exposition import exposition_of
from eomgen.derivation.identity import identical
from eomgen.derivation.own_names import names_within
from eomgen.derivation.reading import numbered, read
from eomgen.derivation.simplified import size
from eomgen.derivation.steps import Equation, Step
from eomgen.derivation.symbols import Expr
from eomgen.derivation.telling import Exposition
from eomgen.model.model import Model
from eomgen.scene.schema import Form
from eomgen.tables.details import METHODS, Method

TERMS = ("Velocity forces", "Gravity forces", "Applied forces")
"""Titles of steps in which a method ends, one for each term of the equations of motion."""
BEFORE = ("introduction", "state", "bodies", "joint", "motion", "effect", "constraint", "algorithm",
          "force", "variant")  # fmt: skip
"""Kinds of steps that stand before the columns if all methods have them."""
WIDEST = 160
"""The size of an equation of motion up to which it is written in one line."""
LINES = " Line by line:"
SAME = (
    "By every method this is M dv/dt + V + G = F with the same M, V, G and F. M is what is left of "
    "Newton's and Euler's equations once the joints' forces are out, the matrix of T = ½ vᵀ M v, "
    "and the sum of the products of the partial velocities. Line by line:"
)
SAME_TREE = (
    "By every method this is M dv/dt + V + G = F with the same M, V, G and F, those of the tree "
    "without its constraints. M is what is left of Newton's and Euler's equations once the joints' "
    "forces are out, the matrix of T = ½ vᵀ M v, and the sum of the products of the partial "
    "velocities. What the constraints leave free follows from it below, by each method in the same "
    "way."
)
SAME_ALGORITHM = (
    "By every method this is M dv/dt + h_0 = 0 with the same M and the same h_0 = V + G - F. In "
    "the columns of P there is S of each joint before a body, carried to it by X. So the sum of "
    "PᵀI P over the bodies behind a joint is Sᵀ(Σ XᵀI X) S, and the sum in brackets is I^c, the "
    "inertia of all that hangs on the joint: Newton and Euler go over the bodies once for what the "
    "sums of Kane and Lagrange say. In Lagrange's V, N - D is - v × P for all joints but balls, so "
    "that each of its terms is Kane's Pᵀ(I σ + v ×* H); for a ball ω × ∂T/∂ω makes up for the rest."
)


def compared(model: Model, form: Form | None = None) -> Exposition:
    """A model by all methods: what they share once, the rest of each as a column.

    Raises `SceneError` for a form that the mechanism has by one method only.
    """
    ways = [exposition_of(model, form, method, shared="written") for method in METHODS]
    if len({_is_written(model, found) for found in ways}) > 1:
        ways = [exposition_of(model, form, method, shared="algorithm") for method in METHODS]
    every = [[*found.steps] for found in ways]
    after = _shared_end(every)
    columns = [steps[: len(steps) - len(after)] for steps in every]
    before = [s for s in columns[0] if s.kind in BEFORE and all(_has(x, s) for x in columns)]
    columns = [[s for s in steps if not _has(before, s)] for steps in columns]
    agree = Step("equations", "What agrees", *_agreement(model, columns))
    differ = Step("equations", "What differs", _differences(model, columns), ())
    steps = _numbered(before, dict(zip(METHODS, columns, strict=True)), [agree, differ, *after])
    return replace(ways[0], steps=tuple(steps), method="all")


def _is_written(model: Model, found: Exposition) -> bool:
    """Whether M, V, G and F are written out, if only those of a tree."""
    lefts = {str(line.left) for step in found.steps for line in step.equations}
    names = names_within(model)
    return lefts.issuperset(names.get(letter, letter) for letter in "MVGF")


def _has(steps: Sequence[Step], step: Step) -> bool:
    """Whether a step is among others, whatever its number."""
    return any(replace(x, number=step.number) == step for x in steps)


def _shared_end(every: Sequence[Sequence[Step]]) -> list[Step]:
    """The steps in which all end, from behind the equations of motion on."""
    found: list[Step] = []
    for steps in zip(*(reversed(x) for x in every), strict=False):
        step = steps[0]
        if step.title in TERMS or not all(_has([x], step) for x in steps):
            break
        found.insert(0, step)
    return found


def _agreement(model: Model, columns: Sequence[Sequence[Step]]) -> tuple[str, tuple[Equation, ...]]:
    """In what all methods end: words, and the equations of motion one by one.

    Raises `ArithmeticError` if they do not.
    """
    lines = [{str(e.left): e.right for s in x for e in s.equations} for x in columns]
    names = names_within(model)
    letters = [names.get(letter, letter) for letter in "MVGF"]
    if not all(letter in found for letter in letters for found in lines):
        return SAME_ALGORITHM, ()
    first, *others = lines
    for other in others:
        pairs = [pair for x in letters for pair in zip(first[x], other[x], strict=True)]
        if not identical([(a, b) for a, b in pairs if a != b]):
            raise ArithmeticError(f"the methods do not agree on the equations of {model.name}")
    M, V, G, F = (first[letter] for letter in letters)
    a = sp.Matrix([read(sp.Symbol(c.acceleration), names) for c in model.velocities])
    rows = [Equation(x, y) for x, y in zip(M * a + V + G, F, strict=True)]
    words = SAME_TREE if model.constraints else SAME
    if max(size(row.left) for row in rows) > WIDEST:
        return words.removesuffix(LINES), ()
    return words, tuple(rows)


def _differences(model: Model, columns: Sequence[Sequence[Step]]) -> str:
    """What each method needs and gives, with counts."""
    plane = 3 if model.dimensions == 2 else 6
    n, bodies = len(model.velocities), len(model.bodies)
    equations = plane * bodies
    before = 0
    for k in range(bodies):
        while k >= 0:
            before += len(model.bodies[k].velocities)
            k = model.bodies[k].parent
    newton, lagrange, kane = map(_cost, columns)
    each = "one equation for each velocity" if n > 1 else "one equation"
    words = [
        f"- Newton and Euler: {equations} equations, {plane} for each body, with "
        f"{_counted(equations - n, 'component')} of forces and torques of joints beside "
        f"{_counted(n, 'acceleration')}. The joints' forces have to be eliminated, and so they "
        f"are known. {newton}",
        f"- Lagrange: {n} equations, {each}, without the joints' forces and without accelerations "
        f"of bodies, but with derivatives to take: of T by {_counted(n, 'velocity')}, by the "
        f"coordinates and by the time, and of U by the coordinates. {lagrange}",
        f"- Kane: {n} equations, {each}, without the joints' forces and with no energy to "
        f"differentiate, but with accelerations of bodies and {before} partial motions: one for "
        f"each body and each velocity of the joints before it. {kane}",
    ]
    if model.constraints:
        rows = len(model.rows)
        words.append(
            f"- The constraints have {_counted(rows, 'force')} of their own, the multipliers λ. "
            "No method needs them for the motion."
        )
    return "\n".join(words)


def _counted(n: int, word: str) -> str:
    plural = word.removesuffix("y") + "ies" if word.endswith("y") else word + "s"
    return f"{n} {word if n == 1 else plural}"


def _cost(steps: Sequence[Step]) -> str:
    """How long the lines of a column are."""
    lines = [line for step in steps for line in step.equations]
    if any(line.right.is_Matrix and not isinstance(line.right, sp.MatrixBase) for line in lines):
        return f"Its column has {len(lines)} lines of vectors and matrices."
    total = sum(int(sp.count_ops(e)) for line in lines for e in _entries(line.right))
    return f"The lines of its column have {total} operations."


def _entries(e: Expr) -> Sequence[Expr]:
    return list(e) if isinstance(e, sp.MatrixBase) else [e]


def _numbered(
    before: Sequence[Step], columns: Mapping[Method, Sequence[Step]], after: Sequence[Step]
) -> Iterator[Step]:
    """All steps; those of one place in their columns have the same number."""
    first = [replace(s, number="") for s in before]
    yield from numbered(first)
    n = len(before)
    last = n
    for method, steps in columns.items():
        ways = [s for s in steps if s.kind in ("balance", "algorithm")]
        for i, step in enumerate(ways, 1):
            number = f"({n + 1}.{i})" if len(ways) > 1 else f"({n + 1})"
            yield replace(step, number=number, way=method)
        rest = [s for s in steps if s not in ways]
        for i, step in enumerate(rest, n + 2):
            yield replace(step, number=f"({i})", way=method)
        last = max(last, n + 1 + len(rest))
    yield from numbered([replace(s, number="") for s in after], last + 1)
