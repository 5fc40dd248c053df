"""Make cases with a known hidden effect from bars of solid elements: solids.py FOLDER [NAME ...]

The elements are scikit-fem's quadratic hexahedra; nothing here comes from a beam code. Bars, or frames of
bars that are one body, are reduced to their modes and their responses to forces where something is attached;
joints, masses, springs and dampers are added to that exactly, line by line, and what depends on amplitude by
harmonic balance. Each case becomes a folder with nominal.json and frf.uff, as in
../shared/data/independent-cases, and all of them one truth.json. It runs where scikit-fem and pyuff are
installed (make peers), and imports nothing of Dovetail.
"""

import json
import sys
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
import scipy.sparse.linalg as sla
from scipy.optimize import brentq

E, NU, RHO = 210e9, 0.3, 7850.0
AXES = "xyz"
DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")
ELEMENT = 0.02
"""Length of an element [m]."""
ACROSS = 4, 2
"""Elements across a bar's width and height; with 2 and 1 torsion is 5 % too stiff."""
PATCH = 0.015
"""A joint holds what lies within this distance along a bar [m]."""
TRUE_JOINT = dict(zip(DIRECTIONS, (5e7, 5e7, 1e7, 3e3, 3e3, 5e3), strict=True))
JOINT_LOSS = 0.006
HELD = 1e11
"""Stiffness of a soft base in its other directions [N/m, N·m/rad]."""
NOISE, NOISE_FLOOR_DB = 0.01, -65.0
LEVELS_N = {"frf.uff": 1.0, "frf_level2.uff": 20.0}
"""Amplitudes of the force where something depends on amplitude, by the file that they make [N]."""
N_MODES, HIGHEST = 60, 9000.0
N_MODES_WELDED = 100
WELDED = (
    "all bar-to-bar connections welded (rigid); centre lines given; the clear length of a bar ends 10 mm "
    "from the centre line of the bar it meets (solid corner: usual practice is a rigid end zone of half of "
    "that, about 5 mm at every member end)"
)


@dataclass(frozen=True)
class Bar:
    """A bar of rectangular section along an axis, its h along z or, of one along z, along y [m]."""

    start: tuple[float, float, float]
    axis: str
    length: float
    b: float
    h: float

    @property
    def rotation(self):
        """Local to global."""
        columns = {
            "x": ([1, 0, 0], [0, 1, 0], [0, 0, 1]),
            "y": ([0, 1, 0], [-1, 0, 0], [0, 0, 1]),
            "z": ([0, 0, 1], [1, 0, 0], [0, 1, 0]),
        }
        return np.array(columns[self.axis], dtype=float).T

    def at(self, s):
        return (np.array(self.start) + self.rotation[:, 0] * s).round(9)


@dataclass(frozen=True)
class Structure:
    """Bars, joints (name, bar, position, bar, position), and what is measured up to a frequency [Hz].

    Welded bars have no joints and are one body, which may be held at first ends of bars.
    """

    bars: dict
    joints: tuple
    sensors: tuple  # (bar, position [m], directions)
    excitations: tuple  # names of sensors
    stop: float
    held: tuple = ()
    step: float = 2.0
    damping: tuple = (0.003, 1700.0)  # of modes, and how its variation goes with frequency [-, Hz]
    clamped: float = 0.0  # joints hold patches of this reach as good as rigidly [m]
    disc: str = ""  # or flats that touch hold a disc of that radius on their faces, "mean" or "rigid"

    @property
    def welded(self):
        return not self.joints


@dataclass(frozen=True)
class Hidden:
    """What a case hides; everything is nominal unless it is named here.

    Bars, by name: ``E``, ``rho``, ``b`` and ``h`` are factors, ``loss`` loss factors beyond modal damping
    of bars that are not welded, and ``weaker`` is (from, to, factor of E) of a stretch.

    Places: ``masses``, ``ground``, ``dampers``, ``inertias`` and ``rotors`` are (bar, position, …) with a
    mass [kg]; a direction, a stiffness [N/m] and a loss factor; a direction and a dashpot to the ground
    [N·s/m]; a rotary inertia alike about all axes [kg·m²]; the axis of rotation, global, and the angular
    momentum about it [kg·m²/s]. What turns takes the mean motion of what lies within `PATCH` along the bar.
    ``bases`` are stiffnesses [N·m/rad, N/m] of held ends by (bar, direction), and ``base_dashpots`` dashpots
    [N·m·s/rad, N·s/m] beside them.

    Joints, by (joint, direction): ``joints`` are factors of stiffnesses, ``dashpots`` dampers [N·m·s/rad,
    N·s/m], ``zener`` the (r, τ [s]) of k (1 + r iωτ/(1 + iωτ)). ``couplings`` are the shares c of
    k_ij = c √(k_ii k_jj) by (joint, direction, direction). By joint: ``joint_masses`` are masses, half on
    each side [kg], and ``offsets`` where the springs act, from the middle [m]. ``nonlinear`` is one (joint,
    direction, law of `LAWS`, values of the law), beside the joint's spring.

    Faults of the measurement, by sensor: ``gains``, ``delays`` [s], ``tilts`` (towards a direction, angle
    [rad]) and ``places`` where a sensor truly is [m]; ``swaps`` are pairs of exchanged labels, and
    ``force_gains`` what the readings of excitations carry.
    """

    E: dict = field(default_factory=dict)
    rho: dict = field(default_factory=dict)
    b: dict = field(default_factory=dict)
    h: dict = field(default_factory=dict)
    loss: dict = field(default_factory=dict)
    weaker: dict = field(default_factory=dict)
    masses: tuple = ()
    ground: tuple = ()
    dampers: tuple = ()
    inertias: tuple = ()
    rotors: tuple = ()
    joints: dict = field(default_factory=dict)
    dashpots: dict = field(default_factory=dict)
    zener: dict = field(default_factory=dict)
    couplings: dict = field(default_factory=dict)
    joint_masses: dict = field(default_factory=dict)
    offsets: dict = field(default_factory=dict)
    nonlinear: tuple = ()
    bases: dict = field(default_factory=dict)
    base_dashpots: dict = field(default_factory=dict)
    gains: dict = field(default_factory=dict)
    delays: dict = field(default_factory=dict)
    tilts: dict = field(default_factory=dict)
    places: dict = field(default_factory=dict)
    swaps: tuple = ()
    force_gains: dict = field(default_factory=dict)

    @property
    def points(self):
        """Where something acts on displacements: (bar, position)."""
        return [(bar, s) for bar, s, *_ in (*self.masses, *self.ground, *self.dampers)]

    @property
    def turning(self):
        """Where something acts on rotations: (bar, position)."""
        return [(bar, s) for bar, s, *_ in (*self.inertias, *self.rotors)]

    def changed(self, name, bar):
        """Return a bar with the section that it truly has."""
        return replace(bar, b=bar.b * self.b.get(name, 1.0), h=bar.h * self.h.get(name, 1.0))


def along(bar, n, step, directions="z", first=0.0):
    return tuple((bar, round(first + step * k, 9), directions) for k in range(n))


