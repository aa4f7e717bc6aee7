"""Generated code kept by content, so that a scene whose module is fresh is not derived again.

The key is a digest of what enters the code: the model without its looks, and every file of this
program that has a say. What is found under it is taken only if it is whole.
"""

import hashlib
import importlib.metadata
import json
import os
from contextlib import suppress
from dataclasses import astuple, dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import platformdirs

from eomgen.errors import RunError
from eomgen.files import write_whole
from eomgen.model import Model
from eomgen.program.passes import PassReport
from eomgen.scene.look import Camera
from eomgen.scene.schema import Simulation
from eomgen.templating import PACKAGE, templates_folder

SOURCES = ("language", "joints", "effects", "derivation", "program", "backends")
"""Folders of this program that have a say in the code; the single files are named below."""
SINGLE = ("model.py", "pipeline.py", "templating.py")


def folder() -> Path:
    """Where generated code is kept: `EOMGEN_CACHE`, or the user's cache folder."""
    chosen = os.environ.get("EOMGEN_CACHE")
    return Path(chosen) if chosen else Path(platformdirs.user_cache_dir("eomgen"))


@dataclass(frozen=True)
class Code:
    """What a model is compiled to, as `eomgen.pipeline.Generated`, and whether only just now."""

    module: str
    poses: str
    reports: tuple[PassReport, ...]
    explanation: tuple[str, ...]
    notices: tuple[str, ...]
    derived: bool


def generated_code(model: Model) -> Code:
    """A model's code, from the store or derived now.

    A store that cannot be read or written, or is damaged, is done without.
    """
    path = folder() / f"{_key(model)}.json"
    kept = _kept(path)
    if kept is not None:
        return kept
    # Imported here because it brings what derives, which takes long to load.
    from eomgen.pipeline import generate

    made = generate(model)
    reports = [astuple(report) for report in made.reports]
    parts = [made.module, made.poses, reports, made.explanation, made.notices]
    with suppress(RunError):
        write_whole(path, json.dumps({"digest": _digest(parts), "parts": parts}), force=True)
    return Code(**vars(made), derived=True)


def _kept(path: Path) -> Code | None:
    """What a file of the store holds, or None if it is not whole."""
    try:
        entry = json.loads(path.read_text("utf-8"))
        module, poses, reports, *told = entry["parts"]
        if entry["digest"] != _digest(entry["parts"]):
            return None
        reports = tuple(PassReport(*report) for report in reports)
        explanation, notices = map(tuple, told)
        return Code(module, poses, reports, explanation, notices, derived=False)
    except (OSError, ValueError, TypeError, KeyError, RecursionError):
        return None


def _digest(parts: list[Any]) -> str:
    return hashlib.sha256(json.dumps(parts).encode()).hexdigest()


def _key(model: Model) -> str:
    bodies = tuple(replace(body, shapes=()) for body in model.bodies)
    bare = replace(model, bodies=bodies, simulation=Simulation(), camera=Camera(), notices=())
    digest = hashlib.sha256(_generator_digest())
    digest.update(repr(bare).encode())
    return digest.hexdigest()[:32]


@cache
def _generator_digest() -> bytes:
    digest = hashlib.sha256(importlib.metadata.version("sympy").encode())
    files = [PACKAGE / name for name in SINGLE]
    files += [path for name in SOURCES for path in (PACKAGE / name).rglob("*.py")]
    files += [path for name in ("python", "javascript") for path in _templates(name)]
    for path in sorted(files, key=lambda path: path.as_posix()):
        digest.update(path.name.encode() + b"\0" + path.read_bytes())
    return digest.digest()


def _templates(name: str) -> list[Path]:
    return list((templates_folder() / name).rglob("*.jinja"))
