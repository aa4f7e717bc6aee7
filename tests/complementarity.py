"""Random complementarity problems, solved in Python, in the C of units and in JavaScript."""

import ctypes
import json
from collections.abc import Sequence
from functools import cache

import numpy as np
from live import run_in_node

from eomgen.native.library import compiled_library
from eomgen.run import complementarity
from eomgen.run.complementarity import complementary
from eomgen.run.problem import FloatArray
from eomgen.templating import render

MOST = 8
"""The greatest number of contacts."""
Problem = tuple[FloatArray, FloatArray]
Forces = list[float] | None


def drawn(count: int, seed: int) -> list[Problem]:
    """Matrices (n, n) and offsets (n,), n <= `MOST`: of a body that slides on n contacts, of which
    many are redundant; a positive definite matrix with a skew part; and any matrix.
    """
    random, found = np.random.default_rng(seed), list[Problem]()
    for k in range(count):
        n = int(random.integers(1, MOST + 1))
        free, wide = int(random.integers(1, MOST + 1)), random.normal(size=(n, MOST))
        if k % 3 == 0:
            normal, slip = random.normal(size=(2, n, free))
            matrix = normal @ (normal + random.uniform(0, 2) * slip).T
        elif k % 3 == 1:
            skew = random.normal(size=(n, n)) * random.uniform(0, 3)
            matrix = wide @ wide.T + skew - skew.T
        else:
            matrix = random.normal(size=(n, n)) + random.uniform(0, 2) * np.eye(n)
        found.append((matrix * 10.0 ** random.uniform(-6, 6), random.normal(size=n)))
    return found


def in_python(problems: Sequence[Problem]) -> list[Forces]:
    """The forces of each problem; None where none are found."""
    found = [complementary(*problem) for problem in problems]
    return [None if forces is None else forces.tolist() for forces in found]


def in_c(problems: Sequence[Problem]) -> list[Forces]:
    """The same by the solver of FMI units."""
    solve, found = _library().solve, list[Forces]()
    solve.argtypes = [ctypes.c_int, *[ctypes.c_void_p] * 3]
    for matrix, offset in problems:
        given, forces = np.ascontiguousarray(matrix), np.zeros(len(offset))
        right = np.ascontiguousarray(offset)
        ok = solve(len(offset), given.ctypes.data, right.ctypes.data, forces.ctypes.data)
        found.append(forces.tolist() if ok else None)
    return found


def in_javascript(problems: Sequence[Problem]) -> list[Forces]:
    """The same by the solver of the page, in node."""
    given = json.loads(json.dumps([[a.tolist(), b.tolist()] for a, b in problems]))
    script = "return given.map(([a, b]) => contacts.complementary(a, b));"
    found: list[Forces] = run_in_node("", script, given, scripts=["contacts.js"])
    return found


@cache
def _library() -> ctypes.CDLL:
    names = {
        "rounding": repr(complementarity.ROUNDING),
        "consistent": repr(complementarity.CONSISTENT),
    }
    text = f"""
#include <math.h>
#include <string.h>
enum {{ CONTACTS = {MOST} }};
static int all_finite(const double *x, int n) {{
    for (int i = 0; i < n; i++) if (!isfinite(x[i])) return 0;
    return 1;
}}
{render("fmu", "complementarity.c.jinja", names)}
int solve(int n, const double *matrix, const double *b, double *f) {{
    double a[CONTACTS][CONTACTS];
    for (int i = 0; i < n; i++) memcpy(a[i], matrix + i * n, n * sizeof *a[i]);
    return complementary(n, a, b, f);
}}
"""
    return compiled_library(f"complementarity {text}", lambda: {"solve.c": text}, "solve.c")


def same(one: Forces, other: Forces) -> bool:
    """Whether two solutions agree. Least squares are solved by LAPACK in Python and by Jacobi
    rotations elsewhere, which round differently; by their bits those of Lemke's method agree.
    """
    if one is None or other is None:
        return one is other
    return bool(np.allclose(one, other, rtol=1e-7, atol=1e-9 * max(map(abs, one))))
