"""The command line: parses arguments, runs a command, returns its exit code.

Exit codes: 0 done, 1 the scene or the run is at fault, 2 wrong usage, 130 interrupted.
"""

import argparse
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from eomgen import commands
from eomgen.errors import EomgenError, InterruptedRunError, report_refusal
from eomgen.options import (
    add_export,
    add_film,
    add_folder,
    add_force,
    add_gallery,
    add_import,
    add_inputs,
    add_parameters,
    add_plot,
    add_simulation,
    add_sweep,
)
from eomgen.routes import ROUTES
from eomgen.streams import steady_streams
from eomgen.text import one_line
from eomgen.usage import Parser, Version, example_of, path

Arguments = argparse.Namespace
Command = Callable[..., argparse.ArgumentParser]
"""Adds a command: its name, function, what it does, and what it takes as SCENE."""
INTERRUPTED = 130
DERIVED = "what was derived is kept for the next call"
KEPT = {
    "accuracy": "the runs made so far are in the table, and the same command continues",
    **dict.fromkeys(("derive", "verify", "effects", "linearise"), DERIVED),
    **dict.fromkeys(("simulate", "view", "plot", "film"), DERIVED),
}
"""What an interrupt leaves, for commands that do not say so themselves."""


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
        parser = _parser()
        given = parser.parse_args(arguments)
        if "run" not in given:  # no command
            parser.print_help()
            return 0
        if "scenes" in given and not (given.scenes or given.all):
            parser.error("generate: no scene; name one, or give --all for the built-in ones")
        code: int = given.run(given)
    except EomgenError as error:
        report_refusal(error)
        return INTERRUPTED if isinstance(error, InterruptedRunError) else 1
    except (OSError, MemoryError) as error:
        why = "out of memory" if isinstance(error, MemoryError) else one_line(str(error))
        print(f"eomgen: {why}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        kept = KEPT.get(given.command, "") if given else ""
        print(f"eomgen: interrupted{kept and '; '}{kept}", file=sys.stderr)
        return INTERRUPTED
    return code


def command_parsers() -> list[tuple[str, argparse.ArgumentParser]]:
    """The name of each command, and the parser of its arguments, in the order of the help."""
    found: list[tuple[str, argparse.ArgumentParser]] = []
    _parser(found)
    return found


def _parser(
    found: list[tuple[str, argparse.ArgumentParser]] | None = None,
) -> argparse.ArgumentParser:
    """The parser of the command line; those of the commands are appended to `found`."""
    parser = Parser(
        prog="eomgen",
        description="Equations of motion from a scene: derived, solved once, written as code.",
        epilog="SCENE is a file or the name of a built-in scene (eomgen list).",
    )
    parser.add_argument("--version", action=Version, help="print the version and exit")
    sub = parser.add_subparsers(metavar="COMMAND")

    def command(
        name: str, run: Callable[[Arguments], int], about: str, scenes: str | None = "scene"
    ) -> argparse.ArgumentParser:
        added = sub.add_parser(name, help=about, description=about, epilog=example_of(name))
        added.set_defaults(run=run, command=name, parser_of_command=added)
        if found is not None:
            found.append((name, added))
        if scenes == "scene":
            added.add_argument("scene", metavar="SCENE", help="file or built-in name")
        elif scenes == "run":
            text = "file that simulate wrote, .npz or .csv; or a scene, which is simulated first"
            added.add_argument("scene", metavar="RUN", help=text)
        elif scenes == "scenes":
            added.add_argument("scenes", metavar="SCENE", nargs="*", help="file or built-in name")
        return added

    _scene_files(command)
    completion = command(
        "completion", commands.completion, "print the completion of commands for a shell", None
    )
    completion.add_argument(
        "shell", metavar="SHELL", choices=("bash", "zsh", "fish"), help="bash, zsh or fish"
    )
    completion.set_defaults(parser=parser)
    command("schema", commands.print_schema, "print the JSON Schema of scenes, for editors", None)
    reference = command(
        "reference", commands.print_reference, "print the keys of joints and effects", None
    )
    reference.add_argument(
        "type", metavar="TYPE", nargs="?", help="one joint or effect, drag for example"
    )
    check = command("check", commands.check, "validate a scene and print its parts")
    check.add_argument("--long", action="store_true", help="do not shorten long lists")
    check.add_argument(
        "--assemble", action="store_true", help="print how the start of a mechanism with loops fits"
    )
    check.add_argument(
        "--picture", metavar="FILE", type=path, help="draw the start (png, pdf, svg)"
    )
    add_force(check)
    _form(check)
    derive = command("derive", commands.derive, "print the derivation, step by step")
    derive.add_argument(
        "--format",
        choices=("text", "latex", "html"),
        help="what is written (by the ending of FILE, .html or .tex; else text)",
    )
    derive.add_argument(
        "--form",
        dest="state_form",
        choices=("velocity", "momentum", "redundant"),
        help="state whose time derivative is written out: [q, v]; the handout's 8 numbers, or 12",
    )
    derive.add_argument("-o", "--output", metavar="FILE", type=path, help="write it to a file")
    add_force(derive)
    _generation(command("generate", commands.generate, "write the module of a scene", "scenes"))
    about = "write the equations of a scene in the format of another tool"
    add_export(_code(_form(command("export", commands.export, about))))
    for name, run, about in (
        ("simulate", commands.simulate, "integrate, and write trajectory, figure and page"),
        ("view", commands.view, "integrate, and open the animated page"),
    ):
        add_simulation(_code(_form(command(name, run, about))))
    about = "draw a figure of a run for a paper: PNG, SVG or PDF"
    add_plot(command("plot", commands.plot, about, "run"))
    about = "make a film of a run: GIF, or MP4 with ffmpeg"
    add_film(command("film", commands.film, about, "run"))
    about = (
        "write a folder of live pages, and one that shows them all with a picture and a sentence"
    )
    add_gallery(command("gallery", commands.gallery, about, None))
    about = "run a scene many times, with other parameters, initial states or inputs"
    add_sweep(_route(_form(command("sweep", commands.sweep, about))))
    about = "compare the module with an independent solver and 60 digits"
    _verification(_route(command("verify", commands.verify, about)))
    about = "measure time against error of all methods, and rounding errors of all routes"
    _accuracy(_route(_form(command("accuracy", commands.accuracy, about))))
    about = "measure the cost of each effect, and the change of the motion without it"
    costing = _route(command("effects", commands.effects, about))
    costing.add_argument(
        "--each", action="store_true", help="a line for each effect instead of each type"
    )
    costing.add_argument("--no-motion", action="store_true", help="do not compare motions")
    costing.add_argument(
        "--motion-time",
        metavar="S",
        type=float,
        default=10.0,
        help="length of the motions that are compared, s",
    )
    add_inputs(costing)
    add_folder(costing)
    add_force(costing)
    _linearisation(
        command("linearise", commands.linearise, "compute A, B and modes about an equilibrium")
    )
    return parser


def _generation(parser: argparse.ArgumentParser) -> None:
    _code(_form(parser))
    parser.add_argument("--backend", metavar="NAME", default="numpy", help="numpy, c or javascript")
    parser.add_argument(
        "-o",
        "--output",
        metavar="DIR",
        type=path,
        default=Path("generated"),
        help="folder of the modules",
    )
    parser.add_argument("--all", action="store_true", help="all built-in scenes")
    parser.add_argument(
        "--check", action="store_true", help="report which modules are stale; write nothing"
    )
    parser.add_argument(
        "--explain",
        action="store_true",
        help="say why the route was chosen, and what each line computes",
    )
    parser.add_argument("--report", action="store_true", help="say what each pass saved")
    add_force(parser)


def _scene_files(command: Command) -> None:
    """The commands on files of scenes."""
    command("list", commands.list_scenes, "list the built-in scenes", None)
    command("show", commands.show, "print the file of a scene")
    new = command("new", commands.new, "write a small scene with comments, to begin with", None)
    new.add_argument("name", metavar="NAME", type=path, help="the scene is written to NAME.toml")
    add_force(new)
    copy = command("copy", commands.copy, "copy a scene to a file of your own")
    copy.add_argument(
        "name", metavar="NAME", type=path, nargs="?", help="the copy is NAME.toml (the scene's)"
    )
    add_force(copy)
    about = "write a robot file, URDF or MJCF, as a scene"
    add_import(command("import", commands.import_, about, None))


def _form(parser: argparse.ArgumentParser) -> argparse.ArgumentParser:
    parser.add_argument(
        "--form", choices=("velocity", "momentum", "redundant"), help="state form (the scene's)"
    )
    return parser


def _route(parser: argparse.ArgumentParser) -> argparse.ArgumentParser:
    parser.add_argument(
        "--route",
        choices=("auto", *ROUTES),
        help="route to the equations (the scene's; auto is the one with the fewest operations that "
        "is accurate enough)",
    )
    return parser


def _code(parser: argparse.ArgumentParser) -> argparse.ArgumentParser:
    _route(parser)
    parser.add_argument(
        "--outputs", metavar="A,B,…", help="functions of the module, or all (the scene's)"
    )
    return parser


def _accuracy(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--methods", metavar="A,B,…", help="only these integrators (all)")
    parser.add_argument("--quick", action="store_true", help="only every second tolerance or step")
    parser.add_argument("--t-end", metavar="S", type=float, help="end time (the scene's)")
    parser.add_argument(
        "--run-time", metavar="S", type=float, default=3.0, help="longest time of one run, s"
    )
    parser.add_argument(
        "--time", metavar="S", type=float, default=300.0, help="start no run after this, s"
    )
    parser.add_argument("--fresh", action="store_true", help="do not use runs of earlier calls")
    add_parameters(parser)
    add_inputs(parser)
    half = parser.add_mutually_exclusive_group()
    half.add_argument("--arithmetic", action="store_true", help="only rounding errors, no runs")
    half.add_argument("--no-arithmetic", action="store_true", help="only runs, no rounding errors")
    parser.add_argument("--float32", action="store_true", help="also rounding errors of float32")
    parser.add_argument(
        "--states",
        metavar="N",
        type=int,
        help="states of each kind for rounding errors (100, 20 if large)",
    )
    parser.add_argument(
        "--seed", metavar="N", type=int, default=0, help="seed of the random states"
    )
    add_folder(parser)
    add_force(parser)


def _verification(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--states", metavar="N", type=int, help="states of each kind (8, 2 if there are many)"
    )
    parser.add_argument(
        "--seed", metavar="N", type=int, default=0, help="seed of the random states"
    )
    parser.add_argument(
        "--bound", metavar="ULPS", type=float, help="greatest error of v̇ (what the data allow)"
    )
    parser.add_argument(
        "--horizon",
        metavar="S",
        type=float,
        nargs="?",
        const=60.0,
        help="how long doubles are meaningful, by an extended-precision run of at most S s (60)",
    )
    parser.add_argument(
        "--save",
        metavar="DIR",
        type=path,
        nargs="?",
        const=Path("generated"),
        help="write the report beside the module, in DIR (generated)",
    )
    add_inputs(parser)
    add_force(parser)


def _linearisation(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--at",
        choices=("equilibrium", "rest", "initial"),
        default="equilibrium",
        help="about the nearest equilibrium, the state where it comes to rest, or the given state",
    )
    parser.add_argument(
        "--state",
        metavar="NAME=X",
        action="append",
        default=[],
        help="value of a state to start from; NAME_deg in degrees (the scene's initial state)",
    )
    parser.add_argument(
        "--hold",
        metavar="NAME",
        action="append",
        default=[],
        help="a coordinate that keeps its value while an equilibrium is searched for",
    )
    parser.add_argument(
        "--trim",
        metavar="INPUT",
        action="append",
        default=[],
        help="an input whose value is searched for as well",
    )
    add_parameters(parser)
    add_inputs(parser, constant=True)
    _route(parser)
    parser.add_argument(
        "-o", "--output", metavar="FILE", type=path, help="write A and B to FILE.npz or FILE.csv"
    )
    add_force(parser)
