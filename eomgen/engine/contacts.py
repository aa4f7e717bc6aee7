"""Rigid contacts: forces of contacts that are held, and impacts of contacts that close.

All tolerances are dimensionless: gaps are relative to the size of the mechanism, speeds and
accelerations to those of its motion. So a scene in other units, or of another scale, runs alike.
"""

from dataclasses import dataclass
from typing import Annotated, Protocol

from eomgen.engine.complementarity import accelerate, complementary
from eomgen.subset.words import Vector, Whole, counts, numbers, rows, sqrt, zeros

TOLERANCE = 1e-9
"""Contacts with gaps below this touch, and may penetrate by this at the start; in sizes."""
STILL = 3e-11
"""Contacts that close more slowly than this do not strike; in speeds of the motion."""
PARTING = 1e-10
"""A contact without force whose gap accelerates less than this does not open; in accelerations of
the motion."""
ALPHA = 10 / sqrt(9.81)
"""The rate at which the drift of held contacts decays, in rates of the motion: 10/s for a mechanism
of one metre under gravity."""
RISE = 5e-8
"""A contact that would rise less than this does not bounce, unless `rest` is given; in sizes."""
AWAY = 1e-6
"""A gap that accelerates by more than this without contact forces opens by itself; in accelerations
of the motion."""
STRONG = 2.0**400
"""A force beside which all others are negligible, N or N m."""
BOUNCES, STRIKES = 100, 5000
"""Greatest number of strikes at one time, per contact: with restitution, and in all."""
STRUCK, ENDLESS, NO_FORCES = 0, 1, 2
"""What `strike` answers: it is done, impacts do not end, no forces keep contacts from closing."""


class ContactLaw(Protocol):
    """The rigid contacts of a mechanism; those without effect have infinite gaps, and no rates."""

    def gaps(self, t: float, y: Annotated[Vector, "STATES"], /) -> Annotated[Vector, "CONTACTS"]:
        """The gaps (CONTACTS,), in sizes; positive if apart."""
        ...

    def rates(self, t: float, y: Annotated[Vector, "STATES"], /) -> Annotated[Vector, "CONTACTS"]:
        """Their time derivatives, sizes/s."""
        ...

    def held(
        self, t: float, y: Annotated[Vector, "STATES"], forces: Annotated[Vector, "CONTACTS"], /
    ) -> Annotated[Vector, "PRESSED"]:
        """Under normal forces of the contacts, N or N m: the rates of the states, the accelerations
        of the gaps, sizes/s², and what else the forces change; all affine in them.
        """
        ...

    def impact(
        self, t: float, y: Annotated[Vector, "STATES"], contact: int, bounce: float, /
    ) -> Annotated[Vector, "STATES"]:
        """The state after an impact of a contact, whose restitution is multiplied by `bounce`."""
        ...


@dataclass(slots=True)
class Touching:
    """What is known of contacts beside time and state.

    alpha    the rate at which drift decays, 1/s
    fastest  the greatest rate of any gap at any strike so far, sizes/s
    holds    1 for contacts that are held
    units    for each of them a force that accelerates its gap about as much as the other forces do,
             so that differences do not lose digits
    slack    added to each gap: positive for contacts that have just opened, whose gaps are 0 but
             for rounding, until they exceed `TOLERANCE`
    rest     closing speeds below which contacts do not bounce, sizes/s; negative if not given
    found, pushes, parts
             what `press` has computed
    speeds, least
             the same of `strike`
    """

    alpha: float
    fastest: float
    holds: Annotated[Whole, "CONTACTS"]
    units: Annotated[Vector, "CONTACTS"]
    slack: Annotated[Vector, "CONTACTS"]
    rest: Annotated[Vector, "CONTACTS"]
    found: Annotated[Vector, "PRESSED"]
    pushes: Annotated[Vector, "CONTACTS"]
    parts: Annotated[Vector, "CONTACTS"]
    speeds: Annotated[Vector, "CONTACTS"]
    least: Annotated[Vector, "CONTACTS"]


@dataclass(slots=True)
class Place:
    """Where a run is: time and state, and flags of the contacts that have just closed or opened.
    There were `events` within `least` s `since` a time. Last the contact of which a zero is sought,
    and what is added to its gap.
    """

    t: float
    y: Annotated[Vector, "STATES"]
    closed: Annotated[Whole, "CONTACTS"]
    opened: Annotated[Whole, "CONTACTS"]
    least: float
    since: float
    events: int
    contact: int = 0
    slack: float = 0.0


def largest(n: int, x: Annotated[Vector, "n"]) -> float:
    """The greatest magnitude."""
    most = 0.0
    for i in range(n):
        most = max(most, abs(x[i]))
    return most


def counted(n: int, flags: Annotated[Whole, "n"]) -> int:
    """How many flags are 1."""
    many = 0
    for i in range(n):
        many += flags[i]
    return many


