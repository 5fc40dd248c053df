"""A case of the open test: a folder with structure.json, frf.uff and modes.csv, in words of no program."""

import csv
import json
import re
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

CASE_FORMAT = "open test of missing physics, case, version 1"
STRUCTURE, FRFS, MODES = "structure.json", "frf.uff", "modes.csv"
SAME_POINT = 1e-6
"""Positions that differ by less are the same [m]."""
DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")
SHAPES = {"rect": "rectangle", "rhs": "hollow rectangle", "round": "circle", "tube": "tube"}
TOLERANCES = {"E": "E", "rho": "rho", "joint data": "joint_stiffness", "dimensions": "dimensions"}
"""How nominal.json of `benchmarks.independent` names tolerances, and how structure.json does."""


class CaseError(ValueError):
    """A case or an answer that is not as the documents of the test say."""


@dataclass(frozen=True)
class Structure:
    """What structure.json says, by name: members with their lengths [m], connections, sensors and forces."""

    name: str
    lengths: dict
    connections: dict
    sensors: tuple
    forces: tuple
    told: dict

    @property
    def n_single(self):
        """How many different single effects can be named: kinds at members, connections, ends and sensors."""
        of_members, of_connections, of_ends = 6 * len(self.lengths), 8 * len(self.connections), 12
        return of_members + of_connections + of_ends * len(self.lengths) + 5 * len(self.sensors)

    def axis(self, member):
        """Return the global direction along a member, None where it is oblique."""
        ends = next(m["ends"] for m in self.told["members"] if m["name"] == member)
        along = np.abs(np.subtract(*ends)) > SAME_POINT
        return DIRECTIONS[int(np.argmax(along))] if along.sum() == 1 else None

    @cached_property
    def welded(self):
        """Frozensets of ends ``(member, 1 or 2)`` that are welded to each other at one point.

        An end at which a connection acts is left out: what is welded to which side of it is not stated.
        """
        at, sides = {}, {side for sides in self.connections.values() for side in sides}
        for m in self.told["members"]:
            for end, (point, s) in enumerate(zip(m["ends"], (0.0, self.lengths[m["name"]]), strict=True), 1):
                if not any(member == m["name"] and abs(s - x) < SAME_POINT for member, x in sides):
                    at.setdefault(tuple(np.round(point, 6)), set()).add((m["name"], end))
        return tuple(frozenset(ends) for ends in at.values() if len(ends) > 1)


def read_structure(case):
    """Return the structure of a case folder.

    Raises
    ------
    CaseError
        If the file is missing or not of this format.
    """
    file = Path(case) / STRUCTURE
    try:
        told = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, json.JSONDecodeError) as reason:
        msg = f"{file}: {reason}"
        raise CaseError(msg) from reason
    if told.get("format") != CASE_FORMAT:
        msg = f"{file}: format is {told.get('format')!r}; {CASE_FORMAT!r} is expected"
        raise CaseError(msg)
    lengths = {m["name"]: float(np.linalg.norm(np.subtract(*m["ends"]))) for m in told["members"]}
    connections = {j["name"]: [(s["member"], s["position"]) for s in j["sides"]] for j in told["joints"]}
    connections |= {s["name"]: [] for s in told["supports"]}
    sensors = tuple(s["name"] for s in told["sensors"])
    return Structure(told["case"], lengths, connections, sensors, tuple(told["forces"]), told)


def neutral(nominal):
    """Return structure.json of a nominal.json of `benchmarks.independent.foreign`."""
    material = nominal["material"]
    lines = nominal["frequency"]
    zone = re.search(r"([\d.]+) mm at every member end", nominal.get("welded", ""))
    return {
        "format": CASE_FORMAT,
        "case": nominal["case"],
        "description": nominal["structure"],
        "units": "SI: m, N, kg, s, Pa, Hz, rad",
        "materials": [{k: material[k] for k in ("name", "E", "nu", "rho")}],
        "modal_damping_ratio": nominal["damping_guess_modal"],
        "members": [
            {
                "name": m["name"],
                "material": material["name"],
                "ends": [m["end1"], m["end2"]],
                "section": {"shape": SHAPES[m["section"]["type"]]}
                | {k: v for k, v in m["section"].items() if k not in ("type", "h_direction")},
                "height_direction": m["section"]["h_direction"],
            }
            for m in nominal["members"]
        ],
        "elsewhere": "members whose ends or centre lines meet are joined rigidly there",
        "rigid_end_length": float(zone[1]) / 1000 if zone else 0.0,
        "joints": [
            {
                "name": j["name"],
                "sides": [{"member": j["member1"], "position": j["s1"]}]
                + ([] if j["member2"] == "ground" else [{"member": j["member2"], "position": j["s2"]}]),
                "to_ground": j["member2"] == "ground",
                "at": j["location"],
                "stiffness": {k.removeprefix("k"): v for k, v in j["k"].items()},
                "loss_factor": float(re.search(r"loss factor ([\d.]+)", j["type"])[1]),
            }
            for j in nominal["joints"]
        ],
        "supports": [
            {"name": s["point"], "at": nominal["points"][s["point"]], "fixed": list(DIRECTIONS)}
            for s in (nominal["supports"] if isinstance(nominal["supports"], list) else [])
        ],
        "sensors": [
            {
                "name": s["name"],
                "node": s["node"],
                "at": nominal["points"][str(s["node"])],
                "member": s["member"],
                "position": s["position"],
                "direction": s["direction"],
            }
            | ({"mass": s["mass"]} if "mass" in s else {})
            for s in nominal["sensors"]
        ],
        "forces": [e["sensor"] for e in nominal["excitations"]],
        "frequency": {"first": lines["start"], "last": lines["stop"], "lines": lines["lines"]},
        "response": "accelerance",
        "tolerances": {
            TOLERANCES[name.strip()]: round(float(value) / 100, 6)
            for name, value in re.findall(r"([A-Za-z ]+?) \+-([\d.]+) %", nominal["tolerances"])
        },
        "data": {"frf": FRFS, "modes": MODES},
    }


