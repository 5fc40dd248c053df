"""Properties of a Nastran deck's bars: MAT1 with PBAR, PBARL, PBEAM, PBEAML, PROD, PTUBE and CONROD."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from fem.array_types import Floats
from fem.io.faults import refuse
from fem.io.frame_deck import BarProperty
from fem.io.frame_sections import angle, box, check_fit, material_of, of_constants, rod, walled, with_shear
from fem.io.nastran_deck import Card, NastranDeck
from fem.materials import PropertyError, negligible_density
from fem.sections.constants import NO_INERTIA_OF_TORSION
from fem.sections.profiles import cross_of_plates
from fem.sections.section import Section

BEAMS = ("CBAR", "CBEAM")

OF_ELEMENT = {"CBAR": ("PBAR", "PBARL"), "CBEAM": ("PBEAM", "PBEAML"), "CROD": ("PROD",), "CTUBE": ("PTUBE",)}
"""Cards that give the property of an element."""


@dataclass(frozen=True, slots=True, eq=False)
class Profile:
    """Data of one property card.

    Attributes
    ----------
    card : Card
    material : int, number of its MAT1
    section, section2 : Section, Section or None
    mass_per_length : float, non-structural [kg/m]
    centroid : ndarray (2, 2), centroid from the shear centre in Nastran's y and z at both ends [m]
    torsion : float, j of a rod [m⁴]
    """

    card: Card
    material: int
    section: Section
    section2: Section | None = None
    mass_per_length: float = 0.0
    centroid: Floats = field(default_factory=lambda: np.zeros((2, 2)))
    torsion: float = 0.0


class Properties:
    """The properties of a deck's bars, made when a bar asks for one."""

    def __init__(self, deck: NastranDeck) -> None:
        self.deck = deck
        self.materials = deck.by_number("MAT1")
        self.cards = {element: deck.by_number(*names) for element, names in OF_ELEMENT.items()}
        self.consistent = deck.parameter("COUPMASS", -1.0) > 0
        self.made: dict[tuple, tuple[int, Profile]] = {}
        self.found: list[BarProperty] = []

    def of(self, element: Card, number: int | None) -> tuple[int, Profile]:
        """Return the place of an element's property in the list, and its profile."""
        key = (element.name, number) if number is not None else ("CONROD", *map(str, element.fields[3:7]))
        if key not in self.made:
            card = element if number is None else self.cards[element.name].get(number)
            if card is None:
                names = " or ".join(OF_ELEMENT[element.name])
                element.refuse(f"refers to property {number}, but the file has no {names} {number}")
            try:
                profile = _READERS[card.name](self, card)
                self.found.append(self._property(element, profile, number))
            except (PropertyError, OverflowError) as reason:
                card.refuse(f"cannot be used: {reason}")
            self.made[key] = (len(self.found) - 1, profile)
        return self.made[key]

    def material(self, card: Card, number: int) -> Card:
        """Return the MAT1 card that another one refers to."""
        if number not in self.materials:
            other = next(
                (c for c in self.deck.of("MAT2", "MAT8", "MAT9", "MAT3") if c.integer(0) == number), None
            )
            has = f"no MAT1 {number}" + (f", but {other} at {other.place}" if other else "")
            card.refuse(f"refers to material {number}, and the file has {has}; isotropic MAT1 is read")
        return self.materials[number]

    def nu(self, card: Card, number: int) -> float:
        """Return Poisson's ratio of a material for the shear coefficients of shapes."""
        E, G, nu = elastic(self.material(card, number))
        ratio = E / (2 * G) - 1
        return ratio if 0 <= ratio <= 0.5 else min(max(nu, 0.0), 0.5)

    def _property(self, element: Card, profile: Profile, number: int | None) -> BarProperty:
        deck, units = self.deck, self.deck.units
        card = self.material(profile.card, profile.material)
        E, G, nu = elastic(card)
        if not (card.text(2) or card.text(3)) and element.name in BEAMS:
            deck.notes.add(
                "it has neither G nor NU, so that Nastran gives bars no stiffness in torsion; "
                "NU = 0.3 is taken",
                card,
            )
        if element.name not in BEAMS or profile.section.label == "rod":
            theory = "bar"
        else:
            sections = [one for one in (profile.section, profile.section2) if one is not None]
            theory = "timoshenko" if any(one.ky or one.kz for one in sections) else "euler-bernoulli"
        rho = card.real(4) * deck.mass_factor * units.density
        if not rho:
            deck.notes.add("it has no density; a negligible one is taken", card)
            rho = negligible_density(E * units.stress)
        material, factor = material_of(
            deck.names.materials.get(profile.material, f"MAT1 {profile.material}"),
            E * units.stress,
            G * units.stress,
            nu,
            rho,
            card.real(7),
        )
        return BarProperty(
            name=f"CONROD {element.text(0)}"
            if number is None
            else deck.names.properties.get(number, f"property {number}"),
            material=material,
            section=self._end(profile.section, factor, element),
            section2=None if profile.section2 is None else self._end(profile.section2, factor, element),
            theory=theory,
            mass="consistent" if self.consistent and theory != "bar" else "lumped-slender",
            mass_per_length=profile.mass_per_length,
        )

    def _end(self, section: Section, factor: float, element: Card) -> Section:
        scaled = with_shear(section, factor)
        if self.consistent or element.name != "CBAR":
            return scaled
        # lumped mass of CBARs has no inertia of torsion
        return replace(scaled, Ip=NO_INERTIA_OF_TORSION * (scaled.Iy + scaled.Iz))

    def notes(self) -> Iterator[str]:
        """Yield what the mass of these bars is."""
        if not self.made:
            return
        kinds = {key[0] for key in self.made}
        if self.consistent:
            yield (
                "PARAM COUPMASS: bars have the consistent mass of their shape functions, and rods lumped "
                "mass, which is nearer to Nastran's coupled mass: that of motions along them lies midway "
                "between the two"
            )
        elif "CBAR" in kinds:
            yield (
                "bars have lumped mass, as in Nastran without PARAM COUPMASS: half at each end, for CBAR "
                "without inertia of torsion"
            )
        else:
            yield "bars have lumped mass, as in Nastran without PARAM COUPMASS: half at each end"


