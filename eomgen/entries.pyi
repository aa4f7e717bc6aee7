"""The tables of a scene: see `entries.py`. Written by `tools/pages.py`."""

from collections.abc import Mapping, Sequence
from typing import Any, Literal

from eomgen.language.base import Table
from eomgen.scene.schema import Scene as _Scene

def Ball(
    *,
    name: str,
    parent: str,
    child: str,
    r_parent: Sequence[float | str] = ...,
    r_child: Sequence[float | str] = ...,
    orientation_deg: float | Sequence[float] = ...,
    orientation: float | str | Sequence[float | str] | Sequence[Sequence[float | str]] | None = ...,
    loop: bool = ...,
    motor_inertia: float | str = ...,
) -> Table:
    """The child rotates about a point: world_R_child = world_R_parent E R(quaternion).

    E is the fixed rotation `orientation_deg`. The velocities are the angular velocity of the child
    relative to the parent, in the child's axes.
    """
    ...

def Belt(
    *,
    name: str,
    body_1: str,
    body_2: str,
    carrier: str | None = ...,
    phase: float | str = ...,
    radius_1: float | str,
    radius_2: float | str,
    crossed: bool = ...,
) -> Table:
    """A belt or chain that does not slip connects discs of two bodies, which turn about axes that
    their `carrier` holds, in the same sense, or in opposite senses if it is `crossed`. The discs
    are around the axes.

    The angles are those of joints, from the carrier. The belt is tight on both sides: the
    multiplier is the difference of its two tensions, N, counted in the sense in which `body_1`
    turns.
    """
    ...

def Body(
    *,
    name: str,
    mass: float | str,
    inertia_com: float | str | Sequence[float | str] = ...,
    com: Sequence[float | str] = ...,
    inertia_check: Literal["on", "off"] = ...,
    shapes: Sequence[Table | Mapping[str, Any]] = ...,
) -> Table:
    """A rigid body.

    `inertia_com` is needed unless the body is on a joint of type `particle`; of a particle it is 0.
    In the plane the inertia is a number; in space [xx, yy, zz], or [xx, yy, zz, xy, xz, yz], the
    entries of the matrix about the centre of mass in body axes.

    Points of a body are given relative to its centre of mass, or, with `com`, in the body's own
    frame, in which the centre of mass is at `com`. Joints without `r_parent` or `r_child` are then
    at the origin of that frame. All other points that are not given are at the centre of mass. The
    coordinates of a free joint and the outputs of poses are those of the centre of mass, too.
    """
    ...

def Box(
    *,
    size: Sequence[float | str],
    center: Sequence[float | str] | None = ...,
    angle: float = ...,
    orientation_deg: Sequence[float] = ...,
    color: str | None = ...,
) -> Table:
    """A rectangle or a cuboid with edges of `size` m, centred at `center` in body axes.

    It is rotated relative to the body: in the plane by `angle` rad, in space by `orientation_deg`
    about the body's x, then y, then z axis.
    """
    ...

def Camera(
    *,
    mode: Literal["fit", "follow", "fixed"] | None = ...,
    center: Sequence[float] | None = ...,
    height: float | None = ...,
    follow: str | None = ...,
    background: str | None = ...,
    azimuth_deg: float = ...,
    elevation_deg: float = ...,
) -> Table:
    """The camera of pictures.

    In `mode = "fit"` the whole motion lies within the picture. With "follow" the picture moves with
    the body `follow`, and with "fixed" it shows `height` m around `center`. Without a mode, it is
    fixed if `center` or `height` is given, and follows if `follow` is; else the whole motion is
    shown, unless the mechanism would be small in it: then the camera follows its heaviest body that
    moves away. `height` is the distance from the bottom to the top of the picture; what the motion
    needs if absent.

    In space the picture is a parallel projection, seen from a direction that is rotated by
    `azimuth_deg` from x towards y and by `elevation_deg` towards z.
    """
    ...

def Chain(
    *,
    name: str,
    count: int,
    parent: str = ...,
    mass: float | str,
    inertia_com: float | str | Sequence[float | str],
    start: Sequence[float | str] = ...,
    r_parent: Sequence[float | str],
    r_child: Sequence[float | str],
    axis: Sequence[float] | None = ...,
    shapes: Sequence[Table | Mapping[str, Any]] = ...,
) -> Table:
    """A chain of equal links: bodies `<name>_1`, … at revolute joints `<name>_joint_1`, …

    `r_parent` is the pin on the previous link and `r_child` the pin on the link itself, each from
    the centre of mass of its link; `start` is the first pin on `parent`.
    """
    ...

