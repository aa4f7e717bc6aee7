"""The options that commands alone take; those of public functions are in `eomgen.api.options`."""

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from eomgen.api.options import FORMS, OWN, Forced, check_seed, check_time, names_in, outputs_in
from eomgen.base.options import option
from eomgen.exports import FORMATS
from eomgen.show.filming import FilmOptions
from eomgen.tables.details import DETAILS, METHODS

if TYPE_CHECKING:
    from eomgen.api.given import Outputs


def _file(words: str, **more: Any) -> Any:
    return option(None, words, flag="-o --output", **{"value": "FILE", **more})


@dataclass(frozen=True, kw_only=True)
class InFolder(Forced):
    """Where files are written."""

    output: Path = option(Path("out"), "output folder", flag="-o --output", value="DIR")


@dataclass(frozen=True, kw_only=True)
class Live:
    """Whether a page integrates."""

    live: bool | None = option(
        None, "a page that integrates by itself, or only replays (live where it can be)"
    )


@dataclass(frozen=True, kw_only=True)
class Coded:
    """What a module has."""

    outputs: "Outputs | None" = option(
        None, "functions of the module, or all", none=OWN, value="A,B,…", read=outputs_in
    )


@dataclass(frozen=True, kw_only=True)
class RunFiles(InFolder, Live):
    """What `simulate` and `view` write."""

    parquet: bool = option(False, "also write the table as a Parquet file")
    plot: Path | None = option(None, "figure (DIR/NAME.png)", value="FILE")
    no_pictures: bool = option(False, "write no figure and no page")
    view: bool = option(False, "open the page when done")


@dataclass(frozen=True, kw_only=True)
class Picture(Forced):
    """How a scene is simulated for a picture."""

    t_end: float | None = option(None, "end time, if a scene is simulated", "s")
    samples: int | None = option(None, "rows to keep, then (1001, 20001 for --poincare)")
    parameters: Sequence[str] = option(
        (), "value of a parameter, then", flag="--set", value="NAME=X"
    )


@dataclass(frozen=True, kw_only=True)
class Plot(Picture):
    """The options of `plot`."""

    of: str = option(
        "",
        "states, energy, effects as NAME, NAME.force or NAME.power, outputs as joint_forces, "
        "components as joint_forces.NAME.fx, against time (all coordinates)",
        value="A,B,…",
    )
    phase: str = option("", "B against A", value="A,B")
    poincare: str = option(
        "",
        "B against A where the motion passes --at; of A alone each value against the last",
        value="A,B",
    )
    at: str = option("", "condition of t, states and parameters: 'phi = 0'", value="X=Y")
    direction: str = option("rising", "how X passes Y", choices=("rising", "falling", "both"))
    strobe: bool = option(False, "the mechanism at several times")
    times: str = option("", "times of --strobe, s", value="T,T,…")
    count: int = option(8, "poses of --strobe")
    size: str = option(
        "double",
        "single or double column of a paper (85 or 174 mm), or mm: 120 or 120x80",
        value="SIZE",
    )
    output: Path | None = _file("figure, .png, .svg or .pdf (out/NAME_plot.png)")


@dataclass(frozen=True, kw_only=True)
class Film(FilmOptions, Picture):
    """The options of `film`."""

    output: Path | None = _file("film, .gif or .mp4 (out/NAME.gif)")


@dataclass(frozen=True, kw_only=True)
class Gallery(InFolder, Live):
    """The options of `gallery`."""

    scene: Sequence[str] | None = option(
        None, "files or built-in names (all built-in ones)", value="SCENE", count="+"
    )
    output: Path = option(Path("gallery"), "output folder", flag="-o --output", value="DIR")


@dataclass(frozen=True, kw_only=True)
class Logs:
    """What `fit` takes beside its options."""

    data: Sequence[Path] = option(
        (),
        "measurements with columns t, inputs, states and outputs",
        flag="LOG",
        value="FILE.csv",
        count="+",
    )
    names: Sequence[str] = option(
        (),
        "what is fitted: parameters, and states at the start of each experiment",
        value="A,B,…",
        read=names_in,
    )


@dataclass(frozen=True, kw_only=True)
class Members:
    """The options of `sweep`, beside those of `ensemble`."""

    vary: Sequence[str] = option(
        (),
        "a parameter, state or input, or NAME_deg, an angle in degrees: LOW:HIGH:COUNT, "
        "LOW:HIGH:COUNT:log or A,B,…; with --sample uniform:LOW:HIGH, loguniform:LOW:HIGH or "
        "normal:MEAN:DEVIATION",
        value="NAME=…",
    )
    sample: int | None = option(None, "draw N runs, instead of a grid")
    seed: int = option(0, "seed of the sample", check=check_seed)
    of: str | None = option(None, "state or output in the figure (the first)")
    statistics: bool = option(
        False, "also write mean, deviation and quantiles over the runs, at each kept time"
    )
    workers: int | None = option(None, "number of processes (one per core)")


@dataclass(frozen=True, kw_only=True)
class Evidence(Forced):
    """The options of `verify`, beside those of the function."""

    horizon: float | None = option(
        None,
        "how long doubles are meaningful, by an extended-precision run of at most S s (60)",
        "s",
        alone=60.0,
        count="?",
        check=check_time,
    )
    save: Path | None = option(
        None,
        "write the report beside the module, in DIR (generated)",
        value="DIR",
        alone=Path("generated"),
        count="?",
    )


