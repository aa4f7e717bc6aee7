"""Coordinates in which every inertia is one that a body can have.

The pseudo-inertia of a body about its centre of mass, Σ = ½ tr(I) 1 - I = Σ m r rᵀ, is positive
definite, and its mass is positive: Wensing, Kim and Slotine, "Linear matrix inequalities for
physically consistent inertial parameter identification", IEEE RA-L 3 (2018). With m = e^2α, the
centre c and Σ = m U Uᵀ, U upper triangular with a diagonal of e^d, any α, d, c and entries above
the diagonal are a body, and every body has some: Rucker and Wensing, "Smooth parameterization of
rigid-body inertia", IEEE RA-L 7 (2022). A search in these never leaves what is possible.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from eomgen.language.formula import Constant, Formula, Name
from eomgen.model.model import Model
from eomgen.run.problem import FloatArray

PLACES = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
"""The entries of an inertia: xx, yy, zz, xy, xz, yz."""


@dataclass(frozen=True)
class Inertia:
    """The inertia of a body that is fitted.

    mass     the number of its mass among the values; None if that is not fitted
    entries  the numbers of xx, yy, zz, and of xy, xz, yz if these are not 0; of one in the plane
    """

    mass: int | None
    entries: tuple[int, ...]

    @property
    def size(self) -> int:
        """The length of its matrices."""
        return 1 if len(self.entries) == 1 else 3

    @property
    def members(self) -> list[int]:
        """The numbers of all its values."""
        return [*([] if self.mass is None else [self.mass]), *self.entries]

    def inward(self, values: FloatArray) -> FloatArray | None:
        """Its coordinates: α, d and what is above the diagonal; None if no body has such values."""
        mass = 1.0 if self.mass is None else float(values[self.mass])
        if mass <= 0.0:
            return None
        pseudo = _turned(_matrix(values[list(self.entries)])) / mass
        try:  # U of Σ = U Uᵀ, by the lower factor of what is turned over
            upper = np.linalg.cholesky(pseudo[::-1, ::-1])[::-1, ::-1]
        except np.linalg.LinAlgError:
            return None
        own = [0.5 * np.log(mass)] if self.mass is not None else []
        count = len(self.entries)
        above = [upper[place] for place in PLACES[:count] if place[0] != place[1]]
        return np.array([*own, *np.log(np.diag(upper)), *above])

    def outward(self, coordinates: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Its values, and their derivatives by the coordinates."""
        has_mass, count = self.mass is not None, len(self.entries)
        mass = float(np.exp(2.0 * coordinates[0])) if has_mass else 1.0
        own = coordinates[int(has_mass) :]
        places = PLACES[: count if count > 1 else 1]
        upper = np.zeros((self.size, self.size))
        for place, x in zip(places, own, strict=True):
            upper[place] = np.exp(x) if place[0] == place[1] else x
        pseudo = mass * upper @ upper.T
        columns = []
        if has_mass:
            columns.append([2.0 * mass, *_entries(_turned_back(2.0 * pseudo), count)])
        for place in places:
            change = np.zeros_like(upper)
            change[place] = upper[place] if place[0] == place[1] else 1.0
            half = mass * change @ upper.T
            rates = _entries(_turned_back(half + half.T), count)
            columns.append([*([0.0] if has_mass else []), *rates])
        values = [*([mass] if has_mass else []), *_entries(_turned_back(pseudo), count)]
        return np.array(values), np.array(columns).T


def _matrix(entries: FloatArray) -> FloatArray:
    """The symmetric matrix of some entries."""
    if len(entries) == 1:
        return np.asarray(entries).reshape(1, 1)
    found = np.zeros((3, 3))
    for place, x in zip(PLACES, entries, strict=False):
        found[place] = found[place[::-1]] = x
    return found


def _entries(matrix: FloatArray, count: int) -> list[float]:
    return [float(matrix[place]) for place in PLACES[:count]]


def _turned(inertia: FloatArray) -> FloatArray:
    """Σ of I; in the plane the moment itself."""
    if len(inertia) == 1:
        return inertia
    return np.asarray(0.5 * np.trace(inertia) * np.eye(3) - inertia)


def _turned_back(pseudo: FloatArray) -> FloatArray:
    """I of Σ."""
    if len(pseudo) == 1:
        return pseudo
    return np.asarray(np.trace(pseudo) * np.eye(3) - pseudo)


@dataclass(frozen=True)
class Chart:
    """Coordinates of all values: those of some inertias, and the other values themselves."""

    inertias: tuple[Inertia, ...] = ()

    def inward(self, values: FloatArray) -> FloatArray:
        """The coordinates of values."""
        found = values.copy()
        for inertia in self.inertias:
            own = inertia.inward(values)
            assert own is not None
            found[inertia.members] = own
        return found

    def outward(self, coordinates: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The values at coordinates, and their derivatives (n, n)."""
        values, slopes = coordinates.copy(), np.eye(len(coordinates))
        for inertia in self.inertias:
            members = inertia.members
            values[members], slopes[np.ix_(members, members)] = inertia.outward(
                coordinates[members]
            )
        return values, slopes


def chart(model: Model, names: Sequence[str], start: FloatArray, bounded: Sequence[Any]) -> Chart:
    """The coordinates for fitting what `names` are, from the values `start`: those of the inertias
    of bodies whose entries are all fitted, each by a parameter of its own and without bounds.
    """
    found: list[Inertia] = []
    taken: set[int] = set()
    for body in model.bodies:
        places = [_place(entry, names) for entry in body.inertia_com]
        diagonal, rest = places[:3], body.inertia_com[3:]
        if all(entry == Constant(0.0) for entry in rest):
            places = diagonal
        entries = [place for place in places if place is not None]
        if len(entries) < len(places) or len(set(entries)) < len(entries):
            continue
        inertia = Inertia(_place(body.mass, names), tuple(entries))
        members = inertia.members
        if taken & {*members} or any(bounded[i] for i in members):
            continue
        if inertia.inward(start) is not None:
            found.append(inertia)
            taken |= {*members}
    return Chart(tuple(found))


def _place(formula: Formula, names: Sequence[str]) -> int | None:
    """The number of the name that a formula is, among some names; None if it is no such name."""
    if isinstance(formula, Name) and formula.name in names:
        return names.index(formula.name)
    return None