def elastic(card: Card) -> tuple[float, float, float]:
    """Return E, G and Poisson's ratio of a MAT1, each missing one from the other two."""
    E, G, nu = (card.real(k) for k in (1, 2, 3))
    has_nu = bool(card.text(3))
    if not E and G and has_nu:
        E = 2 * G * (1 + nu)
    if not G:
        nu = nu if has_nu else 0.3
        G = E / (2 * (1 + nu)) if nu > -1 else 0.0
    if not (E > 0 and G > 0):
        card.refuse(f"has E = {E:g} and G = {G:g}; both must be positive, or E with NU above -1")
    return E, G, nu


def _constants(reader: Properties, card: Card, values: Floats, k: tuple[float, float]) -> Section:
    """Return the section of A, I1, I2, I12 and J of a card; one without any moment is a rod."""
    units = reader.deck.units
    A, I1, I2, I12, J = values * np.array([units.area, *[units.second_moment] * 4])
    if not A >= 0 or not (A or I1 or I2):
        card.refuse(f"has the area {values[0]:g}; it must be positive")
    if I1 < 0 or I2 < 0 or J < 0:
        card.refuse(
            f"has I1 = {values[1]:g}, I2 = {values[2]:g} and J = {values[4]:g}; they cannot be negative"
        )
    if not (I1 or I2):
        if J:
            reader.deck.notes.add("without I1 and I2 it is a rod; its stiffness in torsion is left out", card)
        return replace(rod(A), label="rod")
    zero = [name for name, value in (("A", A), ("I1", I1), ("I2", I2), ("J", J)) if not value]
    if zero:
        reader.deck.notes.add(
            f"{' and '.join(zero)} {'is' if len(zero) == 1 else 'are'} zero; a negligible value is taken, so "
            "that motions which Nastran's AUTOSPC constrains may have modes of very low frequency",
            card,
        )
    A = A or NEGLIGIBLE * math.sqrt(max(I1, I2))
    return section_of_constants(str(card), A, (I1, I2, I12), J, k)


