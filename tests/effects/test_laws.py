"""Laws of mechanics on every built-in scene, whatever its joints, and what the programs cost.

Laws are tried on the program, run in 60 digits, so that nothing hides in rounding: what is left are
the doubles that a scene itself is made of. The module's own numbers are compared with those.
"""

import dis
import re
from collections.abc import Mapping
from dataclasses import replace
from functools import cache, cached_property
from types import FunctionType
from typing import Any

import numpy as np
import pytest
from bookkeeping import growth
from campaign import some, thinned
from engine import MP, Digits, Engine, along, apart, engine, exact, read
from spatial_trees import ENDS, random_spatial_tree

from eomgen.codegen.kernels import MORE
from eomgen.codegen.recording import Recording
from eomgen.dynamics.dynamics import Dynamics, Values
from eomgen.language.formula import Formula, evaluate
from eomgen.model.elaborate import elaborate
from eomgen.pipeline import compile_program
from eomgen.program.program import Output, Program, cost, finish, live_steps
from eomgen.program.tape import TIME, Stage
from eomgen.scalars.floats import FloatScalars
from eomgen.scene.effects import ExternalForce, Gravity, Motor
from eomgen.scene.effects.base import JointLoad, Load
from eomgen.scene.joints import Free
from eomgen.scene.joints.base import WithRotor
from eomgen.scene.reader import built_in_names, find_scene, parse_scene

FIGURES = ("human_figure", "hanging_figure", "quadruped")
LARGE = (*FIGURES, "ragdoll", "walker_motors", "chain", "chain_in_wind", "puma560", "stiff_beam")
TREES = {  # of up to 5 bodies; together they have everything
    "plane_60": (60, 2),
    "plane_379": (379, 2),
    "space_68": (68, 3),
    "space_153": (153, 3),
    "space_187": (187, 3),
    "space_293": (293, 3),
    "space_377": (377, 3),
}
PINS = {f"pins_{seed}": seed for seed in (7, 9, 16)}
"""Trees of pins and free bodies, for the closed form."""
ALIKE = "chain_in_wind hanging_figure quadruped ragdoll stiff_beam walker_motors".split()
LIKE_OTHERS = some(ALIKE, [])
LOOPS = [
    name
    for name in built_in_names()
    if re.search(r"loop = true|\[\[constraints", find_scene(name).read_text())
]
"""The laws below are those of trees; `verify` has those of mechanisms with constraints."""
OWN = [name for name in built_in_names() if name not in (*LIKE_OTHERS, *LOOPS)]
CASES = [(name, "") for name in OWN]
CASES += [(name, ("aba", "ldl")[i % 2]) for i, name in enumerate(TREES)]
CASES += [(name, "closed") for name in PINS]
SMALL = [name for name in OWN if name not in LARGE]
CASES += some([], [(name, route) for name in SMALL for route in ("aba", "ldl")])
CASES += some([], [("puma560", "ldl")])
EXACT = 1e-13
"""For 60 digits: the directions and orientations of a scene are doubles, and so are its sines."""
ROUNDING = 1e-11
DERIVATIVES = ("input_jacobian", "parameter_jacobian")


def compiled(name: str, route: str = "") -> Engine:
    """A case by its name."""
    text = name
    if name in TREES:
        text = random_spatial_tree(TREES[name][0], TREES[name][1], 5)[1]
    if name in PINS:
        text = random_spatial_tree(PINS[name], 2, pins=True)[1]
    return engine(text, route, leave_out=DERIVATIVES)


