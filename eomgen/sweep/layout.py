"""The arrays in which the results of a sweep are kept, in memory."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from eomgen.base.text import one_line
from eomgen.sweep.members import Arrays, Task, module_of, output_shape


class Column(NamedTuple):
    """What an array keeps of each member: numbers of a type, in a shape."""

    type: str
    shape: tuple[int, ...]


Layout = Mapping[str, Column]
"""The arrays by name, without messages."""


def layout_of(task: Task) -> Layout:
    """The arrays that `run_members` returns, but for "message", which most members lack."""
    ny, many = len(module_of(task.source).STATES), len(task.times) > 2
    rows = (len(task.times),) if many else ()
    found = {"final": Column("<f8", (ny,)), "t": Column("<f8", ()), "status": Column("|i1", ())}
    if many:
        found["rows"] = Column("<f8", (*rows, ny))
    for name in task.outputs:
        found[name] = Column("<f8", (*rows, *output_shape(task.source, name)))
    return found


def bytes_each(layout: Layout) -> int:
    """Bytes of a member's results."""
    return sum(np.dtype(c.type).itemsize * math.prod(c.shape) for c in layout.values())


def said(arrays: Arrays) -> dict[int, str]:
    """The messages of a chunk by number of the member in it, each one line; without empty ones."""
    messages = arrays["message"]
    return {int(i): one_line(str(messages[i])) for i in np.flatnonzero(messages != "")}


@dataclass
class Memory:
    """The results of all members, in memory; chunks have `size` members."""

    layout: Layout
    members: int
    size: int
    arrays: Arrays = field(init=False)
    messages: dict[int, str] = field(init=False, default_factory=dict)

    def __post_init__(self) -> None:
        self.arrays = {
            name: np.empty((self.members, *column.shape), column.type)
            for name, column in self.layout.items()
        }

    def has(self, number: int) -> bool:
        """Whether a chunk is there."""
        return False

    def put(self, number: int, arrays: Arrays) -> None:
        """Take a chunk."""
        start = number * self.size
        for name, array in self.arrays.items():
            array[start : start + self.size] = arrays[name]
        self.messages |= {start + i: text for i, text in said(arrays).items()}

    def results(self) -> tuple[Arrays, dict[int, str]]:
        """The arrays of all members, and messages by number of the member."""
        return self.arrays, self.messages


def worded(messages: Mapping[int, str], members: int) -> NDArray[Any]:
    """(n,), the messages of all members, "" for those that have none."""
    found = np.full(members, "", dtype=object)
    for i, text in messages.items():
        found[i] = text
    return found
