"""What the tables of `peers.py` share: mechanisms, times by turns, and rows of tables."""

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin

from eomgen.model.elaborate import elaborate
from eomgen.model.model import Model
from eomgen.scene.built_in import BUILT_IN
from eomgen.scene.reader import parse_scene

COLUMNS = 2000


def chain(count: int) -> Model:
    """The built-in chain with this many links."""
    text = (BUILT_IN / "chain.toml").read_text("utf-8").replace("count = 10", f"count = {count}")
    return replace(elaborate(parse_scene(text)), outputs=())


def chain_of_pinocchio(
    count: int, mass: float = 0.1, half: float = 0.1, inertia: float = 3.3333333333333335e-4
) -> Any:
    """The same mechanism, or one of other rods: mass, half the length, inertia."""
    model = pin.Model()
    model.gravity.linear = np.array([0.0, -9.81, 0.0])
    at, place = 0, pin.SE3.Identity()
    for i in range(count):
        at = model.addJoint(at, pin.JointModelRZ(), place, f"joint_{i}")
        about_com = pin.Inertia(mass, np.zeros(3), np.diag([1e-12, 1e-12, inertia]))
        model.appendBodyToJoint(at, about_com, pin.SE3(np.eye(3), np.array([half, 0.0, 0.0])))
        place = pin.SE3(np.eye(3), np.array([2 * half, 0.0, 0.0]))
    return model


def paired(rounds: int, *calls: Callable[[], object], warm: bool = False) -> np.ndarray:
    """Times of calls, (rounds, calls), s, by turns.

    warm  whether each is made twice and the second is timed, so that none pays for the data that
          the one before has put into the caches
    """
    times = np.empty((rounds, len(calls)))
    for call in calls:
        call()
    for row in times:
        for j, call in enumerate(calls):
            if warm:
                call()
            start = time.perf_counter()
            call()
            row[j] = time.perf_counter() - start
    return times


def spread(ratios: np.ndarray) -> str:
    low, middle, high = np.quantile(ratios, (0.25, 0.5, 0.75))
    return f"{middle:.3g} ({low:.3g} to {high:.3g})"


def compared(ours: np.ndarray, theirs: np.ndarray) -> str:
    """The ratio of least times, which other work on the machine disturbs little, and the quartiles
    of the ratios of paired rounds.
    """
    low, high = np.quantile(theirs / ours, (0.25, 0.75))
    return f"{theirs.min() / ours.min():.3g} ({low:.3g} to {high:.3g})"


def row(*words: object) -> None:
    """Print a row of a table."""
    print(f"| {' | '.join(map(str, words))} |", flush=True)
