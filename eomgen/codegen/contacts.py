"""What a module knows of rigid contacts: gaps, impacts, and motion under forces that hold."""

from collections.abc import Sequence
from itertools import chain

from eomgen.codegen.system import ContactLabel, Made
from eomgen.dynamics.dynamics import Dynamics, Forward
from eomgen.dynamics.impulses import generalised, pressed, rough, scaled, struck
from eomgen.program.differentiate import tangent
from eomgen.program.tape import Node, Stage, Tape, total
from eomgen.scene.effects.base import Contact, JointLoad


def contact_labels(d: Dynamics) -> tuple[ContactLabel, ...]:
    """The contacts by name, effect and unit of the gap."""
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
) -> tuple[Made, dict[str, tuple[str, ...]]]:
    """Outputs of a model with contacts, and the inputs that two of them take besides."""
    names = [contact.name for contact in d.contacts]
    chosen = [_given(tape, f"struck__{name}") for name in names]
    bounce = _given(tape, "impact__bounce")
    forces = [_given(tape, f"force__{name}") for name in names]
    extra = {"impact": [*chosen, bounce], "held": forces}
    found = {
        "gaps": [contact.gap for contact in d.contacts],
        "gap_rates": _rates(d),
        "impact": [
            *d.values.q,
            *_struck(d, tape, route, chosen, bounce),
            *d.values.states.values(),
        ],
        "held": _held(d, tape, forward, position_rates, forces),
    }
    made: Made = {name: ((len(nodes),), nodes) for name, nodes in found.items()}
    return made, {k: tuple(str(node.step.value) for node in nodes) for k, nodes in extra.items()}


def _given(tape: Tape, name: str) -> Node:
    return tape.input(name, Stage.INPUTS)


def _rates(d: Dynamics) -> list[Node]:
    return [d.power_of(contact.normal) for contact in d.contacts]


def _struck(
    d: Dynamics, tape: Tape, route: str, chosen: Sequence[Node], bounce: Node
) -> list[Node]:
    """The velocities after that contact has struck whose number in `chosen` is 1, all others 0.

    The loads are those of all contacts, each times its number: so one impact does for all.
    """
    contacts = list(zip(d.contacts, chosen, strict=True))
    across = max(len(rough(d, contact)) for contact in d.contacts)
    directions = [
        list(
            chain.from_iterable(
                scaled(loads, one)
                for contact, one in contacts
                for loads in (contact.normal, *rough(d, contact))[i : i + 1]
            )
        )
        for i in range(across + 1)
    ]
    restitution = bounce * total([one * c.restitution for c, one in contacts], tape)
    friction = total([one * c.friction for c, one in contacts], tape)
    return struck(d, directions, restitution, friction, route)


def _held(
    d: Dynamics,
    tape: Tape,
    forward: Forward,
    position_rates: Sequence[Node],
    forces: Sequence[Node],
) -> list[Node]:
    """Under forces on the contacts: the state's derivative, ä of the gaps, the powers of the
    contacts and of the drives.
    """
    found = [pressed(d, contact, f) for contact, f in zip(d.contacts, forces, strict=True)]
    beside = generalised(d, chain.from_iterable(loads for loads, _ in found))
    vd = forward(beside[: d.nv])
    rates = [*position_rates, *vd, *d.state_rates]
    given = (*d.values.q, *d.values.v, *d.values.states.values())
    along = {node.index: rate for node, rate in zip(given, rates, strict=True)}
    along[d.values.time.index] = tape.constant(1.0)
    powers = [power for _, power in found] + d.driving_powers(vd, beside)
    return [*rates, *tangent(_rates(d), along), *powers]
