"""A program with the meaning of its inputs: what a backend needs to write a module."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from eomgen.model.model import Model
from eomgen.model.states import State
from eomgen.outputs import shape_of
from eomgen.program.passes import PassReport, optimise_and_report
from eomgen.program.program import Check, Output, Program, finish
from eomgen.program.switching import with_switching_functions
from eomgen.program.tape import Node, Tape

LARGEST_JACOBIAN = 30_000
"""Operations up to which a matrix of derivatives is written out entry by entry."""

Made = dict[str, tuple[tuple[int, ...], list[Node]]]
"""Shape and nodes of each output."""


@dataclass(frozen=True)
class ContactLabel:
    """What a module says of a rigid contact; `unit` is that of its gap."""

    name: str
    effect: str
    unit: str


@dataclass(frozen=True)
class System:
    """A model's program.

    `extra` names what some outputs take besides state, parameters and inputs: generalised forces or
    accelerations, one a velocity; or directions, for those of `tangents`, which compute how
    something changes along a direction in place of a matrix of derivatives. `contacts` are the
    rigid ones, `reports` tell what each pass saved, once they have run.
    """

    model: Model
    route: str
    states: tuple[State, ...]
    program: Program
    extra: Mapping[str, tuple[str, ...]]
    tangents: frozenset[str]
    contacts: tuple[ContactLabel, ...] = ()
    reports: tuple[PassReport, ...] = ()


def output_shape(name: str, model: Model) -> tuple[int, ...]:
    """The shape of an output of a model that is no matrix of derivatives."""
    sizes = {
        "nv": len(model.velocities),
        "bodies": len(model.bodies),
        "joints": len(model.holding),
        "effects": len(model.effects),
        "driven": len(model.driven),
        "points": len(model.points),
        "dimensions": model.dimensions,
    }
    return shape_of(name, model.dimensions, sizes)


def recorded(
    model: Model,
    route: str,
    states: Sequence[State],
    tape: Tape,
    made: Made,
    checks: Sequence[Check],
    extra: Mapping[str, tuple[str, ...]],
    tangents: frozenset[str],
    contacts: tuple[ContactLabel, ...] = (),
) -> System:
    """A tape with its outputs as a system, no pass run over it yet."""
    for name, (shape, nodes) in made.items():
        entries = shape[0] if name in tangents else math.prod(shape)
        assert entries == len(nodes), f"{name}: {len(nodes)} nodes for {shape}"
    outputs = {
        name: Output(shape, tuple(node.index for node in nodes))
        for name, (shape, nodes) in made.items()
    }
    program = finish(tape, outputs, checks)
    return System(model, route, tuple(states), program, extra, tangents, contacts)


def optimised(system: System) -> System:
    """The same values in fewer operations, with switching functions and a report of the passes."""
    program, reports = optimise_and_report(system.program)
    program = with_switching_functions(program, [state.name for state in system.states])
    return replace(system, program=program, reports=reports)
