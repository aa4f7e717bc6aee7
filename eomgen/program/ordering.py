"""The order of a program's steps, for short waits and few values in use at a time.

A processor begins operations that wait for nothing while others wait, but looks ahead by some
hundreds only, and has few registers. So independent chains of operations are interleaved, within a
window that moves along the program. No operation changes, nor does a bit of any result.
"""

import heapq
from collections.abc import Sequence
from dataclasses import replace

from eomgen.program.program import Program
from eomgen.program.tape import FUNCTIONS, Stage

WAIT = {"add": 3, "sub": 3, "mul": 3, "neg": 1, "div": 13, "sqrt": 20}
"""Cycles until the result of an operation is there; of the others `LONG`."""
LONG = 50
WIDTH = 2
"""Operations that begin in a cycle."""
WINDOW = 256
"""Steps in the program's order, from the first that has not been placed, of which the next one is
chosen.
"""


def ordered(program: Program) -> Program:
    """The same program with its steps in another order."""
    steps = program.steps
    ahead = [step for step in range(len(steps)) if _is_early(program, step)]
    order = [*ahead, *_interleaved(program, [i for i in range(len(steps)) if i not in {*ahead}])]
    place = {old: new for new, old in enumerate(order)}
    return Program(
        tuple(
            steps[i]._replace(operands=tuple(place[o] for o in steps[i].operands)) for i in order
        ),
        {
            name: replace(output, nodes=tuple(place[n] for n in output.nodes))
            for name, output in program.outputs.items()
        },
        {place[i]: name for i, name in program.names.items()},
        tuple(replace(check, node=place[check.node]) for check in program.checks),
    )


def _is_early(program: Program, i: int) -> bool:
    """Whether a step is there before all calls: numbers, inputs, what parameters determine."""
    step = program.steps[i]
    return step.operation in ("constant", "input") or step.stage <= Stage.PARAMETERS


def _interleaved(program: Program, todo: Sequence[int]) -> list[int]:
    """Steps in the order in which a processor begins them that prefers those on the longest chain
    of operations to the end.
    """
    steps, kept = program.steps, set(todo)
    operands = {i: [o for o in dict.fromkeys(steps[i].operands) if o in kept] for i in todo}
    users: dict[int, list[int]] = {i: [] for i in todo}
    for i in todo:
        for o in operands[i]:
            users[o].append(i)
    wait = {
        i: WAIT.get(steps[i].operation, LONG if steps[i].operation in FUNCTIONS else 1)
        for i in todo
    }
    left: dict[int, int] = {}  # cycles from the begin of a step to the end
    for i in reversed(todo):
        left[i] = wait[i] + max((left[u] for u in users[i]), default=0)
    missing = {i: len(operands[i]) for i in todo}
    start = dict.fromkeys(todo, 0.0)
    ready: list[tuple[int, int]] = []  # the longest chain first
    later: list[tuple[float, int]] = []  # by the time at which operands are there
    placed: list[int] = []
    done: set[int] = set()
    time, first, last = 0.0, 0, 0
    while len(placed) < len(todo):
        while first < len(todo) and todo[first] in done:
            first += 1
        while last < min(first + WINDOW, len(todo)):
            if not missing[todo[last]]:
                heapq.heappush(later, (start[todo[last]], todo[last]))
            last += 1
        while later and (later[0][0] <= time or not ready):
            begin, i = heapq.heappop(later)
            time = max(time, begin) if not ready else time
            heapq.heappush(ready, (-left[i], i))
        _, i = heapq.heappop(ready)
        placed.append(i)
        done.add(i)
        for u in users[i]:
            missing[u] -= 1
            start[u] = max(start[u], time + wait[i])
            if not missing[u] and last and u <= todo[last - 1]:
                heapq.heappush(later, (start[u], u))
        time += 1 / WIDTH
    return placed
