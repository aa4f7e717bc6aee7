"""What the closed form divides by: it can vanish at no pose, and here is why."""

from functools import cache

import numpy as np
import pytest
import sympy as sp
from campaign import BUILT_IN, some
from mechanisms import REPORTED, SEEDS, Scene, compiled, random_tree
from spatial_newton_euler import mass_matrix, velocities_of

from eomgen.derivation.handout.closed import Equations, derive
from eomgen.derivation.symbols import OF_SCENE
from eomgen.model.elaborate import elaborate
from eomgen.scene.reader import parse_scene

POSITIVE, NONNEGATIVE = "positive", "nonnegative"
FIVE_BODIES = some((8,), (4, 7, 8))
SCENES = [
    *(REPORTED[name] for name in BUILT_IN),
    *(random_tree(seed) for seed in SEEDS),
    *(random_tree(seed, 5) for seed in FIVE_BODIES),
]
every_scene = pytest.mark.parametrize(
    "scene", SCENES, ids=lambda scene: f"{scene.name}_{len(scene.tree.bodies)}"
)


@cache
def derived(scene: Scene) -> Equations:
    """The derivation alone, without a program."""
    if not scene.text or len(scene.tree.bodies) < 5:
        return compiled(scene).equations
    return derive(elaborate(parse_scene(scene.text)))


class Signs:
    """Decides what is positive from its form alone: positive symbols, even powers, sums, products.

    A symbol that is defined has the sign of what it stands for; SymPy's assumptions are not asked.
    An even power of what moves is nonnegative only; one of parameters alone is positive, as long as
    the scene's values do not make it 0.
    """

    def __init__(self, equations: Equations, scene: Scene) -> None:
        self._meaning = dict(equations.solution.definitions)
        self._positive = scene.positive
        self._values = {
            symbol: scene.tree.parameters[name]
            for name, symbol in equations.symbols.parameters.items()
        }
        self._known: dict[sp.Expr, str | None] = {}

    def of(self, expression: sp.Expr) -> str | None:
        """`positive`, `nonnegative`, or None if neither is plain to see."""
        if expression not in self._known:
            self._known[expression] = self._of(expression)
        return self._known[expression]

    def _of(self, e: sp.Expr) -> str | None:
        if e in self._meaning:
            return self.of(self._meaning[e])
        if e.is_Symbol:
            return POSITIVE if e.name.removesuffix(OF_SCENE) in self._positive else None
        if e.is_Number:
            return POSITIVE if e > 0 else None
        parts = [self.of(part) for part in e.args]
        if e.is_Add and None not in parts:
            return POSITIVE if POSITIVE in parts else NONNEGATIVE
        if e.is_Mul and None not in parts:
            return NONNEGATIVE if NONNEGATIVE in parts else POSITIVE
        if e.is_Pow and e.exp.is_Integer:
            if parts[0] == POSITIVE:
                return POSITIVE
            if e.exp % 2 == 0:
                if self._fixed_and_not_zero(e.base):
                    return POSITIVE
                return NONNEGATIVE if e.exp > 0 else None
        return None

    def _fixed_and_not_zero(self, e: sp.Expr) -> bool:
        while any(symbol in self._meaning for symbol in e.free_symbols):
            e = e.xreplace(self._meaning)
        return e.free_symbols <= {*self._values} and e.xreplace(self._values) != 0


def denominators(expression: sp.Expr) -> list[sp.Expr]:
    """Everything with a negative exponent, turned over."""
    return [1 / power for power in expression.atoms(sp.Pow) if not power.exp.is_nonnegative]


@pytest.mark.every(3)
@every_scene
def test_denominators_are_sums_of_positive_terms(scene: Scene) -> None:
    """Whatever the closed form divides by is built of positive terms: no pose makes it vanish."""
    equations = derived(scene)
    signs = Signs(equations, scene)
    found = 0
    for symbol, meaning in equations.solution.definitions:
        for base in denominators(meaning):
            found += 1
            assert signs.of(base) == POSITIVE, f"{symbol} divides by {base}"
    assert found >= len(scene.tree.bodies)
    for pivot in equations.solution.pivots:
        assert signs.of(pivot) == POSITIVE