STRUCTURES = {
    "cross": Structure(
        {
            "U": Bar((0.0, 0.0, 0.011), "x", 0.8, 0.03, 0.01),
            "D": Bar((0.45, -0.25, -0.011), "y", 0.8, 0.03, 0.01),
        },
        (("J", "U", 0.45, "D", 0.25),),
        along("U", 9, 0.1) + along("D", 9, 0.1),
        ("U1z", "D3z"),
        3200.0,
    ),
    "ladder": Structure(
        {
            "A": Bar((0.0, 0.0, -0.012), "x", 0.7, 0.025, 0.012),
            "B": Bar((0.0, 0.3, -0.012), "x", 0.7, 0.025, 0.012),
            "C": Bar((0.2, -0.05, 0.012), "y", 0.4, 0.025, 0.012),
        },
        (("J1", "A", 0.2, "C", 0.05), ("J2", "B", 0.2, "C", 0.35)),
        (
            *(("A", 0.0, "yz"), ("A", 0.7, "yz"), ("B", 0.0, "yz"), ("B", 0.7, "yz"), ("C", 0.2, "xz")),
            *along("A", 6, 0.1, first=0.1),
            *along("B", 6, 0.1, first=0.1),
            *along("C", 2, 0.4),
        ),
        ("A1z", "B2z", "A1y"),
        2000.0,
    ),
    "grid": Structure(
        {
            "P": Bar((0.0, 0.0, -0.011), "x", 0.76, 0.03, 0.01),
            "Q": Bar((0.0, 0.32, -0.011), "x", 0.76, 0.03, 0.01),
            "R": Bar((0.16, -0.12, 0.011), "y", 0.6, 0.03, 0.01),
            "S": Bar((0.56, -0.08, 0.011), "y", 0.5, 0.025, 0.01),
        },
        (
            ("J1", "P", 0.16, "R", 0.12),
            ("J2", "Q", 0.16, "R", 0.44),
            ("J3", "P", 0.56, "S", 0.08),
            ("J4", "Q", 0.56, "S", 0.4),
        ),
        (
            *(("P", 0.0, "yz"), ("P", 0.3, "z"), ("P", 0.46, "z"), ("P", 0.76, "yz")),
            *(("Q", 0.0, "z"), ("Q", 0.36, "z"), ("Q", 0.66, "z"), ("Q", 0.76, "yz")),
            *(("R", 0.0, "z"), ("R", 0.28, "xz"), ("R", 0.6, "xz")),
            *(("S", 0.0, "z"), ("S", 0.24, "z"), ("S", 0.5, "xz")),
        ),
        ("P1z", "S3z"),
        1200.0,
    ),
    "lap": Structure(
        {
            "A": Bar((0.0, 0.0, -0.0045), "x", 0.62, 0.036, 0.009),
            "B": Bar((0.26, -0.018, 0.0045), "y", 0.4, 0.036, 0.009),
        },
        (("J", "A", 0.26, "B", 0.018),),
        (
            *(("A", 0.0, "yz"), ("A", 0.1, "z"), ("A", 0.2, "z"), ("A", 0.34, "yz"), ("A", 0.42, "z")),
            *(("A", 0.52, "z"), ("A", 0.62, "yz"), ("B", 0.06, "z"), ("B", 0.14, "xz"), ("B", 0.22, "z")),
            *(("B", 0.3, "z"), ("B", 0.4, "xz")),
        ),
        ("A1z", "B5z", "B5x"),
        2400.0,
        damping=(0.0025, 1300.0),
        clamped=0.0175,
    ),
    "strap": Structure(
        {
            "A": Bar((0.0, 0.0, -0.004), "x", 0.74, 0.032, 0.008),
            "B": Bar((0.18, -0.03, 0.005), "y", 0.36, 0.03, 0.01),
            "C": Bar((0.52, -0.1, 0.004), "y", 0.42, 0.04, 0.008),
        },
        (("J1", "A", 0.18, "B", 0.03), ("J2", "A", 0.52, "C", 0.1)),
        (
            *(("A", 0.0, "yz"), ("A", 0.1, "z"), ("A", 0.26, "z"), ("A", 0.36, "yz"), ("A", 0.44, "z")),
            *(("A", 0.64, "z"), ("A", 0.74, "yz"), ("B", 0.16, "z"), ("B", 0.36, "xz")),
            *(("C", 0.0, "xz"), ("C", 0.24, "z"), ("C", 0.42, "xz")),
        ),
        ("A1z", "C3z", "B2x"),
        1800.0,
        damping=(0.003, 900.0),
        clamped=0.015,
    ),
    "bolt": Structure(
        {
            "A": Bar((0.0, 0.0, -0.0045), "x", 0.58, 0.045, 0.009),
            "B": Bar((0.22, -0.0225, 0.0045), "y", 0.36, 0.036, 0.009),
        },
        (("J", "A", 0.22, "B", 0.0225),),
        (
            *(("A", 0.0, "yz"), ("A", 0.1, "z"), ("A", 0.16, "z"), ("A", 0.3, "yz"), ("A", 0.4, "z")),
            *(("A", 0.5, "z"), ("A", 0.58, "yz"), ("B", 0.08, "z"), ("B", 0.16, "xz"), ("B", 0.24, "z")),
            *(("B", 0.3, "z"), ("B", 0.36, "xz")),
        ),
        ("A1z", "B5z", "B5x"),
        2400.0,
        damping=(0.0028, 1100.0),
        clamped=0.016,
        disc="mean",
    ),
    "gate": Structure(
        {
            "L": Bar((0.0, 0.0, 0.0), "z", 0.6, 0.02, 0.02),
            "R": Bar((0.4, 0.0, 0.0), "z", 0.52, 0.02, 0.02),
            "S": Bar((0.0, 0.0, 0.1), "x", 0.4, 0.02, 0.012),
            "T": Bar((0.0, 0.0, 0.44), "x", 0.4, 0.02, 0.02),
        },
        (),
        (
            *(("L", 0.0, "xy"), ("L", 0.27, "xy"), ("L", 0.6, "xyz")),
            *(("R", 0.0, "xy"), ("R", 0.27, "xy"), ("R", 0.52, "xyz")),
            *(("S", 0.14, "yz"), ("S", 0.28, "yz"), ("T", 0.14, "yz"), ("T", 0.28, "yz")),
        ),
        ("L1x", "R1y"),
        1200.0,
        damping=(0.004, 700.0),
    ),
    "table": Structure(
        {
            "C1": Bar((0.0, 0.0, 0.0), "z", 0.42, 0.02, 0.02),
            "C2": Bar((0.46, 0.0, 0.0), "z", 0.42, 0.02, 0.02),
            "C3": Bar((0.46, 0.34, 0.0), "z", 0.42, 0.02, 0.02),
            "C4": Bar((0.0, 0.34, 0.0), "z", 0.42, 0.02, 0.02),
            "X1": Bar((0.0, 0.0, 0.41), "x", 0.46, 0.02, 0.02),
            "X2": Bar((0.0, 0.34, 0.41), "x", 0.46, 0.02, 0.02),
            "Y1": Bar((0.0, 0.0, 0.41), "y", 0.34, 0.02, 0.014),
            "Y2": Bar((0.46, 0.0, 0.41), "y", 0.34, 0.02, 0.014),
        },
        (),
        (
            *(("C1", 0.2, "xy"), ("C1", 0.41, "xyz"), ("C2", 0.2, "xy"), ("C2", 0.41, "xyz")),
            *(("C3", 0.2, "xy"), ("C3", 0.41, "xyz"), ("C4", 0.2, "xy"), ("C4", 0.41, "xyz")),
            *(("X1", 0.23, "yz"), ("X2", 0.23, "yz"), ("Y1", 0.17, "xz"), ("Y2", 0.17, "xz")),
        ),
        ("C12x", "C32y"),
        600.0,
        held=("C1", "C2", "C3", "C4"),
        step=1.0,
        damping=(0.006, 260.0),
    ),
    "tower": Structure(
        {
            **{
                f"C{k + 1}": Bar((x, y, 0.0), "z", 0.78, 0.02, 0.02)
                for k, (x, y) in enumerate(((0.0, 0.0), (0.44, 0.0), (0.44, 0.32), (0.0, 0.32)))
            },
            **{
                f"X{k}{side}": Bar((0.0, y, z), "x", 0.44, 0.02, 0.02)
                for k, z in ((1, 0.37), (2, 0.77))
                for side, y in (("a", 0.0), ("b", 0.32))
            },
            **{
                f"Y{k}{side}": Bar((x, 0.0, z), "y", 0.32, 0.02, 0.012)
                for k, z in ((1, 0.37), (2, 0.77))
                for side, x in (("a", 0.0), ("b", 0.44))
            },
        },
        (),
        (
            *((f"C{k}", s, "xyz") for k in range(1, 5) for s in (0.2, 0.37, 0.58, 0.77)),
            *(("X1a", 0.22, "xyz"), ("X2b", 0.22, "xyz"), ("Y1a", 0.16, "xyz"), ("Y2b", 0.16, "xyz")),
        ),
        ("C24x", "C42y"),
        500.0,
        held=("C1", "C2", "C3", "C4"),
        step=1.0,
        damping=(0.007, 240.0),
    ),
}
STRUCTURES["bond"] = replace(STRUCTURES["bolt"], disc="rigid")


def named(kind, *place, value, unit, position=None, length=None):
    """Return what truth.json says of an effect in Dovetail's words; several kinds if they say the same."""
    return {
        "type": "named",
        "kind": [kind] if isinstance(kind, str) else list(kind),
        "place": list(place),
        "value": value,
        "unit": unit,
        "position": position,
        "length": length,
        "location": " ".join(place),
        "magnitude": value,
    }


def fault(sensor, **magnitude):
    """Return what truth.json says of a sensor's fault: ``factor``, ``delay_s``, ``swapped_with``, …"""
    return {"type": "sensor_fault", "location": sensor, "magnitude": magnitude}


