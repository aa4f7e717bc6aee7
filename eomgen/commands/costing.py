"""The command `effects`."""

import math
from dataclasses import replace
from typing import TYPE_CHECKING

from eomgen.api.effects import bill_of
from eomgen.api.inputs import all_in_formulas
from eomgen.api.options import EffectsOptions
from eomgen.base.errors import InterruptedRunError
from eomgen.base.files import check_folder
from eomgen.commands.shared import (
    Arguments,
    print_wrapped,
    read_whole,
    reporter_of,
    scene_with_inputs,
)
from eomgen.commands.usage import taken

if TYPE_CHECKING:
    from eomgen.study.cost.bill import Bill, Item

OWN, SHARED = "the mechanism itself", "shared by effects"


def effects(given: Arguments) -> int:
    """Print and draw the cost of each effect and the change of the motion without it."""
    # Imported here: they import Matplotlib.
    from eomgen.show.bill import save_bill
    from eomgen.show.style import check_figure

    options = taken(EffectsOptions, given, source=given.scene)
    reporter = reporter_of(given, given.scene)
    tables = all_in_formulas(*scene_with_inputs(given), reporter)
    scene, model, name = read_whole(given.scene, given, tables)
    path = given.output / f"{name}_effects.png"
    check_folder(path.parent)
    check_figure(path, force=given.force)
    found = bill_of(
        scene.replaced(route=model.route),
        replace(options, motion=None) if given.no_motion else options,
        name=name,
        reporter=reporter,
    )
    print(
        f"{name}: one derivative takes {found.operations} operations, {_us(found.seconds)} µs "
        f"(±{_us(found.spread)})"
    )
    _print_items(found)
    _print_routes(found)
    if found.extent is not None:
        _print_motion(found, found.extent)
    save_bill(found, path, force=given.force)
    print(f"    wrote {path}")
    if found.stopped:
        raise InterruptedRunError(f"{name}: {found.stopped}")
    return 0


def _print_items(bill: "Bill") -> None:
    from eomgen.study.cost.bill import difference

    operations, seconds, spread = bill.shared
    width = max(len(OWN), *(len(item.label) for item in bill.items), 0)
    motion = "   motion  from 1 %" if bill.extent is not None else ""
    print(f"    {'':<{width}}  operations   share        µs  states  inputs{motion}")

    def line(label: str, operations: int, took: str, rest: str = "") -> None:
        share = operations / bill.operations if bill.operations else 0.0
        text = f"    {label:<{width}}  {operations:>10}  {share:6.1%}  {took:>8}  {rest}"
        print(text.rstrip())

    def lines(kind: str) -> None:
        for item in bill.items:
            if item.kind == kind and item.needed_by:
                print(f"    {item.label:<{width}}  {_needed(item)}")
            elif item.kind == kind:
                took = difference(item.seconds, item.spread)
                line(item.label, item.operations, took, _rest(bill, item))

    kinds = [item.kind for item in bill.items]
    by = (
        ""
        if bill.bare_route == bill.route
        else f"{'':>14}{motion and ' ' * 19}  ({bill.bare_route})"
    )
    line(OWN, bill.bare_operations, _us(bill.bare_seconds), by)
    lines("effect")
    if kinds.count("effect") > 1 or operations:
        line(SHARED, operations, difference(seconds, spread))
    if "mechanism" in kinds:
        print("    parts of the mechanism itself that could be left out:")
        lines("mechanism")
    if "left out" in kinds:
        print("    left out by the scene, with what it would add:")
        lines("left out")
    if {bill.bare_route, *(item.route for item in bill.items)} - {"", bill.route}:
        print_wrapped(
            "    ", f"(route): the route without this effect; with all effects it is {bill.route}"
        )


def _needed(item: "Item") -> str:
    """Why an item cannot be left out alone: the items that need it."""
    more = f" and {len(item.needed_by) - 3} more" if len(item.needed_by) > 3 else ""
    return f"others need it: {', '.join(item.needed_by[:3])}{more}"


def _rest(bill: "Bill", item: "Item") -> str:
    """States, inputs, change of the motion without it, and the route without it if it differs."""
    other_route = "" if item.route == bill.route else f"  ({item.route})"
    text = f"{item.states:>6}  {item.inputs:>6}"
    if bill.extent is None:
        return f"{text}{other_route}"
    if item.change is None:
        return f"{text}{'':>19}{other_route}"
    since = "-" if item.change.since is None else f"{item.change.since:.3g} s"
    return f"{text}  {item.change.percent + ' %':>7}  {since:>8}{other_route}"


def _print_routes(bill: "Bill") -> None:
    if bill.at_contacts:
        counts = ", ".join(f"{name} {count}" for name, count in bill.at_contacts.items())
        print(f"    rigid contacts beside it, operations of each kernel: {counts}")
    print("    route     operations        µs")
    for route in bill.routes:
        count = "-" if route.operations is None else str(route.operations)
        seconds = "-" if route.seconds is None else _us(route.seconds)
        label = f"    {route.route:<10}{count:>10}  {seconds:>8}  "
        if route.words:
            print_wrapped(label, route.words)
        else:
            print(label.rstrip())


def _print_motion(bill: "Bill", extent: float) -> None:
    """Explain the changes of the motion, and print the largest of them in m and degrees."""
    print_wrapped(
        "    motion: ",
        "distance of all mass from its position without the effect (root mean square, greatest "
        "over the run, inputs 0), relative to the distance that the scene's motion takes it, "
        f"{extent:.3g} m; about 100 % or more is a different motion",
    )
    changes = [(item.label, item.change) for item in bill.items if item.change is not None]
    for why in dict.fromkeys(change.ended for _, change in changes if change.ended):
        ends = [change.until for _, change in changes if change.ended == why]
        to = " to ".join(dict.fromkeys(f"{t:.3g}" for t in (min(ends), max(ends))))
        some = "" if len(ends) == len(changes) else f"{len(ends)} of {len(changes)} "
        print_wrapped("        ", f"{some}compared only to t = {to} s of {bill.t_end:g} s: {why}")
    for label, change in changes:
        if change.since is not None:
            angle = f"{math.degrees(change.angle):.0f}°"
            text = f"up to {change.distance:.3g} m ({change.body}) and {angle}"
            print_wrapped(f"        {label}: ", text)


def _us(seconds: float) -> str:
    return f"{round(1e6 * seconds, 1) + 0.0:.1f}"  # never -0.0