def Contact(
    *,
    name: str,
    body: str | None = ...,
    bodies: Literal["all"] | Sequence[str] | None = ...,
    points: Sequence[str] | None = ...,
    at: Sequence[float | str] = ...,
    against: Literal["plane", "heights", "ball", "each_other"] = ...,
    radius: float | str = ...,
    radii: Mapping[str, float | str] = ...,
    corners: Sequence[float | str] | None = ...,
    normal: Sequence[float] = ...,
    offset: float | str = ...,
    height: float | str = ...,
    other: str = ...,
    other_at: Sequence[float | str] = ...,
    other_radius: float | str = ...,
    shapes: Mapping[str, Table | Mapping[str, Any]] = ...,
    pairs: Sequence[Sequence[str]] = ...,
    except_pairs: Sequence[Sequence[str]] = ...,
    law: Literal["spring_damper", "hunt_crossley", "impact"],
    stiffness: float | str = ...,
    damping: float | str = ...,
    dissipation: float | str = ...,
    restitution: float | str = ...,
    friction: float | str = ...,
    slip_speed: float | str | None = ...,
    allow_active: bool = ...,
) -> Table:
    """Contact of spheres (circles in the plane), points, and corners of boxes.

    Each body of `body` or `bodies` has a sphere of `radius` at `at`, or each of the named `points`
    is the centre of one. `radii` gives single bodies another radius; a sphere of radius 0 is a
    point. With `corners`, half sizes along the body's axes, the corners of a box at `at` are used
    instead, rounded by the radius. These touch

    - `against = "plane"`: the half-space n·x <= `offset`, with n along `normal`, by default up;
    - `against = "heights"`: the ground of the world below `height`, a formula of x, and y in space;
    - `against = "ball"`: the sphere of `other_radius` at `other_at`;
    - `against = "each_other"`: each other, every pair of `bodies`.

    With `shapes` in place of bodies, these are capsules, boxes, ellipsoids and hulls, each of one
    body: see `shapes of contacts`.

    Plane and ball are fixed in the world, or to the body `other`; then they are given relative to
    its centre of mass, in its axes. An offset cannot depend on time: a moving floor is a body.

    With the gap g, the depth d = max(0, -g) and ḋ = -dg/dt, the normal force is

    - `law = "spring_damper"`: max(0, k d + c ḋ) where d > 0; energy ½ k d²;
    - `law = "hunt_crossley"`: max(0, k d^1.5 (1 + 1.5 a ḋ)); energy 2/5 k d^2.5. Hunt & Crossley,
      "Coefficient of restitution interpreted as damping in vibroimpact", J. Appl. Mech. 42 (1975)
      440-445, with λ = 1.5 a k;
    - `law = "impact"`: none; the bodies are rigid, and contacts are events of a run.

    `friction` μ adds -μ F u/sqrt(|u|² + s²) for the slip velocity u (m/s) at the contact point,
    with `slip_speed` s: 71 % of μ F at |u| = s, 99.5 % at 10 s. There is no exact sticking: under a
    tangential load of a fraction ρ < 1 of μ F a body creeps at s ρ/sqrt(1 - ρ²); from a speed
    v >> s a block slides v²/(2 μ g) (1 + (s/v)² (½ + ln(2 v/s))).
    """
    ...

def ContactShape(
    *,
    body: str,
    at: Sequence[float | str] = ...,
    radius: float | str = ...,
    end: Sequence[float | str] | None = ...,
    half_sizes: Sequence[float | str] | None = ...,
    semi_axes: Sequence[float | str] | None = ...,
    vertices: Sequence[Sequence[float]] = ...,
    orientation_deg: float | Sequence[float] = ...,
) -> Table:
    """A shape with which a body touches others: a core, rounded by `radius`.

    Without more the core is the point `at`, and the shape a sphere, a circle in the plane. With
    `end` it is the line from `at` to there: a capsule. With `half_sizes` it is a box about `at`,
    with `semi_axes` an ellipsoid, both turned by `orientation_deg`, with `vertices` the convex hull
    of points that are given from `at`. Positions are in body axes.

    A plane is touched by the ends of a capsule, the corners of a box, the vertices of a hull, and
    by the lowest point of an ellipsoid, Σ w (w·n)/sqrt(Σ (w·n)²) with its half-axes w. A flat
    ellipsoid is a disc: the rim of a cylinder is one at each end. Spheres, capsules and boxes touch
    each other where their cores are nearest, a capsule and a box at the ends of the capsule, and
    two boxes at the corners of each, too. One of two needs a `radius`, within which they may
    overlap.
    """
    ...

def Controller(
    *,
    name: str,
    states: Mapping[str, Table | Mapping[str, Any]] = ...,
    torques: Mapping[str, float | str],
) -> Table:
    """dz/dt = f and τ = g, formulas of t, coordinates, velocities, inputs and states.

    `states = { z = { initial = 0.0, rate = "q - z" } }` defines the states by the names that
    formulas use. `torques = { joint = "-k*z" }` defines the torque of each joint, or the force if
    it is prismatic, on its child, with the reaction on its parent. Formulas cannot use rates or
    torques, so none depends on itself.
    """
    ...

def Coupling(
    *,
    name: str,
    coordinate: str,
    equals: float | str,
) -> Table:
    """A coordinate follows others: `coordinate` = `equals`, a formula of coordinates, `t` and
    parameters. Racks, screws, differentials and mimic joints are couplings; see also `gear` and
    `belt`.

    The multiplier is the generalised force on `coordinate`, N m or N.
    """
    ...

def Cylinder(
    *,
    start: Sequence[float | str],
    end: Sequence[float | str],
    radius: float | str,
    color: str | None = ...,
) -> Table:
    """A cylinder of `radius` m with flat ends at `start` and `end`, m, body axes; in space."""
    ...