NOTHING = {"type": "none", "location": "-", "magnitude": 0}
NOTCH = (0.24, 0.26, 0.4)
SPREAD = tuple(("D", 0.36 + 0.02 * k, 0.025) for k in range(7))
CASES = {
    # the thresholds of the search were looked at on these
    "cross-nothing": ("cross", 1, Hidden(), [NOTHING]),
    "cross-stiffness": (
        "cross",
        2,
        Hidden(E={"U": 0.92}),
        [named("member_stiffness", "U", value=-0.08, unit="-")],
    ),
    "cross-notch": (
        "cross",
        3,
        Hidden(weaker={"U": NOTCH}),
        [named(("crack", "stiffness_loss"), "U", value=5.7e-5, unit="rad/(N·m)", position=0.25, length=0.8)],
    ),
    "cross-viscous-joint": (
        "cross",
        5,
        Hidden(dashpots={("J", "ry"): 0.6}),
        [named("joint_viscous_damping", "J", "ry", value=0.6, unit="N·m·s/rad")],
    ),
    "cross-sensor-masses": (
        "cross",
        6,
        Hidden(masses=tuple((bar, round(0.1 * k, 9), 0.012) for bar in "UD" for k in range(9))),
        [named("sensor_mass", "the", "18", "places", "of", "sensors", value=0.012, unit="kg")],
    ),
    "cross-ground-spring": (
        "cross",
        7,
        Hidden(ground=(("D", 0.8, "z", 5e4, 0.01),)),
        [named("ground_spring", "end", "2", "of", "D", "z", value=5e4, unit="N/m")],
    ),
    "cross-end-mass": (
        "cross",
        8,
        Hidden(masses=(("U", 0.0, 0.03),)),
        [named("point_mass", "U", value=0.03, unit="kg", position=0.0, length=0.8)],
    ),
    "cross-thicker": (
        "cross",
        9,
        Hidden(h={"D": 1.04}),
        [named("member_section", "D", "along", "local", "z", value=0.04, unit="-")],
    ),
    "cross-spread-mass": (
        "cross",
        10,
        Hidden(masses=SPREAD),
        [named("distributed_mass", "D", value=1.25, unit="kg/m", position=0.42, length=0.8)],
    ),
    "cross-soft-joint-and-mass": (
        "cross",
        11,
        Hidden(joints={("J", "rx"): 0.1}, masses=(("D", 0.6, 0.08),)),
        [
            named("joint_stiffness", "J", "rx", value=300.0, unit="N·m/rad"),
            named("point_mass", "D", value=0.08, unit="kg", position=0.6, length=0.8),
        ],
    ),
    "cross-soft-joint-z": (
        "cross",
        13,
        Hidden(joints={("J", "rz"): 0.02}),
        [named("joint_stiffness", "J", "rz", value=100.0, unit="N·m/rad")],
    ),
    "cross-heavier": (
        "cross",
        14,
        Hidden(rho={"D": 1.06}),
        [named("member_density", "D", value=0.06, unit="-")],
    ),
    # and not on these: kinds that no other case of solids has
    "more-joint-mass": (
        "cross",
        121,
        Hidden(joint_masses={"J": 0.1}),
        [named("joint_mass", "J", value=0.1, unit="kg")],
    ),
    "more-zener-joint": (
        "cross",
        122,
        Hidden(zener={("J", "ry"): (1.5, 4e-4)}),
        [named("joint_zener", "J", "ry", value=1.5, unit="-")],
    ),
    "more-joint-offset": (
        "cross",
        123,
        Hidden(offsets={"J": (0.008, 0.0, 0.0)}),
        [named("joint_offset", "J", "x", value=0.008, unit="m")],
    ),
    "more-joint-coupling": (
        "cross",
        124,
        Hidden(couplings={("J", "rx", "ry"): 0.6}),
        [named("joint_coupling", "J", "rx", "with", "ry", value=0.6, unit="-")],
    ),
    "more-gyroscopic": (
        "cross",
        125,
        Hidden(rotors=(("U", 0.8, (0.0, 0.0, 1.0), 0.3),)),
        [named("rotor", "end", "2", "of", "U", "about", "local", "z", value=0.3, unit="kg·m²/s")],
    ),
    "more-ground-damper": (
        "cross",
        126,
        Hidden(dampers=(("D", 0.8, "z", 50.0),)),
        [named("ground_damper", "end", "2", "of", "D", "z", value=50.0, unit="N·s/m")],
    ),
    "more-point-inertia": (
        "cross",
        127,
        Hidden(inertias=(("U", 0.8, 2e-5),)),
        [named("point_inertia", "U", value=2e-5, unit="kg·m²", position=0.8, length=0.8)],
    ),
    "more-joint-translation": (
        "cross",
        128,
        Hidden(joints={("J", "z"): 0.015}),
        [named("joint_stiffness", "J", "z", value=1.5e5, unit="N/m")],
    ),
    "more-joint-translation-less": (
        "cross",
        144,
        Hidden(joints={("J", "z"): 0.3}),
        [named("joint_stiffness", "J", "z", value=3e6, unit="N/m")],
    ),
    "more-driver-mass": (
        "cross",
        129,
        Hidden(masses=(("U", 0.0, 0.03), ("D", 0.2, 0.03))),
        [named("driver_mass", "excitations", "at", "U", "D", value=0.03, unit="kg")],
    ),
    "more-stinger": (
        "cross",
        130,
        Hidden(ground=(("D", 0.2, "z", 1e5, 0.0),)),
        [named("stinger", "excitation", "at", "D", "along", "it", value=1e5, unit="N/m")],
    ),
    "more-cubic-joint": (
        "cross",
        131,
        Hidden(nonlinear=("J", "ry", "cubic", 3e9)),
        [named("joint_cubic", "J", "ry", value=3e9, unit="N·m/rad³")],
    ),
    "more-friction-joint": (
        "cross",
        132,
        Hidden(nonlinear=("J", "ry", "friction", 0.01)),
        [named("joint_friction", "J", "ry", value=0.01, unit="N·m")],
    ),
    "more-gap-joint": (
        "cross",
        133,
        Hidden(nonlinear=("J", "ry", "gap", 3e3, 1e-4)),
        [named("joint_gap", "J", "ry", value=3e3, unit="N·m/rad")],
    ),
    "more-swap": ("cross", 134, Hidden(swaps=(("U3z", "D6z"),)), [fault("U3z", swapped_with="D6z")]),
    "more-delay": ("cross", 135, Hidden(delays={"D7z": 2e-5}), [fault("D7z", delay_s=2e-5)]),
    "more-tilt": (
        "cross",
        136,
        Hidden(tilts={"U9z": ("y", float(np.radians(25)))}),
        [fault("U9z", tilt_rad=round(float(np.radians(25)), 4))],
    ),
    "more-wrong-position": (
        "cross",
        137,
        Hidden(places={"U3z": 0.24}),
        [fault("U3z", moved_m=0.04)],
    ),
    "more-excitation-gain": (
        "cross",
        138,
        Hidden(force_gains={"U1z": 1.25}),
        [fault("U1z", excitation_factor=1.25)],
    ),
    "more-fault-and-effect": (
        "cross",
        139,
        Hidden(joints={("J", "rx"): 0.1}, gains={"U7z": 1.3}),
        [named("joint_stiffness", "J", "rx", value=300.0, unit="N·m/rad"), fault("U7z", factor=1.3)],
    ),
    "more-two": (
        "cross",
        140,
        Hidden(dashpots={("J", "ry"): 0.6}, rho={"D": 1.06}),
        [
            named("joint_viscous_damping", "J", "ry", value=0.6, unit="N·m·s/rad"),
            named("member_density", "D", value=0.06, unit="-"),
        ],
    ),
    "more-nothing": ("cross", 141, Hidden(), [NOTHING]),
    "more-local-damping": (
        "cross",
        142,
        Hidden(loss={"D": 0.03}),
        [named("member_damping", "D", value=0.03, unit="-")],
    ),
    "more-section-width": (
        "cross",
        143,
        Hidden(b={"D": 1.04}),
        [named("member_section", "D", "along", "local", "y", value=0.04, unit="-")],
    ),
    "ladder-nothing": ("ladder", 21, Hidden(), [NOTHING]),
    "ladder-nothing-again": ("ladder", 22, Hidden(), [NOTHING]),
    "ladder-notch": (
        "ladder",
        23,
        Hidden(weaker={"A": (0.42, 0.44, 0.3)}),
        [named(("crack", "stiffness_loss"), "A", value=6.2e-5, unit="rad/(N·m)", position=0.43, length=0.7)],
    ),
    "ladder-soft-joint": (
        "ladder",
        24,
        Hidden(joints={("J2", "ry"): 0.1}),
        [named("joint_stiffness", "J2", "ry", value=300.0, unit="N·m/rad")],
    ),
    "ladder-heavier": (
        "ladder",
        25,
        Hidden(rho={"B": 1.05}),
        [named("member_density", "B", value=0.05, unit="-")],
    ),
    "ladder-ground-spring": (
        "ladder",
        26,
        Hidden(ground=(("C", 0.0, "z", 3e4, 0.02),)),
        [named("ground_spring", "end", "1", "of", "C", "z", value=3e4, unit="N/m")],
    ),
    "ladder-mass": (
        "ladder",
        27,
        Hidden(masses=(("B", 0.5, 0.06),)),
        [named("point_mass", "B", value=0.06, unit="kg", position=0.5, length=0.7)],
    ),
    "ladder-stiffness": (
        "ladder",
        28,
        Hidden(E={"A": 1.07}),
        [named("member_stiffness", "A", value=0.07, unit="-")],
    ),
    "ladder-viscous-joint": (
        "ladder",
        29,
        Hidden(dashpots={("J1", "rx"): 0.5}),
        [named("joint_viscous_damping", "J1", "rx", value=0.5, unit="N·m·s/rad")],
    ),
    "ladder-thinner": (
        "ladder",
        30,
        Hidden(h={"C": 0.95}),
        [named("member_section", "C", "along", "local", "z", value=-0.05, unit="-")],
    ),
    "ladder-two": (
        "ladder",
        31,
        Hidden(joints={("J1", "rx"): 0.08}, masses=(("A", 0.6, 0.05),)),
        [
            named("joint_stiffness", "J1", "rx", value=240.0, unit="N·m/rad"),
            named("point_mass", "A", value=0.05, unit="kg", position=0.6, length=0.7),
        ],
    ),
    "grid-nothing": ("grid", 41, Hidden(), [NOTHING]),
    "grid-nothing-again": ("grid", 42, Hidden(), [NOTHING]),
    "grid-soft-joint-rx": (
        "grid",
        43,
        Hidden(joints={("J4", "rx"): 0.1}),
        [named("joint_stiffness", "J4", "rx", value=300.0, unit="N·m/rad")],
    ),
    "grid-soft-joint-rz": (
        "grid",
        44,
        Hidden(joints={("J1", "rz"): 0.02}),
        [named("joint_stiffness", "J1", "rz", value=100.0, unit="N·m/rad")],
    ),
    "grid-notch": (
        "grid",
        45,
        Hidden(weaker={"R": (0.26, 0.28, 0.25)}),
        [named(("crack", "stiffness_loss"), "R", value=1.14e-4, unit="rad/(N·m)", position=0.27, length=0.6)],
    ),
    "grid-mass": (
        "grid",
        46,
        Hidden(masses=(("S", 0.24, 0.04),)),
        [named("point_mass", "S", value=0.04, unit="kg", position=0.24, length=0.5)],
    ),
    "grid-softer": (
        "grid",
        47,
        Hidden(E={"Q": 0.94}),
        [named("member_stiffness", "Q", value=-0.06, unit="-")],
    ),
    "grid-lighter": (
        "grid",
        48,
        Hidden(rho={"R": 0.95}),
        [named("member_density", "R", value=-0.05, unit="-")],
    ),
    "grid-thicker": (
        "grid",
        49,
        Hidden(h={"P": 1.04}),
        [named("member_section", "P", "along", "local", "z", value=0.04, unit="-")],
    ),
    "grid-ground-spring": (
        "grid",
        50,
        Hidden(ground=(("Q", 0.76, "z", 1.5e4, 0.02),)),
        [named("ground_spring", "end", "2", "of", "Q", "z", value=1.5e4, unit="N/m")],
    ),
    "grid-viscous-joint": (
        "grid",
        51,
        Hidden(dashpots={("J3", "ry"): 0.5}),
        [named("joint_viscous_damping", "J3", "ry", value=0.5, unit="N·m·s/rad")],
    ),
    "grid-sensor-masses": (
        "grid",
        52,
        Hidden(masses=tuple((bar, s, 0.008) for bar, s, _ in STRUCTURES["grid"].sensors)),
        [named("sensor_mass", "the", "14", "places", "of", "sensors", value=0.008, unit="kg")],
    ),
    "grid-two": (
        "grid",
        53,
        Hidden(joints={("J2", "ry"): 0.06}, E={"S": 1.08}),
        [
            named("joint_stiffness", "J2", "ry", value=180.0, unit="N·m/rad"),
            named("member_stiffness", "S", value=0.08, unit="-"),
        ],
    ),
    # flats that lie on each other and are bolted: the model's joint is rigid, and the lap no beam
    "lap-nothing": ("lap", 81, Hidden(), [NOTHING]),
    "lap-nothing-again": ("lap", 82, Hidden(), [NOTHING]),
    "lap-soft-joint-ry": (
        "lap",
        83,
        Hidden(joints={("J", "ry"): 250.0 / HELD}),
        [named("joint_stiffness", "J", "ry", value=250.0, unit="N·m/rad")],
    ),
    "lap-soft-joint-rz": (
        "lap",
        84,
        Hidden(joints={("J", "rz"): 1500.0 / HELD}),
        [named("joint_stiffness", "J", "rz", value=1500.0, unit="N·m/rad")],
    ),
    "lap-mass": (
        "lap",
        85,
        Hidden(masses=(("B", 0.3, 0.05),)),
        [named("point_mass", "B", value=0.05, unit="kg", position=0.3, length=0.4)],
    ),
    "lap-sensor-masses": (
        "lap",
        86,
        Hidden(masses=tuple((bar, s, 0.01) for bar, s, _ in STRUCTURES["lap"].sensors)),
        [named("sensor_mass", "the", "12", "places", "of", "sensors", value=0.01, unit="kg")],
    ),
    "lap-notch": (
        "lap",
        87,
        Hidden(weaker={"A": (0.44, 0.46, 0.3)}),
        [
            named(
                ("crack", "stiffness_loss"), "A", value=1.02e-4, unit="rad/(N·m)", position=0.45, length=0.62
            )
        ],
    ),
    "lap-ground-spring": (
        "lap",
        88,
        Hidden(ground=(("A", 0.62, "z", 4e4, 0.02),)),
        [named("ground_spring", "end", "2", "of", "A", "z", value=4e4, unit="N/m")],
    ),
    "lap-heavier": ("lap", 89, Hidden(rho={"A": 1.06}), [named("member_density", "A", value=0.06, unit="-")]),
    "lap-thinner": (
        "lap",
        90,
        Hidden(h={"B": 0.94}),
        [named("member_section", "B", "along", "local", "z", value=-0.06, unit="-")],
    ),
    "lap-stiffness": (
        "lap",
        91,
        Hidden(E={"B": 1.08}),
        [named("member_stiffness", "B", value=0.08, unit="-")],
    ),
    # and not on these
    "strap-nothing": ("strap", 101, Hidden(), [NOTHING]),
    "strap-nothing-again": ("strap", 102, Hidden(), [NOTHING]),
    "strap-soft-joint-rx": (
        "strap",
        103,
        Hidden(joints={("J2", "rx"): 350.0 / HELD}),
        [named("joint_stiffness", "J2", "rx", value=350.0, unit="N·m/rad")],
    ),
    "strap-soft-joint-ry": (
        "strap",
        104,
        Hidden(joints={("J1", "ry"): 200.0 / HELD}),
        [named("joint_stiffness", "J1", "ry", value=200.0, unit="N·m/rad")],
    ),
    "strap-mass": (
        "strap",
        105,
        Hidden(masses=(("A", 0.64, 0.06),)),
        [named("point_mass", "A", value=0.06, unit="kg", position=0.64, length=0.74)],
    ),
    "strap-heavier": (
        "strap",
        106,
        Hidden(rho={"C": 1.08}),
        [named("member_density", "C", value=0.08, unit="-")],
    ),
    "strap-stiffness": (
        "strap",
        107,
        Hidden(E={"A": 0.92}),
        [named("member_stiffness", "A", value=-0.08, unit="-")],
    ),
    "strap-thicker": (
        "strap",
        108,
        Hidden(h={"B": 1.06}),
        [named("member_section", "B", "along", "local", "z", value=0.06, unit="-")],
    ),
    "strap-notch": (
        "strap",
        109,
        Hidden(weaker={"C": (0.28, 0.3, 0.25)}),
        [
            named(
                ("crack", "stiffness_loss"), "C", value=1.67e-4, unit="rad/(N·m)", position=0.29, length=0.42
            )
        ],
    ),
    "strap-sensor-masses": (
        "strap",
        110,
        Hidden(masses=tuple((bar, s, 0.01) for bar, s, _ in STRUCTURES["strap"].sensors)),
        [named("sensor_mass", "the", "12", "places", "of", "sensors", value=0.01, unit="kg")],
    ),
    # flats that a bolt's disc joins on the faces that touch, which is smaller than the lap
    "bolt-nothing": ("bolt", 201, Hidden(), [NOTHING]),
    "bolt-nothing-again": ("bolt", 202, Hidden(), [NOTHING]),
    "bolt-soft-joint-rx": (
        "bolt",
        203,
        Hidden(joints={("J", "rx"): 400.0 / HELD}),
        [named("joint_stiffness", "J", "rx", value=400.0, unit="N·m/rad")],
    ),
    "bolt-soft-joint-ry": (
        "bolt",
        204,
        Hidden(joints={("J", "ry"): 350.0 / HELD}),
        [named("joint_stiffness", "J", "ry", value=350.0, unit="N·m/rad")],
    ),
    "bolt-soft-joint-rz": (
        "bolt",
        205,
        Hidden(joints={("J", "rz"): 2500.0 / HELD}),
        [named("joint_stiffness", "J", "rz", value=2500.0, unit="N·m/rad")],
    ),
    "bolt-mass": (
        "bolt",
        206,
        Hidden(masses=(("A", 0.4, 0.06),)),
        [named("point_mass", "A", value=0.06, unit="kg", position=0.4, length=0.58)],
    ),
    "bolt-sensor-masses": (
        "bolt",
        207,
        Hidden(masses=tuple((bar, s, 0.012) for bar, s, _ in STRUCTURES["bolt"].sensors)),
        [named("sensor_mass", "the", "12", "places", "of", "sensors", value=0.012, unit="kg")],
    ),
    "bolt-notch": (
        "bolt",
        208,
        Hidden(weaker={"B": (0.18, 0.2, 0.3)}),
        [
            named(
                ("crack", "stiffness_loss"), "B", value=1.02e-4, unit="rad/(N·m)", position=0.19, length=0.36
            )
        ],
    ),
    "bolt-ground-spring": (
        "bolt",
        209,
        Hidden(ground=(("B", 0.36, "z", 3e4, 0.02),)),
        [named("ground_spring", "end", "2", "of", "B", "z", value=3e4, unit="N/m")],
    ),
    "bolt-heavier": (
        "bolt",
        210,
        Hidden(rho={"B": 1.07}),
        [named("member_density", "B", value=0.07, unit="-")],
    ),
    "bolt-stiffness": (
        "bolt",
        211,
        Hidden(E={"A": 0.94}),
        [named("member_stiffness", "A", value=-0.06, unit="-")],
    ),
    "bolt-wider": (
        "bolt",
        212,
        Hidden(b={"A": 1.06}),
        [named("member_section", "A", "along", "local", "y", value=0.06, unit="-")],
    ),
    "bolt-ground-damper": (
        "bolt",
        213,
        Hidden(dampers=(("B", 0.36, "z", 30.0),)),
        [named("ground_damper", "end", "2", "of", "B", "z", value=30.0, unit="N·s/m")],
    ),
    "bolt-driver-mass": (
        "bolt",
        214,
        Hidden(masses=(("A", 0.0, 0.015), ("B", 0.36, 0.015))),
        [named("driver_mass", "excitations", "at", "A", "B", value=0.015, unit="kg")],
    ),
    "bolt-gain": ("bolt", 215, Hidden(gains={"A4z": 1.2}), [fault("A4z", factor=1.2)]),
    # and where nothing within the disc gives way: the face that it bonds makes the flats stiffer, too
    "bond-nothing": ("bond", 221, Hidden(), [NOTHING]),
    "bond-mass": (
        "bond",
        222,
        Hidden(masses=(("A", 0.4, 0.06),)),
        [named("point_mass", "A", value=0.06, unit="kg", position=0.4, length=0.58)],
    ),
    "bond-soft-joint-ry": (
        "bond",
        223,
        Hidden(joints={("J", "ry"): 350.0 / HELD}),
        [named("joint_stiffness", "J", "ry", value=350.0, unit="N·m/rad")],
    ),
    # corners of finite size, which no frame of beams has
    "gate-nothing": ("gate", 61, Hidden(), [NOTHING]),
    "gate-mass": (
        "gate",
        62,
        Hidden(masses=(("T", 0.28, 0.08),)),
        [named("point_mass", "T", value=0.08, unit="kg", position=0.28, length=0.4)],
    ),
    "gate-heavier": (
        "gate",
        63,
        Hidden(rho={"L": 1.08}),
        [named("member_density", "L", value=0.08, unit="-")],
    ),
    "gate-thinner": (
        "gate",
        64,
        Hidden(h={"S": 0.92}),
        [named("member_section", "S", "along", "local", "z", value=-0.08, unit="-")],
    ),
    "gate-notch": (
        "gate",
        65,
        Hidden(weaker={"R": (0.26, 0.28, 0.2)}),
        [named(("crack", "stiffness_loss"), "R", value=2.9e-5, unit="rad/(N·m)", position=0.27, length=0.52)],
    ),
    "gate-sensor-masses": (
        "gate",
        66,
        Hidden(masses=tuple((bar, s, 0.012) for bar, s, _ in STRUCTURES["gate"].sensors)),
        [named("sensor_mass", "the", "10", "places", "of", "sensors", value=0.012, unit="kg")],
    ),
    "table-nothing": ("table", 71, Hidden(), [NOTHING]),
    "table-mass": (
        "table",
        72,
        Hidden(masses=(("X1", 0.14, 0.2),)),
        [named("point_mass", "X1", value=0.2, unit="kg", position=0.14, length=0.46)],
    ),
    "table-soft-base": (
        "table",
        73,
        Hidden(bases={("C2", "ry"): 4000.0}),
        [named("support_flexibility", "C2", "ry", value=4000.0, unit="N·m/rad")],
    ),
    "table-stiffness": (
        "table",
        74,
        Hidden(E={"C3": 0.88}),
        [named("member_stiffness", "C3", value=-0.12, unit="-")],
    ),
    "table-heavier": (
        "table",
        75,
        Hidden(rho={"Y1": 1.15}),
        [named("member_density", "Y1", value=0.15, unit="-")],
    ),
    "table-ground-spring": (
        "table",
        76,
        Hidden(ground=(("X2", 0.23, "z", 2e5, 0.02),)),
        [
            named(
                "side_spring", "X2", "along", "local", "z", value=2e5, unit="N/m", position=0.23, length=0.46
            )
        ],
    ),
    "table-notch": (
        "table",
        77,
        Hidden(weaker={"C4": (0.16, 0.18, 0.2)}),
        [
            named(
                ("crack", "stiffness_loss"), "C4", value=2.9e-5, unit="rad/(N·m)", position=0.17, length=0.42
            )
        ],
    ),
    # kinds that other cases of these structures do not have; nothing was looked at on these either
    "more-lap-rotor": (
        "lap",
        151,
        Hidden(rotors=(("B", 0.4, (0.0, 0.0, 1.0), 0.1),)),
        [named("rotor", "end", "2", "of", "B", "about", "local", "z", value=0.1, unit="kg·m²/s")],
    ),
    "more-lap-ground-damper": (
        "lap",
        152,
        Hidden(dampers=(("A", 0.62, "z", 40.0),)),
        [named("ground_damper", "end", "2", "of", "A", "z", value=40.0, unit="N·s/m")],
    ),
    "more-lap-driver-mass": (
        "lap",
        153,
        Hidden(masses=(("A", 0.0, 0.008), ("B", 0.4, 0.008))),
        [named("driver_mass", "excitations", "at", "A", "B", value=0.008, unit="kg")],
    ),
    "more-lap-softer": (
        "lap",
        154,
        Hidden(E={"A": 0.96}),
        [named("member_stiffness", "A", value=-0.04, unit="-")],
    ),
    "more-lap-swap": ("lap", 155, Hidden(swaps=(("A3z", "B3z"),)), [fault("A3z", swapped_with="B3z")]),
    "more-lap-gain": ("lap", 156, Hidden(gains={"A5z": 1.25}), [fault("A5z", factor=1.25)]),
    "more-lap-tilt": (
        "lap",
        157,
        Hidden(tilts={"A6z": ("y", float(np.radians(20)))}),
        [fault("A6z", tilt_rad=round(float(np.radians(20)), 4))],
    ),
    "more-lap-nothing-third": ("lap", 158, Hidden(), [NOTHING]),
    "more-gate-driver-mass": (
        "gate",
        161,
        Hidden(masses=(("L", 0.0, 0.02), ("R", 0.0, 0.02))),
        [named("driver_mass", "excitations", "at", "L", "R", value=0.02, unit="kg")],
    ),
    "more-gate-ground-spring": (
        "gate",
        162,
        Hidden(ground=(("R", 0.52, "y", 1e5, 0.02),)),
        [named("ground_spring", "end", "2", "of", "R", "y", value=1e5, unit="N/m")],
    ),
    "more-gate-rotor": (
        "gate",
        163,
        Hidden(rotors=(("L", 0.6, (0.0, 0.0, 1.0), 1.0),)),
        [named("rotor", "end", "2", "of", "L", "about", "local", "x", value=1.0, unit="kg·m²/s")],
    ),
    "more-gate-stiffness": (
        "gate",
        164,
        Hidden(E={"L": 1.1}),
        [named("member_stiffness", "L", value=0.1, unit="-")],
    ),
    "more-gate-gain-and-sign": (
        "gate",
        165,
        Hidden(gains={"R2y": 1.25, "S1z": -1.0}),
        [fault("R2y", factor=1.25), fault("S1z", factor=-1)],
    ),
    "more-gate-two": (
        "gate",
        166,
        Hidden(masses=(("T", 0.14, 0.06),), rho={"R": 1.08}),
        [
            named("point_mass", "T", value=0.06, unit="kg", position=0.14, length=0.4),
            named("member_density", "R", value=0.08, unit="-"),
        ],
    ),
    "more-gate-nothing-again": ("gate", 167, Hidden(), [NOTHING]),
    "more-table-base-ry": (
        "table",
        171,
        Hidden(bases={("C4", "ry"): 4e4}),
        [named("support_flexibility", "C4", "ry", value=4e4, unit="N·m/rad")],
    ),
    "more-table-base-damper": (
        "table",
        172,
        Hidden(bases={("C3", "rx"): 1.2e4}, base_dashpots={("C3", "rx"): 12.0}),
        [named("foundation_dashpot", "C3", "rx", value=1.2e4, unit="N·m/rad")],
    ),
    "more-table-driver-mass": (
        "table",
        173,
        Hidden(masses=(("C1", 0.41, 0.1), ("C3", 0.41, 0.1))),
        [named("driver_mass", "excitations", "at", "C1", "C3", value=0.1, unit="kg")],
    ),
    "more-table-lighter": (
        "table",
        174,
        Hidden(rho={"X2": 0.92}),
        [named("member_density", "X2", value=-0.08, unit="-")],
    ),
    "more-table-faults": (
        "table",
        175,
        Hidden(gains={"C41y": 0.8}, swaps=(("C21x", "X11y"),)),
        [fault("C41y", factor=0.8), fault("C21x", swapped_with="X11y")],
    ),
    "more-table-damper": (
        "table",
        176,
        Hidden(dampers=(("C2", 0.42, "y", 300.0),)),
        [named("ground_damper", "end", "2", "of", "C2", "y", value=300.0, unit="N·s/m")],
    ),
    "more-table-two": (
        "table",
        177,
        Hidden(bases={("C1", "rx"): 3e4}, masses=(("Y2", 0.12, 0.1),)),
        [
            named("support_flexibility", "C1", "rx", value=3e4, unit="N·m/rad"),
            named("point_mass", "Y2", value=0.1, unit="kg", position=0.12, length=0.34),
        ],
    ),
    "more-table-nothing-again": ("table", 178, Hidden(), [NOTHING]),
    "tower-nothing": ("tower", 301, Hidden(), [NOTHING]),
    "tower-nothing-again": ("tower", 302, Hidden(), [NOTHING]),
    "tower-soft-base-rx": (
        "tower",
        303,
        Hidden(bases={("C3", "rx"): 5000.0}),
        [named("support_flexibility", "C3", "rx", value=5000.0, unit="N·m/rad")],
    ),
    "tower-mass": (
        "tower",
        304,
        Hidden(masses=(("X2a", 0.3, 0.15),)),
        [named("point_mass", "X2a", value=0.15, unit="kg", position=0.3, length=0.44)],
    ),
    "tower-stiffness": (
        "tower",
        305,
        Hidden(E={"C2": 0.9}),
        [named("member_stiffness", "C2", value=-0.1, unit="-")],
    ),
    "tower-heavier": (
        "tower",
        306,
        Hidden(rho={"Y2b": 1.2}),
        [named("member_density", "Y2b", value=0.2, unit="-")],
    ),
    "tower-notch": (
        "tower",
        307,
        Hidden(weaker={"C1": (0.46, 0.48, 0.15)}),
        [
            named(
                ("crack", "stiffness_loss"), "C1", value=4.1e-5, unit="rad/(N·m)", position=0.47, length=0.78
            )
        ],
    ),
    "tower-thinner": (
        "tower",
        308,
        Hidden(h={"X1b": 0.9}),
        [named("member_section", "X1b", "along", "local", "z", value=-0.1, unit="-")],
    ),
    "tower-ground-spring": (
        "tower",
        309,
        Hidden(ground=(("C4", 0.78, "x", 2e4, 0.02),)),
        [named("ground_spring", "end", "2", "of", "C4", "x", value=2e4, unit="N/m")],
    ),
    "tower-damper": (
        "tower",
        310,
        Hidden(dampers=(("C3", 0.78, "y", 30.0),)),
        [named("ground_damper", "end", "2", "of", "C3", "y", value=30.0, unit="N·s/m")],
    ),
    "tower-sensor-masses": (
        "tower",
        311,
        Hidden(masses=tuple((bar, s, 0.015) for bar, s, _ in STRUCTURES["tower"].sensors)),
        [named("sensor_mass", "the", "20", "places", "of", "sensors", value=0.015, unit="kg")],
    ),
    "tower-gain-and-sign": (
        "tower",
        312,
        Hidden(gains={"C13y": 1.2, "X1a1z": -1.0}),
        [fault("C13y", factor=1.2), fault("X1a1z", factor=-1)],
    ),
    "tower-base-and-mass": (
        "tower",
        313,
        Hidden(bases={("C1", "ry"): 6000.0}, masses=(("Y1b", 0.2, 0.12),)),
        [
            named("support_flexibility", "C1", "ry", value=6000.0, unit="N·m/rad"),
            named("point_mass", "Y1b", value=0.12, unit="kg", position=0.2, length=0.32),
        ],
    ),
    # dampers and pairs, where beams leave more than noise
    "strap-ground-damper": (
        "strap",
        321,
        Hidden(dampers=(("C", 0.42, "z", 25.0),)),
        [named("ground_damper", "end", "2", "of", "C", "z", value=25.0, unit="N·s/m")],
    ),
    "lap-ground-damper-y": (
        "lap",
        322,
        Hidden(dampers=(("A", 0.0, "y", 30.0),)),
        [named("ground_damper", "end", "1", "of", "A", "y", value=30.0, unit="N·s/m")],
    ),
    "gate-ground-damper": (
        "gate",
        323,
        Hidden(dampers=(("L", 0.6, "y", 20.0),)),
        [named("ground_damper", "end", "2", "of", "L", "y", value=20.0, unit="N·s/m")],
    ),
    "gate-mass-and-stiffness": (
        "gate",
        324,
        Hidden(masses=(("S", 0.28, 0.07),), E={"L": 0.9}),
        [
            named("point_mass", "S", value=0.07, unit="kg", position=0.28, length=0.4),
            named("member_stiffness", "L", value=-0.1, unit="-"),
        ],
    ),
    "tower-notch-and-heavier": (
        "tower",
        325,
        Hidden(weaker={"C4": (0.18, 0.2, 0.15)}, rho={"X2a": 1.15}),
        [
            named(
                ("crack", "stiffness_loss"), "C4", value=4.1e-5, unit="rad/(N·m)", position=0.19, length=0.78
            ),
            named("member_density", "X2a", value=0.15, unit="-"),
        ],
    ),
    "tower-damper-x": (
        "tower",
        326,
        Hidden(dampers=(("C1", 0.37, "x", 60.0),)),
        [named("ground_damper", "end", "1", "of", "X1a", "x", value=60.0, unit="N·s/m")],
    ),
    "strap-damped-member": (
        "strap",
        327,
        Hidden(loss={"B": 0.03}),
        [named("member_damping", "B", value=0.03, unit="-")],
    ),
}


