"""Results of the public functions, which can be pickled and displayed in a notebook."""

import html
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from eomgen.errors import SceneError
from eomgen.files import check_writable, write_whole
from eomgen.language.base import identifier
from eomgen.model.model import Model
from eomgen.run.limits import Excursion, excursions
from eomgen.run.problem import FloatArray
from eomgen.run.trajectory import Outcome, Trajectory, save_csv, save_npz
from eomgen.scene.schema import Simulation
from eomgen.study.diagnosis import joint_limits, locks

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from eomgen.derivation.matrices import Matrices
    from eomgen.derivation.steps import Step
    from eomgen.derivation.symbols import Expr
    from eomgen.exposition.derivation import Exposition
    from eomgen.program.passes import PassReport
    from eomgen.run.progress import Progress
    from eomgen.show.balance import Imbalance
    from eomgen.show.motion import Motion
    from eomgen.show.page import PageCode
    from eomgen.study.accuracy.estimate import Estimate
    from eomgen.study.accuracy.search import Choice
    from eomgen.study.between import Direction


NUMBERS = (
    "m = eomgen.load(eomgen.generate(scene, outputs=['mass_matrix', 'velocity_force', "
    "'gravity_force', 'applied_force'])); y = m.initial_state(); m.mass_matrix(0.0, y), "
    "m.velocity_force(0.0, y), m.gravity_force(0.0, y), m.applied_force(0.0, y)"
)
"""How to compute M, V, G and F of a `scene` where they are not written out."""


@dataclass(frozen=True)
class Derivation:
    """Equations of motion M v̇ + V + G = F as SymPy expressions, and the steps of their derivation.

    `matrices` has the equations and the symbols of coordinates `q`, velocities `v` and
    accelerations `a`. A mechanism whose steps are those of an algorithm has none; the functions
    `mass_matrix`, `velocity_force`, `gravity_force`, `applied_force` of its module give numbers.
    """

    model: Model
    exposition: "Exposition"

    @property
    def name(self) -> str:
        """Name of the scene."""
        return self.model.name

    @property
    def title(self) -> str:
        """Title of the scene."""
        return self.model.title

    @property
    def matrices(self) -> "Matrices":
        """The equations as matrices. Raises `SceneError` if they are too long to be written out."""
        if self.exposition.matrices is None:
            raise SceneError(
                f"derive: M, V, G and F of {self.name} are too long to be written out as "
                f"expressions; a module computes their numbers: `{NUMBERS}`"
            )
        return self.exposition.matrices

    @property
    def M(self) -> "Expr":
        """Mass matrix, (nv, nv), symmetric."""
        return self.matrices.M

    @property
    def V(self) -> "Expr":
        """Velocity-dependent forces (Coriolis and centrifugal), (nv, 1), on the left side."""
        return self.matrices.V

    @property
    def G(self) -> "Expr":
        """Gravity forces, (nv, 1), on the left side."""
        return self.matrices.G

    @property
    def F(self) -> "Expr":
        """All other generalised forces, (nv, 1), on the right side."""
        return self.matrices.F

    @property
    def solution(self) -> "dict[Expr, Expr]":
        """Each acceleration as an expression in q, v, parameters and inputs."""
        from eomgen.derivation.matrices import written_out

        found = self.matrices
        return {a: written_out(a, found.definitions) for a in found.a}

    @property
    def steps(self) -> "tuple[Step, ...]":
        """The steps of the derivation, with number, title, explanation and equations."""
        return self.exposition.steps

    def text(self, *, encoding: str = "utf-8") -> str:
        """All steps as plain text, in ASCII if the encoding lacks Greek letters."""
        from eomgen.show.derivation import as_text

        return as_text(self.model, self.steps, encoding=encoding)

    def latex(self) -> str:
        """All steps as one LaTeX document."""
        from eomgen.show.derivation import as_latex

        return as_latex(self.model, self.steps, self.exposition.effects)

    def html(self) -> str:
        """All steps as one HTML page."""
        from eomgen.show.derivation import as_html

        return as_html(self.model, self.steps, self.exposition.effects)

    def _repr_latex_(self) -> str:
        import sympy as sp

        if self.exposition.matrices is None:
            steps = f"M v̇ + V + G = F in {len(self.steps)} steps"
            return f"$\\text{{{steps}}}$"
        found = self.matrices
        left = sp.latex(found.M) + sp.latex(sp.Matrix(found.a))
        rest = " + ".join(sp.latex(m) for m in (found.V, found.G))
        return f"$\\displaystyle {left} + {rest} = {sp.latex(found.F)}$"


