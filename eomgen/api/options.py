"""The options of the public functions, each with what a user reads of it, here and nowhere else.

Commands have the same records; `eomgen.commands.options` has what these alone take.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field
from os import PathLike
from typing import TYPE_CHECKING, Any, Literal

from eomgen.base.errors import RunError
from eomgen.base.options import about, flag_of, option, options_of
from eomgen.tables.routes import ROUTES

if TYPE_CHECKING:
    from eomgen.api.controllers import Controllers
    from eomgen.api.given import Outputs, Source, Values
    from eomgen.api.inputs import Inputs
    from eomgen.api.runs import Run
    from eomgen.exports import Number
    from eomgen.fitting.logs import Data
    from eomgen.results.design import Design, Law
    from eomgen.run.problem import FloatArray
    from eomgen.run.tally import Follow
    from eomgen.scene.schema import Form, Route

GuardMode = Literal["stop", "repair"]
Backend = Literal["auto", "numpy", "c"]
BACKENDS: tuple[Backend, ...] = ("auto", "numpy", "c")
Place = Literal["equilibrium", "rest", "initial"]
OWN = "the scene's own"
FORMS = ("velocity", "momentum", "redundant")
MOST_STATES = 100_000
"""Greatest number of random states of each kind."""


def check_time(value: float, argument: str) -> None:
    """Raise `RunError` unless a time, s, is positive and finite."""
    if not 0 < value < math.inf:
        raise RunError(f"{argument}: {value:g} is not a positive time; give one in s")


def check_seed(value: int, argument: str) -> None:
    """Raise `RunError` for a negative seed."""
    if value < 0:
        raise RunError(f"{argument}: {value} is negative; give 0, 1, 2, …")


def at_most(most: int) -> Callable[[int, str], None]:
    """A check that a number is from 1 to `most`."""

    def check(value: int, argument: str) -> None:
        if not 1 <= value <= most:
            raise RunError(f"{argument}: {value} is not a number from 1 to {most}")

    return check


def check_workers(value: int, argument: str) -> None:
    """Raise `RunError` for a number of processes below one."""
    if value < 1:
        raise RunError(f"{argument}: {value} is not a number of processes; give 1 or more")


def check_bound(value: float, argument: str) -> None:
    """Raise `RunError` for a bound of errors, in ulps, that no result meets."""
    if not 0.5 <= value < math.inf:
        raise RunError(f"{argument}: {value:g} ulps is not a bound; give 0.5 or more")


def check_radius(value: float, argument: str) -> None:
    """Raise `RunError` for a radius that no box has."""
    if not 0 < value < math.inf:
        raise RunError(f"{argument}: {value:g} is not a positive radius")


def check_rows(value: int, argument: str) -> None:
    """Raise `RunError` for a number of rows without a first and a last."""
    if not 2 <= value <= MOST_STATES:
        raise RunError(f"{argument}: {value} is not a number of rows from 2 to {MOST_STATES}")


def names_in(text: str) -> tuple[str, ...]:
    """The names in a text, between commas."""
    return tuple(filter(None, (word.strip() for word in text.split(","))))


def outputs_in(text: str) -> "Outputs":
    """The outputs in a text, between commas, or all."""
    return "all" if text == "all" else [name.strip() for name in text.split(",")]


def seconds_in(text: str) -> float:
    """A time such as 2s, 500ms, 1.5min or 2, in s. Raises `RunError` for anything else."""
    number = text.strip()
    unit = next((word for word in ("ms", "min", "s") if number.endswith(word)), "")
    try:
        value = float(number.removesuffix(unit)) * {"ms": 1e-3, "min": 60.0}.get(unit, 1.0)
    except ValueError:
        value = math.nan
    if not 0 < value < math.inf:
        raise RunError(f"--budget {text}: is not a computing time; give e.g. 2s, 500ms or 1.5min")
    return value


VARYING = (
    "an input: a number or a formula of t, 'push=3*sin(t)'; or FILE.csv with columns t and names, "
    "between whose times inputs are linear"
)


def _inputs(words: str, help: str = VARYING) -> Any:
    return option(None, words, help=help, flag="--input", value="NAME=X")


@dataclass(frozen=True, kw_only=True)
class Forced:
    """Whether files are overwritten."""

    force: bool = option(False, "also overwrite files that eomgen did not write")


@dataclass(frozen=True, kw_only=True)
class Routed:
    """The route to the equations."""

    route: "Route | None" = option(
        None,
        "route, the algorithm that gives the accelerations; auto is the one with the fewest "
        "operations that is accurate enough",
        none=OWN,
        choices=("auto", *ROUTES),
    )


@dataclass(frozen=True, kw_only=True)
class Formed(Routed):
    """The equations that are taken of a scene."""

    form: "Form | None" = option(None, "state form", none=OWN, choices=FORMS)


@dataclass(frozen=True, kw_only=True)
class Constants:
    """Parameters."""

    parameters: "Values | None" = option(
        None,
        "values that replace those of the scene, by name",
        help="value of a parameter",
        flag="--set",
        value="NAME=X",
    )


@dataclass(frozen=True, kw_only=True)
class Started:
    """The state at the start."""

    state: "Values | None" = option(
        None,
        "values that replace those of the scene's initial state, by name; `<name>_deg` in degrees",
        help="value of a state at the start; NAME_deg in degrees (the scene's initial state)",
        value="NAME=X",
    )


@dataclass(frozen=True, kw_only=True)
class Method(Constants):
    """The method of a run, and how far it goes."""

    t_end: float | None = option(None, "end time", "s", OWN, check=check_time)
    integrator: str | None = option(None, "name of the method", none=OWN)
    dt: float | None = option(None, "step of a fixed-step method", "s", OWN)
    rtol: float | None = option(None, "relative tolerance of an adaptive method", none=OWN)
    atol: float | None = option(None, "absolute tolerance of an adaptive method", none=OWN)
    max_step: float | None = option(None, "longest step of an adaptive method", "s")
    unstable: bool = option(
        False, "allow steps of an explicit fixed-step method that are too long for stability"
    )


@dataclass(frozen=True)
class RunOptions(Method, Started, Formed):
    """The options of `simulate`."""

    source: "Source"
    _: KW_ONLY
    accuracy: float | None = option(
        None,
        "choose method and tolerances so that the error of the last state, relative to the "
        "scale of the motion, is below this; they are found by trial runs of this scene",
        help="choose method and tolerances for an error of X at the end, relative to the motion",
    )
    budget: float | None = option(
        None,
        "choose the most accurate run of about this time, s",
        help="choose the most accurate run of about this time, 2s for example",
        value="TIME",
        read=seconds_in,
    )
    inputs: "Inputs | None" = _inputs(
        "a mapping by name: constants; formulas of t, the motion and parameters, for example "
        '"3*sin(t)", which become part of the module; or functions of t. Or a DataFrame, or '
        "the path of a table of comma-separated values, with a column t and one for each "
        "input, and any others; between these times inputs are linear. With tables and "
        "functions nothing is compiled. Inputs that are not given have their defaults"
    )
    controllers: "Controllers" = option(
        (),
        "controllers that sample: tables as those of an effect `sampled_controller`, or "
        "`eomgen.Controller(...)` of a function; their inputs are held between samples",
        flag=None,
    )
    samples: int = option(1001, "approximate number of rows to keep")
    works: bool = option(False, "also compute the work of each effect, J")
    save: Sequence[str] = option(
        (),
        "what to save beside the states: energy, points, poses, works, inputs, or outputs by "
        "name, for example joint_forces",
        value="A,B,…",
        read=names_in,
    )
    guard: GuardMode | None = option(
        None,
        "check rounding errors at each step; where digits are lost, stop the run or repair the "
        "step. By default runs stop there of scenes that may have fewer than 6 digits of "
        "accelerations right, unless inputs are tables or functions",
        choices=("stop", "repair"),
        alone="stop",
        count="?",
    )
    estimate: bool = option(False, "estimate the error by a second run")
    resume: "str | PathLike[str] | Run | None" = option(
        None,
        "continue an earlier run as if it had not ended: a `Run`, or its archive",
        help="continue an earlier run as if it had not ended",
        flag="--from",
        value="FILE.npz",
    )
    backend: Backend = option(
        "auto",
        '"numpy": compute all in Python; "c": compute the derivative, the Jacobian and what '
        "else the run evaluates in compiled C code, with the same bits, and make whole steps "
        'of DOP853, rk4, euler and semi_implicit_euler there; "auto": do so if a library is '
        "in the store, or if the run is longer than compiling takes and there is a compiler",
        help="auto: compute in compiled C code if that pays; numpy: never; c: always",
        value="NAME",
        choices=BACKENDS,
    )
    follow: "Follow | None" = option(
        None, "called with time and state after each step; a true result stops the run", flag=None
    )


@dataclass(frozen=True)
class SweepOptions(Method):
    """The options of `ensemble`."""

    source: "Source"
    vary: "Design | Mapping[str, Sequence[float] | FloatArray]" = field(
        metadata=about(
            "lists of values by name of a parameter, a state or an input, one for each run, a "
            "member of the sweep, `<name>_deg` of an angle in degrees; or `grid(...)` or "
            "`sampled(...)`",
            flag=None,
        )
    )
    _: KW_ONLY
    inputs: "Inputs | None" = _inputs(
        "values that all members have; also formulas of t, the motion and parameters, or the "
        "path of a table, as for `simulate`; with a table nothing is compiled"
    )
    controllers: "Controllers" = option(
        (), "controllers that sample, as for `simulate`; tables alone, no functions", flag=None
    )
    outputs: Sequence[str] = option(
        (),
        "functions of the module to compute, kinetic_energy for example",
        value="A,B,…",
        read=outputs_in,
    )
    samples: int = option(
        2, "approximate number of rows to keep; 2 keeps only the first and the last"
    )
    backend: Backend = option(
        "auto",
        '"numpy": run in Python; "c": compile at once; "auto": compile if that pays',
        help="auto: compute in compiled C code if that pays; numpy: never; c: always",
        value="NAME",
        choices=BACKENDS,
    )
    workers: int = option(
        1,
        "number of processes, or threads if members run together in compiled code. With more "
        'than one, a script needs `if __name__ == "__main__":`',
        check=check_workers,
    )
    scheduler: str = option(
        "",
        "address of a Dask scheduler whose workers run the members",
        value="ADDRESS",
    )
    folder: "str | PathLike[str] | None" = option(
        None,
        "where finished members are kept, so that the same call continues a stopped sweep",
        flag=None,
    )


@dataclass(frozen=True)
class AccuracyOptions(Constants, Formed):
    """The options of `accuracy`."""

    source: "Source"
    _: KW_ONLY
    methods: Sequence[str] | None = option(
        None,
        "only these integrators",
        none="all",
        value="A,B,…",
        read=names_in,
    )
    quick: bool = option(False, "only every second tolerance or step")
    t_end: float | None = option(None, "end time", "s", OWN, check=check_time)
    run_time: float = option(3.0, "longest time of one run", "s", check=check_time)
    time: float = option(
        300.0,
        "time after which no run is started",
        "s",
        check=check_time,
    )
    inputs: "Inputs | None" = _inputs(
        "by name constant values, or formulas of t, the motion and parameters; or the path of "
        "a table, as for `simulate`. Others have their defaults"
    )
    table: "str | PathLike[str] | None" = option(
        None,
        "a CSV file to which runs are written and, unless `fresh`, from which earlier runs "
        "are taken",
        flag=None,
    )
    fresh: bool = option(False, "do not use runs of earlier calls")
    backend: Backend = option(
        "numpy",
        '"numpy": make the runs in Python; "c": in compiled C code, as `simulate` makes long ones',
        help="numpy: make the runs in Python; c: in compiled C code",
        value="NAME",
        choices=("numpy", "c"),
    )


@dataclass(frozen=True)
class ArithmeticOptions(Constants):
    """The options of `arithmetic`."""

    source: "Source"
    _: KW_ONLY
    states: int | None = option(
        None,
        "number of states of each kind",
        none="as many as are quick",
        help="states of each kind for rounding errors (100, 20 if large)",
        check=at_most(MOST_STATES),
    )
    seed: int = option(0, "seed of the random states", check=check_seed)
    single: bool = option(
        False, "also in float32", help="also rounding errors of float32", flag="--float32"
    )


@dataclass(frozen=True)
class VerifyOptions:
    """The options of `verify`."""

    source: "Source"
    _: KW_ONLY
    states: int | None = option(
        None,
        "number of states of each kind",
        none="as many as are quick",
        help="states of each kind (8, 2 if there are many)",
        check=at_most(10_000),
    )
    seed: int = option(0, "seed of the random states", check=check_seed)
    bound: float | None = option(
        None,
        "greatest error of v̇, units in the last place",
        none="the effect of errors of half a unit in the data",
        help="greatest error of v̇ (what the data allow)",
        value="ULPS",
        check=check_bound,
    )
    inputs: "Inputs | None" = _inputs(
        "constants, formulas or a table in place of inputs, as for `simulate`; others are "
        "sampled, and 0 in the run that the scene describes"
    )


@dataclass(frozen=True)
class EffectsOptions(Routed):
    """The options of `effects`."""

    source: "Source"
    _: KW_ONLY
    each: bool = option(
        False,
        "each effect separately, not all of a type together",
        help="a line for each effect instead of each type",
    )
    motion: float | None = option(
        10.0,
        "length of the motions that are compared",
        "s",
        "motions are not compared",
        help="length of the motions that are compared, s",
        flag="--motion-time",
        check=check_time,
    )
    inputs: "Inputs | None" = _inputs(
        "constants, formulas or a table in place of inputs, as for `simulate`; others are 0"
    )


@dataclass(frozen=True)
class PointOptions(Started, Constants):
    """The options of `linearise`."""

    source: "Source"
    _: KW_ONLY
    at: Place = option(
        "equilibrium",
        '"equilibrium": the nearest one, stable or not; "rest": where the motion comes to '
        'rest; "initial": the given state, which may move',
        help="about the nearest equilibrium, the state where it comes to rest, or the given state",
        choices=("equilibrium", "rest", "initial"),
    )
    inputs: "Inputs | None" = _inputs(
        "constant values, by name; others are 0", "constant value of an input"
    )
    hold: Sequence[str] = option(
        (),
        "coordinates that keep their values while an equilibrium is searched for",
        help="a coordinate that keeps its value while an equilibrium is searched for",
        value="NAME",
        count="many",
    )
    trim: Sequence[str] = option(
        (),
        "inputs whose values are searched for as well",
        help="an input whose value is searched for as well",
        value="INPUT",
        count="many",
    )


@dataclass(frozen=True)
class FitOptions(Started, Constants):
    """The options of `fit`."""

    source: "Source"
    data: "Data | Sequence[Data]" = field(
        metadata=about(
            "an experiment, or a list of several: the path of a table of comma-separated values, "
            "a DataFrame, or a mapping, with a column t, states (angles in degrees as "
            "`<name>_deg`) and outputs by name, for example `point_positions.tip.x`, and inputs, "
            "which are linear between samples. Missing samples are nan, or empty; other columns "
            "are left out",
            flag=None,
        )
    )
    names: str | Sequence[str] = field(
        metadata=about(
            "what is fitted: parameters, and states at the start of each experiment", flag=None
        )
    )
    _: KW_ONLY
    measured: Sequence[str] = option(
        (),
        "the measured columns that are fitted to; (): all",
        help="the measured columns that are fitted to (all)",
        value="A,B,…",
        read=names_in,
    )
    bounds: "Mapping[str, tuple[float, float]] | None" = option(
        None,
        "the least and the greatest value, by name",
        help="the least and the greatest value of what is fitted",
        flag="--bound",
        value="NAME=LOW:HIGH",
        count="many",
    )
    priors: "Mapping[str, tuple[float, float]] | None" = option(
        None,
        "what is known before, by name: a mean and its standard deviation",
        help="what is known before: a mean and its standard deviation",
        flag="--prior",
        value="NAME=MEAN:DEVIATION",
        count="many",
    )
    noise: "Values | None" = option(
        None,
        "standard deviations of the noise of measured columns, by name; others are estimated from "
        "the residuals",
        help="standard deviation of the noise of a column (estimated from the residuals)",
        value="NAME=X",
        count="many",
    )
    inputs: "Inputs | None" = _inputs(
        "constant values of inputs that are not in the data, by name; others have their defaults",
        "constant value of an input that is not in the data",
    )
    rtol: float = option(1e-8, "relative tolerance of the motion and its sensitivities")
    backend: Backend = option(
        "auto",
        '"c": compute motions in compiled C code; "numpy": in Python, with the same bits; "auto": '
        "compile if that pays",
        help="auto: compute in compiled C code if that pays; numpy: never; c: always",
        value="NAME",
        choices=BACKENDS,
    )


@dataclass(frozen=True)
class CertifyOptions(Started, Constants):
    """The options of `certify`."""

    source: "Source | Run"
    _: KW_ONLY
    tolerance: float = option(
        1e-9, "greatest radius of a state, in its SI unit", check=check_radius
    )
    t_end: float | None = option(None, "end time", "s", OWN, check=check_time)
    samples: int = option(101, "number of rows", check=check_rows)
    inputs: "Inputs | None" = _inputs(
        "constant values, by name; others have their defaults", "constant value of an input"
    )
    uncertain: "Values | None" = option(
        None,
        "how far parameters, or states at the start, may lie from their values, by name: the "
        "boxes hold all of these motions",
        help="how far a parameter, or a state at the start, may lie from its value",
        value="NAME=X",
        count="many",
    )


@dataclass(frozen=True)
class SpaceOptions(PointOptions):
    """The options of `state_space`."""

    _: KW_ONLY
    outputs: Sequence[str] = option(
        (),
        'states, outputs of the module or their components, by name, for example "theta", '
        '"point_positions.tip.x" or "kinetic_energy"; (): all states',
    )
    period: float | None = option(
        None,
        "time between samples, with inputs held: the system is x⁺ = A x + B u then",
        unit="s",
        none="continuous time",
        check=check_time,
    )


@dataclass(frozen=True)
class ExportOptions(Formed, Forced):
    """The options of `export`."""

    source: "Source"
    format: str = field(metadata=about("a name in `exports.FORMATS`", flag=None))
    path: "str | PathLike[str] | None" = option(
        None,
        "the file, or the folder of a format of several files",
        none="the scene's name, in the current folder",
        flag="-o --output",
        value="PATH",
    )
    _: KW_ONLY
    outputs: "Outputs | None" = option(
        None,
        "functions beside those that the format needs",
        none=OWN,
        value="A,B,…",
        read=outputs_in,
    )
    number: "Number" = option(
        "double",
        'type of numbers in C, "double" or "float", where the format has a choice',
        help="numbers in C are float, not double",
        flag="--float",
        alone="float",
    )
    integrator: str = option(
        "",
        'method of steps, of those that compiled code has; "" for the format\'s own',
        help="method of steps (DOP853; rk4)",
    )


@dataclass(frozen=True)
class EnvironmentOptions:
    """The options of `environment`."""

    source: "Source"
    reward: str = field(
        metadata=about("formula of t, states, inputs and parameters, after each step")
    )
    _: KW_ONLY
    actions: "Mapping[str, tuple[float, float]]" = field(
        metadata=about("the inputs that are set, with their bounds; what is beyond them is cut")
    )
    observe: Sequence[str] = option((), "formulas that are observed; (): all states")
    ended: str = option(
        "0", 'formula that is not 0 where an episode has failed, for example "abs(theta) > 0.2"'
    )
    start: "Mapping[str, Law | tuple[str, float, float]] | None" = option(
        None,
        "distributions of states at the beginning, as those of `sampled`; others have the "
        "values of the scene",
    )
    dt: float = option(
        0.02,
        "length of a step, s; it is made by `parts` steps of the classical Runge-Kutta "
        "method, in compiled code if there is a compiler, see `stepper`",
    )
    parts: int = option(4, "number of these steps")
    t_end: float = option(10.0, "time after which an episode is cut off", "s")
    lanes: int | None = option(
        None, "number of environments that step together", none="a single one"
    )


RECORDS = (
    RunOptions,
    SweepOptions,
    AccuracyOptions,
    ArithmeticOptions,
    VerifyOptions,
    EffectsOptions,
    PointOptions,
    FitOptions,
    ExportOptions,
)
"""The records of which commands take options."""
FLAGS = {each.name: flag_of(each) for record in RECORDS for each in options_of(record)}
"""The flags of options on the command line, by their names; "" for those that have none there."""


def as_flag(name: str) -> str:
    """What messages of the command line call an argument."""
    flags = FLAGS.get(name, "").split()
    return flags[-1] if flags else f"--{name.replace('_', '-')}"