def assembled(mesh, modulus, density):
    """Return mass and stiffness, the basis's places (3, n) and directions (n,) of unknowns."""
    from skfem import Basis, BilinearForm, ElementHex2, ElementVector
    from skfem.helpers import ddot, dot, sym_grad, trace

    basis = Basis(mesh, ElementVector(ElementHex2()), intorder=4)

    @BilinearForm
    def stiffness(u, v, w):
        lame, shear = w.modulus * NU / ((1 + NU) * (1 - 2 * NU)), w.modulus / (2 * (1 + NU))
        a, b = sym_grad(u), sym_grad(v)
        return 2 * shear * ddot(a, b) + lame * trace(a) * trace(b)

    @BilinearForm
    def mass(u, v, w):
        return w.density * dot(u, v)

    def at_points(values):
        return np.repeat(np.asarray(values, dtype=float)[:, None], basis.dx.shape[1], axis=1)

    K = stiffness.assemble(basis, modulus=at_points(modulus)).tocsc()
    M = mass.assemble(basis, density=at_points(density)).tocsc()
    direction = np.empty(K.shape[0], dtype=int)
    for table in (basis.nodal_dofs, basis.edge_dofs, basis.facet_dofs, basis.interior_dofs):
        for c in range(3):
            direction[table[c]] = c
    return K, M, basis.doflocs, direction


