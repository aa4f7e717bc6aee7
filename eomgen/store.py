"""Generated code kept, so that a scene whose module is fresh is not derived again.

Beside the code lies the program that it was written from, in an entry of its own, which is read
only where the program is run: in many digits, by studies.

The key is a digest of what enters the code: the model without its notices, every file of this
program that has a say, and the libraries it is made with. What is found under it is taken only as
this program wrote it, see `eomgen.entries`.
"""

import hashlib
import importlib.metadata
import json
import os
import pickle
import platform
from contextlib import suppress
from dataclasses import astuple, dataclass, fields, replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

import platformdirs

from eomgen.entries import Entries
from eomgen.model.model import Model
from eomgen.program.passes import PassReport
from eomgen.program.program import Program
from eomgen.program.saving import ProgramError, restored, saved
from eomgen.templating import PACKAGE, templates_folder

if TYPE_CHECKING:
    from eomgen.codegen.interface import Interface

AFTER = (
    *(
        "store.py",
        "entries.py",
        "native",
        "run",
        "precision",
        "linear",
        "study",
        "show",
        "results.py",
    ),
    *("api", "commands", "cli.py", "__main__.py", "__init__.py"),
)
"""Files and folders of this program that have no say in the code; all others have."""
LIBRARIES = (
    *("gmpy2", "jinja2", "markupsafe", "mpmath", "numpy", "pydantic", "pydantic_core", "sympy"),
)
"""Whatever is loaded to generate code, but for what only states types."""


def folder(within: str = "") -> Path | None:
    """Where code is kept, or what is kept `within`: `EOMGEN_CACHE`, or the user's cache folder.

    None if the user has no home.
    """
    chosen = os.environ.get("EOMGEN_CACHE") or platformdirs.user_cache_dir("eomgen")
    try:
        return Path(chosen).expanduser() / within
    except RuntimeError:  # there is no home to expand ~ to
        return None


@dataclass(frozen=True)
class Code:
    """What a model is compiled to, as `eomgen.pipeline.Generated`, and whether only just now.

    `notice` is what there is to say of the store: why it was not used; or "".
    """

    module: str
    poses: str
    reports: tuple[PassReport, ...]
    explanation: tuple[str, ...]
    notices: tuple[str, ...]
    derived: bool
    notice: str = ""


def generated_code(model: Model, *, anew: bool = False) -> Code:
    """A model's code, from the store or derived now.

    A store that cannot be trusted, read or written is done without, with a notice; what is damaged
    in it is made again. With `anew` nothing that it holds is believed.
    """
    directory, key = folder(), _key(model)
    kept = _code(Entries(directory).get(key)) if directory else None
    if kept and not anew:
        return kept
    # Imported here because it brings what derives, which takes long to load.
    from eomgen.pipeline import generate

    made = generate(model)
    code = Code(made.module, made.poses, made.reports, made.explanation, made.notices, derived=True)
    if directory is None:
        return replace(code, notice="no store: there is no home folder; name one in EOMGEN_CACHE")
    entries = Entries(directory)
    trouble = entries.put(key, _content(code))
    trouble = trouble or _keep_program(entries, key, made.program, made.interface)
    if trouble:
        return replace(code, notice=f"the store {directory} is not used: {trouble}")
    if kept and (kept.module, kept.poses) != (code.module, code.poses):
        notice = f"the store {directory} held other code for this scene, which was put right"
        return replace(code, notice=notice)
    return code


def program_of(model: Model) -> Program:
    """The program of a model's code, from the store beside it or recorded now."""
    return interfaced_program_of(model)[0]


def interfaced_program_of(model: Model) -> tuple[Program, "Interface"]:
    """The same with its interface: what a backend writes code of."""
    directory, key = folder(), _key(model)
    if directory and (kept := _kept_program(Entries(directory), key)):
        return kept
    # Imported here because it brings what derives, which takes long to load.
    from eomgen.codegen.interface import interface_of
    from eomgen.pipeline import compile_program

    system = compile_program(model).system
    made = system.program, interface_of(system)
    if directory:
        _keep_program(Entries(directory), key, *made)
    return made


def _keep_program(entries: Entries, key: str, program: Program, interface: "Interface") -> str:
    """Keep a program and its interface beside code of this key; why not, or ""."""
    return entries.put(_beside(key), pickle.dumps((saved(program), interface)))


def _kept_program(entries: Entries, key: str) -> tuple[Program, "Interface"] | None:
    content = entries.get(_beside(key))
    if content is None:
        return None
    with suppress(ProgramError, pickle.UnpicklingError, ValueError, TypeError):
        # To be trusted as the module is that lies beside it, and is executed: see `entries`.
        text, interface = pickle.loads(content)
        return restored(text), interface
    return None


def _beside(key: str) -> str:
    """The key of the program beside that of its code."""
    return hashlib.sha256(f"program of {key}".encode()).hexdigest()[:32]


def _content(code: Code) -> bytes:
    """The bytes that are kept of code."""
    reports = [astuple(report) for report in code.reports]
    return json.dumps([code.module, code.poses, reports, code.explanation, code.notices]).encode()


def _code(content: bytes | None) -> Code | None:
    """The code of which these bytes were kept; None for anything else."""
    try:
        module, poses, reports, explanation, notices = json.loads(content or b"")
        made = tuple(PassReport(*report) for report in reports)
        texts = [module, poses, *explanation, *notices, *(report.name for report in made)]
        "".join(texts).encode()  # which half of a surrogate pair cannot be
    except (ValueError, TypeError, RecursionError):
        return None
    counts = [getattr(r, f.name) for r in made for f in fields(r) if f.name != "name"]
    lists = all(type(part) is list for part in (reports, explanation, notices))
    if not (lists and all(type(n) is int for n in counts)):
        return None
    return Code(module, poses, made, tuple(explanation), tuple(notices), derived=False)


def _key(model: Model) -> str:
    digest = hashlib.sha256(_generator_digest())
    digest.update(repr(replace(model, notices=())).encode())
    return digest.hexdigest()[:32]


@cache
def _generator_digest() -> bytes:
    """A digest of all that makes code of a model: Python, libraries, this program, templates."""
    python = (platform.python_implementation(), platform.python_version(), platform.machine())
    digest = hashlib.sha256(repr((python, [_version(name) for name in LIBRARIES])).encode())
    for root, files in ((PACKAGE, _sources()), (templates_folder(), _templates())):
        for path in sorted(files, key=lambda path: path.as_posix()):
            digest.update(path.relative_to(root).as_posix().encode() + b"\0" + path.read_bytes())
    return digest.digest()


def _version(library: str) -> str:
    try:
        return importlib.metadata.version(library)
    except importlib.metadata.PackageNotFoundError:
        return ""


def _sources() -> list[Path]:
    files = PACKAGE.rglob("*.py")
    return [path for path in files if path.relative_to(PACKAGE).parts[0] not in AFTER]


def _templates() -> list[Path]:
    return [
        path
        for name in ("python", "javascript", "c")
        for path in (templates_folder() / name).rglob("*.jinja")
    ]
