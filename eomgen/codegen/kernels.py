"""A program's outputs as straight lines of a language: what all backends have in common."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

from eomgen.codegen.interface import Function, Interface
from eomgen.program.printing import Block, Dialect, Names, print_block
from eomgen.program.program import Check, Program, cost, live_steps
from eomgen.program.tape import COUNTED, TIME, Stage

LARGE = 500
"""Operations shared with `derivative` from which on an output goes on from there."""
MORE = 0.05
"""Part of an output's operations that it may do in vain for that."""


@dataclass(frozen=True)
class Kernel:
    """One output as lines.

    function   what it is to a user
    block      its lines, one expression a result, and the functions that they call
    state      of each state its variable, or "" where it is not used; `inputs` and `extra` likewise
    constants  variables that depend on parameters alone, taken from what `Constants` computes
    time       whether it depends on time
    counts     operations by kind
    passed     variables that it passes on to kernels that go on from it
    base       the kernel that it goes on from, or None: it takes these of its variables, `taken`,
               "_" for each that it does not use
    """

    function: Function
    block: Block
    state: tuple[str, ...]
    inputs: tuple[str, ...]
    extra: tuple[str, ...]
    constants: tuple[str, ...]
    time: bool
    counts: Mapping[str, int]
    passed: tuple[str, ...] = ()
    base: "Kernel | None" = None
    taken: tuple[str, ...] = ()


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
    program: Program, interface: Interface, dialect: Dialect, *, sharing: bool = False
) -> tuple[list[Kernel], Constants]:
    """The kernels of a program in a language, in order, and their constants.

    sharing  whether kernels go on from that of `derivative` where `shares` says so, instead of
             repeating its lines
    """
    names = Names(program, dialect)
    blocks: dict[str, Block] = {}
    for name, output in program.outputs.items():
        start = blocks.get("derivative") if sharing else None
        known = frozenset(start.nodes) if start and shares(program, name, start) else frozenset()
        blocks[name] = print_block(program, output.nodes, names, dialect, known=known)

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
    base = next((k for k in kernels if k.function.name == "derivative"), None)
    if base and (wanted := {i for k in kernels for i in k.block.taken}):
        given = [i for i in base.block.nodes if i in wanted]
        passed = replace(base, passed=tuple(names[i] for i in given))
        kernels = [
            passed
            if k is base
            else replace(
                k,
                base=passed,
                taken=tuple(names[i] if i in k.block.taken else "_" for i in given),
            )
            if k.block.taken
            else k
            for k in kernels
        ]
    parameters = tuple(names.safe(p.name) for p in interface.parameters)
    return kernels, _constants(program, blocks, names, parameters, dialect)


def shares(program: Program, name: str, base: Block) -> bool:
    """Whether an output of a large program takes nearly all steps of `derivative`, so that it may
    go on from there: at most `MORE` of its own operations would be done in vain, or twice, because
    `derivative` has no variable for them.
    """
    derivative = _operations(program, "derivative")
    if len(derivative) < LARGE:
        return False
    own = _operations(program, name)
    if len(own & derivative) < LARGE or len(derivative - own) > MORE * len(own):
        return False
    twice = _operations(program, name, frozenset(base.nodes)) & derivative
    return len(derivative - own) + len(twice) <= MORE * len(own)


def _operations(program: Program, name: str, known: frozenset[int] = frozenset()) -> set[int]:
    """The steps of an output that cost something at every call, if some are `known`."""
    steps = program.steps

    def outside(i: int) -> bool:
        return i in known or steps[i].stage <= Stage.PARAMETERS

    live = live_steps(program, program.outputs[name].nodes, outside)
    return {i for i in live if not outside(i) and steps[i].operation in COUNTED}


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