def _pbar(reader: Properties, card: Card) -> Profile:
    A, I1, I2, J = card.reals(2, 6)
    I12 = card.real(18)
    # blank and zero both mean no shear deformation, and a product of inertia leaves both out
    k = (card.real(16), card.real(17)) if not I12 else (0.0, 0.0)
    section = _constants(reader, card, np.array([A, I1, I2, I12, J]), k)
    nsm = card.real(6) * reader.deck.mass_factor * reader.deck.units.mass_per_length
    return Profile(card, card.integer(1), section, mass_per_length=nsm)


def _shape(reader: Properties, card: Card, start: int) -> tuple[Section, float, int]:
    """Return the section of dimensions from a field on, the mass per length, and the field after them."""
    shape, units = card.text(3), reader.deck.units
    if shape not in SHAPES:
        card.refuse(f"has the shape '{shape}'; there are {', '.join(SHAPES)}; give its constants instead")
    stop = start + SHAPES[shape][0]
    lost = next((k for k in range(start, stop) if not card.text(k)), None)
    if lost is not None:
        card.refuse(
            f"has the shape {shape}, which needs {stop - start} dimensions; DIM{lost - start + 1} is blank"
        )
    section = section_of_shape(
        shape, (card.reals(start, stop) * units.length).tolist(), reader.nu(card, card.integer(1))
    )
    return section, card.real(stop) * reader.deck.mass_factor * units.mass_per_length, stop + 1


def _pbarl(reader: Properties, card: Card) -> Profile:
    section, nsm, _ = _shape(reader, card, 8)
    return Profile(card, card.integer(1), section, mass_per_length=nsm)


def _pbeaml(reader: Properties, card: Card) -> Profile:
    section, nsm, k = _shape(reader, card, 8)
    stations = [(0.0, section, nsm)]
    while k < len(card.fields) and not card.blank(k, len(card.fields)):
        where = card.real(k + 1, 1.0)
        if card.blank(k + 2, k + 2 + SHAPES[card.text(3)][0]):
            stations.append((where, section, nsm))
            k += 3 + SHAPES[card.text(3)][0]
        else:
            one, mass, k = _shape(reader, card, k + 2)
            stations.append((where, one, mass))
    return _tapered(reader, card, stations, np.array([_centroid(s) for s in _end_sections(stations)]))


def _centroid(section: Section) -> tuple[float, float]:
    """Return the centroid from the shear centre, in Nastran's y and z: local z and -y."""
    y, z = section.shear_centre
    c, s = math.cos(section.angle), math.sin(section.angle)
    return -(s * y + c * z), c * y - s * z


def _end_sections(stations: list[tuple[float, Section, float]]) -> list[Section]:
    return [stations[0][1], next((s for x, s, _ in stations if x == 1.0), stations[0][1])]


