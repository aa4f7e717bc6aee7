"""The pages of joints, effects and constraints in docs/reference, one for each entry.

The scene of a page is docs/reference/scenes/NAME.toml. An entry without such a file, as a new one,
is shown by the example of its table, on an arm with a hand.
"""

import tomllib
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import sympy as sp

import eomgen
from eomgen.base.errors import SceneError
from eomgen.derivation.steps import Step
from eomgen.language.base import Table
from eomgen.scene.importers.toml_text import toml_text
from eomgen.scene.kinds import AnyConstraint, Effect, Joint
from eomgen.scene.reader import parse_scene
from eomgen.scene.reference import by_type, reference_pages
from eomgen.scene.schema import Scene
from eomgen.show.derivation import sections
from eomgen.show.tex import tex

SCENES = Path(__file__).parent.parent / "docs" / "reference" / "scenes"
UNIONS = (Joint, Effect, AnyConstraint)
ENTRIES: dict[str, type[Table]] = {k: v for union in UNIONS for k, v in by_type(union).items()}
STYLE = "width:100%;height:620px;border:1px solid #8884;border-radius:6px"
LIVE = """\
```{{raw}} html
<iframe title="{title}" src="live/{name}.html" loading="lazy" style="{style}"></iframe>
```
"""
Formulas = Callable[[eomgen.Derivation, Step], Iterator[str]]
"""What writes the equations of a step, as lines of a page."""


def scene_text(name: str) -> str:
    """The scene of a page; its name is that of the entry."""
    file = SCENES / f"{name}.toml"
    if file.exists():
        return file.read_text("utf-8")
    for dimensions in (2, 3):
        tables = {**arm_with(ENTRIES[name].example, dimensions), "name": name}
        try:
            eomgen.check(tables)
        except SceneError as error:
            problem = error
            continue
        return toml_text(tables)
    raise problem


def arm_with(example: str, dimensions: int) -> dict[str, Any]:
    """The tables of an arm with a hand that hangs in the plane or in space, and in it those of an
    example.
    """
    inertia, pin = (0.1, [-0.4, 0]) if dimensions == 2 else ([0.1, 0.1, 0.1], [-0.4, 0, 0])
    shoulder = {"name": "shoulder", "type": "revolute", "parent": "world", "child": "arm"}
    elbow = {"name": "elbow", "type": "revolute", "parent": "arm", "child": "hand"}
    axis = {} if dimensions == 2 else {"axis": [0, -1, 0]}
    scene: dict[str, Any] = {
        "name": "example",
        "dimensions": dimensions,
        "parameters": {"m": 1.0, "l": 1.0},
        "bodies": [{"name": name, "mass": 1.0, "inertia_com": inertia} for name in ("arm", "hand")],
        "joints": [joint | axis | {"r_child": pin} for joint in (shoulder, elbow)],
        "effects": [{"type": "gravity", "g": 9.81}],
    }
    found = tomllib.loads(example)
    if isinstance(found.get("bodies"), dict):
        scene["bodies"][0] |= found.pop("bodies")
    for key, content in found.items():
        if not isinstance(content, list) or key not in scene:
            scene[key] = content
            continue
        same = "child" if key == "joints" else "name"
        new = {table.get(same, "") for table in content}
        scene[key] = [table for table in scene[key] if table.get(same, "") not in new] + content
    return scene


def told(name: str, scene: Scene, derived: eomgen.Derivation) -> list[Step]:
    """The steps of a derivation that say what an entry of the scene adds. Of one that has no steps
    of its own, as gravity, these are the accelerations.
    """
    union = next(u for u in UNIONS if name in by_type(u))
    kinds = {"joint", "motion"} if union is Joint else {"effect", "constraint"}
    tables = (*scene.joints, *scene.effects, *scene.constraints)
    entry = next(table for table in tables if table.type == name)
    found = [step for step in derived.steps if step.kind in kinds]
    own = [step for step in found if f"`{entry.name}`" in step.title]
    found = [step for step in own or found if step.equations] if own or union is Joint else []
    if found:
        return found
    state, solution = (next(s for s in derived.steps if s.kind == k) for k in ("state", "solution"))
    given = tuple(e for e in state.equations if not isinstance(e.right, sp.MatrixBase))
    return [replace(state, words="", equations=given), solution]


def as_tex(_: eomgen.Derivation, step: Step) -> Iterator[str]:
    """Equations as blocks of TeX, which hosts of source text draw."""
    for equation in step.equations:
        yield f"```math\n{tex(equation.left)} = {tex(equation.right)}\n```\n"


def as_mathml(found: eomgen.Derivation, step: Step) -> Iterator[str]:
    """Equations as browsers draw them without a script."""
    section = sections(found.model, [step], found.exposition.effects)[0]
    for text in section["equations"]:
        yield f'<div class="equation" tabindex="0"><math displaystyle="true">{text}</math></div>\n'


def entry_page(name: str, formulas: Formulas = as_tex) -> str:
    """What an entry is, its equations in its scene, its keys, and the scene, live."""
    head, _, rest = reference_pages()[f"{name}.md"].partition("\n| key |")
    keys = "| key |" + rest.partition("\n```toml")[0]
    text = scene_text(name)
    scene = parse_scene(text)
    found = eomgen.derive(scene)
    lines = [head, LIVE.format(title=scene.title or name, name=name, style=STYLE)]
    lines += [f"```toml\n# {name}.toml\n{text}```\n", "## Equations\n"]
    lines += ["As `derive` writes them for this scene.\n"]
    for step in told(name, scene, found):
        lines += [f"{step.words}\n"] if step.words and step.kind != "effect" else []
        lines += formulas(found, step)
    return "\n".join([*lines, "## Keys\n", keys.rstrip(), ""])
