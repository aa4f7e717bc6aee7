"""Who loses how many digits where: every route, `numpy.linalg.solve`, MuJoCo, Pinocchio.

    python tests/campaigns/lost_digits.py [-o FOLDER] [--states N] [--only WORD]

For each mechanism the error of v̇, relative to its largest component, at seeded states, against 60
digits at exactly the same doubles: a table (text and CSV) and a figure. An engine that is not
installed, or that refuses a mechanism, is left out of its rows.
"""

import argparse
import csv
import math
import random
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

sys.path.append(str(Path(__file__).parent.parent))

import judges
import numpy as np
from matplotlib.figure import Figure
from spatial_trees import ORIGIN, PLANE, SPACE, SpatialTree, TreeBody, TreeJoint

from eomgen.model.elaborate import elaborate
from eomgen.pipeline import compile_program, python_module
from eomgen.run.module import load_module
from eomgen.scene.reader import parse_scene
from eomgen.show.style import FAINT, INK, style
from eomgen.study.verification.truth import Truth

WAYS = ("closed", "ldl", "aba", "orthogonal", "linalg.solve", "MuJoCo", "Pinocchio")
FEW = 3
"""Bodies up to which the closed form is asked, too."""
EPSILON = 2.0**-53
ANGLES: dict[str, Callable[[random.Random], float]] = {
    "random": lambda r: r.uniform(-6, 6),
    "straight": lambda r: 0.0,
    "quarter turns": lambda r: r.randrange(-4, 5) * (math.pi / 2),
    "eighths of turns": lambda r: r.randrange(-8, 9) * (math.pi / 4),
}


@dataclass(frozen=True)
class Case:
    """A mechanism, what its states are like, and how many of them are judged."""

    name: str
    tree: SpatialTree
    angles: str = "random"
    share: float = 1.0


# Mechanisms.


def body(
    k: int, dimensions: int, mass: float, kind: str, parent: int, r: random.Random
) -> TreeBody:
    """A body of about half a metre; general arms, axes along coordinate axes."""
    ends = [[round(r.uniform(-0.5, 0.5), 3) for _ in range(3)] for _ in range(2)]
    moments = [round(r.uniform(0.04, 0.06), 3) * mass for _ in range(3)]
    axis = [0.0, 0.0, 0.0]
    axis[2 if dimensions == PLANE else k % 3] = 1.0
    if dimensions == PLANE:
        ends = [[*end[:2], 0.0] for end in ends]
        moments[:2] = [0.0, 0.0]
    name = f"j{k}"
    coordinates: tuple[str, ...] = (f"{name}_angle",)
    if kind == "free":
        ends, coordinates = [[*ORIGIN], [*ORIGIN]], tuple(f"b{k}_{x}" for x in ("x", "y", "angle"))
    if kind == "prismatic":
        axis, coordinates = [1.0, 0.0, 0.0], (f"{name}_slide",)
    velocities = tuple(f"{own}_dot" for own in coordinates)
    places: tuple[Any, Any] = (tuple(ends[0]), tuple(ends[1]))
    joint = TreeJoint(
        name, kind, parent, *places, ORIGIN, (tuple(axis),), 0.0, coordinates, velocities
    )
    return TreeBody(f"b{k}", mass, (*moments, 0.0, 0.0, 0.0), joint)


def tree(
    dimensions: int,
    masses: Sequence[float],
    seed: int,
    *,
    straight: float = 1.0,
    first: str = "revolute",
) -> SpatialTree:
    """Bodies on hinges under gravity; each hangs on the last with probability `straight`."""
    r = random.Random(seed)
    bodies: list[TreeBody] = []
    for k, mass in enumerate(masses):
        near = k - 1 if r.random() < straight else r.randrange(k) if k else -1
        bodies.append(body(k, dimensions, mass, "revolute" if k else first, near, r))
    return SpatialTree(f"tree_{seed}", dimensions, tuple(bodies), 9.81, -1, (), (), {})