def Cylindrical(
    *,
    name: str,
    parent: str,
    child: str,
    r_parent: Sequence[float | str] = ...,
    r_child: Sequence[float | str] = ...,
    orientation_deg: float | Sequence[float] = ...,
    orientation: float | str | Sequence[float | str] | Sequence[Sequence[float | str]] | None = ...,
    loop: bool = ...,
    axis: Sequence[float] = ...,
    coordinates: Sequence[str] | None = ...,
) -> Table:
    """The child translates along `axis` and rotates about it."""
    ...

def Disc(
    *,
    radius: float | str,
    center: Sequence[float | str] | None = ...,
    color: str | None = ...,
) -> Table:
    """A disc of `radius` m about `center`, in body axes; in the plane."""
    ...

def DiscreteState(
    *,
    initial: float = ...,
    next: float | str,
    unit: str = ...,
    about: str = ...,
) -> Table:
    """A state z of a sampled controller: it is `initial` before the first sample, and `next` after
    each one.
    """
    ...

def Distance(
    *,
    name: str,
    body_1: str,
    at_1: Sequence[float | str] = ...,
    body_2: str,
    at_2: Sequence[float | str] = ...,
    length: float | str,
) -> Table:
    """Two points keep their distance: |x_1 - x_2| = `length`, as if by a massless rod.

    The multiplier is the force with which the rod pushes the points apart, N; in tension it is
    negative.
    """
    ...

def Drag(
    *,
    name: str,
    body: str | None = ...,
    bodies: Literal["all"] | Sequence[str] | None = ...,
    points: Sequence[str] | None = ...,
    at: Sequence[float | str] = ...,
    linear: float | str = ...,
    quadratic: float | str = ...,
    density: float | str | None = ...,
    area: float | str | None = ...,
    coefficient: float | str | None = ...,
    turning_linear: float | str = ...,
    turning_quadratic: float | str = ...,
    wind: Sequence[float | str] = ...,
    allow_active: bool = ...,
) -> Table:
    """Drag f = -(linear + quadratic |w|) w at a point of velocity w = v - wind in the fluid.

    Drag on rotation: torque = -(turning_linear + turning_quadratic |ω|) ω. Instead of `quadratic`,
    density, area and coefficient give ½ ρ A c_d of the drag equation. All vectors are in world
    axes; each body has these coefficients. The drag is differentiable at rest.
    """
    ...

def Driven(
    *,
    name: str,
    joint: str,
    coordinate: float | str,
) -> Table:
    """Prescribes the coordinate of a joint by `coordinate`, a formula of `t` and parameters.

    The coordinate is not a state. Its rate and acceleration are exact derivatives of the formula;
    for step, select, abs, min and max they are those of the branch, so a jump gives no impulse. The
    output `driving_forces` is the generalised force of the drive along the coordinate, N m for a
    revolute and N for a prismatic joint, on the child, with its reaction on the parent. It lacks
    the forces of rigid contacts, which are known only in a run. The drive is a constraint, not a
    load.
    """
    ...

def Ellipsoid(
    *,
    radii: Sequence[float | str],
    center: Sequence[float | str] | None = ...,
    orientation_deg: Sequence[float] = ...,
    color: str | None = ...,
) -> Table:
    """An ellipsoid with half-axes `radii` m, in body axes, rotated like a box; in space."""
    ...

def Equation(
    *,
    name: str,
    position: float | str | None = ...,
    velocity: float | str | None = ...,
) -> Table:
    """An equation of the scene: `position` = 0, a formula of coordinates, `t` and parameters; or
    `velocity` = 0, a formula that is linear in the velocities, which need not be the rate of one of
    positions.
    """
    ...

def ExternalForce(
    *,
    name: str,
    body: str,
    axes: Literal["world", "body"] = ...,
    at: Sequence[float | str] = ...,
    force: Literal["input"] | Sequence[float | str],
) -> Table:
    """A force f_e at the point r_e of a body (handout (29)-(34)), in world or body axes.

    With `force = "input"` its components are the inputs `<name>_x`, `<name>_y` and, in space,
    `<name>_z`.
    """
    ...

def ExternalTorque(
    *,
    name: str,
    body: str,
    axes: Literal["world", "body"] = ...,
    torque: Literal["input"] | float | str | Sequence[float | str],
) -> Table:
    """A torque on a body: one component about z in the plane, three in world or body axes in space.

    With `torque = "input"` it is the input `<name>`, in space `<name>_x`, `<name>_y`, `<name>_z`.
    """
    ...

def Field(
    *,
    name: str,
    body: str | None = ...,
    bodies: Literal["all"] | Sequence[str] | None = ...,
    points: Sequence[str] | None = ...,
    at: Sequence[float | str] = ...,
    kind: Literal["formula", "attract", "repel", "vortex", "avoid"] = ...,
    force: Sequence[float | str] = ...,
    center: Sequence[float | str] = ...,
    strength: float | str | None = ...,
    steering: float | str | None = ...,
    power: float = ...,
    softening: float | str = ...,
    radius: float | str | None = ...,
    reach: float | str | None = ...,
) -> Table:
    """A force at a point of a body that depends on its position and velocity and on time.

    With the vector r from `center` to the point and s² = r·r + softening², in world axes:

    - "formula": `force`, a formula of x, y, z and vx, vy, vz of the point, of t and the motion;
    - "attract", "repel": ∓strength r / s^(power+1), which has a potential energy;
    - "vortex": strength ẑ × r / s^(power+1), anticlockwise about the z axis through `center`; r and
      s are those in the x-y plane;
    - "avoid": steers away from an obstacle (handout, section 1), a ball of `radius`, within `reach`
      of its surface. The force is perpendicular to the velocity v, so it does no work:
      steering h² c² |v| v × n with the unit vector n along v × d and the vector d to the centre. h
      falls from 1 at the surface to 0 at `reach`; c is the cosine between v and d, or 0 if the
      point moves away. The path past an obstacle does not depend on the speed. If v points to the
      centre, n is ẑ and the path turns right. The field only changes the direction of motion; if
      it is too weak, a body passes through the obstacle.

    Without softening the central fields are infinite at the centre. A run with adaptive steps stops
    there; a run with fixed steps may jump across the centre and continue with a large error.
    """
    ...

