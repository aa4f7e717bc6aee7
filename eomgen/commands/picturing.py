"""The commands `plot` and `film`."""

from pathlib import Path

from eomgen.api.options import RunOptions
from eomgen.api.planning import plan_run
from eomgen.api.reopening import load_run
from eomgen.api.runs import Run
from eomgen.api.simulating import run_plan
from eomgen.base.errors import RunError
from eomgen.base.files import check_folder
from eomgen.commands.shared import (
    Arguments,
    assignments,
    print_wrapped,
    read_whole,
    reporter_of,
)
from eomgen.commands.usage import taken
from eomgen.run.progress import terminal_notice, terminal_progress
from eomgen.show.filming import FilmOptions

SAVED = (".npz", ".csv")
"""Suffixes of files that `simulate` writes and from which a run comes back."""
FOLDER = Path("out")
ROWS, MANY = 1001, 20_001
"""Rows that are kept of a scene that is simulated here: usually, and for a section."""


def plot(given: Arguments) -> int:
    """Draw a figure of a run, and write it."""
    from eomgen.show.plotting import Wanted, names_of, plotted
    from eomgen.show.style import check_figure, write_figure

    target = _target(given, "_plot.png")
    check_figure(target, force=given.force)
    if (given.times or given.count != 8) and not given.strobe:
        raise RunError("--times and --count are for --strobe; add it")
    wanted = Wanted(
        of=names_of(given.of),
        phase=names_of(given.phase),
        poincare=names_of(given.poincare),
        at=given.at,
        direction=given.direction,
        strobe=(_times(given.times) or given.count or -1) if given.strobe else 0,
        size=given.size,
    )
    run = _run_of(given)
    with terminal_notice(f"drawing {run.model.name} …"):
        made = plotted(run.trajectory, run.motion, wanted, "--{}".format)
        write_figure(made.figure, target, force=given.force, paper=True)
    width, height = (25.4 * inches for inches in made.figure.get_size_inches())
    print(f"{run.model.name}: a figure of {width:.0f} x {height:.0f} mm")
    if made.note:
        print_wrapped("    ", made.note)
    print(f"    wrote {target}")
    return 0


def film(given: Arguments) -> int:
    """Make a film of a run, and write it."""
    from eomgen.show.film import check_film, pixels_of
    from eomgen.show.plotting import filmed

    target = _target(given, ".gif")
    check_film(target, force=given.force)
    if given.size:
        pixels_of(given.size, "--size")
    run = _run_of(given)
    with terminal_progress(f"filming {run.model.name}") as progress:
        options = taken(FilmOptions, given)
        made = filmed(run.trajectory, run.motion, target, options, progress)
    size = f"{made.size[0]} x {made.size[1]} pixels"
    lasts = made.frames / made.fps
    print(f"{run.model.name}: {made.frames} frames of {size}, {lasts:.3g} s at {made.fps:.4g} fps")
    print(f"    wrote {target}")
    return 0


def _target(given: Arguments, ending: str) -> Path:
    """Where the picture is written; makes the folder."""
    path: Path = given.output or FOLDER / f"{Path(given.scene).stem}{ending}"
    check_folder(path.parent)
    return path


def _run_of(given: Arguments) -> Run:
    """The run in a file, or that of a scene, which is simulated."""
    if Path(given.scene).suffix.lower() in SAVED:
        if given.t_end is not None or given.parameters or given.samples is not None:
            raise RunError(
                f"--t-end, --samples, --set: are for a scene, and {given.scene} is a run; drop them"
            )
        return load_run(given.scene)
    reporter = reporter_of(given, given.scene)
    scene, model, _ = read_whole(given.scene, given)
    options = taken(
        RunOptions,
        given,
        source=scene,
        parameters=assignments(given.parameters, model.defaults, "--set"),
        samples=given.samples or (MANY if getattr(given, "poincare", "") else ROWS),
    )
    run = run_plan(plan_run(scene, model, options, reporter=reporter), reporter=reporter)
    if not run.finished:
        raise RunError(f"{run.model.name}: {run.message}")
    print(f"{run.model.name}: simulated {run.t[-1]:g} s by {run.trajectory.integrator}")
    return run


def _times(text: str) -> tuple[float, ...]:
    """The times of `--times`. Raises `RunError` for a text that is none."""
    try:
        return tuple(float(word) for word in text.split(",") if word.strip())
    except ValueError:
        raise RunError(f"--times {text}: are no times; give seconds such as 0,0.5,1") from None
