"""The NumPy backend: a Python module that imports `math` and `numpy` only."""

import json
import keyword
import math
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from eomgen.base.errors import listed
from eomgen.base.templating import render
from eomgen.codegen.backends.conditions import Test, refusals
from eomgen.codegen.interface import Interface
from eomgen.codegen.kernels import Kernel, kernels_of
from eomgen.language.base import LARGEST
from eomgen.language.formula import names_in
from eomgen.program.printing import Block, Dialect
from eomgen.program.program import Program, live_steps
from eomgen.scalars.functions import FUNCTIONS
from eomgen.tables.outputs import DYNAMICS, OUTPUTS

SUFFIXES: tuple[str, ...] = (".py",)
TEMPLATES = "python"
ABOUT = "a Python module that needs NumPy only"
WIDTH = 100
RESERVED = frozenset(
    {"y", "p", "u", "k", "extra", "np", "math", "values"}
    | set(FUNCTIONS)
    | set(keyword.kwlist)
    | {"float", "len", "list", "tuple", "ValueError", "zip"}
)
SHELL = ("hypot", "inf", "isfinite", "nan", "prod")
"""Names of `math` that the shell uses."""
SHOWING = ("sin", "cos", "tan", "asin", "acos", "log", "sqrt", "abs")
"""Functions whose value is never finite for an argument that is not finite."""
DIALECT = Dialect({name: name for name in FUNCTIONS}, RESERVED)
COLUMNS = {
    **{name: f"np.{name}" for name in ("sin", "cos", "tan", "exp", "log", "tanh", "sqrt", "abs")},
    **{name: f"np.arc{name[1:]}" for name in ("asin", "acos", "atan", "atan2")},
    "min": "np.minimum",
    "max": "np.maximum",
    "step": "lambda x: np.heaviside(x, 0.0)",
    "select": "lambda c, a, b: np.where(c > 0.0, a, b)",
}
"""NumPy source of each function, for columns of states."""
OWN = {
    "step": ("x", "1.0 if x > 0.0 else 0.0"),
    "select": ("c, a, b", "a if c > 0.0 else b"),
}
"""Parameters and value of functions that neither `math` nor Python has."""


@dataclass(frozen=True)
class Written:
    """A kernel as values for the template.

    held   constants of the kernel, after those of its base
    known  number of the base's constants
    """

    name: str
    about: str
    shape: str
    block: Block
    state: str
    inputs: str
    extra: str
    constants: str
    functions: tuple[str, ...]
    operations: str
    tangent: bool
    time: bool
    held: str
    passed: tuple[str, ...]
    base: "Written | None"
    known: int
    taken: tuple[str, ...]


def files(program: Program, interface: Interface) -> Mapping[str, str]:
    """The module, one file. Equal programs and interfaces give equal bytes."""
    return {f"{interface.name}.py": module(program, interface)}


def module(program: Program, interface: Interface) -> str:
    """The module's source."""
    kernels, constants = kernels_of(program, interface, DIALECT, sharing=True)
    written = {kernel.function.name: _written(kernel) for kernel in kernels}
    costs = {kernel.function.name: kernel.counts for kernel in kernels}
    moving = {f for kernel in kernels for f in kernel.block.functions}
    refused = refusals(interface, DIALECT)
    others = (*constants.functions, *refused.functions)
    called = [f for f in FUNCTIONS if f in moving or f in others]
    dynamics = [(n, OUTPUTS[n].beside, "=None" * (OUTPUTS[n].beside == "tau")) for n in DYNAMICS]
    matrices = [k.function.name for k in kernels if k.function.matrix]
    special = {"initial_state", "derivative", *matrices, *(name for name, _, _ in dynamics)}
    special |= {"impact", "held", "samples", "implicit_step"}
    context = _facts(interface) | {
        "about": document(interface, costs["derivative"]),
        "parameter_names": ", ".join(constants.parameters),
        "refused": refused.lines,
        "tests": [(_test(test), _words(test)) for test in refused.tests],
        "impact": written.get("impact"),
        "held": written.get("held"),
        "samples": written.get("samples"),
        "implicit_step": written.get("implicit_step"),
        "costs": [(name, json.dumps(counts)) for name, counts in costs.items()],
        "kernels": list(written.values()),
        "math_functions": sorted({*SHELL, *(f for f in called if hasattr(math, f))}),
        "largest": repr(LARGEST),
        "own_functions": [(f, *OWN[f]) for f in called if f in OWN],
        "columns": [(f, COLUMNS[f]) for f in called if f in moving],
        "timed": any(kernel.time for kernel in kernels),
        "derivative": written["derivative"],
        "watched": watched(program, [s.name for s in interface.states]),
        "outputs": [kernel for name, kernel in written.items() if name not in special],
        "derivatives": [written[name] for name in matrices],
        "dynamics": [(written[name], *rest) for name, *rest in dynamics if name in written],
        "checked": constants.checked,
        "checks": [
            (plain(check.about), source, check.relation, check.problem)
            for check, source in constants.checks
        ],
        "fixed": constants.lines,
    }
    return render(TEMPLATES, "module.py.jinja", context)