class Body:
    """Mass and stiffness of bars, and what forces at places of them do."""

    def __init__(self, bars, mesh, modulus, density):
        """Assemble a mesh in global coordinates."""
        self.bars = bars
        self.K, self.M, self.places, self.direction = assembled(mesh, modulus, density)

    def local(self, name):
        """Return the places (3, n) of unknowns in a bar's own axes."""
        bar = self.bars[name]
        return bar.rotation.T @ (self.places - np.array(bar.start)[:, None])

    def point(self, name, s):
        """Return global displacements (n, 3) of the point of a bar's axis there."""
        x, y, z = self.local(name)
        (at,) = np.nonzero((np.abs(x - s) < 1e-7) & (np.abs(y) < 1e-7) & (np.abs(z) < 1e-7))
        if len(at) != 3:
            msg = f"there is no node on the axis of {name} at {s} m"
            raise ValueError(msg)
        P = np.zeros((len(x), 3))
        P[at] = np.eye(3)[self.direction[at]]
        return P

    def near(self, name, s, reach, disc=None):
        """Return the unknowns of a bar within a distance of a place along it, or of a point on its face."""
        x, y, z = self.local(name)
        bar = self.bars[name]
        if disc is not None:
            middle = bar.rotation.T @ (disc - np.array(bar.start))
            face = np.abs(z - middle[2]) < 1e-6
            return np.flatnonzero(face & (np.hypot(x - middle[0], y - middle[1]) < reach + 1e-9))
        within = (np.abs(y) < 0.5 * bar.b + 1e-9) & (np.abs(z) < 0.5 * bar.h + 1e-9)
        return np.flatnonzero(within & (np.abs(x - s) < reach + 1e-9))

    def patch(self, name, s, about, reach=PATCH, disc=None):
        """Return the mean motion (n, 6) of what lies near s on a bar, in global directions about a point."""
        near = self.near(name, s, reach, disc)
        P = np.zeros((self.places.shape[1], 6))
        P[near] = np.linalg.pinv(self.rigid(near, about)).T
        return P

    def rigid(self, unknowns, about):
        """Return what motions (6,) of a rigid body are there, in global directions about a point."""
        arm, along = self.places[:, unknowns].T - about, np.eye(3)[self.direction[unknowns]]
        return np.hstack([along, np.cross(arm, along)])

    def hold(self, structure, soft, discs=()):
        """Clamp the first ends of bars that are held, but those that are soft move as rigid bodies.

        So do discs: unknowns and a point about which they move.

        Return what the unknowns (n, n_left) are by those that are left: with a soft base that is as good as
        rigid an end is clamped, and nothing else in it gives way.
        """
        n = self.K.shape[0]
        moves, rigid = np.ones(n, dtype=bool), []
        for name in structure.held:
            face = self.near(name, 0.0, 0.0)
            moves[face] = False
            rigid += [(face, self.bars[name].at(0.0))] if name in soft else []
        faces = []
        for unknowns, about in (*rigid, *discs):
            moves[unknowns] = False
            faces.append(np.zeros((n, 6)))
            faces[-1][unknowns] = self.rigid(unknowns, about)
        T = sp.hstack([sp.eye(n, format="csc")[:, moves], *map(sp.csc_matrix, faces)], format="csc")
        self.K, self.M = ((T.T @ X @ T).tocsc() for X in (self.K, self.M))
        return T

    def reduced(self, forces, n_modes, free):
        """Return squared frequencies and M-orthonormal vectors of modes and responses to forces."""
        shift = (2 * np.pi * 150) ** 2
        solved = sla.splu((self.K + shift * self.M).tocsc())
        inverse = sla.LinearOperator(self.K.shape, solved.solve)
        squares, V = sla.eigsh(self.K, k=n_modes, M=self.M, sigma=-shift, OPinv=inverse)
        X = np.hstack([V[:, squares < (2 * np.pi * HIGHEST) ** 2], solved.solve(forces)])
        Q, _ = np.linalg.qr(X / np.sqrt(np.einsum("ij,ij->j", X, self.M @ X)))
        squares, U = la.eigh(Q.T @ (self.K @ Q), Q.T @ (self.M @ Q))
        if free:
            squares[:6] = 0.0
        return np.maximum(squares, 0.0), Q @ U