@dataclass(frozen=True, kw_only=True)
class Halves(InFolder):
    """The options of `accuracy`, beside those of the functions."""

    arithmetic: bool = option(False, "only rounding errors, no runs", apart="half")
    no_arithmetic: bool = option(False, "only runs, no rounding errors", apart="half")


@dataclass(frozen=True, kw_only=True)
class Costing(InFolder):
    """The options of `effects`, beside those of the function."""

    no_motion: bool = option(False, "do not compare motions")


@dataclass(frozen=True, kw_only=True)
class Matrices(Forced):
    """Where `linearise` writes."""

    output: Path | None = _file("write A and B to FILE.npz or FILE.csv")


@dataclass(frozen=True, kw_only=True)
class Boxes(Forced):
    """Where `certify` writes."""

    output: Path | None = _file("write all rows to FILE.csv or FILE.json")


@dataclass(frozen=True, kw_only=True)
class Generation(Forced):
    """The options of `generate`."""

    backend: str = option("numpy", "numpy, c or javascript")
    output: Path = option(
        Path("generated"), "folder of the modules", flag="-o --output", value="DIR"
    )
    all: bool = option(False, "all built-in scenes")
    check: bool = option(False, "report which modules are stale; write nothing")
    explain: bool = option(False, "say why the route was chosen, and what each line computes")
    report: bool = option(False, "say what each pass saved")


def add_formats(parser: argparse.ArgumentParser) -> None:
    """The formats of `export`."""
    group = parser.add_mutually_exclusive_group(required=True)
    for name, found in FORMATS.items():
        flag = f"--{name.replace('_', '-')}"
        group.add_argument(flag, dest="format", action="store_const", const=name, help=found.about)


@dataclass(frozen=True, kw_only=True)
class Derivation(Forced):
    """The options of `derive`."""

    format: str | None = option(
        None,
        "what is written (by the ending of FILE, .html or .tex; else text)",
        choices=("text", "latex", "html"),
    )
    state_form: str | None = option(
        None,
        "state whose time derivative is written out: [q, v]; the handout's 8 numbers, or 12",
        flag="--form",
        choices=FORMS,
    )
    detail: str = option(
        "steps",
        "summary: the equations and their solution; steps: all that leads to them; all: forces in "
        "joints and constraints, too, and other ways to write the equations",
        choices=DETAILS,
    )
    method: str | None = option(
        None,
        "how the equations are derived: from free bodies, from energies, in the partial "
        "velocities, or by all of these side by side (by what suits the mechanism)",
        choices=(*METHODS, "all"),
    )
    exercise: bool = option(
        False, "questions on the results, in HTML with fields that check answers"
    )
    solutions: bool = option(False, "with --exercise: the answers")
    seed: int = option(
        0, "with --exercise: chooses the questions, their numbers, and how arms lie", value="N"
    )
    output: Path | None = _file("write it to a file")


@dataclass(frozen=True, kw_only=True)
class Check(Forced):
    """The options of `check`."""

    long: bool = option(False, "do not shorten long lists")
    identifiable: Sequence[str] | None = option(
        None,
        "print the base parameters, which torques and motions of joints tell; and of these states "
        "and outputs, which parameters they tell",
        value="A,B,…",
        read=names_in,
        alone=(),
        count="?",
    )
    assemble: bool = option(False, "print how the start of a mechanism with loops fits")
    picture: Path | None = option(None, "draw the start (png, pdf, svg)", value="FILE")


@dataclass(frozen=True, kw_only=True)
class Imported(Forced):
    """The options of `import`."""

    robot: Path | None = option(None, "file, .urdf, .xml or .mjcf", flag="ROBOT", value="FILE")
    output: Path | None = _file("the scene (NAME.toml, the robot's name)")
    floating: bool = option(
        False, "let the root link of a URDF move freely; else it is fixed to the world"
    )
    stops: bool = option(
        False, "make rigid stops of the limits of a URDF's joints, which are else reported"
    )
    contacts: bool = option(
        False, "let collision geometry touch the ground: planes of an MJCF file, else z = 0"
    )
    self_contacts: bool = option(
        False, "let collision geometry touch the ground, itself and fixed obstacles"
    )
    allow: Sequence[Path] = option(
        (),
        "also read meshes and included files in this folder; else only beside ROBOT",
        value="DIR",
        count="many",
    )


@dataclass(frozen=True, kw_only=True)
class New(Forced):
    """The options of `new`."""

    name: Path | None = option(None, "the scene is written to NAME.toml", flag="NAME", value="FILE")


@dataclass(frozen=True, kw_only=True)
class Copy(Forced):
    """The options of `copy`."""

    name: Path | None = option(
        None, "the copy is NAME.toml (the scene's)", flag="NAME", value="FILE", count="?"
    )


@dataclass(frozen=True, kw_only=True)
class Shell:
    """The argument of `completion`."""

    shell: str = option(None, "bash, zsh or fish", flag="SHELL", choices=("bash", "zsh", "fish"))


@dataclass(frozen=True, kw_only=True)
class Type:
    """The argument of `reference`."""

    type: str | None = option(None, "one joint or effect, drag for example", flag="TYPE", count="?")