def test_the_checker_refuses_what_can_vanish() -> None:
    """Differences, odd powers and waves that can be 0 together with all else are seen."""
    scene = REPORTED["two_body"]
    equations = derived(scene)
    signs = Signs(equations, scene)
    parameters = equations.symbols.parameters
    m, length, theta = parameters["m_A"], parameters["l_A"], equations.symbols.q[2]
    for good in (m, m + length**2, m + sp.sin(theta) ** 2, 3 / (m + theta**4), m / length**2):
        assert signs.of(good) == POSITIVE
    for bad in (
        length,
        m - length**2,
        sp.sin(theta) ** 2,
        m * sp.cos(theta) ** 2,
        m + length,
        m / theta**2,
    ):
        assert signs.of(bad) != POSITIVE
    assert {*denominators(m / (1 + theta) + 1 / sp.sqrt(m))} == {1 + theta, sp.sqrt(m)}


def pivots(equations: Equations, scene: Scene, poses: np.ndarray) -> np.ndarray:
    """Every pivot at poses (coordinates, k), by NumPy: (pivots, k)."""
    values: dict[sp.Expr, object] = {
        symbol: scene.tree.parameters[name] for name, symbol in equations.symbols.parameters.items()
    }
    s = equations.symbols
    turned = dict(zip((c.name for c in equations.model.coordinates), poses, strict=True))
    angle: list[np.ndarray] = []
    for body, symbol in zip(equations.model.bodies, s.angle, strict=True):
        base = angle[body.parent] if body.parent >= 0 else 0.0
        angle.append(base + turned[body.positions[-1].name])
        values[symbol] = angle[-1]
    meaning = dict(equations.solution.definitions)

    def value(symbol: sp.Expr) -> object:
        if symbol not in values:
            names = sorted(meaning[symbol].free_symbols, key=str)
            function = sp.lambdify(names, meaning[symbol], "numpy")
            values[symbol] = function(*(value(name) for name in names))
        return values[symbol]

    rows = [
        value(p) if p.is_Symbol else float(p.xreplace(values)) for p in equations.solution.pivots
    ]
    return np.array([np.broadcast_to(row, poses.shape[1:]) for row in rows])


def squared(equations: Equations) -> list[int]:
    """How often each pivot counts: a floating tree's mass, the first of its pivots, twice."""
    counts: list[int] = []
    members: dict[int, list[int]] = {}
    for k, body in enumerate(equations.model.bodies):
        root = k
        while equations.model.bodies[root].parent >= 0:
            root = equations.model.bodies[root].parent
        members.setdefault(root, [2] if body.joint.type == "free" else []).append(1)
    for tree in members.values():
        counts += tree
    return counts


def poses_of(equations: Equations, rng: np.random.Generator, count: int) -> np.ndarray:
    """Random poses, the first of them at multiples of π/4: (coordinates, count)."""
    n = len(equations.symbols.q)
    poses = rng.uniform(-2 * np.pi, 2 * np.pi, (n, count))
    half = count // 2
    poses[:, :half] = rng.integers(8, size=(n, half)) * (np.pi / 4)
    return poses


@pytest.mark.every(2)
@every_scene
def test_pivots_multiply_to_the_determinant(scene: Scene) -> None:
    """Their product is det M, the mass of a floating tree counted for x and for y.

    M comes from the independent solver, by the bodies' velocities.
    """
    equations = derived(scene)
    poses = poses_of(equations, np.random.default_rng(42), 12)
    found = pivots(equations, scene, poses)
    product = np.prod(found.T ** squared(equations), axis=1)
    names = [c.name for c in equations.model.coordinates]
    for i, pose in enumerate(poses.T):
        q = pose[[names.index(name) for name in scene.tree.coordinates]]
        mass = mass_matrix(scene.tree, q, velocities_of(scene.tree, q))
        assert product[i] == pytest.approx(np.linalg.det(mass), rel=1e-10)
