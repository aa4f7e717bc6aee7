"""Imported MJCF models beside MuJoCo at random states: places, velocities and accelerations.

    python tests/campaigns/mjcf_models.py [NAME…] [--states 20] [--module]

The models are those that `dm_control`, `gymnasium` and `mujoco` ship; NAME is a part of a path. In
MuJoCo what
the importer says that it leaves out is switched off: contacts, limits, fluids, and actuators where
some have no counterpart. Friction of joints, which is smoothed here, is off on both sides. Random
generalised forces act on both. Equality constraints are soft in MuJoCo; they are off, and then on
for one state: M v̇ - f at our v̇ must be a combination of MuJoCo's rows.
`--module` compares the generated module instead of the recursion that it is recorded from. The
differences that are printed are those of accelerations, in MuJoCo's order and frames, relative to
the greatest, and for single components to each; of places and velocities of bodies; and of qpos and
qvel, converted to the scene's state and back. `--remarks` prints the remarks too.

Of the models of `mujoco.mjx`, if it is installed, `convex.xml` is off by 1e-8: MuJoCo counts a
centre of mass that is 2e-9 m off the origin of a free body as there.
"""

import argparse
import sys
import time
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from eomgen.base.errors import EomgenError

sys.path.insert(0, str(Path(__file__).parent.parent))

from mjcf_states import Comparison

BOUND = 1e-10


def models(wanted: list[str]) -> list[Path]:
    """The MJCF files of the packages that are there."""
    found = (find_spec(name) for name in ("dm_control", "gymnasium", "mujoco"))
    roots = [Path(spec.origin).parent for spec in found if spec and spec.origin]
    found = [path for root in roots for path in sorted(root.rglob("*.xml"))]
    return [path for path in found if not wanted or any(part in str(path) for part in wanted)]


def main() -> int:
    """Compare all models; the exit code is 1 if one is beyond the bound."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*")
    parser.add_argument("--states", type=int, default=20)
    parser.add_argument("--module", action="store_true")
    parser.add_argument("--remarks", action="store_true")
    given = parser.parse_args()
    worst = 0
    for path in models(given.names):
        start = time.perf_counter()
        label = "/".join(path.parts[-3:])
        try:
            comparison = Comparison.of(path)
            differences = comparison.differences(given.states, module=given.module)
        except EomgenError as error:
            print(f"{label}: {error}")
            continue
        whole, single, frames, states = differences.max(axis=0)
        passed = max(whole, frames, states) <= BOUND
        worst |= not passed
        print(
            f"{label}: nv {comparison.nv}, {whole:.1e}, single {single:.1e}, bodies {frames:.1e}, "
            f"states {states:.1e} {'' if passed else 'BEYOND '}"
            f"({time.perf_counter() - start:.1f} s)"
        )
        closed = Comparison.of(path, equalities=True)
        if closed.has_constraints:
            found = closed.constrained("aba", np.random.default_rng(0))
            worst |= not found.apart <= BOUND * found.force
            print(f"    with equality constraints {found.apart / found.force:.1e}")
        if given.remarks:
            for remark in comparison.imported.remarks:
                print(f"    {remark}")
        sys.stdout.flush()
    return worst


if __name__ == "__main__":
    sys.exit(main())
