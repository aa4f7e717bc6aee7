"""Imported robots on the ground: they settle, gain no energy, and sink in by little.

    python tests/campaigns/standing.py FILE… [--allow DIR]… [--count 20] [--time 5] [--self]
        [--integrator DOP853] [--dt 0.005]

Robots are passive: their actuators, and bounds of joints, are left out on both sides. Each is
dropped from where its file has it, a URDF from where it touches the ground. Printed are the energy
at the start and the end, J; the greatest gain of energy between two rows relative to that at the
start; the greatest depth at the end, mm; the greatest speed there; and of an MJCF file how high the
centre of mass is then, with what MuJoCo has. What has not come to rest, or without `--self` lies
on itself, is elsewhere there.
"""

import argparse
import re
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

import eomgen
from eomgen.base.errors import EomgenError
from eomgen.dynamics.dynamics import Dynamics
from eomgen.dynamics.start.diagnostics import values_at
from eomgen.scalars.floats import FloatScalars

DEEPEST = 5e-3
GAIN, GAIN_LONG = 1e-5, 1e-3
"""Greatest gains: with tolerances, and with equal steps, by which energy sways a little."""
RATES = ("_dot", "_wx", "_wy", "_wz")
ACTIVE = ("motor", "controller", "servo", "pd", "pid", "external_force")


def depth_of(model: Any, module: Any, y: np.ndarray) -> float:
    """The greatest depth of the contacts of a model at a state, m."""
    if getattr(module, "FOLLOWING", ()):  # with the coordinates that follow from others
        y = np.concatenate((module.coordinates(0.0, y), module.velocities(0.0, y)))
    dynamics = Dynamics(model, values_at(model, 0.0, y.tolist(), {}, {}), FloatScalars())
    return max(float(effect.overlap(dynamics)) for effect in model.effects)


def in_mujoco(path: Path, seconds: float, ours: np.ndarray) -> tuple[float, float, float]:
    """How high MuJoCo has the centre of mass after some time, passive and without bounds, and how
    high it is at `ours`, m; and how far MuJoCo lets contacts sink in at rest.
    """
    import mujoco

    model = mujoco.MjModel.from_xml_path(str(path))
    off = mujoco.mjtDisableBit
    model.opt.disableflags |= off.mjDSBL_LIMIT | off.mjDSBL_ACTUATION
    data = mujoco.MjData(model)
    while data.time < seconds:
        mujoco.mj_step(model, data)
    depth = max((c.includemargin - c.dist for c in data.contact), default=0.0)
    height = float(data.subtree_com[0][2])
    data.qpos[:] = ours
    mujoco.mj_forward(model, data)
    return height, float(data.subtree_com[0][2]), depth


def settled(path: Path, options: argparse.Namespace) -> tuple[str, bool]:
    """What is printed of a robot, and whether it is within the bounds."""
    given = eomgen.import_robot(
        path,
        floating=path.suffix == ".urdf",
        contacts=True,
        self_contacts=options.self,
        allow=[path.parent, *options.allow],
    )
    tables = dict(given.tables)
    active = [e["name"] for e in tables["effects"] if e["type"] in ACTIVE]
    tables["effects"] = [e for e in tables["effects"] if e.get("name") not in active]
    defined = tables.pop("definitions", {}).items()
    if kept := {k: v for k, v in defined if not re.search(r"_(activation|force|control)\b", v)}:
        tables["definitions"] = kept
    if not any(e["type"] == "contact" for e in tables["effects"]):
        raise EomgenError("has no contact with the ground")
    tables["outputs"] = ["kinetic_energy", "potential_energy"]
    method, seconds = options.integrator, options.time
    bounds = {"dt": options.dt} if options.dt else {"rtol": 1e-4, "atol": 1e-6}
    run = eomgen.simulate(tables, t_end=seconds, integrator=method, **bounds)
    if not run.finished:
        raise EomgenError(run.message)
    energy = np.asarray(run.energy)
    gain = max(float(np.diff(energy).max()), 0.0) / abs(energy[0])
    module = eomgen.load(run.module)
    depth = depth_of(run.model, module, np.asarray(run.y[-1]))
    beside = ""
    if path.suffix != ".urdf":
        place = given.mujoco(module).position(np.asarray(run.y[-1]))
        theirs, own, sunk = in_mujoco(path, seconds, np.asarray(place))
        beside = f", height {own:.4f} m; in MuJoCo depth {1e3 * sunk:.2f} mm, height {theirs:.4f} m"
    moving = [i for i, name in enumerate(run.states) if name.endswith(RATES)]
    speeds = np.abs(np.asarray(run.y[-1])[moving])
    most = GAIN_LONG if options.dt else GAIN
    within = run.finished and gain <= most and depth <= DEEPEST
    return (
        f"{energy[0]:.4g} J to {energy[-1]:.4g} J, gain {gain:.1e}, depth {1e3 * depth:.2f} mm, "
        f"speed {speeds.max():.1e}{beside}"
    ), bool(within)


def main() -> int:
    """Drop all robots; the exit code is 1 if one is beyond the bounds."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("files", nargs="+", type=Path)
    parser.add_argument("--allow", action="append", default=[])
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--time", type=float, default=5.0)
    parser.add_argument("--self", action="store_true")
    parser.add_argument("--integrator", default="DOP853")
    parser.add_argument("--dt", type=float, help="the step, s, of methods with equal steps")
    given = parser.parse_args()
    good = tried = 0
    for path in given.files[: given.count]:
        start = time.process_time()
        try:
            said, within = settled(path, given)
        except EomgenError as error:
            print(f"{path.name}: {error}", flush=True)
            continue
        tried, good = tried + 1, good + within
        spent = time.process_time() - start
        print(
            f"{path.name}: {said} {'' if within else 'BEYOND '}({spent:.1f} s)",
            flush=True,
        )
    print(f"{good} of {tried} settle within the bounds")
    return int(good < tried)


if __name__ == "__main__":
    sys.exit(main())
