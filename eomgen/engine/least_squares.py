"""Least squares of least norm, for few unknowns, by elimination that shows the rank.

Entries are taken one by one: see `numbers`.
"""

from typing import Annotated

from eomgen.subset.words import Matrix, Vector, Whole, counts, numbers

NO_PIVOT = 1e-10
"""Pivots below this, relative to the first, count as zero."""


def shortest(
    n: int,
    a: Annotated[Matrix, "n", "n"],
    b: Annotated[Vector, "n"],
    x: Annotated[Vector, "n"],
) -> None:
    """Compute the x of least norm of those for which |a x - b| is least; a becomes its factors.

    With P a Q = L U of the rank r, from complete pivoting, the rows of [-L₂ L₁⁻¹  1] are orthogonal
    to the range, the columns of [-U₁⁻¹ U₂; 1] are the null space. What of b is outside the range is
    left away, then one solution is found by substitution, and its part in the null space is left
    away.
    """
    rows = counts(n)
    columns = counts(n)
    z = numbers(n)
    rank = reduced(n, a, rows, columns)
    for i in range(n):
        z[i] = b[rows[i]]
    if rank < n:
        project_on_range(n, n - rank, a, z)
    for i in range(rank):
        part = z[i]
        for p in range(i):
            part -= a[i][p] * z[p]
        z[i] = part
    for i in range(rank - 1, -1, -1):
        part = z[i]
        for p in range(i + 1, rank):
            part -= a[i][p] * z[p]
        z[i] = part / a[i][i]
    for i in range(rank, n):
        z[i] = 0.0
    if rank < n:
        project_off_null_space(n, n - rank, a, z)
    for i in range(n):
        x[columns[i]] = z[i]


def reduced(
    n: int,
    a: Annotated[Matrix, "n", "n"],
    rows: Annotated[Whole, "n"],
    columns: Annotated[Whole, "n"],
) -> int:
    """Replace a matrix by its factors L and U, with pivots that are the largest of all that is
    left; entry (i, j) was that at (rows[i], columns[j]). The rank.
    """
    for i in range(n):
        rows[i] = i
        columns[i] = i
    least = 0.0
    for p in range(n):
        largest = -1.0
        row = p
        column = p
        for i in range(p, n):
            for j in range(p, n):
                if abs(a[i][j]) > largest:
                    largest = abs(a[i][j])
                    row = i
                    column = j
        if p == 0:
            least = NO_PIVOT * largest
        if not largest > least:
            return p
        exchange(n, a, rows, columns, p, row, column)
        for i in range(p + 1, n):
            factor = a[i][p] / a[p][p]
            a[i][p] = factor
            for j in range(p + 1, n):
                a[i][j] -= factor * a[p][j]
    return n


def exchange(
    n: int,
    a: Annotated[Matrix, "n", "n"],
    rows: Annotated[Whole, "n"],
    columns: Annotated[Whole, "n"],
    p: int,
    row: int,
    column: int,
) -> None:
    """Bring the entry of a row and a column to place (p, p)."""
    if row != p:
        for j in range(n):
            other = a[p][j]
            a[p][j] = a[row][j]
            a[row][j] = other
        number = rows[p]
        rows[p] = rows[row]
        rows[row] = number
    if column != p:
        for i in range(n):
            other = a[i][p]
            a[i][p] = a[i][column]
            a[i][column] = other
        number = columns[p]
        columns[p] = columns[column]
        columns[column] = number


def project_on_range(
    n: int, d: int, a: Annotated[Matrix, "n", "n"], b: Annotated[Vector, "n"]
) -> None:
    """Project b (n,) on the range of a matrix with factors a, whose rank is n - d."""
    rank = n - d
    space = numbers(d, n)
    for k in range(d):
        space[k][rank + k] = 1.0
        for j in range(rank - 1, -1, -1):
            part = -a[rank + k][j]
            for p in range(j + 1, rank):
                part -= space[k][p] * a[p][j]
            space[k][j] = part
    project_off(n, d, space, b)


def project_off_null_space(
    n: int, d: int, a: Annotated[Matrix, "n", "n"], x: Annotated[Vector, "n"]
) -> None:
    """Project x (n,) on what is orthogonal to the null space of a matrix with factors a, whose rank
    is n - d.
    """
    rank = n - d
    space = numbers(d, n)
    for k in range(d):
        space[k][rank + k] = 1.0
        for i in range(rank - 1, -1, -1):
            part = -a[i][rank + k]
            for p in range(i + 1, rank):
                part -= a[i][p] * space[k][p]
            space[k][i] = part / a[i][i]
    project_off(n, d, space, x)


def project_off(
    n: int, d: int, space: Annotated[Matrix, "d", "n"], x: Annotated[Vector, "n"]
) -> None:
    """Project x (n,) on what is orthogonal to the rows of S (d, n): x -= Sᵀ z with S Sᵀ z = S x."""
    products = numbers(d, d)
    wanted = numbers(d)
    for i in range(d):
        for p in range(n):
            wanted[i] += space[i][p] * x[p]
        for j in range(d):
            for p in range(n):
                products[i][j] += space[i][p] * space[j][p]
    # By elimination; the matrix is positive definite, and its eigenvalues are at least 1.
    for i in range(d):
        for j in range(i):
            factor = products[i][j] / products[j][j]
            for p in range(j + 1, d):
                products[i][p] -= factor * products[j][p]
            wanted[i] -= factor * wanted[j]
    for i in range(d - 1, -1, -1):
        for j in range(i + 1, d):
            wanted[i] -= products[i][j] * wanted[j]
        wanted[i] /= products[i][i]
        for p in range(n):
            x[p] -= wanted[i] * space[i][p]
