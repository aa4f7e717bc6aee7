"""Limits of joints as rigid stops."""

from eomgen.scene.importers.parts import Parts


def add_stops(made: Parts) -> list[str]:
    """Add a rigid stop without bounce to each joint that has limits, but for coordinates that
    follow others, or are locked; names of joints that started beyond their limits.

    A body cannot start inside a stop, so these start in the middle between their limits; what
    follows is found.
    """
    following = [c["coordinate"] for c in made.constraints if "coordinate" in c]
    moved = list[str]()
    for joint in made.joints:
        if "limits" not in joint or joint["coordinate"] in {*following, *made.locked}:
            continue
        (low, high), name, coordinate = joint["limits"], joint["name"], joint["coordinate"]
        stop = {"type": "joint_stop", "name": f"{name}_stop", "joint": name}
        made.effects.append(stop | {"low": low, "high": high, "restitution": 0.0})
        if not low <= made.start.get(coordinate, 0.0) <= high:
            made.start[coordinate] = (low + high) / 2
            moved.append(name)
    if moved:
        for coordinate in following:
            made.start.pop(coordinate, None)
    return moved