def accelerations(
    law: ContactLaw,
    t: float,
    y: Annotated[Vector, "STATES"],
    free: Annotated[Vector, "CONTACTS"],
) -> None:
    """Compute the accelerations of the gaps without contact forces, sizes/s²."""
    none = zeros(len(free))
    base = law.held(t, y, none)
    free[:] = base[len(y) : len(y) + len(free)]


def begin(
    law: ContactLaw, now: Touching, t: float, y: Annotated[Vector, "STATES"], span: float
) -> None:
    """Begin a run of `span` s: nothing is held.

    `alpha` is ALPHA times the rate of the motion at its start, and at least 1/span.
    """
    rate = nothing_held(law, now, t, y)
    now.alpha = ALPHA * max(rate, 1.0 / span)


def nothing_held(law: ContactLaw, now: Touching, t: float, y: Annotated[Vector, "STATES"]) -> float:
    """Hold nothing. The rate of the motion, 1/s: the greatest of √a and v of the gaps."""
    free = zeros(len(now.slack))
    accelerations(law, t, y, free)
    rate = law.rates(t, y)
    now.fastest = largest(len(free), rate)
    for c in range(len(free)):
        now.holds[c] = 0
        now.slack[c] = 0.0
    return max(sqrt(largest(len(free), free)), now.fastest)


def deepest(law: ContactLaw, t: float, y: Annotated[Vector, "STATES"]) -> int:
    """The contact that penetrates most; -1 if none does by more than `TOLERANCE`."""
    gap = law.gaps(t, y)
    found = -1
    least = -TOLERANCE
    for c in range(len(gap)):
        if gap[c] < least:
            least = gap[c]
            found = c
    return found


def acceleration_of_motion(now: Touching) -> float:
    """The acceleration of the motion at the start of the run, sizes/s²: see `begin`."""
    rate = now.alpha / ALPHA
    return rate * rate


def weigh(law: ContactLaw, now: Touching, t: float, y: Annotated[Vector, "STATES"]) -> None:
    """Compute `units` of the contacts that are held: forces that accelerate their gaps as much as
    any gap is without contact forces, but at least by the acceleration of the motion, since bodies
    that move together do not accelerate their gaps.
    """
    n = len(now.slack)
    first = len(y)
    force = zeros(len(now.slack))
    base = law.held(t, y, force)
    top = max(largest(n, base[first : first + n]), acceleration_of_motion(now))
    for c in range(n):
        if now.holds[c] == 1:
            force[c] = STRONG
            under = law.held(t, y, force)
            force[c] = 0.0
            own = abs(under[first + c] - base[first + c]) / STRONG
            now.units[c] = top / own if own > 0.0 else 1.0


def press(law: ContactLaw, now: Touching, t: float, y: Annotated[Vector, "STATES"]) -> bool:
    """Compute, as `found`, what `ContactLaw.held` gives under the forces of the contacts that are
    held, which may open, but not close. False if no forces keep them from closing.

    The forces f solve 0 <= f, 0 <= a, f a = 0 with a = gap'' + 2 α gap' + α² gap, which is affine
    in f: with α = `alpha` drift decays (Baumgarte stabilisation with both roots at -α). For each
    contact `pushes` is the acceleration of its gap by its own force, and `parts` is a, or 0 if that
    is negligible.
    """
    return press_many(law, now, counted(len(now.holds), now.holds), t, y)


def press_many(
    law: ContactLaw, now: Touching, many: int, t: float, y: Annotated[Vector, "STATES"]
) -> bool:
    """The same for `many` contacts that are held."""
    alpha = now.alpha
    n = len(now.holds)
    first = len(y)
    place = counts(many)
    a = numbers(many, many)
    offset = numbers(many)
    forces = numbers(many)
    w = numbers(many)
    force = zeros(len(now.holds))
    base = law.held(t, y, force)
    under = rows(many, len(base))
    gap = law.gaps(t, y)
    rate = law.rates(t, y)
    row = 0
    for c in range(n):
        now.pushes[c] = 0.0
        now.parts[c] = 0.0
        if now.holds[c] == 1:
            place[row] = c
            offset[row] = base[first + c] + 2.0 * alpha * rate[c] + alpha * alpha * gap[c]
            row += 1
    for j in range(many):
        force[place[j]] = now.units[place[j]]
        under[j] = law.held(t, y, force)
        force[place[j]] = 0.0
        for i in range(many):
            a[i][j] = under[j][first + place[i]] - base[first + place[i]]
    if not complementary(many, a, offset, forces):
        return False
    accelerate(many, a, offset, forces, w)
    scale = max(largest(n, base[first : first + n]), acceleration_of_motion(now))
    now.found[:] = base
    for j in range(many):
        part = forces[j]
        now.found += part * (under[j] - base)
        now.pushes[place[j]] = part * a[j][j]
        if abs(w[j]) > PARTING * scale:
            now.parts[place[j]] = w[j]
    return True


