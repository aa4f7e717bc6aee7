"""Mechanisms that all but stand in line, and their accelerations from the numbers of their scenes.

Angles, axes, arms, directions of forces and moments of inertia are off alignment by 1e-17 to 1, log
uniformly, or not at all. Nothing here imports eomgen: a case is plain numbers, written as a scene
for eomgen and solved in 100 digits here, joint by joint from the world outwards, by Newton, Euler
and d'Alembert, with dense elimination.
"""

import math
import random
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import gmpy2
import numpy as np
from gmpy2 import mpfr

BITS = 340
"""Of the numbers here: 100 digits."""
NOTHING = 1e-60
"""What is left by them of an acceleration that is 0."""
HALF_AN_ULP = 2.0**-53
Vector = np.ndarray
Matrix = np.ndarray
"""Of numbers like these."""
Near = Callable[[float], Any]
"""A number as it is, or changed by up to half a unit in the last place."""

KINDS = {
    2: ("revolute", "revolute", "prismatic", "prismatic", "planar", "weld"),
    3: ("revolute", "revolute", "prismatic", "cylindrical", "universal", "planar", "ball", "weld"),
}
ENDS = {
    "revolute": ("angle",), "prismatic": ("slide",), "cylindrical": ("slide", "angle"),
    "universal": ("angle_1", "angle_2"), "planar": ("x", "y", "angle"),
    "ball": ("qw", "qx", "qy", "qz"), "weld": (),
}  # fmt: skip
"""How the names of coordinates end."""


@dataclass(frozen=True)
class Link:
    """A body and the joint that holds it, as the scene has them; see `docs/reference`.

    `inertia` is xx, yy, zz, xy, xz, yz; `held` is what a locked coordinate is held at, degrees or
    metres, and `spring` the stiffness and rest of a spring on each of the joint's coordinates.
    """

    kind: str
    parent: int
    r_parent: tuple[float, ...]
    r_child: tuple[float, ...]
    orientation: tuple[float, float, float]
    axes: tuple[tuple[float, ...], ...]
    mass: float
    inertia: tuple[float, ...]
    rotor: float
    held: float | None
    spring: tuple[float, float] | None


@dataclass(frozen=True)
class Case:
    """A mechanism at a state: gravity g along `down`, a force on the last body's `pushed` point."""

    dimensions: int
    links: tuple[Link, ...]
    g: float
    down: tuple[float, ...] | None
    force: tuple[float, ...] | None
    force_axes: str
    pushed: tuple[float, ...]
    q: tuple[float, ...]
    v: tuple[float, ...]


# Random cases.


class _Draw:
    """What is off alignment by some part, seeded."""

    def __init__(self, number: int) -> None:
        self.r = random.Random(number)
        self.dimensions = self.r.choice((2, 3))
        # How much of it is off, so that some mechanisms are so by one number only.
        self.share = self.r.choice((0.05, 0.2, 0.5, 0.9))

    def chance(self, share: float) -> bool:
        return self.r.random() < share

    def slight(self) -> float:
        """1e-17 to 1, of either sign; or 0."""
        if not self.chance(self.share):
            return 0.0
        return self.r.choice((-1.0, 1.0)) * 10.0 ** self.r.uniform(-17, 0)

    def direction(self) -> tuple[float, ...]:
        """All but a coordinate axis, of any length."""
        parts = [self.slight() for _ in range(self.dimensions)]
        parts[self.r.randrange(self.dimensions)] = self.r.choice((-1.0, 1.0))
        size = self.r.choice((1.0, 1.0, self.r.uniform(0.2, 5.0)))
        return tuple(size * x for x in parts)

    def arm(self) -> tuple[float, ...]:
        """One or none of these."""
        if self.chance(0.25):
            return tuple(self.slight() for _ in range(self.dimensions))
        return self.direction()

    def degrees(self) -> float:
        """All but a multiple of 90."""
        return self.r.choice((0.0, 0.0, 90.0, -90.0, 180.0)) + math.degrees(self.slight())

    def orientation(self) -> tuple[float, float, float]:
        if self.dimensions == 2:
            return (0.0, 0.0, self.degrees())
        x, y, z = ((self.degrees() if self.chance(0.5) else 0.0) for _ in range(3))
        return (x, y, z)

    def moment(self) -> float:
        """0.01 to 1, or down to 1e-17 of that."""
        return abs(self.slight()) * self.r.uniform(0.01, 1.0) or self.r.uniform(0.01, 1.0)

    def inertia(self) -> tuple[float, ...]:
        """That of a solid: second moments a, b, c of mass along x, y, z, and mixed ones."""
        if self.dimensions == 2:
            return (0.0, 0.0, self.moment(), 0.0, 0.0, 0.0)
        a, b, c = (self.moment() for _ in range(3))
        mixed = [0.5 * self.slight() * math.sqrt(p * q) for p, q in ((a, b), (a, c), (b, c))]
        return (b + c, a + c, a + b, *(-x for x in mixed))


