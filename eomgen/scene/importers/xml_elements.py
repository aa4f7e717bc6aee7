"""XML of untrusted files, as elements with their lines.

Document type declarations, and with them all entities, are refused, so that a file cannot expand in
memory or name other files.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import ParseError

from defusedxml import DefusedXmlException
from defusedxml.ElementTree import DefusedXMLParser

from eomgen.base.errors import SceneError
from eomgen.base.files import read_plain

LARGEST_FILE = 2_000_000
DEEPEST = 100
"""Greatest depth of elements within elements."""
MOST_ELEMENTS = 100_000


@dataclass(frozen=True)
class Element:
    """An element of XML, without its text.

    tag         its name, without its namespace
    namespace   the address of its namespace; "" without one
    attributes  their texts, by name
    file, line  where it begins
    """

    tag: str
    namespace: str
    attributes: Mapping[str, str]
    file: str
    line: int
    children: list["Element"] = field(default_factory=list)

    def all(self, tag: str) -> list["Element"]:
        """The children of this name."""
        return [child for child in self.children if child.tag == tag]

    def first(self, tag: str) -> "Element | None":
        """The first child of this name."""
        return next((child for child in self.children if child.tag == tag), None)

    def error(self, text: str) -> SceneError:
        """An error of this element, to be raised."""
        return SceneError(f"{self.file}:{self.line}: {text}")

    def walk(self) -> Iterator["Element"]:
        """This element and all within it, in the order of the file."""
        pending = [self]
        while pending:
            found = pending.pop()
            yield found
            pending += reversed(found.children)


class _Tree:
    """Collects elements for a parser. Raises `SceneError` if they are too deep or too many."""

    def __init__(self, name: str) -> None:
        self.name, self.parser, self.count = name, None, 0
        self.root: Element | None = None
        self.open: list[Element] = []

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        line = self._line()
        self.count += 1
        if self.count > MOST_ELEMENTS:
            raise SceneError(f"{self.name}:{line}: has more than {MOST_ELEMENTS} elements")
        if len(self.open) >= DEEPEST:
            raise SceneError(f"{self.name}:{line}: has elements more than {DEEPEST} deep")
        namespace, _, local = tag.rpartition("}")
        found = Element(local, namespace.removeprefix("{"), attributes, self.name, line)
        if self.open:
            self.open[-1].children.append(found)
        else:
            self.root = found
        self.open.append(found)

    def end(self, tag: str) -> None:
        self.open.pop()

    def close(self) -> Element | None:
        return self.root

    def _line(self) -> int:
        expat: Any = getattr(self.parser, "parser", None)
        return expat.CurrentLineNumber if expat else 0


def read_xml(path: Path) -> Element:
    """The root element of a file.

    Raises `SceneError` if it cannot be read, is no XML, or has a document type declaration.
    """
    data = read_plain(path, LARGEST_FILE, name=path.name, error=SceneError)
    tree = _Tree(path.name)
    parser: Any = DefusedXMLParser(target=tree, forbid_dtd=True)
    tree.parser = parser
    try:
        parser.feed(data)
        parser.close()
    except ParseError as error:
        line, column = error.position
        why = str(error).partition(": line ")[0]
        raise SceneError(f"{path.name}:{line}: is not XML: {why} at column {column}") from None
    except DefusedXmlException:
        line = parser.parser.CurrentLineNumber
        raise SceneError(
            f"{path.name}:{line}: has a document type declaration, which may name other files or "
            "expand in memory; remove <!DOCTYPE …>"
        ) from None
    except (ValueError, LookupError) as error:  # an encoding that does not exist, or lone bytes
        raise SceneError(f"{path.name}: is not XML: {error}") from None
    assert tree.root is not None
    return tree.root
