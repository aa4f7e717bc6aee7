"""The failure of a step."""

from eomgen.base.errors import RunError


class StepFailure(RunError):
    """A step that cannot be made: the `reason`, and the `remedy`, what to change, or ""."""

    dead = False
    """See `trajectory.Outcome`."""

    def __init__(self, reason: str, remedy: str = "") -> None:
        super().__init__("; ".join(filter(None, (reason, remedy))))
        self.reason, self.remedy = reason, remedy

    def __reduce__(self) -> tuple[type, tuple[str, ...]]:
        return type(self), (self.reason, self.remedy)


class EndedRunError(StepFailure):
    """Raised by a callback of a run to end it; the text says why."""


NOT_FINITE = "the state overflows or is not a number"
"""Why a run stops at a state that is not finite."""