def nominal_of(told):
    """Return the nominal.json that a structure.json was made of: the way back of `neutral`."""
    (material,) = told["materials"]
    zone = told["rigid_end_length"]
    shapes = {v: k for k, v in SHAPES.items()}
    names = {v: k for k, v in TOLERANCES.items()}
    points = {str(s["node"]): s["at"] for s in told["sensors"]} | {
        s["name"]: s["at"] for s in told["supports"]
    }
    return {
        "case": told["case"],
        "structure": told["description"],
        "units": "SI",
        "material": material,
        "points": points,
        "members": [
            {
                "name": m["name"],
                "end1": m["ends"][0],
                "end2": m["ends"][1],
                "section": {"type": shapes[m["section"]["shape"]]}
                | {k: v for k, v in m["section"].items() if k != "shape"}
                | {"h_direction": m["height_direction"]},
            }
            for m in told["members"]
        ],
        "joints": [_nominal_joint(j) for j in told["joints"]],
        "welded": "all other connections welded (rigid), centre lines meet"
        + (f" (rigid end zone: {1000 * zone:g} mm at every member end)" if zone else ""),
        "supports": [{"point": s["name"], "fixed": "all six"} for s in told["supports"]] or "free-free",
        "sensors": [{k: v for k, v in s.items() if k != "at"} | {"sign": 1} for s in told["sensors"]],
        "excitations": [{"sensor": name} for name in told["forces"]],
        "frequency": dict(zip(("start", "stop", "lines"), told["frequency"].values(), strict=True)),
        "response": "accelerance, (m/s^2)/N",
        "damping_guess_modal": told["modal_damping_ratio"],
        "tolerances": ", ".join(f"{names[k]} +-{100 * v:g} %" for k, v in told["tolerances"].items()),
        "files": [told["data"]["frf"]],
    }


def _nominal_joint(joint):
    first, *second = joint["sides"]
    other = second[0] if second else {"member": "ground", "position": 0.0}
    return {
        "name": joint["name"],
        "type": f"elastic, 6 uncoupled springs in global directions, loss factor {joint['loss_factor']:g}",
        "member1": first["member"],
        "s1": first["position"],
        "member2": other["member"],
        "s2": other["position"],
        "location": joint["at"],
        "k": {f"k{d}": k for d, k in joint["stiffness"].items()},
    }


def write_modes(file, identified, sensors):
    """Write identified modes: frequency [Hz], damping ratio and, for each sensor, the shape's two parts."""
    shapes = np.asarray(identified.shapes)
    with Path(file).open("w", newline="", encoding="utf-8") as stream:
        out = csv.writer(stream)
        out.writerow(
            ["frequency_hz", "damping_ratio", *(f"{part}:{s}" for s in sensors for part in ("re", "im"))]
        )
        for f, zeta, phi in zip(identified.frequency, identified.zeta, shapes.T, strict=True):
            phi = phi / phi[np.argmax(np.abs(phi))]
            parts = np.column_stack([phi.real, phi.imag]).ravel()
            out.writerow([f"{f:.6g}", f"{zeta:.4g}", *(f"{x:.4g}" for x in parts)])


def read_modes(case):
    """Return natural frequencies [Hz], damping ratios and shapes (n_sensors, n_modes) of a case."""
    file = Path(case) / MODES
    with file.open(newline="", encoding="utf-8") as stream:
        rows = [[float(x) for x in row] for row in list(csv.reader(stream))[1:]]
    table = np.array(rows, dtype=float).reshape(len(rows), -1)
    return table[:, 0], table[:, 1], (table[:, 2::2] + 1j * table[:, 3::2]).T
