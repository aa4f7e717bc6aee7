"""Generated code kept by content, so that a scene whose module is fresh is not derived again.

The key is a digest of the model and of every file that has a say in the code, this program's own
included; what is found under it is what would be generated.
"""

import hashlib
import importlib.metadata
import os
from functools import cache
from pathlib import Path

import platformdirs

from eomgen.errors import RunError
from eomgen.files import write_whole
from eomgen.model import Model
from eomgen.templating import PACKAGE, templates_folder

NOT_IN_CODE = ("run", "show", "study", "scenes", "cli.py", "store.py", "__main__.py", "__init__.py")


def folder() -> Path:
    """Where generated code is kept: `EOMGEN_CACHE`, or the user's cache folder."""
    chosen = os.environ.get("EOMGEN_CACHE")
    return Path(chosen) if chosen else Path(platformdirs.user_cache_dir("eomgen"))


def generated_code(model: Model, *, derive_again: bool = False) -> tuple[str, str, bool]:
    """A model's module and page source, and whether they had to be derived now.

    A store that cannot be read or written is done without.
    """
    key = _key(model)
    module_path, poses_path = folder() / f"{key}.py", folder() / f"{key}.js"
    if not derive_again:
        try:
            return module_path.read_text("utf-8"), poses_path.read_text("utf-8"), False
        except (OSError, UnicodeDecodeError):
            pass
    # Imported here because it brings SymPy, which takes longer than everything else together.
    from eomgen.pipeline import generate

    code = generate(model)
    try:
        write_whole(module_path, code.module, force=True)
        write_whole(poses_path, code.poses, force=True)
    except RunError:
        pass
    return code.module, code.poses, True


def _key(model: Model) -> str:
    digest = hashlib.sha256(_generator_digest())
    digest.update(repr(model).encode())
    return digest.hexdigest()[:32]


@cache
def _generator_digest() -> bytes:
    digest = hashlib.sha256(importlib.metadata.version("sympy").encode())
    files = [
        path
        for path in PACKAGE.rglob("*.py")
        if path.relative_to(PACKAGE).parts[0] not in NOT_IN_CODE
    ]
    files += templates_folder().rglob("*.jinja")
    for path in sorted(files, key=lambda path: path.as_posix()):
        digest.update(path.name.encode() + b"\0" + path.read_bytes())
    return digest.digest()
