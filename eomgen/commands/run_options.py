"""Options of the commands that make runs, and pictures of them."""

import argparse
from pathlib import Path

from eomgen.commands.options import (
    add_backend,
    add_folder,
    add_force,
    add_inputs,
    add_live,
    add_method,
    add_parameters,
    add_rows,
    add_unstable,
)
from eomgen.commands.usage import path


def add_simulation(parser: argparse.ArgumentParser) -> None:
    """The options of `simulate` and `view`."""
    add_method(parser)
    add_unstable(parser)
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
        help="check rounding at each step; where digits are lost, stop (the default) or repair",
    )
    parser.add_argument("--t-end", metavar="S", type=float, help="end time")
    parser.add_argument(
        "--from",
        metavar="FILE.npz",
        dest="resume",
        type=path,
        help="continue an earlier run as if it had not ended",
    )
    add_backend(parser)
    _add_start(parser)
    _add_results(parser)


def _add_results(parser: argparse.ArgumentParser) -> None:
    add_rows(parser)
    parser.add_argument(
        "--save",
        metavar="A,B,…",
        default="",
        help="what to save beside the states: energy, points, poses, works, inputs, or outputs by "
        "name, for example joint_forces",
    )
    parser.add_argument(
        "--parquet", action="store_true", help="also write the table as a Parquet file"
    )
    parser.add_argument("--works", action="store_true", help="compute the work of each effect")
    add_folder(parser)
    parser.add_argument("--plot", metavar="FILE", type=path, help="figure (DIR/NAME.png)")
    parser.add_argument("--no-pictures", action="store_true", help="write no figure and no page")
    parser.add_argument("--view", action="store_true", help="open the page when done")
    add_live(parser)
    add_force(parser)


def _add_start(parser: argparse.ArgumentParser) -> None:
    add_parameters(parser)
    parser.add_argument(
        "--state",
        metavar="NAME=X",
        action="append",
        default=[],
        help="value of a state at the start; NAME_deg in degrees (the scene's initial state)",
    )
    add_inputs(parser)


def add_plot(parser: argparse.ArgumentParser) -> None:
    """The options of `plot`."""
    parser.add_argument(
        "--of",
        metavar="A,B,…",
        default="",
        help="states, energy, outputs as joint_forces, components as joint_forces.NAME.fx, against "
        "time (all coordinates)",
    )
    parser.add_argument("--phase", metavar="A,B", default="", help="B against A")
    parser.add_argument(
        "--poincare",
        metavar="A,B",
        default="",
        help="B against A where the motion passes --at; of A alone each value against the last",
    )
    parser.add_argument(
        "--at", metavar="X=Y", default="", help="condition of t, states and parameters: 'phi = 0'"
    )
    parser.add_argument(
        "--direction",
        choices=("rising", "falling", "both"),
        default="rising",
        help="how X passes Y",
    )
    parser.add_argument("--strobe", action="store_true", help="the mechanism at several times")
    parser.add_argument("--times", metavar="T,T,…", default="", help="times of --strobe, s")
    parser.add_argument("--count", metavar="N", type=int, default=8, help="poses of --strobe")
    parser.add_argument(
        "--size",
        metavar="SIZE",
        default="double",
        help="single or double column of a paper (85 or 174 mm), or mm: 120 or 120x80",
    )
    _add_picture(parser, "figure, .png, .svg or .pdf (out/NAME_plot.png)")


def add_film(parser: argparse.ArgumentParser) -> None:
    """The options of `film`."""
    parser.add_argument("--fps", metavar="N", type=float, default=25.0, help="frames of a second")
    parser.add_argument(
        "--speed", metavar="X", type=float, default=1.0, help="0.5 shows the motion half as fast"
    )
    parser.add_argument(
        "--from", metavar="T", type=float, dest="start", help="time of the first frame, s"
    )
    parser.add_argument("--to", metavar="T", type=float, dest="end", help="time of the last, s")
    parser.add_argument(
        "--size", metavar="WxH", default="", help="pixels, 640x480 for example (as it needs them)"
    )
    _add_picture(parser, "film, .gif or .mp4 (out/NAME.gif)")


def _add_picture(parser: argparse.ArgumentParser, what: str) -> None:
    """Where a picture is written, and how a scene is simulated for it."""
    parser.add_argument(
        "--t-end", metavar="S", type=float, help="end time, if a scene is simulated"
    )
    parser.add_argument(
        "--samples", metavar="N", type=int, help="rows to keep, then (1001, 20001 for --poincare)"
    )
    parser.add_argument(
        "--set", metavar="NAME=X", action="append", default=[], help="value of a parameter, then"
    )
    parser.add_argument("-o", "--output", metavar="FILE", type=path, help=what)
    add_force(parser)


def add_gallery(parser: argparse.ArgumentParser) -> None:
    """The options of `gallery`."""
    parser.add_argument(
        "--scene", metavar="SCENE", nargs="+", help="files or built-in names (all built-in ones)"
    )
    add_method(parser)
    parser.add_argument("--t-end", metavar="S", type=float, help="end time (each scene's)")
    add_backend(parser)
    add_rows(parser)
    add_live(parser)
    add_folder(parser, Path("gallery"))
    add_force(parser)


def add_sweep(parser: argparse.ArgumentParser) -> None:
    """The options of `sweep`."""
    parser.add_argument(
        "--vary",
        metavar="NAME=…",
        action="append",
        default=[],
        help="a parameter, state or input, or NAME_deg, an angle in degrees: LOW:HIGH:COUNT, "
        "LOW:HIGH:COUNT:log or A,B,…; with --sample uniform:LOW:HIGH, loguniform:LOW:HIGH or "
        "normal:MEAN:DEVIATION",
    )
    parser.add_argument("--sample", metavar="N", type=int, help="draw N members, instead of a grid")
    parser.add_argument("--seed", metavar="N", type=int, default=0, help="seed of the sample")
    parser.add_argument("--of", metavar="NAME", help="state or output in the figure (the first)")
    parser.add_argument(
        "--statistics",
        action="store_true",
        help="also write mean, deviation and quantiles over the members, at each kept time",
    )
    parser.add_argument("--outputs", metavar="A,B,…", help="functions of the module to compute")
    add_method(parser)
    add_unstable(parser)
    parser.add_argument("--t-end", metavar="S", type=float, help="end time")
    parser.add_argument(
        "--samples",
        metavar="N",
        type=int,
        default=2,
        help="rows to keep; 2 keeps only the first and the last",
    )
    parser.add_argument(
        "--backend",
        metavar="NAME",
        default="auto",
        help="auto: compute in compiled C code if that pays; numpy: never; c: always",
    )
    parser.add_argument(
        "--workers", metavar="N", type=int, help="number of processes (one per core)"
    )
    parser.add_argument(
        "--scheduler", metavar="ADDRESS", default="", help="run on the workers of a Dask scheduler"
    )
    add_parameters(parser)
    add_inputs(parser)
    add_folder(parser)
    add_force(parser)
