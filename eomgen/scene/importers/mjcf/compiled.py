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

from eomgen.base.errors import SceneError
from eomgen.base.text import one_line
from eomgen.language.base import LARGEST

SECONDS = 60.0
"""Longest time that MuJoCo may take for a file."""
MISSING = "reading MJCF needs MuJoCo 4; install it with: pip install 'eomgen[robots]'"
NO_MUJOCO = 3
"""The exit code of `compiler` without it."""
MEASURED = (
    *("body_", "jnt_", "dof_", "geom_", "pair_", "actuator_", "tendon_", "wrap_", "eq_data"),
    "qpos",
)
"""Beginnings of the names of arrays in which each number must be finite."""


@dataclass(frozen=True)
class Compiled:
    """A compiled model.

    arrays  the arrays of mjModel by name, as numbers or lists; those of its options begin with
            `opt_`. An array over objects of one kind has an entry for each
    names   for each kind of object a name for each; nameless ones are called by kind and number
    warnings  what MuJoCo warns of
    """

    arrays: Mapping[str, Any]
    names: Mapping[str, tuple[str, ...]]
    warnings: tuple[str, ...] = ()

    def __getitem__(self, name: str) -> Any:
        return self.arrays[name]


def compiled(path: Path) -> Compiled:
    """Compile a file by MuJoCo, in a process of its own.

    Raises `SceneError`, one line with MuJoCo's message.
    """
    if find_spec("mujoco") is None:
        raise SceneError(f"{path.name}: {MISSING}")
    code, data, said = _compile(path)
    if code == NO_MUJOCO:
        raise SceneError(f"{path.name}: {MISSING}")
    if code:
        raise SceneError(f"{path.name}: {_why(code, said)}")
    return _read(data, said, path.name)


def _compile(path: Path) -> tuple[int, bytes, list[str]]:
    """The exit code of the compiler, its output, and the lines of its messages."""
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
    lines = done.stderr.decode("utf-8", "replace").splitlines()
    return done.returncode, done.stdout, [line.strip() for line in lines if line.strip()]


def _why(code: int, said: list[str]) -> str:
    """What MuJoCo says of a file that it does not compile."""
    last = said[-1] if said else ""
    if code < 0 or not last:
        return f"MuJoCo ends while it compiles the file (code {code}){f': {last}' if last else ''}"
    return f"MuJoCo: {last.removeprefix('Error: ').removesuffix(';')}"


def _read(data: bytes, said: list[str], name: str) -> Compiled:
    import numpy as np  # here, so that reading a scene does not load it

    with np.load(io.BytesIO(data), allow_pickle=False) as found:
        arrays = {key: found[key] for key in found.files}
    names = {
        key.removeprefix("names_"): _called(key.removeprefix("names_"), json.loads(str(array)))
        for key, array in arrays.items()
        if key.startswith("names_")
    }
    for key in sorted(arrays, key=lambda key: (key.endswith("0"), key)):  # what is computed: last
        measured = key.startswith(MEASURED) and arrays[key].dtype.kind == "f"
        if measured and not (np.abs(arrays[key].astype(float)) <= LARGEST).all():
            raise SceneError(
                f"{name}: {key} of the compiled model has a number that is not finite or larger "
                f"than {LARGEST:g}; correct the file"
            )
    lists = {key: a.tolist() for key, a in arrays.items() if not key.startswith("names_")}
    warnings = [f"MuJoCo warns: {line[8:].strip()}" for line in said if line.startswith("WARNING")]
    return Compiled(lists, names, tuple(dict.fromkeys(map(one_line, warnings))))


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
