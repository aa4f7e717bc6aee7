"""SciPy's implicit methods, which hand their remarks to the run and not to Python's warnings.

`warnings.catch_warnings` would change the filters of the whole process, so that of two runs in two
threads one would take the other's remarks. These methods make no warning in the first place.
"""

from collections.abc import Callable
from threading import RLock
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import BDF as ScipyBDF
from scipy.integrate import LSODA as ScipyLSODA
from scipy.integrate import Radau as ScipyRadau
from scipy.integrate._ode import IntegratorConcurrencyError
from scipy.linalg import get_lapack_funcs

Remark = Callable[[str], None]
"""Told what a method has to say of a step that it makes or gives up."""

Matrix = NDArray[np.float64] | NDArray[np.complex128]
Factors = tuple[Matrix, NDArray[np.int32]]
"""L and U in one matrix (n, n), and pivots (n,), as `scipy.linalg.lu_solve` takes them."""


_AT_WORK = RLock()
"""Held during a step of LSODA: old versions of SciPy keep what it works on once for all runs."""


def unheard(text: str) -> None:
    """Let a remark pass."""


class Radau(ScipyRadau):
    """Radau IIA of order 5; `remark` is told of singular matrices."""

    remark: Remark = staticmethod(unheard)

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self.lu: Any = _counted_factors(self)


class BDF(ScipyBDF):
    """Backward differentiation of orders 1 to 5; `remark` is told of singular matrices."""

    remark: Remark = staticmethod(unheard)

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self.lu: Any = _counted_factors(self)


class LSODA(ScipyLSODA):
    """Adams' methods or backward differentiation, by stiffness; `remark` is told why it gives up.

    SciPy looks the reason up by its number, to warn of it, and then says only that the number is
    unexpected. Here the look-up raises the reason, before any warning.
    """

    remark: Remark = staticmethod(unheard)

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        own: Any = self
        integrator = own._lsoda_solver._integrator
        integrator.messages = _Reasons(integrator.messages)

    def _step_impl(self) -> Any:
        try:
            with _AT_WORK:
                return super()._step_impl()  # type: ignore[misc]  # which the stubs leave out
        except _GaveUp as reason:
            self.remark(f"lsoda: {reason}")
            return False, "Unexpected istate in LSODA."
        except IntegratorConcurrencyError:
            return False, "LSODA of this version of SciPy makes one run at a time"


UNWARNED = (Radau, BDF, LSODA)


def factors(matrix: Matrix, remark: Remark = unheard) -> Factors:
    """LU factors of a matrix (n, n), which is overwritten. A singular one is told to `remark`."""
    if not matrix.size:
        return matrix, np.arange(0, dtype=np.int32)
    getrf: Any = get_lapack_funcs("getrf", (matrix,))
    found, pivots, info = getrf(matrix, overwrite_a=True)
    if info > 0:
        remark(f"Diagonal number {info} is exactly zero. Singular matrix.")
    return found, pivots


def _counted_factors(solver: Radau | BDF) -> Callable[[Matrix], Factors]:
    """Factors of dense matrices, counted as the solver counts its own.

    They raise `ValueError` for a matrix that is not finite, as SciPy's do.
    """

    def counted(matrix: Matrix) -> Factors:
        solver.nlu += 1
        return factors(np.asarray_chkfinite(matrix), solver.remark)

    return counted


class _GaveUp(Exception):
    """Why LSODA gives up."""


class _Reasons(dict[int, str]):
    """The reasons for which LSODA gives up, by number; looked up to be raised."""

    def get(self, number: int, default: str | None = None) -> str:  # type: ignore[override]
        raise _GaveUp(super().get(number, default))
