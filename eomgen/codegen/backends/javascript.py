"""The JavaScript backend: poses of the bodies from the state, for the page that plays a motion."""

from collections.abc import Sequence

from eomgen.codegen.system import System
from eomgen.program.printing import Dialect, Names, print_block
from eomgen.program.tape import TIME
from eomgen.scalars.functions import FUNCTIONS
from eomgen.templating import render

RESERVED = frozenset(
    "y p select step Math break case catch class const continue debugger default delete do "
    "else enum eval export extends false finally for function if implements import in "
    "instanceof interface let new null package private protected public return static super "
    "switch this throw true try typeof var void while with yield await async of get set "
    "arguments undefined NaN".split()
)
OWN = {
    "step": "(x) => (x > 0 ? 1 : 0)",
    "select": "(c, a, b) => (c > 0 ? a : b)",
}
"""Functions of formulas that JavaScript has not."""
DIALECT = Dialect({name: name if name in OWN else f"Math.{name}" for name in FUNCTIONS}, RESERVED)


def javascript_poses(system: System) -> str:
    """`function bodyPoses(y, p)`: the poses of all bodies from state and parameters; with driven
    joints `bodyPoses(y, p, t)`, from the time in s, too.

    For each body [x, y, angle] in the plane, m and rad; in space the three rows, four numbers each,
    of [world_R_body | position], 1 and m.
    """
    program = system.program
    names = Names(program, DIALECT)
    poses = program.outputs["body_poses"]
    block = print_block(program, poses.nodes, names, DIALECT, fixed=True)
    states = [s.name for s in system.states]
    parameters = [p.name for p in system.model.parameters]
    used = {names[i] for i in block.constants}
    given = [
        *((names.safe(n), f"p[{i}]") for i, n in enumerate(parameters) if names.safe(n) in used),
        *((names.safe(n), f"y[{i}]") for i, n in enumerate(states) if n in block.inputs),
    ]
    rows = _bracketed(block.results, poses.shape[-1], ", ")
    if len(poses.shape) == 3:  # rows of a matrix each body
        rows = _bracketed(rows, poses.shape[-2], ",\n     ")
    context = {
        "timed": TIME in block.inputs,
        "own_functions": [(name, OWN[name]) for name in block.functions if name in OWN],
        "given": given,
        "lines": block.lines,
        "rows": rows,
    }
    return render("javascript", "poses.js.jinja", context)


def _bracketed(parts: Sequence[str], width: int, between: str) -> list[str]:
    """Arrays of `width` parts each."""
    groups = (parts[i : i + width] for i in range(0, len(parts), width))
    return [f"[{between.join(group)}]" for group in groups]
