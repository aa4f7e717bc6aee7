"""Outputs of models with rigid contacts: gaps, impacts, and motion under contact forces."""

from collections.abc import Sequence
from itertools import chain

from eomgen.codegen.system import ContactLabel, OutputNodes, names_of_inputs
from eomgen.dynamics.dynamics import Dynamics, Forward
from eomgen.dynamics.impulses import pressed, rough, struck
from eomgen.dynamics.tree.loads import generalised, scaled
from eomgen.program.differentiate import tangent
from eomgen.program.tape import Node, Stage, Tape, total
from eomgen.scene.effects.base import Contact, JointLoad


def contact_labels(d: Dynamics) -> tuple[ContactLabel, ...]:
    """The rigid contacts of a model."""
    return tuple(ContactLabel(c.name, c.effect, _unit(d, c)) for c in d.contacts)


def _unit(d: Dynamics, contact: Contact) -> str:
    units = [
        d.joint_indices[load.joint].body.velocities[load.coordinate].unit.removesuffix("/s")
        for load in contact.normal
        if isinstance(load, JointLoad)
    ]
    return units[0] if units else "m"


def contact_outputs(
    d: Dynamics, tape: Tape, route: str, forward: Forward, position_rates: Sequence[Node]
) -> tuple[OutputNodes, dict[str, tuple[str, ...]]]:
    """The outputs of a model with contacts, and the names of the extra inputs that two of them
    take.
    """
    names = [contact.name for contact in d.contacts]
    chosen = [_given(tape, f"struck__{name}") for name in names]
    bounce = _given(tape, "impact__bounce")
    forces = [_given(tape, f"force__{name}") for name in names]
    extra = {"impact": [*chosen, bounce], "held": forces}
    nodes = {
        "gaps": [contact.gap for contact in d.contacts],
        "gap_rates": _gap_rates(d),
        "impact": [
            *d.values.q,
            *_struck(d, tape, route, chosen, bounce),
            *d.values.states.values(),
        ],
        "held": _held(d, tape, forward, position_rates, forces),
    }
    outputs: OutputNodes = {name: ((len(part),), part) for name, part in nodes.items()}
    return outputs, {name: names_of_inputs(part) for name, part in extra.items()}


def _given(tape: Tape, name: str) -> Node:
    return tape.input(name, Stage.INPUTS)


def _gap_rates(d: Dynamics) -> list[Node]:
    return [d.power_of(contact.normal) for contact in d.contacts]


def _struck(
    d: Dynamics, tape: Tape, route: str, chosen: Sequence[Node], bounce: Node
) -> list[Node]:
    """The velocities after the impact of the contact whose entry in `chosen` is 1, the others 0.

    Loads, restitution and friction are sums over all contacts weighted by `chosen`, so that one
    program serves for any contact.
    """
    contacts = list(zip(d.contacts, chosen, strict=True))
    tangential = max(len(rough(d, contact)) for contact in d.contacts)
    directions = [
        list(
            chain.from_iterable(
                scaled(loads, weight)
                for contact, weight in contacts
                for loads in (contact.normal, *rough(d, contact))[i : i + 1]
            )
        )
        for i in range(tangential + 1)
    ]
    restitution = bounce * total([weight * c.restitution for c, weight in contacts], tape)
    friction = total([weight * c.friction for c, weight in contacts], tape)
    return struck(d, directions, restitution, friction, route)


def _held(
    d: Dynamics,
    tape: Tape,
    forward: Forward,
    position_rates: Sequence[Node],
    forces: Sequence[Node],
) -> list[Node]:
    """Under normal forces on the contacts: the derivative of the state, the second derivatives of
    the gaps, the powers of the contacts and of the drives.
    """
    pairs = [pressed(d, contact, f) for contact, f in zip(d.contacts, forces, strict=True)]
    generalised_forces = generalised(d, chain.from_iterable(loads for loads, _ in pairs))
    vd = forward(generalised_forces[: d.nv])
    rates = [*position_rates, *vd, *d.state_rates]
    state = (*d.values.q, *d.values.v, *d.values.states.values())
    direction = {node.index: rate for node, rate in zip(state, rates, strict=True)}
    direction[d.values.time.index] = tape.constant(1.0)
    powers = [power for _, power in pairs] + d.driving_powers(vd, generalised_forces)
    return [*rates, *tangent(_gap_rates(d), direction), *powers]
