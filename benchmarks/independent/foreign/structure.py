"""Structures of structures.toml, and what an analyst knows of one: nominal.json."""

import tomllib
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from benchmarks.independent.bodies import Bar
from benchmarks.independent.casefiles import DIRECTIONS

_FILES = "structures", "further", "later", "fresh", "latest", "newest", "unseen", "sealed", "open", "recent"
STRUCTURES, *NAMED = (Path(__file__).with_name(f"{name}.toml") for name in _FILES)
FRESH, OPEN = (STRUCTURES.with_name(f"{name}.toml") for name in ("fresh", "open"))
"""Structures that every run draws are the first ones; of the others each is drawn when it is named."""
E, NU, RHO = 210e9, 0.3, 7850.0
HELD = 1e11
"""Stiffness of what is held, in every direction [N/m, N·m/rad]."""
OFF_MATERIAL, OFF_JOINT = 0.02, 0.10
"""Nominal E, ρ and joint stiffnesses are off by up to this [-]."""
CORNER = (
    "all other bar-to-bar connections welded (rigid); centre lines given; the clear length of a bar ends "
    "{half:g} mm from the centre line of the bar it meets (solid corner: usual practice is a rigid end zone "
    "of half of that, about {zone:g} mm at every member end)"
)
WELDED_BEAMS = "all other connections welded (rigid), centre lines meet"


@dataclass(frozen=True)
class Member:
    """A straight member: ends [m], section as in nominal.json, and its bar of solids if it is one."""

    name: str
    start: np.ndarray
    end: np.ndarray
    section: dict
    bar: Bar | None = None

    @property
    def length(self):
        return float(np.linalg.norm(self.end - self.start))

    @property
    def axes(self):
        """Local axes as rows; z along the section's h."""
        x = (self.end - self.start) / self.length
        h = np.array(self.section["h_direction"], dtype=float)
        z = h - (h @ x) * x
        z /= np.linalg.norm(z)
        return np.array([x, np.cross(z, x), z])

    def at(self, s):
        """Return the point of the axis there."""
        return (self.start + s * (self.end - self.start) / self.length).round(9)


@dataclass(frozen=True)
class Connection:
    """Springs in global directions between sides (member, position), or between one and the ground."""

    name: str
    sides: tuple
    location: np.ndarray
    k: np.ndarray
    loss: float
    held: bool


@dataclass(frozen=True)
class Structure:
    """A structure, what is measured on it, and up to which frequency [Hz]."""

    name: str
    says: str
    code: str
    bodies: tuple
    members: dict
    connections: dict
    sensors: tuple
    excitations: tuple
    frequency: np.ndarray
    damping: tuple

    @property
    def solid(self):
        return self.code == "solid"

    @cached_property
    def channels(self):
        """Sensors as nominal.json lists them; places are counted along each member."""
        out, node = [], 0
        for member in self.members:
            for n, (_, s, directions) in enumerate(p for p in self.sensors if p[0] == member):
                node += 1
                place = {"node": node, "sign": 1, "member": member, "position": s}
                out += [{"name": f"{member}{n + 1}{d}", "direction": d, **place} for d in directions]
        return out

    @property
    def joints(self):
        return [c for c in self.connections.values() if not c.held]

    @property
    def supports(self):
        return [c for c in self.connections.values() if c.held]

    @cached_property
    def body_of(self):
        return {member: body for body in self.bodies for member in body}


def member_of(name, given, sections):
    """Return a member of structures.toml."""
    if "axis" in given:
        bar = Bar(**given | {"start": tuple(given["start"])})
        section = {
            "type": "rect",
            "b": bar.b,
            "h": bar.h,
            "h_direction": bar.rotation[:, 2].round(12).tolist(),
        }
        return Member(name, bar.at(0.0), bar.at(bar.length), section, bar)
    return Member(name, np.array(given["from"]), np.array(given["to"]), sections[given["section"]])