def _facts(interface: Interface) -> dict[str, Any]:
    """What the template needs of the mechanism: names, sizes and units."""
    return {
        "title": plain(interface.title),
        "scene": interface.name,
        "form": interface.form,
        "dimensions": interface.dimensions,
        "states": interface.states,
        "ny": len(interface.states),
        "nq": interface.coordinates,
        "nv": interface.velocities,
        "nx": interface.others,
        "forces": interface.forces,
        "positions": repr(tuple(i for i, s in enumerate(interface.states) if s.position)),
        "quaternions": repr(interface.quaternions),
        "parameters": interface.parameters,
        "inputs": interface.inputs,
        "units": units(interface),
        "effects": repr(tuple(kind for _, kind in interface.effects)),
        "effect_names": repr(tuple(name for name, _ in interface.effects)),
        "bodies": repr(interface.bodies),
        "joints": repr(interface.joints),
        "drives": len(interface.driven),
        "driven": repr(tuple(c.name for c in interface.driven)) if interface.driven else "",
        "points": repr(interface.points),
        "contacts": [(c.name, c.effect) for c in interface.contacts],
        "controllers": [(c.effect, c) for c in interface.sampling],
        "noises": sum(len(c.noises) for c in interface.sampling),
        "constraints": repr(tuple(n for n, _ in interface.constraints)),
        "constrained": bool(interface.constraints),
        "velocity_rows": repr(interface.velocity_rows) if interface.velocity_rows else "",
        "ranged": repr(interface.ranged) if interface.ranged else "",
        "following": repr(tuple(n for n, _, _ in interface.following))
        if interface.following
        else "",
    }


def _written(kernel: Kernel) -> Written:
    function, base = kernel.function, kernel.base
    wanted = {*kernel.block.functions, *(base.block.functions if base else ())}
    return Written(
        name=function.name,
        about=function.about,
        shape=repr(function.shape),
        block=kernel.block,
        state=unpacking(kernel.state),
        inputs=unpacking(kernel.inputs),
        extra=unpacking(kernel.extra),
        constants=joined(kernel.constants),
        functions=tuple(f for f in FUNCTIONS if f in wanted) if base else kernel.block.functions,
        operations=operations(kernel.counts),
        tangent=function.tangent,
        time=kernel.time or (base is not None and base.time),
        held=joined((*(base.constants if base else ()), *kernel.constants)),
        passed=_wrapped(kernel.passed),
        base=_written(base) if base else None,
        known=len(base.constants) if base else 0,
        taken=_wrapped(kernel.taken),
    )


def _wrapped(names: Sequence[str]) -> tuple[str, ...]:
    """Names wrapped to lines, with a comma after each name."""
    return tuple(textwrap.wrap(" ".join(f"{name}," for name in names), WIDTH - 8))


def watched(program: Program, states: Sequence[str]) -> str:
    """The source of a condition on `state` under which no overflow remains undetected if the
    entries of `derivative` are less than `reach` in size; "" if none is needed.

    A quotient may be finite though its divisor is not, and so may functions other than `SHOWING`.
    Therefore a state that enters one of these, other than through sine or cosine, must be less than
    `reach` too. A state that no entry depends on in a way that shows it must be finite.
    """
    nodes = program.outputs["derivative"].nodes
    steps, live = program.steps, live_steps(program, nodes)
    hidden, seen = set[int](), set(nodes)
    for i in reversed(live):
        operation, operands, _, _ = steps[i]
        hides = operation in FUNCTIONS and operation not in SHOWING
        if hides or (i in hidden and operation not in ("sin", "cos")):
            hidden.update(operands)
        if operation == "div":
            hidden.add(operands[1])
        if i in seen and not hides:
            seen.update(operands[:1] if operation == "div" else operands)
    given = {str(steps[i].value): i for i in live if steps[i].operation == "input"}
    large = [k for k, s in enumerate(states) if given.get(s) in hidden.difference(nodes)]
    unseen = [k for k, s in enumerate(states) if given.get(s) not in seen and k not in large]
    if len(large) > 2:
        return "hypot(*state) < reach"
    sums = [f"state[{k}]" for k in large]
    if unseen:
        sums.append(" + ".join(f"state[{k}]" for k in unseen))
    return " and ".join(f"-reach < {part} < reach" for part in sums)


def _test(test: Test) -> str:
    """The source of a condition that is false for nan."""
    condition, value = test.condition, test.value
    low, high = f"{condition.low + 0.0!r}", f"{condition.high!r}"
    if condition.high == math.inf:
        return f"{value} {'>' if condition.strict else '>='} {low}"
    return f"{low} {'<' if condition.strict else '<='} {value} <= {high}"