def Free(
    *,
    name: str,
    parent: Literal["world"] = ...,
    child: str,
    coordinates: Sequence[str] | None = ...,
) -> Table:
    """A body that moves freely in the plane or in space.

    In the plane its coordinates are x, y of the centre of mass in world axes, and its angle. In
    space they are x, y, z of the centre of mass and the unit quaternion of world_R_body; its
    velocities are that of the centre of mass in world axes and the angular velocity in body axes.
    """
    ...

def Gear(
    *,
    name: str,
    body_1: str,
    body_2: str,
    carrier: str | None = ...,
    phase: float | str = ...,
    teeth_1: float | str | None = ...,
    teeth_2: float | str | None = ...,
    radius_1: float | str | None = ...,
    radius_2: float | str | None = ...,
    ratio: float | str | None = ...,
    inside: bool = ...,
) -> Table:
    """Two gears mesh: `body_1` and `body_2` turn about axes that their `carrier` holds, in opposite
    senses, or `inside` a ring in the same sense. Give the numbers of `teeth`, the radii, or the
    `ratio`, which is the number of turns of `body_1` for one of `body_2`.

    The angles are those of joints, from the carrier, about the axes of the joints: axes that point
    the same way for spur gears; for bevel gears choose `inside` by the axes. A carrier that turns
    makes it a planetary gear. The world may be `body_2`, as a fixed ring gear.

    The multiplier is the torque on `body_1` that the gears transmit, N m; with radii it is the
    force between the teeth, N, counted in the sense in which `body_1` turns.
    """
    ...

def Gravity(
    *,
    name: str = ...,
    g: float | str,
    direction: Sequence[float] | None = ...,
    except_bodies: Sequence[str] = ...,
) -> Table:
    """Weight m g of each body, along -y in the plane (handout (5), (9)), along -z in space.

    `direction` (world axes, not 0, need not have unit length) replaces these axes. Gravity does not
    act on the bodies in `except_bodies`; if there are any, the weights of the other bodies are
    applied forces, in F of M v̇ + V + G = F instead of G.
    """
    ...

def Initial(
    *,
    q: Sequence[float] | Mapping[str, float | str] = ...,
    v: Sequence[float] | Mapping[str, float | str] = ...,
    guess: Mapping[str, float | str] = ...,
) -> Table:
    """The initial state: lists in the order of `eomgen check`, or tables by name.

    In a table, values that are not named are 0, and an angle may be given in degrees, as
    `<name>_deg = 90` or `<name> = "90 deg"`.
    """
    ...

def Input(
    *,
    name: str,
    unit: str = ...,
    about: str = ...,
    default: float = ...,
) -> Table:
    """An input of the module for formulas of the scene: `{ name = "thrust", unit = "N" }`."""
    ...

def JointFriction(
    *,
    name: str,
    joint: str | None = ...,
    joints: Literal["all"] | Sequence[str] | None = ...,
    coordinate: str | None = ...,
    viscous: float | str = ...,
    coulomb: float | str = ...,
    speed: float | str | None = ...,
    allow_active: bool = ...,
) -> Table:
    """Friction -(b v + C tanh(v/speed)) against the rate v of a joint's coordinate.

    A torque (N m) or a force (N) on the child, with its reaction on the parent. Coulomb friction C
    is smoothed: at |v| = `speed` it is 76 % of C, at 3 `speed` 99.5 %. There is no exact sticking:
    under a load F < C the joint creeps at speed · artanh(F/C).
    """
    ...

def JointSpring(
    *,
    name: str,
    joint: str | None = ...,
    joints: Literal["all"] | Sequence[str] | None = ...,
    coordinate: str | None = ...,
    stiffness: float | str = ...,
    damping: float | str = ...,
    rest: float | str = ...,
    law: float | str | None = ...,
    allow_active: bool = ...,
) -> Table:
    """A torque or force -(k s + c ds/dt) on a joint's coordinate q, with s = q - rest.

    A torque (N m, s in rad) at a revolute joint, a force (N, s in m) at a prismatic one, on the
    child, with the reaction on the parent. A `law` of `stretch` s and `rate` ds/dt replaces k s; it
    is positive towards `rest`. The potential energy is ½ k s²; a law has none, so its work counts
    as that of an applied force. At a ball joint s is the angle of rotation, 0 to π, about the axis
    n, and the torque is -k s n - c ω; its `rest` is 0, and the torque reverses at s = π.
    """
    ...

