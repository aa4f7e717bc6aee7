"""A cache of generated code, so that equations are not derived again for an unchanged scene.

The program from which code was written is a separate entry. It is read only where the program
itself is run, in extended precision or by studies.

The key is a digest of all that determines the code: the model without its notices, the relevant
files of this program, and the libraries that it uses. `eomgen.base.entries` ensures that an entry
is used only if this program wrote it.
"""

import hashlib
import importlib.metadata
import json
import marshal
import os
import pickle
import platform
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import astuple, dataclass, fields, replace
from functools import cache
from importlib.util import MAGIC_NUMBER
from pathlib import Path
from types import CodeType
from typing import TYPE_CHECKING

import platformdirs

from eomgen.base import plugins
from eomgen.base.entries import Entries
from eomgen.base.templating import PACKAGE, templates_folder
from eomgen.base.version import __version__
from eomgen.model.model import Model
from eomgen.program.passes import PassReport
from eomgen.program.program import Program
from eomgen.program.saving import restored, saved

if TYPE_CHECKING:
    from eomgen.codegen.interface import Interface
    from eomgen.language.formula import Formula

AFTER = (
    *(
        "store.py",
        "base/entries.py",
        "native",
        "run",
        "study",
        "fitting",
        "sweep",
        "show",
        "exports",
        "certified",
        "results",
    ),
    *("api", "commands", "__main__.py", "__init__.py"),
)
"""Files and folders of this program that do not influence the generated code; all others do."""
LIBRARIES = (
    *("gmpy2", "jinja2", "markupsafe", "mpmath", "numpy", "pydantic", "pydantic_core", "sympy"),
)
"""Libraries that are loaded to generate code, except those for type annotations alone."""
IF_THERE = ("python-flint",)
"""Libraries that SymPy loads where they are installed."""


def entries_of(part: str = "") -> Entries | None:
    """The entries of the store, or of a part of it that has a folder of its own: in the folder
    `EOMGEN_CACHE`, or in the user's cache folder.

    None if the user has no home folder.
    """
    chosen = os.environ.get("EOMGEN_CACHE") or platformdirs.user_cache_dir("eomgen")
    try:
        folder = Path(chosen).expanduser()
    except RuntimeError:  # there is no home to expand ~ to
        return None
    return Entries(folder / part, folder) if part else Entries(folder)


@dataclass(frozen=True)
class Code:
    """Generated code, with the fields of `eomgen.pipeline.Generated`.

    derived  whether it was derived now; else it comes from the store
    notice   a problem with the store, or ""
    """

    module: str
    reports: tuple[PassReport, ...]
    explanation: tuple[str, ...]
    notices: tuple[str, ...]
    digits: int | None
    derived: bool
    notice: str = ""


def generated_code(model: Model, *, anew: bool = False) -> Code:
    """A model's code, from the store, or derived and stored; derived in any case if `anew`.

    A store that cannot be trusted, read or written is not used, and the result has a notice. A
    damaged entry is replaced.
    """
    entries, key = entries_of(), key_of(model)
    kept = _code(entries.get(key)) if entries else None
    if kept and not anew:
        return kept
    # Imported here because the modules that derive equations take long to load.
    from eomgen.pipeline import generate

    new = generate(model)
    code = Code(new.module, new.reports, new.explanation, new.notices, new.digits, derived=True)
    if entries is None:
        return replace(code, notice="no store: there is no home folder; name one in EOMGEN_CACHE")
    trouble = entries.put(key, _content(code))
    trouble = trouble or _keep_program(entries, key, new.program, new.interface)
    if trouble:
        return replace(code, notice=f"the store {entries.folder} is not used: {trouble}")
    if kept and kept.module != code.module:
        notice = f"the store {entries.folder} held other code for this scene, which was replaced"
        return replace(code, notice=notice)
    return code


