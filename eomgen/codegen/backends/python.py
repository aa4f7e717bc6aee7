"""The NumPy backend: a system as a Python module that imports `math` and `numpy` only."""

import json
import keyword
import math
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from eomgen.codegen.backends.conditions import refusals
from eomgen.codegen.system import System
from eomgen.language.base import LARGEST
from eomgen.language.formula import written
from eomgen.model.model import Model
from eomgen.outputs import DERIVATIVES, JACOBIAN, OUTPUTS
from eomgen.program.printing import Block, Dialect, Names, print_block
from eomgen.program.program import Program, cost, live_steps
from eomgen.program.tape import TIME
from eomgen.scalars.functions import FUNCTIONS
from eomgen.templating import render

WIDTH = 100
RESERVED = frozenset(
    {"y", "p", "u", "k", "extra", "np", "math", "values"}
    | set(FUNCTIONS)
    | set(keyword.kwlist)
    | {"float", "len", "list", "tuple", "ValueError", "zip"}
)
SHELL = ("hypot", "inf", "isfinite", "nan", "prod")
"""What the shell needs of `math`."""
SHOWING = ("sin", "cos", "tan", "asin", "acos", "log", "sqrt", "abs")
"""Functions that have no finite value for an argument that is not finite."""
DIALECT = Dialect({name: name for name in FUNCTIONS}, RESERVED)
COLUMNS = {
    **{name: f"np.{name}" for name in ("sin", "cos", "tan", "exp", "log", "tanh", "sqrt", "abs")},
    **{name: f"np.arc{name[1:]}" for name in ("asin", "acos", "atan", "atan2")},
    "min": "np.minimum",
    "max": "np.maximum",
    "step": "lambda x: np.heaviside(x, 0.0)",
    "select": "lambda c, a, b: np.where(c > 0.0, a, b)",
}
"""What each function is on columns of states."""
OWN = {
    "step": ("x", "1.0 if x > 0.0 else 0.0"),
    "select": ("c, a, b", "a if c > 0.0 else b"),
}
"""Functions that neither `math` nor Python has."""


ABOUT = {
    "derivative": "Time derivative of the state.",
    "jacobian": JACOBIAN.about,
    "gaps": "How far apart each of `CONTACTS` is, m or rad; negative where they overlap.",
    "gap_rates": "How fast each of `gaps` grows, m/s or rad/s.",
    "switching_functions": "`derivative` has another branch where one of these passes 0.",
    "switching_functions_of_time": "As `switching_functions`; these depend on time alone.",
}
"""What every module has; the other outputs are in the table."""


@dataclass(frozen=True)
class Kernel:
    """One output as the template writes it."""

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