class Moment:
    """An engine at one state: outputs in 60 digits, each found once.

    The plane is treated as space: wrenches, velocities and places have all three components.
    """

    def __init__(self, e: Engine, seed: int) -> None:
        rng = np.random.default_rng(seed)
        self.e, self.model, self.module = e, e.model, e.module
        self.doubles = e.random_state(rng)
        self.u = e.random_inputs(rng)
        self.t = float(rng.uniform(0.0, 2.0))
        self.y = exact(self.doubles)
        self.nq, self.nv = len(e.model.coordinates), len(e.model.velocities)
        self.q, self.v, self.x = np.split(self.y, [self.nq, self.nq + self.nv])
        self.tau = list(exact(rng.uniform(-9.0, 9.0, len(self.v))))
        self.plane = e.model.dimensions == 2
        self.known: dict[str, np.ndarray] = {}

    def __getitem__(self, output: str) -> np.ndarray:
        if output not in self.known:
            self.known[output] = self.at(output, self.y)
        return self.known[output]

    def at(self, output: str, y: np.ndarray, p: Mapping[str, float] | None = None) -> np.ndarray:
        """An output at another state."""
        return self.e.exactly(output, y, self.u, p, t=self.t)

    def moving(self, y: np.ndarray) -> Dynamics:
        """What effects may ask, in 60 digits."""
        q, v, x = np.split(y, [self.nq, self.nq + self.nv])
        parameters = {name: MP.mpf(value) for name, value in self.module.PARAMETERS.items()}
        inputs = {name: MP.mpf(value) for name, value in self.u.items()}
        states = dict(zip((state.name for state in self.model.extra), x, strict=True))
        values = Values(parameters, inputs, list(q), list(v), states, MP.mpf(self.t))
        return Dynamics(self.model, values, Digits())

    def stored(self, y: np.ndarray) -> Any:
        """Potential energy of all effects but gravity."""
        moving = self.moving(y)
        others = (e for e in self.model.effects if not isinstance(e, Gravity))
        return sum((e.potential_energy(moving) for e in others), MP.mpf(0))

    def way(self, v: np.ndarray) -> np.ndarray:
        """Where velocities lead, they themselves held still."""
        way = self.at("derivative", np.concatenate((self.q, v, self.x)))
        way[self.nq :] = 0 * way[self.nq :]
        return way

    def slope(self, output: str, v: np.ndarray) -> np.ndarray:
        """How an output changes that way."""
        return along(lambda y: self.at(output, y), self.y, self.way(v))

    def slope_of_stored(self, v: np.ndarray) -> Any:
        """The same of `stored`."""
        if all(isinstance(effect, PLAIN) for effect in self.model.effects):
            return MP.mpf(0)
        return along(self.stored, self.y, self.way(v))

    def rate(self, output: str) -> np.ndarray:
        """How an output changes along the motion."""
        return along(lambda y: self.at(output, y), self.y, self["derivative"])

    @cached_property
    def vd(self) -> np.ndarray:
        """v̇."""
        return self["derivative"][self.nq : self.nq + self.nv]

    # The bodies one by one, in space.

    def value(self, formula: Formula) -> Any:
        """A quantity, as doubles have it; a formula of time now."""
        return MP.mpf(evaluate(formula, {**self.model.defaults, TIME: self.t}, FloatScalars()))

    def vector(self, parts: tuple[Formula, ...]) -> np.ndarray:
        """A vector of the scene."""
        return in_space(np.array([self.value(part) for part in parts], dtype=object))

    @cached_property
    def masses(self) -> list[Any]:
        """Of the bodies."""
        return [self.value(body.mass) for body in self.model.bodies]

    def places(self, poses: np.ndarray) -> tuple[list[np.ndarray], list[np.ndarray]]:
        """Rotation and centre of mass of each body."""
        if not self.plane:
            return [pose[:, :3] for pose in poses], [pose[:, 3] for pose in poses]
        turned = [turn_about_z(angle) for angle in poses[:, 2]]
        return turned, [in_space(pose[:2]) for pose in poses]

    def inertia(self, k: int, turned: np.ndarray) -> np.ndarray:
        """Of a body about its centre of mass, world axes."""
        entries = [self.value(entry) for entry in self.model.bodies[k].inertia_com]
        xx, yy, zz, xy, xz, yz = entries if len(entries) == 6 else [0, 0, *entries, 0, 0, 0]
        return turned @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]], object) @ turned.T

    def twists(self, velocities: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
        """Linear and angular part of motions, or of wrenches, that the module returns."""
        if not self.plane:
            return [(row[:3], row[3:]) for row in velocities]
        nothing = MP.mpf(0)
        return [(in_space(row[:2]), exact([nothing, nothing, row[2]])) for row in velocities]

    @cached_property
    def gravity(self) -> np.ndarray:
        """Acceleration of gravity, world axes."""
        g = [self.value(e.g) for e in self.model.effects if isinstance(e, Gravity)]
        return -sum(g, MP.mpf(0)) * exact(np.eye(3)[1 if self.plane else 2])

    @cached_property
    def others(self) -> list[Any]:
        """Loads of effects but the plainest, as they state them: each has a test of its own."""
        moving = self.moving(self.y)
        effects = (e for e in self.model.effects if not isinstance(e, PLAIN))
        return [load for effect in effects for load in effect.loads(moving)]

    def pushes(self) -> list[tuple[int, np.ndarray, np.ndarray, np.ndarray]]:
        """Forces on bodies: body, place on it in body axes, force and torque in world axes."""
        names = [body.name for body in self.model.bodies]
        found, none = [], exact(np.zeros(3))
        for load in self.others:
            if isinstance(load, Load) and load.body in names:
                torque = (
                    none
                    if not load.torque
                    else exact([*none[: 3 - len(load.torque)], *load.torque])
                )
                at, force = (in_space(np.array(x, dtype=object)) for x in (load.at, load.force))
                found.append((names.index(load.body), at, force, torque))
        for effect in self.model.effects:
            if isinstance(effect, ExternalForce):
                force = effect.force
                if isinstance(force, tuple):
                    pushed = self.vector(force)
                else:
                    ends = "xyz"[: self.model.dimensions]
                    pushed = in_space(exact([self.u[f"{effect.name}_{x}"] for x in ends]))
                found.append((names.index(effect.body), self.vector(effect.at), pushed, none))
        return found

    def torques(self) -> np.ndarray:
        """What motors put on the velocities."""
        found = exact(np.zeros(len(self.v)))
        first = dict(
            zip(
                (body.joint.name for body in self.model.bodies),
                self.model.first_velocity,
                strict=True,
            )
        )
        for effect in self.model.effects:
            if isinstance(effect, Motor):
                torque = effect.torque
                given = self.u[effect.name] if isinstance(torque, str) else self.value(torque)
                found[first[effect.joint]] += given
        for load in self.others:
            if isinstance(load, JointLoad):
                found[first[load.joint] + load.coordinate] += load.force
        return found

    def armatures(self) -> np.ndarray:
        """Rotor inertia that each velocity feels: gear ratio squared times its own."""
        found = exact(np.zeros(len(self.v)))
        for body, first in zip(self.model.bodies, self.model.first_velocity, strict=True):
            if isinstance(body.joint, WithRotor):
                ratio = getattr(body.joint, "gear_ratio", None)
                geared = MP.mpf(1) if ratio is None else self.value(ratio)
                inertia = geared**2 * self.value(body.joint.motor_inertia)
                found[first : first + len(body.velocities)] = inertia
        return found


PLAIN = (Gravity, ExternalForce, Motor)
"""Effects whose loads are written here by hand."""


def in_space(vector: np.ndarray) -> np.ndarray:
    """With z = 0 if it is one of the plane."""
    return np.array([*vector, *[MP.mpf(0)] * (3 - len(vector))], dtype=object)


def turn_about_z(angle: Any) -> np.ndarray:
    """The rotation of a planar body."""
    c, s = MP.cos(angle), MP.sin(angle)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]], dtype=object)


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """a × b."""
    return np.array([a[i - 2] * b[i - 1] - a[i - 1] * b[i - 2] for i in range(3)], dtype=object)


