"""Expansion of chains: one table of a scene becomes links and revolute joints."""

from eomgen.base.errors import SceneError
from eomgen.language.base import LONGEST_NAME
from eomgen.language.formula import ZERO
from eomgen.language.quantity import with_components
from eomgen.scene.joints import Joint, Revolute
from eomgen.scene.schema import MOST, BodyTable, ChainTable, Scene


def written_out(scene: Scene) -> tuple[list[tuple[BodyTable, str]], list[tuple[Joint, str]]]:
    """Bodies and joints of a scene and its chains, each with its location in the scene.

    Raises `SceneError` if there is no body, if there are more than `MOST`, or if a chain has a
    vector of the wrong length or a name that becomes too long.
    """
    count = len(scene.bodies) + sum(chain.count for chain in scene.chains)
    if count > MOST:
        raise SceneError(f"chains: make {count} bodies in all; at most {MOST} are allowed")
    bodies = [(body, f"bodies[{i}]") for i, body in enumerate(scene.bodies)]
    joints = [(joint, f"joints[{i}]") for i, joint in enumerate(scene.joints)]
    for i, chain in enumerate(scene.chains):
        for body, joint in _links(chain, f"chains[{i}]", scene.dimensions):
            bodies.append((body, f"chains[{i}]"))
            joints.append((joint, f"chains[{i}]"))
    if not bodies:
        raise SceneError("bodies: missing; a scene needs at least one body, or a chain")
    return bodies, joints


def _links(chain: ChainTable, location: str, dimensions: int) -> list[tuple[BodyTable, Joint]]:
    longest = f"{chain.name}_joint_{chain.count}"
    if len(longest) > LONGEST_NAME:
        raise SceneError(
            f"{location}.name: makes the name '{longest}', which is longer than {LONGEST_NAME} "
            "characters; choose a shorter name"
        )
    # Checked here, so that messages have the chain's keys and not those of its links.
    start, r_parent, r_child = (
        with_components(getattr(chain, field), ZERO, dimensions, f"{location}.{field}")
        for field in ("start", "r_parent", "r_child")
    )
    links: list[tuple[BodyTable, Joint]] = []
    parent, pin = chain.parent, start
    for k in range(1, chain.count + 1):
        name = f"{chain.name}_{k}"
        body = BodyTable(
            name=name, mass=chain.mass, inertia_com=chain.inertia_com, shapes=chain.shapes
        )
        joint = Revolute(
            type="revolute",
            name=f"{chain.name}_joint_{k}",
            parent=parent,
            child=name,
            r_parent=pin,
            r_child=r_child,
            axis=chain.axis,
        )
        links.append((body, joint))
        parent, pin = name, r_parent
    return links
