"""CasADi's functions of all built-in scenes: values and Jacobians beside those of the modules.

    python tests/campaigns/casadi_functions.py [SCENE …]

For each scene the largest difference at 20 states, relative to the largest entry or 1, of the
derivative and of its Jacobian, by CasADi and by the generated module. Where the Jacobians differ by
more than 1e-12 both are compared with 60 digits at the worst of these states.
"""

import sys
from typing import Any

import numpy as np

import eomgen
from eomgen.api.given import check
from eomgen.program.extended import evaluator
from eomgen.scalars.extended import MP
from eomgen.store import interfaced_program_of

STATES = 20


def apart(found: Any, wanted: Any) -> float:
    """The largest difference relative to the largest entry or 1; inf for nan."""
    size = max(1.0, float(np.abs(wanted).max()))
    difference = float(np.abs(np.asarray(found - wanted, dtype=float)).max()) / size
    return difference if difference == difference else np.inf


def in_60_digits(scene: str, y: Any, u: Any) -> Any:
    """The Jacobian by the program itself in 60 digits."""
    program, interface = interfaced_program_of(check(scene))
    function = next(f for f in interface.functions if f.name == "jacobian")
    run = evaluator(program, "jacobian")
    given = {"t": MP.mpf(0), **{p.name: p.default for p in interface.parameters}}
    given |= dict(zip([s.name for s in interface.states], y.tolist(), strict=True))
    given |= dict(zip([i.name for i in interface.inputs], u.tolist(), strict=True))
    n = len(y)
    if not function.tangent:
        return np.array(run(given), dtype=object).reshape(n, n)
    unit = np.eye(n).tolist()
    return np.array(
        [run(given | dict(zip(function.extra, unit[j], strict=True))) for j in range(n)]
    ).T


def main() -> None:
    """Print a line for each scene."""
    for scene in sys.argv[1:] or eomgen.built_in_names():
        functions = eomgen.casadi_functions(scene, outputs=[])
        module: Any = eomgen.load(eomgen.generate(scene, outputs=[]))
        derivative = functions["derivative"]
        slope = derivative.factory("slope", ["t", "y", "p", "u"], ["jac:derivative:y"])
        rng = np.random.default_rng(1)
        value, worst, there = 0.0, -1.0, None
        for _ in range(STATES):
            y = np.array(functions.y) + rng.uniform(-0.3, 0.3, len(functions.y))
            u = rng.uniform(-5.0, 5.0, len(functions.u))
            value = max(
                value,
                apart(
                    derivative(0.0, y, functions.p, u).full().ravel(),
                    module.derivative(0.0, y, None, u),
                ),
            )
            found, own = slope(0.0, y, functions.p, u).full(), module.jacobian(0.0, y, None, u)
            if (off := apart(found, own)) > worst:
                worst, there = off, (y, u, found, own)
        line = f"{scene:20}{derivative.n_instructions():7} steps  value {value:.1e}  "
        line += f"Jacobian {worst:.1e}"
        if worst > 1e-12 and there is not None:
            y, u, found, own = there
            exact = in_60_digits(scene, y, u)
            line += (
                f"; from 60 digits CasADi {apart(found, exact):.1e}, ours {apart(own, exact):.1e}"
            )
        print(line, flush=True)


if __name__ == "__main__":
    main()
