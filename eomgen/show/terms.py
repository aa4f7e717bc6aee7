"""Which term of the derivation each line of a generated Python module computes."""

import ast
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

NUMBERED = re.compile(r"[sk]\d+$")
"""Variables without a name of their own."""
LETTERS = {
    "mass_matrix": "M",
    "velocity_force": "V",
    "gravity_force": "G",
    "bias_force": "(V + G)",
    "applied_force": "F",
}
"""Outputs by their letters in M v̇ + V + G = F."""
MOST_TERMS = 3
"""The most terms that are listed of a line that several need."""
TERMS: Mapping[str, str] = {
    "mass": "mass of {}, of its tree or its frame",
    "pivot": "pivot of {}: d of the closed form (37), D of the recursion",
    "load": "load of {}: b of the closed form (37), Q in Kane's",
    "coupling": "coupling of {}: c of the closed form (37)",
    "alpha": "angular acceleration α of {}",
    "delta": "linear acceleration of {}, beside that at v̇ = 0",
    "omega": "angular velocity ω of {}",
    "velocity": "velocity v of {}",
    "bias": "acceleration of {} at v̇ = 0: ζ of the recursion, α and a of the closed form",
    "angle": "angle ψ of {}",
    "moment": "first moment of mass m c of {}: in the inertia I of its frame",
    "inertia": "moment of inertia of {}: in the inertia I of its frame",
    "weight": "weight w of a square: in the pivots of the closed form, {}",
    "row": "entry j of a square: in the pivots of the closed form, {}",
    "turn": "partial angular velocity: {}",
    "move": "partial velocity: {}",
    "mean": "mean of a tree: h of the closed form, {}",
    "apart": "difference from the mean: j of the closed form, {}",
    "rest": "what is left: b of the closed form, {}",
    "drive": "force on a velocity: f of the closed form, {}",
    "force": "joint force f of {}, (38)",
    "fx": "joint force f of {}, x, (38)",
    "fy": "joint force f of {}, y, (38)",
    "R": "entry of the rotation R: {}",
    "W": "entry of the rotation W: {}",
    "k": "scale 2/|q|² of the quaternion of {}",
    "sin": "sine of {}",
    "cos": "cosine of {}",
}
"""What the first part of a variable's name says; the rest of the name is put in."""


@dataclass(frozen=True)
class ExplainedLine:
    """One assignment of a kernel, and the term that it is, or is part of."""

    kernel: str
    line: str
    term: str


@dataclass(frozen=True)
class _Kernel:
    """Assignments in order, each with the names that it uses, and the results likewise."""

    name: str
    lines: tuple[tuple[str, str, tuple[str, ...]], ...]
    results: tuple[tuple[str, tuple[str, ...]], ...]


def explained(source: str) -> Iterator[ExplainedLine]:
    """Every line of every kernel of a generated Python module, with its term."""
    tree = ast.parse(source)
    given = {
        node.targets[0].id: ast.literal_eval(node.value)
        for node in tree.body
        if isinstance(node, ast.Assign)
        and isinstance(node.targets[0], ast.Name)
        and node.targets[0].id in ("STATES", "INPUTS", "PARAMETERS", "EFFECT_NAMES")
        and isinstance(node.value, ast.Tuple | ast.Dict | ast.List)
    }
    states = tuple(given.get("STATES", ()))
    kernels = [
        _kernel(node, states)
        for node in tree.body
        if isinstance(node, ast.FunctionDef)
        and (node.name == "_fixed" or [a.arg for a in node.args.args][:2] == ["y", "k"])
    ]
    used = [kernel for kernel in kernels if kernel.name != "fixed"]
    for kernel in kernels:
        consumers = [*used, kernel] if kernel.name == "fixed" else [kernel]
        terms = _terms(kernel, consumers)
        for target, line, _ in kernel.lines:
            yield ExplainedLine(kernel.name, line, terms[target])


def _kernel(node: ast.FunctionDef, states: Sequence[str]) -> _Kernel:
    lines, results = [], []
    name = node.name.removeprefix("_")
    for statement in ast.walk(node):
        if isinstance(statement, ast.Assign) and isinstance(statement.targets[0], ast.Name):
            target = statement.targets[0].id
            lines.append((target, ast.unparse(statement), _names(statement.value)))
        if isinstance(statement, ast.Return) and isinstance(statement.value, ast.Tuple):
            count = len(statement.value.elts)
            for i, entry in enumerate(statement.value.elts):
                results.append((_result(name, i, count, states), _names(entry)))
        elif isinstance(statement, ast.Return) and statement.value and name != "fixed":
            results.append((_result(name, 0, 1, states), _names(statement.value)))
    return _Kernel(name, tuple(lines), tuple(results))


def _names(node: ast.AST) -> tuple[str, ...]:
    return tuple(dict.fromkeys(x.id for x in ast.walk(node) if isinstance(x, ast.Name)))


def _result(kernel: str, i: int, count: int, states: Sequence[str]) -> str:
    """The name of a result of a kernel: M_3,1, or the time derivative of a state."""
    if kernel == "derivative" and i < len(states):
        return f"time derivative of {states[i]}"
    letter = LETTERS.get(kernel, kernel)
    if kernel == "mass_matrix":
        rows = math.isqrt(count)
        return f"{letter}_{i // rows + 1},{i % rows + 1}"
    return f"{letter}_{i + 1}" if count > 1 else letter


def _terms(kernel: _Kernel, consumers: Sequence[_Kernel]) -> dict[str, str]:
    """The term of each variable of a kernel: its own, or those of what it is part of."""
    needed: dict[str, dict[str, None]] = {}
    order: dict[str, int] = {}
    for other in consumers:
        for label, names in other.results:
            order.setdefault(label, len(order))
            for name in names:
                needed.setdefault(name, {})[label] = None
        for target, _, names in reversed(other.lines):
            own = _own_term(target)
            order.setdefault(own, len(order))
            labels = {own: None} if own else needed.get(target, {})
            for name in names:
                needed.setdefault(name, {}).update(labels)
    found = {}
    for target, _, _ in kernel.lines:
        several = sorted(needed.get(target, {}), key=lambda label: order[label])
        more = f" and {len(several) - MOST_TERMS} more" if len(several) > MOST_TERMS else ""
        listed = f"part of {'; '.join(several[:MOST_TERMS])}{more}"
        found[target] = _own_term(target) or (listed if several else "a check of a parameter")
    return found


def _own_term(name: str) -> str:
    """What a variable's own name says; "" for a number."""
    if NUMBERED.match(name):
        return ""
    if name.endswith("_squared"):
        return f"square of {name.removesuffix('_squared')}"
    head, _, rest = name.partition("_")
    if rest and head in TERMS:
        return TERMS[head].format(rest.replace("_", " "))
    if name.endswith(("_ddot", "_dot")):
        return f"acceleration or rate {name}"
    return f"{name}, as the scene names it"
