"""How the command line looks: its parser, and help with defaults."""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NoReturn

from eomgen.base.errors import nearest
from eomgen.base.text import breaks_lines, one_line
from eomgen.base.version import __version__


def path(text: str) -> Path:
    """An argument that is a path; its name has no control characters."""
    if breaks_lines(text):
        raise argparse.ArgumentTypeError(f"{text} has a control character in its name")
    return Path(text)


class Version(argparse.Action):
    """Prints the version."""

    def __init__(self, option_strings: Sequence[str], dest: str, help: str) -> None:
        super().__init__(option_strings, argparse.SUPPRESS, nargs=0, help=help)

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> NoReturn:
        print(f"eomgen {__version__}")
        parser.exit()


class Help(argparse.RawDescriptionHelpFormatter):
    """Help that states the default of each option that has one, unless its text does."""

    def _get_help_string(self, action: argparse.Action) -> str:
        text, default = action.help or "", action.default
        if default in (None, False, "", argparse.SUPPRESS) or default == []:
            return text
        return f"{text} (default: %(default)s)"


class Parser(argparse.ArgumentParser):
    """A parser whose error messages stay on one line, whatever the arguments contain."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**{"formatter_class": Help, **options})

    def parse_args(self, args: Any = None, namespace: Any = None) -> Any:
        """As that of argparse, with a hint at an option that is known and similar."""
        given, left = self.parse_known_args(args, namespace)
        if left:
            command = getattr(given, "parser_of_command", self)
            known = [text for action in command._actions for text in action.option_strings]
            hints = [nearest(word.partition("=")[0], known) for word in left if word[:1] == "-"]
            self.error(f"unrecognized arguments: {' '.join(left)}{''.join(hints)}")
        return given

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if action.choices is not None and value not in action.choices:
            names = list(map(str, action.choices))
            hint = nearest(str(value), names) or f"; known: {', '.join(names)}"
            raise argparse.ArgumentError(action, f"no '{value}'{hint}")

    def error(self, message: str) -> NoReturn:
        super().error(one_line(message))