def strike(law: ContactLaw, now: Touching, at: Place) -> int:
    """Let contacts strike, and change the state: among those that touch, that have `closed` or that
    are held, the one that closes fastest, until none closes; then hold those that
    stay closed.

    Computes the greatest closing `speeds` of those that struck, and the `least` with which each
    bounces. A contact that closes more slowly does not bounce, and after `BOUNCES` strikes per
    contact none does. Answers `STRUCK`, `ENDLESS` or `NO_FORCES`.
    """
    n = len(at.closed)
    touching = counts(len(at.closed))
    gap = law.gaps(at.t, at.y)
    many = 0
    for c in range(n):
        now.speeds[c] = 0.0
        if at.closed[c] == 1 or now.holds[c] == 1 or gap[c] <= TOLERANCE:
            touching[c] = 1
            many += 1
    nothing = slowest(law, now, at.t, at.y)
    count = 0
    while True:
        rate = law.rates(at.t, at.y)
        c = fastest(n, touching, rate)
        if c < 0 or not -rate[c] > nothing:
            break
        if count == STRIKES * many:
            return ENDLESS
        bounce = 1.0 if -rate[c] >= now.least[c] and count < BOUNCES * many else 0.0
        now.speeds[c] = max(now.speeds[c], -rate[c])
        after = law.impact(at.t, at.y, c, bounce)
        at.y = after
        count += 1
    return hold(law, now, at.t, at.y, touching, nothing)


def slowest(law: ContactLaw, now: Touching, t: float, y: Annotated[Vector, "STATES"]) -> float:
    """The speed below which contacts do not strike, sizes/s; and the `least` with which each
    bounces: `rest` if given, else that from which it would rise by `RISE` against the accelerations
    of the gaps.

    A contact that opens by itself, as in grazing a curved surface, bounces at any speed: its
    bounces end anyway, and without them it would stick.
    """
    n = len(now.least)
    accelerations(law, t, y, now.least)
    rate = law.rates(t, y)
    top = largest(n, now.least)
    now.fastest = max(now.fastest, largest(n, rate))
    for c in range(n):
        if now.least[c] > AWAY * top:
            now.least[c] = 0.0
        elif now.rest[c] >= 0.0:
            now.least[c] = now.rest[c]
        else:
            now.least[c] = sqrt(2.0 * RISE * top)  # it leaves at v against a, and rises by v²/2a
    return STILL * max(now.fastest, sqrt(top))


def fastest(n: int, touching: Annotated[Whole, "n"], rate: Annotated[Vector, "n"]) -> int:
    """The contact among some that closes fastest; -1 if there is none."""
    found = -1
    for c in range(n):
        if touching[c] == 1 and (found < 0 or rate[c] < rate[found]):
            found = c
    return found


def hold(
    law: ContactLaw,
    now: Touching,
    t: float,
    y: Annotated[Vector, "STATES"],
    touching: Annotated[Whole, "CONTACTS"],
    nothing: float,
) -> int:
    """Hold, of the contacts that touch, those that do not open faster than `nothing` and would not
    open without a force. Answers `STRUCK` or `NO_FORCES`.
    """
    n = len(touching)
    rate = law.rates(t, y)
    for c in range(n):
        now.holds[c] = 0
        if touching[c] == 1:
            now.slack[c] = 0.0
            if rate[c] <= nothing:
                now.holds[c] = 1
    if counted(n, now.holds) == 0:
        return STRUCK
    weigh(law, now, t, y)
    if not press(law, now, t, y):
        return NO_FORCES
    gap = law.gaps(t, y)
    for c in range(n):
        if now.holds[c] == 1 and not (now.pushes[c] > 0.0 or now.parts[c] <= 0.0):
            let_go(now, c, gap[c])
    return STRUCK


def let_go(now: Touching, c: int, gap: float) -> None:
    """Let a contact open; its `slack` is `TOLERANCE`, or a little more than its penetration."""
    now.holds[c] = 0
    now.slack[c] = max(TOLERANCE, 0.01 * TOLERANCE - gap)


def release(
    law: ContactLaw,
    now: Touching,
    t: float,
    y: Annotated[Vector, "STATES"],
    opened: Annotated[Whole, "CONTACTS"],
) -> None:
    """Let contacts open that were held, and weigh the others anew."""
    gap = law.gaps(t, y)
    for c in range(len(opened)):
        if opened[c] == 1:
            let_go(now, c, gap[c])
    weigh(law, now, t, y)


def settle(law: ContactLaw, now: Touching, t: float, y: Annotated[Vector, "STATES"]) -> None:
    """Take the slack off contacts that have left."""
    n = len(now.slack)
    if largest(n, now.slack) > 0.0:
        gap = law.gaps(t, y)
        for c in range(n):
            if gap[c] > TOLERANCE:
                now.slack[c] = 0.0
