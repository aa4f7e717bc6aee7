"""How a computation reports to its caller: notes, trial runs, progress.

By default notes and trial runs go to the logger "eomgen", which is silent until it has a handler.
"""

from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

from eomgen.base.errors import EomgenError, SceneError
from eomgen.run.progress import Progress
from eomgen.scene.lines import with_lines

if TYPE_CHECKING:
    from logging import Logger


@cache
def logger() -> "Logger":
    """The logger "eomgen". It is silent unless the user's program gives it a handler."""
    import logging

    found = logging.getLogger("eomgen")
    found.addHandler(logging.NullHandler())
    return found


def _log(text: str) -> None:
    if text:
        logger().info(text)


def _log_detail(text: str) -> None:
    logger().debug(text)


def _no_progress(label: str) -> AbstractContextManager[Progress]:
    return nullcontext(lambda fraction: None)


def _no_notice(label: str) -> AbstractContextManager[None]:
    return nullcontext()


@dataclass(frozen=True)
class Reporter:
    """Callbacks of a caller, and the names that its messages use.

    scene     name of the scene, which starts messages about it; "" for none
    text      the text of the scene's file, for the lines in messages
    argument  name of an argument in messages: `t_end` is `--t-end` on the command line
    note      receives notes, for example that the store cannot be used
    trial     receives a line for each trial run
    waiting   a context that shows a notice while it is open
    progress  a context that shows how much of a computation is done
    """

    scene: str = ""
    text: Callable[[], str] = str
    argument: Callable[[str], str] = str
    note: Callable[[str], None] = _log
    trial: Callable[[str], None] = _log_detail
    waiting: Callable[[str], AbstractContextManager[None]] = _no_notice
    progress: Callable[[str], AbstractContextManager[Progress]] = _no_progress

    @contextmanager
    def located(self) -> Iterator[None]:
        """A context whose errors are raised as `SceneError`, each line after the scene's name."""
        try:
            yield
        except EomgenError as error:
            if not self.scene:
                raise
            raise SceneError(*self._with_lines(error.lines)) from None

    def note_scene(self, text: str) -> None:
        """Note something about the scene."""
        self.note(next(self._with_lines([text])) if self.scene else text)

    def _with_lines(self, messages: Iterable[str]) -> Iterator[str]:
        """Messages about the scene, each with the scene's name and, if known, the line."""
        return with_lines((f"{self.scene}: {text}" for text in messages), self.scene, self.text())


SILENT = Reporter()
"""Prints nothing."""
