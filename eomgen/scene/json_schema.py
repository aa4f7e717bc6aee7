"""The JSON Schema of the scene language, which editors read for completion and checks."""

import json

from eomgen.language.quantity import of_any_joint
from eomgen.scene.schema import Scene


def json_schema() -> str:
    """The schema as JSON text, with the same bytes on each call."""
    schema = Scene.model_json_schema()
    _without_internals(schema)
    schema = {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}
    return json.dumps(schema, indent=2) + "\n"


def _without_internals(node: object) -> None:
    """Remove entries that only this program reads; move the unit into the description."""
    if isinstance(node, dict):
        if isinstance(node.get("unit"), str):  # our entry, not a property of that name
            words = f"{node.get('description', '')} ({node.pop('unit')})"
            node["description"] = of_any_joint(words)
        for internal, kind in (("bound", str), ("sees", list)):
            if isinstance(node.get(internal), kind):
                del node[internal]
        for value in node.values():
            _without_internals(value)
    elif isinstance(node, list):
        for value in node:
            _without_internals(value)
