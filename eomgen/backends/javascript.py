"""The JavaScript backend: poses of the bodies from the state, for the page that plays a motion."""

from eomgen.program.assemble import System
from eomgen.program.printing import Dialect, Names, print_block
from eomgen.templating import render

RESERVED = frozenset(
    "y p Math break case catch class const continue debugger default delete do else enum eval "
    "export extends false finally for function if implements import in instanceof interface let "
    "new null package private protected public return static super switch this throw true try "
    "typeof var void while with yield await async of get set arguments undefined NaN".split()
)
DIALECT = Dialect({name: f"Math.{name}" for name in ("sin", "cos", "tan", "sqrt")}, RESERVED)


def javascript_poses(system: System) -> str:
    """`function bodyPoses(y, p)`: [[x, y, angle], …] in m and rad, from state and parameters."""
    program = system.program
    names = Names(program, DIALECT)
    nodes = program.outputs["body_poses"].nodes
    block = print_block(program, nodes, names, DIALECT, fixed=True)
    states = [s.name for s in system.form.states]
    parameters = [p.name for p in system.model.parameters]
    used = {names[i] for i in block.constants}
    given = [
        *((names.safe(n), f"p[{i}]") for i, n in enumerate(parameters) if names.safe(n) in used),
        *((names.safe(n), f"y[{i}]") for i, n in enumerate(states) if n in block.inputs),
    ]
    rows = [block.results[i : i + 3] for i in range(0, len(block.results), 3)]
    context = {"given": given, "lines": block.lines, "rows": rows}
    return render("javascript", "poses.js.jinja", context)
