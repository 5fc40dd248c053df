"""True effects in the words of the test, from truth.json of `benchmarks.independent.foreign`; their seal."""

import hashlib
import json

NAMED = {
    "point_mass": "mass",
    "point_inertia": "inertia",
    "crack": "stiffness_loss",
    "member_stiffness": "member_stiffness",
    "member_density": "member_mass",
    "member_section": "member_section",
    "preload": "preload",
    "ground_spring": "ground_spring",
    "ground_damper": "ground_damper",
    "joint_viscous_damping": "connection_damping",
}
"""Kinds of the generator, and what the test calls them."""
MOVED = "hole_beside", "mounted_along", "settled_elsewhere"


def neutral_effects(effect):
    """Return what the generator calls one effect as effects of the test: one for each direction."""
    place, size = effect["location"].split()[-1], effect["magnitude"]
    match effect["type"]:
        case "none":
            return []
        case "connection":
            out = [
                {
                    "kind": "connection_stiffness",
                    "place": place,
                    "direction": d,
                    "value": k,
                    "unit": _stiffness(d),
                }
                for d, k in size["k"].items()
            ]
            if "loss_factor" in size:
                damped = {"kind": "connection_damping", "place": place}
                out.append(damped | {"value": size["loss_factor"], "unit": "-"})
            return out
        case "named":
            return [_named(effect)]
        case moved if moved in MOVED:
            return [{"kind": "connection_offset", "place": place, "value": size, "unit": "m"}]
        case "outside":
            return []
        case "sensor_fault":
            other = [size["swapped_with"]] if "swapped_with" in size else []
            return [
                {"kind": "sensor", "place": effect["location"], "also": other, "value": size, "unit": "-"}
            ]
    msg = f"the truth {effect['type']!r} has no kind in the test"
    raise ValueError(msg)


def _stiffness(direction):
    return "N·m/rad" if direction.startswith("r") else "N/m"


def _named(effect):
    kind, place = NAMED[effect["kind"][0]], effect["place"]
    value = {"value": effect["value"], "unit": effect["unit"]}
    if kind.startswith("ground"):
        _, end, _, member, direction = place
        return {"kind": kind, "place": f"{member}.{end}", "direction": direction} | value
    out = {"kind": kind, "place": place[0]} | value
    return out if effect["position"] is None else out | {"position": effect["position"]}


def neutral_truth(truth):
    """Return what the test keeps of a truth of the generator.

    ``test`` is ``as described`` or ``real``: then sensors have masses and are off by millimetres, degrees and
    per cent, and statements of that are neither right nor wrong. ``outside`` has effects that no kind of the
    test describes, ``noise`` the relative noise of FRFs [-].
    """
    effects = [x for e in truth["effects"] for x in neutral_effects(e)]
    told = {"effects": effects, "test": truth.get("test", "as described"), "code": truth["code"]}
    if outside := [e for e in truth["effects"] if e["type"] == "outside"]:
        told["outside"] = outside
    more = {"noise": truth["noise"]} if "noise" in truth else {}
    return told | {"structure": truth["structure"], "shows": truth.get("shows", [])} | more


def canonical(truth):
    """Return the text of a truth that is hashed: keys in order, no spaces."""
    return json.dumps(truth, sort_keys=True, separators=(",", ":"), ensure_ascii=False)


def seal_of(case, truth, salt):
    """Return the SHA-256 of a case's truth with a salt, in hexadecimal digits."""
    return hashlib.sha256(f"{salt}:{case}:{canonical(truth)}".encode()).hexdigest()


def broken_seals(truths, seals, salt):
    """Return the names of the cases whose truth is not what was sealed."""
    every = sorted(truths.keys() | seals.keys())
    return [c for c in every if c not in truths or seals.get(c) != seal_of(c, truths[c], salt)]