def _tapered(
    reader: Properties, card: Card, stations: list[tuple[float, Section, float]], centroid: Floats
) -> Profile:
    first, last = _end_sections(stations)
    masses = [m for x, _, m in sorted(stations, key=lambda one: one[0]) if x in (0.0, 1.0)]
    same = all(
        math.isclose(getattr(first, k), getattr(last, k), rel_tol=1e-9) for k in ("A", "Iy", "Iz", "J")
    )
    if not same and (first.shape != last.shape or first.angle != last.angle or not first.shape):
        first, last = (_by_constants(s) for s in (first, last))
    for x, section, _ in stations:
        if 0 < x < 1:
            between = first if same else Section.between(first, last, x)
            error = max(abs(getattr(section, k) / getattr(between, k) - 1) for k in ("A", "Iy", "Iz"))
            # Difference of a section between the ends from that of the taper that is named rather than
            # refused [-]
            if error > 0.02:
                card.refuse(
                    f"has at X/XB = {x:g} a section that differs by {100 * error:.0f} % from that of a "
                    "taper; divide the beam there"
                )
            reader.deck.notes.add("stations between the ends are left out; the section tapers evenly", card)
    if not same and not first.shape:
        reader.deck.notes.add("between its ends √A and the fourth roots of I1, I2 and J are linear", card)
    return Profile(card, card.integer(1), first, None if same else last, sum(masses) / len(masses), centroid)


def _by_constants(s: Section) -> Section:
    return Section(
        s.A, s.Iy, s.Iz, s.J, s.ky, s.kz, label=s.label, Ip=s.Ip, angle=s.angle, shear_centre=s.shear_centre
    )


_STATION = ("YES", "YESA", "NO")


def _pbeam(reader: Properties, card: Card) -> Profile:
    units, deck = reader.deck.units, reader.deck
    rows = [card.reals(2, 8)]  # A, I1, I2, I12, J, NSM of end A
    k, where = (8 if card.text(8) in _STATION else 16), [0.0]
    while card.text(k) in _STATION:
        given = [card.text(j) for j in range(k + 2, k + 8)]
        rows.append(np.array([card.real(k + 2 + j) if t else rows[0][j] for j, t in enumerate(given)]))
        where.append(card.real(k + 1, 1.0))
        k += 16 if card.text(k) == "YES" else 8
    k1, k2 = card.real(k, 1.0), card.real(k + 1, 1.0)
    if card.reals(k + 4, k + 6).any():
        deck.notes.add("NSI, the inertia of non-structural mass about the bar, is left out", card)
    if card.reals(k + 6, k + 8).any():
        deck.notes.add("warping (CW) is left out: a restrained open section is stiffer in torsion", card)
    M1, M2, M1b, M2b, N1, N2, N1b, N2b = (
        card.real(k + 8 + j) if card.text(k + 8 + j) or j % 4 < 2 else card.real(k + 6 + j) for j in range(8)
    )
    if M1 or M2 or M1b or M2b:
        deck.notes.add("the non-structural mass is taken at the centroid, not at M1 and M2", card)
    stations = [
        (
            x,
            _constants(reader, card, row[[0, 1, 2, 3, 4]], (k1, k2)),
            float(row[5]) * deck.mass_factor * units.mass_per_length,
        )
        for x, row in zip(where, rows, strict=True)
    ]
    return _tapered(reader, card, stations, np.array([(N1, N2), (N1b, N2b)]) * units.length)


def _rod(reader: Properties, card: Card, material: int, start: int) -> Profile:
    """Return the profile of A, J, C and NSM from a field on."""
    units = reader.deck.units
    A, J = card.real(start) * units.area, card.real(start + 1) * units.second_moment
    if not A > 0:
        card.refuse(f"has the area {card.real(start):g}; it must be positive")
    nsm = card.real(start + 3) * reader.deck.mass_factor * units.mass_per_length
    return Profile(card, material, rod(A), mass_per_length=nsm, torsion=J)


def _ptube(reader: Properties, card: Card) -> Profile:
    """Return the profile of a tube; one that tapers has the mean of its diameters."""
    units = reader.deck.units
    outer = (card.real(2) + card.real(5, card.real(2))) / 2 * units.length
    wall = card.real(3) * units.length or outer / 2
    if not 0 < wall <= outer / 2:
        card.refuse(f"has OD = {card.real(2):g} and T = {card.real(3):g}; T must be at most OD / 2")
    inner = outer - 2 * wall
    if card.real(5, card.real(2)) != card.real(2):
        reader.deck.notes.add("the tube tapers; the mean of its diameters is taken", card)
    J = math.pi / 32 * (outer**4 - inner**4)
    nsm = card.real(4) * reader.deck.mass_factor * units.mass_per_length
    return Profile(
        card, card.integer(1), rod(math.pi / 4 * (outer**2 - inner**2)), mass_per_length=nsm, torsion=J
    )