def _words(test: Test) -> str:
    """The source of the message for a condition that is not met."""
    condition = test.condition
    names = listed(dict.fromkeys(names_in(condition.value)))
    text = f"parameters {names}: {condition.location}: {condition.words}"
    if test.shown:
        return f"{text!r}.format({', '.join(test.shown)})"
    return repr(text.replace("{{", "{").replace("}}", "}"))


def unpacking(names: Sequence[str]) -> str:
    """The names as unpacking targets, `_` for those not used; "" if none is used."""
    return joined([name or "_" for name in names]) if any(names) else ""


def joined(words: Sequence[str]) -> str:
    """The source of a tuple; a single word gets a trailing comma."""
    return f"{words[0]}," if len(words) == 1 else ", ".join(words)


def operations(counts: Mapping[str, int]) -> str:
    """The number of operations, and how many of each kind, as a docstring has them."""
    kinds = ", ".join(f"{n} {kind}" for kind, n in counts.items() if kind not in _SUMS)
    return f"{counts['total']} operations" + (f": {kinds}" if kinds else "")


_SUMS = ("total", "parameters")


def plain(text: str) -> str:
    """Text of a scene made safe for a docstring: no double quotes, backslashes or control
    characters.
    """
    kept = "".join(c if c.isprintable() else " " for c in text)
    return kept.replace("\\", "/").replace('"', "'")


def units(interface: Interface) -> list[tuple[str, str]]:
    """The entries of `UNITS`: names of all variables with their units. A contact or a constraint
    with the name of a variable of another unit is under its kind and its name.
    """
    entries = [(s.name, s.unit) for s in (*interface.states, *interface.inputs)]
    entries += [(p.name, plain(p.unit)) for p in interface.parameters]
    taken = dict(entries)
    rows = [("contact", c.name, c.unit) for c in interface.contacts]
    rows += [("constraint", *pair) for pair in interface.constraints]
    rows = [row for row in rows if taken.get(row[1]) != row[2]]
    entries += [(f"{kind} {n}" if n in taken else n, unit) for kind, n, unit in rows]
    return entries + [(n, unit) for n, unit, _ in interface.following if n not in taken]


def document(interface: Interface, counts: Mapping[str, int]) -> list[str]:
    """The docstring's tables: states, inputs, parameters, effects, operations."""
    lines = ["State y, in this order:"]
    if not interface.states:
        lines = ["The state y is empty, (0,): all is given by the time."]
    lines += _table([(s.name, s.unit, s.about) for s in interface.states])
    if interface.inputs:
        lines += ["", "Inputs u, each 0 unless given:"]
        rows = [
            (f"{i.name} = {i.default!r}" if i.default else i.name, i.unit, i.about)
            for i in interface.inputs
        ]
        if any(i.default for i in interface.inputs):
            lines[-1] = "Inputs u, each 0 unless another value is shown or given:"
        lines += _table(rows)
    if interface.parameters:
        lines += ["", "Parameters p, with the scene's values:"]
        lines += _table(
            [
                (f"{p.name} = {p.default!r}", plain(p.unit), plain(p.about))
                for p in interface.parameters
            ]
        )
    lines += _given(interface)
    if interface.following:
        lines += ["", "What follows from the state in closed form: `coordinates` and `velocities`."]
        lines += _table(list(interface.following))
    effects = ", ".join(kind for _, kind in interface.effects) or "none"
    lines += ["", f"Effects: {effects}."]
    if interface.contacts:
        lines += ["", "Rigid contacts, each with the unit of its gap and its effect:"]
        lines += _table([(c.name, c.unit, c.effect) for c in interface.contacts])
        lines += [""]
    if interface.constraints:
        lines += ["", "Constraints, each with the unit of its force:"]
        lines += _table([(name, unit, "") for name, unit in interface.constraints])
        lines += [""]
    lines += interface.left_out
    lines += textwrap.wrap(
        f"One call of `derivative` takes {operations(counts)}; "
        f"{counts['parameters']} more depend on parameters alone and are done once.",
        WIDTH,
    )
    return lines


def _given(interface: Interface) -> list[str]:
    """The docstring's tables of prescribed coordinates."""
    lines: list[str] = []
    if interface.driven:
        rows = [(f"{c.name} = {c.value}", c.unit, c.about) for c in interface.driven]
        lines += ["", "Driven coordinates, which are not states:", *_table(rows)]
        lines.append(
            "M, V, G, F belong to the other velocities; V includes the terms of the driven motion."
        )
    if interface.locked:
        rows = [(f"{c.name} = {c.value}", c.unit, c.about) for c in interface.locked]
        lines += ["", "Locked coordinates, which are not states:", *_table(rows)]
    return lines


def _table(rows: list[tuple[str, str, str]]) -> list[str]:
    widths = [max((len(row[i]) for row in rows), default=0) for i in (0, 1)]
    return [
        f"    {name:<{widths[0]}}  {unit:<{widths[1]}}  {about}".rstrip()
        for name, unit, about in rows
    ]
