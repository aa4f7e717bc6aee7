"""An MJCF file as the tables of a scene."""

from collections.abc import Iterable, Iterator
from pathlib import Path

from eomgen.base.errors import listed
from eomgen.scene.importers.conventions import JointStates, convention, suffixed
from eomgen.scene.importers.imported import Imported, Wishes
from eomgen.scene.importers.mjcf.actuators import add_actuators
from eomgen.scene.importers.mjcf.bodies import add_bodies, is_split, joints_of
from eomgen.scene.importers.mjcf.compiled import Compiled, compiled
from eomgen.scene.importers.mjcf.contacts import add_contacts
from eomgen.scene.importers.mjcf.equalities import add_equalities
from eomgen.scene.importers.mjcf.files import check_files
from eomgen.scene.importers.mjcf.forces import add_gravity, add_passive
from eomgen.scene.importers.mjcf.mechanism import BALL, FREE, Mechanism, Names
from eomgen.scene.importers.mjcf.tendons import add_tendon
from eomgen.scene.importers.names import TAKEN, identifiers, renamed, scene_name
from eomgen.scene.importers.parts import SLIDING_SPEED, SPEED
from eomgen.scene.importers.stops import add_stops
from eomgen.scene.importers.xml_elements import Element
from eomgen.scene.joints.base import WORLD

COUNTED = {
    "nsensor": "sensors",
    "ncam": "cameras",
    "nkey": "key frames",
    "nflex": "flexible bodies",
    "nskin": "skins",
    "nplugin": "plugins",
}


def imported(path: Path, root: Element, wishes: Wishes) -> Imported:
    """The scene of a mechanism. Raises `SceneError`, one line."""
    check_files(path, root, wishes.allowed)
    model = compiled(path)
    if not model["nv"]:
        raise root.error("nothing can move: the file has no joints")
    names, changed = names_of(model)
    made = mechanism_of(model, names)
    if wishes.stops and (moved := add_stops(made)):
        made.remark(
            f"the file's pose is beyond the limits of {listed(map(repr, moved))}, which start "
            "between them"
        )
    if wishes.contacts or wishes.self_contacts:
        add_contacts(model, names, made, each_other=wishes.self_contacts)
    made.remarks |= dict.fromkeys(_remarks(model, made, wishes))
    if changed:
        made.remark(f"renamed: {listed(changed)}")
    name = scene_name(root.attributes.get("model", ""), path.stem)
    lost = [f"left out: {what} ({count})" for what, count in made.lost.items()]
    beside = ", ".join(f"{what} ({model[key]})" for key, what in COUNTED.items() if model[key])
    lost += [f"left out: {beside}"] if beside else []
    remarks = (*lost, *made.remarks, *model.warnings)
    states = convention("MuJoCo", list(_states(model, names)), made.locked)
    return Imported(made.tables(name, path.name), remarks, states)


def _states(model: Compiled, names: Names) -> Iterator[JointStates]:
    """The numbers of each joint."""
    for j, kind in enumerate(model["jnt_type"]):
        name, k = names.joints[j], model["jnt_bodyid"][j]
        if kind == BALL:
            turns, spins = suffixed(name, "qw qx qy qz"), suffixed(name, "wx wy wz")
            yield JointStates(turns, spins, "quaternion")
        elif kind == FREE and j in names.split:
            yield JointStates.free(names.between[k, j], name, "quaternion")
        elif kind == FREE:
            body, com = names.bodies[k], tuple(model["body_ipos"][k])
            yield JointStates.free(body, body, "origin in the world", body, com)
        else:
            yield JointStates.single(name)


def names_of(model: Compiled) -> tuple[Names, list[str]]:
    """Names in the scene of all objects that need one, and which of them are changed."""
    split = frozenset(j for j in range(model["njnt"]) if is_split(model, j))
    between = {}
    for k in range(1, model["nbody"]):
        numbers = joints_of(model, k)
        for n, j in enumerate(numbers):
            if j in split or j != numbers[-1]:
                between[k, j] = f"{model.names['body'][k]} {n + 1}"
    listed_bodies = list(model.names["body"][1:])
    bodies = identifiers([*listed_bodies, *between.values()], "body")
    joints = identifiers(model.names["joint"], "joint")
    moving = {*joints.values(), *(f"{name}_dot" for name in joints.values())}
    inputs = identifiers(model.names["actuator"], "control", {*TAKEN, *moving})
    tendons = identifiers(model.names["tendon"], "tendon")
    equalities = identifiers(model.names["equality"], "equality", {*TAKEN, *joints.values()})
    names = Names(
        bodies=(WORLD, *(bodies[name] for name in listed_bodies)),
        joints=tuple(joints.values()),
        inputs=tuple(inputs.values()),
        tendons=tuple(tendons[name] for name in model.names["tendon"]),
        equalities=tuple(equalities[name] for name in model.names["equality"]),
        between={key: bodies[name] for key, name in between.items()},
        split=split,
    )
    own = {name: bodies[name] for name in listed_bodies}
    others = {name: new for name, new in inputs.items() if new != f"{name}_control"}
    return names, [text for found in (own, joints, others) for text in renamed(found)]


def mechanism_of(model: Compiled, names: Names) -> Mechanism:
    """All tables of a compiled model."""
    made, off = Mechanism(), model["opt_disableflags"]
    add_bodies(model, names, made)
    add_gravity(model, names, made, off)
    add_passive(model, names, made, off)
    for t in range(model["ntendon"]):
        add_tendon(model, t, names, made, off)
    add_actuators(model, names, made, off)
    add_equalities(model, names, made, off)
    return made


def _remarks(model: Compiled, made: Mechanism, wishes: Wishes) -> Iterable[str]:
    """What else has no counterpart, or is otherwise than in MuJoCo."""
    if wishes.floating:
        yield "--floating is for URDF; an MJCF file says which bodies move freely"
    if model["opt_density"] or model["opt_viscosity"]:
        yield (
            f"left out: forces of the medium of density {model['opt_density']:g} kg/m^3 and "
            f"viscosity {model['opt_viscosity']:g} Pa s; an effect drag may replace them"
        )
    touching = any(model["geom_contype"]) or any(model["geom_conaffinity"])
    if touching and not (wishes.contacts or wishes.self_contacts):
        yield (
            "left out: contacts between geoms; import with --contacts adds those with planes, with "
            "--self-contacts those with each other, too"
        )
    if any("limits" in joint for joint in made.joints) and not wishes.stops:
        yield (
            "a coordinate beyond the limits of its joint is reported, not prevented; import with "
            "--stops adds rigid stops"
        )
    if any(
        limited and kind == BALL
        for limited, kind in zip(model["jnt_limited"], model["jnt_type"], strict=True)
    ):
        made.lost["limits of ball joints"] += 1
    if any(model["jnt_actfrclimited"]):
        made.lost["bounds of the whole actuator force at joints"] += sum(model["jnt_actfrclimited"])
    if any(model["jnt_springyield"]) or any(model["tendon_springyield"]):
        made.lost["plastic yields of springs"] += 1
    if model["nmocap"]:
        yield "bodies of motion capture (mocap) are fixed where the file has them"
    if model["body_geomnum"][0]:
        made.lost["geoms of the world"] += model["body_geomnum"][0]
    if any("coulomb" in effect for effect in made.effects):
        yield f"friction of joints is smoothed within {SPEED:g} rad/s or m/s: {SLIDING_SPEED}"
    if FREE in model["jnt_type"]:
        yield (
            "coordinates of a free body are those of its centre of mass, in MuJoCo of its origin; "
            "import_robot(...).mujoco(module) converts them"
        )
