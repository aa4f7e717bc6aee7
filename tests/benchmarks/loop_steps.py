"""Steps of mechanisms with loops that keep all coordinates: in C beside Python.

    python tests/benchmarks/loop_steps.py

Processor time of `simulate`, least of three runs of each, divided by the number of steps: with
projection and its checks, two rows of the trajectory kept.
"""

import time

import eomgen

CASES = (
    ("four_bar", {"integrator": "rk4", "dt": 1e-3}),
    ("four_bar", {"integrator": "gauss_4", "dt": 1e-3}),
    *(
        ("peaucellier", {"integrator": f"leapfrog{order}", "dt": 1e-3})
        for order in ("", "_4", "_6")
    ),
    ("rattleback", {"integrator": "DOP853", "rtol": 1e-10}),
)
LEAST = 3


def seconds(scene: object, backend: str, t_end: float, options: dict[str, object]) -> float:
    """Processor time of a step, s."""
    found = []
    for _ in range(LEAST):
        start = time.process_time()
        run = eomgen.simulate(scene, backend=backend, t_end=t_end, samples=2, **options)
        found.append((time.process_time() - start) / run.trajectory.counts["steps"])
    return min(found)


def main() -> None:
    """Print a table."""
    print("| scene | method | C, µs | Python, µs | Python / C |\n|---|---|---|---|---|")
    for name, options in CASES:
        scene = eomgen.read(name).replaced(loops="projected")
        c = seconds(scene, "c", 5.0, options)
        python = seconds(scene, "numpy", 0.5, options)
        how = options["integrator"]
        print(f"| {name} | {how} | {c * 1e6:.1f} | {python * 1e6:.0f} | {python / c:.0f} |")


if __name__ == "__main__":
    main()