def case(number: int) -> Case:
    """The case of a number, always the same."""
    d = _Draw(number)
    r, n = d.r, d.r.choice((1, 1, 2, 2, 3, 4))
    links: list[Link] = []
    for k in range(n):
        parent = -1 if k == 0 or d.chance(0.1) else r.choice((k - 1, r.randrange(k)))
        if k and not links[-1].mass:
            parent = k - 1  # or nothing would resist its motion
        kind = r.choice(KINDS[d.dimensions][: -1 if k == 0 else None])
        if parent < 0 and d.chance(0.15):
            kind = "free"
        hollow = k < n - 1 and kind in ("revolute", "prismatic") and d.chance(0.15)
        mass = 0.0 if hollow else r.uniform(0.2, 5.0)
        particle = kind in ("weld", "prismatic") and d.chance(0.2)
        inertia = (0.0,) * 6 if hollow or particle else d.inertia()
        single = kind in ("revolute", "prismatic")
        axes = [d.direction() for _ in range(2)]
        while kind == "universal" and _main(axes[0]) == _main(axes[1]):
            axes[1] = d.direction()
        if d.dimensions == 2 and kind != "prismatic":
            axes = [(0.0, 0.0, 1.0)] * 2
        links.append(
            Link(
                kind,
                parent,
                d.arm(),
                d.arm(),
                d.orientation(),
                tuple(axes),
                mass,
                inertia,
                r.uniform(0.01, 0.5) if single and d.chance(0.1) else 0.0,
                _held(d, kind) if single and k > 0 and d.chance(0.08) else None,
                (r.uniform(0.5, 50.0), r.choice((0.0, d.slight()))) if d.chance(0.2) else None,
            )
        )
    force = d.direction() if d.chance(0.3) else None
    down = d.direction() if d.chance(0.4) else None
    force_axes, pushed = r.choice(("world", "body")), d.arm()
    q, v = _state(d, links)
    g, made = r.choice((0.0, 9.81, 9.81)), tuple(links)
    return Case(d.dimensions, made, g, down, force, force_axes, pushed, q, v)


def _main(axis: Sequence[float]) -> int:
    """The coordinate axis that an axis is nearest to."""
    return max(range(len(axis)), key=lambda i: abs(axis[i]))


def _held(d: _Draw, kind: str) -> float:
    """What a coordinate is locked at, degrees or m."""
    return d.degrees() if kind == "revolute" else d.r.choice((0.0, 1.0, 0.5)) + d.slight()