@dataclass(frozen=True)
class LiveCode:
    """What a model's page computes with, with the fields of `eomgen.pipeline.Live`."""

    source: str
    loads: tuple[tuple[str, str], ...]
    operations: int
    saved: Mapping[str, int]


def live_code(
    model: Model, geometry: Sequence["Formula"] = (), *, series: bool = False
) -> LiveCode:
    """The functions of a model's page, from the store, or derived and stored; `geometry` are the
    formulas of the function of that name. With `series` it has those of Taylor.

    A store that cannot be used is no obstacle.
    """
    entries = entries_of()
    text = f"page of {key_of(model)} with {tuple(geometry)!r}{' and series' * series}"
    key = hashlib.sha256(text.encode()).hexdigest()[:32]
    if entries and (kept := _live_code(entries.get(key))):
        return kept
    # Imported here because the modules that derive equations take long to load.
    from eomgen.pipeline import live

    new = live(model, geometry, series=series)
    code = LiveCode(new.source, new.loads, new.operations, new.saved)
    if entries:
        content = json.dumps([code.source, code.loads, code.operations, dict(code.saved)])
        entries.put(key, content.encode())
    return code


def _live_code(content: bytes | None) -> LiveCode | None:
    """The code of an entry that `live_code` wrote; None for any other bytes."""
    with suppress(ValueError, TypeError, AttributeError, RecursionError):
        source, loads, operations, saved = json.loads(content or b"")
        source.encode()  # fails for lone surrogates
        pairs = tuple((str(effect), str(body)) for effect, body in loads)
        counts = {str(name): int(count) for name, count in saved.items()}
        return LiveCode(source, pairs, int(operations), counts)
    return None


def kept_text(name: str, make: Callable[[], str]) -> str:
    """A text that only this program determines, from the store, or made and stored.

    A store that cannot be used is no obstacle.
    """
    entries = entries_of()
    key = hashlib.sha256(f"{name} of {package_digest()}".encode()).hexdigest()[:32]
    if entries and (content := entries.get(key)):
        return content.decode()
    new = make()
    if entries:
        entries.put(key, new.encode())
    return new


def bytecode_of(source: str) -> CodeType:
    """The source of a generated module, compiled by Python: from the store, or compiled and stored,
    since to compile a large one takes longer than a short run.

    A store that cannot be used is no obstacle.
    """
    entries = entries_of()
    text = b"bytecode " + MAGIC_NUMBER + source.encode()
    key = hashlib.sha256(text).hexdigest()[:32]
    if entries and (content := entries.get(key)):
        with suppress(ValueError, EOFError, TypeError):
            if isinstance(kept := marshal.loads(content), CodeType):
                return kept
    new = compile(source, "<string>", "exec", dont_inherit=True)
    if entries:
        entries.put(key, marshal.dumps(new))
    return new


def program_of(model: Model) -> Program:
    """The program of a model's code, from the store, or recorded and stored."""
    return interfaced_program_of(model)[0]


def interfaced_program_of(model: Model) -> tuple[Program, "Interface"]:
    """The program of a model's code and its interface, which is all that a backend needs."""
    entries, key = entries_of(), key_of(model)
    if entries and (kept := _kept_program(entries, key)):
        return kept
    # Imported here because the modules that derive equations take long to load.
    from eomgen.codegen.interface import interface_of
    from eomgen.pipeline import compile_program

    system = compile_program(model).system
    program, interface = system.program, interface_of(system)
    if entries:
        _keep_program(entries, key, program, interface)
    return program, interface


def _keep_program(entries: Entries, key: str, program: Program, interface: "Interface") -> str:
    """Store a program and its interface. Return why that failed, or ""."""
    return entries.put(_program_key(key), pickle.dumps((saved(program), interface)))


def _kept_program(entries: Entries, key: str) -> tuple[Program, "Interface"] | None:
    """A stored program and its interface; None if there is none."""
    content = entries.get(_program_key(key))
    if content is None:
        return None
    from eomgen.codegen.interface import Interface

    # A malformed pickle may raise any error. Unpickling can execute code, and so can the stored
    # module: `entries` checks that this user wrote both.
    with suppress(Exception):
        text, interface = pickle.loads(content)
        return (restored(text), interface) if isinstance(interface, Interface) else None
    return None


