"""Each construct of the engine's subset in three languages; and what is refused, with its line."""

import ast
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import constructs
import numpy as np
import pytest
from campaign import some as some_of
from languages import NONE, Given, results

from eomgen.base.loading import load_source
from eomgen.engine.structures import with_room
from eomgen.subset.languages import JAVASCRIPT, C
from eomgen.subset.printing import printed
from eomgen.subset.text import NotInSubsetError, Text

TEXT = Text.of(constructs)
SEEDED = np.random.default_rng(2)
N = 4


def some(*shape: int) -> Any:
    """Random numbers."""
    return SEEDED.normal(size=shape)


class Python:
    """The functions of `constructs.System`."""

    def derivative(self, t: float, y: Any) -> Any:
        return y * y - t * y

    def size(self, y: Any) -> float:
        return float(y[0] + y[1])

    def count(self) -> int:
        return 3

    def halve(self, y: Any) -> None:
        y /= 2.0


GIVEN = Given(
    Python(),
    """#define STATES 2
typedef struct { int none; } System;
static void derivative(System *s, double t, const double *y, double *out) {
    (void)s;
    for (int j = 0; j < 2; j++) out[j] = y[j] * y[j] - t * y[j];
}
static double size(System *s, const double *y) { (void)s; return y[0] + y[1]; }
static int64_t count(System *s) { (void)s; return 3; }
static void halve(System *s, double *y) { (void)s; y[0] /= 2.0, y[1] /= 2.0; }
""",
    """const STATES = 2;
const system = {
  derivative: (t, y, out) => y.forEach((x, j) => (out[j] = x * x - t * x)),
  size: (y) => y[0] + y[1],
  count: () => 3,
  halve: (y) => { y[0] /= 2; y[1] /= 2; },
};
""",
)


@dataclass(frozen=True)
class Method:
    """Known when it is printed."""

    name: str
    factors: tuple[float, ...]
    extra: bool


CASES: dict[str, list[list[Any]]] = {
    "numbers": [[a, b, n] for a in (-2.5, 0.0, 1.25) for b in (-1.0, 0.0, 3.5) for n in (0, 1, 6)],
    "vectors": [[n, some(n), some(n)] for n in (1, 2, 7)],
    "matrices": [[n, m, some(n, m), some(m)] for n, m in ((2, 3), (4, 2), (5, 5))],
    "products": [[n, m, some(n, m), some(m)] for n, m in ((2, 3), (4, 2), (5, 1))],
    "chosen": [[N + 1, np.array(which), 3, some(N + 1)] for which in ([4, 0, 2], [1, 2, 4])],
    "whole_numbers": [[N, np.array([2, 0, 3, 1]), some(N)]],
    "records": [
        [constructs.Memory(N, some(N), np.arange(N), steps=steps), 0.25] for steps in (0, 3)
    ],
    "records_in_records": [
        [constructs.Book(0.5, constructs.Memory(N, some(N), np.arange(N), steps=3)), 0.25]
    ],
    "listed": [[N, some(N), some(N)] for _ in range(3)],
    "with_given": [[GIVEN, 0.3, some(2)]],
}


@pytest.mark.parametrize("name", CASES)
def test_the_same_bits(name: str) -> None:
    """Python, C and JavaScript leave and return the same."""
    python, *others = results(
        TEXT, name, CASES[name], given=GIVEN if name == "with_given" else NONE
    )
    assert others == [python, python]


def test_room_for_records_in_records() -> None:
    book = with_room(constructs.Book, t=0.0, many=3)
    assert book.memory.y.shape == book.memory.order.shape == (6,)


@pytest.mark.parametrize("extra", [False, True])
def test_what_is_known(extra: bool) -> None:
    """Loops over what is known are written out, and decided tests are left away."""
    method = Method(f"three_{extra}", (0.5, 3.0, 1.25), extra)
    python, *others = results(TEXT, "known", [[x] for x in (-1.5, 2.0)], {"method": method})
    assert others == [python, python]
    assert ("if" in printed(TEXT, [("known", {"method": method})], C)) == extra