def JointStop(
    *,
    name: str,
    joint: str | None = ...,
    joints: Literal["all"] | Sequence[str] | None = ...,
    coordinate: str | None = ...,
    low: float | str | None = ...,
    high: float | str | None = ...,
    stiffness: float | str = ...,
    damping: float | str = ...,
    restitution: float | str | None = ...,
    allow_active: bool = ...,
) -> Table:
    """Keeps a joint's coordinate q between `low` and `high`; either limit may be absent.

    Beyond a limit by x (q - high > 0 or q - low < 0) a torque (N m) or force (N) -(k x + c dq/dt)
    acts on the child, with its reaction on the parent. It never pulls towards the limit, however
    fast q returns, and damping starts with a jump. The potential energy is ½ k x². At a ball joint
    q is the angle of rotation, which has no `low`. With `restitution` instead of stiffness the stop
    is rigid and of a single coordinate: it exerts no load, and each limit is a contact,
    `<effect>_low` and `<effect>_high`.
    """
    ...

def KnifeEdge(
    *,
    name: str,
    body: str,
    at: Sequence[float | str] = ...,
    other: str = ...,
    other_at: Sequence[float | str] = ...,
    across: Sequence[float],
) -> Table:
    """The point `at` of `body` does not move across the edge: its velocity relative to `other` has
    no component along `across`, a direction in the axes of `body`. This restricts velocities only:
    the point can come to any position. `other_at` has no effect.

    The multiplier is the force along `across` on the body, N.
    """
    ...

def Motor(
    *,
    name: str,
    joint: str,
    coordinate: str | None = ...,
    torque: Literal["input"] | float | str,
) -> Table:
    """A torque τ on the joint's child and -τ on its parent (handout (35), (36)).

    At a prismatic joint it is a force. With `torque = "input"` it is the input `<name>`.
    """
    ...

def Pairwise(
    *,
    name: str,
    bodies: Literal["all"] | Sequence[str] = ...,
    gravitation: float | str | None = ...,
    softening: float | str = ...,
    stiffness: float | str | None = ...,
    damping: float | str = ...,
    rest_length: float | str = ...,
    law: float | str | None = ...,
) -> Table:
    """A force along the line between the centres of mass of every two of `bodies`:

    - `gravitation` G: the attraction G m_1 m_2 r/(r² + ε²)^1.5 at the distance r, with the
      `softening` ε. It has the potential energy -G m_1 m_2/sqrt(r² + ε²). Without softening it is
      infinite where two bodies meet;
    - `stiffness` k: springs of this `rest_length`, with `damping`; see `spring`. The potential
      energy is that of the springs;
    - `law`: an attraction that is a formula of the `distance` r (m) and its `rate` (m/s). It has no
      potential energy, so its work counts as that of an applied force.
    """
    ...

def Parameter(
    *,
    value: float,
    unit: str = ...,
    about: str = ...,
) -> Table:
    """A parameter with its unit and meaning: `{ value = 1.0, unit = "kg", about = "…" }`."""
    ...

def Particle(
    *,
    name: str,
    parent: str,
    child: str,
    r_parent: Sequence[float | str] = ...,
    r_child: Sequence[float | str] = ...,
    orientation_deg: float | Sequence[float] = ...,
    orientation: float | str | Sequence[float | str] | Sequence[Sequence[float | str]] | None = ...,
    loop: bool = ...,
    motor_inertia: float | str = ...,
    coordinates: Sequence[str] | None = ...,
) -> Table:
    """The child translates along all axes of the parent and does not rotate relative to it.

    A point mass is a body on a particle joint to the world: it needs no `inertia_com`, which is
    then 0. The coordinates are those of the child's point from the parent's, in the joint's axes.
    """
    ...

def Pd(
    *,
    name: str,
    joint: str,
    coordinate: str | None = ...,
    target: float | str,
    target_rate: float | str = ...,
    stiffness: float | str,
    damping: float | str = ...,
    limit: float | str | None = ...,
    lag: float | str | None = ...,
    allow_active: bool = ...,
) -> Table:
    """A command c = k_p (target - q) + k_d (target_rate - v) to a joint.

    The command acts on the joint's child, with its reaction on the parent: a torque, at a prismatic
    joint a force. It is limited to ±`limit`, if given. With `lag` T the torque τ follows the
    command by T dτ/dt = c - τ; τ is the state `<name>_torque`, initially 0.
    """
    ...

def Pid(
    *,
    name: str,
    joint: str,
    coordinate: str | None = ...,
    target: float | str,
    target_rate: float | str = ...,
    stiffness: float | str,
    damping: float | str = ...,
    limit: float | str | None = ...,
    lag: float | str | None = ...,
    allow_active: bool = ...,
    integral_gain: float | str,
    tracking: float | str | None = ...,
) -> Table:
    """c = k_p e + k_d (target_rate - v) + k_i z, dz/dt = e, e = target - q.

    The command acts on the joint's child, with its reaction on the parent: a torque, at a prismatic
    joint a force. It is limited to ±`limit`, if given. With `lag` T the torque τ follows the
    command by T dτ/dt = c - τ; τ is the state `<name>_torque`, initially 0.

    z is the state `<name>_integral`. While the command is limited, back-calculation prevents
    windup: dz/dt = e + (c_limited - c)/(k_i T), with the tracking time T, `tracking`, by default
    k_p/k_i (Åström, Murray, Feedback Systems, section on integrator windup).
    """
    ...