def _state(d: _Draw, links: Sequence[Link]) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Coordinates of 0, of quarter turns, slight or random ones; velocities of 0 or not."""
    r, places = d.r, "at rest" if d.chance(0.4) else "moving"
    aligned = d.chance(0.6)
    q: list[float] = []
    v: list[float] = []
    for link in links:
        ends = coordinates(link, d.dimensions)
        quaternion = [end for end in ends if end in ENDS["ball"]]
        for end in ends:
            if end in quaternion:
                continue
            anywhere = r.uniform(-3, 3)
            turns = end.startswith("angle")
            lined = r.choice((0.0, 0.0, r.choice((-1, 1, 2)) * math.pi / 2 if turns else 1.0))
            q.append(lined + d.slight() if aligned else anywhere)
        if quaternion:
            parts = [1.0, *(d.slight() for _ in range(3))]
            if not aligned:
                parts = [r.gauss(0, 1) for _ in range(4)]
            length = math.hypot(*parts)
            q += [x / length for x in parts]
        count = len(ends) - bool(quaternion)
        v += [0.0 if places == "at rest" else r.uniform(-3, 3) for _ in range(count)]
    return tuple(q), tuple(v)


def coordinates(link: Link, dimensions: int) -> tuple[str, ...]:
    """Ends of the names of those coordinates of a joint that are states, in their order."""
    if link.held is not None:
        return ()
    if link.kind == "free":
        return ("x", "y", "angle") if dimensions == 2 else ("x", "y", "z", *ENDS["ball"])
    return ENDS[link.kind]


def names(given: Case) -> tuple[list[str], list[str]]:
    """Names of the coordinates and of the velocities, in the order of q and v."""
    q: list[str] = []
    v: list[str] = []
    for k, link in enumerate(given.links):
        for end in coordinates(link, given.dimensions):
            name = f"{'b' if link.kind == 'free' else 'j'}{k}_{end}"
            q.append(name)
            if end in ENDS["ball"]:
                v += [f"{name[:-2]}w{end[1]}"] if end != "qw" else []
            else:
                v.append(f"{name}_dot")
    return q, v


# As a scene.


def scene(given: Case, **more: object) -> str:
    """The scene of a case as TOML; `more` keys of it."""
    lines = ['name = "aligned"', f"dimensions = {given.dimensions}"]
    lines += [f'{key} = "{value}"' for key, value in more.items()]
    held = [(k, link) for k, link in enumerate(given.links) if link.held is not None]
    for k, link in enumerate(given.links):
        inertia = list(link.inertia) if any(link.inertia) else "0"
        if given.dimensions == 2 and any(link.inertia):
            inertia = link.inertia[2]
        lines += [
            "[[bodies]]",
            f'name = "b{k}"',
            f"mass = {link.mass!r}",
            f"inertia_com = {inertia}",
        ]
        parent = "world" if link.parent < 0 else f"b{link.parent}"
        lines += ["[[joints]]", f'name = "j{k}"', f'type = "{link.kind}"', f'child = "b{k}"']
        if link.kind == "free":
            continue
        turned = list(link.orientation) if given.dimensions == 3 else link.orientation[2]
        lines += [f'parent = "{parent}"', f"orientation_deg = {turned}"]
        lines += [f"r_parent = {list(link.r_parent)}", f"r_child = {list(link.r_child)}"]
        if link.kind == "universal":
            lines.append(f"axes = {[list(axis) for axis in link.axes]}")
        elif link.kind in ("prismatic", "revolute", "cylindrical") and len(link.axes[0]) == (
            given.dimensions
        ):
            lines.append(f"axis = {list(link.axes[0])}")
        if link.rotor:
            lines.append(f"motor_inertia = {link.rotor!r}")
    lines += ["[[effects]]", 'type = "gravity"', f"g = {given.g!r}"]
    if given.down is not None:
        lines.append(f"direction = {list(given.down)}")
    if given.force is not None:
        lines += ["[[effects]]", 'type = "external_force"', 'name = "push"']
        lines += [f'body = "b{len(given.links) - 1}"', f"force = {list(given.force)}"]
        lines += [f"at = {list(given.pushed)}", f'axes = "{given.force_axes}"']
    for k, link in enumerate(given.links):
        if _sprung(link):
            stiffness, rest = _spring(link)
            lines += ["[[effects]]", 'type = "joint_spring"', f'name = "s{k}"', f'joint = "j{k}"']
            lines += [f"stiffness = {stiffness!r}", f"rest = {rest!r}"]
    if held:
        lines.append("[locked]")
        for k, link in held:
            end = "angle_deg" if link.kind == "revolute" else "slide"
            lines.append(f"j{k}_{end} = {link.held!r}")
    return "\n".join(lines)


def _sprung(link: Link) -> bool:
    """Whether a spring holds the joint's coordinate."""
    return link.spring is not None and link.held is None and link.kind in ("revolute", "prismatic")


def _spring(link: Link) -> tuple[float, float]:
    assert link.spring is not None
    return link.spring


# Solved.


def exactly(given: Case) -> list[Any]:
    """v̇ at the numbers of the case. Raises `ZeroDivisionError` if the mass matrix is singular."""
    with gmpy2.context(precision=BITS):
        return _Solver(given, mpfr).solve()


def nearby(given: Case, seed: int) -> list[Any]:
    """v̇ where every number of the case is changed by up to half a unit in the last place, each time
    that it is used: but for multiples of 90 degrees, which mean themselves.
    """
    r = random.Random(seed)
    with gmpy2.context(precision=BITS):
        # In doubles, one and half a unit would be one.
        return _Solver(
            given, lambda x: mpfr(x) * (1 + mpfr(r.uniform(-1, 1) * HALF_AN_ULP))
        ).solve()


@dataclass
class _Frame:
    """Axes `R` that turn at w, with the partial velocities by each velocity, turning and of the
    origin, and what velocities alone make of the accelerations.
    """

    R: Matrix
    w: Vector
    alpha: Vector
    a: Vector
    turn: Matrix
    move: Matrix


