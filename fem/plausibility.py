"""Implausible values of a model: units that were mixed up, and values that are off by powers of ten.

Each suspicion names the quantity, its value, the range of solids or structures, and the unit that it would be
right in. Nothing here is refused: the constructors refuse impossible values.

Ranges of solids are those of Ashby, *Materials Selection in Mechanical Design*, 4th ed., appendix A: E from
polymer foams (0.3 MPa) to diamond (1220 GPa), ρ from polymer foams (16 kg/m³) to osmium (22 590 kg/m³). Their
ratio, as speed of sound √(E/ρ), lies between 30 m/s (rubber) and 19 km/s (diamond); solids denser than
polymers are metals, ceramics and stone, with at least 1 GPa (lead has 14).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from fem.array_types import Floats, Ints
from fem.elements.frame import Frame
from fem.elements.properties import MemberProperties
from fem.materials import Material
from fem.mesh import Mesh
from fem.model import Damping, Model
from fem.sections.constants import NO_INERTIA_OF_TORSION
from fem.sections.section import Section

MODULUS = (0.3e6, 1.22e12)
"""Young's moduli of solids: polymer foams … diamond [Pa]."""

DENSITY = (16.0, 22590.0)
"""Densities of solids: polymer foams … osmium [kg/m³]."""

SOUND = (30.0, 19e3)
"""√(E/ρ) of solids: rubber … diamond [m/s]."""

DENSE = (2250.0, 1e9)
"""Solids denser than the first are no polymers (PTFE has 2200), and stiffer than the second [kg/m³, Pa]."""

UNITS = {"E": "Pa", "rho": "kg/m³"}

USUAL_SOUND = 5000.0
"""√(E/ρ) of steel, aluminium, glass and wood along its grain, within a fifth [m/s]."""


LARGEST_AREA = 10.0
"""Solid part of a cross-section that no member exceeds [m²]."""

MOST_DAMPING = 0.3
"""Damping ratio above which no structure vibrates long enough to be tested [-]."""


MOST_PRESTRAIN = 0.02
"""Strain of a pretension above that at which steel wire breaks [-]."""

_GRAVITY = 9.81
"""[m/s²]."""

_LOOKED_AT = 100
"""Members of one kind of mistake that are looked at."""

LEAST_USUAL = (1e8, 100.0)
"""E and ρ from which a guess of the unit is worth a word: polyethylene, cork [Pa, kg/m³]."""

FARTHEST_SOUND = float(np.log(4.0))
"""Largest deviation of a guessed speed of sound from the usual one, as a logarithm [-]."""

MODULUS_UNITS = (
    (1e6, "MPa (N/mm²)", False),
    (1e9, "GPa", False),
    (1e3, "kPa", False),
    (1e-3, "a thousand times as much", False),
    (6894.757, "psi", True),
    (6.894757e6, "ksi", True),
)
"""Pascals in units that are taken for Pa, their names, and whether they are imperial."""

DENSITY_UNITS = (
    (1e3, "g/cm³ (t/m³)", False),
    (1e12, "t/mm³", False),
    (1e9, "kg/mm³", False),
    (1e-3, "g/m³", False),
    (27679.9, "lb/in³", True),
    (1.06869e7, "lbf·s²/in⁴", True),
)
"""The same of kg/m³."""


@dataclass(frozen=True, slots=True)
class Suspicion:
    """A value that is probably a mistake.

    Attributes
    ----------
    place : tuple of str
        Owner of the value: ``("material", name, "E")``, ``("section", member)``, ``("member", name, key)``,
        ``("effect", name, key)``, ``("damping", key)`` or ``("mesh",)``.
    message : str
        The value found, the usual values, and a remedy.
    lines : tuple of int
        Lines of the mesh that it concerns.
    """

    place: tuple[str, ...]
    message: str
    lines: tuple[int, ...] = ()


def suspicions(model: Model, max_frequency: float | None = None) -> tuple[Suspicion, ...]:
    """Return the implausible values of a model, materials first.

    Parameters
    ----------
    model : Model
    max_frequency : float, optional
        Highest frequency of interest, at which Rayleigh damping is judged [Hz].
    """
    out = list(_of_damping(model.damping, max_frequency))
    frames: tuple[Frame, ...] = model.of_kind(Frame)
    if not frames or any(name not in frames[0].members for name in model.mesh.members):
        return tuple(out)
    (frame,) = frames
    members = _alike(frame, model.mesh)
    materials = {m.name: m for m in (each.material for each in members)}
    wrong = [s for m in materials.values() for s in suspicions_of_material(m)]
    different = {id(s): s for m in members for s in m.sections}
    odd = {key for key, s in different.items() if any(_contradictions(s))}
    sound = [m for m in members if not any(id(s) in odd for s in m.sections)]
    sizes = list(_of_sizes(model.mesh, sound, trusted=not wrong))
    carriers = [] if wrong else sound
    effects = _of_effects(model, members, carriers)
    return (*wrong, *_of_sections(members), *sizes, *_of_members(members), *effects, *out)


