"""SciPy's adaptive methods as integrators."""

from scipy import integrate

from eomgen.run.integrators import unwarned
from eomgen.run.integrators.interface import Adaptive

RK45 = Adaptive(integrate.RK45, memory=("h_abs", "f"))
RADAU = Adaptive(unwarned.Radau, uses_jacobian=True)
RADAU_DIFFERENCES = Adaptive(unwarned.Radau)
BDF = Adaptive(unwarned.BDF, uses_jacobian=True, one_step=False)
BDF_DIFFERENCES = Adaptive(unwarned.BDF, one_step=False)
LSODA = Adaptive(unwarned.LSODA, uses_jacobian=True, one_step=False)
