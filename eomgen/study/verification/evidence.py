"""The results of `verify` as text and as data; the same bytes for the same scene."""

import json
import textwrap
from collections.abc import Sequence
from math import isfinite
from pathlib import Path
from typing import Any

from eomgen.base.files import check_folder, check_writable, write_whole
from eomgen.study.verification.bounds import OWN, Check
from eomgen.study.verification.hard_states import KINDS, State
from eomgen.study.verification.horizon import Horizon
from eomgen.study.verification.verify import Verified

SHOWN = 12
"""Messages do not list states with more numbers than this."""


def report(found: Verified, horizon: Horizon | None = None) -> list[str]:
    """The lines of the report."""
    counts: dict[str, int] = {}
    for one in found.judged:
        counts[one.state.kind] = counts.get(one.state.kind, 0) + 1
    listed = ", ".join(f"{count} {kind}" for kind, count in counts.items())
    lines = [f"{found.name}: route {found.taken}, {len(found.judged)} states, seed {found.seed}"]
    width = max(len(check.what) for check in found.checks)
    lines += [_line(check, width) for check in found.checks]
    lines += _wrapped("states: ", listed)
    if found.left_out:
        lines += _wrapped("", f"{found.left_out} states have no finite acceleration, left out")
    if OWN in counts:
        lines += _wrapped("", f"the scene's run followed to t = {found.until:.4g} s, inputs 0")
    for note in found.notes:
        lines += _wrapped("", note)
    if horizon is not None:
        lines += _wrapped("", horizon.words)
    return lines


def _line(check: Check, width: int) -> str:
    unit = f" {check.unit}" if check.unit else ""
    sign = ">" if check.above else "<="
    bound = "" if check.bound is None else f"{sign} {number(check.bound)}"
    verdict = "" if check.bound is None else "MISSED" if check.missed else "ok"
    rest = "; ".join(words for words in (check.at, check.words) if words)
    text = f"    {check.what:<{width}}  {number(check.value) + unit:>12}  {bound:<10}  {verdict:<6}"
    return f"{text}  {rest}".rstrip()


def _wrapped(label: str, text: str) -> list[str]:
    return textwrap.wrap(
        label + text,
        100,
        initial_indent="    ",
        subsequent_indent="    " + " " * len(label),
        break_long_words=False,
        break_on_hyphens=False,
    )


def number(value: float) -> str:
    """A number as text with few digits."""
    if not isfinite(value):
        return "none" if value != value else "infinite"
    return f"{value:.1f}" if 0.05 <= abs(value) < 9999.5 else f"{value:.2g}"


def missed(found: Verified) -> list[str]:
    """For each missed bound a line with its name, the state, and a remedy if there is one."""
    states = {one.state.label: one.state for one in found.judged}
    lines = []
    for check in found.missed:
        unit = f" {check.unit}" if check.unit else ""
        sign = "not above" if check.above else "above"
        bound = number(check.bound or 0.0)
        line = f"{check.what}: {number(check.value)}{unit}, {sign} its bound {bound}{unit}"
        if check.at:
            line += f", at state '{check.at}'{_numbers(states[check.at], found)}"
        lines.append(line + _remedy(check, found))
    return lines


def _numbers(state: State, found: Verified) -> str:
    if len(state.y) > SHOWN:
        return " (--save writes it out)"
    pairs = zip(found.states, state.y.tolist(), strict=True)
    words = [f"t={state.t!r}", *(f"{name}={value!r}" for name, value in pairs)]
    return f" ({', '.join(words + [f'{name}={value!r}' for name, value in state.u.items()])})"


def _remedy(check: Check, found: Verified) -> str:
    if not check.taken:
        return ""
    good = [other for other in found.better if other != found.taken]
    return f"; take --route {good[0]}, which keeps them" if good else ""


def evidence(found: Verified, horizon: Horizon | None, module: str) -> dict[str, Any]:
    """All results as data for JSON; `module` is a digest of the module's source."""
    return {
        "eomgen": f"verification of {found.name}",
        "scene": found.name,
        "route": found.taken,
        "module_sha256": module,
        "seed": found.seed,
        "passed": not found.missed,
        "checks": [
            {
                "what": check.what,
                "value": _plain(check.value),
                "bound": None if check.bound is None else _plain(check.bound),
                "above": check.above,
                "unit": check.unit,
                "ok": not check.missed,
                "at": check.at,
                "words": check.words,
            }
            for check in found.checks
        ],
        "notes": [*found.notes, *([horizon.words] if horizon else [])],
        "kinds": {**KINDS, OWN: "of the scene's run, inputs 0"},
        "names": list(found.states),
        "units": list(found.units),
        "left_out": found.left_out,
        "states": [
            {
                "state": one.state.label,
                "t": one.state.t,
                "y": one.state.y.tolist(),
                "u": one.state.u,
                "vd": one.vd.tolist(),
                "error_ulps": {r: _plain(float(errors[k])) for r, errors in found.ulps.items()},
                "one_ulp_in_the_data_ulps": _plain(float(found.data[k])),
                "condition": _plain(one.condition),
                "smallest_pivot": _plain(one.pivot),
                "digits_agreed": _plain(one.agreed),
                "losses_ulps": {
                    what: [_plain(loss.error), _plain(loss.data)]
                    for what, loss in (
                        *((f"residual of {route}", loss) for route, loss in one.residuals.items()),
                        *one.losses.items(),
                    )
                },
            }
            for k, one in enumerate(found.judged)
        ],
    }


def _plain(value: float) -> float | str:
    """A number, or its name if JSON has none for it."""
    return float(value) if isfinite(value) else str(float(value))


def paths(folder: Path, name: str, *, force: bool = False) -> tuple[Path, Path]:
    """The files for text and data. Raises `RunError` if they cannot be written."""
    check_folder(folder)
    text, data = folder / f"{name}_verified.txt", folder / f"{name}_verified.json"
    for path in (text, data):
        check_writable(path, force=force)
    return text, data


def save(
    folder: Path, name: str, lines: Sequence[str], found: dict[str, Any], *, force: bool = False
) -> tuple[Path, Path]:
    """Write both files, each atomically. Raises `RunError` as `paths` does."""
    text, data = paths(folder, name, force=force)
    write_whole(data, json.dumps(found, indent=1, ensure_ascii=False) + "\n", force=force)
    head = f"# eomgen verification of {name}\n"
    write_whole(text, head + "\n".join(lines) + "\n", force=force)
    return text, data