def disc_cuts(structure, name):
    """Return where a bar is cut besides, so that elements on discs are short [m]."""
    ends = [(bar, s) for _, bar1, s1, bar2, s2 in structure.joints for bar, s in ((bar1, s1), (bar2, s2))]
    marks = [s + r * structure.clamped for bar, s in ends if bar == name for r in (-1, -0.5, 0, 0.5, 1)]
    return marks if structure.disc else []


def bar_alone(name, bar, hidden, cuts=()):
    """Return one bar as a body, with more cuts along it [m]."""
    from skfem import MeshHex

    bar = hidden.changed(name, bar)
    n = round(bar.length / ELEMENT)
    grid = (
        np.unique(np.round([*np.linspace(0, bar.length, n + 1), *cuts], 9)),
        np.linspace(-bar.b / 2, bar.b / 2, ACROSS[0] + 1),
        np.linspace(-bar.h / 2, bar.h / 2, ACROSS[1] + 1),
    )
    mesh = MeshHex.init_tensor(*grid)
    along = mesh.p[0, mesh.t].mean(axis=0)
    mesh = MeshHex(bar.rotation @ mesh.p + np.array(bar.start)[:, None], mesh.t)
    return Body({name: bar}, mesh, modulus_of(name, along, hidden), density_of(name, along, hidden))


def modulus_of(name, along, hidden):
    """Return Young's modulus of elements at places along a bar."""
    out = np.full(len(along), E * hidden.E.get(name, 1.0))
    if name in hidden.weaker:
        start, end, factor = hidden.weaker[name]
        inside = (along > start) & (along < end)
        if not inside.any():
            msg = f"no element of {name} lies between {start} and {end} m"
            raise ValueError(msg)
        out[inside] *= factor
    return out


def density_of(name, along, hidden):
    return np.full(len(along), RHO * hidden.rho.get(name, 1.0))


