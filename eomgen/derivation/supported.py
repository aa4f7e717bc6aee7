"""Which models have a closed form, and by which of the two derivations."""

from collections import Counter

from eomgen.language.formula import ZERO, is_zero
from eomgen.model.dependence import is_plain
from eomgen.model.model import Model
from eomgen.scene.joints import Joint
from eomgen.scene.joints.base import WithRotor, kinds_of

MOST_BODIES = 12
"""Bodies of one tree of pins in the plane; twelve take about a minute, one more a third more."""
MOST_GENERAL_BODIES, MOST_GENERAL_VELOCITIES = 6, 15
"""Of any other model: six pins in space take two seconds, five ball joints some twenty."""
MOST_REPORTED = 6
"""The most bodies of a derivation that anyone would read; writing it takes half a minute."""
FEW_BODIES, FEW_VELOCITIES = 3, 3
"""Up to this many the closed form takes about a second, and is worth a try."""


def why_not_closed(model: Model) -> str:
    """Why a model has no route `closed`, in a few words; "" if it has."""
    if why_not_plain(model) or not why_not_pins(model):
        return why_not_plain(model)
    if len(model.bodies) > MOST_GENERAL_BODIES:
        return (
            f"it is for {MOST_GENERAL_BODIES} bodies at most, or {MOST_BODIES} in a tree of pins "
            "and free bodies in the plane"
        )
    size = len(model.velocities)
    if size > MOST_GENERAL_VELOCITIES:
        return f"it is for {MOST_GENERAL_VELOCITIES} velocities at most, and there are {size}"
    return ""


def why_not_tried(model: Model) -> str:
    """Why deriving a closed form, if there is one, would take too long; "" if it would not."""
    if len(model.bodies) > FEW_BODIES:
        return f"not tried on more than {FEW_BODIES} bodies; --route closed tries it"
    if not why_not_pins(model) or len(model.bodies) == 1:
        return ""
    if len(model.velocities) > FEW_VELOCITIES:
        return f"not tried on more than {FEW_VELOCITIES} velocities; --route closed tries it"
    return ""


def why_not_plain(model: Model) -> str:
    """Why a model has no closed form: prescribed motion, a loop, something left out."""
    for c in model.prescribed:
        return f"it takes no {'locked' if c.locked else 'driven'} coordinate ('{c.position.name}')"
    for constraint in model.constraints:
        return f"it closes no loops ('{constraint.name}')"
    for words in model.leave_out:
        return f"it leaves nothing out ('{words}')"
    return ""


def why_not_momenta(model: Model) -> str:
    """Why a model has no state form with momenta: the handout's derivation, for pins and free
    bodies in the plane, alone has them, without effects that are symbols to it.
    """
    if words := why_not_plain(model):
        return words
    for effect in model.effects:
        if not is_plain(effect, model):
            what = f"'{effect.type}' that it does not write out ('{effect.name}')"
            return f"in momenta it takes no {what}"
    return why_not_pins(model)


def why_not_pins(model: Model) -> str:
    """Why a model is not covered by the handout's derivation, for pins and free bodies in the
    plane.
    """
    if why_not_plain(model):
        return why_not_plain(model)
    if model.dimensions != 2:
        return "it is derived in the plane"
    for body in model.bodies:
        joint = body.joint
        if joint.holds and kinds_of(joint, 2) != ["revolute"]:
            return f"it is for pins and free bodies, and '{joint.name}' is {joint.type}"
        if isinstance(joint, WithRotor) and joint.motor_inertia != ZERO:
            return f"it takes no motor_inertia, and '{joint.name}' has one"
        if joint.orientation_deg or joint.orientation:
            return f"it takes no orientation, and '{joint.name}' has one"
        if model.value(body.mass) == 0.0:
            return f"it divides by masses, and that of '{body.name}' is 0"
        if model.value(body.moment) == 0.0 and (
            not off_centre(joint) or all(model.value(r) == 0.0 for r in joint.r_child)
        ):
            return f"nothing in it resists the rotation of '{body.name}', whose inertia_com is 0"
    size = max(Counter(model.roots).values())
    if size > MOST_BODIES:
        return f"it is for trees of up to {MOST_BODIES} bodies, and one has {size}"
    return ""


def off_centre(joint: Joint) -> bool:
    """Whether a revolute joint's axis passes beside its child's centre of mass: `r_child` is not
    the bare number 0.
    """
    return joint.holds and not all(is_zero(r) for r in joint.r_child)
