"""WebAssembly: the functions of firmware, in double, as a module without imports.

Its memory holds the arrays that they are given; `__heap_base` says where it is free.
"""

import importlib.util
import re
import subprocess
import sys
import tempfile
from pathlib import Path

from eomgen.base.errors import RunError, SceneError
from eomgen.exports import Options, Written, firmware
from eomgen.model.model import Model

FLAGS = (
    *("-target", "wasm32-freestanding", "-std=c99", "-O2", "-ffp-contract=off"),
    *("-fno-math-errno", "-nostdlib", "-fvisibility=default", "-w", "-I."),
    *("-Wl,--strip-all", "-Wl,--no-entry", "-Wl,--export-dynamic", "-Wl,--export=__heap_base"),
)
"""For a module that waits for calls; operations as they are written."""
MATH = """
#define sqrt __builtin_sqrt
#define fabs __builtin_fabs
#define INFINITY __builtin_inf()
#define NAN __builtin_nan("")
#define isfinite(x) __builtin_isfinite(x)
"""
"""What there is of <math.h>: the instructions of WebAssembly."""


def files(model: Model, options: Options) -> Written:
    """The module. Raises `SceneError` for a scene that needs a mathematical library beside sines,
    cosines and roots, and `RunError` if there is no compiler for WebAssembly.
    """
    if importlib.util.find_spec("ziglang") is None:
        raise RunError("wasm: the compiler is not installed; run: pip install 'eomgen[compiled]'")
    written = firmware.files(model, options)
    name = f"{model.name}.c"
    with tempfile.TemporaryDirectory(prefix="eomgen-") as folder:
        for each, text in {**written.files, "math.h": MATH}.items():
            assert isinstance(text, str)
            (Path(folder) / each).write_text(text, "utf-8")
        command = [sys.executable, "-m", "ziglang", "cc", *FLAGS, name, "-o", "made.wasm"]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
        if missing := re.search(r"undeclared function '(\w+)'", done.stderr):
            why = f"the scene uses {missing[1]}, which WebAssembly does not have"
            raise SceneError(f"wasm: {why}; take --firmware")
        if done.returncode:
            raise RunError(f"wasm: {(done.stderr.splitlines() or ['the compiler failed'])[0]}")
        made = (Path(folder) / "made.wasm").read_bytes()
    return Written({f"{model.name}.wasm": made}, written.remarks)
