"""Turn an independent case into a study: python -m benchmarks.independent.convert nominal.json study.toml

It reads what the analyst knows beforehand, and never truth.json. What is not understood is an error.
"""

import argparse
import json
import os
import re
import sys
from pathlib import Path

import numpy as np

KNOWN = {
    "case",
    "structure",
    "environment",
    "units",
    "material",
    "points",
    "members",
    "joints",
    "welded",
    "supports",
    "preload",
    "sensors",
    "sensors_note",
    "excitations",
    "frequency",
    "response",
    "damping_guess_modal",
    "tolerances",
    "files",
    "levels_N",
    "files_note",
}
SHAPES = {
    "rect": ("rectangle", ("b", "h")),
    "rhs": ("hollow_rectangle", ("b", "h", "t")),
    "round": ("circle", ("d",)),
    "tube": ("tube", ("d", "t")),
}
CONSTANTS = ("A", "Iy", "Iz", "J")
TABLES = {"modes.csv": "[modes]", "baseline.csv": "[baseline]"}
"""Files of measured modes, and the tables of a study that name them."""
GROUND = "ground"
"""What the second side of a joint to the ground is called."""
NUMBER = r"(\d+(?:\.\d+)?)"


class ConversionError(ValueError):
    """Something in a nominal.json that is not understood."""


def refuse(text):
    raise ConversionError(text)


def only(table, allowed, where):
    """Refuse keys that are not known."""
    if unknown := sorted(set(table) - set(allowed)):
        refuse(f"{where}: '{unknown[0]}' is not understood; known are {', '.join(sorted(allowed))}")
    return table


def toml(value):
    """Write a value in TOML."""
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{k} = {toml(v)}" for k, v in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(toml(v) for v in value) + "]"
    return repr(value)


def block(header, comment="", **keys):
    """Write a table with its keys; those that are None are left out."""
    lines = [header + (f"  # {comment}" if comment else "")]
    return "\n".join(lines + [f"{k} = {toml(v)}" for k, v in keys.items() if v is not None]) + "\n"


def convert(nominal, folder, target):
    """Return the text of a study file.

    Parameters
    ----------
    nominal : dict
        What nominal.json holds.
    folder : Path
        Where nominal.json and the measured files are.
    target : Path
        Where the study file will be; files are named relative to it.
    """
    only(nominal, KNOWN, "nominal.json")
    if not nominal["units"].startswith("SI"):
        refuse(f"units are '{nominal['units']}'; SI is expected")
    if nominal.get("preload", "none known") != "none known":
        refuse(f"preload '{nominal['preload']}' is not understood; 'none known' is")
    points = {name: [float(x) for x in xyz] for name, xyz in nominal["points"].items()}
    material = only(nominal["material"], {"name", "E", "nu", "rho", "loss_factor"}, "material")
    supports = supports_of(nominal)
    members = {
        m["name"]: only(m, {"name", "end1", "end2", "section"}, f"member {m['name']}")
        for m in nominal["members"]
    }
    zones = rigid_zones(
        nominal.get("welded", nominal["joints"]), members, [points[s["point"]] for s in supports]
    )
    parts = [
        block("[study]", name=nominal["case"], description=nominal["structure"]),
        block(f"[materials.{material['name']}]", **{k: v for k, v in material.items() if k != "name"}),
        block("[damping]", modal=nominal["damping_guess_modal"]),
        uncertain(nominal),
        block(
            "[points]", **{toml(n): xyz for n, xyz in points.items() if n in used_points(nominal, supports)}
        ),
        *(member_block(m, zones.get(m["name"], {})) for m in members.values()),
        *(joint_block(j, members) for j in nominal["joints"] if isinstance(nominal["joints"], list)),
        *(block("[[supports]]", **s) for s in supports),
        *sensor_blocks(nominal, points, members),
        *(excitation_block(e, nominal) for e in nominal["excitations"]),
        *measurement_blocks(nominal, folder, target),
    ]
    if "environment" in nominal:
        parts.append(block("[candidates]", environment=nominal["environment"]))
    return (
        f"# {nominal['case']}: written by benchmarks/independent/convert.py from nominal.json\n\n"
        + "\n".join(parts)
    )


def used_points(nominal, supports):
    return {s["point"] for s in supports} | {str(s["node"]) for s in nominal["sensors"]}


def uncertain(nominal):
    """Read 'E +-2 %, rho +-0.5 %, joint data +-3 %, dimensions +-0.5 %'."""
    names = {"E": "E", "rho": "rho", "joint data": "joints", "dimensions": None}
    keys = {}
    for part in nominal["tolerances"].split(","):
        found = re.fullmatch(rf"\s*({'|'.join(names)}) \+-{NUMBER} %\s*", part)
        if not found:
            refuse(f"tolerances: '{part.strip()}' is not understood; 'E +-2 %' and likes of it are")
        if names[found[1]]:
            keys[names[found[1]]] = round(float(found[2]) / 100, 9)
    return block("[uncertain]", nominal["tolerances"], **keys)


