"""The result of a simulation, which can be pickled, plotted, and displayed in a notebook."""

from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import DTypeLike, NDArray

from eomgen.base.options import about, taking
from eomgen.language.base import identifier
from eomgen.results.labelled import dataframe, dataset, units_of
from eomgen.results.simulated import Simulated
from eomgen.run.limits import Excursion, excursions
from eomgen.run.problem import FloatArray
from eomgen.run.trajectory import save_csv, save_npz
from eomgen.show.filming import FilmOptions
from eomgen.study.diagnosis import joint_limits, locks
from eomgen.study.recording import FOLLOWING

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame
    from xarray import Dataset

    from eomgen.run.progress import Progress
    from eomgen.show.balance import Imbalance
    from eomgen.show.motion import Motion
    from eomgen.show.notebook import Cell
    from eomgen.show.page import PageCode
    from eomgen.study.accuracy.estimate import Estimate
    from eomgen.study.accuracy.search import Choice
    from eomgen.study.between import Direction


@dataclass(frozen=True)
class Filming(FilmOptions):
    """What `Run.film` takes."""

    run: "Run"
    path: str | Path
    _: KW_ONLY
    progress: "Progress | None" = field(
        default=None, metadata=about("called with the fraction done")
    )


@taking(Filming)
def film(options: Filming) -> Path:
    """Write a film, .gif or, where the program ffmpeg is, .mp4; return its path.

    Raises `RunError` for another suffix, without ffmpeg, or if the file exists and this program
    did not write it.
    """
    from eomgen.show.plotting import filmed

    run, path = options.run, Path(options.path)
    return filmed(run.trajectory, run.motion, path, options, options.progress).path


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class Run(Simulated):
    """The result of a simulation.

    model       the mechanism, with the parameters of the run
    module      the module that was integrated
    trajectory  times, states, counts, events
    motion      poses and energies along the trajectory
    options     command-line options that give the same run
    error       estimated error of the last state relative to the motion's scale; nan if none
    warnings    warnings for the user
    choice      the choice of method and tolerances, if `accuracy` or `budget` was given
    estimate    the estimate of the error by a second run, if asked for
    begun       how it continues an earlier run; "" if it does not
    compiled    whether steps were made, or functions computed, in compiled code
    simulation  settings of the scene
    inputs      constant inputs that are not their defaults
    varying     whether inputs were tables or functions of time
    """

    shown = (
        "states",
        "t",
        "y",
        "finished",
        "message",
        "begun",
        "error",
        "saved",
        "excursions",
        "warnings",
        "options",
    )

    motion: "Motion"
    options: str
    error: float
    warnings: tuple[str, ...]
    choice: "Choice | None" = None
    estimate: "Estimate | None" = None
    begun: str = ""
    compiled: bool = False

    @property
    def energy(self) -> FloatArray:
        """Total mechanical energy, (n,), J."""
        return self.motion.kinetic_energy + self.motion.potential_energy

    @property
    def imbalance(self) -> "Imbalance | None":
        """The error of the energy balance; None where it is not defined."""
        from eomgen.show.balance import imbalance

        return imbalance(self.motion)

    @property
    def limits(self) -> Mapping[str, tuple[float, float]]:
        """Joint limits that no joint stop enforces, by coordinate."""
        return joint_limits(self.model)

    @property
    def excursions(self) -> tuple[Excursion, ...]:
        """The coordinates that exceeded these limits, and when."""
        return tuple(excursions(self.trajectory, self.limits))

    @property
    def locks(self) -> tuple[str, ...]:
        """Where a spatial mechanism came near gimbal lock, a line for each velocity."""
        return tuple(locks(self.model, self.trajectory))

    def __getitem__(self, state: str) -> FloatArray:
        """One state over time, (n,), or a coordinate or velocity that follows from the states.
        Raises `KeyError` for an unknown name.
        """
        state = identifier(state)
        following = self.trajectory.saved.get(FOLLOWING)
        if following and state in following.columns:
            return following.values[:, following.columns.index(state)]
        if state not in self.states:
            raise KeyError(f"no state '{state}'; known: {', '.join(self.states)}")
        return self.y[:, self.states.index(state)]

    def __array__(
        self, dtype: DTypeLike | None = None, copy: bool | None = None
    ) -> NDArray[np.generic]:
        """`y`, for `numpy.asarray(run)` and whatever else takes arrays."""
        return np.array(self.y, dtype=dtype, copy=copy)

    @property
    def report(self) -> Mapping[str, object]:
        """Counts, outcome, energies and error of the run, by name."""
        return {
            "t_end": float(self.t[-1]),
            "finished": self.finished,
            "message": self.message,
            **self.trajectory.counts,
            "energy_at_start": float(self.energy[0]),
            "energy_at_end": float(self.energy[-1]),
            "error": self.error,
            "options": self.options,
        }

    def figure(self) -> "Figure":
        """Poses, states and energies as a Matplotlib figure."""
        from eomgen.show.figure import draw_motion

        return draw_motion(self.motion)

    def page(self, *, live: bool | None = None) -> "PageCode":
        """The functions of the page of this run, in JavaScript: `show.page_code.page_code`."""
        from eomgen.show.page_code import page_code

        return page_code(self, self.motion, live=live)

    def plot(
        self,
        of: str | Sequence[str] = (),
        *,
        phase: str | Sequence[str] = (),
        poincare: str | Sequence[str] = (),
        at: str = "",
        direction: "Direction" = "rising",
        strobe: int | Sequence[float] = 0,
        size: str = "double",
    ) -> "Figure":
        """A figure for a paper, as Matplotlib's `Figure`.

        of        quantities against time: states, "energy", outputs and their components, as
                  "joint_forces.hinge.fx", effects, as "coil", "coil.force", "coil.power"; names,
                  or a text of names with commas, here and below
        phase     two quantities, one against the other
        poincare  two quantities where the motion passes `at`, one against the other; or one, each
                  value against the one before
        at        a condition on t, states and parameters, as "phi = 0"
        direction in which it is passed: "rising", "falling" or "both"
        strobe    the mechanism at these times, s, in one picture, or at so many equal times
        size      "single" or "double" for one column or two, or mm, as "120" or "120x80"

        Without any of them all coordinates are drawn. Raises `RunError` for an unknown name.
        """
        from eomgen.show.plotting import Wanted, names_of, plotted

        wanted = Wanted(
            names_of(of),
            names_of(phase),
            names_of(poincare),
            at,
            direction,
            strobe if isinstance(strobe, int) else tuple(strobe),
            size,
        )
        return plotted(self.trajectory, self.motion, wanted).figure

    film = film

    def save(
        self,
        folder: str | Path,
        *,
        parquet: bool = False,
        live: bool | None = None,
        force: bool = False,
    ) -> tuple[Path, ...]:
        """Write module, table, archive and page into a folder, with `parquet` also the table as a
        Parquet file; return their paths. The page is live as `page` says.

        Raises `RunError` if a file cannot be written, or exists and this program did not write it.
        """
        from eomgen.show.page import save_page

        base = Path(folder) / self.model.name
        paths = tuple(base.with_suffix(f".{kind}") for kind in ("py", "csv", "npz", "html"))
        module, table, archive, page = paths
        self.module.save(module, force=force)
        # Before the archive: a table is ours if the archive beside it has the same columns.
        save_csv(self.trajectory, table, force=force)
        save_npz(self.trajectory, archive, force=force)
        save_page(self.motion, self.page(live=live), page, force=force)
        if parquet:
            from eomgen.run.parquet import save_parquet

            save_parquet(self.trajectory, base.with_suffix(".parquet"), force=force)
            return (*paths, base.with_suffix(".parquet"))
        return paths

    @property
    def units(self) -> Mapping[str, str]:
        """The unit of each column of the table of the run, by name; without those of none."""
        both = (*self.model.coordinates, *self.model.velocities)
        following = {each.name: each.unit for each in both}
        of_states = dict(zip(self.motion.states, self.motion.units, strict=True))
        return units_of(self.trajectory, self.model, {**following, **of_states})

    def to_dataframe(self) -> "DataFrame":
        """States, works and what was saved as pandas' DataFrame over `t`: the columns of the table
        that `save` writes, their units in `attrs["units"]`. Raises `RunError` without pandas.
        """
        return dataframe(self.trajectory, self.units)

    def to_xarray(self) -> "Dataset":
        """The same as an xarray.Dataset over `t`, each variable with its attribute `units`. Raises
        `RunError` without xarray.
        """
        return dataset(self.trajectory, self.units)

    def view(self, *, height: int = 620, live: bool | None = None) -> "Cell":
        """The page of this run, for a cell of a notebook: `height` pixels high, and live as `page`
        says.
        """
        from eomgen.show.notebook import page_cell

        return page_cell(self.motion, self.page(live=live), height)

    def _repr_html_(self) -> str:
        from eomgen.show.notebook import run_html

        return run_html(self.motion, self.report, self.warnings)