# Materials --------------------------------------------------------------------------------------------------


def suspicions_of_material(m: Material) -> Iterator[Suspicion]:
    """Yield the implausible values of a material."""
    outside = {
        key: f"solids have {si_number(low)} to {si_number(high)} {unit} ({ends})"
        for key, value, unit, (low, high), ends in (
            ("E", m.E, "Pa", MODULUS, "polymer foams to diamond"),
            ("rho", m.rho, "kg/m³", DENSITY, "polymer foams to osmium"),
        )
        if not low <= value <= high
    }
    reasons = outside or _of_both(m)
    if m.is_massless:
        reasons["rho"] = (
            "a deck without a density is read with such a negligible one; state that of the material"
        )
    meant = _meant(m, tuple(reasons))
    for key, why in reasons.items():
        about = [key, *(k for k in meant if k not in reasons)]
        guesses = [
            f"{k} looks like {meant[k][1]}: {si_number(meant[k][0])} {UNITS[k]}" for k in about if k in meant
        ]
        hint = "; ".join(["", *guesses])
        value = f"{key} = {si_number(getattr(m, key))} {UNITS[key]}"
        text = f"material '{m.name}': {value} is implausible: {why}{hint}"
        yield Suspicion(("material", m.name, key), text)
    if m.nu < 0:
        yield Suspicion(
            ("material", m.name, "nu"),
            f"material '{m.name}': nu = {m.nu:g} is implausible; solids have 0 to 0.5, but for auxetic foams",
        )
    if m.loss_factor > 1:
        yield Suspicion(
            ("material", m.name, "loss_factor"),
            f"material '{m.name}': loss_factor = {m.loss_factor:g} is implausible; solids have 1e-5 to 1; in "
            f"per cent it would be {m.loss_factor / 100:g}",
        )


def _of_both(m: Material) -> dict[str, str]:
    """Return why E and ρ, each of which some solid has, do not belong together."""
    speed = float(np.sqrt(m.E / m.rho))
    if speed > SOUND[1]:
        at = f"with E = {si_number(m.E)} Pa"
        return {"rho": f"{at} sound would have {speed:.0f} m/s, and has {SOUND[1]:.0f} m/s in diamond"}
    if speed < SOUND[0]:
        at = f"with rho = {m.rho:.5g} kg/m³"
        return {"E": f"{at} sound would have {speed:.2g} m/s, and has {SOUND[0]:g} m/s in rubber"}
    if m.rho > DENSE[0] and DENSE[1] > m.E:
        return {"E": f"solids of {m.rho:.5g} kg/m³ have at least {si_number(DENSE[1])} Pa (lead has 14e9 Pa)"}
    return {}


def _meant(m: Material, odd: Sequence[str]) -> dict[str, tuple[float, str]]:
    """Return the values in SI and the units in which the odd ones make the most usual solid.

    Units are taken to come from one system, SI or imperial, where that explains the values.
    """
    kept = ((1.0, "", False),)
    for free in (odd, ("E", "rho")):
        best: tuple[float, dict[str, tuple[float, str]]] = (FARTHEST_SOUND, {})
        by_E = (*kept, *MODULUS_UNITS) if "E" in free else kept
        by_rho = (*kept, *DENSITY_UNITS) if "rho" in free else kept
        for (f, of_E, US_E), (g, of_rho, US_rho) in product(by_E, by_rho):
            E, rho = f * m.E, g * m.rho
            off = abs(np.log(np.sqrt(E / rho) / USUAL_SOUND)) + (US_rho != US_E)
            found = {"E": (E, of_E), "rho": (rho, of_rho)}
            if off < best[0] and LEAST_USUAL[0] <= E <= MODULUS[1] and LEAST_USUAL[1] <= rho <= DENSITY[1]:
                best = (off, {key: value for key, value in found.items() if value[1]})
        if best[1]:
            return best[1]
    return {}


def si_number(value: float) -> str:
    """Return a value with an exponent that is a multiple of three, as people write it: 210e9."""
    if 1e-3 <= value < 1e5:
        return f"{value:.5g}"
    power = 3 * int(np.floor(np.log10(value) / 3))
    return f"{value / 10.0**power:.4g}e{power}"


