"""What a figure or a page shows: one run of one mechanism, as plain values."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from eomgen.errors import RunError
from eomgen.scene.look import Camera, Shape

Array = NDArray[np.float64]

Anchor = tuple[int, float, float] | tuple[int, float, float, float]
"""A point to mark as a joint: the body's index, then x, y (in space z) in body axes, m."""

MOST_ROWS = 3000
"""Samples beyond this many add bytes to a picture and nothing to see."""

INSTANTS = 8
"""Instants that a still picture shows."""

BARE = "#4477aa"
"""The colour of a body without shapes."""

MOST_TRACES = 12
"""Bodies whose way is drawn: of more bodies than this only some, or nothing else is seen."""


MOST_MARKS = 30
"""Joints that a still picture marks: more marks than these hide what they mark."""


@dataclass(frozen=True)
class Plane:
    """A plane that stands still: n·x = `offset`, m, with n its `normal`, of length 1, to the free
    side; world axes.
    """

    normal: tuple[float, ...]
    offset: float


@dataclass(frozen=True)
class Ball:
    """A ball that stands still, or, with a `reach` beyond its surface, an obstacle of a field; m,
    world axes.
    """

    center: tuple[float, ...]
    radius: float
    reach: float | None = None


@dataclass(frozen=True, eq=False)
class Motion:
    """A run of a mechanism: n samples, ny states, nb bodies, nj joints that hold a common point.

    `positions` are the indices of those states that say where the bodies are, `quaternions` of
    those among them that make a unit quaternion. `poses` holds in the plane world x, y of each
    body's centre of mass and its angle, in space [world_R_body | world x, y, z of the centre of
    mass]. `joint_drift` is the distance between a joint's point on parent and on child. `anchors`
    are points to mark as joints. `works` are what each effect, or all of a type, have done since
    the start, None where that was not asked for. `planes` and `balls` are what stands still in the
    world and bodies touch or avoid. `keeps_energy` says whether exact motion would.
    """

    name: str
    title: str
    t: Array  # (n,) s
    y: Array  # (n, ny)
    states: tuple[str, ...]  # ny names
    units: tuple[str, ...]  # ny units, e.g. "rad/s"
    positions: tuple[int, ...]
    bodies: tuple[str, ...]  # nb names
    shapes: tuple[tuple[Shape, ...], ...]  # of each body, body axes
    joints: tuple[str, ...]  # nj names
    poses: Array  # (n, nb, 3) m, m, rad or (n, nb, 3, 4) 1 and m
    kinetic_energy: Array  # (n,) J
    potential_energy: Array  # (n,) J
    joint_drift: Array  # (n, nj) m
    camera: Camera
    integrator: str
    finished: bool
    message: str
    anchors: tuple[Anchor, ...] = ()
    quaternions: tuple[tuple[int, int, int, int], ...] = ()
    works: Array | None = None  # (n, m) J, of m effects
    effects: tuple[str, ...] = ()  # m names
    planes: tuple[Plane, ...] = ()
    balls: tuple[Ball, ...] = ()
    keeps_energy: bool = True

    def __post_init__(self) -> None:
        n, ny, nb, nj = len(self.t), len(self.states), len(self.bodies), len(self.joints)
        assert self.t.shape == self.kinetic_energy.shape == self.potential_energy.shape == (n,)
        assert self.y.shape == (n, ny) and len(self.units) == ny
        assert self.poses.shape in ((n, nb, 3), (n, nb, 3, 4)) and len(self.shapes) == nb
        assert self.joint_drift.shape == (n, nj)
        assert self.works is None or self.works.shape == (n, len(self.effects))
        assert all(len(anchor) == 1 + self.dimensions for anchor in self.anchors)
        assert all(len(plane.normal) == self.dimensions for plane in self.planes)
        assert all(len(ball.center) == self.dimensions for ball in self.balls)

    @property
    def dimensions(self) -> int:
        """2 in the plane, 3 in space."""
        return self.poses.ndim - 1

    @property
    def places(self) -> Array:
        """World positions (n, nb, 2) or (n, nb, 3) of the centres of mass, m."""
        return self.poses[..., :2] if self.dimensions == 2 else self.poses[..., 3]

    @property
    def traced(self) -> tuple[int, ...]:
        """Indices of the bodies whose way is drawn, the first and the last among them."""
        count = len(self.bodies)
        kept = np.linspace(0, count - 1, min(count, MOST_TRACES)).round().astype(int)
        return tuple(map(int, kept))

    @property
    def colours(self) -> tuple[str, ...]:
        """A colour for each body: that of its first shape."""
        return tuple(shapes[0].color if shapes else BARE for shapes in self.shapes)

    @property
    def center(self) -> Array:
        """Where the camera looks when it follows nothing, world axes, m."""
        center = self.camera.center
        return np.zeros(self.dimensions) if center is None else np.array(center, dtype=float)

    @property
    def heading(self) -> str:
        """The title on one line, or the name where there is no title."""
        return one_line(self.title) or self.name

    @property
    def summary(self) -> str:
        """Integrator, duration and number of samples, on one line."""
        samples = "1 sample" if len(self.t) == 1 else f"{len(self.t)} samples"
        return f"{one_line(self.integrator)} · {self.t[-1] - self.t[0]:.6g} s · {samples}"

    @property
    def stopped(self) -> str:
        """One sentence about why the run is unfinished, or "" for a finished one."""
        if self.finished:
            return ""
        return f"The run stopped at t = {self.t[-1]:.6g} s: {one_line(self.message)}"


def one_line(text: str) -> str:
    """`text` without line breaks and characters that no font shows."""
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())


def instants(motion: Motion) -> list[tuple[int, float]]:
    """Samples that a still picture shows, and how strongly: the last full, those before lighter.

    A part of the ink rather than a transparency, so that parts that overlap stay clear.
    """
    last = len(motion.t) - 1
    rows = np.unique(np.linspace(0, last, INSTANTS).round().astype(int)).tolist()
    return [(k, 1.0 if k == last else 0.14 + 0.45 * i / INSTANTS) for i, k in enumerate(rows)]


def thinned(motion: Motion, most: int = MOST_ROWS) -> Motion:
    """The finite samples of `motion`, at most `most` (>= 2) of them, the first and last among them.

    Raises `RunError` if no sample is finite.
    """
    energies = (motion.kinetic_energy, motion.potential_energy)
    numbers = (motion.t, motion.y, motion.poses, *energies, motion.joint_drift)
    table = np.column_stack([part.reshape(len(motion.t), -1) for part in numbers])
    rows = np.flatnonzero(np.isfinite(table).all(axis=1))
    if not len(rows):
        raise RunError(f"{motion.name}: the run holds no finite sample, nothing can be shown")
    if len(rows) > most:
        rows = rows[np.linspace(0, len(rows) - 1, most).round().astype(int)]
    return replace(
        motion,
        t=motion.t[rows],
        y=motion.y[rows],
        poses=motion.poses[rows],
        kinetic_energy=motion.kinetic_energy[rows],
        potential_energy=motion.potential_energy[rows],
        joint_drift=motion.joint_drift[rows],
        works=None if motion.works is None else motion.works[rows],
    )
