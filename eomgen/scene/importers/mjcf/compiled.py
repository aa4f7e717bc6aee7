"""The compiled model of an MJCF file: the arrays of MuJoCo's mjModel, as lists."""

import io
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from eomgen.errors import SceneError

SECONDS = 120.0
"""Longest time that MuJoCo may take for a file."""
MISSING = "reading MJCF needs MuJoCo; install it with: pip install 'eomgen[robots]'"
MEASURED = ("body_", "jnt_", "dof_", "geom_", "actuator_", "tendon_", "wrap_", "eq_data", "qpos")
"""Beginnings of the names of arrays in which each number must be finite."""


@dataclass(frozen=True)
class Compiled:
    """A compiled model.

    arrays  the arrays of mjModel by name, as numbers or lists; those of its options begin with
            `opt_`. An array over objects of one kind has an entry for each
    names   for each kind of object a name for each; nameless ones are called by kind and number
    """

    arrays: Mapping[str, Any]
    names: Mapping[str, tuple[str, ...]]

    def __getitem__(self, name: str) -> Any:
        return self.arrays[name]


def compiled(path: Path) -> Compiled:
    """Compile a file by MuJoCo, in a process of its own.

    Raises `SceneError`, one line with MuJoCo's message.
    """
    if find_spec("mujoco") is None:
        raise SceneError(f"{path.name}: {MISSING}")
    program = Path(__file__).with_name("compiler.py")
    with tempfile.TemporaryDirectory() as folder:  # MuJoCo writes its log into the working folder
        command = [sys.executable, "-P", str(program), str(path.resolve())]
        try:
            done = subprocess.run(
                command,
                capture_output=True,
                check=False,
                cwd=folder,
                timeout=SECONDS,
                env={**os.environ, "MUJOCO_GL": "disable"},
            )
        except subprocess.TimeoutExpired:
            raise SceneError(
                f"{path.name}: MuJoCo does not compile it within {SECONDS:g} s; make it smaller"
            ) from None
    if done.returncode == 3:
        raise SceneError(f"{path.name}: {MISSING}")
    if done.returncode:
        raise SceneError(f"{path.name}: {_why(done)}")
    return _read(done.stdout, path.name)


def _why(done: subprocess.CompletedProcess[bytes]) -> str:
    """What MuJoCo says of a file that it does not compile."""
    lines = done.stderr.decode("utf-8", "replace").strip().splitlines()
    if done.returncode < 0 or not lines:
        said = f": {lines[-1]}" if lines else ""
        return f"MuJoCo ends while it compiles the file (code {done.returncode}){said}"
    return f"MuJoCo: {lines[-1].removeprefix('Error: ').removesuffix(';')}"


def _read(data: bytes, name: str) -> Compiled:
    import numpy as np  # here, so that reading a scene does not load it

    with np.load(io.BytesIO(data), allow_pickle=False) as found:
        arrays = {key: found[key] for key in found.files}
    names = {
        key.removeprefix("names_"): _called(key.removeprefix("names_"), json.loads(str(array)))
        for key, array in arrays.items()
        if key.startswith("names_")
    }
    for key, array in arrays.items():
        if key.startswith(MEASURED) and array.dtype.kind == "f" and not np.isfinite(array).all():
            raise SceneError(f"{name}: {key} has a number that is not finite; correct the file")
    lists = {key: a.tolist() for key, a in arrays.items() if not key.startswith("names_")}
    return Compiled(lists, names)


def _called(kind: str, names: list[str]) -> tuple[str, ...]:
    """The names of objects of a kind; nameless ones have their number."""
    taken, found = {*names}, list[str]()
    for i, name in enumerate(names):
        called = name or f"{kind}_{i}"
        while not name and called in taken:
            called += "_"
        taken.add(called)
        found.append(called)
    return tuple(found)
