"""Places on a true frame, and effects that are hidden there with their strength still open."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.validation.frames import Draft, Generator
from benchmarks.validation.truth import Cut, Member, Reading, TrueFrame, rectangle_constants, rigid_body

NEAR = 0.05
"""A place is right within this part of the member's length [-]."""

Readings = tuple[Reading, ...]
Matrix = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Place:
    """Where something is hidden; fields that are None or empty need not agree."""

    words: str
    member: str | None = None
    xyz: NDArray[np.float64] | None = None  # (3,) [m]
    tolerance: float = 0.0  # how far from there a found effect may lie [m]
    joint: str | None = None
    direction: str | None = None
    support: str | None = None
    pair: tuple[str, ...] = ()  # two directions that are coupled
    of_member: bool = False  # whether an effect at a corner must be of the very member
    sensors: tuple[str, ...] = ()  # of faults
    # members and local directions of which one must agree, as one rotation at a corner has several names
    turns: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Hidden:
    """An effect at a place, its strength still open."""

    place: Place
    bounds: tuple[float, float]  # least and largest amplitude
    # from the true frame and the amplitude to the frame with the effect
    change: Callable[[TrueFrame, float], TrueFrame] = lambda frame, a: frame
    # from the amplitude to parameters as the candidates name them; only those that can be compared
    values: Callable[[float], dict[str, float]] = lambda a: {}
    # from the sensors to the places and directions where they really are
    readings: Callable[[Readings, float], Readings] | None = None
    # from frequencies (n_freq,), exact FRFs (n_freq, n_out, n_in) and the amplitude to the recorded data
    data: Callable[[NDArray[np.float64], NDArray[Any], float], NDArray[Any]] | None = None
    # effects at one place that are hidden together, alone, each with its strength
    parts: tuple["Hidden", ...] = ()
    kind: str = ""  # filled in by `hidden.draw_hidden`


Draw = Callable[[Generator, Draft, TrueFrame], Hidden | None]


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of effect or fault."""

    name: str
    found_as: tuple[str, ...]  # kinds of candidates, or of faults, that are the right answer
    draw: Draw = field(repr=False)  # gives a place, or None if the frame has none
    fault: bool = False  # of the measurement
    elastic_feet: bool = False  # it needs a frame on elastic feet in place of clamps


def some_member(rng: Generator, draft: Draft) -> tuple[str, Member]:
    """Return the name of a member drawn at random, and the member."""
    name = str(rng.choice(list(draft.frame.members)))
    return name, draft.frame.members[name]


def bending_stiffnesses(m: Member) -> tuple[float, float]:
    """Return E Iy and E Iz of the nominal member [N·m²]."""
    _, Iy, Iz, _ = rectangle_constants(m.b, m.h)
    return m.E * Iy, m.E * Iz


def on_member(draft: Draft, name: str, position: float) -> Place:
    """Return the place at an arc length along a member [m]."""
    m = draft.frame.members[name]
    return Place(f"member {name} at {position:.3f} m", name, m.place(position), NEAR * m.length)


def entire_member(name: str) -> Place:
    """Return a member as a place."""
    return Place(f"member {name}", name)


def some_place(rng: Generator, draft: Draft) -> tuple[str, Member, float]:
    """Return a place along a member drawn at random: its name, the member, the arc length [m]."""
    name, m = some_member(rng, draft)
    return name, m, float(rng.uniform(0.06, 0.94) * m.length)


def some_fastening(rng: Generator, draft: Draft) -> tuple[str, Member, float]:
    """Return a member's end that is no foot, or a joint's place: where things are fastened."""
    feet = [s.at for s in draft.frame.supports]
    places = [Cut(name, x) for name, m in draft.frame.members.items() for x in (0.0, m.length)]
    places += [c for j in draft.frame.joints for c in j.cuts]
    free = [p for p in places if p not in feet]
    at = free[int(rng.integers(len(free)))]
    return at.member, draft.frame.members[at.member], at.position


def middle_of_band(draft: Draft) -> float:
    """Return the middle of the band, geometric [rad/s]."""
    return float(2 * np.pi * np.sqrt(draft.frequency[0] * draft.frequency[-1]))


def one_entry(d: int, value: float) -> Matrix:
    """Return a 6×6 matrix with one entry on the diagonal."""
    out = np.zeros((6, 6))
    out[d, d] = value
    return out


def felt_stiffness(draft: Draft, member: str, d: int) -> float:
    """Return a stiffness that a member feels in a direction, for scale [N/m or N·m/rad]."""
    m = draft.frame.members[member]
    EI = min(bending_stiffnesses(m))
    return 300 * EI / m.length if d > 2 else 1e5 * EI / m.length**3


def some_body(m: Member, rotary: bool) -> tuple[Matrix, float]:
    """Return a body for the scale of a member: its matrix (6, 6), and its mass [kg] or inertia [kg·m²]."""
    unit = m.mass * m.length**2 / 12 if rotary else m.mass
    return (rigid_body(0.0, unit) if rotary else rigid_body(unit)), unit