@cache
def moment(name: str, route: str, seed: int) -> Moment:
    """A case at a random state."""
    return Moment(compiled(name, route), seed)


@pytest.fixture(params=thinned(CASES, 2), ids=lambda case: "-".join(case).strip("-"))
def m(request: pytest.FixtureRequest) -> Moment:
    """Every built-in scene by its own route, small ones and some trees by another."""
    return moment(*request.param, 61)


# The module is its program.


def test_module_is_its_program(m: Moment) -> None:
    """In doubles, and what it says that it costs."""
    module, program, y = m.module, m.e.system.program, m.doubles
    assert list(module.COST) == list(program.outputs)
    for name in program.outputs:
        assert module.COST[name] == cost(program, name)
        taken, kernel = module.COST[name]["total"], getattr(module, f"_{name}")
        if "_derivative" in kernel.__code__.co_names:  # goes on from it, with a few steps in vain
            own = arithmetic(kernel) - 1 + arithmetic(module._derivative)
            assert taken <= own <= (1 + MORE) * taken
        else:
            assert taken == arithmetic(kernel)
        if name in ("initial_state", "jacobian", "impact", "held"):
            continue
        if name.endswith("_dynamics"):
            extra = np.array(m.tau, dtype=float)
            q, v, x = np.split(y, [m.nq, m.nq + m.nv])
            given = {"x": x} if m.model.extra else {}
            found = getattr(module, name)(q, v, extra, t=m.t, u=m.u, **given)
            expected = m.e.exactly(name, m.y, m.u, extra=m.tau, t=m.t)
        else:
            found, expected = getattr(module, name)(m.t, y, u=m.u), m[name]
        assert apart(found, expected) < ROUNDING, name


