"""Functions in the engine's subset that use each of its constructs, for `test_constructs.py`."""

from dataclasses import dataclass
from typing import Annotated, Protocol

from eomgen.subset.words import (
    Known,
    Matrix,
    Vector,
    Whole,
    added,
    all_within,
    copy,
    counts,
    inf,
    isfinite,
    larger,
    nan,
    next_after,
    ordered,
    product,
    rows,
    sqrt,
    unrolled,
    zeros,
)

MOST = 5


@dataclass(slots=True)
class Memory:
    """Numbers and arrays."""

    n: int
    y: Annotated[Vector, "n"]
    order: Annotated[Whole, "n"]
    t: float = 0.5
    steps: int = 0


@dataclass(slots=True)
class Book:
    """A number, and a record of numbers for so many."""

    t: float
    memory: Annotated[Memory, "2 * many"]


class System(Protocol):
    """What a function is given."""

    def derivative(self, t: float, y: Annotated[Vector, "STATES"]) -> Annotated[Vector, "STATES"]:
        """An array."""
        ...

    def size(self, y: Annotated[Vector, "STATES"]) -> float:
        """A number."""
        ...

    def count(self) -> int:
        """Without arguments."""
        ...

    def halve(self, y: Annotated[Vector, "STATES"]) -> None:
        """A change in place."""
        ...


def numbers(a: float, b: float, n: int) -> float:
    """Arithmetic, comparisons, branches and loops of numbers."""
    total = 0.0
    if (a < b and not a <= 0.0) or n > 3:
        total = -a + b * 2.0 - a / 3.0
    elif a >= b:
        total = abs(a) + sqrt(abs(b))
    else:
        total = inf if n != 1 else nan
    for i in range(n):
        if i == 1:
            continue
        total += i * 0.1
    for i in range(n - 1, -1, -1):
        total -= min(a, i * 1.0) + max(b, 0.5)
        if total < -100.0:
            break
    made = 0
    while made < MOST:
        made += 1
        total *= 1.01
    if not isfinite(total):
        return next_after(a)
    return total


def vectors(n: int, x: Annotated[Vector, "n"], y: Annotated[Vector, "n"]) -> float:
    """Elementwise statements of vectors, their parts and sums."""
    place = x + 0.5 * y
    both = abs(place) - larger(x, y) * 2.0
    x[:] = both
    y[1:] += x[1:] * place[1:]
    y[: n - 1] /= 2.0
    nothing = zeros(n)
    kept = copy(y[1:n])
    nothing[:1] = 3.0
    square = ordered(both * both)
    x += nothing
    rest = ordered(kept)
    return square + rest + len(x)


def matrices(n: int, m: int, a: Annotated[Matrix, "n", "m"], x: Annotated[Vector, "m"]) -> None:
    """Rows, columns and blocks."""
    row = copy(a[0])
    a[0, :] = a[n - 1]
    a[n - 1, :] = row
    column = copy(a[:, 0])
    a[:, 1] = column * 2.0
    for i in range(1, n):
        below = a[i, 0]
        a[i, 1:] -= below * x[1:]
    a[1:, 1:] *= 0.5
    other = zeros(n, m)
    other[:, :] = a * 0.5
    a[:, :] += other


def products(n: int, m: int, a: Annotated[Matrix, "n", "m"], x: Annotated[Vector, "m"]) -> int:
    """A matrix by a vector, and whether entries are within limits."""
    found = product(a, x)
    half = 0.5 * found
    small = all_within(abs(half), found)
    scale = larger(half, 1.0)
    lower = all_within(found - half, scale * 2.0)
    b = zeros(m, n)
    b[0, :] = product(a, x * 2.0)
    a[:, 0] = b[0]
    return small + 2 * lower


def chosen(n: int, which: Annotated[Whole, "m"], m: int, x: Annotated[Vector, "n"]) -> None:
    """Entries at several places."""
    some = copy(x[which])
    x[which] = 0.25 * some + 1.0
    x[which] += some * some
    a = zeros(n, m)
    for i in range(1, 2):
        a[which, i] = some
        x[:] = x * 1.0
    a[0, :] = x[which] * 2.0
    x[0] = a[0, 0] + a[n - 1, 1]


def whole_numbers(n: int, order: Annotated[Whole, "n"], x: Annotated[Vector, "n"]) -> int:
    """Arrays of whole numbers, as places."""
    turned = counts(n)
    for i in range(n):
        turned[i] = order[n - 1 - i]
    for i in range(n):
        x[i] += x[turned[i]]
    order[:] = turned
    return turned[0] + n


def records(memory: Memory, h: float) -> bool:
    """Fields, which functions change."""
    memory.t += h
    memory.steps += 1
    for i in range(memory.n):
        memory.order[i] += 1
    there = memory.y * h
    memory.y = there
    moved(memory.n, memory.y)
    return memory.steps > 3


def records_in_records(book: Book, h: float) -> bool:
    """A record of a record, which functions are given."""
    book.t += h
    return records(book.memory, book.t)


def moved(n: int, x: Annotated[Vector, "n"]) -> None:
    """Called by another."""
    x[0] = x[n - 1] + 1.0


def with_given(system: System, t: float, y: Annotated[Vector, "STATES"]) -> float:
    """Functions that are given."""
    k = rows(3, len(y))
    k[0] = system.derivative(t, y)
    for i in range(1, 3):
        place = y + 0.1 * k[i - 1]
        k[i] = system.derivative(t + 0.1 * i, place)
    system.halve(y)
    y[:] = y + k[0] * k[2]
    return system.size(y) + system.count()


def known(method: Known, x: float) -> float:
    """What is known when it is printed."""
    total = x
    for i in unrolled(range(len(method.factors))):
        total = total * method.factors[i]
        if i == 1 and method.extra:
            total = total + 1.0
    if method.extra and x > 0.0:
        total = total - added(factor * x for factor in method.factors)
    return total


def listed(n: int, x: Annotated[Vector, "n"], y: Annotated[Vector, "n"]) -> None:
    """Entries that are given at once."""
    first = y[0]
    x[:] = [first, sqrt(2.0 + abs(first)) - first, 3.0 if n == 4 else 4.0, y[n - 1]]
    y[1:3] = [x[1] * 2.0, first]
