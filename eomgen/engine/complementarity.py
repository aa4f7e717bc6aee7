"""The linear complementarity problem of contact forces, which push and never pull.

Cottle, Pang, Stone, The Linear Complementarity Problem, sections 4.2 and 4.4.
"""

from typing import Annotated

from eomgen.engine.least_squares import shortest
from eomgen.subset.words import Matrix, Vector, Whole, counts, inf, isfinite, numbers

ROUNDING = 1e-10
"""Values below this, relative to the largest offset or force, count as zero."""
CONSISTENT = 1e-6
"""Largest acceleration left by a redundant set of contacts, relative to the largest offset."""


def complementary(
    n: int,
    a: Annotated[Matrix, "n", "n"],
    offset: Annotated[Vector, "n"],
    forces: Annotated[Vector, "n"],
) -> bool:
    """Find f (n,) with 0 <= f, 0 <= w = a f + offset, f_i w_i = 0. False if none is found.

    Murty's least-index principal pivoting or, if that cycles, Lemke's method. The systems of the
    former are solved by least squares of least norm, so that redundant contacts, such as the four
    corners of a box on the ground, share the load evenly.
    """
    acts = counts(n)
    w = numbers(n)
    scale = 0.0
    many = 0
    for i in range(n):
        forces[i] = 0.0
        if not isfinite(offset[i]):
            return False
        scale = max(scale, abs(offset[i]))
        if offset[i] < 0.0:
            acts[i] = 1
            many += 1
    if many == 0:
        return True
    for i in range(n):
        for j in range(n):
            if not isfinite(a[i][j]):
                return False
    for _turn in range(4 * n + 4):
        balance(n, many, a, offset, acts, forces)
        accelerate(n, a, offset, forces, w)
        wrong = first_wrong(n, acts, forces, w, scale)
        if wrong == n:
            if not is_balanced(n, acts, w, scale):
                break
            for i in range(n):
                forces[i] = max(0.0, forces[i])
            return True
        many += 1 - 2 * acts[wrong]
        acts[wrong] = 1 - acts[wrong]
    return by_lemke(n, a, offset, scale, forces)


def balance(
    n: int,
    many: int,
    a: Annotated[Matrix, "n", "n"],
    offset: Annotated[Vector, "n"],
    acts: Annotated[Whole, "n"],
    forces: Annotated[Vector, "n"],
) -> None:
    """Compute forces, of the `many` contacts that act, under which w is 0 there."""
    place = counts(many)
    part = numbers(many, many)
    wanted = numbers(many)
    found = numbers(many)
    row = 0
    for i in range(n):
        forces[i] = 0.0
        if acts[i] == 1:
            place[row] = i
            wanted[row] = -offset[i]
            row += 1
    for i in range(many):
        for j in range(many):
            part[i][j] = a[place[i]][place[j]]
    shortest(many, part, wanted, found)
    for i in range(many):
        forces[place[i]] = found[i]


def accelerate(
    n: int,
    a: Annotated[Matrix, "n", "n"],
    offset: Annotated[Vector, "n"],
    forces: Annotated[Vector, "n"],
    w: Annotated[Vector, "n"],
) -> None:
    """Compute w = a f + offset."""
    for i in range(n):
        total = offset[i]
        for j in range(n):
            total += a[i][j] * forces[j]
        w[i] = total


def first_wrong(
    n: int,
    acts: Annotated[Whole, "n"],
    forces: Annotated[Vector, "n"],
    w: Annotated[Vector, "n"],
    scale: float,
) -> int:
    """The first contact that acts and pulls, or does not and closes; n if there is none."""
    largest = 0.0
    for i in range(n):
        largest = max(largest, abs(forces[i]))
    for i in range(n):
        if acts[i] == 1:
            if forces[i] < -ROUNDING * largest:
                return i
        elif w[i] < -ROUNDING * scale:
            return i
    return n


def is_balanced(
    n: int, acts: Annotated[Whole, "n"], w: Annotated[Vector, "n"], scale: float
) -> bool:
    """Whether w is 0 where contacts act: redundant ones may have no such forces."""
    for i in range(n):
        if acts[i] == 1 and not abs(w[i]) <= CONSISTENT * scale:
            return False
    return True


def by_lemke(
    n: int,
    a: Annotated[Matrix, "n", "n"],
    offset: Annotated[Vector, "n"],
    scale: float,
    forces: Annotated[Vector, "n"],
) -> bool:
    """Lemke's method: an artificial variable gives a feasible basis and is then eliminated.

    Columns are w (0 … n - 1), f (n … 2 n - 1), the artificial variable and the right-hand side.
    """
    columns = numbers(n, 2 * n + 2)
    basis = counts(n)
    row = 0
    for i in range(n):
        columns[i][i] = 1.0
        for j in range(n):
            columns[i][n + j] = -a[i][j]
        columns[i][2 * n] = -1.0
        columns[i][2 * n + 1] = offset[i]
        basis[i] = i
        if offset[i] < offset[row]:
            row = i
    entering = 2 * n
    for _turn in range(20 * n + 20):
        pivot(n, columns, row, entering)
        leaving = basis[row]
        basis[row] = entering
        if leaving == 2 * n:
            return are_forces(n, a, offset, scale, columns, basis, forces)
        entering = leaving + n if leaving < n else leaving - n
        row = leaves(n, columns, basis, entering, scale)
        if row < 0:
            return False  # a ray: there is no solution
    return False


def pivot(n: int, columns: Annotated[Matrix, "n", "2 * n + 2"], row: int, entering: int) -> None:
    """Bring a variable into the basis, by the equation of a row."""
    divisor = columns[row][entering]
    for j in range(2 * n + 2):
        columns[row][j] /= divisor
    for i in range(n):
        factor = columns[i][entering]
        if i != row and factor != 0.0:
            for j in range(2 * n + 2):
                columns[i][j] -= factor * columns[row][j]


def leaves(
    n: int,
    columns: Annotated[Matrix, "n", "2 * n + 2"],
    basis: Annotated[Whole, "n"],
    entering: int,
    scale: float,
) -> int:
    """The row of the variable that leaves the basis, that of the least ratio; -1 if there is none.

    Of several rows it is that of the artificial variable, or the method cycles at degenerate
    vertices; else the first.
    """
    largest = 0.0
    least = inf
    for i in range(n):
        largest = max(largest, abs(columns[i][entering]))
    for i in range(n):
        if columns[i][entering] > ROUNDING * largest:
            least = min(least, columns[i][2 * n + 1] / columns[i][entering])
    row = -1
    for i in range(n):
        if columns[i][entering] > ROUNDING * largest:
            ratio = columns[i][2 * n + 1] / columns[i][entering]
            if ratio <= least + ROUNDING * scale and (row < 0 or basis[i] == 2 * n):
                row = i
    return row


def are_forces(
    n: int,
    a: Annotated[Matrix, "n", "n"],
    offset: Annotated[Vector, "n"],
    scale: float,
    columns: Annotated[Matrix, "n", "2 * n + 2"],
    basis: Annotated[Whole, "n"],
    forces: Annotated[Vector, "n"],
) -> bool:
    """Take the forces from the right-hand side; whether no contact closes under them."""
    w = numbers(n)
    for i in range(n):
        forces[i] = 0.0
    for i in range(n):
        if basis[i] >= n:
            forces[basis[i] - n] = max(0.0, columns[i][2 * n + 1])
    accelerate(n, a, offset, forces, w)
    for i in range(n):
        if not w[i] >= -CONSISTENT * scale:
            return False
    return True
