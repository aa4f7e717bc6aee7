"""The command `completion`."""

import argparse

from eomgen.base.errors import RunError
from eomgen.commands.usage import path
from eomgen.scene.built_in import built_in_names

_PREAMBLE = {
    "bash": """
_eomgen_scene() {
  compgen -W "NAMES" -- "$1"
  compgen -f -X '!*.toml' -- "$1"
}
""",
    "zsh": """
_eomgen_scene() {
  _alternative 'names:built-in scene:(NAMES)' 'files:file:_files -g "*.toml"'
}
""",
}


def completion(given: argparse.Namespace) -> int:
    """Print the script that completes commands, options and scenes in a shell."""
    try:
        import shtab
    except ImportError:
        raise RunError("completion: needs shtab; run: pip install shtab") from None
    names = " ".join(built_in_names())
    for action in _actions(given.parser):
        if action.dest in ("scene", "scenes"):
            action.complete = {  # type: ignore[attr-defined]
                "bash": "_eomgen_scene",
                "zsh": "_eomgen_scene",
                "fish": f"{names} (__fish_complete_suffix .toml)",
            }
        elif action.dest == "output":
            action.complete = shtab.DIRECTORY  # type: ignore[attr-defined]
        elif action.type is path:
            action.complete = shtab.FILE  # type: ignore[attr-defined]
    preamble = _PREAMBLE.get(given.shell, "").replace("NAMES", names)
    print(shtab.complete(given.parser, given.shell, preamble=preamble))
    return 0


def _actions(parser: argparse.ArgumentParser) -> list[argparse.Action]:
    """The options and arguments of a parser and of its commands."""
    found: list[argparse.Action] = []
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for command in action.choices.values():
                found += _actions(command)
        else:
            found.append(action)
    return found