@dataclass(frozen=True)
class Module:
    """A generated module.

    name         name of the scene
    source       source code
    explanation  a line for each route, with its operations and which was chosen
    notices      notices for the user
    reports      steps and operations of the program after each optimisation pass
    derived      whether it was derived now; else it comes from the store
    backend      name of the backend that wrote it
    others       contents of further files of the backend, by name
    library      sources of its shared library by name, if it is to be compiled and loaded
    reference    source of the Python module that a compiled one falls back on; "" without one
    """

    name: str
    source: str
    explanation: tuple[str, ...]
    notices: tuple[str, ...]
    reports: "tuple[PassReport, ...]" = ()
    derived: bool = field(default=True, compare=False)
    backend: str = "numpy"
    others: Mapping[str, str] = field(default_factory=dict)
    library: Mapping[str, str] = field(default_factory=dict, compare=False)
    reference: str = field(default="", compare=False)

    def save(self, path: str | Path, *, force: bool = False) -> None:
        """Write the file, and further files beside it, each atomically.

        Raises `RunError` if a file exists that this program did not write, unless `force`.
        """
        for name in self.others:
            check_writable(Path(path).with_name(name), force=force)
        write_whole(Path(path), self.source, force=force)
        for name, text in self.others.items():
            write_whole(Path(path).with_name(name), text, force=force)

    def _repr_html_(self) -> str:
        lines = "\n".join(self.explanation)
        return f"<b>{html.escape(self.name)}.py</b><pre>{html.escape(lines)}</pre>"


@dataclass(frozen=True, eq=False)
class Run:
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

    model: Model
    module: Module
    trajectory: Trajectory
    motion: "Motion"
    options: str
    error: float
    warnings: tuple[str, ...]
    choice: "Choice | None" = None
    estimate: "Estimate | None" = None
    begun: str = ""
    compiled: bool = False
    simulation: Simulation = field(default_factory=Simulation)
    inputs: Mapping[str, float] = field(default_factory=dict)
    varying: bool = False

    @property
    def t(self) -> FloatArray:
        """Times, (n,), s."""
        return self.trajectory.t

    @property
    def y(self) -> FloatArray:
        """States, (n, ny), SI units, in the order of `states`."""
        return self.trajectory.y

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the states."""
        return self.trajectory.states

    @property
    def finished(self) -> bool:
        """Whether the run reached its end time."""
        return self.trajectory.finished

    @property
    def outcome(self) -> Outcome:
        """How the run ended: kind, reason, and what to change."""
        return self.trajectory.outcome

    @property
    def message(self) -> str:
        """Why the run ended early, and what to change; "" if there is nothing to report."""
        return self.trajectory.message

    @property
    def energy(self) -> FloatArray:
        """Total mechanical energy, (n,), J."""
        return self.motion.kinetic_energy + self.motion.potential_energy

    @property
    def saved(self) -> Mapping[str, FloatArray]:
        """What `save` asked for, (n, …) each, by output."""
        return {name: each.values for name, each in self.trajectory.saved.items()}

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
        """One state over time, (n,). Raises `KeyError` for an unknown name."""
        state = identifier(state)
        if state not in self.states:
            raise KeyError(f"no state '{state}'; known: {', '.join(self.states)}")
        return self.y[:, self.states.index(state)]

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

        return page_code(self, live=live)

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
                  "joint_forces.hinge.fx"; names, or a text of names with commas, here and below
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

    def film(
        self,
        path: str | Path,
        *,
        fps: float = 25.0,
        speed: float = 1.0,
        start: float | None = None,
        end: float | None = None,
        size: str = "",
        force: bool = False,
        progress: "Progress | None" = None,
    ) -> Path:
        """Write a film, .gif or, where the program ffmpeg is, .mp4; return its path.

        fps         frames of a second
        speed       of the film relative to the motion: 0.5 shows it half as fast
        start, end  times of the run between which it is shown, s; None: all
        size        in pixels, as "640x480"; "": as the motion needs it
        progress    called with the fraction done

        Raises `RunError` for another suffix, without ffmpeg, or if the file exists and this program
        did not write it.
        """
        from eomgen.show.plotting import filmed

        times = (start, end)
        return filmed(
            self.trajectory, self.motion, Path(path), fps, speed, times, size, force, progress
        ).path

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

    def _repr_html_(self) -> str:
        rows = "".join(
            f"<tr><td>{html.escape(name)}</td><td>{html.escape(str(value))}</td></tr>"
            for name, value in self.report.items()
        )
        notes = "".join(f"<p>{html.escape(line)}</p>" for line in self.warnings)
        return f"<b>{html.escape(self.model.name)}</b><table>{rows}</table>{notes}"
