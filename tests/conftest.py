"""What the tests share: fixtures, and which of them run in one process."""

import gc
import os
import signal
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from campaign import BUILT_IN, FULL, is_kept
from xdist.scheduler import LoadScopeScheduling

if TYPE_CHECKING:  # not imported here: the process that deals out tests runs none
    from matplotlib.figure import Figure
    from mechanisms import Compiled

    from eomgen.native.compiler import Compiler

os.environ.setdefault("SYMPY_GROUND_TYPES", "gmpy")  # as for users without python-flint
TOGETHER = {
    "closed": "generated handout identities pivots program routes".split(),
    "effects": "absence bookkeeping".split(),
}
"""Files whose tests ask for the same compiled scenes: these are made once a process."""
GROUPS = {name: group for group, names in TOGETHER.items() for name in names}
FIRST = "closed effects verify laws loop_runs choosing closed_form integrators native".split()
"""Groups and files that take longest, so that no process is left with one of them at the end."""


def pytest_configure() -> None:
    """Look for garbage seldom: a compiled scene is a hundred thousand things that are kept, and to
    go through them again and again takes a fifth of the time. And listen to interrupts, so that
    processes that tests start do: a shell starts what runs in the background deaf to them.
    """
    gc.set_threshold(100_000, 20, 20)
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def _group(nodeid: str) -> str:
    """What of the tests runs in one process: a file of its own, or several together."""
    name = nodeid.partition("::")[0].rpartition("/")[2].removeprefix("test_").removesuffix(".py")
    return GROUPS.get(name, name)


def _is_of_all(config: pytest.Config) -> bool:
    """Whether all tests were asked for, and no folder, file or mark."""
    return [Path(name).name for name in config.args] == ["tests"] and not config.option.markexpr


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """What takes longest comes first. Of cases that are more of the same, an ordinary run takes
    one of every n, of tests for full runs none, and if it is one of all tests, then none of those
    that stand apart; see the markers in pyproject.toml.
    """
    if not FULL:
        marks = ("full", "apart") if _is_of_all(config) else ("full",)
        seen: dict[str, int] = {}
        left = []
        for item in items:
            name = item.nodeid.partition("[")[0]
            seen[name] = seen.get(name, -1) + 1
            every = item.get_closest_marker("every")
            if any(map(item.get_closest_marker, marks)) or (
                every and not is_kept(seen[name], *every.args)
            ):
                left.append(item)
        config.hook.pytest_deselected(items=left)
        gone = set(map(id, left))
        items[:] = [item for item in items if id(item) not in gone]
    rank = {name: i for i, name in enumerate(FIRST)}
    items.sort(key=lambda item: rank.get(_group(item.nodeid), len(FIRST)))


class ByGroup(LoadScopeScheduling):  # type: ignore[misc]
    """Deals out groups. That of xdist's own marks does nothing with a pytest that keeps the
    name of a test elsewhere, as 9.2 does.
    """

    def _split_scope(self, nodeid: str) -> str:
        return _group(nodeid)


def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> ByGroup:
    """Called by xdist."""
    return ByGroup(config, log)


@pytest.fixture(scope="session", params=BUILT_IN)
def built_in(request: pytest.FixtureRequest) -> "Compiled":
    """Each built-in scene, compiled once."""
    from mechanisms import compiled

    return compiled(request.param)


def _blank(*_: Any) -> "Figure":
    from matplotlib.figure import Figure

    return Figure((1, 1))


@pytest.fixture(scope="module", autouse=True)
def _blank_motions(request: pytest.FixtureRequest) -> Iterator[None]:
    """Figures of runs are written, but blank: of a short run they take nine tenths of the time, and
    what they show is tested in `show`, where they are not.
    """
    with pytest.MonkeyPatch.context() as patch:
        if request.path.parent.name != "show":
            patch.setattr("eomgen.show.figure.draw_motion", _blank)
        yield


@pytest.fixture
def blank_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    """The same of studies, and in `show`."""
    monkeypatch.setattr("eomgen.show.figure.draw_motion", _blank)
    monkeypatch.setattr("eomgen.show.work_precision.draw", _blank)


@pytest.fixture(scope="session", autouse=True)
def _in_short() -> Iterator[None]:
    """Calls and runs are timed as seldom as may be: no test asks how long something took. C is
    compiled without optimisation, which takes a third of the time and changes no bit: tests with
    the fixture `optimised` show that. And the parser of the command line is made once.
    """
    from eomgen.commands.main import parsers

    compile_c = _compile_c()

    def plainly(self: "Compiler", sources: Mapping[str, str], main: str, *flags: str) -> bytes:
        texts = {
            name: text.replace('optimize("O3", ', "optimize(") for name, text in sources.items()
        }
        return compile_c(self, texts, main, *("-O0" if x[:2] == "-O" else x for x in flags))

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("eomgen.native.compiler.Compiler.shared_library", plainly)
        patch.setattr("eomgen.commands.main.parsers", cache(parsers))
        patch.setattr("eomgen.study.timing.TIMING", 0.0)
        patch.setattr("eomgen.study.accuracy.work_precision.REPEATS", 0.0)
        yield


@cache
def _compile_c() -> Callable[..., bytes]:
    """The compiler's own way, which is asked for before it is replaced."""
    from eomgen.native.compiler import Compiler

    return Compiler.shared_library


@pytest.fixture
def optimised(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """C is compiled as for users."""
    monkeypatch.setattr("eomgen.native.compiler.Compiler.shared_library", _compile_c())
    monkeypatch.setenv("EOMGEN_CACHE", str(tmp_path / "optimised"))


@pytest.fixture(scope="session", autouse=True)
def _own_store(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Generated code of the tests is kept apart from the user's, in one store for all processes."""
    own = tmp_path_factory.getbasetemp()
    store = (own.parent if "PYTEST_XDIST_WORKER" in os.environ else own) / "store"
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("EOMGEN_CACHE", str(store))
        yield


@pytest.fixture
def mujoco_in_this_process(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """MuJoCo compiles here, which takes a tenth of the time of a process for each file."""
    from eomgen.scene.importers.mjcf import compiled
    from eomgen.scene.importers.mjcf.compiler import compile_file

    def compile_here(path: Path) -> tuple[int, bytes, list[str]]:
        code, data, message = compile_file(str(path.absolute()))
        return code, data, [message] if message else []

    monkeypatch.setattr(compiled, "_compile", compile_here)
    monkeypatch.chdir(tmp_path)  # MuJoCo writes its log here