def _program_key(key: str) -> str:
    """The key of the program whose code has this key."""
    return hashlib.sha256(f"program of {key}".encode()).hexdigest()[:32]


def _content(code: Code) -> bytes:
    """The bytes of an entry for code."""
    reports = [astuple(report) for report in code.reports]
    return json.dumps([code.module, reports, code.explanation, code.notices, code.digits]).encode()


def _code(content: bytes | None) -> Code | None:
    """The code of an entry that `_content` wrote; None for any other bytes."""
    try:
        module, reports, explanation, notices, digits = json.loads(content or b"")
        passes = tuple(PassReport(*report) for report in reports)
        texts = [module, *explanation, *notices, *(report.name for report in passes)]
        "".join(texts).encode()  # fails for lone surrogates
    except (ValueError, TypeError, RecursionError):
        return None
    counts = [getattr(r, f.name) for r in passes for f in fields(r) if f.name != "name"]
    lists = all(type(part) is list for part in (reports, explanation, notices))
    counts += [] if digits is None else [digits]
    if not (lists and all(type(n) is int for n in counts)):
        return None
    return Code(module, passes, tuple(explanation), tuple(notices), digits, derived=False)


def key_of(model: Model) -> str:
    """The key of a model's code: a digest of all that determines it."""
    return hashlib.sha256(_generator_digest() + model.digest).hexdigest()[:32]


@cache
def package_digest() -> str:
    """A digest of all that generates code or runs it: another program may compute other bits."""
    others = [path for path in _files(PACKAGE, ".py") if _is_after(path)]
    digest = hashlib.sha256(_generator_digest())
    _add(digest, PACKAGE, others)
    return digest.hexdigest()[:32]


@cache
def this_program() -> str:
    """What distinguishes this program from others that may compute other numbers, in words: its
    version, a digest of its files, and the versions of what it computes with.
    """
    libraries = " ".join(f"{name} {_version(name)}" for name in ("numpy", "scipy"))
    python = f"Python {platform.python_version()}"
    return f"eomgen {__version__} ({package_digest()[:12]}; {python} {libraries})"


@cache
def _generator_digest() -> bytes:
    """A digest of all that generates code: Python, libraries, this program and its templates."""
    python = (platform.python_implementation(), platform.python_version(), platform.machine())
    digest = hashlib.sha256(
        repr((python, [_version(name) for name in (*LIBRARIES, *IF_THERE)])).encode()
    )
    _add(digest, PACKAGE, _sources())
    for name in ("c", "javascript", "python"):
        _add(digest, templates_folder(), _files(templates_folder() / name, ".jinja"))
    digest.update(plugins.digest())
    return digest.digest()


def _add(digest: "hashlib._Hash", root: Path, files: Sequence[Path]) -> None:
    """Add names and contents of files."""
    for path in files:
        digest.update(path.relative_to(root).as_posix().encode() + b"\0" + path.read_bytes())


def _version(library: str) -> str:
    try:
        return importlib.metadata.version(library)
    except importlib.metadata.PackageNotFoundError:
        return ""


def _sources() -> list[Path]:
    return [path for path in _files(PACKAGE, ".py") if not _is_after(path)]


def _is_after(path: Path) -> bool:
    inside = path.relative_to(PACKAGE)
    return inside.parts[0] in AFTER or inside.as_posix() in AFTER


@cache
def _files(root: Path, suffix: str) -> tuple[Path, ...]:
    """The files in a folder and those in it, in an order that is the same on all systems."""
    found = [Path(place) / name for place, _, names in os.walk(root) for name in names]
    kept = [path for path in found if path.name.endswith(suffix)]
    return tuple(sorted(kept, key=lambda path: path.as_posix()))
