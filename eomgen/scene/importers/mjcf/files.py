"""The files that an MJCF file would open, checked before MuJoCo sees it.

MuJoCo resolves a name in several folders: beside the main file, beside the file that includes
another, in `meshdir`, `texturedir` and `assetdir`. A name is refused if in any of them it would be
outside of the allowed folders.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path

from eomgen.base.text import brief
from eomgen.scene.importers.xml_elements import MOST_ELEMENTS, Element, read_xml

FOLDERS = ("meshdir", "texturedir", "assetdir")
DEEPEST = 20
"""Greatest depth of files that include files."""
MOST_FILES = 1000
LARGEST_ASSET = 200_000_000
MOST_POINTS = 100_000_000
"""Greatest number of points of a field of heights, and of a picture."""


def check_files(path: Path, root: Element, allowed: Sequence[Path]) -> None:
    """Check the files that an MJCF file names, and those that these include.

    Raises `SceneError`, with file and line, for one outside of the file's folder and the `allowed`
    ones, one that is not XML, or includes without end.
    """
    folders = [folder.resolve() for folder in (path.parent, *allowed)]
    check_sizes(root)
    elements = list(_with_includes(path, root, folders))
    within = {path.parent.resolve(), *(file.parent.resolve() for file, _ in elements)}
    for _, element in elements:
        if element.tag == "compiler":
            for key in FOLDERS:
                if name := element.attributes.get(key, "").strip():
                    for base in (path.parent, *(file.parent for file, _ in elements)):
                        within.add(_inside(base, name, element, folders))
    for _, element in elements:
        for key, name in element.attributes.items():
            if key.startswith("file") and element.tag != "include":
                for base in sorted(within):
                    _check_size(_inside(base, name, element, folders), name, element)


def _with_includes(
    path: Path, root: Element, folders: Sequence[Path]
) -> Iterator[tuple[Path, Element]]:
    """All elements of a file and of those that it includes, each with its file."""
    pending, count = [(path, root, 0)], 0
    while pending:
        file, top, depth = pending.pop()
        for element in top.walk():
            yield file, element
            if not _reads_mjcf(element):
                continue
            count += 1
            name = element.attributes["file"].strip()
            if depth >= DEEPEST or count > MOST_FILES:
                raise element.error(
                    f"includes '{brief(name)}', more than {DEEPEST} files deep or "
                    f"{MOST_FILES} in all; does a file include itself?"
                )
            tried = {_inside(base, name, element, folders) for base in (file.parent, path.parent)}
            # MuJoCo takes one of them.
            found = sorted(other for other in tried if other.is_file())
            if not found:
                raise element.error(f"no file '{brief(name)}' to include; correct its name")
            for other in found:
                inner = read_xml(other)
                check_sizes(inner)
                pending.append((other, inner, depth + 1))


def _reads_mjcf(element: Element) -> bool:
    """Whether an element names another file of MJCF."""
    return element.tag in ("include", "model") and "file" in element.attributes


def _inside(base: Path, name: str, element: Element, folders: Sequence[Path]) -> Path:
    """The file of a name in a folder. Raises `SceneError` if it is outside of the allowed ones."""
    try:
        found = (base / name.strip().replace("\\", "/")).resolve()  # as MuJoCo reads it
        inside = any(found.is_relative_to(folder) for folder in folders)
    except (OSError, ValueError, RuntimeError):
        inside = False
    if not inside:
        raise element.error(
            f"'{brief(name)}' is outside of the file's folder; allow its folder with --allow DIR"
        )
    return found


def _check_size(path: Path, name: str, element: Element) -> None:
    try:
        if not path.exists() or path.is_dir():
            return
        ordinary, size = path.is_file(), path.stat().st_size
    except OSError as error:
        raise element.error(f"'{brief(name)}' cannot be read: {error.strerror}") from None
    if not ordinary:
        raise element.error(f"'{brief(name)}' is no ordinary file; name one that is")
    if size > LARGEST_ASSET:
        raise element.error(f"'{brief(name)}' is larger than {LARGEST_ASSET} bytes")


def check_sizes(root: Element) -> None:
    """Check what a few attributes could make large: numbers of copies, and of points in a grid.

    Raises `SceneError` with file and line.
    """
    pending, total = [(root, 1)], 0
    while pending:
        element, copies = pending.pop()
        if count := _product(element, ("count",)):
            copies *= count
        if _product(element, ("nrow", "ncol")) > MOST_POINTS:
            raise element.error(f"has more than {MOST_POINTS} points; give a coarser grid")
        if _product(element, ("width", "height")) > MOST_POINTS:
            raise element.error(f"has more than {MOST_POINTS} points; give a smaller picture")
        total += copies
        if total > MOST_ELEMENTS:
            raise element.error(
                f"the file has more than {MOST_ELEMENTS} elements with all copies; make fewer"
            )
        pending += [(child, copies) for child in element.children]


def _product(element: Element, keys: Sequence[str]) -> int:
    """The product of the positive whole numbers of some attributes, 0 without any."""
    words = [word for key in keys for word in element.attributes.get(key, "").split()]
    found = 0
    for word in words:
        if word.isascii() and word.isdigit() and int(word[:20]):
            found = max(found, 1) * int(word[:20])
    return found