def supports_of(nominal):
    given = nominal["supports"]
    if given == "free-free":
        return []
    if not isinstance(given, list):
        refuse(f"supports '{given}' is not understood; 'free-free' or a list of points is")
    out = []
    for s in given:
        only(s, {"point", "fixed"}, "supports")
        if str(s["point"]) not in nominal["points"]:
            refuse(f"supports: there is no point {s['point']}")
        fixed = s["fixed"] if isinstance(s["fixed"], str) else " ".join(s["fixed"])
        if fixed == "all six":
            fixed = "all"
        elif not set(fixed.replace(",", " ").split()) <= {"x", "y", "z", "rx", "ry", "rz"}:
            refuse(f"supports: fixed '{fixed}' is not understood; 'all six' or some of x y z rx ry rz are")
        out.append({"point": str(s["point"]), "fixed": fixed})
    return out


def rigid_zones(joints, members, held):
    """Return the rigid end zones that the text on joints states, at member ends that meet another member."""
    if isinstance(joints, list):
        return {}
    if not re.search(r"all .*connections welded \(rigid\)", joints):
        refuse(f"joints '{joints[:60]}…' is not understood; 'all connections welded (rigid)' or a list is")
    found = re.search(rf"{NUMBER} mm at every member end", joints)
    if not found:
        if "zone" in joints:
            refuse("joints: a rigid end zone is spoken of, but 'N mm at every member end' is not found")
        return {}
    zone, out = float(found[1]) / 1000, {}
    for name, m in members.items():
        for key, end in (("rigid1", m["end1"]), ("rigid2", m["end2"])):
            meets = any(distance(end, o["end1"], o["end2"]) < 1e-6 for n, o in members.items() if n != name)
            if meets and not any(np.allclose(end, xyz, atol=1e-6) for xyz in held):
                out.setdefault(name, {})[key] = zone
    return out


