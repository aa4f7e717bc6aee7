"""Coordinates that are given: driven joints, against the tests' own solver, undriven scenes,
published thresholds and closed forms.
"""

import math
from functools import cache
from itertools import product
from typing import Any

import numpy as np
import pytest
from campaign import some
from driven_trees import given
from engine import DERIVATIVES, MP, Digits, Engine, along, apart, engine, exact, slopes
from scipy.integrate import solve_ivp
from spatial_newton_euler import solve
from spatial_trees import PLANE, SPACE, SpatialTree, random_state

from eomgen.dynamics.dynamics import Dynamics, Values
from eomgen.dynamics.reactions import reactions
from eomgen.language.formula import parse
from eomgen.language.rates import with_rates
from eomgen.model.elaborate import elaborate
from eomgen.scalars.floats import FloatScalars
from eomgen.scalars.functions import FUNCTIONS
from eomgen.scene.reader import parse_scene

ROUNDING = 1e-11
"""What the recursions keep to in floats; of the trees here the worst is off by 2e-13."""
TREES = [*product((PLANE, SPACE), range(some(16, 120)))]
FEW = [(PLANE, 3), (PLANE, 38), (SPACE, 11), (SPACE, 14), (SPACE, 47)]
ROUTES = ("aba", "ldl")


@pytest.mark.every(8)
@pytest.mark.parametrize(("dimensions", "seed"), TREES)
def test_as_the_judge_has_it(dimensions: int, seed: int) -> None:
    """Accelerations by both routes and in both kinds of axes, driving forces, joint forces."""
    case = given(dimensions, seed, (6, 14, 30)[seed % 3])
    tree = case.tree
    model = elaborate(parse_scene(case.text))
    rng = np.random.default_rng(seed)
    (q, v), u, t = random_state(tree, rng), tree.random_inputs(rng), float(rng.uniform(0.0, 3.0))
    at, accelerations = case.values(t, math)
    q = np.array([at.get(c, x) for c, x in zip(tree.coordinates, q, strict=True)])
    v = np.array([at.get(c, x) for c, x in zip(tree.velocities, v, strict=True)])
    motion = solve(tree, q, v, u, accelerations)
    place = [tree.velocities.index(c.name) for c in model.velocities]
    assert len(place) == len(tree.velocities) - len(accelerations)
    state = dict(zip((*tree.coordinates, *tree.velocities), (*q, *v), strict=True))
    positions, velocities = (
        [state[c.name] for c in group] for group in (model.coordinates, model.velocities)
    )
    for axes in ("own", "world"):
        values = Values(model.defaults, u, positions, velocities, {}, t)
        d = Dynamics(model, values, FloatScalars(), axes)
        assert apart(d.articulated_forward(), motion.accelerations[place]) < ROUNDING
        assert apart(d.factored_forward(), motion.accelerations[place]) < ROUNDING
        if axes == "own":
            assert apart(d.orthogonal_forward(), motion.accelerations[place]) < ROUNDING
        forces = [motion.driving[c.velocity.name] for c in model.driven]
        assert apart(d.driving_forces, forces) < ROUNDING
        assert apart(d.kinetic_energy, motion.kinetic_energy) < ROUNDING
        held = [(b, f) for b, f in zip(model.holding, reactions(d, d.vd), strict=True)]
        held = [(b.joint.name, f) for b, f in held if b.joint.type != "free"]  # not in the judge
        wrenches = np.array([(*f.force, *f.moment) for _, f in held]).reshape(-1, 6)
        kept = [0, 1, 5] if dimensions == PLANE else range(6)
        expected = motion.joint_forces[tree.rows([name for name, _ in held])]
        assert apart(wrenches[:, kept], expected) < ROUNDING


def test_the_trees_are_given_much() -> None:
    """Driven and locked coordinates of all kinds occur often."""
    cases = [given(dimensions, seed, (6, 14, 30)[seed % 3]) for dimensions, seed in TREES]
    assert sum(len(case.driven) for case in cases) > some(40, 200)
    assert sum(len(case.locked) for case in cases) > some(40, 200)


# In 60 digits, as modules.


@cache
def made(dimensions: int, seed: int, route: str, *, tangents: bool = False) -> Engine:
    """A driven tree's module."""
    return engine(given(dimensions, seed, 5, locks=False).text, route, tangents=tangents)


