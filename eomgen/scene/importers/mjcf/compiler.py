"""Compiles an MJCF file by MuJoCo and writes the arrays of the model: a program of its own.

`python compiler.py FILE` writes to standard output what `numpy.load` reads. It runs in a process of
its own because an error in a C library may end the process that it happens in. On failure its last
line on standard error is MuJoCo's message.
"""

import io
import json
import sys
from contextlib import suppress
from typing import Any

MOST_MEMORY = 8 << 30
"""Bytes of memory that a compilation may take, where the system can limit it."""
OLDEST = 4
"""The first version of MuJoCo whose arrays are read."""
MISSING = 3
"""The exit code without such a MuJoCo."""
KINDS = ("body", "joint", "geom", "site", "actuator", "tendon", "equality")
"""Objects whose names are written."""
PREFIXES = (
    "body_",
    "jnt_",
    "dof_",
    "geom_",
    "site_",
    "actuator_",
    "tendon_",
    "wrap_",
    "eq_",
    "exclude_",
    "pair_",
    "mat_rgba",
    "mesh_vert",
    "qpos",
)
SINGLE = (
    "nbody",
    "njnt",
    "ngeom",
    "nsite",
    "nactuator",
    "ntendon",
    "neq",
    "nsensor",
    "ncam",
    "nkey",
    "nflex",
    "nskin",
    "nplugin",
    "npair",
    "nmocap",
    "nv",
)
OPTIONS = (
    *("gravity", "density", "viscosity", "wind", "magnetic"),
    *("disableflags", "disableactuator", "timestep", "cone", "impratio"),
)


def arrays_of(model: Any) -> dict[str, Any]:
    """The arrays of a compiled model that describe the mechanism, by their names in mjModel."""
    import numpy as np

    names = [name for name in dir(model) if name.startswith(PREFIXES)]
    found = {name: np.asarray(getattr(model, name)) for name in (*names, *SINGLE)}
    found |= {f"opt_{name}": np.asarray(getattr(model.opt, name)) for name in OPTIONS}
    for kind in KINDS:
        count = getattr(model, {"joint": "njnt", "equality": "neq"}.get(kind, f"n{kind}"))
        called = [getattr(model, kind)(i).name for i in range(count)]
        found[f"names_{kind}"] = np.array(json.dumps(called))
    return found


def compile_file(path: str) -> tuple[int, bytes, str]:
    """The exit code, the arrays as `numpy.savez` writes them, and MuJoCo's message."""
    try:
        import mujoco
        import numpy as np
    except ImportError:
        return MISSING, b"", ""
    if int(mujoco.__version__.split(".")[0]) < OLDEST:
        return MISSING, b"", ""
    try:
        model = mujoco.MjModel.from_xml_path(path)
    except Exception as error:  # whatever MuJoCo raises, its message is all that is wanted
        lines = [line.strip() for line in str(error).splitlines()]
        return 1, b"", "; ".join(line for line in lines if line)
    buffer = io.BytesIO()
    np.savez(buffer, **arrays_of(model))
    return 0, buffer.getvalue(), ""


def limit_memory() -> None:
    """Let allocations beyond `MOST_MEMORY` fail."""
    with suppress(ImportError, OSError, ValueError):
        import resource  # POSIX only

        resource.setrlimit(resource.RLIMIT_AS, (MOST_MEMORY, MOST_MEMORY))


if __name__ == "__main__":
    limit_memory()
    code, data, message = compile_file(sys.argv[1])
    sys.stdout.buffer.write(data)
    print(message, file=sys.stderr)
    sys.exit(code)