def arithmetic(function: FunctionType) -> int:
    """Operators and calls in a function; the minus of a number is a part of it."""
    operations = function.__code__.co_code[::2]  # each of one byte, with an argument of one
    kinds = ("BINARY_OP", "UNARY_NEGATIVE", "CALL")
    return sum(operations.count(dis.opmap[kind]) for kind in kinds)


def stages(program: Program, output: str) -> Stage:
    """The latest thing that an output depends on."""
    steps = live_steps(program, program.outputs[output].nodes)
    return max((program.steps[i].stage for i in steps), default=Stage.CONSTANT)


def test_what_depends_on_what(m: Moment) -> None:
    """Places and M, G, U know of no velocity, and nothing but forces knows of inputs."""
    program = m.e.system.program
    for name in (
        "mass_matrix gravity_force potential_energy body_poses centre_of_mass point_positions "
        "point_jacobians"
    ).split():
        if name in program.outputs:
            assert stages(program, name) <= Stage.POSITIONS, name
    for name in "kinetic_energy velocity_force bias_force momentum body_velocities".split():
        assert stages(program, name) <= Stage.VELOCITIES, name


# Energy and the mass matrix.


def test_mass_matrix(m: Moment) -> None:
    """½ vᵀ M v is the kinetic energy, of bodies and rotors; M is symmetric and positive."""
    M, v = m["mass_matrix"], m.v
    assert np.array_equal(M, M.T)
    for y in (m.doubles, -m.doubles):
        own = m.module.mass_matrix(0.0, y)
        assert np.array_equal(own, own.T)
        assert np.linalg.eigvalsh(own)[0] > 0
    energy = m["kinetic_energy"]
    assert apart(v @ M @ v / 2, energy) < EXACT
    turned, _ = m.places(m["body_poses"])
    value = sum(m.armatures() * v * v, MP.mpf(0))
    for k, (linear, spin) in enumerate(m.twists(m["body_velocities"])):
        value += m.masses[k] * (linear @ linear) + spin @ m.inertia(k, turned[k]) @ spin
    assert apart(value / 2, energy) < EXACT


def ways(m: Moment) -> np.ndarray:
    """Velocities by chance, none of them 0: one entry off shows along each of them."""
    return exact(np.random.default_rng(63).normal(size=(3, len(m.v))))


def test_gravity_force_is_the_slope_of_the_potential(m: Moment) -> None:
    """G is how the weights' U changes as velocities lead; that is their height."""
    G = m["gravity_force"]
    for way in ways(m):
        slope = m.slope("potential_energy", way) - m.slope_of_stored(way)
        assert apart(G @ way, slope, G) < EXACT
    assert ("gravity" in m.module.EFFECTS) == bool(np.any(m.gravity))
    _, centres = m.places(m["body_poses"])
    weights = sum((-a * (m.gravity @ x) for a, x in zip(m.masses, centres, strict=True)), MP.mpf(0))
    assert apart(m["potential_energy"], weights + m.stored(m.y)) < EXACT


def test_velocity_force(m: Moment) -> None:
    """V = Ṁ v - ∂T/∂π, and ω x ∂T/∂ω more where ω belongs to a quaternion (Poincaré's equations).

    With plain coordinates this says that V = C v with the Christoffel symbols of M, and Ṁ - 2C is
    skew. With either it leaves vᵀ V = ½ vᵀ Ṁ v.
    """
    V, M, v = m["velocity_force"], m["mass_matrix"], m.v
    rate = m.slope("mass_matrix", v)
    gyration = exact(np.zeros(len(v)))
    starts = zip(m.model.bodies, m.model.first_velocity, strict=True)
    spins = [first + len(body.velocities) - 3 for body, first in starts if spinning(body)]
    for first in spins:
        at = slice(first, first + 3)
        gyration[at] = cross(v[at], (M @ v)[at])
    assert len(spins) == len(m.module.QUATERNIONS)
    for way in ways(m):
        expected = (rate @ v + gyration) @ way - m.slope("kinetic_energy", way)
        assert apart(V @ way, expected, rate @ v) < EXACT
    assert apart(v @ V, v @ rate @ v / 2, np.abs(v) @ np.abs(V)) < EXACT


