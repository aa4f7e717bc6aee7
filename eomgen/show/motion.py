"""What a figure or a page shows: one run of one mechanism, as plain values."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from eomgen.errors import RunError
from eomgen.scene.look import Camera, Shape

Array = NDArray[np.float64]

MOST_ROWS = 3000
"""Samples beyond this many add bytes to a picture and nothing to see."""


@dataclass(frozen=True, eq=False)
class Motion:
    """A run of a mechanism: n samples, ny states, nb bodies, nj joints.

    `positions` are the indices of those states that are lengths or angles; `poses` holds world x, y
    of each body's centre of mass and its angle; `joint_drift` the distance between a joint's point
    on parent and on child. `anchors` (body index, x, y in body axes) are points to mark as joints.
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
    poses: Array  # (n, nb, 3) m, m, rad
    kinetic_energy: Array  # (n,) J
    potential_energy: Array  # (n,) J
    joint_drift: Array  # (n, nj) m
    camera: Camera
    integrator: str
    finished: bool
    message: str
    anchors: tuple[tuple[int, float, float], ...] = ()

    def __post_init__(self) -> None:
        n, ny, nb, nj = len(self.t), len(self.states), len(self.bodies), len(self.joints)
        assert self.t.shape == self.kinetic_energy.shape == self.potential_energy.shape == (n,)
        assert self.y.shape == (n, ny) and len(self.units) == ny
        assert self.poses.shape == (n, nb, 3) and len(self.shapes) == nb
        assert self.joint_drift.shape == (n, nj)

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
    )
