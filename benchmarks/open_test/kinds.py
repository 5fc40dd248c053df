"""The kinds of effects that answers name, and which answers say the same.

An effect is a dict with ``kind``, ``place`` and, by kind, ``direction`` and ``position`` [m] along the
member; ``value`` in ``unit`` and ``std`` are stated where they are known.
"""

from dataclasses import dataclass

from benchmarks.open_test.case import DIRECTIONS, CaseError

CONNECTION, MEMBER, END, SENSOR = "connection", "member", "end of a member", "sensor"
NEAR = 0.05
"""A position is right within this share of the member's length [-]."""


@dataclass(frozen=True)
class Kind:
    """A neutral kind: what it means, what it is at, whether a direction or a position belongs to it."""

    says: str
    at: str
    unit: str
    directed: bool = False
    placed: bool = False


KINDS = {
    "connection_stiffness": Kind(
        "stiffness of a joint or support in a direction, as it is",
        CONNECTION,
        "N/m or N·m/rad",
        directed=True,
    ),
    "connection_damping": Kind(
        "damping of a joint or support: loss factor, or dashpot in a direction",
        CONNECTION,
        "- or N·s/m, N·m·s/rad",
    ),
    "connection_offset": Kind("a joint, clamp or foot acts elsewhere than stated", CONNECTION, "m"),
    "mass": Kind("additional mass at a point", MEMBER, "kg", placed=True),
    "inertia": Kind("additional rotary inertia at a point", MEMBER, "kg·m²", placed=True),
    "stiffness_loss": Kind("less stiffness over a short length: a crack, a notch", MEMBER, "-", placed=True),
    "member_stiffness": Kind("relative change of a member's modulus", MEMBER, "-"),
    "member_mass": Kind("relative change of a member's mass per length", MEMBER, "-"),
    "member_section": Kind("relative change of a dimension of a member's section", MEMBER, "-"),
    "preload": Kind("axial force, tension positive", MEMBER, "N"),
    "ground_spring": Kind("spring from an end of a member to the ground", END, "N/m", directed=True),
    "ground_damper": Kind("dashpot from an end of a member to the ground", END, "N·s/m", directed=True),
    "sensor": Kind("a sensor that is not as stated: sign, gain, label, direction or place", SENSOR, "-"),
}
"""All kinds by name. Places: names of structure.json; an end of a member is ``MEMBER.1`` or ``MEMBER.2``."""


ON_A_NODE = [KINDS[name] for name in ("mass", "inertia", "ground_spring", "ground_damper")]
"""Kinds that act on a point and not on one member there."""


def places(kind, structure):
    """Return the names at which a kind of effect can be."""
    if kind.at == MEMBER:
        return set(structure.lengths)
    if kind.at == SENSOR:
        return set(structure.sensors)
    if kind.at == END:
        return {f"{m}.{k}" for m in structure.lengths for k in (1, 2)}
    return set(structure.connections)


def check_effect(effect, structure, where):
    """Raise a CaseError where an effect is not one of the test's."""
    kind = KINDS.get(effect.get("kind"))
    if kind is None:
        msg = f"{where}: there is no kind {effect.get('kind')!r}; kinds are {', '.join(KINDS)}"
        raise CaseError(msg)
    if effect.get("place") not in (known := places(kind, structure)):
        named = ", ".join(sorted(known))
        msg = f"{where}: {effect['kind']} at {effect.get('place')!r}; a place is one of {named}"
        raise CaseError(msg)
    if kind.directed and effect.get("direction") not in DIRECTIONS:
        msg = f"{where}: direction is {effect.get('direction')!r}; one of {', '.join(DIRECTIONS)} is needed"
        raise CaseError(msg)
    if kind.placed:
        length, s = structure.lengths[effect["place"]], effect.get("position")
        if not isinstance(s, int | float) or not 0 <= s <= length * (1 + 1e-9):
            msg = f"{where}: position is {s!r}; 0 to {length:.4g} m along {effect['place']} is allowed"
            raise CaseError(msg)


def is_same(said, true, structure):
    """Return whether a stated effect is the true one, by kind, place, direction and position.

    A true effect may have ``also``, other places at which it is the same: both sensors of a swap, mirror
    places. Ends of members that are welded to each other are one place for masses, springs and dashpots,
    and so are both ends of a member for a spring or dashpot along it.
    What softens a member close to a connection acts as that connection does: a crack within `NEAR` of a
    member's length from a side of a connection is right where its stiffness about an axis is stated.
    """
    if said["kind"] == true["kind"]:
        kind = KINDS[true["kind"]]
        if kind.directed and said["direction"] != true["direction"]:
            return False
        if kind in ON_A_NODE and _at_one_corner(said, true, structure):
            return True
        if said["place"] not in (true["place"], *true.get("also", ())):
            return False
        near = NEAR * structure.lengths.get(true["place"], 0.0)
        return not kind.placed or abs(said["position"] - true["position"]) <= near
    softness, crack = sorted((said, true), key=lambda e: e["kind"])
    if (softness["kind"], crack["kind"]) != ("connection_stiffness", "stiffness_loss"):
        return False
    member = crack["place"]
    sides = [s for m, s in structure.connections[softness["place"]] if m == member]
    turns = softness["direction"].startswith("r")
    return turns and any(abs(s - crack["position"]) <= NEAR * structure.lengths[member] for s in sides)


def _at_one_corner(said, true, structure):
    """Return whether two effects are at ends that are welded to each other, or act along the same member."""
    one, two = _end(said, structure), _end(true, structure)
    if one is None or two is None:
        return False
    if one[0] == two[0] and KINDS[true["kind"]].directed:
        return true["direction"] == structure.axis(one[0]) or one == two
    return any({one, two} <= ends for ends in structure.welded)


def _end(effect, structure):
    """Return the end ``(member, 1 or 2)`` at or near which an effect is, None of another place."""
    if "position" not in effect:
        member, _, end = effect["place"].rpartition(".")
        return member, int(end)
    member, length = effect["place"], structure.lengths[effect["place"]]
    shares = effect["position"] / length, 1 - effect["position"] / length
    return next(((member, k) for k, share in enumerate(shares, 1) if share <= NEAR), None)


def is_right(said, true, structure):
    """Return whether stated effects are the true ones, each once and none besides."""
    left = list(true)
    for effect in said:
        match = next((t for t in left if is_same(effect, t, structure)), None)
        if match is None:
            return False
        left.remove(match)
    return not left


def share(said, true, structure):
    """Return how many of the true effects are named, and how many that are none."""
    named = sum(any(is_same(s, t, structure) for s in said) for t in true)
    false = sum(not any(is_same(s, t, structure) for t in true) for s in said)
    return named, false
