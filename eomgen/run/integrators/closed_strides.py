"""Compiled steps of mechanisms whose loops are in closed form, watched for singular positions."""

from dataclasses import replace
from typing import TypeVar

from eomgen.run.compiled import EqualStride, Stride
from eomgen.run.problem import FloatArray, Problem

MOST = 1024
"""Greatest number of steps at once: between them progress is shown, and Ctrl-C is heard."""
FEWER, MORE = 8, 2
"""By how much fewer steps are made at once where Python has to look, and more where it need not."""

Steps = TypeVar("Steps", Stride, EqualStride)


def kept_closed(
    problem: Problem, t: float, y: FloatArray, stride: Steps, most: int
) -> tuple[Steps | None, int]:
    """Steps from (t, y) with the margins of their constraints, and how many to make at once next
    time; None if one of them may pass a singular position, so that Python must make the next.
    """
    if problem.closed_form is None:
        return stride, most
    margins = problem.closed_form.passed(t, y, stride.ends, stride.states)
    if margins is None:
        return None, max(1, most // FEWER)
    return replace(stride, margins=margins), min(MOST, MORE * most)
