"""The JAX backend: a module of pure functions to compile, map and differentiate; it imports `jax`
and `numpy` only.

XLA takes a time to compile straight lines that grows faster than their length, and fuses them so
that shared values are computed many times over. A module therefore records a long kernel when it is
first called, and evaluates it as a loop over rows of operations.
"""

import pprint
from collections.abc import Mapping
from typing import Any

from eomgen.base.templating import render
from eomgen.codegen.backends.python import (
    RESERVED,
    document,
    joined,
    operations,
    plain,
    units,
    unpacking,
)
from eomgen.codegen.interface import Interface
from eomgen.codegen.kernels import Kernel, kernels_of
from eomgen.program.printing import Dialect
from eomgen.program.program import Program
from eomgen.scalars.functions import FUNCTIONS
from eomgen.tables.outputs import DYNAMICS, OUTPUTS

SUFFIXES: tuple[str, ...] = ("_jax.py",)
TEMPLATES = "jax"
ABOUT = "a Python module for JAX: jit, vmap and grad, float32 or float64"
DIALECT = Dialect({name: f"f.{name}" for name in FUNCTIONS}, RESERVED | {"f"})
LONGEST = 120
"""Most operations that are evaluated in line."""
BLOCK = 128
"""Columns that are computed together on a CPU."""
WIDTH = 100
BESIDE = {"tau": ("tau=None", "jnp.zeros_like(v) if tau is None else tau"), "vd": ("vd", "vd")}
"""The arguments beside the state, and what each is."""
LEFT_OUT = ("impact", "held", "implicit_step", "project_position", "project_velocity", "samples")
"""Outputs for simulations with contacts, loops or samples, which take other arguments."""


def files(program: Program, interface: Interface) -> Mapping[str, str]:
    """The module, one file. Equal programs and interfaces give equal bytes.

    It has the functions of the Python module except matrices of derivatives, which `jax.jacfwd`
    computes, and `LEFT_OUT`.
    """
    kernels, constants = kernels_of(program, interface, DIALECT)
    kernels = [k for k in kernels if not k.function.matrix and k.function.name not in LEFT_OUT]
    held = tuple(dict.fromkeys(name for kernel in kernels for name in kernel.constants))
    place = {name: i for i, name in enumerate(held)}
    written = {kernel.function.name: _written(kernel, place) for kernel in kernels}
    special = {"initial_state", "derivative", *DYNAMICS}
    context: dict[str, Any] = {
        "title": plain(interface.title),
        "scene": interface.name,
        "form": interface.form,
        "about": document(interface, _counts(kernels)),
        "data": _data(interface),
        "ny": len(interface.states),
        "nv": interface.velocities,
        "nx": interface.others,
        "parameters": joined(constants.parameters),
        "fixed": [*constants.checked, *constants.lines],
        "held": joined(held),
        "kernels": list(written.values()),
        "derivative": written["derivative"],
        "dynamics": [
            {**written[name], "argument": argument, "given": given}
            for name in DYNAMICS
            for argument, given in [BESIDE[OUTPUTS[name].beside]]
            if name in written
        ],
        "outputs": [kernel for name, kernel in written.items() if name not in special],
        "longest": LONGEST,
        "block": BLOCK,
    }
    return {f"{interface.name}{SUFFIXES[0]}": render(TEMPLATES, "module.py.jinja", context)}


def _counts(kernels: list[Kernel]) -> Mapping[str, int]:
    """The operations of `derivative` by kind."""
    return next(kernel.counts for kernel in kernels if kernel.function.name == "derivative")


def _written(kernel: Kernel, place: Mapping[str, int]) -> dict[str, Any]:
    """A kernel as values for the template."""
    function = kernel.function
    return {
        "name": function.name,
        "about": function.about,
        "shape": repr(function.shape),
        "operations": operations(kernel.counts),
        "constants": joined(kernel.constants),
        "places": joined([str(place[name]) for name in kernel.constants]),
        "state": unpacking(kernel.state),
        "inputs": unpacking(kernel.inputs),
        "extra": unpacking(kernel.extra),
        "lines": kernel.block.lines,
        "results": kernel.block.results,
    }


def _data(interface: Interface) -> list[tuple[str, str]]:
    """Names and values of the module's plain data."""
    positions = tuple(i for i, s in enumerate(interface.states) if s.position)
    data: dict[str, Any] = {
        "NAME": interface.name,
        "FORM": interface.form,
        "DIMENSIONS": interface.dimensions,
        "STATES": tuple(s.name for s in interface.states),
        "POSITIONS": positions,
        "QUATERNIONS": interface.quaternions,
        "INPUTS": {i.name: i.default for i in interface.inputs},
        "PARAMETERS": {p.name: p.default for p in interface.parameters},
        "UNITS": dict(units(interface)),
        "EFFECTS": tuple(kind for _, kind in interface.effects),
        "EFFECT_NAMES": tuple(name for name, _ in interface.effects),
        "BODIES": interface.bodies,
        "JOINTS": interface.joints,
        "POINTS": interface.points,
        "DRIVEN": tuple(c.name for c in interface.driven),
        "CONTACTS": {c.name: c.effect for c in interface.contacts},
        "CONSTRAINTS": tuple(name for name, _ in interface.constraints),
        "VELOCITY_CONSTRAINTS": interface.velocity_rows,
    }
    return [
        (name, pprint.pformat(value, width=WIDTH - len(name), sort_dicts=False))
        for name, value in data.items()
    ]
