"""What a warm `simulate` costs beside its integration, s of processor time.

    python tests/benchmarks/fixed_costs.py [SCENE …]

For each scene the least of five runs in one process, after one that fills the store; what a run by
`eomgen simulate SCENE --no-pictures` takes in all, in a process of its own, imports included; and
the part of that which importing takes.
"""

import resource
import subprocess
import sys
import tempfile
import time
from typing import Any

import eomgen
from eomgen.study.accuracy.trial import Case

SCENES = ("pendulum", "two_body", "four_bar", "ragdoll", "human_figure")
IMPORTS = "import eomgen.commands.running, eomgen.run.integrate, eomgen.show.observe"
RUNS = 5


def main() -> None:
    """A line for each scene."""
    print(f"imports: {alone('-c', IMPORTS):.2f} s")
    for scene in sys.argv[1:] or SCENES:
        eomgen.simulate(scene)
        beside, inside = min(warm(scene) for _ in range(RUNS))
        with tempfile.TemporaryDirectory() as out:
            whole = alone("-m", "eomgen", "simulate", scene, "--no-pictures", "-o", out)
        print(f"{scene}: {beside:.3f} s beside {inside:.3f} s; {whole:.2f} s alone", flush=True)


def warm(scene: str) -> tuple[float, float]:
    """The time beside integration, and that of integration."""
    spent, run = 0.0, Case.run

    def timed(self: Case, *given: Any, **named: Any) -> Any:
        nonlocal spent
        began = time.process_time()
        try:
            return run(self, *given, **named)
        finally:
            spent += time.process_time() - began

    Case.run = timed  # type: ignore[method-assign]
    try:
        began = time.process_time()
        eomgen.simulate(scene)
        return time.process_time() - began - spent, spent
    finally:
        Case.run = run  # type: ignore[method-assign]


def alone(*arguments: str) -> float:
    """The least time of a Python process with these arguments."""
    times = []
    for _ in range(RUNS):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run([sys.executable, *arguments], capture_output=True, check=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        times.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
    return min(times)


if __name__ == "__main__":
    main()
