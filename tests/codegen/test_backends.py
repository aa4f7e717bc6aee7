"""Languages: each is a file and a folder, and computes what the NumPy module does."""

import json
import re
import subprocess
from pathlib import Path
from typing import Any

import awk_backend
import numpy as np
import pytest
from campaign import some
from engine import Engine, engine

import eomgen
from eomgen.base.errors import RunError
from eomgen.codegen import kernels
from eomgen.codegen.backends import BACKENDS
from eomgen.codegen.interface import interface_of
from eomgen.commands.main import main
from eomgen.pipeline import python_module
from eomgen.run.module import load_module
from eomgen.scalars.functions import BY_MATH

SCENES = ("two_body_forced", "tumbling_body", "steering_particles")


def awk(text: str, states: np.ndarray, folder: Path) -> np.ndarray:
    """What an AWK program prints of states, one a row."""
    path = folder / "scene.awk"
    path.write_text(text, "utf-8")
    lines = "\n".join(" ".join(map(repr, row)) for row in states.tolist())
    done = subprocess.run(
        ["awk", "-f", str(path)], input=lines, capture_output=True, text=True, check=True
    )
    return np.array([[float(x) for x in line.split()] for line in done.stdout.splitlines()])


@pytest.mark.every(2)
@pytest.mark.parametrize("scene", ["double_pendulum", "tumbling_body", "chain"])
def test_a_language_is_one_file_and_one_folder(
    scene: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """AWK, which is no language of this program: chosen by name, written, run, and right."""
    monkeypatch.setitem(BACKENDS, "awk", awk_backend)
    assert main(["generate", scene, "--backend", "awk", "-o", str(tmp_path)]) == 0
    made = engine(scene)
    rng = np.random.default_rng(4)
    states = np.array([made.random_state(rng) for _ in range(5)])
    found = awk((tmp_path / f"{scene}.awk").read_text("utf-8"), states, tmp_path)
    module = eomgen.load(eomgen.generate(scene))
    wanted = np.array([module.derivative(0.0, y) for y in states])
    assert found == pytest.approx(wanted, rel=1e-11, abs=1e-11)


def test_what_a_backend_knows(monkeypatch: pytest.MonkeyPatch) -> None:
    """The program and its interface, and no model."""
    import ast

    for backend in (*BACKENDS.values(), awk_backend):
        tree = ast.parse(Path(backend.__file__ or "").read_text("utf-8"))  # type: ignore[attr-defined]
        imported = [n.module or "" for n in ast.walk(tree) if isinstance(n, ast.ImportFrom)]
        assert imported and not [m for m in imported if m.startswith("eomgen.model")]


# JavaScript, by a reader of its straight lines: what is checked holds where no engine is.

_LINE = re.compile(r"^  const (\w+) = (.*);$")


def javascript(text: str, made: Engine, name: str, y: np.ndarray, extra: Any = ()) -> list[float]:
    """What a kernel of a JavaScript module computes, line by line in Python."""
    body = text.split(f"function {name}_(t, y, k, u, extra) {{\n")[1].split("\n}")[0]
    fixed = text.split("const fixed = (")[1].split("\n};")[0]
    values: dict[str, Any] = {"t": 0.3, "y": y.tolist(), "extra": list(extra)}
    values["u"] = [0.0] * len(made.module.INPUTS)
    names = [word.strip() for word in fixed.split(")")[0].split(",") if word.strip()]
    values |= dict(zip(names, made.module.PARAMETERS.values(), strict=True))
    functions = {
        **{f"Math_{f}": value for f, value in BY_MATH.items()},
        **{f: BY_MATH[f] for f in ("step", "select")},
    }

    def value(source: str) -> float:
        tree = compile(source.replace("Math.", "Math_"), "line", "eval")
        return float(eval(tree, {"__builtins__": {}}, {**functions, **values}))

    for part in (fixed, body):
        for line in part.splitlines():
            if (found := _LINE.match(line)) and not line.startswith("  const ["):
                values[found[1]] = value(found[2])
    rows = body.split("return [\n")[1].split("\n  ];")[0]
    return [value(row.strip().rstrip(",")) for row in rows.splitlines()]


@pytest.mark.every(2)
@pytest.mark.parametrize("scene", SCENES)
def test_javascript_is_the_module(scene: str, tmp_path: Path) -> None:
    """The same bits as Python's, of the derivative and of all that is computed beside it."""
    made = engine(scene)
    text = BACKENDS["javascript"].files(made.system.program, interface_of(made.system))
    ((name, source),) = text.items()
    assert name == f"{made.module.NAME}.js"
    y = made.random_state(np.random.default_rng(5))
    for output in ("derivative", "jacobian", "kinetic_energy", "body_poses", "mass_matrix"):
        if output in made.system.program.outputs and output not in made.system.tangents:
            found = javascript(source, made, output, y)
            wanted = np.ravel(getattr(made.module, output)(0.3, y))
            assert np.array_equal(found, wanted), output


def test_the_module_says_what_it_is(tmp_path: Path) -> None:
    """Names, units and defaults; it is written, and checked, as the Python module is."""
    folder = str(tmp_path)
    assert main(["generate", "cart_pole", "--backend", "javascript", "-o", folder]) == 0
    text = (tmp_path / "cart_pole.js").read_text("utf-8")
    module = eomgen.load(eomgen.generate("cart_pole"))
    given = text.split("export const PARAMETERS = {\n")[1].split("\n};")[0]
    pairs = dict(re.findall(r"^  (\w+): ([^,]+),", given, re.MULTILINE))
    assert {name: float(value) for name, value in pairs.items()} == module.PARAMETERS
    assert re.findall(r'^  "(\w+)"', text.split("];")[0], re.MULTILINE) == [*module.STATES]
    assert main(["generate", "cart_pole", "--backend", "javascript", "-o", folder, "--check"]) == 0
    (tmp_path / "cart_pole.js").write_text(text.replace("9.81", "9.91"), "utf-8")
    assert main(["generate", "cart_pole", "--backend", "javascript", "-o", folder, "--check"]) == 1


def test_a_language_that_is_not_there(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """One line says which there are; Python loads its own only."""
    assert main(["generate", "pendulum", "--backend", "javascrip", "-o", str(tmp_path)]) == 1
    assert capsys.readouterr().err == (
        "eomgen: backend: unknown name 'javascrip' (did you mean 'javascript'?); known: "
        "numpy, c, javascript, jax, matlab\n"
    )
    with pytest.raises(RunError, match="unknown name 'fortran'; known: numpy, c, javascript"):
        eomgen.generate("pendulum", backend="fortran")
    other = eomgen.generate("pendulum", backend="javascript")
    assert other.source.startswith("/* ") and json.loads(json.dumps(other.backend)) == "javascript"
    with pytest.raises(RunError, match="loads modules of 'numpy', 'c' and 'jax', not of"):
        eomgen.load(other)


def test_a_large_jacobian_goes_on_from_the_derivative(monkeypatch: pytest.MonkeyPatch) -> None:
    """Instead of repeating it: fewer lines, and the same bits for a state and for columns."""
    scene, share = some(("two_body_forced", 0.96), ("chain", 0.95))
    made = engine(scene, "aba")
    monkeypatch.setattr(kernels, "LARGE", 1)
    short = python_module(made.system)
    monkeypatch.setattr(kernels, "LARGE", 10**9)
    long = python_module(made.system)
    assert "passing=True" in short and "passing" not in long
    assert short.count("\n") < share * long.count("\n")
    one, other = load_module(short), load_module(long)
    rng = np.random.default_rng(6)
    y = np.array([made.random_state(rng) for _ in range(3)]).T
    p = {name: 1.01 * value for name, value in one.PARAMETERS.items()}
    for given in (y, y[:, 0].copy()):
        for function in ("derivative", "jacobian"):
            first, second = (getattr(m, function)(0.1, given, p) for m in (one, other))
            assert np.array_equal(first, second), function