def Planar(
    *,
    name: str,
    parent: str,
    child: str,
    r_parent: Sequence[float | str] = ...,
    r_child: Sequence[float | str] = ...,
    orientation_deg: float | Sequence[float] = ...,
    orientation: float | str | Sequence[float | str] | Sequence[Sequence[float | str]] | None = ...,
    loop: bool = ...,
    coordinates: Sequence[str] | None = ...,
) -> Table:
    """The child translates along x and y of the joint's axes, and rotates about z."""
    ...

def Point(
    *,
    name: str,
    body: str,
    at: Sequence[float | str] = ...,
) -> Table:
    """A named point of a body."""
    ...

def PointGravity(
    *,
    name: str,
    mu: float | str,
    at: Sequence[float | str] = ...,
    except_bodies: Sequence[str] = ...,
) -> Table:
    """Newton's attraction f = -μ m r/|r|³ of each body by a mass M that is fixed in the world.

    r is the vector from the point `at` to the body's centre of mass, where the force acts; μ = G M.
    There is no gravity gradient torque. The force is infinite at the point itself.
    """
    ...

def PointOn(
    *,
    name: str,
    body: str,
    at: Sequence[float | str] = ...,
    other: str = ...,
    other_at: Sequence[float | str] = ...,
    line: Sequence[float] = ...,
    normal: Sequence[float] = ...,
    equations: Sequence[float | str] = ...,
) -> Table:
    """The point `at` of `body` stays, without friction, on

    - `line`: the line through `other_at` in this direction;
    - `normal`: the plane through `other_at` with this normal;
    - `equations`: where these formulas are 0. They are formulas of the point's position x, y, z
      from `other_at`, of `t` and of parameters. In the plane one formula is a curve; in space one
      is a surface and two are a curve.

    All are fixed to `other`, in its axes. The residual of a formula f is f/|grad f|, so its
    multiplier is the force on the point along the gradient, N. Where the gradient is 0, as at the
    apex of a cone, the constraint is singular.
    """
    ...

def Polygon(
    *,
    points: Sequence[Sequence[float | str]],
    color: str | None = ...,
) -> Table:
    """A closed polygon through `points`, m, body axes; in the plane."""
    ...

def Prismatic(
    *,
    name: str,
    parent: str,
    child: str,
    r_parent: Sequence[float | str] = ...,
    r_child: Sequence[float | str] = ...,
    orientation_deg: float | Sequence[float] = ...,
    orientation: float | str | Sequence[float | str] | Sequence[Sequence[float | str]] | None = ...,
    loop: bool = ...,
    motor_inertia: float | str = ...,
    coordinate: str | None = ...,
    gear_ratio: float | str | None = ...,
    limits: Sequence[float] | None = ...,
    axis: Sequence[float],
) -> Table:
    """The child translates along `axis` and does not rotate relative to the parent."""
    ...

def Pulley(
    *,
    name: str,
    length: float | str | None = ...,
    body: str,
    at: Sequence[float | str] = ...,
    radius: float | str,
    body_1: str,
    at_1: Sequence[float | str] = ...,
    body_2: str,
    at_2: Sequence[float | str] = ...,
    winds: Literal["clockwise", "counterclockwise"] = ...,
) -> Table:
    """A rope runs from a point of `body_1` over the disc of `radius` about the point `at` of `body`
    to a point of `body_2`, and turns the disc: it does not slip. It is a `rope` over one disc that
    grips, in the plane.

    The multipliers are the tensions on the side of `body_1` and on that of `body_2`, N.
    """
    ...

def Revolute(
    *,
    name: str,
    parent: str,
    child: str,
    r_parent: Sequence[float | str] = ...,
    r_child: Sequence[float | str] = ...,
    orientation_deg: float | Sequence[float] = ...,
    orientation: float | str | Sequence[float | str] | Sequence[Sequence[float | str]] | None = ...,
    loop: bool = ...,
    motor_inertia: float | str = ...,
    coordinate: str | None = ...,
    gear_ratio: float | str | None = ...,
    limits: Sequence[float | str] | None = ...,
    axis: Sequence[float] | None = ...,
) -> Table:
    """A pin: x_child = x_parent + r_parent - r_child (handout (21)).

    `r_parent` is the pin's position from the parent's centre of mass (or the world's origin) in the
    parent's axes, `r_child` that from the child's centre of mass in the child's axes. In the plane
    the axis is z.
    """
    ...

def Rod(
    *,
    start: Sequence[float | str],
    end: Sequence[float | str],
    width: float | str,
    color: str | None = ...,
) -> Table:
    """A thick line with round ends from one point to another, m, body axes."""
    ...

