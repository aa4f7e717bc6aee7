"""Options of the commands that study a scene: its errors, its effects, its equilibria."""

import argparse
from pathlib import Path

from eomgen.commands.options import add_folder, add_force, add_inputs, add_parameters, add_route
from eomgen.commands.usage import path


def add_verification(parser: argparse.ArgumentParser) -> None:
    """The options of `verify`."""
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


def add_accuracy(parser: argparse.ArgumentParser) -> None:
    """The options of `accuracy`."""
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


def add_linearisation(parser: argparse.ArgumentParser) -> None:
    """The options of `linearise`."""
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
    add_route(parser)
    parser.add_argument(
        "-o", "--output", metavar="FILE", type=path, help="write A and B to FILE.npz or FILE.csv"
    )
    add_force(parser)


def add_costing(parser: argparse.ArgumentParser) -> None:
    """The options of `effects`."""
    parser.add_argument(
        "--each", action="store_true", help="a line for each effect instead of each type"
    )
    parser.add_argument("--no-motion", action="store_true", help="do not compare motions")
    parser.add_argument(
        "--motion-time",
        metavar="S",
        type=float,
        default=10.0,
        help="length of the motions that are compared, s",
    )
    add_inputs(parser)
    add_folder(parser)
    add_force(parser)
