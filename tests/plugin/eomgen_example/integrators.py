"""An integrator: its method is imported when it is first used."""

from eomgen.tables.integrators import IntegratorSpec

HEUN = IntegratorSpec(
    "Heun's method, order 2", "explicit", "methods:HEUN", package="eomgen_example"
)
