"""Functions for MATLAB, by a reader of their straight lines; see `campaigns/octave.py`."""

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_casadi import CORNERS

import eomgen
from eomgen.base.errors import RunError
from eomgen.commands.main import main
from eomgen.scalars.functions import BY_MATH

pytestmark = pytest.mark.apart

SCENES = ("cart_pole", "tumbling_body", "bouncing_two_body", "four_bar", CORNERS)
_LINE = re.compile(r"^(\w+) = (.*);$")
_ELEMENT = re.compile(r"\b([ypu])\((\d+)\)")
FUNCTIONS = {**BY_MATH, "step_": BY_MATH["step"], "select_": BY_MATH["select"]}


def computed(text: str, y: Any, p: Any, u: Any) -> list[list[float]]:
    """The rows that a function of MATLAB returns, line by line in Python, at t = 0.3."""
    values: dict[str, Any] = {"t": 0.3, "y": y, "p": p, "u": u}

    def value(source: str) -> float:
        source = _ELEMENT.sub(lambda found: f"{found[1]}[{int(found[2]) - 1}]", source)
        return float(eval(source, {"__builtins__": {}}, {**FUNCTIONS, **values}))

    lines, _, rest = text.rpartition("result = [\n")
    for line in lines.split(" numbers');\nend\n")[1].splitlines():
        if found := _LINE.match(line):
            values[found[1]] = value(found[2])
    rows = rest.split("];")[0].splitlines()
    return [[value(entry) for entry in _entries(row)] for row in rows]


def _entries(row: str) -> list[str]:
    """The entries of a row: what commas outside of parentheses divide."""
    found, depth = [""], 0
    for letter in row.strip():
        depth += (letter == "(") - (letter == ")")
        if letter == "," and not depth:
            found.append("")
        else:
            found[-1] += letter
    return found


def files(source: Any) -> tuple[dict[str, str], Any]:
    """The files of a scene by name, and its Python module."""
    made = eomgen.generate(source, backend="matlab")
    module = eomgen.load(eomgen.generate(source))
    return {f"{made.name}.m": made.source, **made.others}, module


def arguments(module: Any) -> tuple[Any, Any, Any]:
    """A state, parameters and inputs."""
    rng = np.random.default_rng(6)
    y = module.initial_state() + rng.uniform(-0.3, 0.3, len(module.STATES))
    p = np.array([*module.PARAMETERS.values()]) * rng.uniform(0.98, 1.02, len(module.PARAMETERS))
    return y, p, rng.uniform(-3.0, 3.0, len(module.INPUTS))


def checked(module: Any, name: str) -> str:
    """The function of the Python module that a file has; "" if it is internal."""
    output = name.removesuffix(".m").removeprefix(module.NAME).removeprefix("_") or "derivative"
    return output if hasattr(module, output) else ""


@pytest.mark.every(2)
@pytest.mark.parametrize("source", SCENES, ids=lambda s: s if isinstance(s, str) else s["name"])
def test_the_lines_are_those_of_the_module(source: Any) -> None:
    """The same bits, of the derivative and of each other output."""
    found, module = files(source)
    y, p, u = arguments(module)
    for name, text in found.items():
        if output := checked(module, name):
            rows = computed(text, y.tolist(), p.tolist(), u.tolist())
            wanted = np.asarray(getattr(module, output)(0.3, y, p, u))
            count = np.prod(wanted.shape[:-1]) if wanted.ndim > 1 else wanted.size
            assert len(rows) == (count if wanted.size else 0), name
            assert np.array_equal(np.ravel(rows), np.ravel(wanted)), name
    main_file = found[f"{module.NAME}.m"]
    start = main_file.split("result = [\n")[1].split("    ];")[0].split()
    assert np.array_equal([float(x) for x in start], module.initial_state())


def test_names_that_matlab_would_cut(tmp_path: Path) -> None:
    """They are refused in one line; names that MATLAB reserves get an underscore."""
    long = {**CORNERS, "parameters": {"a" * 64: 1.0}}
    long["bodies"] = [{"name": "block", "mass": "a" * 64, "inertia_com": 0.1}]
    with pytest.raises(RunError, match="has 64 letters, and MATLAB takes 63"):
        eomgen.generate(long, backend="matlab")
    odd = {**CORNERS, "parameters": {"end": 2.0, "p": 1.0, "nargin": 1.0}}
    odd["bodies"] = [{"name": "block", "mass": "end*p*nargin", "inertia_com": 0.1}]
    text = eomgen.generate(odd, backend="matlab").source
    assert "end_ = p(1);\np_ = p(2);\nnargin_ = p(3);\n" in text


def test_export_writes_the_files_of_the_backend(tmp_path: Path) -> None:
    """In a folder of their own, with what MATLAB shows as their help."""
    assert (
        main(["export", "cart_pole", "--matlab", "-o", str(tmp_path), "--outputs", "momentum"]) == 0
    )
    text = (tmp_path / "cart_pole.m").read_text("utf-8")
    assert text.startswith("function result = cart_pole(t, y, p, u)\n%CART_POLE Time derivative")
    assert "%     2  theta, rad: angle of pole from cart\n" in text
    assert math.isclose(float(re.findall(r"^        (3\.\S+)$", text, re.M)[0]), math.radians(176))
    assert {path.stem.removeprefix("cart_pole") for path in tmp_path.iterdir()} == {
        *("", "_jacobian", "_momentum")
    }