def Rolling(
    *,
    name: str,
    body: str,
    at: Sequence[float | str] = ...,
    other: str = ...,
    other_at: Sequence[float | str] = ...,
    radius: float | str | None = ...,
    axis: Sequence[float] = ...,
    rim: float | str = ...,
    semi_axes: Sequence[float | str] | None = ...,
    normal: Sequence[float] = ...,
    other_radius: float | str | None = ...,
    inside: bool = ...,
) -> Table:
    """A body rolls without slip and without leaving the surface: its point in contact has the
    velocity of the surface there. The centre of its shape is the point `at`. It is

    - a sphere of `radius`; in the plane a wheel;
    - in space with `axis` a disc of this outer `radius`, whose edge is sharp or rounded with the
      radius `rim`;
    - an ellipsoid with `semi_axes` along the body's axes; in the plane an ellipse.

    The surface is the plane through `other_at` with the normal `normal`, by default up; or, for a
    sphere, the sphere of `other_radius` around `other_at`, in the plane a circle, on whose outside
    it rolls, or `inside`. It is fixed to `other`.

    The row `<name>_normal` keeps the distance at 0; its multiplier is the normal force, N. If that
    becomes negative, the surface holds the body: it does not lift off. The rows `<name>_along`, in
    space `<name>_along_1` and `<name>_along_2`, restrict velocities only; their multipliers are the
    components of the friction that rolling needs. A disc that lies flat is singular.
    """
    ...

def Rope(
    *,
    name: str,
    length: float | str | None = ...,
    through: Sequence[Table | Mapping[str, Any]],
) -> Table:
    """A massless rope of fixed `length` that is taut along its way `through` points, rings and
    discs: see `points of ropes`. Its spans are straight, and discs are left along tangents, in the
    plane. A load on a rope through a ring, a block and tackle, a string that winds on a drum.

    The length is that of the spans and of the arcs on discs between the ends; if it is absent, it
    is that of the start, and so it is for a rope that ends on a drum. The rope is to touch each
    disc that it goes round, and to leave one that takes it along in a direction within half a turn
    from that at the start.

    The multiplier is the tension, N. It stays taut even if that becomes negative, as a rod would;
    a `tether` is slack then. Where a disc takes it along, each section has
    a tension of its own: rows `<name>_1`, `<name>_2`, ….
    """
    ...

def RopePoint(
    *,
    body: str,
    at: Sequence[float | str] = ...,
    radius: float | str | None = ...,
    winds: Literal["clockwise", "counterclockwise"] | None = ...,
    grips: bool = ...,
) -> Table:
    """What a rope is held by or runs through: a point or a ring, or with `radius` a disc about it,
    which it goes round in the sense `winds`, seen along the rope from its first end to its last.

    The rope slides through rings and over discs without friction. A disc that `grips` takes it
    along without slip; so does a disc at an end, a drum, on which it is wound.
    """
    ...

def SampledController(
    *,
    name: str,
    period: float,
    delay: float = ...,
    sensors: Mapping[str, Table | Mapping[str, Any]] = ...,
    states: Mapping[str, Table | Mapping[str, Any]] = ...,
    inputs: Mapping[str, float | str] = ...,
    torques: Mapping[str, float | str] = ...,
    seed: float | str = ...,
) -> Table:
    """At t = 0, `period`, 2 `period`, … it reads `sensors`, then gives inputs of the scene and
    torques at joints the values of their formulas, and its states those of `next`. Between samples
    all of them are held.

    Formulas use t, coordinates, velocities, parameters, readings of this sample, and states and
    inputs as they were before it; so none depends on itself. Sensors do not use readings of the
    same sample. With `delay` inputs and torques change so many seconds after the sample. Readings,
    states and held values are states of the module. Noise follows from `seed`, which is a
    parameter, the number of the sensor and that of the sample alone, and is the same everywhere.
    """
    ...

def Scene(
    *,
    name: str,
    title: str = ...,
    about: str = ...,
    outputs: Literal["all"] | Sequence[Literal["forward_dynamics", "inverse_dynamics", "mass_matrix", "velocity_force", "gravity_force", "bias_force", "applied_force", "kinetic_energy", "potential_energy", "kinetic_slopes", "effect_powers", "effect_forces", "coordinates", "velocities", "accelerations", "momentum", "centre_of_mass", "joint_forces", "constraint_forces", "driving_forces", "body_poses", "body_velocities", "point_positions", "point_velocities", "point_jacobians", "implicit_step", "input_jacobian", "parameter_jacobian", "frame_jacobians", "frame_jacobians_local", "frame_jacobians_world", "frame_bias_accelerations", "frame_bias_accelerations_local", "frame_bias_accelerations_world", "centre_of_mass_jacobian", "centroidal_momentum_matrix", "operational_mobilities", "operational_inertias", "coriolis_matrix", "regressor", "inverse_dynamics_derivatives", "inverse_mass_matrix", "forward_dynamics_derivatives"]] = ...,
    form: Literal["velocity", "momentum", "redundant"] = ...,
    parameters: Mapping[str, float | str | Table | Mapping[str, Any]] = ...,
    inputs: Sequence[str | Table | Mapping[str, Any]] = ...,
    definitions: Mapping[str, float | str] = ...,
    dimensions: Literal[2, 3] = ...,
    route: Literal["auto", "closed", "ldl", "aba", "independent", "embedded", "mixed", "orthogonal"] = ...,
    loops: Literal["auto", "closed", "projected"] = ...,
    bodies: Sequence[Table | Mapping[str, Any]] = ...,
    joints: Sequence[Table | Mapping[str, Any]] = ...,
    chains: Sequence[Table | Mapping[str, Any]] = ...,
    points: Sequence[Table | Mapping[str, Any]] = ...,
    effects: Sequence[Table | Mapping[str, Any]] = ...,
    constraints: Sequence[Table | Mapping[str, Any]] = ...,
    locked: Mapping[str, float | str] = ...,
    leave_out: Sequence[Literal["velocity_forces"]] = ...,
    initial: Table | Mapping[str, Any] = ...,
    simulation: Table | Mapping[str, Any] = ...,
    camera: Table | Mapping[str, Any] = ...,
) -> _Scene:
    """A whole scene."""
    ...

