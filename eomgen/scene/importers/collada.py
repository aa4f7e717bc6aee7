"""The corners of a COLLADA mesh (.dae): those of its geometries, moved by the nodes of its scene.

Lengths are in the file's unit, `meter`. As in ROS, the axis that a file calls up does not turn it.
"""

import xml.etree.ElementTree as xml

import numpy as np
import numpy.typing as npt
from defusedxml import DefusedXmlException
from defusedxml.ElementTree import fromstring

Array = npt.NDArray[np.float64]

MOST_NODES, MOST_CORNERS = 10_000, 20_000_000
"""Greatest number of nodes, and of corners of all. A node may use another many times."""


def corners_of(data: bytes) -> Array:
    """The corners (n, 3) in m. Raises `ValueError` for a file that cannot be read."""
    try:
        root = fromstring(data, forbid_dtd=True)
    except (xml.ParseError, DefusedXmlException, LookupError):
        raise ValueError("is no XML, or has a document type") from None
    for element in root.iter():
        element.tag = element.tag.rpartition("}")[2]
    meshes = {
        f"#{geometry.get('id', '')}": _positions(geometry) for geometry in root.iter("geometry")
    }
    nodes = {f"#{node.get('id', '')}": node for node in root.iter("node")}
    unit = root.find("asset/unit")
    meter = float(unit.get("meter", "1")) if unit is not None else 1.0
    found, nodes_left, corners_left = [np.zeros((0, 3))], MOST_NODES, MOST_CORNERS
    pending = [(node, np.eye(4)) for scene in root.iter("visual_scene") for node in scene]
    while pending:
        node, outer = pending.pop()
        nodes_left -= 1
        if nodes_left < 0 or corners_left < 0:
            raise ValueError("is too large")
        pose = outer @ _transform(node)
        for child in node:
            url = child.get("url", "")
            if child.tag == "node":
                pending.append((child, pose))
            elif child.tag == "instance_node" and url in nodes:
                pending.append((nodes[url], pose))
            elif child.tag == "instance_geometry" and url in meshes:
                corners_left -= len(meshes[url])
                found.append(meshes[url] @ pose[:3, :3].T + pose[:3, 3])
    return np.concatenate(found) * meter


def _positions(geometry: xml.Element) -> Array:
    """The corners of a geometry, in its own axes."""
    named = {f"#{source.get('id', '')}": source for source in geometry.iter("source")}
    found = [np.zeros((0, 3))]
    for given in geometry.iterfind("mesh/vertices/input[@semantic='POSITION']"):
        source = named.get(given.get("source", ""))
        numbers = None if source is None else source.find("float_array")
        accessor = None if source is None else source.find("technique_common/accessor")
        if numbers is not None:
            stride = 3 if accessor is None else int(accessor.get("stride", "3"))
            listed = _numbers(numbers)
            found.append(listed[: len(listed) // stride * stride].reshape(-1, stride)[:, :3])
    return np.concatenate(found)


def _transform(node: xml.Element) -> Array:
    """The transforms of a node, in their order."""
    pose = np.eye(4)
    for child in node:
        step = np.eye(4)
        if child.tag == "matrix":
            step = _numbers(child).reshape(4, 4)
        elif child.tag == "translate":
            step[:3, 3] = _numbers(child)
        elif child.tag == "scale":
            step[:3, :3] = np.diag(_numbers(child))
        elif child.tag == "rotate":
            step[:3, :3] = _turn(*_numbers(child))
        pose = pose @ step
    return pose


def _turn(x: float, y: float, z: float, degrees: float) -> Array:
    """The rotation by an angle about an axis (Rodrigues' formula)."""
    length = float(np.linalg.norm((x, y, z)))
    if not length:
        raise ValueError("has a rotation about no axis")
    a, b, c = x / length, y / length, z / length
    across, angle = np.array([[0, -c, b], [c, 0, -a], [-b, a, 0]]), np.radians(degrees)
    turned: Array = np.eye(3) + np.sin(angle) * across + (1 - np.cos(angle)) * across @ across
    return turned


def _numbers(element: xml.Element) -> Array:
    return np.array((element.text or "").split()).astype(np.float64)
