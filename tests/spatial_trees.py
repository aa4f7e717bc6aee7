"""Trees of bodies in space or in the plane for tests: as plain numbers, and as a scene's text.

Nothing here imports eomgen. The judges (`spatial_newton_euler`, `judges`) read the numbers, eomgen
reads the text; both are the same doubles. SI units and radians, but for `orientation_deg`.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate, pairwise

import numpy as np
from scipy.spatial.transform import Rotation

Vector = tuple[float, float, float]
Vectors = tuple[Vector, ...]
ORIGIN: Vector = (0.0, 0.0, 0.0)
Z: Vector = (0.0, 0.0, 1.0)
PLANE, SPACE = 2, 3
ENDS: dict[str, tuple[str, ...]] = {
    "weld": (), "revolute": ("angle",), "prismatic": ("slide",), "cylindrical": ("slide", "angle"),
    "universal": ("angle_1", "angle_2"), "planar": ("x", "y", "angle"),
    "ball": ("qw", "qx", "qy", "qz"),
}  # fmt: skip
"""How the names of a joint's coordinates end, in their order."""
FREE_ENDS = {PLANE: ENDS["planar"], SPACE: ("x", "y", "z", *ENDS["ball"])}


@dataclass(frozen=True)
class TreeJoint:
    """The joint that holds a body; `parent` is the index of a body, -1 the world.

    `r_parent` is in the parent's axes from its centre of mass (the world's origin), `r_child` in
    the child's axes from its own; `axes` are unit vectors in the joint's axes; `orientation_deg`
    turns about x, then y, then z of the parent's axes. In the plane every vector has z = 0 and
    every axis of turning is z. `armature` is gear_ratio² motor_inertia.
    """

    name: str
    kind: str
    parent: int
    r_parent: Vector
    r_child: Vector
    orientation_deg: Vector
    axes: Vectors
    armature: float
    coordinates: tuple[str, ...]
    velocities: tuple[str, ...]


@dataclass(frozen=True)
class TreeBody:
    """A body: `inertia` is xx, yy, zz, xy, xz, yz about its centre of mass, in its axes."""

    name: str
    mass: float
    inertia: tuple[float, ...]
    joint: TreeJoint

    @property
    def inertia_matrix(self) -> np.ndarray:
        """The same as a matrix."""
        xx, yy, zz, xy, xz, yz = self.inertia
        return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


@dataclass(frozen=True)
class Loop:
    """A joint that closes a loop; its `child` is the index of a body, or -1, as its parent is."""

    joint: TreeJoint
    child: int


