"""The printed table of `accuracy`: all runs, observed orders, and the cheapest methods."""

import math
from collections.abc import Callable, Mapping, Sequence

from eomgen.api.accuracy import Measurement
from eomgen.commands.shared import print_wrapped
from eomgen.study.accuracy.ladder import Work, order
from eomgen.study.accuracy.reading import (
    TARGETS,
    cheapest,
    cost_of,
    observed_order,
    saved_by_jacobian,
)
from eomgen.study.accuracy.work_precision import Bench

WORDS = {"wrong": "wrong", "failed": "failed", "over": "over", "refused": "not possible"}
RUNNERS_UP = 2
"""Number of methods that are listed after the cheapest."""


def _energy(bench: Bench) -> str:
    if bench.energy is not None:
        return "greatest relative change of the energy, which exact motion conserves"
    if bench.powers is not None:
        return (
            "change of kinetic energy that the works of effects do not explain, relative to the "
            "motion's energy; empty if computing the works would take too long"
        )
    return "not known: energy is not conserved, and the works of effects are not known"


def print_table(name: str, made: Measurement) -> None:
    """Print a line for each run, the order of each method, and the cheapest methods."""
    found, bench, methods = made.found, made.bench, made.methods
    works, costs, t_end, generation = found.works, found.costs, found.t_end, found.generation
    truth = bench.reference
    print(
        f"{name}: {t_end:g} s; one derivative takes {1e6 * costs[0]:.1f} µs, one Jacobian "
        f"{1e6 * costs[1]:.1f} µs; generated in {generation:.2g} s"
    )
    floor = bench.floors[0]
    print_wrapped("    reference: ", f"{truth.origin} ({_time(truth.seconds)})")
    print_wrapped(
        "    ",
        f"its own relative error {truth.error:.1g}: errors are resolved down to {floor:.1g} on",
    )
    print_wrapped("    energy: ", _energy(bench))
    if bench.problem.quaternions:
        print_wrapped(
            "    quaternions: ",
            "greatest deviation of their length from 1, before each step scales it to 1",
        )
    extras: list[tuple[str, Callable[[Work], float]]] = [
        ("energy", lambda w: w.energy_drift),
        ("gap, m", lambda w: w.joint_gap),
        ("quaternion", lambda w: w.quaternion_defect),
    ]
    extras = [(title, value) for title, value in extras if any(value(w) >= 0 for w in works)]
    heads = "".join(f"  {title:>10}" for title, _ in extras)
    print(
        f"    {'method':<20}  {'setting':<12}  {'error':>10}{heads}  {'time':>8}  {'steps':>8}  "
        f"{'derivatives':>11}  {'Jacobians':>9}  {'in them':>7}"
    )
    reasons: dict[tuple[str, str, str], list[Work]] = {}
    for method in methods:
        own = [work for work in works if work.setting.integrator == method]
        for work in own:
            cells = "".join(f"  {_small(value(work)):>10}" for _, value in extras)
            print(
                f"    {method:<20}  {work.setting.brief:<12}  {_error(work):>10}{cells}  "
                f"{_time(work.seconds):>8}  {work.steps:>8}  {work.derivatives:>11}  "
                f"{work.jacobians:>9}  {_share(bench, work, costs):>7}"
            )
            if work.status != "ok":
                reason = "" if work.status == "wrong" else work.reason
                reasons.setdefault((method, work.status, reason), []).append(work)
    _print_troubles(reasons)
    _print_orders(methods, works)
    _print_reading(bench, works)


def _error(work: Work) -> str:
    if work.status == "wrong":
        return f"wrong {work.error:.1e}" if work.error < 1e4 else "wrong"
    if work.status != "ok":
        return WORDS[work.status]
    return f"{'≤ ' if work.at_most[0] else ''}{work.error:.1e}"


def _small(value: float) -> str:
    return "-" if math.isnan(value) else f"{value:.1e}" if value else "0"


def _time(seconds: float) -> str:
    if seconds >= 1:
        return f"{seconds:.3g} s"
    return f"{1e3 * seconds:.3g} ms" if seconds >= 1e-3 else f"{1e6 * seconds:.3g} µs"


def _share(bench: Bench, work: Work, costs: tuple[float, float]) -> str:
    """The share of the time that is spent in generated code; "-" in compiled code, and with rigid
    contacts, whose own kernels also take time.
    """
    if bench.compiled or bench.problem.contacts is not None or not work.derivatives:
        return "-"
    spent = work.derivatives * costs[0] + work.jacobians * costs[1]
    return f"{min(1.0, spent / work.seconds):.0%}"


def _print_troubles(reasons: Mapping[tuple[str, str, str], Sequence[Work]]) -> None:
    """Print why runs failed or are wrong, a line for each method and reason."""
    if reasons:
        print("    failed or wrong:")
    for (method, status, cause), works in reasons.items():
        settings = works[0].setting.brief
        if len(works) > 1:
            settings += f" to {works[-1].setting.brief.split()[1]}"
        if status == "wrong":
            worst = max(work.error for work in works)
            cause = f"reported success, but the relative error is up to {worst:.2g}"
        print_wrapped(f"        {method}, {settings}: ", f"{WORDS[status]}: {cause}")


def _print_orders(methods: Sequence[str], works: Sequence[Work]) -> None:
    lines = []
    for method in methods:
        nominal = order(method)
        own = [work for work in works if work.setting.integrator == method]
        if nominal is None or all(work.status == "refused" for work in own):
            continue
        seen = observed_order(own)
        if seen is None:
            text = "not observed: no two successive slopes of the error agree"
        else:
            text = f"{seen.value:.2f} over dt {seen.coarse:.3g} to {seen.fine:.3g} s"
        lines.append(f"        {method:<20}  {nominal}   {text}")
    if lines:
        print("    order, nominal and observed:")
        print("\n".join(lines))


def _print_reading(bench: Bench, works: Sequence[Work]) -> None:
    """Print the cheapest runs for a few errors, and what the generated Jacobian saves."""
    by, cost = "time" if bench.compiled else "counted work", cost_of(bench)
    print(f"    cheapest run, by {by}, for an error within")
    for target in TARGETS:
        best = cheapest(works, target, cost)
        if not best:
            print(f"        {target:.0e}  none of these runs")
            continue
        first = best[0]
        text = f"{first.setting.integrator} at {first.setting.brief}, {_time(first.seconds)}"
        others = [
            f"{other.setting.integrator} {cost(other) / cost(first):.1f} times"
            for other in best[1 : 1 + RUNNERS_UP]
        ]
        print(f"        {target:.0e}  {'; '.join([text, *others])}")
    wrong = [work for work in works if work.status == "wrong"]
    if wrong:
        print_wrapped(
            "    ",
            f"{len(wrong)} of {len(works)} runs reported success and are wrong: their relative "
            "errors are at least a tenth",
        )
    for method, ratio in saved_by_jacobian(works).items():
        print_wrapped(
            "    ",
            f"{method} takes {ratio:.2f} times as long with finite differences as with the "
            "generated Jacobian (median over tolerances)",
        )
