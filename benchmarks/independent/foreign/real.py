"""Tests that are not as described: places, directions, gains and masses of sensors, a stinger and a driver.

A stream of random numbers of its own draws them, so that what a case hides does not depend on them.
"""

from dataclasses import dataclass, field

import numpy as np

from benchmarks.independent.casefiles import AXES

OFF_PLACE, OFF_DIRECTION = 0.002, np.radians(2.0)
"""Standard deviations of a sensor's place in each direction [m], and of directions [rad]."""
OFF_GAIN, OFF_GAIN_OF_SOME, SOME = 0.01, 0.03, 0.15
"""Standard deviations of gains, that of some sensors, and how many these are [-]."""
SENSOR_MASS, DRIVER_MASS = (0.002, 0.010), (0.005, 0.020)
"""Masses of a sensor's body, and of what a driver has beyond its force cell [kg]."""
STINGER = 500.0, 3000.0
"""Stiffness of a stinger across its axis [N/m]."""
ALIKE, STATED = 0.05, 0.20
"""Standard deviations of masses of bodies of one kind, and of the mass that nominal.json states [-]."""
INSIDE = 0.85
"""A sensor of a solid is no further from the axis than this share of half its width or height [-]."""


@dataclass(frozen=True)
class Instruments:
    """What a test has beside what is described; everything is as described unless it is named here.

    Of sensors by name: ``offsets`` along the member and across it along its local y and z [m], ``turns``
    (rotation vectors) [rad] and ``gains``; ``masses`` of their bodies by (member, stated position) [kg].
    Of excitations by name: ``force_turns`` [rad], ``stingers`` (stiffness across the force) [N/m] and
    ``drivers`` (mass beyond the force cell) [kg]; both act whatever is driven.
    """

    offsets: dict = field(default_factory=dict)
    turns: dict = field(default_factory=dict)
    force_turns: dict = field(default_factory=dict)
    gains: dict = field(default_factory=dict)
    masses: dict = field(default_factory=dict)
    stingers: dict = field(default_factory=dict)
    drivers: dict = field(default_factory=dict)


AS_DESCRIBED = Instruments()


def turned(vector, turn):
    """Return a vector turned about a rotation vector [rad] (Rodrigues)."""
    angle = np.linalg.norm(turn)
    if angle == 0:
        return np.asarray(vector, dtype=float)
    k = np.asarray(turn) / angle
    v = np.asarray(vector, dtype=float)
    return v * np.cos(angle) + np.cross(k, v) * np.sin(angle) + k * (k @ v) * (1 - np.cos(angle))


def off_axis(member, s, offset):
    """Return the position along a member and the point of a place that is off by (along, y, z) [m].

    A place beyond an end lies as far before it.
    """
    s = abs(s + offset[0])
    s = round(min(s, 2 * member.length - s), 9)
    across = np.array(offset[1:])
    if member.bar is not None:
        half = 0.5 * INSIDE * np.array([member.bar.b, member.bar.h])
        across = np.clip(across, -half, half)
    return s, tuple((member.at(s) + across @ member.axes[1:]).round(9).tolist())


def draw_instruments(structure, rng):
    """Return what a test has beside what is described; sensors at one place are one body."""
    normal = lambda std, digits: round(float(std * rng.standard_normal()), digits)  # noqa: E731

    def turn(direction):
        angle, towards = OFF_DIRECTION * rng.standard_normal(), rng.uniform(0, 2 * np.pi)
        about = np.insert([np.cos(towards), np.sin(towards)], AXES.index(direction), 0.0)
        return tuple((angle * about).round(6).tolist())

    directions = {s["name"]: s["direction"] for s in structure.channels}
    single, several = sorted(rng.uniform(*SENSOR_MASS, size=2))
    places, masses = {}, {}
    for member, s, along in structure.sensors:
        places[member, s] = tuple(normal(OFF_PLACE, 6) for _ in range(3))
        kind = single if len(along) == 1 else several
        masses[member, s] = round(float(kind * (1 + ALIKE * rng.standard_normal())), 6)
    gains = {
        name: round(1 + normal(OFF_GAIN_OF_SOME if rng.uniform() < SOME else OFF_GAIN, 5), 5)
        for name in directions
    }
    driven = structure.excitations[rng.integers(len(structure.excitations))]
    return Instruments(
        {s["name"]: places[s["member"], s["position"]] for s in structure.channels},
        {name: turn(d) for name, d in directions.items()},
        {name: turn(directions[name]) for name in structure.excitations},
        gains,
        masses,
        {driven: round(float(rng.uniform(*STINGER)), 1)},
        {driven: round(float(rng.uniform(*DRIVER_MASS)), 6)},
    )


def with_stated_masses(nominal, instruments, rng):
    """Return nominal.json with masses of sensors in half of the cases, one factor off; else as it was."""
    if rng.uniform() < 0.5:
        return nominal
    off = 1 + STATED * float(np.clip(rng.standard_normal(), -2.5, 2.5))
    sensors, known = [], set()
    for s in nominal["sensors"]:
        place = s["member"], s["position"]
        first = place not in known  # a body with several channels has its mass at the first of them
        known.add(place)
        sensors.append(s | ({"mass": round(off * instruments.masses[place], 5)} if first else {}))
    return nominal | {"sensors": sensors}


def in_truth(instruments):
    """Return what truth.json says of a test."""
    return {
        "offsets_m": instruments.offsets,
        "turns_rad": instruments.turns,
        "force_turns_rad": instruments.force_turns,
        "gains": instruments.gains,
        "masses_kg": {f"{member} at {s:g} m": mass for (member, s), mass in instruments.masses.items()},
        "stingers_N_per_m": instruments.stingers,
        "drivers_kg": instruments.drivers,
    }