def at_random(e: Engine, seed: int) -> tuple[np.ndarray, dict[str, float], Any]:
    """A state, inputs and a time."""
    rng = np.random.default_rng(seed)
    return e.random_state(rng), e.random_inputs(rng), MP.mpf(float(rng.uniform(0.0, 3.0)))


@pytest.mark.parametrize("route", ROUTES)
@pytest.mark.parametrize(("dimensions", "seed"), FEW)
@pytest.mark.every(8)
def test_as_the_undriven_scene(dimensions: int, seed: int, route: str) -> None:
    """At the same motion: M, V, G, F are its free rows, and f'' takes its part of M into V; the
    same forces keep the same motion; what else there is is the same.
    """
    case = given(dimensions, seed, 5, locks=False)
    e = engine(case.text, route, leave_out=DERIVATIVES)
    bare = engine(case.bare, "aba", leave_out=DERIVATIVES)
    y, u, t = at_random(e, seed)
    at, accelerations = case.values(t, MP)
    assert accelerations
    assert list(e.module.DRIVEN) == [position for position, _ in case.driven]
    at |= dict(zip(e.module.STATES, exact(y), strict=True))
    whole = [at[name] for name in bare.module.STATES]
    assert len(bare.module.STATES) == len(y) + 2 * len(accelerations)

    def both(name: str) -> tuple[np.ndarray, np.ndarray]:
        return e.exactly(name, y, u, t=t), bare.exactly(name, whole, u)

    names = [c.name for c in bare.model.velocities]
    free = [names.index(c.name) for c in e.model.velocities]
    driven = [names.index(velocity) for _, velocity in case.driven]
    given_up = exact([accelerations[names[i]] for i in driven])
    mass, all_mass = both("mass_matrix")
    digits = 1e-14 if turned(case.tree) else 1e-50
    assert apart(mass, all_mass[np.ix_(free, free)]) < digits
    force, all_force = both("velocity_force")
    assert apart(force, all_force[free] + all_mass[np.ix_(free, driven)] @ given_up) < digits
    for name in ("gravity_force", "applied_force"):
        own, others = both(name)
        assert apart(own, others[free]) < digits, name
    same = "kinetic_energy potential_energy momentum centre_of_mass body_poses body_velocities"
    points = ("point_positions", "point_velocities")
    for name in (*same.split(), *(name for name in points if name in e.model.outputs)):
        own, others = both(name)
        assert apart(own, others) < digits, name
    nq = len(e.model.coordinates)
    found = e.exactly("derivative", y, u, t=t)[nq : nq + len(free)]
    vd = exact(np.zeros(len(names)))
    vd[free], vd[driven] = found, given_up
    needed = bare.exactly("inverse_dynamics", whole, u, extra=list(vd))
    assert apart(needed[free], exact(np.zeros(len(free))), vd) < digits
    assert apart(e.exactly("driving_forces", y, u, t=t), needed[driven]) < digits
    tau = exact(np.random.default_rng(seed).uniform(-5.0, 5.0, len(free)))
    pushed = e.exactly("forward_dynamics", y, u, extra=list(tau), t=t)
    assert apart(e.exactly("inverse_dynamics", y, u, extra=list(pushed), t=t), tau) < digits


def turned(tree: SpatialTree) -> bool:
    """Whether its scene has rotations that are doubles, a part in 1e16 off."""
    joints = [body.joint for body in tree.bodies]
    return any(np.any(j.orientation_deg) for j in joints) or any(
        0 < abs(x) < 1 for j in joints for axis in j.axes for x in axis
    )


@pytest.mark.parametrize(
    ("dimensions", "seed", "route", "tangents"),
    [
        *((*case, ROUTES[i % 2], False) for i, case in enumerate(FEW)),
        (PLANE, 38, "ldl", True),
        (SPACE, 47, "aba", True),
    ],
)
@pytest.mark.every(4)
def test_jacobians(dimensions: int, seed: int, route: str, tangents: bool) -> None:
    """By state and by parameters, those of the drives among them, against differences."""
    e = made(dimensions, seed, route, tangents=tangents)
    digits = 1e-13 if turned(given(dimensions, seed, 5, locks=False).tree) else 1e-30
    y, u, t = at_random(e, seed)
    quaternions = {i for four in e.module.QUATERNIONS for i in four}
    for output, left_out in (("jacobian", quaternions), ("parameter_jacobian", set())):
        found, expected = e.exactly(output, y, u, t=t), slopes(e, output, y, u, t=t)
        for i in {*range(len(expected.T))} - left_out:
            assert apart(found[:, i], expected[:, i]) < digits, (output, i)


