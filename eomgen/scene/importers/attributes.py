"""Attributes of elements as texts and numbers. Errors say which, where, and what to do."""

import math
from collections.abc import Callable

from eomgen.base.text import brief
from eomgen.language.base import LARGEST
from eomgen.scene.importers.vectors import ORIGIN, Vector
from eomgen.scene.importers.xml_elements import Element


def required(element: Element, key: str, what: str) -> str:
    """The text of an attribute of `what`, such as "joint 'knee'". Raises `SceneError`."""
    text = element.attributes.get(key, "").strip()
    if not text:
        raise element.error(f"{what}: <{element.tag}> has no {key}; give it")
    return text


def child(element: Element, tag: str, what: str) -> Element:
    """The only child of a name. Raises `SceneError` if there is none."""
    found = element.first(tag)
    if found is None:
        raise element.error(f"{what}: has no <{tag}>; give one")
    return found


def number(element: Element, key: str, what: str, default: float | None = None) -> float:
    """An attribute as a finite number, or the default if it is absent. Raises `SceneError`."""
    if default is not None and key not in element.attributes:
        return default
    text = required(element, key, what)
    return _number(text, lambda why: element.error(f"{what}: <{element.tag}> {key}: {why}"))


def vector(element: Element | None, key: str, what: str, default: Vector = ORIGIN) -> Vector:
    """An attribute of three numbers, or the default if it or the element is absent.

    Raises `SceneError`.
    """
    if element is None or key not in element.attributes:
        return default
    where = f"{what}: <{element.tag}> {key}"
    words = required(element, key, what).split(maxsplit=4)
    if len(words) != 3:
        count = "more than 4" if len(words) > 4 else len(words)
        raise element.error(f"{where}: has {count} numbers; give 3")
    x, y, z = (_number(word, lambda why: element.error(f"{where}: {why}")) for word in words)
    return (x, y, z)


def _number(text: str, error: Callable[[str], Exception]) -> float:
    """A decimal number. Raises what `error` makes of the reason why it is none."""
    shown = brief(text)
    if "${" in text or "$(" in text:
        raise error(f"'{shown}' is to be expanded by xacro; run xacro first")
    try:
        if not text.isascii() or "_" in text:  # which `float` takes
            raise ValueError
        value = float(text)
    except ValueError:
        raise error(f"'{shown}' is not a number; give one") from None
    if not math.isfinite(value):
        raise error(f"'{shown}' is not a finite number; give one that is")
    if abs(value) > LARGEST:
        raise error(f"'{shown}' is larger than {LARGEST:g}; use SI units")
    return value + 0.0  # -0.0 becomes 0.0
