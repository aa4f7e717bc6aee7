"""What the public functions return: values that can be kept, pickled and shown in a notebook."""

import html
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from eomgen.files import check_writable, write_whole
from eomgen.model.model import Model
from eomgen.run.limits import Excursion, excursions
from eomgen.run.problem import FloatArray
from eomgen.run.trajectory import Outcome, Trajectory, save_csv, save_npz
from eomgen.study.diagnosis import joint_limits, locks

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from eomgen.derivation.matrices import Matrices
    from eomgen.derivation.steps import Step
    from eomgen.derivation.symbols import Expr
    from eomgen.program.passes import PassReport
    from eomgen.show.balance import Imbalance
    from eomgen.show.motion import Motion
    from eomgen.study.accuracy.estimate import Estimate
    from eomgen.study.accuracy.search import Choice


@dataclass(frozen=True)
class Derivation:
    """Equations of motion as SymPy has them, M v̇ + V + G = F, and how they were found.

    `matrices` holds them with the symbols of coordinates `q`, velocities `v`, accelerations `a`.
    """

    name: str
    title: str
    matrices: "Matrices"

    @property
    def M(self) -> "Expr":
        """Mass matrix, (nv, nv), symmetric."""
        return self.matrices.M

    @property
    def V(self) -> "Expr":
        """Forces that velocities make, (nv, 1)."""
        return self.matrices.V

    @property
    def G(self) -> "Expr":
        """Forces of gravity, (nv, 1), on the left side."""
        return self.matrices.G

    @property
    def F(self) -> "Expr":
        """All other generalised forces, (nv, 1)."""
        return self.matrices.F

    @property
    def solution(self) -> "dict[Expr, Expr]":
        """Each acceleration as one expression of q, v, parameters and inputs."""
        from eomgen.derivation.matrices import written_out

        found = self.matrices
        return {a: written_out(a, found.definitions) for a in found.a}

    @property
    def steps(self) -> "tuple[Step, ...]":
        """The derivation step by step: number, title, words, equations."""
        return self.matrices.steps

    def text(self, *, encoding: str = "utf-8") -> str:
        """All steps as plain text, in ASCII if the encoding lacks Greek letters."""
        from eomgen.show.derivation import as_text

        return as_text(self.name, self.title, self.steps, encoding=encoding)

    def latex(self) -> str:
        """All steps as one LaTeX document."""
        from eomgen.show.derivation import as_latex

        return as_latex(self.name, self.title, self.steps)

    def html(self) -> str:
        """All steps as one page."""
        from eomgen.show.derivation import as_html

        return as_html(self.name, self.title, self.steps)

    def _repr_latex_(self) -> str:
        import sympy as sp

        found = self.matrices
        left = sp.latex(found.M) + sp.latex(sp.Matrix(found.a))
        rest = " + ".join(sp.latex(m) for m in (found.V, found.G))
        return f"$\\displaystyle {left} + {rest} = {sp.latex(found.F)}$"


@dataclass(frozen=True)
class Module:
    """A generated module.

    name         of the scene
    source       the file's text
    poses        the page's `bodyPoses`, JavaScript; "" without `body_poses`
    explanation  a line for each route, and which was taken
    notices      what its user must know of it
    reports      what each pass over the program left of it: steps and operations
    derived      whether it was derived now; else it was in the store
    backend      the language it is in
    others       further files of that language, by name
    library      the sources of its shared library, by name, if it is to be compiled and loaded
    reference    the text of the Python module that a compiled one falls back on; "" without one
    """

    name: str
    source: str
    poses: str
    explanation: tuple[str, ...]
    notices: tuple[str, ...]
    reports: "tuple[PassReport, ...]" = ()
    derived: bool = field(default=True, compare=False)
    backend: str = "numpy"
    others: Mapping[str, str] = field(default_factory=dict)
    library: Mapping[str, str] = field(default_factory=dict, compare=False)
    reference: str = field(default="", compare=False)

    def save(self, path: str | Path, *, force: bool = False) -> None:
        """Write the file, whole or not at all, and further files beside it. Raises `RunError` where
        another's is there.
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
    """A motion computed.

    model       the mechanism, at the parameters of the run
    module      that computed it
    trajectory  times, states, counts, events
    motion      poses and energies along it
    options     what on the command line makes the same run
    error       estimated, of the last state, in parts of the motion's scale; nan if not asked for
    warnings    what its user must know
    choice      of its method and tolerances, where `accuracy` or `budget` made it
    estimate    of its error by a second run, where that was asked for
    begun       how it goes on from an earlier run; "" if it does not
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
        """Whether it came to its end."""
        return self.trajectory.finished

    @property
    def outcome(self) -> Outcome:
        """How it came to its end: its kind, the reason, and what to change."""
        return self.trajectory.outcome

    @property
    def message(self) -> str:
        """Why it did not, and what to change; "" if there is nothing to say."""
        return self.trajectory.message

    @property
    def energy(self) -> FloatArray:
        """Kinetic and potential energy together, (n,), J."""
        return self.motion.kinetic_energy + self.motion.potential_energy

    @property
    def imbalance(self) -> "Imbalance | None":
        """How far the energy is from what it must be; None where that is not known."""
        from eomgen.show.balance import imbalance

        return imbalance(self.motion)

    @property
    def limits(self) -> Mapping[str, tuple[float, float]]:
        """Of joints, by coordinate, where no stop enforces them."""
        return joint_limits(self.model)

    @property
    def excursions(self) -> tuple[Excursion, ...]:
        """Which coordinates left these limits, and when."""
        return tuple(excursions(self.trajectory, self.limits))

    @property
    def locks(self) -> tuple[str, ...]:
        """Where a spatial mechanism came near gimbal lock, a line for each velocity."""
        return tuple(locks(self.model, self.trajectory))

    def __getitem__(self, state: str) -> FloatArray:
        """One state over time, (n,). Raises `KeyError` for a name that is none."""
        if state not in self.states:
            raise KeyError(f"no state '{state}'; known: {', '.join(self.states)}")
        return self.y[:, self.states.index(state)]

    @property
    def report(self) -> Mapping[str, object]:
        """What it took and how it ended, by name."""
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

    def save(self, folder: str | Path, *, force: bool = False) -> tuple[Path, ...]:
        """Write module, archive, table and page into a folder; return their paths.

        Raises `RunError` where others' files are there, or they cannot be written.
        """
        from eomgen.show.page import save_page

        base = Path(folder) / self.model.name
        paths = tuple(base.with_suffix(f".{kind}") for kind in ("py", "csv", "npz", "html"))
        module, table, archive, page = paths
        self.module.save(module, force=force)
        save_csv(self.trajectory, table, force=force)  # the archive tells whose table it replaces
        save_npz(self.trajectory, archive, force=force)
        parameters = tuple(self.model.defaults.values())
        save_page(self.motion, self.module.poses, parameters, page, force=force)
        return paths

    def _repr_html_(self) -> str:
        rows = "".join(
            f"<tr><td>{html.escape(name)}</td><td>{html.escape(str(value))}</td></tr>"
            for name, value in self.report.items()
        )
        notes = "".join(f"<p>{html.escape(line)}</p>" for line in self.warnings)
        return f"<b>{html.escape(self.model.name)}</b><table>{rows}</table>{notes}"
