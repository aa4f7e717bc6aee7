"""The steps of a derivation that are shown at a level of detail."""

from collections.abc import Sequence

from eomgen.derivation.steps import Step
from eomgen.tables.details import Detail

SUMMARY = ("State", "Elimination", "Mass matrix", "Virtual power", "Velocity forces",
           "Gravity forces", "Applied forces", "One equation", "The accelerations that",
           "Closed form", "Solved", "Compared", "An algorithm")  # fmt: skip
BEYOND = ("Joint force", "The symmetric mass matrix", "The forces of the constraints",
          "Applied forces, term by term")  # fmt: skip

TWICE = ", differentiated twice"
"""Steps on joints: of a mechanism with closed loops the joints of the tree need no such step."""


def at_detail(steps: Sequence[Step], detail: Detail) -> tuple[Step, ...]:
    """The steps of a level; their numbers stay."""
    if detail == "all":
        return tuple(steps)
    if detail == "summary":
        return tuple(x for x in steps if x.title.startswith(SUMMARY) and not _is_beyond(x))
    tied = any(x.title.startswith("One equation") for x in steps)
    return tuple(
        x
        for x in steps
        if not _is_beyond(x)
        and not (tied and x.title.endswith(TWICE) and x.title.startswith("Joint"))
    )


def _is_beyond(step: Step) -> bool:
    return step.title.startswith(BEYOND) or step.title.endswith((": its forces", "(gravity)"))
