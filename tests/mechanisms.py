"""Scenes for tests, written twice: as eomgen reads them, and as plain numbers for
`newton_euler`."""

import itertools
import types
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from campaign import some
from engine import Engine
from newton_euler import Mechanism, Motion, solve

from eomgen.codegen.from_equations import from_equations
from eomgen.codegen.system import optimised
from eomgen.derivation.handout.closed import Equations, derive
from eomgen.model.elaborate import elaborate
from eomgen.pipeline import python_module
from eomgen.scene.reader import parse_scene, read_scene

BUILT_IN = ("double_pendulum", "pendulum", "two_body", "two_body_forced")
"""The built-in scenes whose route is `closed`: SymPy's equations are there to be looked into."""
SEEDS = some((4, 9, 15, 18, 27, 36), (4, 9, 15, 18, 20, 22, 27, 34, 36, 37, 38, 39))
"""Random trees that are quick to compile and of every kind; see `random_tree`."""


@dataclass(frozen=True, eq=False, repr=False)
class Scene:
    """A scene in plain numbers, written without eomgen.

    `numbers` turns parameter values and inputs, by name, into a mechanism. `bodies`, `pins` (the
    joint of each body that has one) and `coordinates` are names in the mechanism's order, `angles`
    the coordinates that are angles; `defaults` are the parameters, `positive` those that make a
    mass or an inertia. `text` is TOML, or None for a scene that comes with eomgen.
    """

    name: str
    bodies: tuple[str, ...]
    pins: tuple[str | None, ...]
    coordinates: tuple[str, ...]
    angles: tuple[str, ...]
    inputs: tuple[str, ...]
    defaults: Mapping[str, float]
    positive: frozenset[str]
    numbers: Callable[[Mapping[str, float], Mapping[str, float]], Mechanism]
    text: str | None = None

    def motion(
        self,
        module: types.ModuleType,
        y: np.ndarray,
        p: Mapping[str, float] | None = None,
        u: Mapping[str, float] | None = None,
    ) -> Motion:
        """The independent solver's word on the state `y` of a module in velocity form."""
        q, v = y[self.places(module)], y[self.places(module, "_dot")]
        return solve(self.mechanism(p, u), q, v)

    def mechanism(
        self, p: Mapping[str, float] | None = None, u: Mapping[str, float] | None = None
    ) -> Mechanism:
        """The mechanism where some parameters are not the scene's own, and some inputs not 0."""
        p, u = {**self.defaults, **(p or {})}, {**dict.fromkeys(self.inputs, 0.0), **(u or {})}
        return self.numbers(p, u)

    def places(self, module: types.ModuleType, suffix: str = "") -> list[int]:
        """Where a module's state holds the coordinates, or with `_dot` the velocities."""
        return [module.STATES.index(name + suffix) for name in self.coordinates]

    def pin_rows(self, module: types.ModuleType) -> list[int]:
        """The body of each of a module's JOINTS."""
        return [self.pins.index(name) for name in module.JOINTS]

    def body_rows(self, module: types.ModuleType) -> list[int]:
        """The index here of each of a module's BODIES."""
        return [self.bodies.index(name) for name in module.BODIES]

    def random_state(self, module: types.ModuleType, rng: np.random.Generator) -> np.ndarray:
        """Angles over two turns, everything else within ±8."""
        y = rng.uniform(-8.0, 8.0, len(module.STATES))
        angles = [module.STATES.index(name) for name in self.angles]
        y[angles] = rng.uniform(-2 * np.pi, 2 * np.pi, len(angles))
        return y

    def random_inputs(self, rng: np.random.Generator) -> dict[str, float]:
        """A value for every input."""
        return {name: float(rng.uniform(-9.0, 9.0)) for name in self.inputs}


@dataclass(frozen=True, eq=False, repr=False)
class Compiled(Engine):
    """A scene after every stage of eomgen, in plain numbers too."""

    scene: Scene
    equations: Equations


