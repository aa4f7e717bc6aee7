"""The command line: parses arguments, runs a command, returns its exit code.

Exit codes: 0 done, 1 the scene or the run is at fault, 2 wrong usage, 130 interrupted.
"""

import argparse
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NoReturn

from eomgen import commands
from eomgen.errors import EomgenError, InterruptedRunError, report_refusal
from eomgen.routes import ROUTES
from eomgen.streams import steady_streams
from eomgen.text import breaks_lines, one_line

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
    try:
        parser = _parser()
        given = parser.parse_args(arguments)
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
        print("eomgen: interrupted", file=sys.stderr)
        return INTERRUPTED
    return code


def _path(text: str) -> Path:
    if breaks_lines(text):
        raise argparse.ArgumentTypeError(f"{text} has a control character in its name")
    return Path(text)


class _Version(argparse.Action):
    """Prints the version, which is looked up only if the option is given."""

    def __init__(self, option_strings: Sequence[str], dest: str, help: str) -> None:
        super().__init__(option_strings, argparse.SUPPRESS, nargs=0, help=help)

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> NoReturn:
        from importlib.metadata import version

        print(f"eomgen {version('eomgen')}")
        parser.exit()


class _Parser(argparse.ArgumentParser):
    """A parser whose error messages stay on one line, whatever the arguments contain."""

    def error(self, message: str) -> NoReturn:
        super().error(one_line(message))


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="eomgen",
        description="Equations of motion from a scene: derived, solved once, written as code.",
        epilog="SCENE is a file or the name of a built-in scene (eomgen list).",
    )
    parser.add_argument("--version", action=_Version, help="print the version and end")
    sub = parser.add_subparsers(metavar="COMMAND", required=True)

    def command(
        name: str, run: Callable[[Arguments], int], about: str, scenes: str | None = "scene"
    ) -> argparse.ArgumentParser:
        added = sub.add_parser(name, help=about, description=about)
        added.set_defaults(run=run)
        if scenes == "scene":
            added.add_argument("scene", metavar="SCENE", help="file or built-in name")
        elif scenes == "scenes":
            added.add_argument("scenes", metavar="SCENE", nargs="*", help="file or built-in name")
        return added

    command("list", commands.list_scenes, "list the built-in scenes", None)
    command("schema", commands.print_schema, "print the JSON Schema of scenes, for editors", None)
    reference = command(
        "reference", commands.print_reference, "print the keys of joints and effects", None
    )
    reference.add_argument(
        "type", metavar="TYPE", nargs="?", help="one joint or effect, drag for example"
    )
    check = command("check", commands.check, "validate a scene and print its parts")
    check.add_argument("--long", action="store_true", help="do not shorten long lists")
    _form(check)
    derive = command("derive", commands.derive, "print the derivation, step by step")
    derive.add_argument("--format", choices=("text", "latex", "html"), default="text")
    derive.add_argument(
        "--form",
        dest="state_form",
        choices=("velocity", "momentum", "redundant"),
        help="state whose time derivative is written out: [q, v]; the handout's 8 numbers, or 12",
    )
    derive.add_argument("-o", "--output", metavar="FILE", type=_path, help="write it to a file")
    _force(derive)
    generate = command("generate", commands.generate, "write the module of a scene", "scenes")
    _code(_form(generate))
    generate.add_argument(
        "--backend", metavar="NAME", default="numpy", help="numpy (default), c, javascript"
    )
    generate.add_argument("-o", "--output", metavar="DIR", type=_path, default=Path("generated"))
    generate.add_argument("--all", action="store_true", help="all built-in scenes")
    generate.add_argument(
        "--check", action="store_true", help="report which are stale, write nothing"
    )
    generate.add_argument(
        "--explain", action="store_true", help="say why its route was chosen, and what each line is"
    )
    generate.add_argument("--report", action="store_true", help="say what each pass saved")
    _force(generate)
    for name, run, about in (
        ("simulate", commands.simulate, "integrate, and write trajectory, figure and page"),
        ("view", commands.view, "integrate, and open the animated page"),
    ):
        _simulation(_code(_form(command(name, run, about))))
    about = "run a scene many times, with other parameters, initial states or inputs"
    _sweep(_route(_form(command("sweep", commands.sweep, about))))
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
        help="length of the motions that are compared, 10 s",
    )
    costing.add_argument("-o", "--output", metavar="DIR", type=_path, default=Path("out"))
    _force(costing)
    _linearisation(
        command("linearise", commands.linearise, "compute A, B and modes about an equilibrium")
    )
    return parser


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


def _values(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--set", metavar="NAME=X", action="append", default=[], help="value of a parameter"
    )
    parser.add_argument(
        "--input", metavar="NAME=X", action="append", default=[], help="constant value of an input"
    )


def _force(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--force", action="store_true", help="also overwrite files that eomgen did not write"
    )


