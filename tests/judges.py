"""What MuJoCo and Pinocchio say of a `SpatialTree`; neither is imported before it is asked.

Both take and give the scene language's conventions: linear velocities of free bodies in world axes,
angular ones and those of balls in the body's axes, quaternions w, x, y, z. The plane is motion in
space: its free body has two slides and a hinge.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation
from spatial_trees import ORIGIN, PLANE, Loop, SpatialTree, TreeJoint

Inputs = Mapping[str, float] | None
Move = tuple[str, tuple[float, ...]]


class Unsuitable(Exception):
    """The judge cannot speak on this tree in this state; the message says why."""


def _moves(tree: SpatialTree, joint: TreeJoint) -> list[Move]:
    """A joint as elementary moves, each in the axes that the one before it left."""
    axis = joint.axes[0]
    x, y, z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
    match joint.kind:
        case "weld":
            return []
        case "revolute":
            return [("hinge", axis)]
        case "prismatic":
            return [("slide", axis)]
        case "cylindrical":
            return [("slide", axis), ("hinge", axis)]
        case "universal":
            return [("hinge", axis), ("hinge", joint.axes[1])]
        case "ball":
            return [("ball", z)]
        case "free" if tree.dimensions != PLANE:
            return [("free", z)]
    return [("slide", x), ("slide", y), ("hinge", z)]


# MuJoCo.


@dataclass
class _MuJoCo:
    """A model, its data, and where it keeps our bodies, coordinates and velocities."""

    model: Any
    data: Any
    bodies: list[int]
    q: list[int]
    v: list[int]


@lru_cache(maxsize=4)
def _mujoco_model(tree: SpatialTree) -> _MuJoCo:
    """MuJoCo's model; the frame of a body is at its centre of mass.

    MuJoCo compiles no particle or massless body that moves, and finds principal axes to 1e-12 only.
    So every body is compiled with mass and inertia 1, away from its frame lest MuJoCo thinks it
    simple and keeps no room for the rest of its mass matrix, and gets its own numbers afterwards.
    """
    import mujoco

    spec = mujoco.MjSpec()
    spec.compiler.degree = True
    spec.compiler.eulerseq = "XYZ"  # capitals: about fixed axes
    spec.option.gravity = tree.gravity_vector()
    spec.option.disableflags = mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    skew = {"ipos": [0.1, 0.2, 0.3], "iquat": [0.5, 0.5, -0.5, 0.5]}
    made: list[Any] = []
    for body in tree.bodies:
        joint = body.joint
        parent = spec.worldbody if joint.parent < 0 else made[joint.parent]
        own = parent.add_body(name=body.name, mass=1.0, inertia=[1.0, 1.0, 1.0], **skew)
        own.alt.type = mujoco.mjtOrientation.mjORIENTATION_EULER
        own.alt.euler = joint.orientation_deg
        own.pos = joint.r_parent  # less the turned r_child; see below
        for i, (kind, axis) in enumerate(_moves(tree, joint)):
            own.add_joint(
                name=f"{joint.name}_{i}",
                type=getattr(mujoco.mjtJoint, f"mjJNT_{kind.upper()}"),
                axis=axis,
                pos=joint.r_child,
                armature=joint.armature,
            )
        made.append(own)
    for loop in tree.loops:
        _mujoco_loop(tree, spec, made, loop)
    model = spec.compile()
    own_bodies, own_q, own_v = [], [], []
    for body in tree.bodies:
        k = model.body(body.name).id
        own_bodies.append(k)
        shift = np.zeros(3)
        mujoco.mju_rotVecQuat(shift, np.array(body.joint.r_child), model.body_quat[k])
        model.body_pos[k] -= shift
        moments, axes = np.linalg.eigh(body.inertia_matrix)
        axes[:, 0] *= np.linalg.det(axes)
        model.body_mass[k], model.body_inertia[k] = body.mass, moments
        model.body_ipos[k] = 0.0
        mujoco.mju_mat2Quat(model.body_iquat[k], axes.ravel())
        if body.joint.coordinates:
            first, dof = model.jnt_qposadr[model.body_jntadr[k]], model.body_dofadr[k]
            own_q += [first + i for i in range(len(body.joint.coordinates))]
            own_v += [dof + i for i in range(len(body.joint.velocities))]
    data = mujoco.MjData(model)
    mujoco.mj_setConst(model, data)
    return _MuJoCo(model, data, own_bodies, own_q, own_v)


def _mujoco_loop(tree: SpatialTree, spec: Any, made: list[Any], loop: Loop) -> None:
    """A loop joint as equality constraints between sites: a weld; or points that stay together, of
    which a hinge in space has two.
    """
    import mujoco

    joint = loop.joint
    places = [ORIGIN]
    if joint.kind == "revolute" and tree.dimensions != PLANE:
        places.append(joint.axes[0])
    elif joint.kind not in ("ball", "weld", "revolute"):
        raise Unsuitable(f"it has no {joint.kind} joint that closes a loop")
    turned = Rotation.from_euler("xyz", joint.orientation_deg, degrees=True)
    sides = (
        (joint.parent, joint.r_parent, turned),
        (loop.child, joint.r_child, Rotation.identity()),
    )
    kind = "WELD" if joint.kind == "weld" else "CONNECT"
    for n, place in enumerate(places):
        names = [f"{joint.name}_{n}_{end}" for end in ("parent", "child")]
        for name, (k, at, axes) in zip(names, sides, strict=True):
            on = spec.worldbody if k < 0 else made[k]
            quaternion = np.roll(axes.as_quat(), 1)
            on.add_site(name=name, pos=np.array(at) + axes.apply(place), quat=quaternion)
        spec.add_equality(
            type=getattr(mujoco.mjtEq, f"mjEQ_{kind}"),
            objtype=mujoco.mjtObj.mjOBJ_SITE,
            name1=names[0],
            name2=names[1],
        )


def _mujoco_run(tree: SpatialTree, q: np.ndarray, v: np.ndarray, u: Inputs) -> _MuJoCo:
    """MuJoCo after forward dynamics; q and v mean the same there, in another order."""
    import mujoco

    made = _mujoco_model(tree)
    model, data = made.model, made.data
    mujoco.mj_resetData(model, data)
    data.qpos[made.q], data.qvel[made.v] = q, v
    data.qfrc_applied[made.v] = tree.torques(u)
    for body, place, force in tree.push_forces(u):
        k = made.bodies[body]
        mujoco.mj_kinematics(model, data)
        data.xfrc_applied[k] = [*force, *np.cross(data.xmat[k].reshape(3, 3) @ place, force)]
    warnings: list[str] = []
    mujoco.set_mju_user_warning(warnings.append)  # in place of MUJOCO_LOG.TXT
    mujoco.mj_forward(model, data)
    mujoco.set_mju_user_warning(None)
    if warnings or not np.isfinite(data.qacc).all():
        raise Unsuitable(f"{tree.name}: MuJoCo warns: {warnings}")
    return made


def mujoco_accelerations(
    tree: SpatialTree, q: np.ndarray, v: np.ndarray, u: Inputs = None
) -> np.ndarray:
    """Rates of the velocities `v`, in their order. Raises `Unsuitable` if MuJoCo warns."""
    made = _mujoco_run(tree, q, v, u)
    return made.data.qacc[made.v]


def mujoco_constrained(
    tree: SpatialTree, q: np.ndarray, v: np.ndarray, u: Inputs = None
) -> np.ndarray:
    """Rates of the velocities `v` where the loops are kept exactly, from MuJoCo's mass matrix, its
    accelerations without loops, and the Jacobian J of its equality constraints.

    MuJoCo itself keeps them softly. J̇ v is the derivative of J v along the motion at constant v, by
    differences of fourth order.
    """
    import mujoco

    made = _mujoco_run(tree, q, v, u)
    model, data = made.model, made.data
    free, mass = data.qacc.copy(), np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, mass)
    model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    start, speed = data.qpos.copy(), data.qvel.copy()

    def jacobian(t: float) -> np.ndarray:
        data.qpos[:] = start
        mujoco.mj_integratePos(model, data.qpos, speed, t)
        flags, model.opt.disableflags = model.opt.disableflags, 0
        mujoco.mj_fwdPosition(model, data)
        model.opt.disableflags = flags
        return np.array(data.efc_J).reshape(data.nefc, model.nv)

    h = 1e-3 / max(1.0, float(np.abs(speed).max()))
    rates = [jacobian(k * h) @ speed for k in (-2, -1, 1, 2)]
    bend = (rates[0] - 8 * rates[1] + 8 * rates[2] - rates[3]) / (12 * h)
    rows = jacobian(0.0)
    inverse = np.linalg.solve(mass, rows.T)
    forces = np.linalg.lstsq(rows @ inverse, -(rows @ free + bend), rcond=1e-10)[0]
    return np.asarray((free + inverse @ forces)[made.v])


def mujoco_wrenches(
    tree: SpatialTree, q: np.ndarray, v: np.ndarray, u: Inputs = None
) -> np.ndarray:
    """Force and moment of each of the tree's `joints` on its parent, as the scene language has it.

    At the joint's point on the child, in world axes, (nj, 6) in the plane too.
    """
    import mujoco

    made = _mujoco_run(tree, q, v, u)
    model, data = made.model, made.data
    mujoco.mj_rnePostConstraint(model, data)
    wrenches = []
    for body, k in zip(tree.bodies, made.bodies, strict=True):
        if body.joint.kind != "free":
            moment, force = data.cfrc_int[k, :3], data.cfrc_int[k, 3:]  # on the child, at `about`
            about = data.subtree_com[model.body_rootid[k]]
            point = data.xpos[k] + data.xmat[k].reshape(3, 3) @ body.joint.r_child
            wrenches.append([*-force, *-(moment + np.cross(about - point, force))])
    return np.array(wrenches).reshape(-1, 6)


# Pinocchio.


@lru_cache(maxsize=4)
def _pinocchio_model(tree: SpatialTree) -> Any:
    """Pinocchio's model, and for each body its joint there and its centre of mass in that.

    A joint of several moves is as many joints with massless bodies between them; a welded body is
    a part of the body it is welded to.
    """
    import pinocchio as pin

    model = pin.Model()
    model.gravity.linear = tree.gravity_vector()
    makers = {
        "hinge": lambda axis: pin.JointModelRevoluteUnaligned(np.array(axis)),
        "slide": lambda axis: pin.JointModelPrismaticUnaligned(np.array(axis)),
        "ball": lambda axis: pin.JointModelSpherical(),
        "free": lambda axis: pin.JointModelFreeFlyer(),
    }
    armature: list[float] = []
    held: list[tuple[int, Any]] = []
    for body in tree.bodies:
        joint = body.joint
        at, frame = (0, pin.SE3.Identity()) if joint.parent < 0 else held[joint.parent]
        turned = pin.rpy.rpyToMatrix(*np.radians(joint.orientation_deg))
        frame = frame * pin.SE3(turned, np.array(joint.r_parent))
        for i, (kind, axis) in enumerate(_moves(tree, joint)):
            at = model.addJoint(at, makers[kind](axis), frame, f"{joint.name}_{i}")
            frame = pin.SE3.Identity()
            armature += [joint.armature] * model.joints[at].nv
        frame = frame * pin.SE3(np.eye(3), -np.array(joint.r_child))
        inertia = pin.Inertia(body.mass, np.zeros(3), body.inertia_matrix)
        model.appendBodyToJoint(at, inertia, frame)
        held.append((at, frame))
    model.armature = np.array(armature)
    return model, model.createData(), held


def _depth_first(tree: SpatialTree) -> bool:
    """Whether each body hangs on the one before it, or on one that carries that."""
    path: list[int] = []
    for k, body in enumerate(tree.bodies):
        while path and path[-1] != body.joint.parent:
            path.pop()
        if not path and body.joint.parent >= 0:
            return False
        path.append(k)
    return True


def _pinocchio_loops(tree: SpatialTree) -> Any:
    """The loops, if they are all balls or welds, or hinges of the plane."""
    import pinocchio as pin

    model, _, held = _pinocchio_model(tree)
    found = pin.StdVec_RigidConstraintModel()
    for loop in tree.loops:
        joint = loop.joint
        turned = pin.rpy.rpyToMatrix(*np.radians(joint.orientation_deg))
        ends = []
        for k, place, axes in (
            (joint.parent, joint.r_parent, turned),
            (loop.child, joint.r_child, np.eye(3)),
        ):
            at, frame = (0, pin.SE3.Identity()) if k < 0 else held[k]
            ends.append((at, frame * pin.SE3(axes, np.array(place))))
        ball = joint.kind == "ball" or (joint.kind == "revolute" and tree.dimensions == PLANE)
        if not ball and joint.kind != "weld":
            raise Unsuitable(f"it has no {joint.kind} joint that closes a loop")
        kind = pin.ContactType.CONTACT_3D if ball else pin.ContactType.CONTACT_6D
        (one, frame), (other, end) = ends
        found.append(
            pin.RigidConstraintModel(kind, model, one, frame, other, end, pin.ReferenceFrame.LOCAL)
        )
    return found


def pinocchio_accelerations(
    tree: SpatialTree, q: np.ndarray, v: np.ndarray, u: Inputs = None
) -> np.ndarray:
    """Rates of the velocities `v`, in their order, by the articulated-body algorithm; with loops by
    `constraintDynamics` (Carpentier, Budhiraja and Mansard 2021).
    """
    import pinocchio as pin

    model, data, held = _pinocchio_model(tree)
    q, v = np.array(q, float), np.array(v, float)
    free = []  # where a free body's velocities are, and its rotation
    for body, at, rate in zip(tree.bodies, tree.q_slices(), tree.v_slices(), strict=True):
        if at.stop - at.start > rate.stop - rate.start:
            last = slice(at.stop - 4, at.stop)
            q[last] = np.roll(q[last], -1)
            if body.joint.kind == "free":
                linear = slice(rate.start, rate.start + 3)
                rotation = pin.Quaternion(q[last]).matrix()
                free.append((linear, slice(linear.stop, linear.stop + 3), rotation))
                v[linear] = rotation.T @ v[linear]
    pin.forwardKinematics(model, data, q)
    forces = [pin.Force.Zero() for _ in range(model.njoints)]
    for body, place, push in tree.push_forces(u):
        at, frame = held[body]
        force = data.oMi[at].rotation.T @ push
        forces[at] = pin.Force(force, np.cross(frame.act(np.array(place)), force))
    if tree.loops:
        if not _depth_first(tree):
            raise Unsuitable("its Cholesky factors take subtrees to be numbered without gaps")
        pin.computeJointJacobians(model, data, q)
        tau = tree.torques(u)
        for at, force in enumerate(forces):
            jacobian = pin.getJointJacobian(model, data, at, pin.ReferenceFrame.LOCAL)
            tau = tau + jacobian.T @ force.vector
        loops = _pinocchio_loops(tree)
        made = pin.StdVec_RigidConstraintData()
        made.extend(loop.createData() for loop in loops)
        pin.initConstraintDynamics(model, data, loops, made)
        iterations = pin.ProximalSettings(1e-14, 1e-14, 1e-6, 500)
        found = pin.constraintDynamics(model, data, q, v, tau, loops, made, iterations).copy()
    else:
        found = pin.aba(model, data, q, v, tree.torques(u), forces).copy()
    for linear, angular, rotation in free:
        found[linear] = rotation @ (found[linear] + np.cross(v[angular], v[linear]))
    return found
