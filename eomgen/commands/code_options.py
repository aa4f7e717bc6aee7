"""Options of the commands on scenes, their derivation and their code."""

import argparse
from pathlib import Path

from eomgen.commands.options import add_force
from eomgen.commands.usage import path
from eomgen.exports import FORMATS


def add_import(parser: argparse.ArgumentParser) -> None:
    """The options of `import`."""
    parser.add_argument("robot", metavar="ROBOT", type=path, help="file, .urdf, .xml or .mjcf")
    parser.add_argument(
        "-o", "--output", metavar="FILE", type=path, help="the scene (NAME.toml, the robot's name)"
    )
    parser.add_argument(
        "--floating",
        action="store_true",
        help="let the root link of a URDF move freely; else it is fixed to the world",
    )
    parser.add_argument(
        "--stops",
        action="store_true",
        help="make rigid stops of the limits of a URDF's joints, which are else reported",
    )
    parser.add_argument(
        "--allow",
        metavar="DIR",
        type=path,
        action="append",
        default=[],
        help="also read meshes and included files in this folder; else only beside ROBOT",
    )
    add_force(parser)


def add_generation(parser: argparse.ArgumentParser) -> None:
    """The options of `generate`."""
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


def add_export(parser: argparse.ArgumentParser) -> None:
    """The formats of `export`, and their options."""
    group = parser.add_mutually_exclusive_group(required=True)
    for name, found in FORMATS.items():
        group.add_argument(
            f"--{name}", dest="format", action="store_const", const=name, help=found.about
        )
    parser.add_argument("--float", action="store_true", help="numbers in C are float, not double")
    parser.add_argument(
        "--integrator", metavar="NAME", default="", help="method of steps (DOP853; rk4)"
    )
    parser.add_argument(
        "-o",
        "--output",
        metavar="PATH",
        type=path,
        help="the file, or the folder of several files (the scene's name)",
    )
    add_force(parser)


def add_new(parser: argparse.ArgumentParser) -> None:
    """The options of `new`."""
    parser.add_argument("name", metavar="NAME", type=path, help="the scene is written to NAME.toml")
    add_force(parser)


def add_copy(parser: argparse.ArgumentParser) -> None:
    """The options of `copy`."""
    parser.add_argument(
        "name", metavar="NAME", type=path, nargs="?", help="the copy is NAME.toml (the scene's)"
    )
    add_force(parser)


def add_completion(parser: argparse.ArgumentParser) -> None:
    """The argument of `completion`."""
    parser.add_argument(
        "shell", metavar="SHELL", choices=("bash", "zsh", "fish"), help="bash, zsh or fish"
    )


def add_reference(parser: argparse.ArgumentParser) -> None:
    """The argument of `reference`."""
    parser.add_argument(
        "type", metavar="TYPE", nargs="?", help="one joint or effect, drag for example"
    )


def add_check(parser: argparse.ArgumentParser) -> None:
    """The options of `check`."""
    parser.add_argument("--long", action="store_true", help="do not shorten long lists")
    parser.add_argument(
        "--assemble", action="store_true", help="print how the start of a mechanism with loops fits"
    )
    parser.add_argument(
        "--picture", metavar="FILE", type=path, help="draw the start (png, pdf, svg)"
    )
    add_force(parser)


def add_derivation(parser: argparse.ArgumentParser) -> None:
    """The options of `derive`."""
    parser.add_argument(
        "--format",
        choices=("text", "latex", "html"),
        help="what is written (by the ending of FILE, .html or .tex; else text)",
    )
    parser.add_argument(
        "--form",
        dest="state_form",
        choices=("velocity", "momentum", "redundant"),
        help="state whose time derivative is written out: [q, v]; the handout's 8 numbers, or 12",
    )
    parser.add_argument("-o", "--output", metavar="FILE", type=path, help="write it to a file")
    add_force(parser)
