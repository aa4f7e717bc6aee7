"""The members of a sweep: the values that each of them has instead of the scene's."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np

from eomgen.base.displays import Displayed
from eomgen.base.errors import RunError
from eomgen.base.frozen import Frozen
from eomgen.language.base import identifier
from eomgen.run.problem import FloatArray

MOST = 10_000_000
"""Greatest number of members."""
Values = Sequence[float] | FloatArray
LAWS = ("uniform", "normal", "loguniform")


@dataclass(frozen=True, eq=False, repr=False)
class Design(Frozen, Displayed):
    """The values of the members.

    names   what is varied
    values  (n, k): one row a member, one column a name
    axes    of a grid, the values along each axis, the last of which varies fastest; else empty
    """

    shown = ("names", "values")

    names: tuple[str, ...]
    values: FloatArray
    axes: tuple[FloatArray, ...] = ()


@dataclass(frozen=True)
class Law:
    """A distribution: uniform or loguniform between `a` and `b`, or normal of mean a, deviation b.

    Raises `RunError` for an unknown kind, or numbers that do not fit it.
    """

    kind: str
    a: float
    b: float

    def __post_init__(self) -> None:
        if self.kind not in LAWS:
            raise RunError(f"'{self.kind}' is not a distribution; take one of {', '.join(LAWS)}")
        fits = math.isfinite(self.a) and math.isfinite(self.b)
        fits = fits and (self.b > 0 if self.kind == "normal" else self.a < self.b)
        if not fits or (self.kind == "loguniform" and self.a <= 0):
            needs = {
                "normal": "a mean and a positive deviation",
                "uniform": "two numbers, the smaller first",
                "loguniform": "two positive numbers, the smaller first",
            }[self.kind]
            raise RunError(f"{self.kind}:{self.a:g}:{self.b:g}: give {needs}")

    def at(self, share: FloatArray) -> FloatArray:
        """The values below which these shares (n,), between 0 and 1, of all values lie."""
        if self.kind == "uniform":
            return self.a + (self.b - self.a) * share
        if self.kind == "loguniform":
            return np.asarray(self.a * (self.b / self.a) ** share)
        normal = NormalDist(self.a, self.b)
        return np.array([normal.inv_cdf(max(x, 2.0**-54)) for x in share.tolist()])


def listed(values: Mapping[str, Values]) -> Design:
    """Members in a row: the first has the first value of each name, and so on.

    Raises `RunError` if there are none, if names have different numbers of values, or if a value is
    not finite.
    """
    columns = [np.atleast_1d(np.asarray(column, dtype=float)) for column in values.values()]
    lengths = {len(column) for column in columns}
    if len(lengths) != 1 or any(column.ndim != 1 for column in columns):
        raise RunError("vary: give a list of values for each name, all of the same length")
    return _checked(Design(tuple(map(identifier, values)), np.array(columns).T.copy()))


def grid(axes: Mapping[str, Values]) -> Design:
    """All combinations of the values of each name. Raises `RunError` if there are no
    members or too many, or if a value is not finite."""
    columns = tuple(np.atleast_1d(np.array(axis, dtype=float)) for axis in axes.values())
    count = math.prod(len(column) for column in columns)
    if not columns or not 0 < count <= MOST:
        raise RunError(f"vary: makes {count if columns else 0} members; 1 to {MOST} are possible")
    rows = np.stack([mesh.ravel() for mesh in np.meshgrid(*columns, indexing="ij")], axis=1)
    return _checked(Design(tuple(map(identifier, axes)), rows, columns))


def sampled(
    laws: Mapping[str, Law | tuple[str, float, float]], count: int, seed: int = 0
) -> Design:
    """Draw `count` members from distributions: ("normal", mean, deviation), ("uniform", low, high)
    or ("loguniform", low, high). A longer sample begins with the shorter one.

    Raises `RunError` if the number is not positive, or nothing is varied.
    """
    if not laws or not 0 < count <= MOST:
        raise RunError(f"sample: {count} members of {len(laws)} names; 1 to {MOST} are possible")
    shares = np.random.default_rng(seed).random((count, len(laws)))
    known = [law if isinstance(law, Law) else Law(*law) for law in laws.values()]
    columns = [law.at(shares[:, i]) for i, law in enumerate(known)]
    return _checked(Design(tuple(map(identifier, laws)), np.array(columns).T.copy()))


def in_radians(design: Design, degrees: Mapping[str, str]) -> Design:
    """The design with angles in radians that it names in degrees: `degrees` gives the name of each.

    Raises `RunError` if an angle is named twice.
    """
    names = tuple(degrees.get(name, name) for name in design.names)
    if len({*names}) < len(names):
        raise RunError("vary: an angle is given twice, in radians and in degrees; leave one out")
    scales = [np.pi / 180 if name in degrees else 1.0 for name in design.names]
    axes = tuple(axis * scale for axis, scale in zip(design.axes, scales, strict=False))
    return Design(names, design.values * scales, axes)


def _checked(design: Design) -> Design:
    count = len(design.values)
    if not 0 < count <= MOST or not design.names:
        raise RunError(f"vary: makes {count} members; 1 to {MOST} are possible")
    if len(set(design.names)) < len(design.names):
        raise RunError("vary: a name is given twice")
    if not np.isfinite(design.values).all():
        raise RunError("vary: a value is not a finite number")
    return design