REFUSED = {
    "y = x": "second name",
    "y = a[0]": "second name",
    "x[1:] = x[:3]": "shifted",
    "x[1:] += x[0] * x[1:]": "shifted",
    "m = 1 / n": "a quotient of whole numbers",
    "m = n // 2": "a quotient of whole numbers",
    "m = n % 2": "a quotient of whole numbers",
    "text = 'word'": "not in the subset",
    "t = 1.0; t = x * 2.0": "another kind",
    "t = missing + 1.0": "not in the subset",
    "t = x.sum()": "not in the subset",
    "t = ordered(x) + 1.0": "to a name first",
    "z = product(a, x) + x": "to a name first",
    "x[:] = product(a, x * 2.0)": "while it is read",
    "x[which] = x[others]": "shifted",
    "x[:] = [0.5, x[0]]": "while it is read",
    "t = 1.0; t = ordered(t * x)": "while it is read",
    "for j_ in range(n): pass": "the name of an index",
    "i_ = 1": "the name of an index",
    "new = 1": "a word of another language",
    "for case in range(n): pass": "a word of another language",
    "z = x[::2] * 1.0": "no steps",
    "z = x + a": "different dimensions",
    "z = x[0, 1]": "not in the subset",
    "z = x ** 2.0": "not in the subset",
    "n = 0.5": "another kind",
    "for v in x: pass": "not in the subset",
    "for i in range(n): n += 1": "changes in the loop",
    "for i in range(0, n, 2): pass": "not in the subset",
    "with x: pass": "not in the subset",
    "try:\n        pass\n    finally:\n        pass": "not in the subset",
    "t, u = 1.0, 2.0": "not in the subset",
    "z = lambda: x": "not in the subset",
    "z = [x]": "not in the subset",
    "t = added(v for v in x)": "not known",
    "for i in unrolled(range(n)): pass": "not known",
    "f(n, x, a, which, others)": "calls itself",
    "f(n, x)": "not in the subset",
    "a[0] += 1 if 0 < n < 2 else 2": "not in the subset",
}


@pytest.mark.parametrize("statement", REFUSED)
def test_what_is_refused(statement: str) -> None:
    """An error names the line."""
    head = (
        'def f(n: int, x: Annotated[Vector, "n"], a: Annotated[Matrix, "n", "n"],'
        ' which: Annotated[Whole, "n"], others: Annotated[Whole, "n"]) -> None:'
    )
    (function,) = ast.parse(f"{head}\n    {statement}\n").body
    assert isinstance(function, ast.FunctionDef)
    with pytest.raises(NotInSubsetError, match=f"(?s)line [12].*{REFUSED[statement]}"):
        for language in (C, JAVASCRIPT):
            printed(Text({"f": function}), [("f", {})], language)


def test_names_are_those_of_one_function() -> None:
    """Functions of two modules with one name, of which one would be lost."""
    with pytest.raises(NotInSubsetError, match=r"(?s)line .*another module"):
        Text.of(constructs, constructs)


HEAD = (
    'def mixed(which: int, n: int, x: Annotated[Vector, "n"], y: Annotated[Vector, "n"],'
    ' a: Annotated[Matrix, "n", "n"], order: Annotated[Whole, "n"]) -> float:\n'
    "    z = x - y\n    s = 0.5\n"
)
TYPING = "from typing import Annotated"
WHOLE = "x y z a[0] a[n-1] a[:,0] a[:,1] x[order] s z*y".split()
PARTS = "x[1:] y[1:] z[1:] a[1,1:] a[2,1:] x[:n-1] z[:n-1] a[:n-1,2] s y[0] a[0,2]".split()
TARGETS = "x[:] y[:] z z[:] a[0] a[n-1] a[:,0] x[order]".split()


def chosen(these: list[str]) -> str:
    """One of these."""
    return these[SEEDED.integers(len(these))]


def statements() -> list[str]:
    """Some that follow one another: of whole arrays and their parts, and sums of them."""
    found: list[str] = []
    while len(found) < 6:
        whole = SEEDED.random() < 0.7
        one, two, three = (chosen(WHOLE if whole else PARTS) for _ in range(3))
        value = f"{one} * 0.5 - ({two} + 0.25 * {three})"
        target = chosen(TARGETS) if whole else chosen([x for x in PARTS if ":" in x])
        statement = f"{target} {chosen(['=', '=', '+=', '-='])} {value}"
        statement = chosen([f"s = ordered({value})", *[statement] * 4])
        text = Text()
        text.add(f"{HEAD}    {statement}\n    return s\n")
        with suppress(NotInSubsetError):
            printed(text, [("mixed", {})], C)
            found.append(statement)
    return found


def test_statements_share_loops_where_nothing_changes() -> None:
    """Random ones have the bits of Python, which makes one after another."""
    cases = [statements() for _ in range(some_of(16, 200))]
    source = HEAD + "".join(
        f"    if which == {i}:\n" + "".join(f"        {s}\n" for s in case)
        for i, case in enumerate(cases)
    )
    source = f"{source}    return s\n"
    module = load_source(f"from eomgen.subset.words import *\n{TYPING}\n{source}", "mixed")
    text = Text()
    text.add(source, vars(module))
    order = np.array([2, 0, 3, 1])
    given = [[i, N, some(N), some(N), some(N, N), order] for i in range(len(cases))]
    python, *others = results(text, "mixed", given)
    assert others == [python, python]
    assert printed(text, [("mixed", {})], C).count("for (") < 6 * len(cases)
