"""Untrusted text made safe to show.

A scene, a file's name or a library's message may contain escape sequences for the terminal, line
breaks that forge a message of this program, marks that reverse the direction of writing, or very
long text.
"""

import re
import unicodedata

LONGEST_LINE = 1000
"""Longest line of a message, in characters. A longer one is cut in the middle, because its end says
what to do.
"""
LONGEST_WORD = 200
LONGEST_VALUE = 60
_LONG_WORD = re.compile(rf"\S{{{LONGEST_WORD + 1},}}")


def escaped(text: str) -> str:
    r"""A text with all characters that are not printable escaped, as \n, \x1b, \u202e.

    Lone surrogates, which cannot be encoded, are escaped too.
    """
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)


def brief(text: str, most: int = LONGEST_VALUE) -> str:
    """Any text, escaped and cut to `most` characters, as a name or a value in a message."""
    if len(text) > 4 * most:  # so that text which is cut is not escaped first
        text = text[: 2 * most] + text[-2 * most :]
    return _without_middle(escaped(text), most)


def one_line(text: str) -> str:
    """Any text, escaped and cut, as one line of a message."""
    line = brief(text, 4 * LONGEST_LINE)
    line = _LONG_WORD.sub(lambda word: _without_middle(word[0], LONGEST_WORD), line)
    return _without_middle(line, LONGEST_LINE)


def breaks_lines(text: str) -> bool:
    """Whether a text has line breaks or other control characters."""
    return any(unicodedata.category(c) in ("Cc", "Zl", "Zp") for c in text)


def _without_middle(text: str, most: int) -> str:
    if len(text) <= most:
        return text
    return f"{text[: 2 * most // 3]}…{text[len(text) - most // 3 + 1 :]}"


def spelled(text: str, encoding: str) -> str:
    """A text with characters that an encoding lacks spelled out: θ as theta, ² as ^2."""
    return "".join(_spelled(c, encoding) for c in text)


_SPELLED = {
    "·": "*", "⋅": "*", "×": "x", "−": "-", "–": "-", "±": "+-", "∓": "-+", "≤": "<=", "≥": ">=",
    "≫": ">>", "≈": "~",
    "°": " deg", "µ": "u", "½": "1/2", "√": "sqrt", "∂": "d", "∫": "integral of ", "∘": "o",
    "\u0307": "_dot", "\u0308": "_ddot", "→": "->", "‘": "'", "’": "'", "“": '"', "”": '"',
}  # fmt: skip
_GREEK = re.compile(r"GREEK (SMALL|CAPITAL) LETTER ([A-Z]+)")


def _spelled(character: str, encoding: str) -> str:
    try:
        character.encode(encoding)
    except UnicodeEncodeError:
        pass
    else:
        return character
    if character in _SPELLED:
        return _SPELLED[character]
    greek = _GREEK.fullmatch(unicodedata.name(character, ""))
    if greek:
        word = greek[2].lower().replace("lamda", "lambda")
        return word if greek[1] == "SMALL" else word.capitalize()
    parts = unicodedata.normalize("NFKD", character)
    raised = "^" if "<super>" in unicodedata.decomposition(character) else ""
    accent = "_dot" if parts.endswith("\u0307") else ""
    plain = parts.encode("ascii", "ignore").decode()
    return raised + plain + accent if plain else ascii(character)[1:-1]