def spinning(body: Any) -> bool:
    """Whether a body's joint has a quaternion."""
    return len(body.positions) > len(body.velocities)


def test_velocity_force_is_quadratic(m: Moment) -> None:
    """V(q, s v) = s² V(q, v), exactly so where s is a power of two."""
    q, v, x = np.split(m.doubles, [m.nq, m.nq + m.nv])
    V = m.module.velocity_force(0.0, m.doubles)
    for s in (-4.0, 0.0, 0.5):
        scaled = m.module.velocity_force(0.0, np.concatenate((q, s * v, x)))
        assert np.array_equal(scaled, s**2 * V)


# Balance.


def test_balance(m: Moment) -> None:
    """M v̇ + V + G = F + τ; h = V + G; inverse dynamics undoes forward dynamics."""
    M, V, G, h, F = (
        m[name]
        for name in "mass_matrix velocity_force gravity_force bias_force applied_force".split()
    )
    forward, inverse = (
        (lambda x, name=name: m.e.exactly(name, m.y, m.u, extra=list(x), t=m.t))
        for name in ("forward_dynamics", "inverse_dynamics")
    )
    assert apart(V + G, h) < EXACT
    assert apart(M @ m.vd + h, F, h, M @ m.vd) < EXACT
    pushed = forward(m.tau)
    assert apart(M @ pushed + h - F, m.tau, M @ pushed, h) < EXACT
    assert apart(inverse(pushed), m.tau, M @ pushed, h) < EXACT
    assert apart(inverse(0 * m.v), h - F) < EXACT
    assert apart(forward(0 * m.v), m.vd) < EXACT
    still = np.concatenate((m.q, 0 * m.v, m.x))
    assert apart(m.at("bias_force", still), G) < EXACT


def test_energy_changes_by_the_power_of_applied_forces(m: Moment) -> None:
    """dE/dt = vᵀ F = Σ f · ẋ + τ q̇ of forces and motors; without them energy is kept."""
    flow = m.rate("kinetic_energy") + m.rate("potential_energy")
    power = m.torques() @ m.v
    turned, _ = m.places(m["body_poses"])
    twists = m.twists(m["body_velocities"])
    for k, at, force, torque in m.pushes():
        linear, spin = twists[k]
        power += force @ (linear + cross(spin, turned[k] @ at)) + torque @ spin
    terms = (m.rate("kinetic_energy"), m["kinetic_energy"])
    assert apart(m["applied_force"] @ m.v, power, *terms) < EXACT
    assert apart(flow - m.slope_of_stored(m.v), power, *terms) < EXACT


def test_forces_of_effects_are_all_that_moves_it(m: Moment) -> None:
    """Their sum is F - G, so that M v̇ + V is it; Q v is the power of each, but of drives."""
    forces, powers = m["effect_forces"], m["effect_powers"]
    F, G, V = m["applied_force"], m["gravity_force"], m["velocity_force"]
    forces = forces.reshape(len(m.model.effects), m.nv)
    pull, terms = m["mass_matrix"] @ m.vd, (forces.ravel(), V)
    assert apart(forces.sum(axis=0), F - G, F, G) < EXACT
    assert apart(pull + V, forces.sum(axis=0), pull, *terms) < EXACT
    for effect, force, power in zip(m.model.effects, forces, powers, strict=True):
        if not effect.prescribes():
            assert apart(force @ m.v, power, powers, forces.ravel()) < EXACT


def test_kinetic_energy_grows_by_the_power_of_effects(m: Moment) -> None:
    """dT/dt = Σ power of all effects, their drives and weights among them, as time goes on."""
    powers, energy = m["effect_powers"], m["kinetic_energy"]
    gained = growth(m.e, "kinetic_energy", m.doubles, m.t, u=m.u)
    assert apart(gained, np.sum(powers), powers, energy) < EXACT
    assert bool(m.model.effects) == bool(np.max(np.abs(powers), initial=0) > 1e-3)