def text(tree: SpatialTree) -> str:
    """The same as a scene."""
    lines = [f'name = "{tree.name}"\ndimensions = {tree.dimensions}']
    lines.append(f'[[effects]]\ntype = "gravity"\ng = {tree.gravity}')
    space = tree.dimensions == SPACE
    for own in tree.bodies:
        joint, moments = own.joint, [*own.inertia[:3]]
        lines.append(f'[[bodies]]\nname = "{own.name}"\nmass = {own.mass!r}')
        lines.append(f"inertia_com = {moments if space else moments[2]}")
        lines.append(f'[[joints]]\nname = "{joint.name}"\ntype = "{joint.kind}"')
        lines.append(f'child = "{own.name}"')
        if joint.kind != "free":
            above = "world" if joint.parent < 0 else tree.bodies[joint.parent].name
            ends = ([*end][: tree.dimensions] for end in (joint.r_parent, joint.r_child))
            lines.append('parent = "{}"\nr_parent = {}\nr_child = {}'.format(above, *ends))
        if space or joint.kind == "prismatic":
            lines.append(f"axis = {[*joint.axes[0]][: tree.dimensions]}")
    return "\n".join(lines)


def cases() -> Iterator[Case]:
    """From harmless to hard."""
    tip = [1.0] * 5
    anywhere = [10 ** random.Random(seed).uniform(-12, 12) for seed in range(12)]
    for name, dimensions in (("plane", PLANE), ("space", SPACE)):
        for words, masses in (
            ("6 equal links", [1.0] * 6),
            ("6 links, tip 1e4", [*tip, 1e4]),
            ("6 links, tip 1e8", [*tip, 1e8]),
            ("6 links, tip 1e12", [*tip, 1e12]),
            ("6 links, ×100 outward", [100.0**k for k in range(6)]),
            ("6 links, ×1/100 outward", [100.0**-k for k in range(6)]),
            ("6 links, one of 1e12 amid", [1.0, 1.0, 1e12, 1.0, 1.0, 1.0]),
            ("6 links, 1e-12 and 1e12 in turn", [1e-12, 1e12] * 3),
        ):
            yield Case(f"{name}: {words}", tree(dimensions, masses, 1))
        for angles in ANGLES:
            hard = tree(dimensions, anywhere, 2)
            yield Case(f"{name}: 12 links over 24 decades, {angles}", hard, angles)
        for words, masses in (("", anywhere), (", heavier outwards", sorted(anywhere))):
            branching = tree(dimensions, masses, 3, straight=0.4)
            yield Case(f"{name}: tree of 12 over 24 decades{words}", branching)
    for masses in ([1.0, 1e12], [1e12, 1.0]):
        pair = tree(PLANE, masses, 4, first="free")
        yield Case("two free bodies, {:g} and {:g} kg".format(*masses), pair)
    for masses in ([1e-6, 1.0], [1e-12, 1e12]):
        cart = tree(PLANE, masses, 5, first="prismatic")
        yield Case("cart of {:g} kg, pole of {:g} kg".format(*masses), cart)
    for count in (30, 100, 200):
        for angles in ("straight", "random"):
            chain = tree(PLANE, [1.0] * count, 6)
            yield Case(f"plane: {count} equal links, {angles}", chain, angles, 0.1)


# Errors.


def errors(case: Case, states: int) -> dict[str, list[float]]:
    """Of each way that answers, at each state; nan where the answer is no number."""
    r = random.Random(case.name)
    angle, count = ANGLES[case.angles], max(3, round(states * case.share))
    model = elaborate(parse_scene(text(case.tree)))
    n = len(case.tree.velocities)
    q = np.array([[angle(r) for _ in range(n)] for _ in range(count)])
    v = np.array([[r.uniform(-3, 3) for _ in range(n)] for _ in range(count)])
    true = Truth(model)(np.zeros(count), np.hstack([q, v]))

    def judged(found: Callable[[Any, Any], Any]) -> list[float]:
        return [_off(found(*at), true[:, k]) for k, at in enumerate(zip(q, v, strict=True))]

    found = {}
    for route in WAYS[:4]:
        if route == "closed" and len(case.tree.bodies) > FEW:
            continue
        made = compile_program(replace(model, route=route), jacobian=False).system
        module: Any = load_module(python_module(made), model.name)
        found[route] = judged(lambda q, v, m=module: m.derivative(0.0, [*q, *v])[n:])
    terms = ("mass_matrix", "bias_force", "applied_force")
    made = compile_program(replace(model, route="aba", outputs=terms), jacobian=False).system
    module = load_module(python_module(made), model.name)

    def solved(q: Any, v: Any) -> Any:
        matrix, bias, applied = (getattr(module, name)(0.0, [*q, *v]) for name in terms)
        return np.linalg.solve(matrix, applied - bias)

    found["linalg.solve"] = judged(solved)
    order = [module.STATES.index(name) for name in case.tree.coordinates]
    for name in WAYS[5:]:
        ask = getattr(judges, f"{name.lower()}_accelerations")
        try:
            found[name] = judged(lambda q, v, ask=ask: _placed(ask, case.tree, q, v, order))
        except (judges.Unsuitable, ImportError) as reason:
            print(f"{case.name}: {name}: {reason}", file=sys.stderr)
    return found


