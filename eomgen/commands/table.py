"""The commands, one entry each: all that is known of a command before it runs."""

import argparse
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from pkgutil import resolve_name
from typing import Literal

from eomgen.api import options as api
from eomgen.commands import options as own
from eomgen.commands.usage import add_options

Arguments = argparse.Namespace
AddOptions = Callable[[argparse.ArgumentParser], None]
Takes = Literal["scene", "scenes", "run", "either", ""]

DERIVED = "what was derived is kept for the next call"
TAKEN = {
    "scene": ("scene", "SCENE", None, "file or built-in name"),
    "scenes": ("scenes", "SCENE", "*", "file or built-in name"),
    "run": (
        "scene",
        "RUN",
        None,
        "file that simulate wrote, .npz or .csv; or a scene, which is simulated first",
    ),
    "either": ("scene", "SCENE", None, "file or built-in name; or FILE.npz, a run"),
}
"""First arguments: destination, name, how many, and help."""


@dataclass(frozen=True)
class Command:
    """A command.

    name     what a user types
    place    "module:function" in `eomgen.commands`, which runs it and returns its exit code
    about    what it does
    example  a line that can be typed
    takes    its first argument: a scene, several, a run, or nothing
    options  records of its options, or functions that add them to a parser
    kept     what an interrupt leaves, if the command does not say so itself
    """

    name: str
    place: str
    about: str
    example: str
    takes: Takes = "scene"
    options: tuple[type | AddOptions, ...] = ()
    kept: str = ""

    def run(self, given: Arguments) -> int:
        """Run it. Its module is imported only now: some load much."""
        code: int = resolve_name(f"eomgen.commands.{self.place}")(given)
        return code

    def fill(self, parser: argparse.ArgumentParser) -> None:
        """Add its arguments and options to a parser."""
        if self.takes:
            name, metavar, count, text = TAKEN[self.takes]
            parser.add_argument(name, metavar=metavar, nargs=count, help=text)
        for options in self.options:
            if isinstance(options, type):
                add_options(parser, options)
            else:
                options(parser)


EACH_SCENE = ("t_end", "integrator", "dt", "rtol", "atol", "max_step", "samples", "backend")
"""The options of a run that `gallery` takes for all scenes."""


