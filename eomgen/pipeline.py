"""The pipeline from a model to generated code.

    Model ─choose▶ Choice ─record▶ System ─optimise▶ System ─render▶ Generated

Before it, `scene.reader` reads a scene, `model.elaborate` makes a model of it, and
`dynamics.start.assembly` gives it a start that meets its constraints. After it, `store`
keeps the generated code, and `run` loads and integrates it.
"""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

from eomgen.base.errors import RunError
from eomgen.codegen.backends import python
from eomgen.codegen.backends.javascript import mechanism
from eomgen.codegen.choice import Candidate, Choice, choose
from eomgen.codegen.derive import record
from eomgen.codegen.interface import Interface, interface_of
from eomgen.codegen.live import live_system
from eomgen.codegen.series import with_series
from eomgen.codegen.system import System, optimised
from eomgen.dynamics.start.singularity import check_nonsingular
from eomgen.language.formula import Formula
from eomgen.model.model import Model
from eomgen.program.passes import PassReport
from eomgen.program.program import Program, cost


@dataclass(frozen=True)
class Generated:
    """What a model is compiled to: a Python module, its program with the interface, what passes
    saved, why its route was taken, what the report must say of it, and `Choice.digits`.
    """

    module: str
    program: Program
    interface: Interface
    reports: tuple[PassReport, ...]
    explanation: tuple[str, ...]
    notices: tuple[str, ...]
    digits: int | None


@dataclass(frozen=True)
class Compiled:
    """A model's optimised program, and the choice of its route."""

    system: System
    choice: Choice

    @property
    def operations(self) -> int:
        """The number of operations of one call of `derivative`."""
        return cost(self.system.program, "derivative")["total"]

    @property
    def candidates(self) -> tuple[Candidate, ...]:
        """The candidate routes; the chosen one with the operations of this program."""
        return tuple(
            replace(c, operations=self.operations) if c.route == self.system.route else c
            for c in self.choice.candidates
        )

    def explanation(self) -> list[str]:
        """A line for each candidate route: its operations, and why it was chosen or not."""
        lines = []
        for candidate in self.candidates:
            count = "-" if candidate.operations is None else str(candidate.operations)
            taken = " <- taken" if candidate.route == self.system.route else ""
            lines.append(f"{candidate.route:<10}{count:>6}  {candidate.words}{taken}".rstrip())
        return lines


def generate(model: Model, *, jacobian: bool = True) -> Generated:
    """Derive a model's equations and write them as code. Equal models give equal bytes.

    Without `jacobian`, which takes longer than all other stages, a module is incomplete but can be
    integrated by explicit methods.

    Raises `SceneError` if the mass matrix is singular or the route does not apply to the model.
    """
    check_nonsingular(model)
    return render(compile_program(model, jacobian=jacobian))


def compile_program(model: Model, *, jacobian: bool = True, closed: bool = True) -> Compiled:
    """A model's program by the route it names, or for `auto` by the route that `choose` returns.

    jacobian  whether the Jacobian of the derivative is an output
    closed    whether `auto` tries symbolic routes
    """
    choice = choose(model, closed=closed)
    recorded = record(choice.derived, jacobian=jacobian)
    return Compiled(optimised(recorded), choice)


def render(compiled: Compiled) -> Generated:
    """The NumPy module of a program, with its reports."""
    program, interface = compiled.system.program, interface_of(compiled.system)
    return Generated(
        python.module(program, interface),
        program,
        interface,
        compiled.system.reports,
        tuple(compiled.explanation()),
        tuple(compiled.choice.notices()),
        compiled.choice.digits,
    )


@dataclass(frozen=True)
class Live:
    """What the page of a model computes with.

    source      the JavaScript source of `const mechanism`
    loads       for each load of the output `loads` the names of its effect and its body
    operations  of one call of `derivative` with all effects on
    saved       operations that leaving out each effect saves, by name
    """

    source: str
    loads: tuple[tuple[str, str], ...]
    operations: int
    saved: Mapping[str, int]


def live(model: Model, geometry: Sequence[Formula] = (), *, series: bool = False) -> Live:
    """The functions of a model's page, of its interactive model; `geometry` are formulas of
    parameters and time, the entries of the function of that name. With `series` they have those of
    Taylor, if there are any.
    """
    check_nonsingular(model)
    found = live_system(model, geometry)
    program, interface, text = found.system.program, interface_of(found.system), None
    if series:
        with suppress(RunError):
            program, interface, text = with_series(program, interface)
    contacts = [{"name": c.name, "effect": c.effect, "unit": c.unit} for c in found.system.contacts]
    source = mechanism(program, interface, contacts, text)
    return Live(source, found.loads, found.operations, found.saved)


def python_module(system: System) -> str:
    """The NumPy module of a system."""
    return python.module(system.program, interface_of(system))