def compiled(scene: "Scene | str", form: str = "velocity") -> Compiled:
    """Compile a scene, or a built-in one by name, once; all outputs on; by the route `closed`."""
    return _compiled(REPORTED[scene] if isinstance(scene, str) else scene, form)


@cache
def _compiled(scene: Scene, form: str) -> Compiled:
    read = read_scene(scene.name) if scene.text is None else parse_scene(scene.text)
    model = replace(elaborate(read), form=form)
    if form == "velocity":
        equations = derive(model)
    else:  # the same equations, to be written in other states
        equations = replace(compiled(scene).equations, model=model)
    system = optimised(from_equations(equations))
    assert system.route == "closed"
    source = python_module(system)
    return Compiled(model, system, source, load(source), scene, equations)


def load(source: str) -> types.ModuleType:
    """Execute a generated module."""
    module = types.ModuleType("generated_by_eomgen")
    exec(compile(source, "<generated by eomgen>", "exec"), module.__dict__)
    return module


# The scenes that come with eomgen, written by hand.


def _two_body(p: Mapping[str, float], u: Mapping[str, float]) -> Mechanism:
    return Mechanism(
        mass=[p["m_A"], p["m_B"]],
        inertia=[p["I_A"], p["I_B"]],
        parent=[-1, 0],
        free=[True, False],
        r_parent=[[0.0, 0.0], [p["l_A"], 0.0]],
        r_child=[[0.0, 0.0], [-p["l_B"], 0.0]],
        gravity=p["g"],
    )


def _two_body_forced(p: Mapping[str, float], u: Mapping[str, float]) -> Mechanism:
    return replace(
        _two_body(p, u),
        torque=[0.0, u["tau"]],
        forces=(
            (0, [p["d_A"], 0.0], [u["f_A_x"], u["f_A_y"]]),
            (1, [p["d_B"], 0.0], [u["f_B_x"], u["f_B_y"]]),
        ),
    )


def _pendulum(p: Mapping[str, float], u: Mapping[str, float]) -> Mechanism:
    return Mechanism(
        mass=[p["bob_mass"]],
        inertia=[0.0],
        parent=[-1],
        free=[False],
        r_parent=[[0.0, 0.0]],
        r_child=[[p["pivot_r_child_x"], 0.0]],
        gravity=p["gravity_g"],
    )


def _double_pendulum(p: Mapping[str, float], u: Mapping[str, float]) -> Mechanism:
    return Mechanism(
        mass=[p["m_1"], p["m_2"]],
        inertia=[p["m_1"] * p["l_1"] ** 2 / 12, p["m_2"] * p["l_2"] ** 2 / 12],
        parent=[-1, 0],
        free=[False, False],
        r_parent=[[0.0, 0.0], [p["l_1"] / 2, 0.0]],
        r_child=[[-p["l_1"] / 2, 0.0], [-p["l_2"] / 2, 0.0]],
        gravity=p["g"],
    )


_HANDOUT = {"m_A": 1.0, "I_A": 0.12, "m_B": 0.6, "I_B": 0.05, "l_A": 0.6, "l_B": 0.5, "g": 9.81}
_TWO_BODIES = Scene(
    name="two_body",
    bodies=("A", "B"),
    pins=(None, "hinge"),
    coordinates=("x_A", "y_A", "theta", "phi"),
    angles=("theta", "phi"),
    inputs=(),
    defaults=_HANDOUT,
    positive=frozenset({"m_A", "m_B", "I_A", "I_B"}),
    numbers=_two_body,
)
REPORTED = {
    "two_body": _TWO_BODIES,
    "two_body_forced": replace(
        _TWO_BODIES,
        name="two_body_forced",
        inputs=("f_A_x", "f_A_y", "f_B_x", "f_B_y", "tau"),
        defaults={**_HANDOUT, "d_A": -0.6, "d_B": 0.5},
        numbers=_two_body_forced,
    ),
    "pendulum": Scene(
        name="pendulum",
        bodies=("bob",),
        pins=("pivot",),
        coordinates=("theta",),
        angles=("theta",),
        inputs=(),
        defaults={"bob_mass": 1.0, "pivot_r_child_x": -1.0, "gravity_g": 9.81},
        positive=frozenset({"bob_mass"}),
        numbers=_pendulum,
    ),
    "double_pendulum": Scene(
        name="double_pendulum",
        bodies=("upper", "lower"),
        pins=("shoulder", "elbow"),
        coordinates=("theta_1", "theta_2"),
        angles=("theta_1", "theta_2"),
        inputs=(),
        defaults={"m_1": 1.0, "m_2": 1.0, "l_1": 1.0, "l_2": 1.0, "g": 9.81},
        positive=frozenset({"m_1", "m_2"}),
        numbers=_double_pendulum,
    ),
}