@pytest.mark.every(4)
@pytest.mark.parametrize(("dimensions", "seed"), FEW)
def test_energy_is_accounted_for(dimensions: int, seed: int) -> None:
    """dE/dt is the sum of the effects' powers, driving force times rate among them."""
    e = made(dimensions, seed, "aba")
    y, u, t = at_random(e, seed)
    kinetic, potential = (
        along(
            lambda z, name=name: e.exactly(name, z[:-1], u, t=z[-1]),
            exact([*y, t]),
            np.array([*e.exactly("derivative", y, u, t=t), MP.mpf(1)], dtype=object),
        )
        for name in ("kinetic_energy", "potential_energy")
    )
    powers = dict(zip(e.module.EFFECT_NAMES, e.exactly("effect_powers", y, u, t=t), strict=True))
    gained = kinetic - sum(powers.values())
    assert apart(gained, exact(0.0), *map(abs, powers.values())) < 1e-14
    weight = powers.get("gravity", MP.mpf(0))
    assert apart(potential, -exact(weight)) < 1e-14
    at, _ = given(dimensions, seed, 5, locks=False).values(t, MP)
    forces = e.exactly("driving_forces", y, u, t=t)
    for i, (_, velocity) in enumerate(given(dimensions, seed, 5, locks=False).driven):
        assert apart(powers[f"way{i}"], forces[i] * at[velocity]) < 1e-50


@pytest.mark.every(3)
@pytest.mark.parametrize(("dimensions", "seed"), FEW)
def test_many_states_at_many_times(dimensions: int, seed: int) -> None:
    """Columns are single states, each at its own time."""
    e = made(dimensions, seed, "aba")
    rng = np.random.default_rng(seed)
    states = [e.random_state(rng) for _ in range(4)]
    times = rng.uniform(0.0, 3.0, 4)
    for name in ("derivative", "jacobian", "driving_forces", "body_poses", "kinetic_energy"):
        function = getattr(e.module, name)
        alone = [function(t, y) for t, y in zip(times, states, strict=True)]
        together = function(times, np.array(states).T)
        assert apart(together, np.stack(alone, axis=-1)) < 1e-12, name


# Derivatives of formulas.


@pytest.mark.every(2)
@pytest.mark.parametrize("function", FUNCTIONS)
def test_rates_of_formulas(function: str) -> None:
    """Every function's derivatives by time, against differences of its value."""
    inner = ("0.4 + a*sin(t)", "0.3*t + a*t*t", "a + t*cos(t)")[: FUNCTIONS[function]]
    formula = parse(f"t*{function}({', '.join(inner)})/(a + t) - -t**3")
    names, digits = {"a": MP.mpf("0.31")}, Digits()

    def value(t: Any) -> Any:
        return with_rates(formula, names, t, digits)[0]

    for t in (MP.mpf("0.2"), MP.mpf("0.45")):
        found = with_rates(formula, names, t, digits)
        h = MP.mpf(10) ** -12
        first = (value(t + h) - value(t - h)) / (2 * h)
        second = (value(t + h) - 2 * value(t) + value(t - h)) / h**2
        assert apart(np.array(found[1:]), np.array([first, second])) < 1e-20


# Closed forms and published numbers.