def connection_of(name, given, members):
    """Return a connection of structures.toml; it acts midway between its sides."""
    sides = tuple((member, s) for member, s in given["sides"])
    location = np.mean([members[member].at(s) for member, s in sides], axis=0).round(9)
    held = given.get("held", False)
    k = np.full(6, HELD) if held else np.array(given["k"], dtype=float)
    return Connection(name, sides, location, k, given.get("loss", 0.0), held)


def read(path=STRUCTURES):
    """Return the structures of a file by name."""
    out = {}
    for name, t in tomllib.loads(path.read_text(encoding="utf-8")).items():
        members = {m: member_of(m, given, t.get("sections", {})) for m, given in t["members"].items()}
        out[name] = Structure(
            name,
            t["says"],
            t["code"],
            tuple(map(tuple, t["bodies"])),
            members,
            {c: connection_of(c, given, members) for c, given in t["connections"].items()},
            tuple(map(tuple, t["sensors"])),
            tuple(t["excitations"]),
            np.arange(t["step"], t["stop"] + 1e-9, t["step"]),
            tuple(t["damping"]),
        )
    return out


def nominal_of(case, structure, rng):
    """Return nominal.json: material and joints a little off, the geometry as it is, and nothing hidden."""
    off = lambda most: 1 + most * float(rng.uniform(-1, 1))  # noqa: E731
    material = {"name": "steel", "E": round(E * off(OFF_MATERIAL), -6), "nu": NU}
    material["rho"] = round(RHO * off(OFF_MATERIAL), 1)
    frequency = structure.frequency
    out = {
        "case": case,
        "structure": structure.says,
        "units": "SI (m, N, kg, s, Pa, Hz)",
        "material": material,
        "points": {
            str(s["node"]): structure.members[s["member"]].at(s["position"]).tolist()
            for s in structure.channels
        }
        | {c.name: c.location.tolist() for c in structure.supports},
        "members": [
            {
                "name": m.name,
                "end1": m.at(0.0).tolist(),
                "end2": m.at(m.length).tolist(),
                "section": m.section,
            }
            for m in structure.members.values()
        ],
        "joints": [joint_of(c, off) for c in structure.joints],
        "supports": [{"point": c.name, "fixed": "all six"} for c in structure.supports] or "free-free",
        "sensors": structure.channels,
        "excitations": [{"sensor": s} for s in structure.excitations],
        "frequency": {"start": float(frequency[0]), "stop": float(frequency[-1]), "lines": len(frequency)},
        "response": "accelerance, (m/s^2)/N",
        "damping_guess_modal": round(0.87 * structure.damping[0], 4),
        "tolerances": "E +-2 %, rho +-2 %, joint data +-10 %, dimensions +-0.5 %",
        "files": ["frf.uff"],
    }
    if welded := welds(structure):
        out["welded"] = welded
    return out


def joint_of(connection, off):
    """Return a joint of nominal.json, its stiffnesses a little off."""
    (member1, s1), *other = connection.sides
    member2, s2 = other[0] if other else ("ground", 0.0)
    k = {f"k{d}": float(f"{v * off(OFF_JOINT):.4g}") for d, v in zip(DIRECTIONS, connection.k, strict=True)}
    kind = f"elastic, 6 uncoupled springs in global directions, loss factor {connection.loss}"
    return {
        "name": connection.name,
        "type": kind,
        "member1": member1,
        "s1": s1,
        "member2": member2,
        "s2": s2,
        "location": connection.location.tolist(),
        "k": k,
    }


def welds(structure):
    """Return the words on welded corners; none where every body is one member."""
    together = [structure.members[m] for body in structure.bodies if len(body) > 1 for m in body]
    if not together:
        return ""
    if not structure.solid:
        return WELDED_BEAMS
    half = 500 * float(np.median([m.bar.h for m in together]))
    return CORNER.format(half=half, zone=half / 2)