# Kinematics and momentum.


def test_poses_change_as_velocities_say(m: Moment) -> None:
    """ẋ = v and Ṙ = ω x R of every body; a point's velocity is the rate of its place, and J v."""
    turned, _ = m.places(m["body_poses"])
    rates = m.slope("body_poses", m.v)
    for k, (linear, spin) in enumerate(m.twists(m["body_velocities"])):
        assert apart(turned[k] @ turned[k].T, exact(np.eye(3))) < EXACT
        if m.plane:
            assert apart(in_space(rates[k][:2]), linear) < EXACT
            assert apart(rates[k][2], spin[2]) < EXACT
        else:
            assert apart(rates[k][:, 3], linear) < EXACT
            whirled = np.array([cross(spin, column) for column in turned[k].T]).T
            assert apart(rates[k][:, :3], whirled) < EXACT
    if m.module.POINTS:
        velocities = m["point_velocities"]
        assert apart(m.slope("point_positions", m.v), velocities) < EXACT
        assert apart(m["point_jacobians"] @ m.v, velocities) < EXACT
        turned, centres = m.places(m["body_poses"])
        for point, place in zip(m.model.points, m["point_positions"], strict=True):
            value = centres[point.body] + turned[point.body] @ m.vector(point.at)
            assert apart(in_space(place), value) < EXACT


def momentum(m: Moment) -> tuple[np.ndarray, np.ndarray]:
    """What a momentum, or its rate, is in space: linear and angular."""
    return m.twists(m["momentum"][None])[0]


def test_momentum_is_that_of_the_bodies(m: Moment) -> None:
    """Σ m v, Σ x × m v + I ω about the world's origin; and the centre of mass is Σ m x / Σ m."""
    turned, centres = m.places(m["body_poses"])
    linear, angular = exact(np.zeros(3)), exact(np.zeros(3))
    for k, (velocity, spin) in enumerate(m.twists(m["body_velocities"])):
        p = m.masses[k] * velocity
        linear, angular = linear + p, angular + cross(centres[k], p)
        angular = angular + m.inertia(k, turned[k]) @ spin
    assert apart(np.array(momentum(m)), np.array((linear, angular))) < EXACT
    moments = sum(a * x for a, x in zip(m.masses, centres, strict=True))
    assert apart(in_space(m["centre_of_mass"]), moments / sum(m.masses)) < EXACT


def joint_points(m: Moment) -> dict[int, np.ndarray]:
    """Of every joint but the free ones its point on the child, by the child."""
    turned, centres = m.places(m["body_poses"])
    return {
        k: centres[k] + turned[k] @ m.vector(body.joint.r_child)
        for k, body in enumerate(m.model.bodies)
        if not isinstance(body.joint, Free)
    }


def wrenches(m: Moment) -> dict[int, tuple[np.ndarray, np.ndarray]]:
    """Force and moment of every joint but the free ones on its parent, by the child."""
    rows = iter(m.twists(m["joint_forces"]))
    return {
        k: next(rows) for k, body in enumerate(m.model.bodies) if not isinstance(body.joint, Free)
    }


def test_momentum_changes_by_the_forces_from_outside(m: Moment) -> None:
    """By weights, applied forces and the joints of the world; and by nothing, without any."""
    turned, centres = m.places(m["body_poses"])
    force, torque = exact(np.zeros(3)), exact(np.zeros(3))

    def act(f: np.ndarray, at: np.ndarray) -> None:
        nonlocal force, torque
        force, torque = force + f, torque + cross(at, f)

    for k, centre in enumerate(centres):
        act(m.masses[k] * m.gravity, centre)
    for k, at, pushed, turning in m.pushes():
        act(pushed, centres[k] + turned[k] @ at)
        torque = torque + turning
    points = joint_points(m)
    for k, (f, n) in wrenches(m).items():
        if m.model.bodies[k].parent < 0:
            act(-f, points[k])
            torque = torque - n
    rate = m.twists(m.rate("momentum")[None])[0]
    assert apart(np.array(rate), np.array((force, torque)), m["momentum"]) < EXACT


FLOATING = ("two_body", "tumbling_body", "quadruped", "human_figure")


