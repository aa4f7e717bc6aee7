"""The order of a program's steps: few values in use at a time, and short waits.

Each step comes shortly before those that use it, so that few registers are needed. A processor
begins operations that wait for nothing while others wait, but looks ahead by some hundreds only:
within a short window that moves along the program, steps of independent chains are interleaved. No
operation changes, nor does a bit of any result.
"""

import heapq
from collections.abc import Mapping, Sequence
from dataclasses import replace

from eomgen.program.program import Program, live_steps
from eomgen.program.tape import ARITHMETIC, Stage

WAIT = {**dict.fromkeys(ARITHMETIC, 3), "neg": 1, "div": 13, "sqrt": 20}
"""Cycles until the result of an operation is there; `LONG` for any other function."""
LONG = 50
TOGETHER = 2
"""Operations that begin in a cycle."""
WINDOW = 64
"""The next step is one of this many, from the first that has not been placed."""


def ordered(program: Program) -> Program:
    """The same program with its steps in another order, without those that nothing needs.

    Steps that do not depend on the state come first, in their order.
    """
    results = [node for output in program.outputs.values() for node in output.nodes]
    live = live_steps(program, [*results, *(check.node for check in program.checks)])
    moving = {i for i in live if not _is_given(program, i)}
    operands = {
        i: [o for o in dict.fromkeys(program.steps[i].operands) if o in moving]
        for i in live
        if i in moving
    }
    waits = {i: WAIT.get(program.steps[i].operation, LONG) for i in operands}
    order = [i for i in live if i not in moving]
    order += _interleaved(_depth_first(results, operands), operands, waits)
    place = {old: new for new, old in enumerate(order)}
    steps = (program.steps[i] for i in order)
    return Program(
        tuple(s._replace(operands=tuple(place[o] for o in s.operands)) for s in steps),
        {
            name: replace(output, nodes=tuple(place[n] for n in output.nodes))
            for name, output in program.outputs.items()
        },
        {place[i]: name for i, name in program.names.items() if i in place},
        tuple(replace(check, node=place[check.node]) for check in program.checks),
    )


def _is_given(program: Program, i: int) -> bool:
    """Whether a step is a number or an input, or is computed once for each set of parameters."""
    step = program.steps[i]
    return step.operation in ("constant", "input") or step.stage <= Stage.PARAMETERS


def _depth_first(results: Sequence[int], operands: Mapping[int, Sequence[int]]) -> list[int]:
    """Steps in the order in which the results need them; of operands, the one with the longest
    chain behind it first.
    """
    depth: dict[int, int] = {}
    for i, of in operands.items():
        depth[i] = 1 + max((depth[o] for o in of), default=0)
    made: dict[int, None] = {}
    todo = [node for node in reversed(results) if node in operands]
    while todo:
        wanted = [o for o in operands[todo[-1]] if o not in made]
        if wanted and todo[-1] not in made:
            todo += sorted(wanted, key=depth.__getitem__)
        else:
            made[todo.pop()] = None
    return list(made)


def _interleaved(
    order: Sequence[int], operands: Mapping[int, Sequence[int]], waits: Mapping[int, int]
) -> list[int]:
    """Steps as a processor begins them that sees a window of the given order, and prefers what the
    longest chain of operations waits for.
    """
    users: dict[int, list[int]] = {i: [] for i in order}
    for i in order:
        for o in operands[i]:
            users[o].append(i)
    chain: dict[int, int] = {}  # cycles from the begin of a step to the end of all
    for i in reversed(order):
        chain[i] = waits[i] + max((chain[u] for u in users[i]), default=0)
    missing = {i: len(operands[i]) for i in order}
    begin = dict.fromkeys(order, 0.0)  # when its operands are there
    seen: set[int] = set()
    waiting: list[tuple[float, int]] = []  # for operands that are being computed
    ready: list[tuple[int, int]] = []
    placed: dict[int, None] = {}
    time, first, end = 0.0, 0, 0
    while len(placed) < len(order):
        while first < len(order) and order[first] in placed:
            first += 1
        for i in order[end : first + WINDOW]:
            seen.add(i)
            if not missing[i]:
                heapq.heappush(waiting, (begin[i], i))
        end = max(end, min(first + WINDOW, len(order)))
        if not ready:
            time = max(time, waiting[0][0])
        while waiting and waiting[0][0] <= time:
            _, i = heapq.heappop(waiting)
            heapq.heappush(ready, (-chain[i], i))
        _, i = heapq.heappop(ready)
        placed[i] = None
        for user in users[i]:
            missing[user] -= 1
            begin[user] = max(begin[user], time + waits[i])
            if not missing[user] and user in seen:
                heapq.heappush(waiting, (begin[user], user))
        time += 1 / TOGETHER
    return list(placed)
