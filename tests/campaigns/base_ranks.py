"""Do robots have as many base parameters here as the rank of Pinocchio's regressor says?

    python tests/campaigns/base_ranks.py FILE.urdf… [--allow DIR]…

For each robot on a fixed base, or one that is free where nothing else moves: the base parameters,
all parameters, whether they are known without rounding, the numeric rank of Pinocchio's regressor
of joint torques over random states, and the gap of its singular values there: the last that counts
and the first that does not, relative to the first of all. Rotors are left out on both sides, and
joints that mimic others move freely.
"""

import argparse
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

import eomgen
from eomgen.base.errors import EomgenError
from eomgen.dynamics.regressor import ROTOR
from eomgen.fitting.base_parameters import base_parameters


def theirs(path: Path, floating: bool, locked: list[str]) -> tuple[int, int, float, float]:
    """The rank by the largest gap of singular values below 1e-8, the columns, and its two ends."""
    root = [pin.JointModelFreeFlyer()] if floating else []
    model = pin.buildModelFromUrdf(str(path), *root)
    held = [model.getJointId(name) for name in locked if model.existJointName(name)]
    model = pin.buildReducedModel(model, held, pin.neutral(model)) if held else model
    data = model.createData()
    rng = np.random.default_rng(1)
    rows: list[Any] = []
    columns = 10 * (model.njoints - 1)
    while len(rows) * model.nv < 2 * columns + 20:
        q = pin.randomConfiguration(model, -np.ones(model.nq), np.ones(model.nq))
        v, a = rng.normal(size=(2, model.nv))
        rows.append(pin.computeJointTorqueRegressor(model, data, q, v, a))
    matrix = np.concatenate(rows)
    lengths = np.linalg.norm(matrix, axis=0)
    matrix /= np.where(lengths > 1e-9 * lengths.max(), lengths, np.inf)  # rounding is no column
    sizes = np.linalg.svd(matrix, compute_uv=False)
    sizes = np.maximum(sizes / sizes[0], 1e-20)
    steps = [i for i in range(1, len(sizes)) if sizes[i] < 1e-8]
    rank = max(steps, key=lambda i: sizes[i - 1] / sizes[i]) if steps else len(sizes)
    return rank, columns, sizes[rank - 1], sizes[rank] if rank < len(sizes) else 0.0


def ours(path: Path, allowed: list[Path], floating: bool) -> tuple[int, int, bool, list[str]]:
    """Base parameters, all, and whether they are exact, without rotors; and the joints that are
    held since they carry no mass.
    """
    tables = dict(eomgen.import_robot(path, allow=allowed, floating=floating).tables)
    tables.pop("constraints", None)  # of joints that mimic others, which Pinocchio moves freely
    found = base_parameters(eomgen.check(tables))
    own = sum(one.what != ROTOR for one in found.groups)
    every = sum(one.what != ROTOR for one in found.every)
    return own, every, found.exact, list(tables.get("locked", {}))


def main() -> None:
    """Print a line for each robot, and how many agree."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("files", nargs="+", type=Path)
    parser.add_argument("--allow", action="append", default=[], type=Path)
    given = parser.parse_args()
    same = tried = 0
    for path in given.files:
        begun, floating = time.process_time(), False
        try:
            try:
                rank, every, exact, locked = ours(path, given.allow, floating)
            except EomgenError as error:
                if "nothing can move" not in str(error):
                    raise
                floating = True
                rank, every, exact, locked = ours(path, given.allow, floating)
            own = time.process_time() - begun
            other, _, last, first = theirs(path, floating, locked)
        except (EomgenError, ValueError, RuntimeError) as error:
            print(f"{path.name:32} {str(error).splitlines()[0][:100]}", flush=True)
            continue
        tried, same = tried + 1, same + (rank == other)
        kind = "exact" if exact else "60 digits"
        print(
            f"{path.name:32} {rank:4} of {every:4} {kind:9} {own:6.1f} s   {other:4} "
            f"{last:.0e} {first:.0e} {'' if rank == other else 'OTHER'}",
            flush=True,
        )
    print(f"{same} of {tried} agree")
    sys.exit(same != tried)


if __name__ == "__main__":
    main()
