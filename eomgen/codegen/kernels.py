"""Kernels: each output of a program as straight-line source code of a language."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from eomgen.codegen.interface import Function, Interface
from eomgen.program.printing import Block, Dialect, Names, given_in, print_block
from eomgen.program.program import Check, Program, cost, live_steps
from eomgen.program.tape import COUNTED, TIME

LARGE = 500
"""Least number of operations that an output shares with `derivative` for it to call that kernel."""
MORE = 0.05
"""Largest fraction of an output's operations that may be wasted by that call."""


@dataclass(frozen=True)
class Kernel:
    """The source of one output.

    function   the interface of the output
    block      its assignments, an expression for each result, and the functions called
    state      the variable of each state, "" if it is not used; `inputs` and `extra` likewise
    constants  variables that depend on parameters alone, computed by `Constants`
    time       whether it depends on time
    counts     operations by kind
    passed     variables that it returns to kernels that continue from it
    base       the kernel that it continues from, or None
    taken      the variables `passed` by the base, "_" for each that it does not use
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
    """The source of what depends on parameters alone, for all kernels together.

    parameters  the variable of each parameter
    checked     assignments that `checks` need, which come first
    checks      checks with the source of the value that each tests
    lines       the other assignments
    functions   functions that the assignments call
    """

    parameters: tuple[str, ...]
    checked: tuple[tuple[str, str], ...]
    checks: tuple[tuple[Check, str], ...]
    lines: tuple[tuple[str, str], ...]
    functions: tuple[str, ...]


def kernels_of(
    program: Program, interface: Interface, dialect: Dialect, *, sharing: bool = False
) -> tuple[list[Kernel], Constants]:
    """The kernels of a program in a language, in the order of its outputs, and their constants.

    sharing  whether kernels may continue from that of `derivative`, where `shares` recommends it,
             instead of repeating its lines
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
    taken = {i for block in blocks.values() for i in block.taken}
    passed = [i for i in blocks["derivative"].nodes if i in taken] if taken else []
    kernels: dict[str, Kernel] = {}
    for function in interface.functions:
        block = blocks[function.name]
        kernels[function.name] = Kernel(
            function=function,
            block=block,
            state=used(states, block),
            inputs=used(inputs, block),
            extra=used(function.extra, block),
            constants=tuple(names[i] for i in block.constants),
            time=TIME in block.inputs,
            counts=cost(program, function.name),
            passed=tuple(names[i] for i in passed) if function.name == "derivative" else (),
            base=kernels["derivative"] if block.taken else None,
            taken=tuple(names[i] if i in block.taken else "_" for i in passed)
            if block.taken
            else (),
        )
    parameters = tuple(names.safe(p.name) for p in interface.parameters)
    return list(kernels.values()), _constants(program, blocks, names, parameters, dialect)


def shares(program: Program, name: str, base: Block) -> bool:
    """Whether an output should continue from the kernel of `derivative`, whose block is `base`.

    It should if they share at least `LARGE` operations, and if those of `derivative` that it does
    not need, and those that it must repeat because `derivative` has no variable for them, are at
    most `MORE` of its own.
    """
    derivative = _operations(program, "derivative")
    if len(derivative) < LARGE:
        return False
    own = _operations(program, name)
    if len(own & derivative) < LARGE or len(derivative - own) > MORE * len(own):
        return False
    twice = _operations(program, name, frozenset(base.nodes)) & derivative
    return len(derivative - own) + len(twice) <= MORE * len(own)


def elements(names: Sequence[str], array: str) -> list[tuple[str, str]]:
    """The variables that are used, each with the array element it reads."""
    return [(name, f"{array}[{i}]") for i, name in enumerate(names) if name]


def _operations(program: Program, name: str, known: frozenset[int] = frozenset()) -> set[int]:
    """The steps of an output that are operations at every call, if the nodes `known` are given."""
    is_given, steps = given_in(program, known), program.steps
    live = live_steps(program, program.outputs[name].nodes, is_given)
    return {i for i in live if not is_given(i) and steps[i].operation in COUNTED}


def _constants(
    program: Program,
    blocks: Mapping[str, Block],
    names: Names,
    parameters: tuple[str, ...],
    dialect: Dialect,
) -> Constants:
    constants = sorted({i for block in blocks.values() for i in block.constants})
    computed = [i for i in constants if program.steps[i].operation != "input"]
    # Values are checked before anything divides by them.
    nodes = [check.node for check in program.checks]
    checked = print_block(program, nodes, names, dialect, fixed=True)
    fixed = print_block(program, computed, names, dialect, fixed=True, keep=computed)
    assigned = {name for name, _ in checked.lines}
    return Constants(
        parameters,
        checked.lines,
        tuple(zip(program.checks, checked.results, strict=True)),
        tuple(line for line in fixed.lines if line[0] not in assigned),
        (*checked.functions, *fixed.functions),
    )
