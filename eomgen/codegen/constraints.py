"""Outputs of models with constraints: residuals, projections, and the forces of constraints."""

from eomgen.codegen.recording import Recording
from eomgen.codegen.system import OutputNodes
from eomgen.dynamics.loops import constraints
from eomgen.dynamics.loops.clusters import jacobian_of
from eomgen.program.tape import Node
from eomgen.scene.effects.base import Load

LARGEST_JACOBIAN = 2000
"""A larger matrix of constraints is not written out: runs compute it from the rates."""


def constraint_outputs(record: Recording) -> OutputNodes:
    """What a run needs to keep the constraints; where they are kept in closed form, how well."""
    d, groups = record.dynamics, record.model.groups
    held = d.constrained("independent" if groups else record.route)
    nodes = {
        "constraint_residuals": constraints.residuals(d),
        "constraint_rates": constraints.rates(d),
    }
    if not groups:
        nodes |= {"project_position": held.position(), "project_velocity": held.velocity()}
    nodes["constraint_margins"] = [*held.margins(), *record.ranges.values()]
    found: OutputNodes = {name: ((len(part),), part) for name, part in nodes.items()}
    shape = len(record.model.rows), d.nv
    if shape[0] * shape[1] <= LARGEST_JACOBIAN:
        found["constraint_jacobian"] = (shape, [x for row in jacobian_of(d) for x in row])
    return found


def constraint_forces(record: Recording) -> list[Node]:
    """The multipliers of the rows, N or N m."""
    if not record.model.rows:
        return []
    return record.dynamics.constrained(record.route).multipliers()


def constraint_loads(record: Recording) -> list[list[Load]]:
    """The loads on bodies of each constraint of the model, under the effects."""
    return constraints.loads_of(record.dynamics, constraint_forces(record))
