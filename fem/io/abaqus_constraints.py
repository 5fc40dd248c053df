"""Constraints of Abaqus' and CalculiX' decks: *MPC, *EQUATION, *COUPLING, *RIGID BODY."""

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from fem.io.abaqus_assembly import Instance
from fem.io.abaqus_content import (
    DIRECTIONS,
    Content,
    Placed,
    check,
    dofs_of,
    fault,
    lines_of,
    numbers_of,
    whole,
)
from fem.io.abaqus_deck import Block, name_of
from fem.io.abaqus_systems import Systems
from fem.io.faults import error_at
from fem.io.frame_deck import Equation, Link
from fem.mesh import MeshError

Floats = NDArray[np.float64]
Term = tuple[int, str, float]

SMALL = 1e-12
"""Coefficient, relative to the largest of an equation, that counts as zero."""


@dataclass(slots=True)
class ConstraintBuilder:
    """Links and equations as they are read."""

    content: Content
    systems: Systems
    links: list[Link] = field(default_factory=list)
    equations: list[Equation] = field(default_factory=list)

    def build(self) -> tuple[tuple[Link, ...], tuple[Equation, ...]]:
        """Return links and equations.

        Raises
        ------
        MeshError
            For constraints that are not read, and nodes that are not there.
        """
        readers = {
            "MPC": self._mpc,
            "EQUATION": self._equation,
            "COUPLING": self._coupling,
            "KINEMATICCOUPLING": self._kinematic,
            "RIGIDBODY": self._rigid_body,
        }
        for placed, instance in self.content.model_data(*readers):
            readers[placed.keyword](placed, instance)
        return tuple(self.links), tuple(self.equations)

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
        if kind == "BEAM" or (kind != "LINK" and near):
            directions = DIRECTIONS[:3] if kind == "PIN" else DIRECTIONS
            self.links.append(Link(name=name, node=b, dependents=(a,), directions=directions))
        elif kind == "LINK":
            if near:
                raise error_at(place, "*MPC LINK joins nodes at one place; write PIN")
            along = self.content.points[b] - self.content.points[a]
            along = along / np.linalg.norm(along)
            self._add(
                name, [(n, d, s * along[k]) for n, s in ((a, 1.0), (b, -1.0)) for k, d in enumerate("xyz")]
            )
        else:  # equal motions of nodes apart, without an arm
            for d in DIRECTIONS[:3] if kind == "PIN" else DIRECTIONS:
                self._add(name, [(a, d, 1.0), (b, d, -1.0)])

    def _add(self, name: str, terms: Iterable[Term]) -> None:
        """Add an equation; terms of one degree of freedom are summed, those of rounding size left out."""
        total: dict[tuple[int, str], float] = {}
        for node, direction, value in terms:
            total[node, direction] = total.get((node, direction), 0.0) + float(value)
        largest = max(map(abs, total.values()), default=0.0)
        kept = tuple((n, d, c) for (n, d), c in total.items() if abs(c) > SMALL * largest)
        if kept:
            self.equations.append(Equation(name=name, terms=kept))

    def _equation(self, placed: Placed, instance: Instance) -> None:
        block = placed.block
        check(block)
        rows = lines_of(block)
        k = 0
        while k < len(rows):
            place, cells = rows[k]
            count = whole(block, place, cells[0], "the number of terms")
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

    def _one_equation(self, block: Block, place: str, instance: Instance, terms: list[list[str]]) -> None:
        sets: list[list[int]] = []
        factors: list[tuple[int, float]] = []
        for label, dof, value in terms:
            sets.append(self.content.rows("NSET", name_of(label), instance.name, f"{place}: *EQUATION"))
            d = whole(block, place, dof, "degrees of freedom") - 1
            if not 0 <= d < 6:
                raise fault(block, f"has the degree of freedom {d + 1}; 1 to 6 are allowed", place)
            coefficient = numbers_of(block, place, [value], 1, 1, "coefficients")[0]
            # in the deck's units: Σ c u = 0 holds for lengths in metres if rotations get the unit of length
            factors.append((d, coefficient * (self.content.units.length if d > 2 else 1.0)))
        most = max(map(len, sets))
        if any(len(found) not in (1, most) for found in sets):
            counts = ", ".join(str(len(nodes)) for nodes in sets)
            raise fault(block, f"has sets of {counts} nodes; give sets of equal numbers", place)
        for j in range(most):
            found: list[Term] = []
            for nodes, (d, c) in zip(sets, factors, strict=True):
                found += self._along(nodes[j if len(nodes) > 1 else 0], d, c)
            self._add(f"EQUATION ({place})", found)

    def _along(self, node: int, d: int, c: float) -> list[Term]:
        """Return the terms of a degree of freedom along the node's axes in global directions."""
        axes, start = self.systems.nodal.get(node), 3 * (d // 3)
        if axes is None:
            return [(node, DIRECTIONS[d], c)]
        return [(node, DIRECTIONS[start + k], c * float(axes[d - start, k])) for k in range(3)]

    # Rigid regions ------------------------------------------------------------------------------------------

    def _follow(self, name: str, node: int, dependents: list[int], dofs: set[int], axes: Floats) -> None:
        """Let nodes follow another as a rigid body in some directions of axes."""
        others = [row for row in dependents if row != node]
        skew = not np.allclose(axes, np.eye(3), rtol=0, atol=1e-12)
        groups = [{start, start + 1, start + 2} for start in (0, 3)]
        if not others or not dofs:
            return
        if not skew or all(not dofs & group or group <= dofs for group in groups):
            directions = tuple(DIRECTIONS[d] for d in sorted(dofs))
            self.links.append(Link(name=name, node=node, dependents=tuple(others), directions=directions))
            return
        for row in others:
            arm = self.content.points[row] - self.content.points[node]
            for d in sorted(dofs):
                axis, start = axes[d % 3], 3 * (d // 3)
                terms = [
                    (n, DIRECTIONS[start + k], s * axis[k])
                    for n, s in ((row, 1.0), (node, -1.0))
                    for k in range(3)
                ]
                if d < 3:  # a · (u - u0 - θ x r) = 0, and a · (θ x r) = θ · (r x a)
                    turn = np.cross(arm, axis)
                    terms += [(node, DIRECTIONS[3 + k], -turn[k]) for k in range(3)]
                self._add(name, terms)

    def _reference(self, placed: Placed, instance: Instance) -> int:
        block = placed.block
        label = block.option("REFNODE", "REF NODE=")
        return self.content.node(label, instance.name, f"{block.place}: *{block.name}")

    def _coupling(self, placed: Placed, instance: Instance) -> None:
        block = placed.block
        check(block, "CONSTRAINTNAME", "REFNODE", "SURFACE", "ORIENTATION")
        node = self._reference(placed, instance)
        members = self._surface(placed, instance)
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

    def _surface(self, placed: Placed, instance: Instance) -> list[tuple[int, float]]:
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
        block: Block,
        name: str,
        node: int,
        members: list[tuple[int, float]],
        rotations: set[int],
        axes: Floats,
    ) -> None:
        """Let a node follow the weighted mean motion of others: u = ū + θ x r, θ = T⁻¹ Σ w r x u."""
        check(block, "COUPLING", "WEIGHTINGMETHOD")
        w = np.array([weight for _, weight in members])
        if block.options.get("WEIGHTINGMETHOD", "UNIFORM").upper() != "UNIFORM" or not (w > 0).all():
            raise fault(block, "has weights that are not UNIFORM and positive, which are not read")
        w = w / w.sum()
        rows = [row for row, _ in members]
        centre = w @ self.content.points[rows]
        arms, arm = self.content.points[rows] - centre, self.content.points[node] - centre
        mean = np.kron(w, np.eye(3))
        turn = np.zeros((3, mean.shape[1]))
        if rotations or np.linalg.norm(arm) > 1e-9 * self.content.size:
            T = (w * (arms**2).sum(axis=1)).sum() * np.eye(3) - (arms.T * w) @ arms
            if np.linalg.matrix_rank(T, tol=1e-12 * self.content.size**2) < 3:
                raise fault(block, ": the nodes lie on one line, about which they have no mean rotation")
            turn = np.linalg.solve(T, np.hstack([c * _cross_matrix(a) for c, a in zip(w, arms, strict=True)]))
        for d in (0, 1, 2, *sorted(rotations)):
            axis, start = axes[d % 3], 3 * (d // 3)
            given = axis @ (turn if start else mean - _cross_matrix(arm) @ turn)
            terms = [(node, DIRECTIONS[start + k], float(axis[k])) for k in range(3)]
            terms += [(rows[j // 3], DIRECTIONS[j % 3], -float(c)) for j, c in enumerate(given)]
            self._add(name, terms)

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


def _cross_matrix(arm: Floats) -> Floats:
    """Return R with R u = arm x u."""
    x, y, z = arm
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