def welded(structure, hidden):
    """Return all bars as one body: the elements of a grid that lie in one of them, in the first if in two."""
    from skfem import MeshHex

    bars = {name: hidden.changed(name, bar) for name, bar in structure.bars.items()}
    boxes, cuts = {}, [set(), set(), set()]
    for name, bar in bars.items():
        half = np.abs(bar.rotation) @ [0, bar.b / 2, bar.h / 2]
        boxes[name] = (
            np.minimum(bar.at(0.0), bar.at(bar.length)) - half,
            np.maximum(bar.at(0.0), bar.at(bar.length)) + half,
        )
        for axis in range(3):
            cuts[axis] |= {boxes[name][0][axis], boxes[name][1][axis], bar.at(0.0)[axis]}
    for name, s, *_ in (*structure.sensors, *hidden.points, *hidden.turning):
        for axis, x in enumerate(bars[name].at(s)):
            cuts[axis].add(x)
    for name, (start, end, _) in hidden.weaker.items():
        for s in (start, end):
            cuts[AXES.index(bars[name].axis)].add(bars[name].at(s)[AXES.index(bars[name].axis)])
    grid = []
    for each in cuts:
        marks = np.unique(np.round(sorted(each), 9))
        parts = [np.linspace(a, b, max(1, round((b - a) / ELEMENT)) + 1)[:-1] for a, b in pairwise(marks)]
        grid.append(np.append(np.concatenate(parts), marks[-1]))
    mesh = MeshHex.init_tensor(*grid)
    middle = mesh.p[:, mesh.t].mean(axis=1)
    modulus, density = np.zeros(middle.shape[1]), np.zeros(middle.shape[1])
    for name, (low, high) in reversed(boxes.items()):
        inside = ((middle > low[:, None]) & (middle < high[:, None])).all(axis=0)
        bar = bars[name]
        along = (bar.rotation.T @ (middle[:, inside] - np.array(bar.start)[:, None]))[0]
        modulus[inside], density[inside] = modulus_of(name, along, hidden), density_of(name, along, hidden)
    kept = np.flatnonzero(density)
    used, t = np.unique(mesh.t[:, kept], return_inverse=True)
    mesh = MeshHex(mesh.p[:, used], t.reshape(8, -1))
    return Body(bars, mesh, modulus[kept], density[kept])


def sensors_of(structure):
    """Return sensors as nominal.json lists them; nodes are counted along each bar as they are named."""
    out, node = [], 0
    for bar in structure.bars:
        for n, (_, s, directions) in enumerate(p for p in structure.sensors if p[0] == bar):
            node += 1
            out += [
                {
                    "name": f"{bar}{n + 1}{d}",
                    "node": node,
                    "direction": d,
                    "sign": 1,
                    "member": bar,
                    "position": s,
                }
                for d in directions
            ]
    return out


def receptances(structure, hidden, frequency):
    """Return FRFs (n_freq, n_sensors, n_excitations) [m/N] without noise.

    The relative motion of what depends on amplitude, without it, is one more response and one more force.
    """
    sensors = sensors_of(structure)
    attached = {bar: {s["position"] for s in sensors if s["member"] == bar} for bar in structure.bars}
    for bar, s in hidden.points:
        attached[bar].add(s)
    for s in sensors:
        attached[s["member"]].add(hidden.places.get(s["name"], s["position"]))
    if structure.welded:
        bodies = [welded(structure, hidden)]
    else:
        bodies = [
            bar_alone(name, bar, hidden, disc_cuts(structure, name)) for name, bar in structure.bars.items()
        ]
    squares, more_loss, places, n = [], [], {}, 0
    for body in bodies:
        soft = {name for name, _ in hidden.bases}
        ends = {(name, s): body.point(name, s) for name in body.bars for s in sorted(attached[name])}
        discs = []
        for joint, bar1, s1, bar2, s2 in structure.joints:
            middle = 0.5 * (structure.bars[bar1].at(s1) + structure.bars[bar2].at(s2))
            about = middle + hidden.offsets.get(joint, np.zeros(3))
            for name, s in ((bar1, s1), (bar2, s2)):
                if name in body.bars:
                    disc = middle if structure.disc else None
                    ends[joint, name] = body.patch(name, s, about, structure.clamped or PATCH, disc)
                    if structure.disc == "rigid":
                        discs.append((body.near(name, s, structure.clamped, middle), middle))
                    if joint in hidden.joint_masses:
                        ends["mass", joint, name] = body.patch(name, s, middle, structure.clamped or PATCH)
        for name in sorted(soft):
            ends["base", name] = body.patch(name, 0.0, body.bars[name].at(0.0), reach=0.0)
        for name, s in hidden.turning:
            if name in body.bars:
                ends["turns", name, s] = body.patch(name, s, body.bars[name].at(s))
        T = body.hold(structure, soft, discs)
        ends = {key: T.T @ P for key, P in ends.items()}
        forces = np.hstack(list(ends.values()))
        n_modes = N_MODES_WELDED if structure.welded else N_MODES
        w2, V = body.reduced(forces, n_modes, free=not structure.held)
        places |= {key: (n, V.T @ P) for key, P in ends.items()}
        n += len(w2)
        squares.append(w2)
        more_loss.append(np.full(len(w2), 0.0 if structure.welded else hidden.loss.get(*body.bars, 0.0)))
    w2, more_loss = np.concatenate(squares), np.concatenate(more_loss)

    def whole(*place):
        start, P = places[place]
        out = np.zeros((n, P.shape[1]))
        out[start : start + len(P)] = P
        return out

    omega = 2 * np.pi * frequency
    apart = {joint: whole(joint, bar1) - whole(joint, bar2) for joint, bar1, _, bar2, _ in structure.joints}
    parts = [(apart[joint], joint_stiffness(joint, structure, hidden, omega)) for joint in apart]
    parts += attachments(structure, hidden, omega, whole)
    C = np.hstack([vectors for vectors, _ in parts] or [np.zeros((n, 0))])
    Z = np.zeros((len(omega), C.shape[1], C.shape[1]), dtype=complex)
    first = 0
    for _, dynamic in parts:
        at = slice(first, first + dynamic.shape[-1])
        Z[:, at, at] = dynamic
        first = at.stop

    out = np.array([reading(s, hidden, whole) for s in sensors]).T
    stated = {s["name"]: whole(s["member"], s["position"])[:, AXES.index(s["direction"])] for s in sensors}
    inputs = np.array([stated[name] for name in structure.excitations]).T
    if hidden.nonlinear:
        joint, direction, *_ = hidden.nonlinear
        own = apart[joint][:, [DIRECTIONS.index(direction)]]
        out, inputs = np.hstack([out, own]), np.hstack([inputs, own])
    f = np.sqrt(w2) / (2 * np.pi)
    mean, period = structure.damping
    zeta = mean * (1 + 0.35 * np.sin(2 * np.pi * f / period + 0.7))
    H = np.empty((len(omega), out.shape[1], inputs.shape[1]), dtype=complex)
    for k, w in enumerate(omega):
        modal = 1 / (w2 * (1 + 1j * more_loss) + 2j * zeta * np.sqrt(w2) * w - w**2)
        left, right = C.T * modal, modal[:, None] * inputs
        forces = np.linalg.solve(np.eye(C.shape[1]) + Z[k] @ (left @ C), Z[k] @ (C.T @ right))
        H[k] = out.T @ right - (out.T * modal) @ (C @ forces)
    return H


def joint_stiffness(joint, structure, hidden, omega):
    """Return the dynamic stiffness (n_freq, 6, 6) of a joint."""
    known = [HELD if structure.clamped else TRUE_JOINT[d] for d in DIRECTIONS]
    k = np.array([v * hidden.joints.get((joint, d), 1.0) for v, d in zip(known, DIRECTIONS, strict=True)])
    K = np.diag(k)
    for (name, *pair), share in hidden.couplings.items():
        if name == joint:
            i, j = (DIRECTIONS.index(d) for d in pair)
            K[i, j] = K[j, i] = share * np.sqrt(k[i] * k[j])
    if np.linalg.eigvalsh(K / np.sqrt(np.outer(k, k)))[0] <= 0:
        msg = f"the stiffness of joint {joint} is not positive definite"
        raise ValueError(msg)
    Z = np.tile(K * (1 + 1j * JOINT_LOSS), (len(omega), 1, 1))
    for i, d in enumerate(DIRECTIONS):
        r, tau = hidden.zener.get((joint, d), (0.0, 1.0))
        Z[:, i, i] += 1j * omega * hidden.dashpots.get((joint, d), 0.0)
        Z[:, i, i] += k[i] * r * 1j * omega * tau / (1 + 1j * omega * tau)
    return Z


def attachments(structure, hidden, omega, whole):
    """Return what hangs on the structure beside joints: motions (n, m), dynamic stiffness (n_freq, m, m)."""
    one = np.ones((len(omega), 1, 1))
    w = omega[:, None, None]
    out = []
    for joint, bar1, _, bar2, _ in structure.joints:
        if joint in hidden.joint_masses:
            half = -(w**2) * 0.5 * hidden.joint_masses[joint] * np.eye(3)
            out += [(whole("mass", joint, bar)[:, :3], half) for bar in (bar1, bar2)]
    for bar, s, mass in hidden.masses:
        out.append((whole(bar, s), -(w**2) * mass * np.eye(3)))
    for bar, s, d, stiffness, loss in hidden.ground:
        out.append((whole(bar, s)[:, [AXES.index(d)]], stiffness * (1 + 1j * loss) * one))
    for bar, s, d, dashpot in hidden.dampers:
        out.append((whole(bar, s)[:, [AXES.index(d)]], 1j * w * dashpot))
    for bar, s, inertia in hidden.inertias:
        out.append((whole("turns", bar, s)[:, 3:], -(w**2) * inertia * np.eye(3)))
    for bar, s, axis, momentum in hidden.rotors:
        # the rotor takes the moment momentum · (rate of turn × axis), that by which its momentum changes
        gyroscopic = momentum * np.cross(np.eye(3), axis).T
        out.append((whole("turns", bar, s)[:, 3:], 1j * w * gyroscopic))
    for bar in sorted({name for name, _ in hidden.bases}):
        held = np.diag([hidden.bases.get((bar, d), HELD) for d in DIRECTIONS])
        dashpots = np.diag([hidden.base_dashpots.get((bar, d), 0.0) for d in DIRECTIONS])
        out.append((whole("base", bar), held * one + 1j * w * dashpots))
    return out


