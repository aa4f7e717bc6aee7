"""A program's outputs as straight lines of a language: what all backends have in common."""

from collections.abc import Mapping
from dataclasses import dataclass

from eomgen.codegen.interface import Function, Interface
from eomgen.program.printing import Block, Dialect, Names, print_block
from eomgen.program.program import Check, Program, cost
from eomgen.program.tape import TIME


@dataclass(frozen=True)
class Kernel:
    """One output as lines.

    function   what it is to a user
    block      its lines, one expression a result, and the functions that they call
    state      of each state its variable, or "" where it is not used; `inputs` and `extra` likewise
    constants  variables that depend on parameters alone, taken from what `Constants` computes
    time       whether it depends on time
    counts     operations by kind
    """

    function: Function
    block: Block
    state: tuple[str, ...]
    inputs: tuple[str, ...]
    extra: tuple[str, ...]
    constants: tuple[str, ...]
    time: bool
    counts: Mapping[str, int]


@dataclass(frozen=True)
class Constants:
    """What depends on parameters alone, for all kernels together.

    parameters  of each parameter its variable
    checked     lines that come first, for `checks`: what each asks to be positive, and its source
    lines       the other lines
    functions   those that these lines call
    """

    parameters: tuple[str, ...]
    checked: tuple[tuple[str, str], ...]
    checks: tuple[tuple[Check, str], ...]
    lines: tuple[tuple[str, str], ...]
    functions: tuple[str, ...]


def kernels_of(
    program: Program, interface: Interface, dialect: Dialect
) -> tuple[list[Kernel], Constants]:
    """The kernels of a program in a language, in order, and their constants."""
    names = Names(program, dialect)
    blocks = {
        name: print_block(program, output.nodes, names, dialect)
        for name, output in program.outputs.items()
    }

    def used(wanted: tuple[str, ...], block: Block) -> tuple[str, ...]:
        return tuple(names.safe(name) if name in block.inputs else "" for name in wanted)

    states = tuple(s.name for s in interface.states)
    inputs = tuple(i.name for i in interface.inputs)
    kernels = [
        Kernel(
            function=function,
            block=(block := blocks[function.name]),
            state=used(states, block),
            inputs=used(inputs, block),
            extra=used(function.extra, block),
            constants=tuple(names[i] for i in block.constants),
            time=TIME in block.inputs,
            counts=cost(program, function.name),
        )
        for function in interface.functions
    ]
    parameters = tuple(names.safe(p.name) for p in interface.parameters)
    return kernels, _constants(program, blocks, names, parameters, dialect)


def _constants(
    program: Program,
    blocks: Mapping[str, Block],
    names: Names,
    parameters: tuple[str, ...],
    dialect: Dialect,
) -> Constants:
    roots = sorted({i for block in blocks.values() for i in block.constants})
    made = [i for i in roots if program.steps[i].operation != "input"]
    # Checked before anything divides by it; the blocks share names, so they may share lines.
    nodes = [check.node for check in program.checks]
    checked = print_block(program, nodes, names, dialect, fixed=True)
    fixed = print_block(program, made, names, dialect, fixed=True, keep=made)
    known = {name for name, _ in checked.lines}
    return Constants(
        parameters,
        checked.lines,
        tuple(zip(program.checks, checked.results, strict=True)),
        tuple(line for line in fixed.lines if line[0] not in known),
        (*checked.functions, *fixed.functions),
    )