_ALL = (
    Command("list", "listing:list_scenes", "list the built-in scenes", "eomgen list", ""),
    Command("show", "scene_files:show", "print the file of a scene", "eomgen show pendulum"),
    Command(
        "new",
        "scene_files:new",
        "write a small scene with comments, to begin with",
        "eomgen new swing",
        "",
        (own.New,),
    ),
    Command(
        "copy",
        "scene_files:copy",
        "copy a scene to a file of your own",
        "eomgen copy cart_pole my_cart",
        options=(own.Copy,),
    ),
    Command(
        "import",
        "importing:import_",
        "write a robot file, URDF or MJCF, as a scene",
        "eomgen import robot.urdf -o robot.toml",
        "",
        (own.Imported,),
    ),
    Command(
        "completion",
        "completing:completion",
        "print the completion of commands for a shell",
        "eomgen completion bash > ~/.local/share/bash-completion/completions/eomgen",
        "",
        (own.Shell,),
    ),
    Command(
        "schema",
        "describing:print_schema",
        "print the JSON Schema of scenes, for editors",
        "eomgen schema > scene.schema.json",
        "",
    ),
    Command(
        "reference",
        "describing:print_reference",
        "print the keys of joints and effects",
        "eomgen reference contact",
        "",
        (own.Type,),
    ),
    Command(
        "check",
        "describing:check",
        "validate a scene and print its parts",
        "eomgen check two_body",
        options=(own.Check, api.Formed),
    ),
    Command(
        "derive",
        "deriving:derive",
        "print the derivation, step by step",
        "eomgen derive two_body -o two_body.html",
        options=(own.Derivation,),
        kept=DERIVED,
    ),
    Command(
        "generate",
        "generating:generate",
        "write the module of a scene",
        "eomgen generate two_body pendulum -o modules",
        "scenes",
        (api.Formed, own.Coded, own.Generation),
    ),
    Command(
        "export",
        "exporting:export",
        "write the equations of a scene in the format of another tool",
        "eomgen export cart_pole --fmu -o cart_pole.fmu",
        options=(own.add_formats, api.ExportOptions),
    ),
    Command(
        "simulate",
        "running:simulate",
        "integrate, and write trajectory, figure and page",
        "eomgen simulate cart_pole --set l=0.4 --state theta=0.3 --input push=3*sin(t)",
        options=(api.RunOptions, own.Coded, own.RunFiles),
        kept=DERIVED,
    ),
    Command(
        "view",
        "running:view",
        "integrate, and open the animated page",
        "eomgen view double_pendulum",
        options=(api.RunOptions, own.Coded, own.RunFiles),
        kept=DERIVED,
    ),
    Command(
        "plot",
        "picturing:plot",
        "draw a figure of a run for a paper: PNG, SVG or PDF",
        "eomgen plot out/cart_pole.npz --of theta,theta_dot,energy,joint_forces.pin -o run.pdf",
        "run",
        (own.Plot,),
        DERIVED,
    ),
    Command(
        "film",
        "picturing:film",
        "make a film of a run: GIF, or MP4 with ffmpeg",
        "eomgen film out/cart_pole.npz --speed 0.5 -o cart_pole.gif",
        "run",
        (own.Film,),
        DERIVED,
    ),
    Command(
        "gallery",
        "exhibiting:gallery",
        "write a folder of live pages, and one that shows them all with a picture and a sentence",
        "eomgen gallery -o course --scene pendulum two_body",
        "",
        (partial(add_options, record=api.RunOptions, names=EACH_SCENE), own.Gallery),
    ),
    Command(
        "sweep",
        "sweeping:sweep",
        "run a scene many times, with other parameters, initial states or inputs",
        "eomgen sweep cart_pole --vary m_pole=0.1:0.5:20 --of theta",
        options=(api.Formed, own.Members, api.SweepOptions, own.InFolder),
    ),
    Command(
        "verify",
        "verifying:verify",
        "compare the module with an independent solver and 60 digits",
        "eomgen verify two_body --states 20",
        options=(api.Routed, api.VerifyOptions, own.Evidence),
        kept=DERIVED,
    ),
    Command(
        "accuracy",
        "measuring:accuracy",
        "measure time against error of all methods, and rounding errors of all routes",
        "eomgen accuracy pendulum --quick",
        options=(api.AccuracyOptions, api.ArithmeticOptions, own.Halves),
        kept="the runs made so far are in the table, and the same command continues",
    ),
    Command(
        "effects",
        "costing:effects",
        "measure the cost of each effect, and the change of the motion without it",
        "eomgen effects ragdoll --each",
        options=(api.EffectsOptions, own.Costing),
        kept=DERIVED,
    ),
    Command(
        "linearise",
        "linearising:linearise",
        "compute A, B and modes about an equilibrium",
        "eomgen linearise cart_pole --state theta_deg=180 -o cart_pole.npz",
        options=(api.PointOptions, api.Routed, own.Matrices),
        kept=DERIVED,
    ),
    Command(
        "certify",
        "certifying:certify",
        "prove boxes that hold a motion, or bounds of a run's error",
        "eomgen certify double_pendulum --tolerance 1e-12",
        "either",
        (api.CertifyOptions, api.Routed, own.Boxes),
        DERIVED,
    ),
    Command(
        "fit",
        "fitting:fit",
        "fit parameters and initial states to measurements",
        "eomgen fit swing.toml measured.csv --names b,theta",
        options=(own.Logs, api.FitOptions, api.Routed),
        kept=DERIVED,
    ),
)


def _named(commands: Iterable[Command]) -> dict[str, Command]:
    return {command.name: command for command in commands}


COMMANDS = _named(_ALL)
"""All commands, by name, in the order of the help."""
