"""Modules written and compared: `generate`."""

import shlex
from pathlib import Path

from eomgen.commands.shared import Arguments, code_of, read_model
from eomgen.errors import EomgenError, RunError, tell_refusal
from eomgen.files import check_folder, check_writable, read_plain, write_whole
from eomgen.scene.reader import built_in_names
from eomgen.store import Code

LARGEST = 2**30
"""Bytes of a module beyond which it is none of ours."""


def generate(given: Arguments) -> int:
    """Write modules, or with --check say which are stale.

    A scene or a file that is refused is told, and the others go on; then the exit code is 1.
    """
    scenes = list(dict.fromkeys([*given.scenes, *(built_in_names() if given.all else ())]))
    paths: dict[Path, str] = {}
    stale: list[str] = []
    refused: dict[str, None] = {}
    for scene in scenes:
        try:
            stale += [scene] if not _generate(scene, given, paths) else []
        except EomgenError as error:
            new = [line for line in error.lines if line not in refused]  # of a folder, say it once
            tell_refusal(EomgenError(*new))
            refused |= dict.fromkeys(new)
    if stale:
        raise RunError(
            f"{len(stale)} stale; run: eomgen generate {shlex.join(stale)} "
            f"-o {shlex.quote(str(given.output))}"
            + "".join(
                f" --{option} {shlex.quote(value)}"
                for option in ("form", "route", "outputs")
                if (value := getattr(given, option)) is not None
            )
        )
    return 1 if refused else 0


def _generate(scene: str, given: Arguments, paths: dict[Path, str]) -> bool:
    """Write or check a scene's module, whose file joins `paths`; whether it is fresh then."""
    model, name = read_model(scene, given)
    path = given.output / f"{name}.py"
    if path in paths:
        raise RunError(f"{path}: would be written for {paths[path]} and for {scene}; rename one")
    paths[path] = scene
    if not given.check:
        check_folder(given.output)
        check_writable(path, force=given.force)
    # What is checked is what would be derived now, whatever the store holds.
    code, _ = code_of(scene, model, given, anew=given.check)
    current = _text(path)
    fresh = current == code.module
    if fresh:
        print(f"{path}: fresh")
    elif given.check:
        print(f"{path}: {'missing' if current is None else 'stale'}")
    else:
        write_whole(path, code.module, force=given.force)
        print(f"{path}: written{'' if code.derived else ', not derived again'}")
    if given.explain:
        _print_explanation(code)
    if given.report:
        _print_report(code)
    return fresh or not given.check


def _text(path: Path) -> str | None:
    """What a file holds, of any encoding; None if there is none. Raises `RunError` for others."""
    if not path.exists():
        return None
    return read_plain(path, LARGEST).decode("utf-8", "replace")


def _print_explanation(code: Code) -> None:
    print(f"    {'route':<10}{'cost':>6}  (operations of derivative)")
    for line in code.explanation:
        print(f"    {line}")


def _print_report(code: Code) -> None:
    print(f"    {'pass':<20}{'steps':>8}{'derivative':>12}{'jacobian':>10}  (operations)")
    for line in code.reports:
        print(f"    {line.name:<20}{line.steps:>8}{line.derivative:>12}{line.jacobian:>10}")