# Sections and sizes -----------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class _Alike:
    """Members that share one object of properties, the shortest first."""

    p: MemberProperties
    material: Material  # with moduli and densities as they are now
    names: tuple[str, ...]
    lengths: Floats  # [m]

    @property
    def sections(self) -> tuple[Section, ...]:
        return (self.p.section,) if self.p.section2 is None else (self.p.section, self.p.section2)

    @property
    def most_mass(self) -> float:
        """Mass that bends the longest, simply supported, by its length, or breaks a hanging bar [kg].

        The members' mass is no measure: columns of measured frames carry 100 times as much.
        """
        E, s = self.material.E, self.sections[0]
        if self.p.theory == "bar":
            return MOST_PRESTRAIN * E * s.A / _GRAVITY
        return 48 * E * max(s.Iy, s.Iz) / float(self.lengths[-1]) ** 2 / _GRAVITY


def _alike(frame: Frame, mesh: Mesh) -> list[_Alike]:
    names = list(mesh.members)
    chains, member = mesh.chains()
    lengths = np.bincount(member, weights=mesh.lengths()[chains], minlength=len(names))
    by_properties: dict[int, list[int]] = {}
    for k, name in enumerate(names):
        by_properties.setdefault(id(frame.members[name]), []).append(k)
    out = []
    for rows in by_properties.values():
        order = np.array(rows)[np.argsort(lengths[rows], kind="stable")].tolist()
        p = frame.members[names[rows[0]]]
        now = _material_now(frame, p.material)
        out.append(_Alike(p, now, tuple(names[k] for k in order), np.asarray(lengths[order], dtype=float)))
    return out


def _material_now(frame: Frame, m: Material) -> Material:
    """Return a material with the values of a frame in place of the nominal ones."""
    E, rho = (float(np.real(frame.values.get(f"{key}:{m.name}", getattr(m, key)))) for key in ("E", "rho"))
    return Material(m.name, E, rho, m.nu, m.loss_factor) if E > 0 and rho > 0 else m


def _depth(s: Section) -> float:
    """Return the larger extent of a section; of one without outline twice its radius of gyration [m]."""
    if s.outlines:
        return float(max(np.ptp(o, axis=0).max() for o in s.outlines))
    return 2 * float(np.sqrt(max(s.Iy, s.Iz) / s.A))


def _sag(m: _Alike) -> Floats:
    """Return the sag of simply supported members under their weight, relative to their length [-]."""
    s = m.sections[0]
    load = _GRAVITY * m.material.rho * s.A
    return 5 * load * m.lengths**3 / (384 * m.material.E * max(s.Iy, s.Iz))


def _of_sections(members: Sequence[_Alike]) -> Iterator[Suspicion]:
    """Yield constants that no outline has, and areas that no member has."""
    known = {id(s): (s, m.names[0]) for m in members for s in m.sections}
    for s, name in known.values():
        label = f"section {s.label or 'by its constants'} of member '{name}'"
        wrong = tuple(_contradictions(s))
        for text in wrong:
            yield Suspicion(("section", name), f"{label}: {text}")
        if s.A > LARGEST_AREA and not wrong:
            depth = _depth(s)
            yield Suspicion(
                ("section", name),
                f"{label} has A = {s.A:.4g} m² and is {depth:.4g} m deep; members have up to "
                f"{LARGEST_AREA:g} m²; {_looks_like_mm(depth, 'sizes')}",
            )


def _looks_like_mm(size: float, what: str) -> str:
    return f"are the {what} in mm ({size / 1000:.4g} m)?"


def _contradictions(s: Section) -> Iterator[str]:
    """Yield contradictions among A, Iy, Iz and J.

    Of all figures of an area the ellipse has the least Iy·Iz, A⁴/(16π²); J is less than Iy + Iz (equal for
    circles and rings); walls thinner than a ten-thousandth of the depth buckle at a touch.
    """
    least = s.A**2 / (4 * np.pi)
    mean = float(np.sqrt(s.Iy * s.Iz))
    if mean < 0.99 * least:
        yield (
            f"Iy = {s.Iy:.4g} and Iz = {s.Iz:.4g} m⁴ are too small for A = {s.A:.4g} m²: no outline of that "
            f"area has less than √(Iy Iz) = {least:.3g} m⁴; are A in m² and I in m⁴?"
        )
    elif max(s.Iy, s.Iz) > 1e4 * s.A**2:
        yield (
            f"I = {max(s.Iy, s.Iz):.4g} m⁴ is too large for A = {s.A:.4g} m²: walls would be thinner than "
            "a ten-thousandth of the depth; are A in m² and I in m⁴?"
        )
    polar = s.Iy + s.Iz
    if 1.001 * polar < s.J:
        yield f"J = {s.J:.4g} m⁴ is larger than Iy + Iz = {polar:.4g} m⁴, which is the most that J can be"
    elif 1e-9 * polar > s.J:
        yield f"J = {s.J:.4g} m⁴ is {s.J / polar:.1g} of Iy + Iz; foil has as little"
    if not any(0.5 * Ip <= s.Ip <= 2 * Ip for Ip in (polar, NO_INERTIA_OF_TORSION * polar)):
        yield f"Ip = {s.Ip:.4g} m⁴ is not Iy + Iz = {polar:.4g} m⁴"