def _placed(ask: Any, tree: SpatialTree, q: Any, v: Any, order: Sequence[int]) -> Any:
    """What a judge says, who orders bodies otherwise: `order` is the place of each of his."""
    found = np.empty_like(v)
    found[order] = ask(tree, q[order], v[order])
    return found


def _off(found: Any, true: Any) -> float:
    if not np.isfinite(found).all():
        return math.nan
    apart = max(abs(x - float(y)) for x, y in zip(true, found, strict=True))
    return float(apart / max(abs(x) for x in true))


def lost(errors: Sequence[float]) -> float:
    """Digits lost at the worst state of 15.95."""
    worst = max(math.inf if math.isnan(error) else error for error in errors)
    return min(max(math.log10(worst / EPSILON), 0.0), 16.0) if worst else 0.0


# What is shown.


def figure(rows: Sequence[tuple[str, dict[str, list[float]]]]) -> Figure:
    """Digits lost as shades, the worst error in words."""
    with style():
        made = Figure(figsize=(9.5, 0.6 + 0.235 * len(rows)), layout="constrained")
        axes = made.add_subplot()
        shades = np.full((len(rows), len(WAYS)), np.nan)
        for i, (_, found) in enumerate(rows):
            for j, way in enumerate(WAYS):
                if way in found:
                    shades[i, j] = digits = lost(found[way])
                    words = f"{max(found[way]):.0e}" if digits < 16 else "none left"
                    ink = "white" if digits > 9 else INK
                    axes.text(j, i, words, ha="center", va="center", color=ink, fontsize=8)
                else:
                    axes.text(j, i, "–", ha="center", va="center", color=FAINT, fontsize=8)
        shown = axes.imshow(shades, cmap="YlOrRd", vmin=0, vmax=16, aspect="auto")
        axes.set_xticks(range(len(WAYS)), WAYS)
        axes.set_yticks(range(len(rows)), [name for name, _ in rows], fontsize=8)
        axes.xaxis.tick_top()
        axes.grid(visible=False)
        made.colorbar(shown, label="digits lost at the worst state", fraction=0.03, pad=0.01)
        return made


def main() -> None:
    """The table, then the figure."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("-o", type=Path, default=Path("out"))
    parser.add_argument("--states", type=int, default=40)
    parser.add_argument("--only", default="", help="cases with this in their name")
    given = parser.parse_args()
    given.o.mkdir(parents=True, exist_ok=True)
    rows = []
    print(f"{'median / worst error':<46}" + "".join(f"{way:>20}" for way in WAYS))
    with (given.o / "lost_digits.csv").open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file)
        table.writerow(["case", "way", "states", "median", "worst"])
        for case in cases():
            if given.only not in case.name:
                continue
            found = errors(case, given.states)
            cells = []
            for way in WAYS:
                own = found.get(way)
                cells.append(f"{np.median(own):.1e} / {max(own):.1e}" if own else "–")
                if own:
                    table.writerow([case.name, way, len(own), np.median(own), max(own)])
            print(f"{case.name:<46}" + "".join(f"{cell:>20}" for cell in cells), flush=True)
            rows.append((case.name, found))
    figure(rows).savefig(given.o / "lost_digits.png")


if __name__ == "__main__":
    main()
