"""Firmware of a scene as a library, called from Python."""

import ctypes
import re
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

import eomgen
from eomgen.exports import Number
from eomgen.native.compiler import find_compiler

TYPES: dict[str, Any] = {"double": np.float64, "float": np.float32}
SEEN = """
#ifdef sin_
real seen(real x, int quarter) { return quarter ? cos_(x) : sin_(x); }
#endif
"""


class Firmware:
    """The functions of a scene's firmware, over arrays of its own type of numbers."""

    def __init__(self, scene: str, number: Number, integrator: str = "", *flags: str) -> None:
        with tempfile.TemporaryDirectory() as folder:
            paths = eomgen.export(scene, "firmware", folder, number=number, integrator=integrator)
            sources = {path.name: path.read_text("utf-8") for path in paths}
        self.name, self.type = Path(paths[0]).stem, TYPES[number]
        self.sources = sources
        main = f'#include "{self.name}.c"\n{SEEN}'
        own = [flag.replace("LIBM", f"{self.name.upper()}_LIBM") for flag in flags]
        files = {**sources, "main.c": main}
        built = find_compiler().shared_library(files, "main.c", "-O1", *own)
        with tempfile.NamedTemporaryFile(suffix=".so") as file:
            file.write(built)
            file.flush()
            self.library = ctypes.CDLL(file.name)
        self.states = int(re.findall(r"_STATES (\d+)", sources[f"{self.name}.h"])[0])
        self.real = ctypes.c_double if number == "double" else ctypes.c_float
        self.k = self.array(np.zeros(1000))
        p = self.array(np.zeros(1000))
        self.call("defaults", p)
        assert self.call("constants", p, self.k) == 0

    def array(self, values: Any) -> np.ndarray:
        """An array of the firmware's numbers."""
        return np.array(values, self.type)

    def call(self, function: str, *arguments: Any) -> Any:
        """Call a function: arrays by address, whole numbers as such, others as its numbers."""
        given = [
            ctypes.c_void_p(x.ctypes.data)
            if isinstance(x, np.ndarray)
            else x
            if isinstance(x, int)
            else self.real(x)
            for x in arguments
        ]
        return self.library[f"{self.name}_{function}"](*given)

    def derivative(self, t: float, y: np.ndarray, u: np.ndarray) -> np.ndarray:
        """The time derivative of the state."""
        out = np.zeros_like(y)
        self.call("derivative", t, y, self.k, u, out)
        return out

    def stepped(self, y: Any, u: Any, dt: float, count: int, first: int = 0) -> np.ndarray:
        """The state after some steps, of which the first has this number."""
        y, u = self.array(y), self.array([*u, 0.0])
        for i in range(first, first + count):
            assert self.call("step", i * dt, dt, y, self.k, u) == 1
        return y

    def circular(self, x: np.ndarray, quarter: int) -> np.ndarray:
        """Its sines (quarter 0) or cosines (1)."""
        self.library.seen.restype = self.real
        return self.array([self.library.seen(self.real(v), quarter) for v in x.tolist()])