def _simulation(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--integrator", metavar="NAME", help="method (the scene's)")
    parser.add_argument("--dt", metavar="S", type=float, help="step of a fixed-step method")
    parser.add_argument(
        "--unstable",
        action="store_true",
        help="allow steps of an explicit method that are too long for stability",
    )
    parser.add_argument("--rtol", metavar="X", type=float, help="relative tolerance (adaptive)")
    parser.add_argument("--atol", metavar="X", type=float, help="absolute tolerance (adaptive)")
    parser.add_argument("--max-step", metavar="S", type=float, help="longest step (adaptive)")
    parser.add_argument(
        "--accuracy",
        metavar="X",
        type=float,
        help="choose method and tolerances for an error of X at the end, relative to the motion",
    )
    parser.add_argument(
        "--budget",
        metavar="TIME",
        help="choose the most accurate run of about this time, 2s for example",
    )
    parser.add_argument(
        "--estimate", action="store_true", help="estimate the error by a second run"
    )
    parser.add_argument(
        "--guard",
        choices=("stop", "repair"),
        nargs="?",
        const="stop",
        help="check rounding at each step; stop (default) or repair where digits are lost",
    )
    parser.add_argument("--t-end", metavar="S", type=float, help="end time")
    parser.add_argument(
        "--from",
        metavar="FILE.npz",
        dest="resume",
        type=_path,
        help="continue an earlier run as if it had not ended",
    )
    parser.add_argument(
        "--backend",
        metavar="NAME",
        default="auto",
        help="auto (default): compute in compiled C code if that pays; numpy: never; c: always",
    )
    parser.add_argument("--samples", metavar="N", type=int, default=1001, help="rows to keep")
    parser.add_argument("--works", action="store_true", help="compute the work of each effect")
    _values(parser)
    parser.add_argument("-o", "--output", metavar="DIR", type=_path, default=Path("out"))
    parser.add_argument("--plot", metavar="FILE", type=_path, help="figure (DIR/NAME.png)")
    parser.add_argument("--no-pictures", action="store_true", help="write no figure and no page")
    parser.add_argument("--view", action="store_true", help="open the page when done")
    _force(parser)


def _sweep(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--vary",
        metavar="NAME=…",
        action="append",
        default=[],
        help="a parameter, state or input: LOW:HIGH:COUNT, LOW:HIGH:COUNT:log or A,B,…; with "
        "--sample uniform:LOW:HIGH, loguniform:LOW:HIGH or normal:MEAN:DEVIATION",
    )
    parser.add_argument("--sample", metavar="N", type=int, help="draw N members, instead of a grid")
    parser.add_argument("--seed", metavar="N", type=int, default=0, help="seed of the sample")
    parser.add_argument("--of", metavar="NAME", help="state or output in the figure (the first)")
    parser.add_argument("--outputs", metavar="A,B,…", help="functions of the module to compute")
    parser.add_argument("--integrator", metavar="NAME", help="method (the scene's)")
    parser.add_argument("--dt", metavar="S", type=float, help="step of a fixed-step method")
    parser.add_argument("--rtol", metavar="X", type=float, help="relative tolerance (adaptive)")
    parser.add_argument("--atol", metavar="X", type=float, help="absolute tolerance (adaptive)")
    parser.add_argument("--max-step", metavar="S", type=float, help="longest step (adaptive)")
    parser.add_argument("--t-end", metavar="S", type=float, help="end time")
    parser.add_argument(
        "--samples", metavar="N", type=int, default=2, help="rows to keep (2, the ends)"
    )
    parser.add_argument(
        "--backend",
        metavar="NAME",
        default="auto",
        help="auto (default): compute in compiled C code if that pays; numpy: never; c: always",
    )
    parser.add_argument("--workers", metavar="N", type=int, help="processes (one a core)")
    parser.add_argument(
        "--scheduler", metavar="ADDRESS", default="", help="run on the workers of a Dask scheduler"
    )
    _values(parser)
    parser.add_argument("-o", "--output", metavar="DIR", type=_path, default=Path("out"))
    _force(parser)


def _accuracy(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--methods", metavar="A,B,…", help="only these integrators (all)")
    parser.add_argument("--quick", action="store_true", help="only every second tolerance or step")
    parser.add_argument("--t-end", metavar="S", type=float, help="end time (the scene's)")
    parser.add_argument(
        "--run-time", metavar="S", type=float, default=3.0, help="longest time of one run, 3 s"
    )
    parser.add_argument(
        "--time", metavar="S", type=float, default=300.0, help="start no run after this, 300 s"
    )
    parser.add_argument("--fresh", action="store_true", help="use no runs of an earlier call")
    _values(parser)
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
    parser.add_argument("-o", "--output", metavar="DIR", type=_path, default=Path("out"))
    _force(parser)


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
        type=_path,
        nargs="?",
        const=Path("generated"),
        help="write the report beside the module, in DIR (generated)",
    )
    _force(parser)


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
        help="a coordinate that keeps its value while an equilibrium is searched",
    )
    parser.add_argument(
        "--trim",
        metavar="INPUT",
        action="append",
        default=[],
        help="an input whose value is searched as well",
    )
    _values(parser)
    _route(parser)
    parser.add_argument(
        "-o", "--output", metavar="FILE", type=_path, help="write A and B to FILE.npz or FILE.csv"
    )
    _force(parser)
