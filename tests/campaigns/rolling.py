"""What long runs of rolling bodies keep, and the bicycle's eigenvalues beside the printed ones.

    python tests/campaigns/rolling.py [--seconds 60]

prints, for each body, the drift of its integrals relative to their largest value, and the largest
violation of its constraints. `test_rolling.py` does short runs of the same.
"""

import argparse
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent))
import test_rolling as rolling
from whipple import SPEEDS, TABLE, linearised

from eomgen.dynamics.start.assembly import assembled
from eomgen.model.elaborate import elaborate
from eomgen.run.integrate import integrate
from eomgen.run.module import as_problem
from eomgen.scalars.extended import MP
from eomgen.scene.reader import read_scene


def drift(values: np.ndarray) -> float:
    """The largest change since the start, relative to the largest value."""
    return float(np.abs(values - values[0]).max() / np.abs(values).max())


def long_run(name: str, seconds: float) -> None:
    """Print what a scene keeps."""
    made = rolling.module(name)
    found = integrate(as_problem(made), "DOP853", seconds, rtol=1e-13, atol=1e-14, samples=501)
    energy = np.array(
        [made.kinetic_energy(0.0, y) + made.potential_energy(0.0, y) for y in found.y]
    )
    gap = max(float(np.abs(made.constraint_residuals(0.0, y)).max()) for y in found.y)
    slip = max(float(np.abs(made.constraint_rates(0.0, y)).max()) for y in found.y)
    words = f"energy {drift(energy):.1e}, gap {gap:.1e} m, slip {slip:.1e} m/s"
    if name == "rattleback":
        spins = found.y[:, made.STATES.index("stone_wz")]
        words += f", spin from {spins.min():.2f} to {spins.max():.2f} rad/s"
    print(f"{name}, {found.t[-1]:g} s: {words}", flush=True)


def eigenvalues() -> None:
    """Print the largest difference from the printed eigenvalues at each speed."""
    model = assembled(elaborate(read_scene("bicycle")))
    for speed in SPEEDS:
        own, printed = (
            sorted(given, key=lambda x: (round(float(x.real), 6), x.imag))
            for given in (
                MP.eig(linearised(model, speed), left=False, right=False),
                TABLE[speed],
            )
        )
        worst = max(abs(complex(a) - b) for a, b in zip(own, printed, strict=True))
        shown = ", ".join(MP.nstr(x, 17) for x in own if abs(x.imag) < 1e-30)
        print(f"v = {speed:2d} m/s: {worst:.1e} from those printed; real ones {shown}", flush=True)


def main() -> None:
    """All of it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=60.0)
    given = parser.parse_args()
    eigenvalues()
    for name in ("bicycle", "rattleback"):
        long_run(name, given.seconds)


if __name__ == "__main__":
    main()
