"""Constraints of Abaqus' and CalculiX' decks: *MPC, *EQUATION, *COUPLING, *RIGID BODY."""

from dataclasses import dataclass, field

import numpy as np

from fem.array_types import Floats
from fem.io.abaqus_assembly import Instance
from fem.io.abaqus_content import Content, Placed, check, dofs_of, lines_of, numbers_of, read_integer
from fem.io.abaqus_deck import AbaqusBlock, fault, name_of
from fem.io.abaqus_systems import AbaqusSystems
from fem.io.faults import error_at
from fem.io.frame_deck import Constraints, Equation, Link
from fem.mesh import MeshError


@dataclass(slots=True)
class ConstraintBuilder:
    """Reads constraints."""

    content: Content
    systems: AbaqusSystems
    found: Constraints = field(init=False)

    def __post_init__(self) -> None:
        self.found = Constraints(self.content.points, self.systems.axes)

    def build(self) -> tuple[tuple[Link, ...], tuple[Equation, ...]]:
        """Return links and equations."""
        readers = {
            "MPC": self._mpc,
            "EQUATION": self._equation,
            "COUPLING": self._coupling,
            "KINEMATICCOUPLING": self._kinematic,
            "RIGIDBODY": self._rigid_body,
        }
        for placed, instance in self.content.model_data(*readers):
            readers[placed.keyword](placed, instance)
        return tuple(self.found.links), tuple(self.found.equations)

    # Multi-point constraints --------------------------------------------------------------------------------

    def _mpc(self, placed: Placed, instance: Instance) -> None:
        check(placed.block)
        for place, cells in lines_of(placed.block):
            kind, *labels = (cell.upper() if k == 0 else name_of(cell) for k, cell in enumerate(cells))
            if kind not in ("BEAM", "PIN", "TIE", "LINK") or len(labels) != 2:
                words = (
                    f"{kind[:20]} with {len(labels)} nodes is not read, but BEAM, PIN, TIE and LINK with two"
                )
                raise fault(placed.block, words, place)
            sets = [self.content.rows("NSET", label, instance.name, f"{place}: *MPC") for label in labels]
            if len(sets[1]) == 1:
                sets[1] *= len(sets[0])
            if len(sets[0]) != len(sets[1]):
                words = f"{kind} joins sets of {len(sets[0])} and {len(sets[1])} nodes"
                raise fault(placed.block, words, place)
            for a, b in zip(*sets, strict=True):
                self._joined(kind, a, b, place)

    def _joined(self, kind: str, a: int, b: int, place: str) -> None:
        name = f"MPC {kind} ({place})"
        near = self.content.near(a, b)
        components = range(3 if kind == "PIN" else 6)
        if kind == "LINK":
            if near:
                raise error_at(place, "*MPC LINK joins nodes at one place; write PIN")
            self.found.keep_distance(name, a, b)
        elif kind == "BEAM" or near:
            self.found.follow(name, b, [a], components, np.eye(3))
        else:  # equal motions of nodes apart, without an arm
            for row in np.eye(6)[components]:
                self.found.equate(name, [(a, row), (b, -row)])

    def _equation(self, placed: Placed, instance: Instance) -> None:
        block = placed.block
        check(block)
        rows = lines_of(block)
        k = 0
        while k < len(rows):
            place, cells = rows[k]
            count = read_integer(block, place, cells[0], "the number of terms")
            given: list[str] = []
            k += 1
            while k < len(rows) and len(given) < 3 * count:
                given += rows[k][1]
                k += 1
            if count < 1 or len(given) != 3 * count:
                words = (
                    f"of {count} terms has {len(given)} cells after it; each has node, dof and coefficient"
                )
                raise fault(block, words, place)
            self._one_equation(block, place, instance, [given[3 * j : 3 * j + 3] for j in range(count)])

    def _one_equation(
        self, block: AbaqusBlock, place: str, instance: Instance, terms: list[list[str]]
    ) -> None:
        sets: list[list[int]] = []
        factors: list[tuple[int, float]] = []
        for label, dof, value in terms:
            sets.append(self.content.rows("NSET", name_of(label), instance.name, f"{place}: *EQUATION"))
            d = read_integer(block, place, dof, "degrees of freedom") - 1
            if not 0 <= d < 6:
                raise fault(block, f"has the degree of freedom {d + 1}; 1 to 6 are allowed", place)
            coefficient = numbers_of(block, place, [value], 1, 1, "coefficients")[0]
            factors.append((d, coefficient))
        scale = self.content.units.of_motions
        most = max(map(len, sets))
        if any(len(found) not in (1, most) for found in sets):
            counts = ", ".join(str(len(nodes)) for nodes in sets)
            raise fault(block, f"has sets of {counts} nodes; give sets of equal numbers", place)
        for j in range(most):
            rows = [nodes[j if len(nodes) > 1 else 0] for nodes in sets]
            motions = [
                (row, c * self.found.motion(row, d)) for row, (d, c) in zip(rows, factors, strict=True)
            ]
            self.found.equate(f"EQUATION ({place})", [(row, scale * v) for row, v in motions])

    # Rigid regions ------------------------------------------------------------------------------------------

    def _follow(self, name: str, node: int, dependents: list[int], dofs: set[int], axes: Floats) -> None:
        """Let nodes follow another as a rigid body in some directions of axes."""
        self.found.follow(name, node, [row for row in dependents if row != node], dofs, axes)

    def _reference(self, placed: Placed, instance: Instance) -> int:
        block = placed.block
        label = block.option("REFNODE", "REF NODE=")
        return self.content.node(label, instance.name, f"{block.place}: *{block.name}")

    def _coupling(self, placed: Placed, instance: Instance) -> None:
        block = placed.block
        check(block, "CONSTRAINTNAME", "REFNODE", "SURFACE", "ORIENTATION")
        node = self._reference(placed, instance)
        members = self._surface(placed)
        axes = self.systems.orientation(placed, instance)
        name = f"COUPLING {block.options.get('CONSTRAINTNAME', '') or f'({block.place})'}"
        for keyword, sub in placed.subs.items():
            dofs = {d for place, cells in lines_of(sub) for d in dofs_of(sub, place, cells)}
            dofs = dofs or set(range(6))
            if keyword == "KINEMATIC":
                self._follow(name, node, [row for row, _ in members], dofs, axes)
            else:
                self._distribute(sub, name, node, members, dofs & {3, 4, 5}, axes)
        if not placed.subs:
            raise fault(block, "is followed by neither *KINEMATIC nor *DISTRIBUTING")

    def _surface(self, placed: Placed) -> list[tuple[int, float]]:
        """Return the nodes of the surface of nodes that a coupling names, with their weights."""
        block = placed.block
        name = block.option("SURFACE", "SURFACE=")
        for other, owner in self.content.model_data("SURFACE"):
            if other.block.options.get("NAME") != name:
                continue
            if other.block.options.get("TYPE", "ELEMENT").upper() != "NODE":
                msg = f"{other.block.place}: *SURFACE {name} is of elements; the coupling needs TYPE=NODE"
                raise MeshError(msg)
            found: list[tuple[int, float]] = []
            for place, cells in lines_of(other.block):
                weight = numbers_of(other.block, place, cells[1:2], 1, 1, "areas")[0] if cells[1:2] else 1.0
                where = f"{place}: *SURFACE"
                rows = self.content.rows("NSET", name_of(cells[0]), owner.name, where)
                found += [(row, weight) for row in rows]
            return found
        raise fault(block, f"refers to the surface {name[:60]}, which the file does not have")

    def _distribute(
        self,
        block: AbaqusBlock,
        name: str,
        node: int,
        members: list[tuple[int, float]],
        rotations: set[int],
        axes: Floats,
    ) -> None:
        """Let a node follow the weighted mean motion of others."""
        check(block, "COUPLING", "WEIGHTINGMETHOD")
        uniform = block.options.get("WEIGHTINGMETHOD", "UNIFORM").upper() == "UNIFORM"
        if not uniform or any(not weight > 0 for _, weight in members):
            raise fault(block, "has weights that are not UNIFORM and positive, which are not read")
        rows = [(row, c, weight) for row, weight in members for c in range(3)]
        if self.found.average(name, node, (0, 1, 2, *sorted(rotations)), rows, axes) is not None:
            raise fault(block, ": the nodes lie on one line, about which they have no mean rotation")

    def _kinematic(self, placed: Placed, instance: Instance) -> None:
        block = placed.block
        check(block, "REFNODE", "ORIENTATION")
        node = self._reference(placed, instance)
        axes = self.systems.orientation(placed, instance)
        for place, cells in lines_of(block):
            rows = self.content.rows("NSET", name_of(cells[0]), instance.name, f"{place}: *{block.name}")
            dofs = set(dofs_of(block, place, cells[1:]))
            self._follow(f"KINEMATIC COUPLING ({place})", node, rows, dofs, axes)

    def _rigid_body(self, placed: Placed, instance: Instance) -> None:
        block = placed.block
        check(block, "REFNODE", "NSET", "ELSET", "PINNSET", "TIENSET", "POSITION", "ROTNODE", "ISOTHERMAL")
        if block.options.get("POSITION", "INPUT").upper() != "INPUT":
            raise fault(block, "moves its node to the centre of mass; give POSITION=INPUT")
        where = f"{block.place}: *{block.name}"
        node = self._reference(placed, instance)
        found: dict[str, list[int]] = {}
        for key in ("NSET", "TIENSET", "PINNSET"):
            if key in block.options:
                found[key] = self.content.rows("NSET", block.options[key], instance.name, where)
        if "ELSET" in block.options:
            elements = self.content.rows("ELSET", block.options["ELSET"], instance.name, where)
            found["ELSET"] = sorted({n for row in elements for n in self.content.nodes_of(row)})
        if not found:
            raise fault(block, "has no nodes; give NSET=, ELSET=, PIN NSET= or TIE NSET=")
        pinned = set(found.pop("PINNSET", []))
        tied = [row for rows in found.values() for row in rows if row not in pinned]
        name = f"RIGID BODY ({block.place})"
        self._follow(name, node, list(dict.fromkeys(tied)), set(range(6)), np.eye(3))
        self._follow(name, node, sorted(pinned), {0, 1, 2}, np.eye(3))
