"""Prose of descriptions in paragraphs and lists, with what is code and what is a formula marked."""

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

Kind = Literal["word", "code", "name", "power"]
NAME = re.compile(
    r"(?<![\w<.])([A-Za-zα-ωΑ-Ω]|I\^[Aa]|p\^[Aa])_([A-Za-z0-9]\w*(?:,[a-z]+)*)(?![\w(])|I\^A|p\^A|r\^×|I\^a|p\^a|\^(?:\([^)]*\)|-?[\w.]*\w)"
)
"""A letter with a subscript, such as f_j, which prose writes as formulas do; a power."""
WORD = re.compile(r"(?<![\w`<])([A-Za-z]{2,}\w*_\w+)(?![\w`(])")
"""A name of the language of scenes."""


@dataclass(frozen=True)
class Block:
    """A paragraph, or a list of items; each text in pieces with what they are."""

    items: tuple[tuple[tuple[Kind, str], ...], ...]
    listed: bool


def blocks(words: str) -> tuple[Block, ...]:
    """The paragraphs and lists of a text: blank lines divide, "- " starts an item."""
    found = []
    for part in re.split(r"\n\s*\n", words.strip()):
        if not part:
            continue
        listed = part.startswith("- ")
        items = re.split(r"^- ", part, flags=re.MULTILINE)[1:] if listed else [part]
        found.append(Block(tuple(pieces(item) for item in items), listed))
    return tuple(found)


def pieces(text: str) -> tuple[tuple[Kind, str], ...]:
    """A text in words, code and names."""
    found: list[tuple[Kind, str]] = []
    for i, part in enumerate(_marked(" ".join(text.split())).split("`")):
        if i % 2:
            found.append(("code", part))
            continue
        start = 0
        for match in NAME.finditer(part):
            found.append(("word", signs(part[start : match.start()])))
            power = match[0].startswith("^")
            text = signs(match[0][1:].strip("()")) if power else match[0]
            found.append(("power" if power else "name", text))
            start = match.end()
        found.append(("word", signs(part[start:])))
    return tuple(piece for piece in found if piece[1])


def _marked(text: str) -> str:
    """The text with its names of the scene's language marked as code too."""
    parts = text.split("`")
    parts[::2] = [WORD.sub(r"`\1`", part) for part in parts[::2]]
    return "`".join(parts)


def signs(text: str) -> str:
    """Words with minus signs and dashes in place of hyphens where they are meant."""
    text = re.sub(r"(?<=[\d)])-(?=[\d(])", "–", text)
    text = text.replace("<=", "≤").replace(">=", "≥").replace(">>", "≫")
    return re.sub(r"(?<![\w)\]-])-(?=[\w(|]|$)| - ", lambda m: m[0].replace("-", "−"), text)


def joined(
    found: tuple[tuple[Kind, str], ...],
    word: Callable[[str], str],
    code: Callable[[str], str],
    name: Callable[[str], str],
    power: Callable[[str], str],
) -> str:
    """One text, its words, its code, its names and its powers written by functions."""
    writers = {"word": word, "code": code, "name": name, "power": power}
    return "".join(writers[kind](text) for kind, text in found)
