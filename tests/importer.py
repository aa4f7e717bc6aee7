"""An importer of FMUs: instances by FMPy, and model exchange integrated by SciPy's DOP853."""

import contextlib
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
from fmpy.simulation import instantiate_fmu
from scipy.integrate import solve_ivp


@contextlib.contextmanager
def instance(path: Path, kind: str) -> Iterator[tuple[Any, dict[str, int]]]:
    """An instance of a unit that is not initialised, and its value references by name."""
    description = fmpy.read_model_description(str(path))
    folder = Path(tempfile.mkdtemp(prefix="fmu-"))
    try:
        fmpy.extract(str(path), unzipdir=str(folder))
        unit = instantiate_fmu(str(folder), description, kind)
        yield unit, {v.name: v.valueReference for v in description.modelVariables}
        unit.freeInstance()
    finally:
        shutil.rmtree(folder)


def begun(unit: Any, t_end: float, tolerance: float = 1e-12) -> None:
    """Initialise an instance."""
    unit.enterInitializationMode(tolerance=tolerance, startTime=0.0, stopTime=t_end)
    unit.exitInitializationMode()


def exchanged(path: Path, t_end: float, *, rtol: float = 1e-12) -> np.ndarray:
    """The states of a unit in model exchange at the end of a run: every event indicator that
    changes its sign ends an integration, and the unit updates its states.
    """
    with instance(path, "ModelExchange") as (unit, _):
        begun(unit, t_end)
        size, events = sizes(unit)
        buffer = (fmpy.fmi3.fmi3Float64 * max(size, events))()

        def at(t: float, y: np.ndarray) -> None:
            unit.setTime(t)
            buffer[:size] = y.tolist()
            unit.setContinuousStates(buffer, size)

        def slope(t: float, y: np.ndarray) -> np.ndarray:
            at(t, y)
            unit.getContinuousStateDerivatives(buffer, size)
            return np.array(buffer[:size])

        last: dict[float, list[float]] = {}

        def indicator(i: int) -> Any:
            def value(t: float, y: np.ndarray) -> float:
                if t not in last:  # all are asked for at one time, one after another
                    last.clear()
                    at(t, y)
                    unit.getEventIndicators(buffer, events)
                    last[t] = list(buffer[:events])
                return last[t][i]

            value.terminal = True  # type: ignore[attr-defined]
            return value

        nominals = (fmpy.fmi3.fmi3Float64 * size)()
        unit.getNominalsOfContinuousStates(nominals, size)
        t = 0.0
        indicators = [indicator(i) for i in range(events)]
        while t < t_end:
            last.clear()
            unit.updateDiscreteStates()
            unit.enterContinuousTimeMode()
            unit.getContinuousStates(buffer, size)
            found = solve_ivp(
                slope,
                (t, t_end),
                np.array(buffer[:size]),
                method="DOP853",
                rtol=max(rtol, 3e-14),
                atol=rtol * np.array(nominals),
                events=indicators or None,
                max_step=t_end / 50,
            )
            # The crossing is located on either side of it: the importer goes to the far one.
            late = 4e-16 * max(1.0, found.t[-1]) if found.status == 1 else 0.0
            t = float(found.t[-1] + late)
            at(t, found.y[:, -1] + late * slope(found.t[-1], found.y[:, -1]))
            unit.completedIntegratorStep()
            unit.enterEventMode()
        unit.getContinuousStates(buffer, size)
        return np.array(buffer[:size])


def sizes(unit: Any) -> tuple[int, int]:
    """The numbers of continuous states and of event indicators."""
    from ctypes import byref, c_size_t

    states, events = c_size_t(), c_size_t()
    unit.fmi3GetNumberOfContinuousStates(unit.component, byref(states))
    unit.fmi3GetNumberOfEventIndicators(unit.component, byref(events))
    return states.value, events.value
