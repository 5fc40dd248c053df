"""What Dovetail names, in the words of the test."""

from benchmarks.open_test.answer import Explanation
from benchmarks.open_test.case import SAME_POINT
from benchmarks.open_test.kinds import NEAR

AT_MEMBER = {
    "point_mass": "mass",
    "distributed_mass": "mass",
    "point_inertia": "inertia",
    "crack": "stiffness_loss",
    "stiffness_loss": "stiffness_loss",
    "member_stiffness": "member_stiffness",
    "member_torsion": "member_stiffness",
    "member_density": "member_mass",
    "fluid_added_mass": "member_mass",
    "member_section": "member_section",
    "preload": "preload",
}
AT_END = {"ground_spring": "ground_spring", "ground_damper": "ground_damper"}
AT_CONNECTION = {
    "joint_stiffness": ("connection_stiffness",),
    "support_flexibility": ("connection_stiffness",),
    "joint_complex_stiffness": ("connection_stiffness", "connection_damping"),
    "foundation": ("connection_stiffness", "connection_damping"),
    "foundation_dashpot": ("connection_stiffness", "connection_damping"),
    "joint_viscous_damping": ("connection_damping",),
    "joint_structural_damping": ("connection_damping",),
    "joint_zener": ("connection_damping",),
    "joint_fractional": ("connection_damping",),
    "joint_hole": ("connection_offset",),
    "joint_offset": ("connection_offset",),
    "part_shift": ("connection_offset",),
    "foot_shift": ("connection_offset",),
    "support_shift": ("connection_offset",),
}
OF_A_PART = {"joint_mass": "mass", "joint_inertia": "inertia"}
"""What is at a joint; the test states it at the first side."""
OF_THE_TEST = {"stinger", "driver_mass", "sensor_mass"}
"""What belongs to a test that is not as described, and to no case."""


def effects_of(name, values, structure):
    """Return one effect of the program as effects of the test; None where the test has no word for it.

    Parameters
    ----------
    name : str
        Of a candidate, such as ``joint_stiffness:J1.rx``.
    values : mapping of str to (value, std, unit)
        By parameter, the first of which is the size.
    structure : Structure
    """
    kind, _, rest = name.partition(":")
    place, *parts = rest.split(".")
    place = place if place in structure.connections else place.split("+")[0]  # a clamp that members share
    value, std, unit = next(iter(values.values()), (None, None, ""))
    size = {} if value is None else {"value": value, "std": std, "unit": unit}
    if kind in OF_THE_TEST or kind.endswith("_form"):
        return []
    if kind in AT_MEMBER:
        at = {"position": values["position"][0]} if "position" in values else {}
        return [{"kind": AT_MEMBER[kind], "place": place} | at | size]
    if kind in AT_END and place in structure.lengths and parts[0] in ("1", "2"):
        end, direction = parts
        return [{"kind": AT_END[kind], "place": f"{place}.{end}", "direction": direction} | size]
    if kind in AT_END and (end := _end_at(place, parts, structure)):
        return [{"kind": AT_END[kind], "place": end, "direction": parts[-1]} | size]
    if kind == "end_release":
        s = 0.0 if parts[0] == "1" else structure.lengths[place]
        near = [c for c, sides in structure.connections.items() if (place, s) in sides]
        if near and len(near) == 1 and len(structure.connections[near[0]]) == 1:
            return [{"kind": "connection_stiffness", "place": near[0], "direction": parts[-1]}]
        return [{"kind": "stiffness_loss", "place": place, "position": s}]
    if kind in AT_CONNECTION and place in structure.connections:
        out = []
        for neutral in AT_CONNECTION[kind]:
            directed = {"direction": parts[-1]} if neutral == "connection_stiffness" else {}
            out.append(
                {"kind": neutral, "place": place}
                | directed
                | (size if neutral == AT_CONNECTION[kind][0] else {})
            )
        return out
    if kind in OF_A_PART and structure.connections.get(place):
        member, s = structure.connections[place][0]
        return [{"kind": OF_A_PART[kind], "place": member, "position": s} | size]
    return None


def explanations_of(diagnosis, structure):
    """Return the explanations of a diagnosis, equal ones together, and the probability of no explanation."""
    faults = [
        {"kind": "sensor", "place": f.sensor} for f in diagnosis.faults if f.sensor in structure.sensors
    ]
    kept, unexplained = {}, 0.0
    for e in diagnosis.explanations:
        told, known = [], e.known
        for effect, parameters in zip(e.effects, e.parameters, strict=True):
            values = {p.name: (p.value, p.std, p.unit) for p in parameters}
            words = effects_of(effect.name, values, structure)
            known, told = known and words is not None, told + (words or [])
        if not known:
            unexplained += e.probability
            continue
        effects = (*told, *faults)
        key = frozenset((x["kind"], x["place"], x.get("direction"), _about(x, structure)) for x in effects)
        one = kept.get(key)
        kept[key] = Explanation(
            e.probability + (one.probability if one else 0.0), one.effects if one else effects
        )
    return tuple(kept.values()), unexplained


def _end_at(connection, parts, structure):
    """Return the end of a member at a side of a connection, None in its middle unless that acts along it."""
    *other, direction = parts
    for member, s in structure.connections.get(connection, ())[len(other) : len(other) + 1]:
        length = structure.lengths[member]
        end = 1 if s < length / 2 else 2
        if min(s, length - s) < SAME_POINT or direction == structure.axis(member):
            return f"{member}.{end}"
    return None


def _about(effect, structure):
    """Return a position in steps of what counts as the same place."""
    if "position" not in effect:
        return None
    return round(effect["position"] / (NEAR * structure.lengths[effect["place"]]))