def python_module(system: System) -> str:
    """The generated module's source. Same system, same bytes."""
    program, model, states = system.program, system.model, system.states
    names = Names(program, DIALECT)
    blocks = {
        name: print_block(program, output.nodes, names, DIALECT)
        for name, output in program.outputs.items()
    }
    costs = {name: cost(program, name) for name in blocks}
    kernels = {name: _kernel(system, name, blocks[name], names, costs[name]) for name in blocks}
    moving = {f for block in blocks.values() for f in block.functions}
    fixed, once = _fixed(system, blocks, names)
    refused = refusals(model, DIALECT)
    called = [f for f in FUNCTIONS if f in moving or f in once or f in refused.functions]
    dynamics = (("forward_dynamics", "tau", "=None"), ("inverse_dynamics", "vd", ""))
    special = {"initial_state", "derivative", *DERIVATIVES, *(name for name, _, _ in dynamics)}
    special |= {"impact", "held"}
    quaternions = tuple(model.quaternions) if model.form == "velocity" else ()
    context: dict[str, Any] = {
        "title": _plain(model.title),
        "scene": model.name,
        "about": _document(system, costs["derivative"]),
        "form": model.form,
        "dimensions": model.dimensions,
        "states": states,
        "ny": len(states),
        "nq": len(model.coordinates),
        "nv": len(model.velocities),
        "nx": len(model.states),
        "positions": repr(tuple(i for i, s in enumerate(states) if s.position)),
        "quaternions": repr(quaternions),
        "parameters": model.parameters,
        "parameter_names": ", ".join(names.safe(p.name) for p in model.parameters),
        "refused": refused,
        "inputs": model.inputs,
        "units": _units(system),
        "effects": repr(tuple(effect.type for effect in model.effects)),
        "effect_names": repr(tuple(effect.name for effect in model.effects)),
        "bodies": repr(tuple(body.name for body in model.bodies)),
        "joints": repr(tuple(body.joint.name for body in model.holding)),
        "drives": len(model.driven),
        "driven": repr(tuple(c.position.name for c in model.driven)) if model.driven else "",
        "points": repr(tuple(point.name for point in model.points)),
        "contacts": [(c.name, c.effect) for c in system.contacts],
        "impact": kernels.get("impact"),
        "held": kernels.get("held"),
        "costs": [(name, json.dumps(counts)) for name, counts in costs.items()],
        "kernels": list(kernels.values()),
        "math_functions": sorted({*SHELL, *(f for f in called if hasattr(math, f))}),
        "largest": repr(LARGEST),
        "own_functions": [(f, *OWN[f]) for f in called if f in OWN],
        "columns": [(f, COLUMNS[f]) for f in called if f in moving],
        "timed": any(kernel.time for kernel in kernels.values()),
        "derivative": kernels["derivative"],
        "watched": watched(program, [s.name for s in states]),
        "outputs": [kernel for name, kernel in kernels.items() if name not in special],
        "derivatives": [kernel for name, kernel in kernels.items() if name in DERIVATIVES],
        "dynamics": [(kernels[name], *rest) for name, *rest in dynamics if name in kernels],
        **fixed,
    }
    return render("python", "module.py.jinja", context)


def _kernel(
    system: System, name: str, block: Block, names: Names, counts: Mapping[str, int]
) -> Kernel:
    shape = tuple(system.program.outputs[name].shape)
    return Kernel(
        name=name,
        about=_about(name, system.model.dimensions) + _left_out(system, name),
        shape=repr(shape),
        block=block,
        state=_unpacking([s.name for s in system.states], block, names),
        inputs=_unpacking([i.name for i in system.model.inputs], block, names),
        extra=_unpacking(system.extra.get(name, ()), block, names),
        constants=_joined([names[i] for i in block.constants]),
        functions=block.functions,
        operations=_operations(counts),
        tangent=name in system.tangents,
        time=TIME in block.inputs,
    )


def _about(name: str, dimensions: int) -> str:
    if name in OUTPUTS:
        return OUTPUTS[name].of(dimensions)[1]
    return ABOUT.get(name, "")


def _left_out(system: System, name: str) -> str:
    """What an output lacks where there are rigid contacts, whose forces only a run finds."""
    lacks = name == "derivative" or (name in OUTPUTS and OUTPUTS[name].contacts)
    lacks = lacks and bool(system.contacts)
    return " Forces of held contacts are left out." if lacks else ""


