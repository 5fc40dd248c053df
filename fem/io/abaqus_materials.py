"""Materials of Abaqus' and CalculiX' decks: isotropic elasticity, density and damping."""

from dataclasses import dataclass, field

from fem.io.abaqus_content import Content, check, data, lines_of
from fem.io.abaqus_deck import AbaqusBlock, fault
from fem.io.deck import named, real
from fem.materials import Material, PropertyError, negligible_density
from fem.model import Damping


@dataclass(slots=True)
class Materials:
    """The materials of a deck by name; each is read when a section asks for it.

    Attributes
    ----------
    rayleigh : dict of str to (float, float), alpha and beta of the materials that were asked for [1/s, s]
    """

    content: Content
    rayleigh: dict[str, tuple[float, float]] = field(default_factory=dict)
    _blocks: dict[str, tuple[AbaqusBlock, dict[str, AbaqusBlock]]] = field(default_factory=dict)
    _noted: set[str] = field(default_factory=set)

    def __post_init__(self) -> None:
        for placed in self.content.placed:
            if placed.keyword == "MATERIAL" and not placed.step:
                name = placed.block.option("NAME", "NAME=")
                if name in self._blocks:
                    raise fault(
                        placed.block, f"{name} comes a second time, after {self._blocks[name][0].place}"
                    )
                self._blocks[name] = (placed.block, placed.subs)

    def find(self, name: str, user: AbaqusBlock, density: float | None = None) -> Material:
        """Return a material, with a density that the section gives instead [kg/m³]."""
        if name not in self._blocks:
            has = named(sorted(self._blocks)) or "none"
            raise fault(
                user, f"refers to the material {name[:60]}, which the file does not have; it has {has}"
            )
        block, subs = self._blocks[name]
        units = self.content.units
        elastic = self._of(block, subs, "ELASTIC")
        if elastic.options.get("TYPE", "ISOTROPIC") not in ("ISO", "ISOTROPIC"):
            kind = elastic.options["TYPE"]
            raise fault(elastic, f"of {name[:60]} is of type {kind[:40]}; only ISOTROPIC is read")
        E, *given = self._first(elastic, 1, 2, "Young's modulus and Poisson's ratio")
        if not given:
            self._note(f"*ELASTIC ({elastic.place}) has no Poisson's ratio; 0 is taken, as Abaqus does")
        nu = given[0] if given else 0.0
        if density is None and "DENSITY" in subs:
            density = self._first(subs["DENSITY"], 1, 1, "a density")[0] * units.density
        density = density or self.negligible(f"*MATERIAL {name[:60]} ({block.place})", E * units.stress)
        loss = self._damping(name, subs.get("DAMPING"))
        try:
            return Material(name, E * units.stress, density, nu, loss)
        except PropertyError as reason:
            raise fault(user, f": {reason}") from reason

    def _of(self, block: AbaqusBlock, subs: dict[str, AbaqusBlock], keyword: str) -> AbaqusBlock:
        if keyword not in subs:
            raise fault(block, f"{block.options['NAME']} has no *{keyword}, which natural frequencies need")
        return subs[keyword]

    def negligible(self, what: str, E: float) -> float:
        """Return a density for what has none, and note it."""
        self._note(f"{what} has no density; a negligible one is taken")
        return negligible_density(E)

    def _note(self, sentence: str) -> None:
        if sentence not in self.content.notes:
            self.content.notes.append(sentence)

    def _first(self, block: AbaqusBlock, least: int, count: int, what: str) -> list[float]:
        """Return the first numbers of the first line: later ones depend on temperature or the like."""
        if len(lines_of(block)) > 1 and block.place not in self._noted:
            self._noted.add(block.place)
            self.content.notes.append(
                f"*{block.name} at line {block.line} has several lines; the first is taken"
            )
        return data(block, 0, least, count, what, count)

    def _damping(self, name: str, block: AbaqusBlock | None) -> float:
        if block is None:
            self.rayleigh[name] = (0.0, 0.0)
            return 0.0
        check(block, "ALPHA", "BETA", "STRUCTURAL", "COMPOSITE")
        alpha, beta, loss = damping_of(block)
        self.rayleigh[name] = (alpha / self.content.units.time, beta * self.content.units.time)
        if "COMPOSITE" in block.options:
            self.content.notes.append(
                f"*DAMPING, COMPOSITE at line {block.line} is left out; give the damping"
            )
        return loss

    def of_structure(self) -> Damping | None:
        """Return the damping that all materials share, or that *GLOBAL DAMPING gives."""
        found: Damping | None = None
        for placed, _ in self.content.model_data("GLOBALDAMPING"):
            alpha, beta, loss = damping_of(placed.block)
            time = self.content.units.time
            found = Damping(alpha=alpha / time, beta=beta * time, loss_factor=loss)
        pairs = set(self.rayleigh.values())
        if found is not None or pairs <= {(0.0, 0.0)}:
            return found
        if len(pairs) > 1:
            self.content.notes.append(
                "*DAMPING: ALPHA and BETA differ between materials and are left out; give the damping in the "
                "study file"
            )
            return None
        self.content.notes.append("*DAMPING: ALPHA and BETA also damp springs and masses of the model")
        return Damping.rayleigh(*pairs.pop())


def damping_of(block: AbaqusBlock) -> tuple[float, float, float]:
    """Return ALPHA, BETA and STRUCTURAL of a block."""
    try:
        alpha, beta, loss = (real(block.options.get(key, "")) for key in ("ALPHA", "BETA", "STRUCTURAL"))
    except ValueError as reason:
        raise fault(block, f"cannot be read: {reason}") from reason
    if min(alpha, beta, loss) < 0:
        raise fault(block, "has a negative number; damping is 0 or more")
    return alpha, beta, loss
