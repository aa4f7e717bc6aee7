"""The command `generate`."""

import shlex
from pathlib import Path

from eomgen.api.generating import check_backend, compiled, freshness, translated
from eomgen.base.errors import EomgenError, InterruptedRunError, RunError, report_refusal
from eomgen.base.files import check_folder, check_writable
from eomgen.commands.shared import Arguments, read_model, reporter_of, required
from eomgen.results.module import Module
from eomgen.scene.built_in import built_in_names
from eomgen.show.terms import explained

LONGEST_LINE = 64
"""Letters of a line of code beside its term; the rest is cut off."""


def generate(given: Arguments) -> int:
    """Write modules, or with --check report which are stale.

    An error of one scene is reported, the other scenes are still done, and the exit code is 1.
    """
    scenes = list(dict.fromkeys([*given.scenes, *(built_in_names() if given.all else ())]))
    paths: dict[Path, str] = {}
    stale: list[str] = []
    refused: dict[str, None] = {}
    for done, scene in enumerate(scenes):
        try:
            stale += [scene] if not _generate(scene, given, paths) else []
        except KeyboardInterrupt:
            what = "checked" if given.check else "written"
            raise InterruptedRunError(
                f"interrupted at {scene}; {done} of {len(scenes)} modules are {what}"
            ) from None
        except EomgenError as error:
            # An error of the folder is reported once.
            new = [line for line in error.lines if line not in refused]
            report_refusal(EomgenError(*new))
            refused |= dict.fromkeys(new)
    if stale:
        raise RunError(
            f"{len(stale)} stale; run: eomgen generate {shlex.join(stale)} "
            f"-o {shlex.quote(str(given.output))}"
            + "".join(
                f" --{option} {shlex.quote(value)}"
                for option in ("form", "route", "outputs", "backend")
                if (value := getattr(given, option)) not in (None, "numpy")
            )
        )
    return 1 if refused else 0


def _generate(scene: str, given: Arguments, paths: dict[Path, str]) -> bool:
    """Write or check a scene's module and add its file to `paths`; return whether it is fresh."""
    model, name = read_model(scene, given)
    path = given.output / f"{name}{check_backend(given.backend)}"
    one = Path(str(path).casefold())  # file systems of macOS and Windows take A and a for the same
    if one in paths:
        raise RunError(f"{path}: would be written for {paths[one]} and for {scene}; rename one")
    paths[one] = scene
    if not given.check:
        check_folder(given.output)
        check_writable(path, force=given.force)
    # A check compares with what is derived now, not with the store.
    module, _ = compiled(
        model, asked=required(given, model), anew=given.check, reporter=reporter_of(given, scene)
    )
    python = module
    if given.backend != "numpy":
        module = translated(module, model, given.backend)
    status = freshness(module, path)
    fresh = status == "fresh" or (given.check and status == "listed")
    files = ", ".join([str(path), *module.others])
    if fresh:
        print(f"{files}: fresh")
    elif given.check:
        print(f"{files}: {status}")
    else:
        module.save(path, force=given.force)
        print(f"{files}: written{'' if module.derived else ', not derived again'}")
    if given.explain:
        _print_explanation(module)
        _print_terms(python)
    if given.report:
        _print_report(module)
    return fresh or not given.check


def _print_explanation(module: Module) -> None:
    print(f"    {'route':<10}{'cost':>6}  (operations of derivative)")
    for line in module.explanation:
        print(f"    {line}")


def _print_terms(module: Module) -> None:
    """Each line of the Python module with the term of the derivation that it came from."""
    kernel = ""
    for line in explained(module.source):
        if line.kernel != kernel:
            kernel = line.kernel
            print(f"    {kernel}: each line, and the term that it computes or is part of")
        text = line.line if len(line.line) <= LONGEST_LINE else f"{line.line[: LONGEST_LINE - 2]} …"
        print(f"      {text:<{LONGEST_LINE}}  {line.term}")


def _print_report(module: Module) -> None:
    print(f"    {'pass':<20}{'steps':>8}{'derivative':>12}{'jacobian':>10}  (operations)")
    for line in module.reports:
        print(f"    {line.name:<20}{line.steps:>8}{line.derivative:>12}{line.jacobian:>10}")
