"""Systems of models by the recursions: the derivative of the state and all outputs on a tape."""

from collections.abc import Callable, Sequence
from pkgutil import resolve_name

from eomgen.codegen.constraints import constraint_outputs
from eomgen.codegen.contacts import contact_labels, contact_outputs
from eomgen.codegen.jacobians import matrices
from eomgen.codegen.recording import Recording
from eomgen.codegen.sampling import sampling_labels, sampling_outputs
from eomgen.codegen.system import (
    OutputNodes,
    System,
    names_of_inputs,
    output_shape,
    recorded,
)
from eomgen.language.formula import is_zero
from eomgen.model.states import initial_state, velocity_states
from eomgen.program.program import Check
from eomgen.program.tape import Node, Stage
from eomgen.tables.outputs import DERIVATIVES, OUTPUTS

ExtraInputs = dict[str, tuple[str, ...]]
"""For some outputs the names of the inputs that they take besides the state."""


def from_recursion(
    record: Recording,
    *,
    jacobian: bool = True,
    given: Callable[[str, ExtraInputs], list[Node] | None] = lambda name, extra: None,
    conditions: Sequence[Check] = (),
) -> System:
    """The system of a recorded model, with or without the Jacobian of the derivative.

    given       the nodes of outputs that something else than the recursions computes
    conditions  conditions on parameters beside those of the recursions
    """
    model, tape, ny = record.model, record.tape, len(record.rates)
    start = [tape.constant(x) for x in initial_state(model)]
    nodes: OutputNodes = {"initial_state": ((ny,), start), "derivative": ((ny,), record.rates)}
    derivatives = matrices(record, with_jacobian=jacobian)
    nodes |= derivatives.nodes
    extra = dict(derivatives.extra)
    following = ("coordinates", "velocities", "accelerations") if model.groups else ()
    for name in dict.fromkeys((*model.outputs, *following)):
        if name not in DERIVATIVES:
            found = given(name, extra)
            found = output(record, name, extra) if found is None else found
            nodes[name] = output_shape(name, model), record.closed(found)
    if record.dynamics.contacts:
        more, more_extra = contact_outputs(
            record.dynamics, tape, record.route, record.forward, record.position_rates
        )
        nodes, extra = nodes | more, extra | more_extra
    if model.constraints:
        parts = constraint_outputs(record)
        nodes |= {name: (shape, record.closed(part)) for name, (shape, part) in parts.items()}
    states = velocity_states(model)
    if any(effect.sampling() for effect in model.effects):
        more, more_extra = sampling_outputs(record)
        nodes, extra = nodes | more, extra | more_extra
    tangents = derivatives.tangents
    program = recorded(tape, nodes, [*checks(record), *conditions], tangents)
    labels = contact_labels(record.dynamics)
    given_of = model, record.route, states, program, extra, tangents
    return System(*given_of, labels, sampling_labels(model, [state.name for state in states]))


def output(record: Recording, name: str, extra: ExtraInputs) -> list[Node]:
    """The nodes of an output; for all outputs except matrices of derivatives.

    Enters into `extra` the names of the inputs that the output takes besides the state.
    """
    spec = OUTPUTS[name]
    builder = resolve_name(f"eomgen.codegen.{spec.builder}")
    given: tuple[list[Node], ...] = ()
    if spec.beside:
        single = [record.input(f"step__{spec.beside}", Stage.INPUTS)] if spec.single else None
        given = (single or record.velocity_inputs(spec.beside),)
    if given:
        extra[name] = names_of_inputs(*given)
    nodes: list[Node] = builder(record, *given)
    return nodes


def checks(record: Recording) -> list[Check]:
    """Conditions on a user's parameters: masses and moments of inertia are not negative, and a mass
    that is positive in the scene stays positive.
    """
    found = []
    model, d = record.model, record.dynamics
    for body in model.bodies:
        if not is_zero(body.mass):
            may_vanish = model.value(body.mass) == 0.0
            node = d.value(body.mass)
            found.append(Check(f"mass of {body.name}", node.index, may_vanish))
        for entry, word in zip(body.inertia_com[:3], ("xx", "yy", "zz"), strict=False):
            if not is_zero(entry):
                what = f" {word}" if model.dimensions == 3 else ""
                about = f"inertia_com{what} of {body.name}"
                found.append(Check(about, d.value(entry).index, may_vanish=True))
    return found
