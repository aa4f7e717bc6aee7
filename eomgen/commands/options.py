"""Options that several commands share. Each function adds some to a parser."""

import argparse
from pathlib import Path

from eomgen.commands.usage import path
from eomgen.tables.routes import ROUTES


def add_force(parser: argparse.ArgumentParser) -> None:
    """An option to overwrite files."""
    parser.add_argument(
        "--force", action="store_true", help="also overwrite files that eomgen did not write"
    )


def add_folder(parser: argparse.ArgumentParser, default: Path = Path("out")) -> None:
    """The folder of what is written."""
    parser.add_argument(
        "-o",
        "--output",
        metavar="DIR",
        type=path,
        default=default,
        help="output folder",
    )


def add_parameters(parser: argparse.ArgumentParser) -> None:
    """Values of parameters."""
    parser.add_argument(
        "--set", metavar="NAME=X", action="append", default=[], help="value of a parameter"
    )


def add_inputs(parser: argparse.ArgumentParser, *, constant: bool = False) -> None:
    """Inputs, or constant ones alone."""
    varying = (
        "an input: a number or a formula of t, 'push=3*sin(t)'; or FILE.csv with columns t and "
        "names, between whose times inputs are linear"
    )
    parser.add_argument(
        "--input",
        metavar="NAME=X",
        action="append",
        default=[],
        help="constant value of an input" if constant else varying,
    )


def add_method(parser: argparse.ArgumentParser) -> None:
    """The method of a run, its step or its tolerances."""
    parser.add_argument("--integrator", metavar="NAME", help="method (the scene's)")
    parser.add_argument("--dt", metavar="S", type=float, help="step of a fixed-step method")
    parser.add_argument("--rtol", metavar="X", type=float, help="relative tolerance (adaptive)")
    parser.add_argument("--atol", metavar="X", type=float, help="absolute tolerance (adaptive)")
    parser.add_argument("--max-step", metavar="S", type=float, help="longest step (adaptive)")


def add_unstable(parser: argparse.ArgumentParser) -> None:
    """Steps of any length."""
    parser.add_argument(
        "--unstable",
        action="store_true",
        help="allow steps of an explicit method that are too long for stability",
    )


def add_backend(parser: argparse.ArgumentParser) -> None:
    """Where a run is computed."""
    parser.add_argument(
        "--backend",
        metavar="NAME",
        default="auto",
        help="auto: compute in compiled C code if that pays; numpy: never; c: always",
    )


def add_rows(parser: argparse.ArgumentParser) -> None:
    """How many rows a run keeps."""
    parser.add_argument("--samples", metavar="N", type=int, default=1001, help="rows to keep")


def add_live(parser: argparse.ArgumentParser) -> None:
    """Whether a page integrates."""
    parser.add_argument(
        "--live",
        action=argparse.BooleanOptionalAction,
        help="a page that integrates by itself, or only replays (live where it can be)",
    )


def add_form(parser: argparse.ArgumentParser) -> None:
    """The form of the state."""
    parser.add_argument(
        "--form", choices=("velocity", "momentum", "redundant"), help="state form (the scene's)"
    )


def add_route(parser: argparse.ArgumentParser) -> None:
    """The route to the equations."""
    parser.add_argument(
        "--route",
        choices=("auto", *ROUTES),
        help="route to the equations (the scene's; auto is the one with the fewest operations that "
        "is accurate enough)",
    )


def add_code(parser: argparse.ArgumentParser) -> None:
    """What determines the module: its route and its outputs."""
    add_route(parser)
    parser.add_argument(
        "--outputs", metavar="A,B,…", help="functions of the module, or all (the scene's)"
    )