def watched(program: Program, states: Sequence[str]) -> str:
    """What must hold, besides that the entries of `derivative` are less than `reach` in size, for
    nothing to have gone wrong on the way to them that they do not show; a condition on `state`.

    A quotient may be finite though its divisor is not, and so may the functions that are not
    `SHOWING`. So a state must be less than `reach`, too, if it goes into one of these other than
    by sine and cosine, and finite if nothing else would show that it is not.
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


def _fixed(
    system: System, blocks: Mapping[str, Block], names: Names
) -> tuple[dict[str, Any], tuple[str, ...]]:
    """What depends on parameters alone: lines, and what must be positive with the lines for it;
    and the functions that these call.
    """
    program = system.program
    roots = sorted({i for block in blocks.values() for i in block.constants})
    made = [i for i in roots if program.steps[i].operation != "input"]
    # Checked before anything divides by it; the blocks share names, so they may share lines.
    checked = print_block(
        program, [check.node for check in program.checks], names, DIALECT, fixed=True
    )
    fixed = print_block(program, made, names, DIALECT, fixed=True, keep=made)
    known = {name for name, _ in checked.lines}
    context = {
        "checked": checked.lines,
        "checks": [
            (_plain(check.about), source, *_BOUNDS[check.may_vanish])
            for check, source in zip(program.checks, checked.results, strict=True)
        ],
        "fixed": [(name, source) for name, source in fixed.lines if name not in known],
    }
    return context, (*checked.functions, *fixed.functions)


_BOUNDS = {False: (">", "not positive"), True: (">=", "negative")}


def _unpacking(all_names: Sequence[str], block: Block, names: Names) -> str:
    """`_, _, theta, phi` for the used ones among `all_names`, or nothing if none is used."""
    used = [names.safe(name) if name in block.inputs else "_" for name in all_names]
    return _joined(used) if any(word != "_" for word in used) else ""


def _joined(words: list[str]) -> str:
    """A tuple to unpack into; one word keeps its comma."""
    return f"{words[0]}," if len(words) == 1 else ", ".join(words)


def _operations(counts: Mapping[str, int]) -> str:
    kinds = ", ".join(f"{n} {kind}" for kind, n in counts.items() if kind not in _SUMS)
    return f"{counts['total']} operations" + (f": {kinds}" if kinds else "")


_SUMS = ("total", "parameters")


def _plain(text: str) -> str:
    """Text of a scene as it may stand in a docstring: no quotes that end it, no escapes."""
    kept = "".join(c if c.isprintable() else " " for c in text)
    return kept.replace("\\", "/").replace('"', "'")


def _units(system: System) -> list[tuple[str, str]]:
    entries = [(s.name, s.unit) for s in system.states]
    entries += [(i.name, i.unit) for i in system.model.inputs]
    entries += [(p.name, _plain(p.unit)) for p in system.model.parameters]
    # A contact may be called what a parameter is; the parameter's entry is the one looked up.
    taken = {name for name, _ in entries}
    return entries + [(c.name, c.unit) for c in system.contacts if c.name not in taken]


def _document(system: System, counts: Mapping[str, int]) -> list[str]:
    """The docstring's tables: states, inputs, parameters, effects, operations."""
    model = system.model
    lines = ["State y, in this order:"]
    lines += _table([(s.name, s.unit, s.about) for s in system.states])
    if model.inputs:
        lines += ["", "Inputs u, each 0 unless given:"]
        lines += _table([(i.name, i.unit, i.about) for i in model.inputs])
    if model.parameters:
        lines += ["", "Parameters p, with the scene's values:"]
        lines += _table(
            [
                (f"{p.name} = {p.default!r}", _plain(p.unit), _plain(p.about))
                for p in model.parameters
            ]
        )
    lines += _given(model)
    effects = ", ".join(effect.type for effect in model.effects) or "none"
    lines += ["", f"Effects: {effects}."]
    if system.contacts:
        lines += ["", "Contacts that strike, each with the unit of its gap and its effect:"]
        lines += _table([(c.name, c.unit, c.effect) for c in system.contacts])
        lines += [""]
    if "velocity_forces" in model.leave_out:
        rest = ", of which V keeps what driving takes" if model.driven else ": M v̇ + G = F"
        lines.append(f"Left out: velocity forces{rest}.")
    lines += textwrap.wrap(
        f"One call of `derivative` takes {_operations(counts)}; "
        f"{counts['parameters']} more on parameters alone are done once.",
        WIDTH,
    )
    return lines


def _given(model: Model) -> list[str]:
    """What there is to say of coordinates that are no states."""
    lines: list[str] = []
    if model.driven:
        rows = [
            (f"{c.position.name} = {written(c.value)}", c.position.unit, c.position.about)
            for c in model.driven
        ]
        lines += ["", "Driven coordinates, which are no states:", *_table(rows)]
        lines.append("M, V, G, F are of the other velocities; V holds what driving takes, too.")
    if locked := [c for c in model.prescribed if c.locked]:
        rows = [
            (f"{c.position.name} = {written(c.value)}", c.position.unit, c.position.about)
            for c in locked
        ]
        lines += ["", "Locked coordinates, which are no states:", *_table(rows)]
    return lines


def _table(rows: list[tuple[str, str, str]]) -> list[str]:
    widths = [max(len(row[i]) for row in rows) for i in (0, 1)]
    return [
        f"    {name:<{widths[0]}}  {unit:<{widths[1]}}  {about}".rstrip()
        for name, unit, about in rows
    ]