def distance(xyz, a, b):
    """Return how far a point is from the line between two others [m]."""
    xyz, a, b = (np.array(v, dtype=float) for v in (xyz, a, b))
    s = np.clip((xyz - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)
    return float(np.linalg.norm(a + s * (b - a) - xyz))


def member_block(m, zones):
    s, name = m["section"], m["name"]
    if s.get("type") not in SHAPES:
        refuse(
            f"member {name}: section type '{s.get('type')}' is not understood; known are {', '.join(SHAPES)}"
        )
    shape, sizes = SHAPES[s["type"]]
    only(s, {"type", *sizes, *CONSTANTS, "h_direction", "Iy_note"}, f"member {name}, section")
    if "Iy_note" in s and "Iy: bending in the vertical plane" not in s["Iy_note"]:
        refuse(f"member {name}: '{s['Iy_note']}' is not understood")
    orientation = s.get("h_direction")
    if isinstance(orientation, str):
        orientation = (
            [0, 0, 1]
            if orientation == "vertical"
            else refuse(f"member {name}: h_direction '{orientation}' is not understood")
        )
    section = {"shape": shape} | {k: s[k] for k in (*sizes, *CONSTANTS) if k in s}
    return block(
        f"[members.{toml(name) if not re.fullmatch(r'[A-Za-z0-9_-]+', name) else name}]",
        **{"from": [float(x) for x in m["end1"]], "to": [float(x) for x in m["end2"]]},
        section=section,
        orientation=orientation,
        **zones,
    )


def joint_block(j, members):
    only(
        j,
        {"name", "type", "member1", "s1", "member2", "s2", "location", "note", "k"},
        f"joint {j.get('name')}",
    )
    keys = {
        "name": j["name"],
        "member1": j["member1"],
        "position1": j["s1"],
        "member2": j["member2"],
        "position2": j["s2"],
    }
    if j["member2"] == GROUND:
        del keys["member2"], keys["position2"]
    for member in (j["member1"], keys.get("member2", j["member1"])):
        if member not in members:
            refuse(f"joint {j['name']}: there is no member {member}")
    keys["location"] = j["location"]
    if j["type"].startswith("rigid"):
        if "k" in j:
            refuse(f"joint {j['name']}: it is rigid and has k")
        return block("[[joints]]", j["type"], **keys, rigid="all")
    if not j["type"].startswith("elastic, 6 uncoupled springs in global directions"):
        refuse(
            f"joint {j['name']}: type '{j['type']}' is not understood; 'rigid …' and 'elastic, "
            "6 uncoupled springs in global directions …' are"
        )
    rest = j["type"].removeprefix("elastic, 6 uncoupled springs in global directions").strip(" ,")
    found = re.fullmatch(r"loss factor (\d*\.?\d+)", rest)
    if rest and not found:
        refuse(f"joint {j['name']}: '{rest}' is not understood")
    only(j["k"], {"kx", "ky", "kz", "krx", "kry", "krz"}, f"joint {j['name']}, k")
    return block("[[joints]]", j.get("note", ""), **keys, k=j["k"], eta=float(found[1]) if found else None)


def sensor_blocks(nominal, points, members):
    """Write one table for each sensor, or for each node where names are node and direction."""
    out, groups = [], {}
    for s in nominal["sensors"]:
        only(
            s, {"name", "node", "direction", "sign", "member", "position", "mass"}, f"sensor {s.get('name')}"
        )
        check_place(s, points, members)
        if s["direction"] not in ("x", "y", "z") or s["sign"] not in (1, -1):
            refuse(f"sensor {s['name']}: direction {s['direction']!r}, sign {s['sign']!r} are not understood")
        compact = s["name"] == f"{s['node']}{s['direction']}" and s["sign"] == 1
        key = (s["node"], s["member"], "") if compact else (s["node"], s["member"], s["name"])
        groups.setdefault(key, []).append(s)
    for (node, _, name), sensors in groups.items():
        keys = {"node": node, "point": str(node)}
        if name:
            (s,) = sensors
            keys = (
                {"name": name} | keys | {"direction": s["direction"], "sign": -1 if s["sign"] == -1 else None}
            )
        else:
            keys["directions"] = "".join(s["direction"] for s in sensors)
        mass = next((s["mass"] for s in sensors if "mass" in s), None)
        out.append(block("[[sensors]]", **keys, mass=mass))
    return out


def check_place(s, points, members):
    """Refuse a sensor whose point is not on its member at its position, in any way of counting positions."""
    node, member = str(s["node"]), s["member"]
    if node not in points or member not in members:
        refuse(f"sensor {s['name']}: there is no point {node}, or no member {member}")
    xyz, a, b = (
        np.array(v, dtype=float) for v in (points[node], members[member]["end1"], members[member]["end2"])
    )
    arc, length = float(np.linalg.norm(xyz - a)), float(np.linalg.norm(b - a))
    counted = (arc, arc / length, *xyz)
    if distance(xyz, a, b) > 1e-6 or min(abs(s["position"] - c) for c in counted) > 1e-6:
        refuse(f"sensor {s['name']}: point {node} is not on {member} at {s['position']}")


def excitation_block(e, nominal):
    """Write a force at a sensor, one whose responses refer to a sensor, or a motion of the base."""
    if "base" in e:
        return block("[[excitations]]", **only(e, {"base", "node"}, "excitations"))
    only(e, {"sensor", "level_N", "reference"}, "excitations")
    for name in (e[key] for key in ("sensor", "reference") if key in e):
        if name not in [s["name"] for s in nominal["sensors"]]:
            refuse(f"excitations: there is no sensor {name}")
    return block("[[excitations]]", sensor=e["sensor"], reference=e.get("reference"))


def measurement_blocks(nominal, folder, target):
    response = nominal.get("response", "")  # a test that gave modes has none
    kind = response.split(",")[0]
    known = "accelerance, (m/s^2)/N", "mobility, (m/s)/N", "receptance, m/N", "transmissibility, -", ""
    if response not in known:
        refuse(f"response '{response}' is not understood")
    levels = nominal.get("levels_N", {})
    out = []
    for file in nominal["files"]:
        path = Path(os.path.relpath(Path(folder).resolve() / file, Path(target).resolve().parent)).as_posix()
        if file in TABLES:
            out.append(block(TABLES[file], file=path))
            continue
        if re.fullmatch(r"(sub|joint6)_\w+\.uff", file):
            continue  # the parts by themselves: not a measurement of the assembly
        if not re.fullmatch(r"frf(_level\d+)?\.uff", file):
            refuse(
                f"files: '{file}' is not understood; frf.uff, frf_levelN.uff, sub_*.uff, joint6_*.uff, "
                f"{' and '.join(TABLES)} are"
            )
        out.append(block("[[measurements]]", file=path, kind=kind, force_level=levels.get(file)))
    return out


def main(argv=None):
    parser = argparse.ArgumentParser(
        description="Turn the nominal.json of an independent case into a study file."
    )
    parser.add_argument("nominal", type=Path)
    parser.add_argument("study", type=Path)
    options = parser.parse_args(argv)
    try:
        nominal = json.loads(options.nominal.read_text(encoding="utf-8"))
        text = convert(nominal, options.nominal.parent, options.study)
    except (ConversionError, KeyError, OSError, json.JSONDecodeError) as reason:
        word = f"there is no {reason}" if isinstance(reason, KeyError) else reason
        sys.stderr.write(f"{options.nominal}: {word}\n")
        return 2
    options.study.write_text(text, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