def Sensor(
    *,
    value: float | str,
    noise: float | str = ...,
    quantum: float | str = ...,
    unit: str = ...,
    about: str = ...,
) -> Table:
    """A sensor of a sampled controller: it measures `value`, adds normal noise of the standard
    deviation `noise`, and rounds to a multiple of `quantum`. Its last reading is a state with its
    name, which formulas use.
    """
    ...

def Simulation(
    *,
    t_end: float = ...,
    integrator: Literal["euler", "semi_implicit_euler", "leapfrog", "leapfrog_4", "leapfrog_6", "rk4", "linearly_implicit", "implicit_midpoint", "gauss_4", "gauss_6", "RK45", "DOP853", "taylor", "Rodas5P", "Radau", "Radau_differences", "BDF", "BDF_differences", "LSODA"] = ...,
    dt: float = ...,
    rtol: float = ...,
    atol: float | None = ...,
    rest_speed: float | None = ...,
) -> Table:
    """Settings of a run, which options of the command line override.

    Rigid contacts that close more slowly than `rest_speed`, m/s or rad/s, do not bounce; without
    it, contacts that would rise by less than 5e-8 of the mechanism's size do not. Without `atol`,
    the absolute tolerance of each state is 1e-12 of the state's size, or `rtol`/1000 of it if
    `rtol` is below 1e-9, but not less than the rounding error of the state. Sizes are estimated
    from the scene's lengths and initial motion.
    """
    ...

def Sphere(
    *,
    radius: float | str,
    center: Sequence[float | str] | None = ...,
    color: str | None = ...,
) -> Table:
    """A ball of `radius` m about `center`, in body axes; in space."""
    ...

def Spring(
    *,
    name: str,
    body_1: str,
    at_1: Sequence[float | str] = ...,
    body_2: str,
    at_2: Sequence[float | str] = ...,
    stiffness: float | str = ...,
    damping: float | str = ...,
    rest_length: float | str = ...,
    tension_only: bool = ...,
    law: float | str | None = ...,
    allow_active: bool = ...,
) -> Table:
    """A tension k s + c ds/dt (N) along the line between two points.

    d is the vector from point 1 to point 2, s = |d| - rest length. A `law` of `stretch` s (m) and
    `rate` ds/dt (m/s) replaces k s; it is positive in tension. With `tension_only` it is a rope:
    the force is 0 if s <= 0, and never compressive. The potential energy is ½ k s²; a law has none,
    so its work counts as that of an applied force.

    The direction of d is undefined at d = 0, so it is smoothed below ε = 1e-9 m: there |d| is
    replaced by ε and the force is T(ε) d/ε, which falls to 0; damping acts on the whole relative
    velocity, c ((u·ḋ) u + (1 - u·u) ḋ) with u = d/ε. Force and energy are continuous and
    consistent; with rest length 0 the force is k d everywhere.
    """
    ...

def State(
    *,
    initial: float = ...,
    rate: float | str,
    unit: str = ...,
    about: str = ...,
) -> Table:
    """A state z of a controller: dz/dt = `rate`, z(0) = `initial`."""
    ...

def Tether(
    *,
    name: str,
    through: Sequence[Table | Mapping[str, Any]],
    length: float | str,
    restitution: float | str = ...,
) -> Table:
    """A massless string of fixed `length`, which does not stretch: it keeps its way `through`
    points, rings and discs from getting longer, see `points of ropes`, and is slack while the way
    is shorter.

    It is a rigid contact with the gap `length` - way, without friction. Where it becomes taut it
    pulls with an impulse, and the way shortens at `restitution` times the speed at which it got
    longer. While it is taut its tension is not negative; it becomes slack where that would be.
    """
    ...

def Universal(
    *,
    name: str,
    parent: str,
    child: str,
    r_parent: Sequence[float | str] = ...,
    r_child: Sequence[float | str] = ...,
    orientation_deg: float | Sequence[float] = ...,
    orientation: float | str | Sequence[float | str] | Sequence[Sequence[float | str]] | None = ...,
    loop: bool = ...,
    motor_inertia: float | str = ...,
    axes: Sequence[Sequence[float]] = ...,
    coordinates: Sequence[str] | None = ...,
) -> Table:
    """The child rotates about the first axis, and about the second, which moves with the first."""
    ...

def Weld(
    *,
    name: str,
    parent: str,
    child: str,
    r_parent: Sequence[float | str] = ...,
    r_child: Sequence[float | str] = ...,
    orientation_deg: float | Sequence[float] = ...,
    orientation: float | str | Sequence[float | str] | Sequence[Sequence[float | str]] | None = ...,
    loop: bool = ...,
) -> Table:
    """The child is fixed to the parent."""
    ...
