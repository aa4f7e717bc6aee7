"""What every table of a scene shares: strict types, no unknown keys, frozen once read."""

import keyword
import re
from typing import Annotated

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, Strict

LONGEST_NAME = 40


class Table(BaseModel):
    """A table of the scene: unknown keys are errors, text is never taken for a number."""

    model_config = ConfigDict(extra="forbid", frozen=True)


def _identifier(name: str) -> str:
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", name):
        raise ValueError("is no identifier: use letters a-z, digits and _, a letter first")
    if keyword.iskeyword(name) or keyword.issoftkeyword(name):
        raise ValueError("is a Python keyword: choose another name")
    if len(name) > LONGEST_NAME:
        raise ValueError(f"is longer than {LONGEST_NAME} characters")
    if name.endswith("_") or "__" in name:
        raise ValueError("ends in _ or contains __: choose another name")
    return name


Identifier = Annotated[str, AfterValidator(_identifier)]
"""A name that may stand in Python, JavaScript and LaTeX alike."""

Number = Annotated[float, Strict(), Field(allow_inf_nan=False)]
"""A finite number; whole numbers are taken too, text and booleans are not."""

Positive = Annotated[Number, Field(gt=0)]
Text = Annotated[str, Field(max_length=400)]