_READERS: dict[str, Callable[[Properties, Card], Profile]] = {
    "PBAR": _pbar,
    "PBARL": _pbarl,
    "PBEAM": _pbeam,
    "PBEAML": _pbeaml,
    "PROD": lambda reader, card: _rod(reader, card, card.integer(1), 2),
    "CONROD": lambda reader, card: _rod(reader, card, card.integer(3), 4),
    "PTUBE": _ptube,
}


# Sections of Nastran's property cards: constants of PBAR and PBEAM, shapes of PBARL and PBEAML --------------
# Nastran's element axes are x along the bar, y in plane 1 and z. Local z of a member, the direction of its
# section's height, is Nastran's y, and its local y is Nastran's -z: shapes look as the reference guide draws
# them.


NEGLIGIBLE: Final = 1e-6
"""Stand-in for a constant that a card gives as zero, relative to the others: beams need all [-]."""


def section_of_constants(
    label: str, A: float, moments: tuple[float, float, float], J: float, k: tuple[float, float]
) -> Section:
    """Return a section of Nastran's A, (I1, I2, I12), J and (K1, K2), in principal axes.

    I1 is the second moment for bending in plane 1, local x-z. A product I12 = ∫ y z dA of Nastran's axes is
    -I12 in local ones.

    Raises
    ------
    PropertyError
        For constants that no section has.
    """
    I1, I2, I12 = moments
    least = NEGLIGIBLE * max(I1, I2)
    if I12**2 > I1 * I2:
        refuse(f"section {label}: I12² = {I12**2:g} is above I1 I2 = {I1 * I2:g}", PropertyError)
    return of_constants(label, A, (I1, I2, -I12), max(J, NEGLIGIBLE * (I1 + I2)), k[::-1], least)


def _cross(arms: float, tw: float, h: float, th: float) -> Section:
    b = arms + tw
    if tw == th:
        return Section.cruciform(b, h, tw)
    check_fit(th < h, "the plates are thicker than the cross is high")
    outline, points, walls = cross_of_plates(b, h, tw, th)
    J = (h * tw**3 + arms * th**3) / 3
    return walled(f"cross {b:g} x {h:g} m", [outline], points, walls, [th, th, tw, tw], J)[0]


def _zee(flange: float, web: float, inner: float, h: float) -> Section:
    """Return a Z: the upper flange towards -y, the lower one towards +y."""
    t = (h - inner) / 2
    check_fit(t > 0, "the inner height is above the outer one")
    w, y, z = web / 2, web / 2 + flange, h / 2
    half = [(w, -z + t), (w, z), (-y, z), (-y, z - t)]
    outline = [*half, *((-p, -q) for p, q in half)]
    points = [(y, -z + t / 2), (0.0, -z + t / 2), (0.0, z - t / 2), (-y, z - t / 2)]
    J = (2 * flange * t**3 + h * web**3) / 3
    return walled(f"Z {h:g} m", [outline], points, [(0, 1), (1, 2), (2, 3)], [t, web, t], J)[0]


def _hat(h: float, t: float, top: float, brim: float) -> Section:
    """Return a hat of one thickness, its brims at the bottom."""
    check_fit(2 * t < min(h, top), "the walls of the hat fill it")
    y, b = top / 2, top / 2 + brim
    right = [(y - t, 0), (b, 0), (b, t), (y, t), (y, h)]
    inner = [(-(y - t), h - t), (y - t, h - t)]
    outline = [*inner, *right, *((-p, q) for p, q in reversed(right))]
    m, low, high = y - t / 2, t / 2, h - t / 2
    points = [(b, low), (m, low), (m, high), (-m, high), (-m, low), (-b, low)]
    return walled(f"hat {h:g} m", [outline], points, [(k, k + 1) for k in range(5)], [t] * 5)[0]


