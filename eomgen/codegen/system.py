"""A model's program, with the names of its states and of the extra inputs of its outputs."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from eomgen.model.model import Model
from eomgen.model.states import State
from eomgen.program.passes import PassReport, optimise_and_report
from eomgen.program.program import Check, Output, Program, finish
from eomgen.program.switching import with_switching_functions
from eomgen.program.tape import Node, Tape
from eomgen.tables.outputs import shape_of

LARGEST_JACOBIAN = 30_000
"""Most operations of a matrix of derivatives that is computed entry by entry.

A larger one is computed column by column, as tangents along unit directions.
"""

OutputNodes = dict[str, tuple[tuple[int, ...], list[Node]]]
"""Shape and nodes of each output, by name."""


@dataclass(frozen=True)
class ContactLabel:
    """A rigid contact: its name, the name of its effect, and the unit of its gap."""

    name: str
    effect: str
    unit: str


@dataclass(frozen=True)
class SamplingLabel:
    """An effect that samples at each `period`-th tick of a clock, from tick 0 on.

    per_second   ticks in a second, the same for all of them: tick n is at n / `per_second`, s
    period, lag  ticks from a sample to the next, and to the moves that follow it; no moves if the
                 lag is 0
    sets         indices of the states that its sample sets, in the order of `samples`
    moves        pairs of indices of states, of which the first takes the value of the second
    noises       names of its sensors that take a normal number
    """

    effect: str
    per_second: int
    period: int
    lag: int
    sets: tuple[int, ...]
    moves: tuple[tuple[int, int], ...]
    noises: tuple[str, ...]


@dataclass(frozen=True)
class System:
    """A model's program.

    extra     for some outputs the names of the inputs that they take besides time, state,
              parameters and inputs: generalised forces or accelerations, or a direction
    tangents  matrices of derivatives whose output is their product with the direction in `extra`
    contacts  the rigid contacts
    sampling  the effects that sample
    reports   the size of the program before all passes and after each; () if none has run
    """

    model: Model
    route: str
    states: tuple[State, ...]
    program: Program
    extra: Mapping[str, tuple[str, ...]]
    tangents: frozenset[str]
    contacts: tuple[ContactLabel, ...] = ()
    sampling: tuple[SamplingLabel, ...] = ()
    reports: tuple[PassReport, ...] = ()


def output_shape(name: str, model: Model) -> tuple[int, ...]:
    """The shape of an output of a model; for all outputs except matrices of derivatives."""
    sizes = {
        "ny": len(model.states),
        "nv": len(model.velocities),
        "nq": len(model.coordinates),
        "bodies": len(model.bodies),
        "joints": len(model.force_joints),
        "effects": len(model.effects),
        "driven": len(model.driven),
        "points": len(model.points),
        "constraints": len(model.rows),
        "dimensions": model.dimensions,
    }
    return shape_of(name, model.dimensions, sizes)


def names_of_inputs(nodes: Iterable[Node]) -> tuple[str, ...]:
    """The names of nodes that are inputs."""
    return tuple(str(node.step.value) for node in nodes)


def recorded(
    tape: Tape,
    nodes: OutputNodes,
    checks: Sequence[Check],
    tangents: frozenset[str] = frozenset(),
) -> Program:
    """The program of a tape and the nodes of its outputs, before optimisation."""
    for name, (shape, entries) in nodes.items():
        count = shape[0] if name in tangents else math.prod(shape)
        assert count == len(entries), f"{name}: {len(entries)} nodes for {shape}"
    outputs = {
        name: Output(shape, tuple(node.index for node in entries))
        for name, (shape, entries) in nodes.items()
    }
    return finish(tape, outputs, checks)


def optimised(system: System) -> System:
    """The system after all passes, with switching functions and a report of the passes."""
    program, reports = optimise_and_report(system.program)
    program = with_switching_functions(program, [state.name for state in system.states])
    return replace(system, program=program, reports=reports)