@dataclass
class _Solver:
    given: Case
    near: Near
    frames: list[_Frame] = field(default_factory=list)

    def solve(self) -> list[Any]:
        c = self.given
        nv = len(c.v)
        q, v = [self.near(x) for x in c.q], [self.near(x) for x in c.v]
        M, right = np.full((nv, nv), mpfr(0)), np.full(nv, mpfr(0))
        down = self._unit(c.down) if c.down is not None else _vector(c.dimensions - 1, -1)
        g = self.near(c.g) * down
        i = j = 0
        for link in c.links:
            frame = self._at(link.parent, nv)
            frame, i, j = self._held(link, frame, q, v, i, j)
            self.frames.append(frame)
            mass = self.near(link.mass)
            inertia = self._inertia(link, frame)
            torque = inertia @ frame.alpha + np.cross(frame.w, inertia @ frame.w)
            force = mass * (frame.a - g)
            right -= frame.move @ force + frame.turn @ torque
            M += mass * frame.move @ frame.move.T + frame.turn @ inertia @ frame.turn.T
            if link.rotor and link.held is None:
                M[j - 1, j - 1] += self.near(link.rotor)
            if _sprung(link):
                stiffness, rest = map(self.near, _spring(link))
                right[j - 1] -= stiffness * (q[i - 1] - rest)
        if c.force is not None:
            body = self.frames[-1]
            push = self._space(c.force)
            push = body.R @ push if c.force_axes == "body" else push
            at = body.R @ self._space(c.pushed)
            right += (body.move + np.cross(body.turn, at)) @ push
        return _solved(M, right)

    def _space(self, vector: Sequence[float]) -> Vector:
        return np.array([*map(self.near, vector), mpfr(0)][:3])

    def _unit(self, vector: Sequence[float]) -> Vector:
        x = self._space(vector)
        return x / gmpy2.sqrt(x @ x)

    def _at(self, parent: int, nv: int) -> _Frame:
        if parent >= 0:
            return self.frames[parent]
        nothing, none = np.full(3, mpfr(0)), np.full((nv, 3), mpfr(0))
        return _Frame(_eye(), nothing, nothing, nothing, none, none)

    def _inertia(self, link: Link, frame: _Frame) -> Matrix:
        xx, yy, zz, xy, xz, yz = map(self.near, link.inertia)
        own = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        return frame.R @ own @ frame.R.T

    def _held(
        self, link: Link, frame: _Frame, q: Vector, v: Vector, i: int, j: int
    ) -> tuple[_Frame, int, int]:
        """A body's frame, and how many coordinates and velocities there are up to it."""
        if link.kind != "free":
            frame = _moved(frame, frame.R @ self._space(link.r_parent))
            frame = _turned(frame, self._orientation(link.orientation))
        for end in self._moves(link):
            if end == "spin":
                frame = _spun(frame, q[i : i + 4], v[j : j + 3], j)
                i, j = i + 4, j + 3
            elif end.startswith("slide"):
                axis = self._axis(link, end)
                if link.held is not None:
                    frame = _moved(frame, self.near(link.held) * (frame.R @ axis))
                    continue
                frame = _slid(frame, axis, q[i], v[j], j)
                i, j = i + 1, j + 1
            else:
                axis = self._axis(link, end)
                if link.held is not None:
                    frame = _turned(frame, _about(axis, self._radians(link.held)))
                else:
                    frame = _turning(frame, axis, q[i], v[j], j)
                    i, j = i + 1, j + 1
                # An axis that stands askew is used twice: to get to it, and back.
                frame = _turned(frame, _between(axis, self._axis(link, end)))
        if link.kind != "free":
            frame = _moved(frame, -(frame.R @ self._space(link.r_child)))
        return frame, i, j

    def _moves(self, link: Link) -> Iterator[str]:
        space = self.given.dimensions == 3
        match link.kind:
            case "free":
                yield from (("slide x", "slide y", "slide z")[: self.given.dimensions])
                yield "spin" if space else "turn z"
            case "planar":
                yield from ("slide x", "slide y", "turn z")
            case "ball":
                yield "spin"
            case "cylindrical":
                yield from ("slide 0", "turn 0")
            case "universal":
                yield from ("turn 0", "turn 1")
            case "prismatic":
                yield "slide 0"
            case "revolute":
                yield "turn 0"

    def _axis(self, link: Link, end: str) -> Vector:
        name = end[-1]
        return _vector("xyz".index(name)) if name in "xyz" else self._unit(link.axes[int(name)])

    def _radians(self, degrees: float) -> Any:
        whole = math.fmod(degrees, 90.0) == 0.0
        return (mpfr(degrees) if whole else self.near(degrees)) * gmpy2.const_pi() / 180

    def _orientation(self, degrees: Sequence[float]) -> Matrix:
        turned = _eye()
        for k, angle in enumerate(degrees):
            turned = _about(_vector(k), self._radians(angle)) @ turned
        return turned