def _of_sizes(mesh: Mesh, members: Sequence[_Alike], trusted: bool) -> Iterator[Suspicion]:
    """Yield members that are thicker than long or bend under their weight, and structures too large."""
    size = mesh.size
    # No frame is longer but for bridges [m]
    if size > 1000.0:
        yield Suspicion(
            ("mesh",),
            f"the structure is {size:.4g} m large; are the coordinates in mm ({size / 1000:.4g} m)?",
        )
    thick = [
        (depth / length, depth, length, name)
        for m in members
        for depth in (_depth(m.p.section),)
        for name, length in zip(m.names, m.lengths[m.lengths < depth].tolist(), strict=False)
    ]
    # a piece of a longer straight member is not thick; of many, a few are enough
    thick = sorted(thick, reverse=True)[:_LOOKED_AT]
    thick = [t for t in thick if t[1] > _straight_run(mesh, mesh.members[t[3]])]
    if thick:
        _, depth, length, name = thick[0]
        yield Suspicion(
            ("section", name),
            f"the section of member '{name}'{_and_others(len(thick))} is {depth:.4g} m deep and the member "
            f"{length:.4g} m long: no beam; {_looks_like_mm(depth, 'sizes of the section')}",
            _lines(mesh, [t[3] for t in thick]),
        )
    if not trusted:
        return
    slack = [
        (sag, name, length, m)
        for m in members
        if m.p.theory != "bar" and m.p.pretension <= 0
        for sag, name, length in zip(_sag(m).tolist(), m.names, m.lengths.tolist(), strict=True)
        if sag > 1
    ]
    if slack:
        sag, name, length, m = max(slack, key=lambda each: each[0])
        few = len(slack) <= len(mesh.members) / 2
        yield Suspicion(
            ("section", name) if few else ("mesh",),
            f"member '{name}'{_and_others(len(slack))}, {length:.4g} m long and {_depth(m.p.section):.3g} m "
            f"deep, would sag by {sag:.2g} times its length under its own weight: is the section too "
            "small, or are the coordinates in mm? A cable is a bar (theory) with a pretension",
            _lines(mesh, [each[1] for each in slack[:_LOOKED_AT]]),
        )


def _lines(mesh: Mesh, names: Sequence[str]) -> tuple[int, ...]:
    return tuple(np.concatenate([mesh.members[name] for name in names]).tolist())


def _and_others(n: int) -> str:
    return f" (and of {n - 1} other{'s' * (n > 2)})" if n > 1 else ""


def _straight_run(mesh: Mesh, lines: Ints) -> float:
    """Return the length of a member with all that goes on in its direction at its ends [m]."""
    points = mesh.points
    start, stop = points[mesh.lines[lines[0], 0]], points[mesh.lines[lines[-1], 1]]
    axis = (stop - start) / max(float(np.linalg.norm(stop - start)), 1e-300)
    at = points - start
    along = at @ axis
    # all points of the axis through the member, joined without a gap by lines on it
    on = np.linalg.norm(at - along[:, None] * axis, axis=1) <= 1e-3 * mesh.size
    rows = mesh.lines[on[mesh.lines].all(axis=1)]
    spans = np.sort(along[rows], axis=1)
    lo, hi = 0.0, float(np.linalg.norm(stop - start))
    slack = 1e-6 * mesh.size
    while True:
        touching = spans[(spans[:, 0] <= hi + slack) & (spans[:, 1] >= lo - slack)]
        new = min(lo, float(touching[:, 0].min(initial=lo))), max(hi, float(touching[:, 1].max(initial=hi)))
        if new == (lo, hi):
            return hi - lo
        lo, hi = new