def _turn(section: Section, quarters: int) -> Section:
    return replace(section, angle=section.angle + quarters * math.pi / 2)


def _i(h: float, b1: float, b2: float, tw: float, t1: float, t2: float) -> Section:
    if b1 == b2 and t1 == t2:
        return Section.i_section(b1, h, t1, tw)
    return Section.unequal_i_section(b1, b2, h, t1, t2, tw)


def _circle(r: float) -> Section:
    """Return a circle with the shear coefficient that MSC Nastran lists for ROD, 0.9 for any material."""
    circle = Section.circle(2 * r)
    return Section(circle.A, circle.Iy, circle.Iz, circle.J, 0.9, 0.9, circle.outlines, label=circle.label)


SHAPES: Final[dict[str, tuple[int, Callable[..., Section]]]] = {
    "ROD": (1, _circle),
    "TUBE": (2, lambda r, ri: Section.tube(2 * r, r - ri) if ri else Section.circle(2 * r)),
    "TUBE2": (2, lambda r, t: Section.tube(2 * r, t)),
    "BAR": (2, Section.rectangle),
    "BOX": (4, lambda b, h, flat, side: box(b, h, (flat, side, flat, side), bredt=True)[0]),
    "BOX1": (6, lambda b, h, top, low, right, left: box(b, h, (low, right, top, left), bredt=True)[0]),
    "I": (6, _i),
    "I1": (4, lambda b, tw, inner, h: Section.i_section(b + tw, h, (h - inner) / 2, tw)),
    "H": (4, lambda gap, t2, h, tw: _turn(Section.i_section(h, gap + t2, t2 / 2, tw), 1)),
    "T": (4, Section.t_section),
    "T1": (4, lambda b, stem, tf, tw: _turn(Section.t_section(b, stem + tf, tf, tw), -1)),
    "T2": (4, lambda b, h, tf, tw: _turn(Section.t_section(b, h, tf, tw), 2)),
    "CHAN": (4, lambda b, h, tw, tf: Section.channel(b, h, tf, tw)),
    "CHAN1": (4, lambda b, tw, inner, h: Section.channel(b + tw, h, (h - inner) / 2, tw)),
    "CHAN2": (4, lambda tf, tw, b, h: _turn(Section.channel(b, h, tf, tw), 1)),
    "L": (4, lambda b, h, t, u: Section.angle_section(b, h, t) if t == u else angle(b, h, t, u)[0]),
    "CROSS": (4, _cross),
    "Z": (4, _zee),
    "HAT": (4, _hat),
}
"""Shapes of PBARL and PBEAML: the number of their dimensions, and the section of them."""


def section_of_shape(shape: str, dimensions: Sequence[float], nu: float) -> Section:
    """Return the section of a Nastran shape with its dimensions [m].

    Shear coefficients are those for Poisson's ratio nu; Nastran's are 0.9 for ROD and 5/6 for BAR.

    Raises
    ------
    PropertyError
        For shapes that are not in :data:`SHAPES`, and dimensions that do not fit.
    """
    if shape not in SHAPES:
        refuse(f"there is no section for the shape {shape}; there are {', '.join(SHAPES)}", PropertyError)
    if any(not d > 0 for d in dimensions) and shape != "TUBE":
        msg = f"the dimensions are {', '.join(f'{d:g}' for d in dimensions)}; they must be positive"
        raise PropertyError(msg)
    section = SHAPES[shape][1](*dimensions)
    if 0 < nu <= 0.5 and "nu" in section.dimensions and shape != "BAR":
        section = replace(
            Section.of_shape(section.shape, **{**section.dimensions, "nu": nu}), angle=section.angle
        )
    return section