@dataclass(frozen=True, eq=False, repr=False)
class SpatialTree:
    """A mechanism in plain numbers, parents before children.

    Gravity acts along -y in the plane and along -z in space. `motor` is the body whose joint is
    driven by the input `drive` (-1: none). `pushes` are the names, the bodies and the points on
    them (body axes, from the centre of mass) that the inputs NAME_x, NAME_y, NAME_z act on in world
    axes, and `points` are (name, body, place on it). `parameters` are the values that eomgen knows
    by name. `loops` hold bodies that the joints of the tree carry.
    """

    name: str
    dimensions: int
    bodies: tuple[TreeBody, ...]
    gravity: float
    motor: int
    pushes: tuple[tuple[str, int, Vector], ...]
    points: tuple[tuple[str, int, Vector], ...]
    parameters: Mapping[str, float]
    loops: tuple[Loop, ...] = ()
    drive: str = "drive"

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of all coordinates, in the order of the judges' q."""
        return tuple(name for body in self.bodies for name in body.joint.coordinates)

    @property
    def velocities(self) -> tuple[str, ...]:
        """Names of all velocities, in the order of the judges' v."""
        return tuple(name for body in self.bodies for name in body.joint.velocities)

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of all joints but the free ones, in the order of bodies; then those of loops."""
        own = tuple(b.joint.name for b in self.bodies if b.joint.kind != "free")
        return own + tuple(loop.joint.name for loop in self.loops)

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs."""
        axes = "xyz"[: self.dimensions]
        push = tuple(f"{name}_{x}" for name, _, _ in self.pushes for x in axes)
        return ((self.drive,) if self.motor >= 0 else ()) + push

    def q_slices(self) -> list[slice]:
        """Where each body's coordinates lie in q."""
        ends = accumulate((len(body.joint.coordinates) for body in self.bodies), initial=0)
        return [slice(*both) for both in pairwise(ends)]

    def v_slices(self) -> list[slice]:
        """Where each body's velocities lie in v."""
        ends = accumulate((len(body.joint.velocities) for body in self.bodies), initial=0)
        return [slice(*both) for both in pairwise(ends)]

    def gravity_vector(self) -> np.ndarray:
        """Acceleration of gravity in world axes."""
        return self.gravity * np.array([0.0, -1.0, 0.0] if self.dimensions == PLANE else [0, 0, -1])

    def torques(self, u: Mapping[str, float] | None) -> np.ndarray:
        """What the motor puts on the velocities, in the order of v."""
        torques = np.zeros(len(self.velocities))
        if self.motor >= 0:
            torques[self.v_slices()[self.motor]] = (u or {}).get(self.drive, 0.0)
        return torques

    def push_forces(
        self, u: Mapping[str, float] | None
    ) -> Iterator[tuple[int, Vector, np.ndarray]]:
        """The bodies that are pushed, where, and the force in world axes, three components."""
        for name, body, place in self.pushes:
            yield body, place, np.array([(u or {}).get(f"{name}_{x}", 0.0) for x in "xyz"])

    def places(self, states: Sequence[str]) -> list[int]:
        """Where a module's STATES hold q and then v: `y[places]` is q, v."""
        return [states.index(name) for name in (*self.coordinates, *self.velocities)]

    def state(self, states: Sequence[str], q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """A state, or the rates of one, in the order of a module's STATES."""
        y = np.empty(len(states))
        y[self.places(states)] = np.concatenate((q, v))
        return y

    def rows(self, names: Sequence[str]) -> list[int]:
        """The row in the judges' results of each of a module's BODIES, or of its JOINTS."""
        bodies = [body.name for body in self.bodies]
        return [(bodies if name in bodies else self.joints).index(name) for name in names]

    def random_inputs(self, rng: np.random.Generator) -> dict[str, float]:
        """A value for every input."""
        return {name: float(rng.uniform(-9.0, 9.0)) for name in self.inputs}


def random_state(tree: SpatialTree, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Angles over two turns, slides within 0.6 m, unit quaternions; rates within 3 rad/s, 1 m/s."""
    q, v = np.zeros(len(tree.coordinates)), np.zeros(len(tree.velocities))
    for body, at, rate in zip(tree.bodies, tree.q_slices(), tree.v_slices(), strict=True):
        ends = ENDS.get(body.joint.kind, FREE_ENDS[tree.dimensions])
        reach = [2 * np.pi if end.startswith("angle") else 0.6 for end in ends]
        q[at] = rng.uniform(-1.0, 1.0, len(ends)) * reach
        if ends[-4:] == ENDS["ball"]:
            quaternion = rng.normal(size=4)
            q[at.stop - 4 : at.stop] = quaternion / np.linalg.norm(quaternion)
        speed = [3.0 if end.startswith(("angle", "q")) else 1.0 for end in ends if end != "qw"]
        v[rate] = rng.uniform(-1.0, 1.0, len(speed)) * speed
    return q, v


# Random trees.

Spec = str | float
"""A quantity as it is drawn: a formula over the shared parameters, or a bare number."""
Fit = Callable[[np.ndarray], bool]
SHARED = {"m": 0.9, "l": 0.55, "g": 9.81, "I": 0.04}
KINDS: dict[int, tuple[str, ...]] = {
    PLANE: ("revolute", "revolute", "prismatic", "planar", "weld"),
    SPACE: ("revolute", "prismatic", "cylindrical", "universal", "planar", "ball", "weld"),
}
TURNING = ("revolute", "cylindrical")
LEAST_ARM = 0.15
"""Least distance, in m, of a particle from the axis that it turns about."""


class _Writer:
    """Draws quantities, and remembers the parameters that eomgen makes of bare numbers."""

    def __init__(
        self, rng: np.random.Generator, dimensions: int, given: Mapping, *, pins: bool = False
    ) -> None:
        self.rng, self.dimensions, self.given, self.pins = rng, dimensions, given, pins
        self.shared = {name: given.get(name, value) for name, value in SHARED.items()}
        self.named: dict[str, float] = {}
        self.places: dict[str, np.ndarray] = {}

    def chance(self, share: float) -> bool:
        """True in this share of cases."""
        return bool(self.rng.random() < share)

    def pick(self, *choices: Spec) -> Spec:
        """One of several."""
        return choices[int(self.rng.integers(len(choices)))]

    def number(self, low: float, high: float, digits: int = 3) -> float:
        """A bare number."""
        return round(float(self.rng.uniform(low, high)), digits)

    def write(self, spec: Spec, name: str) -> tuple[str, float]:
        """A drawn quantity as TOML and as a number; `name` is the parameter of a bare one."""
        if isinstance(spec, str):
            return f'"{spec}"', float(eval(spec, {}, self.shared))
        if spec == 0.0:
            return "0", 0.0
        self.named[name] = self.given.get(name, spec)
        return repr(self.named[name]), self.named[name]

    def write_all(self, specs: list, name: str, ends: Iterable) -> tuple[str, list[float]]:
        """Several of them, as a list."""
        pairs = [self.write(s, f"{name}_{e}") for s, e in zip(specs, ends, strict=False)]
        return f"[{', '.join(text for text, _ in pairs)}]", [value for _, value in pairs]

    def place(self, name: str, fits: Fit = lambda place: True) -> tuple[str, Vector]:
        """A place as TOML and as numbers; at the default parameters (see `places`) it `fits`."""
        default = self.places[name] = np.zeros(3)
        while True:
            bare = self.rng.choice([-1, 1], 3) * np.round(self.rng.uniform(0.1, 0.8, 3), 3)
            bare = bare[: self.dimensions].tolist()
            specs = [self.pick(0.0, 0.0, "l", "-l/2", x, x) for x in bare]
            default[: self.dimensions] = [eval(str(spec), {}, SHARED) for spec in specs]
            if fits(default):
                break
        text, (x, y, *z) = self.write_all(specs, name, "xyz")
        return text, (x, y, z[0] if z else 0.0)

    def direction(self) -> Vector:
        """A unit vector, half the time along a coordinate axis."""
        vector = self.rng.normal(size=3)
        if self.chance(0.5):
            vector = np.eye(3)[self.rng.integers(self.dimensions)] * self.rng.choice([-1.0, 1.0])
        vector[self.dimensions :] = 0.0
        x, y, z = (vector / np.linalg.norm(vector)).tolist()
        return x, y, z

    def orientation(self) -> Vector:
        """Degrees about x, y, z: none, multiples of 90, or any; in the plane about z alone."""
        quarters = self.rng.choice([-90.0, 0.0, 90.0, 180.0, 270.0], 3)
        general = np.round(self.rng.uniform(-180.0, 180.0, 3), 1)
        x, y, z = (np.zeros(3), quarters, general)[self.rng.integers(3)].tolist()
        return (x, y, z) if self.dimensions == SPACE else (0.0, 0.0, z)

    def inertia(self, name: str) -> tuple[str, tuple[float, ...]]:
        """The inertia of a solid body: an entry, a diagonal or a matrix; bare or formulas."""
        if self.dimensions == PLANE:
            spec = self.pick("I", "m*l**2/6 + I", self.number(0.02, 0.2))
            text, value = self.write(spec, name)
            return text, (0.0, 0.0, value, 0.0, 0.0, 0.0)
        sides = self.rng.uniform(0.2, 0.8, 3) ** 2
        principal = self.rng.uniform(0.5, 5.0) / 12 * (sides.sum() - sides)
        axes = Rotation.from_quat(self.rng.normal(size=4)).as_matrix()
        matrix = axes @ np.diag(principal) @ axes.T
        entries = np.round(matrix[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]], 5).tolist()
        formulas = [["m*l**2/6 + I"] * 2 + ["I"], ["2*I", "2*I", "m*l**2/6", "I/4", "-I/5", 0.0]]
        specs = [*formulas, np.round(principal, 4).tolist(), entries][min(self.rng.integers(5), 3)]
        text, values = self.write_all(specs, name, ("xx", "yy", "zz", "xy", "xz", "yz"))
        return text, (*values, 0.0, 0.0, 0.0)[:6]


def random_spatial_tree(
    seed: int,
    dimensions: int = SPACE,
    most: int = 4,
    given: Mapping[str, float] | None = None,
    *,
    pins: bool = False,
) -> tuple[SpatialTree, str]:
    """A mechanism of 1 to `most` bodies from a seed, and its scene as TOML.

    Every joint type of the plane or of space; chains and branches, one tree or several, on the
    world or floating; axes and orientations special and general; solid bodies, particles and
    massless bodies, these two only where the mass matrix is regular at every position: a particle
    on a weld, on a slide, or away from its hinge; a massless body on a weld, or on a hinge or slide
    before another one that moves a solid body differently. The scene lists bodies and joints in any
    order. `given` are other values for some of the tree's `parameters`; nothing else changes.

    With `pins` it has at least two bodies, which are solid or particles, and all are free or held
    by a revolute joint without rotor and orientation: what the handout derives.
    """
    rng = np.random.default_rng([seed, dimensions, most])
    writer = _Writer(rng, dimensions, given or {}, pins=pins)
    n = int(rng.integers(2 if pins else 1, most + 1))
    straight, parent = float(rng.uniform(0.2, 0.9)), [-1]
    for k in range(1, n):
        near = k - 1 if writer.chance(straight) else int(rng.integers(k))
        parent.append(near if writer.chance(0.88) else -1)
    hollow: dict[int, int] = {}  # a massless body that moves, and the solid child it moves
    for k in range(n):
        children = [c for c in range(k + 1, n) if parent[c] == k]
        if children and not pins and k not in hollow.values() and writer.chance(0.15):
            hollow[k] = children[0]
    bodies, body_tables, joint_tables = [], [], []
    for k in range(n):
        before = bodies[parent[k]].joint if k in hollow.values() else None
        every = ("revolute", "weld") if pins else KINDS[dimensions]
        kinds = every[: -1 if k == 0 or pins else None]  # the first body moves
        kind = kinds[int(rng.integers(len(kinds)))]
        if k in hollow or before is not None:
            kind = "revolute" if writer.chance(0.6) else "prismatic"
        elif parent[k] < 0 and writer.chance(0.4):
            kind = "free"
        massless = k in hollow or (kind == "weld" and writer.chance(0.2))
        held = before is None and not massless and kind in ("weld", "prismatic", *TURNING)
        particle = held and writer.chance(0.2)
        joint, table = _joint(writer, k, kind, parent[k], before, particle=particle)
        joint_tables.append(table)
        mass_text, mass, inertia_text, inertia = "0", 0.0, "0", (0.0,) * 6
        if not massless:
            spec = writer.pick("m", "2*m", *(writer.number(0.2, 5.0) for _ in range(3)))
            mass_text, mass = writer.write(spec, f"b{k}_mass")
            if not particle:
                inertia_text, inertia = writer.inertia(f"b{k}_inertia_com")
        head = f'[[bodies]]\nname = "b{k}"\n'
        body_tables.append(f"{head}mass = {mass_text}\ninertia_com = {inertia_text}\n")
        bodies.append(TreeBody(f"b{k}", mass, inertia, joint))

    extra, gravity = [], 0.0
    if writer.chance(0.8):
        text, gravity = writer.write(writer.pick("g", "g", 3.71), "gravity_g")
        extra.append(f'[[effects]]\ntype = "gravity"\ng = {text}\n')
    driven = [k for k, b in enumerate(bodies) if b.joint.kind in ("revolute", "prismatic")]
    motor = int(rng.choice(driven)) if driven and writer.chance(0.6) else -1
    if motor >= 0:
        head = f'[[effects]]\ntype = "motor"\nname = "drive"\njoint = "j{motor}"\n'
        extra.append(f'{head}torque = "input"\n')
    pushes, points = [], []
    if writer.chance(0.6):
        pushed, (text, place) = int(rng.integers(n)), writer.place("push_at")
        head = f'[[effects]]\ntype = "external_force"\nname = "push"\nbody = "b{pushed}"\n'
        extra.append(f'{head}at = {text}\nforce = "input"\n')
        pushes.append(("push", pushed, place))
    if writer.chance(0.5):
        shown, (text, place) = int(rng.integers(n)), writer.place("tip_at")
        extra.append(f'[[points]]\nname = "tip"\nbody = "b{shown}"\nat = {text}\n')
        points.append(("tip", shown, place))

    name = f"tree_{dimensions}_{seed}"
    head = f'name = "{name}"\noutputs = "all"\ndimensions = {dimensions}\n\n[parameters]\n'
    head += "".join(f"{key} = {value!r}\n" for key, value in writer.shared.items())
    tables = [head, *rng.permutation(body_tables), *rng.permutation(joint_tables), *extra]
    known = {**writer.shared, **writer.named}
    pushed_at, shown_at = tuple(pushes), tuple(points)
    tree = SpatialTree(name, dimensions, tuple(bodies), gravity, motor, pushed_at, shown_at, known)
    return tree, "\n".join(tables)


def _joint(
    writer: _Writer, k: int, kind: str, parent: int, before: TreeJoint | None, *, particle: bool
) -> tuple[TreeJoint, str]:
    """A joint as numbers and as TOML; `before` is that of the massless body that it hangs on."""
    space, free, name = writer.dimensions == SPACE, kind == "free", f"j{k}"
    lines = ["[[joints]]", f'type = "{kind}"', f'name = "{name}"', f'child = "b{k}"']
    if not free or writer.chance(0.5):
        lines.append(f'parent = "{"world" if parent < 0 else f"b{parent}"}"')
    orientation, axes, places, armature = ORIGIN, (Z,), [ORIGIN, ORIGIN], 0.0
    if not free:
        twin = before if before is not None and before.kind == kind else None
        orientation, axes = (ORIGIN, (Z,)) if writer.pins else _directions(writer, kind, twin)
        if kind == "universal":
            lines.append(f"axes = {[[*axis] for axis in axes]}")
        elif kind == "prismatic" or axes[0] != Z or (kind == "cylindrical" and writer.chance(0.5)):
            lines.append(f"axis = {[*axes[0]][: writer.dimensions]}")
        if orientation != ORIGIN or writer.chance(0.5):
            lines.append(f"orientation_deg = {[*orientation] if space else orientation[2]!r}")
        hinge, arm = axes[0], LEAST_ARM if particle and kind in TURNING else 0.0
        last = writer.places[f"{twin.name}_r_child"] if twin is not None else np.full(3, np.inf)
        fits: dict[str, Fit] = {
            "r_parent": lambda place: bool(np.linalg.norm(place - last) > 2 * LEAST_ARM),
            "r_child": lambda place: bool(np.linalg.norm(np.cross(hinge, place)) >= arm),
        }
        for i, (end, fit) in enumerate(fits.items()):
            text, places[i] = writer.place(f"{name}_{end}", fit)
            if places[i] != ORIGIN or writer.chance(0.5):
                lines.append(f"{end} = {text}")
    if kind in ("revolute", "prismatic") and not writer.pins and writer.chance(0.3):
        text, armature = writer.write(writer.number(0.001, 0.01, 4), f"{name}_motor_inertia")
        lines.append(f"motor_inertia = {text}")
        if writer.chance(0.7):
            text, ratio = writer.write(writer.number(2.0, 10.0, 1), f"{name}_gear_ratio")
            lines.append(f"gear_ratio = {text}")
            armature *= ratio**2
    if kind in ("ball", "universal", "particle") and k % 2:
        text, armature = writer.write(0.0125 * (k + 1), f"{name}_motor_inertia")
        lines.append(f"motor_inertia = {text}")
    ends = FREE_ENDS[writer.dimensions] if free else ENDS[kind]
    prefix = f"b{k}" if free else name
    coordinates = tuple(f"{prefix}_{end}" for end in ends)
    whole = ends[-4:] == ENDS["ball"]
    if ends and not whole and writer.chance(0.4):
        coordinates = tuple(f"q{k}_{i}" for i in range(len(ends)))
        listed = ", ".join(f'"{own}"' for own in coordinates)
        lines.append(f"coordinate = {listed}" if len(ends) == 1 else f"coordinates = [{listed}]")
    velocities = tuple(f"{own}_dot" for own in coordinates)
    if whole:
        velocities = (*velocities[:-4], *(f"{prefix}_w{x}" for x in "xyz"))
    numbers = (*places, orientation, axes, armature, coordinates, velocities)
    return TreeJoint(name, kind, parent, *numbers), "\n".join(lines) + "\n"


def _directions(writer: _Writer, kind: str, twin: TreeJoint | None) -> tuple[Vector, Vectors]:
    """Orientation and axes (z where the scene names none) of a joint, not parallel to its twin."""
    while True:
        orientation, axes = writer.orientation(), (Z,)
        if kind == "prismatic" or (writer.dimensions == SPACE and kind in TURNING):
            axes = (writer.direction(),)
        elif kind == "universal":
            axes = (writer.direction(), writer.direction())
        turned = Rotation.from_euler("xyz", orientation, degrees=True).apply(axes[0])
        parallel = twin is not None and abs(twin.axes[0] @ turned) > 0.7
        if kind == "universal":
            parallel = abs(np.dot(*axes)) > 0.8
        if not parallel or (writer.dimensions == PLANE and kind == "revolute"):
            return orientation, axes
