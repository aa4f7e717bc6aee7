"""The shape of the code: imports go one way, the running half is light, promises of the README."""

import ast
import re
import subprocess
import sys
import tomllib
from pathlib import Path
from pkgutil import resolve_name

import pytest
from drawing import DRAWING, drawing
from floors import FLOORS, PACKAGE, imports, modules, nodes, room

import eomgen
from eomgen.run.integrators import INTEGRATORS
from eomgen.scene.json_schema import json_schema
from eomgen.scene.reader import BUILT_IN, built_in_names, read_scene
from eomgen.scene.reference import reference
from eomgen.tables.outputs import DERIVATIVES, OUTPUTS

ROOT = Path(__file__).parent.parent.parent


def test_imports_go_one_way() -> None:
    """A later stage is never imported by an earlier one, not even inside a function."""
    rank = {name: i for i, name in enumerate(FLOORS)}
    for name in modules():
        for other in imports(name) if name else ():
            assert rank[room(other)] <= rank[room(name)], f"{name} imports {other}"


def test_no_import_cycle() -> None:
    """No module reaches itself through what it imports."""
    for start in modules():
        seen: set[str] = set()
        stack = list(imports(start))
        while stack:
            name = stack.pop()
            if name not in seen:
                seen.add(name)
                stack += imports(name)
        assert start not in seen, f"{start} imports itself"


def test_the_drawing_is_fresh() -> None:
    """`python tools/drawing.py` draws what docs/architecture.md shows."""
    assert DRAWING.read_text("utf-8") == drawing()


def test_what_runs_knows_no_mechanics() -> None:
    """It is handed a module, and whatever explains a failure: no model, dynamics or derivation."""
    for name in modules():
        for other in imports(name) if name and room(name) == "run" else ():
            known = ("run", "tables", "engine", "subset", "base")
            assert room(other) in known, f"{name} imports {other}"


@pytest.mark.parametrize("command", ["list", "--help", "simulate --help", "nonsense"])
def test_what_needs_no_scene_loads_little(command: str) -> None:
    """Names and help come at once: what reads scenes and computes takes ten times as long."""
    code = (
        "import sys; from eomgen.commands.main import main\n"
        "try: main(sys.argv[1:])\n"
        "except SystemExit: pass\n"
        "sys.exit(10 * bool(sys.modules.keys() & {'numpy', 'pydantic', 'sympy', 'jinja2'}))"
    )
    done = subprocess.run([sys.executable, "-c", code, *command.split()], capture_output=True)
    assert done.returncode == 0, done.stderr


@pytest.mark.apart
def test_the_running_half_does_without_sympy(tmp_path: Path) -> None:
    """Loading, integrating, drawing, and all of `simulate` where the module is in the store: SymPy
    is neither needed nor imported.
    """
    eomgen.generate("pendulum")
    rest = (
        "eomgen.store, eomgen.run.integrate, eomgen.run.module, eomgen.show.observe, "
        "eomgen.study.linear.linearise, eomgen.study.linear.equilibrium, "
        "eomgen.study.linear.modes, eomgen.show.page"
    )
    commands = [f"eomgen.{name}" for name in modules() if name.startswith("commands")]
    code = (
        f"import sys, {', '.join(commands)}, {rest}, eomgen.show.figure as f; "
        "from eomgen.commands.main import main; from matplotlib.figure import Figure; "
        "f.draw_motion = lambda motion: Figure((1, 1)); "
        "code = main(['simulate', 'pendulum', '--t-end', '0.1', '-o', sys.argv[1]]); "
        "sys.exit(code or 10 * ('sympy' in sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code, str(tmp_path)], capture_output=True)
    assert done.returncode == 0, done.stderr


def test_generated_modules_import_math_and_numpy_only() -> None:
    """`functools` of the standard library beside them; nothing that solves."""
    for path in sorted((ROOT / "generated").glob("*.py")):
        source = path.read_text("utf-8")
        assert not re.search(r"\.\s*(linalg|solve|inv|lstsq|det)\b", source), path
        names = set(re.findall(r"^\s*(?:from|import) +([\w.]+)", source, re.MULTILINE))
        assert names == {"functools", "math", "numpy"}, path


def test_no_text_is_executed() -> None:
    """Nothing in the package evaluates text: no eval, exec, sympify, parse_expr or lambdify."""
    forbidden = {"eval", "exec", "sympify", "parse_expr", "lambdify", "S"}
    for path in sorted(PACKAGE.rglob("*.py")):
        for node in nodes(path):
            if isinstance(node, ast.Call):
                called = node.func
                name = getattr(called, "id", None) or getattr(called, "attr", "")
                if isinstance(called, ast.Attribute) and called.attr in ("eval", "exec"):
                    name = ""  # a method of that name; the builtins are plain names
                assert name not in forbidden, f"{path}:{node.lineno}: {name}"


def test_each_fact_lives_once() -> None:
    """What two places must both know is the same in both."""
    from eomgen.scene import schema

    assert schema.Integrator.__args__ == tuple(INTEGRATORS)
    assert schema.Output.__args__ == tuple(OUTPUTS)
    for name, spec in OUTPUTS.items():
        assert bool(spec.builder) != (name in DERIVATIVES), name
        assert not spec.builder or callable(resolve_name(f"eomgen.codegen.{spec.builder}")), name
    assert (BUILT_IN / "scene.schema.json").read_text("utf-8") == json_schema()
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    python = project["requires-python"].removeprefix(">=")
    assert f"Python ≥ {python}" in (ROOT / "README.md").read_text("utf-8")


def test_tables_of_the_reference_are_whole() -> None:
    """A bar within a cell would make two of it."""
    rows = [line for line in reference().splitlines() if line.startswith("|")]
    assert len(rows) > 100
    assert {row.count("|") for row in rows} == {5}


def test_built_in_scenes_fit_the_json_schema() -> None:
    """The schema for editors agrees with what the reader takes."""
    import json

    import jsonschema

    validator = jsonschema.Draft202012Validator(json.loads(json_schema()))
    for name in built_in_names():
        table = tomllib.loads((BUILT_IN / f"{name}.toml").read_text("utf-8"))
        assert not list(validator.iter_errors(table)), name
        assert read_scene(name).name == name
        first = (table.get("bodies") or table["chains"])[0]
        first["mas"] = first.pop("mass")
        assert not validator.is_valid(table), name