def reading(sensor, hidden, whole):
    """Return the motion (n,) that a sensor takes, where it truly is and in the direction that it has."""
    name = sensor["name"]
    motions = whole(sensor["member"], hidden.places.get(name, sensor["position"]))
    towards, angle = hidden.tilts.get(name, (sensor["direction"], 0.0))
    along, across = (motions[:, AXES.index(d)] for d in (sensor["direction"], towards))
    return along if angle == 0 else np.cos(angle) * along + np.sin(angle) * across


def gap(a, k, g):
    """Return the stiffness at amplitude a of a spring that acts beyond a gap g on either side."""
    x = np.minimum(g / a, 1.0)
    return k * (1 - 2 / np.pi * (np.arcsin(x) + x * np.sqrt(1 - x**2)))


LAWS = {
    "cubic": lambda a, k3: 0.75 * k3 * a**2,
    "friction": lambda a, F: 4j * F / (np.pi * a),
    "gap": gap,
}
"""Stiffnesses at amplitude a, the fundamental of the force over the motion: k₃ δ³, dry friction F, a gap."""


def steady(R, law, force):
    """Return receptances at a level of force where one relative motion has a stiffness k(a).

    R is of :func:`receptances`. With h the motion by the force and g by a pair of forces at it, both without
    k, a |1 + k(a) g| = force |h|. Of several solutions the one is taken that goes on from the line before, as
    a slow sweep upwards does; without any the motion is held.
    """
    H, c, h, g = R[:, :-1, :-1], R[:, :-1, -1], R[:, -1, :-1], R[:, -1, -1]
    out = np.array(H)
    for j in range(h.shape[1]):
        before = None
        for k in range(len(h)):
            found = amplitudes(law, force * abs(h[k, j]), g[k])
            if found:
                a = min(found, key=lambda x: abs(np.log(x / before))) if before else found[0]
                q = law(a) / (1 + law(a) * g[k])
                before = a
            else:
                q, before = 1 / g[k], None
            out[k, :, j] -= c[k] * q * h[k, j]
    return out


def amplitudes(law, free, g):
    """Return the amplitudes of stable steady motions, the lowest first; ``free`` is that without k."""

    def excess(a):
        return a * abs(1 + law(a) * g) - free

    grid = free * np.geomspace(1e-6, 1e4, 4001)  # near a fold two solutions are close
    above = excess(grid) > 0
    return [brentq(excess, grid[i], grid[i + 1]) for i in np.flatnonzero(~above[:-1] & above[1:])]


def accelerances(R, structure, hidden, frequency, force=1.0):
    """Return FRFs [m/s²/N] without noise as the instruments read them, from receptances, at a level [N]."""
    if hidden.nonlinear:
        _, _, law, *values = hidden.nonlinear
        R = steady(R, lambda a: LAWS[law](a, *values), force)
    H = -((2 * np.pi * frequency[:, None, None]) ** 2) * R
    names = [s["name"] for s in sensors_of(structure)]
    for name, gain in hidden.gains.items():
        H[:, names.index(name)] *= gain
    for name, delay in hidden.delays.items():
        H[:, names.index(name)] *= np.exp(-2j * np.pi * frequency * delay)[:, None]
    for pair in hidden.swaps:
        i, j = (names.index(name) for name in pair)
        H[:, [i, j]] = H[:, [j, i]]
    for name, gain in hidden.force_gains.items():
        H[:, :, structure.excitations.index(name)] /= gain
    return H


def nominal_of(name, structure, frequency, rng):
    """Return what an analyst knows: a material 1.5 and 0.4 % off, joints up to 2 %, and no hidden effect."""
    sensors = sensors_of(structure)
    joints = []
    for joint, bar1, s1, bar2, s2 in structure.joints:
        middle = 0.5 * (structure.bars[bar1].at(s1) + structure.bars[bar2].at(s2))
        k = {f"k{d}": float(f"{v * (1 + 0.02 * rng.uniform(-1, 1)):.4g}") for d, v in TRUE_JOINT.items()}
        kind = f"elastic, 6 uncoupled springs in global directions, loss factor {JOINT_LOSS}"
        if structure.clamped:
            kind = f"rigid (bolt; clamped patch of {2000 * structure.clamped:g} mm, flats on each other)"
        joints.append(
            {"name": joint, "type": kind, "member1": bar1, "s1": s1, "member2": bar2, "s2": s2}
            | {"location": middle.tolist()}
            | ({} if structure.clamped else {"k": k})
        )
    return {
        "case": name,
        "structure": f"{len(structure.bars)} bars, "
        + (
            "welded"
            if structure.welded
            else f"{len(joints)} {'rigid' if structure.clamped else 'elastic'} joint(s)"
        )
        + (", clamped" if structure.held else ", free"),
        "units": "SI (m, N, kg, s, Pa, Hz)",
        "material": {
            "name": "steel",
            "E": E * (1 + float(rng.choice([-1, 1])) * 0.015),
            "nu": NU,
            "rho": RHO * (1 + float(rng.choice([-1, 1])) * 0.004),
        },
        "points": {str(s["node"]): structure.bars[s["member"]].at(s["position"]).tolist() for s in sensors}
        | {name: structure.bars[name].at(0.0).tolist() for name in structure.held},
        "members": [
            {
                "name": bar,
                "end1": b.at(0.0).tolist(),
                "end2": b.at(b.length).tolist(),
                "section": {"type": "rect", "b": b.b, "h": b.h, "h_direction": b.rotation[:, 2].tolist()},
            }
            for bar, b in structure.bars.items()
        ],
        "joints": WELDED if structure.welded else joints,
        "supports": [{"point": name, "fixed": "all six"} for name in structure.held] or "free-free",
        "sensors": sensors,
        "excitations": [{"sensor": s} for s in structure.excitations],
        "frequency": {"start": float(frequency[0]), "stop": float(frequency[-1]), "lines": len(frequency)},
        "response": "accelerance, (m/s^2)/N",
        "damping_guess_modal": round(0.87 * structure.damping[0], 4),
        "tolerances": "E +-2 %, rho +-0.5 %, joint data +-3 %, dimensions +-0.5 %",
        "files": ["frf.uff"],
    }


def with_noise(H, rng):
    """Return FRFs with noise of `NOISE` of each value and `NOISE_FLOOR_DB` under the peak of each."""
    floor = np.abs(H).max(axis=0) * 10 ** (NOISE_FLOOR_DB / 20)

    def noise():
        return (rng.standard_normal(H.shape) + 1j * rng.standard_normal(H.shape)) / np.sqrt(2)

    return H * (1 + NOISE * noise()) + floor * noise()


def write_files(target, nominal, frequency, H, file="frf.uff"):
    """Write nominal.json and a file of FRFs, H of its sensors and excitations (n_freq, n_out, n_in)."""
    import pyuff

    excitations = [e["sensor"] for e in nominal["excitations"]]
    target.mkdir(parents=True, exist_ok=True)
    (target / "nominal.json").write_text(json.dumps(nominal, indent=1), encoding="utf-8")
    (target / file).unlink(missing_ok=True)
    by_name = {s["name"]: s for s in nominal["sensors"]}
    sets, empty = [], {"type": 58, "binary": 0}
    empty |= dict.fromkeys(("func_id", "ver_num", "load_case_id", "z_axis_value", "z_axis_spec_data_type"), 0)
    empty |= dict.fromkeys(("id1", "id2", "id3", "id4", "id5", "rsp_ent_name", "ref_ent_name"), "NONE")
    for axis in ("abscissa", "ordinate", "orddenom", "z_axis"):
        empty |= {f"{axis}_{unit}_unit_exp": 0 for unit in ("len", "force", "temp")}
        empty |= {f"{axis}_axis_lab": "NONE", f"{axis}_axis_units_lab": "NONE"}
    for i, sensor in enumerate(nominal["sensors"]):
        for j, excitation in enumerate(excitations):
            at = by_name[excitation]
            given = {
                "func_type": 4,
                "rsp_node": sensor["node"],
                "rsp_dir": 1 + AXES.index(sensor["direction"]),
                "ref_node": at["node"],
                "ref_dir": 1 + AXES.index(at["direction"]),
                "ord_data_type": 5,
                "num_pts": len(frequency),
                "abscissa_spacing": 1,
                "abscissa_min": frequency[0],
                "abscissa_inc": frequency[1] - frequency[0],
                "abscissa_spec_data_type": 18,
                "ordinate_spec_data_type": 12,
                "orddenom_spec_data_type": 13,
                "x": frequency,
                "data": H[:, i, j],
            }
            sets.append(empty | given)
    pyuff.UFF(str(target / file)).write_sets(sets, "overwrite")


def write(folder, name):
    """Write a case and return its truth."""
    structure_name, seed, hidden, effects = CASES[name]
    structure, rng = STRUCTURES[structure_name], np.random.default_rng(seed)
    frequency = np.arange(structure.step, structure.stop + 1e-9, structure.step)
    R = receptances(structure, hidden, frequency)
    levels = LEVELS_N if hidden.nonlinear else {"frf.uff": 1.0}
    measured = {
        file: with_noise(accelerances(R, structure, hidden, frequency, force), rng)
        for file, force in levels.items()
    }
    nominal = nominal_of(name, structure, frequency, rng)
    if hidden.nonlinear:
        nominal |= {"files": list(levels), "levels_N": levels}
        nominal["files_note"] = "the same channels and lines at the amplitudes of force of levels_N"
    for file, H in measured.items():
        write_files(folder / name, nominal, frequency, H, file)
    return {"code": "scikit-fem, quadratic hexahedra", "effects": effects}


def main(argv):
    folder, names = Path(argv[0]), argv[1:] or list(CASES)
    folder.mkdir(parents=True, exist_ok=True)
    truth = folder / "truth.json"
    known = json.loads(truth.read_text(encoding="utf-8")) if truth.exists() else {}
    for name in names:
        known[name] = write(folder, name)
        truth.write_text(json.dumps(known, indent=1), encoding="utf-8")
        sys.stderr.write(f"{folder / name}\n")


if __name__ == "__main__":
    main(sys.argv[1:])