@pytest.mark.every(4)
@pytest.mark.parametrize("name", FLOATING)
def test_momentum_is_constant_when_nothing_acts_from_outside(name: str) -> None:
    """Trees that nothing holds keep all their momentum without gravity."""
    m = moment(name, "", 61)
    assert all(isinstance(b.joint, Free) for b in m.model.bodies if b.parent < 0)
    p = {"g": 0.0, "gravity_g": 0.0}
    p = {parameter: 0.0 for parameter in p if parameter in m.module.PARAMETERS}
    assert len(p) == ("gravity" in m.module.EFFECTS)
    rates = m.at("derivative", m.y, p)
    assert np.max(np.abs(rates[m.nq :])) > 0.1
    flow = along(lambda y: m.at("momentum", y, p), m.y, rates)
    assert np.max(np.abs(flow)) < EXACT * np.max(np.abs(m["momentum"]))


def test_newton_and_euler_for_each_body(m: Moment) -> None:
    """m a and d(I ω)/dt of every body are weight, forces and what its joints put on it.

    A joint does on its child what its motor does, less what its rotor takes, and no other work.
    """
    turned, centres = m.places(m["body_poses"])
    twists, points, joints = m.twists(m["body_velocities"]), joint_points(m), wrenches(m)
    forces = [mass * m.gravity for mass in m.masses]
    torques = [exact(np.zeros(3)) for _ in m.masses]
    sizes = [exact(np.zeros(3))]

    def act(k: int, f: np.ndarray, n: np.ndarray, at: np.ndarray) -> None:
        more = n + cross(at - centres[k], f)
        forces[k], torques[k] = forces[k] + f, torques[k] + more
        sizes.extend((f, more))

    for k, at, force, torque in m.pushes():
        act(k, force, torque, centres[k] + turned[k] @ at)
    driven = m.torques() - m.armatures() * m.vd
    for k, (f, n) in joints.items():
        body = m.model.bodies[k]
        act(k, -f, -n, points[k])
        linear, spin = twists[k]
        slip = linear + cross(spin, points[k] - centres[k])
        if body.parent >= 0:
            act(body.parent, f, n, points[k])
            linear, other = twists[body.parent]
            slip = slip - linear - cross(other, points[k] - centres[body.parent])
            spin = spin - other
        own = slice(m.model.first_velocity[k], m.model.first_velocity[k] + len(body.velocities))
        power = driven[own] @ m.v[own] if len(body.velocities) else MP.mpf(0)
        assert apart(-(f @ slip) - n @ spin, power, f, n) < EXACT, body.name
    for k, (linear, turning) in enumerate(m.twists(m.rate("body_velocities"))):
        spin, inertia = twists[k][1], m.inertia(k, turned[k])
        name = m.model.bodies[k].name
        assert apart(forces[k], m.masses[k] * linear, *sizes) < EXACT, name
        gyration = inertia @ turning + cross(spin, inertia @ spin)
        assert apart(torques[k], gyration, *sizes) < EXACT, name


# Quaternions.


ROUND = (*some((), FIGURES), "spinning_top", "tumbling_body", *(x for x in TREES if "space" in x))


@pytest.mark.every(4)
@pytest.mark.parametrize(("name", "route"), [case for case in CASES if case[0] in ROUND])
def test_length_of_quaternions(name: str, route: str) -> None:
    """It stays as it is, and nothing depends on it."""
    m = moment(name, route, 61)
    quaternions = [list(indices) for indices in m.module.QUATERNIONS]
    assert quaternions
    longer = m.y.copy()
    for n, indices in enumerate(quaternions):
        parts = m.y[indices]
        assert abs(parts @ m["derivative"][indices]) < MP.mpf(10) ** -50
        assert np.max(np.abs(m["derivative"][indices])) > 0.01
        longer[indices] = parts * (MP.mpf("1.7") + n)
    rates = m.at("derivative", longer)
    for n, indices in enumerate(quaternions):
        rates[indices] = rates[indices] / (MP.mpf("1.7") + n)
    assert apart(rates, m["derivative"]) < 1e-50
    for output in m.e.system.program.outputs:
        if output in ("initial_state", "derivative", "jacobian") or output.endswith("_dynamics"):
            continue
        assert apart(m.at(output, longer), m[output]) < 1e-50, output