def _vector(k: int, size: int = 1) -> Vector:
    return np.array([mpfr(size if k == i else 0) for i in range(3)])


def _eye() -> Matrix:
    return np.array([_vector(k) for k in range(3)])


def _about(axis: Vector, angle: Any) -> Matrix:
    """Rotation about a unit vector (Rodrigues)."""
    return _rotation(axis, gmpy2.cos(angle), gmpy2.sin(angle))


def _rotation(n: Vector, c: Any, s: Any) -> Matrix:
    return np.outer(n, n) * (1 - c) + s * np.cross(n, _eye()).T + c * _eye()


def _between(a: Vector, b: Vector) -> Matrix:
    """From the coordinate axis nearest to both to a, and back from b."""
    k = _main(a)
    e = _vector(k, 1 if a[k] > 0 else -1)
    return _shortest(e, a) @ _shortest(e, b).T


def _shortest(a: Vector, b: Vector) -> Matrix:
    """The shortest turn between two unit vectors."""
    n = np.cross(a, b)
    s = gmpy2.sqrt(n @ n)
    return _rotation(n / s, a @ b, s) if s else _eye()


def _moved(f: _Frame, d: Vector) -> _Frame:
    """The origin moved by a vector, world axes, that is fixed in the frame."""
    a = f.a + np.cross(f.alpha, d) + np.cross(f.w, np.cross(f.w, d))
    return replace(f, a=a, move=f.move + np.cross(f.turn, d))


def _turned(f: _Frame, fixed: Matrix) -> _Frame:
    return replace(f, R=f.R @ fixed)


def _slid(f: _Frame, axis: Vector, way: Any, rate: Any, j: int) -> _Frame:
    n = f.R @ axis
    f = _moved(f, way * n)
    move = f.move.copy()
    move[j] += n
    return replace(f, a=f.a + 2 * rate * np.cross(f.w, n), move=move)


def _turning(f: _Frame, axis: Vector, angle: Any, rate: Any, j: int) -> _Frame:
    n = f.R @ axis
    turn = f.turn.copy()
    turn[j] += n
    return _whirled(replace(f, R=f.R @ _about(axis, angle), turn=turn), rate * n)


def _whirled(f: _Frame, own: Vector) -> _Frame:
    """With an angular velocity of its own."""
    return replace(f, alpha=f.alpha + np.cross(f.w, own), w=f.w + own)


def _spun(f: _Frame, quaternion: Vector, spin: Vector, j: int) -> _Frame:
    """Turned by a quaternion of any length, at angular velocity `spin` in the turned axes."""
    length = gmpy2.sqrt(sum(x * x for x in quaternion))
    w, *rest = [x / length for x in quaternion]
    v = np.array(rest)
    sine = gmpy2.sqrt(v @ v)
    R = f.R @ _rotation(v / sine, w * w - sine * sine, 2 * w * sine) if sine else f.R
    turn = f.turn.copy()
    turn[j : j + 3] += R.T
    return _whirled(replace(f, R=R, turn=turn), R @ np.array(spin))


def _solved(matrix: Matrix, right: Vector) -> Vector:
    """By elimination with row exchanges."""
    a, n = [[*row, x] for row, x in zip(matrix, right, strict=True)], len(right)
    for k in range(n):
        pivot = max(range(k, n), key=lambda i: abs(a[i][k]))
        if not a[pivot][k]:
            raise ZeroDivisionError("the mass matrix is singular")
        a[k], a[pivot] = a[pivot], a[k]
        for row in a[k + 1 :]:
            factor = row[k] / a[k][k]
            for j in range(k, n + 1):
                row[j] -= factor * a[k][j]
    x: Vector = [mpfr(0)] * n
    for k in reversed(range(n)):
        x[k] = (a[k][n] - sum(a[k][j] * x[j] for j in range(k + 1, n))) / a[k][k]
    return x
