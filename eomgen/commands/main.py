"""The command line: parses arguments, runs a command, returns its exit code.

Exit codes: 0 done, 1 the scene or the run is at fault, 2 wrong usage, 130 interrupted.
"""

import argparse
import sys
from collections.abc import Sequence

from eomgen.base.errors import EomgenError, InterruptedRunError, report_refusal
from eomgen.base.streams import steady_streams
from eomgen.base.text import one_line
from eomgen.commands.table import COMMANDS
from eomgen.commands.usage import Parser, Version

Arguments = argparse.Namespace
INTERRUPTED = 130


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code. Raises `SystemExit` for wrong usage and for help.

    A standard stream that fails does not stop the command; the failure is reported at the end.
    """
    with steady_streams() as output:
        stopped = False
        try:
            code = _run(arguments)
        except SystemExit as stop:
            stopped, code = True, int(stop.code or 0)
        if why := output.lost():
            print(f"eomgen: standard output cannot be written: {why}", file=sys.stderr)
            code = code or 1
        if stopped:
            raise SystemExit(code)
        return code


def _run(arguments: Sequence[str] | None) -> int:
    given: Arguments | None = None
    try:
        parser, _ = parsers()
        given = parser.parse_args(arguments)
        if "command" not in given:
            parser.print_help()
            return 0
        if "scenes" in given and not (given.scenes or given.all):
            parser.error("generate: no scene; name one, or give --all for the built-in ones")
        code: int = given.command.run(given)
    except EomgenError as error:
        report_refusal(error)
        return INTERRUPTED if isinstance(error, InterruptedRunError) else 1
    except (OSError, MemoryError) as error:
        why = "out of memory" if isinstance(error, MemoryError) else one_line(str(error))
        print(f"eomgen: {why}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        kept = given.command.kept if given else ""
        print(f"eomgen: interrupted{kept and '; '}{kept}", file=sys.stderr)
        return INTERRUPTED
    return code


def parsers() -> tuple[argparse.ArgumentParser, dict[str, argparse.ArgumentParser]]:
    """The parser of the command line, and those of its commands, in the order of the help."""
    parser = Parser(
        prog="eomgen",
        description="Equations of motion from a scene: derived, solved once, written as code.",
        epilog="SCENE is a file or the name of a built-in scene (eomgen list).",
    )
    parser.add_argument("--version", action=Version, help="print the version and exit")
    sub = parser.add_subparsers(metavar="COMMAND")
    found: dict[str, argparse.ArgumentParser] = {}
    for name, command in COMMANDS.items():
        about, example = command.about, f"example: {command.example}"
        found[name] = sub.add_parser(name, help=about, description=about, epilog=example)
        found[name].set_defaults(command=command, parser=parser, parser_of_command=found[name])
        command.fill(found[name])
    return parser, found
