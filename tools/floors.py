"""The floors of the package: who may import whom."""

import ast
from functools import cache
from pathlib import Path

import eomgen

PACKAGE = Path(eomgen.__file__).parent

# Each room may import from itself and from those below it; the lowest comes first. A room is a
# package or a module, and does not count what has a line of its own.
FLOORS = (
    "base",
    "tables",
    "scalars",
    "language",
    "subset",
    "program",
    "certified",
    "engine",
    "scene.joints",
    "scene.effects",
    "scene.constraints",
    "scene",
    "entries",
    "model",
    "dynamics.tree",
    "dynamics.orthogonal",
    "dynamics.loops",
    "dynamics",
    "dynamics.start",
    "derivation",
    "codegen",
    "pipeline",
    "store",
    "run",
    "native",
    "results",
    "study.precision",
    "study.linear",
    "study.constrained_start",
    "study.whole",
    "study.diagnosis",
    "study.timing",
    "study.accuracy",
    "study.verification",
    "study.cost",
    "study",
    "fitting",
    "sweep",
    "show",
    "exports",
    "api",
    "commands",
    "__main__",
)


@cache
def nodes(path: Path) -> list[ast.AST]:
    """Everything that a module is made of."""
    return list(ast.walk(ast.parse(path.read_text("utf-8"))))


@cache
def modules() -> dict[str, Path]:
    """The package's modules by name, without the package's own name; "" is the package itself."""
    found = {}
    for path in sorted(PACKAGE.rglob("*.py")):
        parts = path.relative_to(PACKAGE).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


@cache
def imports(name: str) -> tuple[str, ...]:
    """The package's own modules that a module imports, wherever in it."""
    found = []
    for node in nodes(modules()[name]):
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "eomgen":
            base = (node.module or "").removeprefix("eomgen").removeprefix(".")
            for alias in node.names:
                inner = f"{base}.{alias.name}".removeprefix(".")
                found.append(inner if inner in modules() else base)
        elif isinstance(node, ast.Import):
            names = [alias.name.split(".", 1) for alias in node.names]
            found += [name[1] for name in names if name[0] == "eomgen" and len(name) > 1]
    return tuple(dict.fromkeys(found))


def room(name: str) -> str:
    """The room that a module is in. Raises `KeyError` if it is in none."""
    parts = name.split(".")
    for end in range(len(parts), 0, -1):
        if (found := ".".join(parts[:end])) in FLOORS:
            return found
    raise KeyError(f"{name} is on no floor: add it to FLOORS")