@pytest.mark.every(4)
@pytest.mark.parametrize("name", some(LARGE[::4], LARGE))
def test_jacobian_of_large_scenes(name: str) -> None:
    """Some columns, as central differences in 60 digits have them."""
    m = moment(name, "", 61)
    J = m.module.jacobian(m.t, m.doubles, u=m.u)
    for i in np.random.default_rng(62).choice(len(m.y), 3, replace=False):
        column = along(lambda y: m.at("derivative", y), m.y, exact(np.eye(len(m.y))[i]))
        assert apart(J[:, i], column) < ROUNDING


# What it costs.


def operations(text: str, route: str) -> int:
    """Of one call of `derivative` of a scene that has no output but those that all have."""
    model = elaborate(read(text).replaced(outputs=()))
    system = compile_program(replace(model, route=route)).system
    return cost(system.program, "derivative")["total"]


def recorded(text: str) -> int:
    """The same by `aba`, before the passes: quicker to find for long chains."""
    record = Recording(elaborate(parse_scene(text)), "aba")
    outputs = {"derivative": Output((len(record.rates),), tuple(n.index for n in record.rates))}
    return cost(finish(record.tape, outputs, ()), "derivative")["total"]


@pytest.mark.parametrize("route", ["closed", "aba"])
def test_operations_of_two_bodies(route: str) -> None:
    """The handout's two free bodies."""
    assert operations("two_body", route) <= {"closed": 46, "aba": 110}[route]


PLANAR_CHAIN = """
name = "links"
[[chains]]
name = "link"
count = {count}
mass = 1.1
inertia_com = 0.03
r_parent = [0.31, {y}]
r_child = [-0.29, {y}]
[[effects]]
type = "gravity"
g = 9.81
"""


def spatial_chain(count: int) -> str:
    """Bodies of any shape on pins along x, y, z in turn."""
    text = 'name = "bodies"\ndimensions = 3\n[[effects]]\ntype = "gravity"\ng = 9.81\n'
    for k in range(count):
        axis = np.eye(3)[k % 3].tolist()
        parent = f"b{k - 1}" if k else "world"
        text += f"""
[[bodies]]
name = "b{k}"
mass = 1.{k}
inertia_com = [0.05, 0.06, 0.07, 0.001, 0.002, 0.003]
[[joints]]
name = "j{k}"
type = "revolute"
parent = "{parent}"
child = "b{k}"
axis = {axis}
r_parent = [0.1, 0.2, 0.3]
r_child = [-0.1, 0.15, 0.25]
"""
    return text


def test_operations_of_a_planar_chain() -> None:
    """For each of 100 links with all that a link may have; and the size grows with the links."""
    counts = {n: recorded(PLANAR_CHAIN.format(count=n, y=0.05)) for n in (100, 200)}
    assert counts[100] <= 105 * 100
    assert abs(counts[200] - 2 * counts[100]) <= 0.02 * counts[100]
    assert recorded(PLANAR_CHAIN.format(count=100, y=0)) <= 70 * 100


def test_operations_of_a_spatial_chain() -> None:
    """For each of 28 bodies, three to a place and six to an inertia; and the size is linear."""
    counts = {n: recorded(spatial_chain(n)) for n in (28, 27, 54, 81)}
    assert counts[28] <= 400 * 28
    assert abs((counts[81] - counts[54]) - (counts[54] - counts[27])) <= 0.02 * counts[27]


def test_operations_of_a_jacobian() -> None:
    """That of ten links takes no more than twelve calls of the derivative."""
    costs = compiled("chain").module.COST
    assert costs["jacobian"]["total"] <= 12 * costs["derivative"]["total"]


@pytest.mark.full
def test_the_figures_are_figures() -> None:
    """As many segments and degrees of freedom as were asked for; everything is covered here."""
    for name in ("human_figure", "hanging_figure"):
        model = compiled(name).model
        assert len(model.bodies) >= 15
        assert len(model.velocities) >= 28
    assert {name for name, _ in CASES} == {*OWN, *TREES, *PINS}
    assert len(built_in_names()) >= 15
    models = [moment(*case, 61).model for case in CASES]
    kinds = {(body.joint.type, model.dimensions) for model in models for body in model.bodies}
    assert kinds >= {(kind, 2) for kind in "revolute prismatic planar weld free".split()}
    assert kinds >= {(kind, 3) for kind in ENDS} | {("free", 3)}
