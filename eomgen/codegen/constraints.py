"""Outputs of models with constraints: residuals, projections, and the forces of constraints."""

from eomgen.codegen.recording import Recording
from eomgen.codegen.system import OutputNodes
from eomgen.dynamics import constraints
from eomgen.program.tape import Node
from eomgen.scene.effects.base import Load


def constraint_outputs(record: Recording) -> OutputNodes:
    """What a run needs to keep the constraints."""
    d = record.dynamics
    held = d.constrained(record.route)
    nodes = {
        "constraint_residuals": constraints.residuals(d),
        "constraint_rates": constraints.rates(d),
        "project_position": held.position(),
        "project_velocity": held.velocity(),
        "constraint_margins": held.margins(),
    }
    return {name: ((len(part),), part) for name, part in nodes.items()}


def constraint_forces(record: Recording) -> list[Node]:
    """The multipliers of the rows, N or N m."""
    if not record.model.rows:
        return []
    return record.dynamics.constrained(record.route).multipliers()


def constraint_loads(record: Recording) -> list[list[Load]]:
    """The loads on bodies of each constraint of the model, under the effects."""
    return constraints.loads_of(record.dynamics, constraint_forces(record))
