"""What a figure or page shows: one run of one mechanism, as plain values."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from eomgen.base.errors import RunError
from eomgen.base.frozen import Frozen
from eomgen.scene.look import BARE, Shape, numbers
from eomgen.show.framing import Framing, View
from eomgen.show.picture import Picture
from eomgen.tables.poses import places_of, world_points

Array = NDArray[np.float64]

Anchor = tuple[int, float, float] | tuple[int, float, float, float]
"""A joint's mark: the body's index, then x, y (in space also z) in body axes, m."""

MOST_ROWS = 3000
"""More samples than these only make a picture larger."""

INSTANTS = 8
"""Number of times at which a still figure shows the mechanism."""

MOST_TRACES = 12
"""Greatest number of bodies whose paths are drawn: more paths would hide everything else."""


MOST_MARKS = 30
"""Greatest number of joints marked in a still figure: more marks would hide the bodies."""


@dataclass(frozen=True)
class Plane:
    """A fixed plane n·x = `offset`, m, with unit `normal` n towards the free side; world axes."""

    normal: tuple[float, ...]
    offset: float


@dataclass(frozen=True, eq=False)
class Motion(Frozen):
    """A run of a mechanism: n samples, ny states, nb bodies, nj joints that hold a common point.

    positions     indices of the states that are coordinates
    quaternions   indices of those that form a unit quaternion
    poses         in the plane, world x, y of each body's centre of mass and its angle; in space,
                  [world_R_body | world x, y, z of the centre of mass]
    joint_drift   distance between a joint's points on parent and child
    anchors       points to mark as joints
    works         done since the start by each effect, or by all of a type; None if not asked for
    planes        fixed obstacles that bodies touch
    framing       the view of a picture of it, or what determines it
    keeps_energy  whether exact motion conserves energy
    picture       of which the shapes are a part; its numbers are formulas of parameters
    drawn         the picture with the values of these formulas
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
    framing: View | Framing
    integrator: str
    finished: bool
    message: str
    anchors: tuple[Anchor, ...] = ()
    quaternions: tuple[tuple[int, int, int, int], ...] = ()
    works: Array | None = None  # (n, m) J, of m effects
    effects: tuple[str, ...] = ()  # m names
    planes: tuple[Plane, ...] = ()
    keeps_energy: bool = True
    picture: Picture | None = None
    drawn: Picture | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        n, ny, nb, nj = len(self.t), len(self.states), len(self.bodies), len(self.joints)
        assert self.t.shape == self.kinetic_energy.shape == self.potential_energy.shape == (n,)
        assert self.y.shape == (n, ny) and len(self.units) == ny
        assert self.poses.shape in ((n, nb, 3), (n, nb, 3, 4)) and len(self.shapes) == nb
        assert self.joint_drift.shape == (n, nj)
        assert self.works is None or self.works.shape == (n, len(self.effects))
        assert all(len(anchor) == 1 + self.dimensions for anchor in self.anchors)
        assert all(len(plane.normal) == self.dimensions for plane in self.planes)

    @property
    def dimensions(self) -> int:
        """2 in the plane, 3 in space."""
        return self.poses.ndim - 1

    @property
    def camera(self) -> View:
        """The view of a picture of it."""
        return self.framing.view if isinstance(self.framing, Framing) else self.framing

    @property
    def places(self) -> Array:
        """World positions (n, nb, 2) or (n, nb, 3) of the centres of mass, m."""
        return places_of(self.poses)

    @property
    def traced(self) -> tuple[int, ...]:
        """Indices of the bodies whose paths are drawn, including the first and the last."""
        count = len(self.bodies)
        kept = np.linspace(0, count - 1, min(count, MOST_TRACES)).round().astype(int)
        return tuple(map(int, kept))

    @property
    def colours(self) -> tuple[str, ...]:
        """A colour for each body, that of its first shape."""
        return tuple((shapes[0].color if shapes else None) or BARE for shapes in self.shapes)

    @property
    def center(self) -> Array:
        """The point that a camera without a body to follow looks at, world axes, m."""
        center = self.camera.center
        return np.zeros(self.dimensions) if center is None else np.array(center, dtype=float)

    @property
    def heading(self) -> str:
        """The title on one line; the name if there is no title."""
        return one_line(self.title) or self.name

    @property
    def summary(self) -> str:
        """Integrator, duration and number of samples, on one line."""
        samples = "1 sample" if len(self.t) == 1 else f"{len(self.t)} samples"
        return f"{one_line(self.integrator)} · {self.t[-1] - self.t[0]:.6g} s · {samples}"

    @property
    def stopped(self) -> str:
        """One sentence on why the run is unfinished; "" for a finished one."""
        if self.finished:
            return ""
        return f"The run stopped at t = {self.t[-1]:.6g} s: {one_line(self.message)}"


def one_line(text: str) -> str:
    """`text` without line breaks and unprintable characters."""
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())


def instants(motion: Motion) -> list[tuple[int, float]]:
    """The samples that a still figure shows, and their strength: 1 for the last, less before.

    The strength is a share of ink and not a transparency, so that overlapping parts stay clear.
    """
    last = len(motion.t) - 1
    rows = np.unique(np.linspace(0, last, INSTANTS).round().astype(int)).tolist()
    return [(k, 1.0 if k == last else 0.14 + 0.45 * i / INSTANTS) for i, k in enumerate(rows)]


def paths(motion: Motion) -> list[tuple[Array, str]]:
    """The paths (n, 2) or (n, 3) of the traced points, m, world axes, with their colours."""
    if motion.drawn is None:
        return [(motion.places[:, body], motion.colours[body]) for body in motion.traced]
    return [
        (world_points(motion.poses, trace.body, np.array(numbers(trace.at))), color)
        for trace in motion.drawn.traces
        for color in [motion.drawn.bodies[trace.body].color]
    ]


def thinned(motion: Motion, most: int = MOST_ROWS) -> Motion:
    """The finite samples of `motion`, at most `most` (>= 2), including the first and the last.

    Raises `RunError` if no sample is finite.
    """
    energies = (motion.kinetic_energy, motion.potential_energy)
    numbers = (motion.t, motion.y, motion.poses, *energies, motion.joint_drift)
    table = np.column_stack([part.reshape(len(motion.t), -1) for part in numbers])
    rows = np.flatnonzero(np.isfinite(table).all(axis=1))
    if not len(rows):
        raise RunError(f"{motion.name}: the run holds no finite sample, so nothing can be shown")
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
