"""SciPy's implicit methods, without their Python warnings: the run reports them instead.

`warnings.catch_warnings` changes the filters of the whole process: one of two runs in two threads
would catch the other's warnings. These methods do not warn in the first place.
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

from eomgen.run.integrators.interface import Remark, ignored

Matrix = NDArray[np.float64] | NDArray[np.complex128]
Factors = tuple[Matrix, NDArray[np.int32]]
"""L and U in one matrix (n, n), and pivots (n,), as `scipy.linalg.lu_solve` takes them."""


_ONE_STEP = RLock()
"""Held during a step of LSODA: in old versions of SciPy all runs share its work arrays."""


class Radau(ScipyRadau):
    """Radau IIA of order 5; calls `remark` for a singular matrix."""

    remark: Remark = staticmethod(ignored)

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self.lu: Any = _counted_factors(self)


class BDF(ScipyBDF):
    """Backward differentiation of orders 1 to 5; calls `remark` for a singular matrix."""

    remark: Remark = staticmethod(ignored)

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self.lu: Any = _counted_factors(self)


class LSODA(ScipyLSODA):
    """Adams' methods or backward differentiation, by stiffness. A failed step returns the reason.

    SciPy looks up the reason by its number to warn of it, but `_step_impl` returns only that the
    number is unexpected. Here the look-up raises the reason, before any warning.
    """

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        own: Any = self
        integrator = own._lsoda_solver._integrator
        integrator.messages = _RaisedMessages(integrator.messages)

    def _step_impl(self) -> Any:
        try:
            with _ONE_STEP:
                return super()._step_impl()  # type: ignore[misc]  # missing in the stubs
        except _LsodaError as error:
            return False, f"lsoda: {error}"
        except IntegratorConcurrencyError:
            return False, "LSODA of this version of SciPy makes one run at a time"


def factors(matrix: Matrix, remark: Remark = ignored) -> Factors:
    """LU factors of a matrix (n, n), which is overwritten; calls `remark` if it is singular."""
    if not matrix.size:
        return matrix, np.arange(0, dtype=np.int32)
    getrf: Any = get_lapack_funcs("getrf", (matrix,))
    found, pivots, info = getrf(matrix, overwrite_a=True)
    if info > 0:
        remark(f"Diagonal number {info} is exactly zero. Singular matrix.")
    return found, pivots


def _counted_factors(solver: Radau | BDF) -> Callable[[Matrix], Factors]:
    """A function that factors dense matrices and counts in `solver.nlu`, as SciPy's does.

    It raises `ValueError` for a matrix that is not finite, as SciPy's does.
    """

    def counted(matrix: Matrix) -> Factors:
        solver.nlu += 1
        return factors(np.asarray_chkfinite(matrix), solver.remark)

    return counted


class _LsodaError(Exception):
    """The reason for which LSODA failed."""


class _RaisedMessages(dict[int, str]):
    """LSODA's messages by number; `get` raises the message as `_LsodaError`."""

    def get(self, number: int, default: str | None = None) -> str:  # type: ignore[override]
        raise _LsodaError(super().get(number, default))
