"""How a caller is spoken to while something is computed; by default nothing is said."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass

from eomgen.errors import EomgenError, SceneError
from eomgen.run.progress import Progress


def _unheard(text: str) -> None:
    """Let it pass."""


def _unseen(label: str) -> AbstractContextManager[Progress]:
    return nullcontext(lambda fraction: None)


def _unwaited(label: str) -> AbstractContextManager[None]:
    return nullcontext()


@dataclass(frozen=True)
class Manner:
    """How a caller is spoken to.

    place    what a scene is called in front of what is said of it; "" for nothing
    option   what an argument is called in messages
    note     told what was done without, or put right
    trying   told each run that is tried
    waiting  shows a line while something is awaited
    watch    shows how far something is
    """

    place: str = ""
    option: Callable[[str], str] = str
    note: Callable[[str], None] = _unheard
    trying: Callable[[str], None] = _unheard
    waiting: Callable[[str], AbstractContextManager[None]] = _unwaited
    watch: Callable[[str], AbstractContextManager[Progress]] = _unseen

    @contextmanager
    def located(self) -> Iterator[None]:
        """Name the scene in front of what is wrong with it."""
        try:
            yield
        except EomgenError as error:
            if not self.place:
                raise
            raise SceneError(*(f"{self.place}: {line}" for line in error.lines)) from None

    def noted(self, notice: str) -> None:
        """Take note of what there is to say of the scene."""
        self.note(f"{self.place}: {notice}" if self.place else notice)


SILENT = Manner()