def _of_members(members: Sequence[_Alike]) -> Iterator[Suspicion]:
    for m in members:
        p, name, length = m.p, m.names[0], float(m.lengths[0])
        strain = abs(p.pretension) / (m.material.E * min(s.A for s in m.sections))
        if strain > MOST_PRESTRAIN:
            yield Suspicion(
                ("member", name, "pretension"),
                f"member '{name}': the pretension of {p.pretension:.4g} N strains it by {strain:.2g}; steel "
                f"wire breaks at {MOST_PRESTRAIN:g}",
            )
        for key in ("offset1", "offset2"):
            offset = float(np.linalg.norm(getattr(p, key)))
            if offset > length:
                yield Suspicion(
                    ("member", name, key),
                    f"member '{name}': {key} is {offset:.4g} m and the member {length:.4g} m long; is it in "
                    "mm?",
                )
        for key in ("spring1", "spring2"):
            for d, k in getattr(p, key).items():
                if 0 < k < np.inf and (text := _odd_stiffness(d, k, members)):
                    yield Suspicion(("member", name, key), f"member '{name}': {key} {d} is {text}")


# Effects and damping ----------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, eq=False)
class _Structure:
    """The members as the yardstick of effects."""

    members: Sequence[_Alike]
    most_mass: float
    size: float

    def odd_stiffness(self, direction: str, stiffness: float) -> str:
        """Return in words why a stiffness is absurd, empty where it is not."""
        return _odd_stiffness(direction, stiffness, self.members) if self.members else ""


def _of_effects(model: Model, members: Sequence[_Alike], carriers: Sequence[_Alike]) -> Iterator[Suspicion]:
    """Yield what effects doubt; masses relative to ``carriers``, members whose values are plausible."""
    # a reduced part may carry more than the members
    unknown = not carriers or any(e.reduced_part for e in model.effects)
    most = np.inf if unknown else max(m.most_mass for m in carriers)
    structure = _Structure(members, most, model.mesh.size)
    for e in model.effects:
        for key, text in e.doubts(structure):
            yield Suspicion(("effect", e.name, key), text)


def _odd_stiffness(d: str, k: float, members: Sequence[_Alike]) -> str:
    """Return in words why a stiffness along or about a direction is absurd, empty where it is not."""
    turning = d.startswith("r")
    unit = "N·m/rad" if turning else "N/m"
    power = 1.5 if turning else 0.5
    block = max(m.material.E * s.A**power for m in members for s in m.sections)
    # Stiffness of a connection relative to a cube of the stiffest member, above which it is rigid [-]
    if k > 1e6 * block:
        return (
            f"{k:.3g} {unit}, {k / block:.1g} times that of a cube as thick as the stiffest member "
            f"({block:.2g} {unit}): it is practically rigid; declare it rigid, because so large a "
            "number costs accuracy elsewhere"
        )
    slack = min(
        m.material.E * min(s.Iy, s.Iz) / float(m.lengths[-1]) ** (1 if turning else 3)
        for m in members
        for s in m.sections
    )
    # Stiffness of a connection relative to the softest member's EI/L³, below which it does nothing [-]
    if k < 1e-9 * slack:
        return (
            f"{k:.3g} {unit}, {k / slack:.1g} times that of the softest member ({slack:.2g} {unit}): it "
            f"has hardly any effect; is it in {unit}?"
        )
    return ""


def _of_damping(d: Damping, max_frequency: float | None) -> Iterator[Suspicion]:
    ratio = float(np.max(d.ratio, initial=0.0))
    if ratio > MOST_DAMPING:
        yield Suspicion(
            ("damping", "modal"),
            f"a modal damping ratio of {ratio:g} is implausible; structures have up to {MOST_DAMPING:g}; is "
            f"it in per cent ({ratio / 100:g})?",
        )
    if d.loss_factor > 2 * MOST_DAMPING:
        yield Suspicion(
            ("damping", "loss_factor"),
            f"a structural loss factor of {d.loss_factor:g} is implausible; structures have up to "
            f"{2 * MOST_DAMPING:g}; is it in per cent ({d.loss_factor / 100:g})?",
        )
    if max_frequency is None:
        return
    at_top = np.pi * d.beta * max_frequency
    if at_top > 10 * MOST_DAMPING:
        yield Suspicion(
            ("damping", "beta"),
            f"beta = {d.beta:g} s gives modes at {max_frequency:g} Hz a damping ratio of {at_top:.3g}; "
            f"{2 * 0.01 / (2 * np.pi * max_frequency):.1g} s would give 0.01",
        )
    of_mass = d.alpha / (4 * np.pi * max_frequency)
    if of_mass > MOST_DAMPING:
        yield Suspicion(
            ("damping", "alpha"),
            f"alpha = {d.alpha:g} 1/s gives modes at {max_frequency:g} Hz, and more so those below, a "
            f"damping ratio of {of_mass:.3g}",
        )