KAPITZA = """\
name = "kapitza"
outputs = "all"
parameters = { a = 0.1, w = 20.0 }
bodies = [
    { name = "pivot", mass = 0, inertia_com = 0 },
    { name = "bob", mass = 1.0, inertia_com = 0 },
]
effects = [
    { type = "gravity", g = 9.81 },
    { type = "driven", name = "shaker", joint = "shaft", coordinate = "a*cos(w*t)" },
]
[[joints]]
type = "prismatic"
name = "shaft"
parent = "world"
child = "pivot"
axis = [0, 1]
[[joints]]
type = "revolute"
name = "pin"
parent = "pivot"
child = "bob"
r_child = [0, -1]
coordinate = "lean"
[initial.q]
lean = 0.001
"""
THRESHOLDS = {
    20: 0.22383084230850073,
    40: 0.11103265132427287,
    80: 0.05540519898770802,
    160: 0.02768868395437137,
}
"""Amplitude from which a pendulum of 1 m stands on a pivot shaken at this many rad/s (g = 9.81):
trace 2 of the monodromy matrix of θ'' = (g/l - a Ω²/l cos Ωt) θ, by Floquet's theory, DOP853 with
rtol 1e-13 and Brent's method. For fast shaking it goes to sqrt(2 g l) / Ω (Kapitza 1951).
"""


@pytest.mark.parametrize("frequency", THRESHOLDS)
def test_kapitza_threshold(frequency: int) -> None:
    """The trace of the monodromy matrix, integrated with the module's own Jacobian, is 2 there."""
    module = engine(KAPITZA).module
    assert module.STATES == ("lean", "lean_dot") and module.DRIVEN == ("shaft_slide",)

    def trace(a: float) -> float:
        p = {"a": a, "w": float(frequency)}

        def rates(t: float, y: np.ndarray) -> np.ndarray:
            return (module.jacobian(t, np.zeros(2), p) @ y.reshape(2, 2)).ravel()

        end = 2 * np.pi / frequency
        found = solve_ivp(rates, (0.0, end), np.eye(2).ravel(), "DOP853", rtol=1e-12, atol=1e-14)
        return float(np.trace(found.y[:, -1].reshape(2, 2)))

    a = THRESHOLDS[frequency]
    assert abs(trace(a) - 2.0) < 1e-10
    assert trace(0.99 * a) > 2.0 > trace(1.01 * a)


def test_kapitza_stands_or_falls() -> None:
    """The whole motion on either side of the threshold, from 1 mrad."""
    module = engine(KAPITZA).module
    for share, stands in ((1.05, True), (0.95, False)):
        p = {"a": share * THRESHOLDS[40], "w": 40.0}
        found = solve_ivp(
            lambda t, y, p=p: module.derivative(t, y, p),
            (0.0, 20.0),
            module.initial_state(),
            "DOP853",
            rtol=1e-9,
            atol=1e-12,
        )
        assert (np.max(np.abs(found.y[0])) < 0.02) == stands
        assert stands or np.max(np.abs(found.y[0])) > 3.0


TURNTABLE = """\
name = "turntable"
outputs = "all"
dimensions = 3
parameters = { w = 6.0, l = 0.8, m = 1.3 }
bodies = [
    { name = "post", mass = 2.0, inertia_com = [0.1, 0.1, 0.1] },
    { name = "bob", mass = "m", inertia_com = [0, 0, 0] },
]
effects = [
    { type = "gravity", g = 9.81 },
    { type = "driven", name = "table", joint = "axle", coordinate = "w*t" },
]
[[joints]]
type = "revolute"
name = "axle"
parent = "world"
child = "post"
axis = [0, 0, 1]
[[joints]]
type = "revolute"
name = "pin"
parent = "post"
child = "bob"
axis = [0, 1, 0]
r_child = [0, 0, "l"]
coordinate = "angle"
"""


@pytest.mark.parametrize("route", ROUTES)
def test_pendulum_on_a_turntable(route: str) -> None:
    """It rests at cos θ = g/(w² l), swings about there at w sin θ, and the table takes
    2 m l² w sin θ cos θ θ': the rate of the bob's angular momentum about the axle.
    """
    e = engine(TURNTABLE, route)
    m, length, w, g = 1.3, 0.8, 6.0, 9.81
    rest = math.acos(g / (w * w * length))
    for t in (0.0, 0.7):
        y = np.array([rest, 0.0])
        assert np.abs(e.module.derivative(t, y)).max() < 1e-13
        slope = e.module.jacobian(t, y)
        assert apart(slope, [[0.0, 1.0], [-((w * math.sin(rest)) ** 2), 0.0]]) < 1e-13
        angle, rate = 0.4, -2.1
        force = e.module.driving_forces(t, np.array([angle, rate]))
        expected = 2 * m * length**2 * w * math.sin(angle) * math.cos(angle) * rate
        assert apart(force, [expected]) < 1e-13