# Random trees.

Value = Callable[[Mapping[str, float]], float]


class _Writer:
    """Writes quantities into a scene and remembers what each of them is worth."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.rng = rng
        self.shared = {"m": 0.9, "l": 0.55, "g": 9.81, "I": 0.04}
        self.named: dict[str, float] = {}
        self.positive: set[str] = {"m", "I"}

    def number(self, low: float, high: float, name: str) -> tuple[str, Value]:
        """A bare number, which becomes a parameter that is named after its place."""
        value = round(float(self.rng.uniform(low, high)), 3)
        self.named[name] = value
        return repr(value), lambda p: p[name]

    def mass(self, name: str) -> tuple[str, Value]:
        """A bare mass, the shared one, or a formula."""
        match self.rng.integers(5):
            case 0:
                return '"m"', lambda p: p["m"]
            case 1:
                return '"2*m"', lambda p: 2 * p["m"]
        self.positive.add(name)
        return self.number(0.4, 2.0, name)

    def inertia(self, name: str, *, may_vanish: bool) -> tuple[str, Value]:
        """A bare inertia, the shared one, a formula, or none: a point mass."""
        match self.rng.integers(5):
            case 0:
                return '"I"', lambda p: p["I"]
            case 1:
                return '"m*l**2/6 + I"', lambda p: p["m"] * p["l"] ** 2 / 6 + p["I"]
            case 2 if may_vanish:
                return "0", lambda p: 0.0
        self.positive.add(name)
        return self.number(0.02, 0.2, name)

    def length(self, name: str) -> tuple[str, Value]:
        """One component of a place: bare, 0, the shared length or a formula."""
        match self.rng.integers(6):
            case 0 | 1:
                return "0", lambda p: 0.0
            case 2:
                return '"l"', lambda p: p["l"]
            case 3:
                return '"-l/2"', lambda p: -p["l"] / 2
        sign = self.rng.choice([-1, 1])
        return self.number(*sorted((0.3 * sign, 0.8 * sign)), name)

    def point(self, name: str) -> tuple[str, list[Value]]:
        """Two components of a place."""
        (x, x_value), (y, y_value) = (self.length(f"{name}_{axis}") for axis in "xy")
        return f"[{x}, {y}]", [x_value, y_value]


@cache
def random_tree(seed: int, most: int = 4) -> Scene:
    """A mechanism of 2 to `most` bodies, from a seed.

    Chains and branches, one tree or several, on the world or floating; pins at points with one, two
    or no nonzero components; numbers bare, shared by name and by formula; with chance gravity, a
    motor and a force from outside. The scene lists bodies and joints in any order.
    """
    rng = np.random.default_rng([seed, most])
    writer = _Writer(rng)
    n = int(rng.integers(2, most + 1))
    parent = [-1] + [int(rng.integers(k)) if rng.random() < 0.85 else -1 for k in range(1, n)]
    free = [p < 0 and rng.random() < 0.5 for p in parent]
    bodies, joints, effects = [], [], []
    mass: list[Value] = []
    inertia: list[Value] = []
    r_parent: list[list[Value]] = []
    r_child: list[list[Value]] = []
    pins: list[str | None] = []
    coordinates: list[str] = []
    angles: list[str] = []
    nowhere: list[Value] = [lambda p: 0.0, lambda p: 0.0]
    for k in range(n):
        above = "world" if parent[k] < 0 else f"b{parent[k]}"
        joint = f'[[joints]]\nname = "j{k}"\nparent = "{above}"\nchild = "b{k}"\n'
        held_away = False
        if free[k]:
            joint += 'type = "free"\n'
            r_parent.append(nowhere)
            r_child.append(nowhere)
            pins.append(None)
            own = [f"b{k}_x", f"b{k}_y", f"b{k}_angle"]
        else:
            at_parent, values = writer.point(f"j{k}_r_parent")
            r_parent.append(values)
            at_child, values = writer.point(f"j{k}_r_child")
            r_child.append(values)
            held_away = at_child != "[0, 0]"
            joint += f'type = "revolute"\nr_parent = {at_parent}\nr_child = {at_child}\n'
            pins.append(f"j{k}")
            own = [f"j{k}_angle"]
            if rng.random() < 0.5:
                own = [f"q{k}"]
                joint += f'coordinate = "q{k}"\n'
        joints.append(joint)
        coordinates += own
        angles.append(own[-1])
        text, value = writer.mass(f"b{k}_mass")
        mass.append(value)
        body = f'[[bodies]]\nname = "b{k}"\nmass = {text}\n'
        text, value = writer.inertia(f"b{k}_inertia_com", may_vanish=held_away)
        inertia.append(value)
        bodies.append(body + f"inertia_com = {text}\n")

    gravity: Value = lambda p: 0.0  # noqa: E731
    if rng.random() < 0.8:
        effects.append('[[effects]]\ntype = "gravity"\ng = "g"\n')
        gravity = lambda p: p["g"]  # noqa: E731
    inputs: list[str] = []
    driven = [k for k in range(n) if not free[k]]
    motor = int(rng.choice(driven)) if driven and rng.random() < 0.6 else -1
    if motor >= 0:
        effects.append(
            f'[[effects]]\ntype = "motor"\nname = "drive"\njoint = "j{motor}"\ntorque = "input"\n'
        )
        inputs.append("drive")
    pushed = int(rng.integers(n)) if rng.random() < 0.6 else -1
    place = nowhere
    if pushed >= 0:
        at, place = writer.point("push_at")
        effects.append(
            f'[[effects]]\ntype = "external_force"\nname = "push"\nbody = "b{pushed}"\n'
            f'at = {at}\nforce = "input"\n'
        )
        inputs += ["push_x", "push_y"]

    def numbers(p: Mapping[str, float], u: Mapping[str, float]) -> Mechanism:
        forces = ()
        if pushed >= 0:
            forces = ((pushed, [value(p) for value in place], [u["push_x"], u["push_y"]]),)
        return Mechanism(
            mass=[value(p) for value in mass],
            inertia=[value(p) for value in inertia],
            parent=parent,
            free=free,
            r_parent=[[x(p), y(p)] for x, y in r_parent],
            r_child=[[x(p), y(p)] for x, y in r_child],
            gravity=gravity(p),
            torque=[u["drive"] if k == motor else 0.0 for k in range(n)],
            forces=forces,
        )

    tables = [*rng.permutation(bodies), *rng.permutation(joints), *effects]
    head = f'name = "tree_{seed}"\noutputs = "all"\n\n[parameters]\n'
    head += "".join(f"{name} = {value}\n" for name, value in writer.shared.items())

    return Scene(
        name=f"tree_{seed}",
        bodies=tuple(f"b{k}" for k in range(n)),
        pins=tuple(pins),
        coordinates=tuple(coordinates),
        angles=tuple(angles),
        inputs=tuple(inputs),
        defaults={**writer.shared, **writer.named},
        positive=frozenset(writer.positive),
        numbers=numbers,
        text="\n".join([head, *tables]),
    )


def quarter_poses(count: int) -> np.ndarray:
    """Every combination of `count` angles at the multiples of π/4 of one turn."""
    return np.array(list(itertools.product(np.arange(8) * (np.pi / 4), repeat=count)))
