"""Frame3DD's examples: their models and printed numbers lie in frame3dd/ as JSON.

Frame3DD of version 20140514+, H. P. Gavin, https://github.com/hpgavin/frame3dd. Units are those of the
examples: kip and inch, or N, mm and t. Rows of ``members`` are both nodes and the row of ``sections``. The
columns of these are A, two shear areas, J, Iy, Iz, E, G and the density.
"""

import json
from collections.abc import Iterator
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.book.entry import Problem, Quantity
from fem import (
    DIRECTIONS,
    AddedMass,
    Frame,
    InitialStrain,
    LineLoad,
    LoadCase,
    Material,
    MemberForce,
    MemberProperties,
    Mesh,
    Model,
    Section,
    StaticSolution,
    Support,
    assemble,
    solve_modes,
    solve_static,
)

DATA = Path(__file__).with_suffix("")

TWIST = "its geometric stiffness has N J/A about the axis, Dovetail's N (Iy + Iz)/A"
SHEAR = "its mass matrix leaves out the shear deformation"
TURNING = f"{SHEAR}; N J/A as above"


@cache
def example(letter: str) -> dict[str, Any]:
    """Return the data of an example."""
    return json.loads((DATA / f"ex{letter}.json").read_text(encoding="utf-8"))


def model_of(data: dict[str, Any], *, masses: bool = False) -> Model:
    """Return the model of an example; its masses feel no gravity there, and are left out of statics."""
    points = np.array(data["nodes"], dtype=float)
    lines = [(a - 1, b - 1) for a, b, _ in data["members"]]
    names = {f"m{k + 1}": [k] for k in range(len(lines))}
    kinds = [_properties(row, data) for row in data["sections"]]
    members = {}
    for name, (a, b), (_, _, row) in zip(names, lines, data["members"], strict=True):
        axis = points[b] - points[a]
        upright = np.hypot(*axis[:2]) < 1e-9 * np.linalg.norm(axis)
        up = np.array([-np.sign(axis[2]), 0, 0]) if upright else np.array([0, 0, 1.0])
        radii = [data["radii"][k] for k in (a, b)] if "radii" in data else [0.0, 0.0]
        members[name] = replace(kinds[row], orientation=up, rigid1=radii[0], rigid2=radii[1])
    effects = [Frame(members=members)]
    for node, flags in data["supports"]:
        fixed = tuple(d for d, flag in zip(DIRECTIONS, flags, strict=True) if flag == "1")
        effects.append(Support(name=str(node), point=node - 1, fixed=fixed))
    if masses:
        effects += _masses(data)
    return Model(Mesh.from_lines(points, lines, names), tuple(effects))


def _properties(row: list[float], data: dict[str, Any]) -> MemberProperties:
    """Return a member's properties with any E/G: G = E/2, and J and shear areas times 2G/E."""
    A, Ay, Az, J, Iy, Iz, E, G, density = row
    ratio = 2 * G / E
    section = Section(A, Iy, Iz, J * ratio, ky=Ay / A * ratio, kz=Az / A * ratio, Ip=J)
    theory = "timoshenko" if data["shear"] else "euler-bernoulli"
    material = Material(f"{E:g}, {density:g}", E, density or 1e-30, nu=0.0)
    return MemberProperties(material, section, theory=theory)


def _masses(data: dict[str, Any]) -> Iterator[AddedMass]:
    for k, (node, mass, *inertia) in enumerate(data.get("masses", ())):
        yield AddedMass(name=f"mass {k}", point=node - 1, mass=mass, inertia=np.diag(inertia))
    for k, (member, mass) in enumerate(data.get("member_masses", ())):
        for end in (0, 1):  # half of a member's extra mass is at either node
            point = data["members"][member - 1][end] - 1
            yield AddedMass(name=f"extra {k} {end}", point=point, mass=mass / 2)


def load_case(data: dict[str, Any], k: int) -> LoadCase:
    """Return a load case of an example."""
    case = data["cases"][k]
    points, supports = {}, {}
    for node, *values in case.get("point_loads", ()):
        points |= {(node - 1, d): v for d, v in zip(DIRECTIONS, values, strict=True) if v}
    for node, *values in case.get("settlements", ()):
        supports |= {(str(node), d): v for d, v in zip(DIRECTIONS, values, strict=True) if v}
    members: list[Any] = [
        LineLoad(member=f"m{m}", force1=force, axes="local") for m, *force in case.get("uniform", ())
    ]
    for m, axis, start, stop, first, second in case.get("trapezoids", ()):
        along = np.eye(3)[axis]
        members.append(
            LineLoad(
                member=f"m{m}",
                force1=first * along,
                force2=second * along,
                start=start,
                stop=stop,
                axes="local",
            )
        )
    members += [
        MemberForce(member=f"m{m}", position=x, force=force, axes="local")
        for m, *force, x in case.get("forces", ())
    ]
    for m, expansion, width, height, *faces in case.get("temperatures", ()):
        gradients = (faces[0] - faces[1]) / width, (faces[2] - faces[3]) / height
        members.append(InitialStrain.thermal(f"m{m}", expansion, sum(faces) / 4, *gradients))
    return LoadCase(points=points, members=tuple(members), gravity=case["gravity"], displacements=supports)


@cache
def solved(letter: str, k: int) -> StaticSolution:
    """Return the response to a case, with the geometric stiffness of axial forces if the example has it."""
    data = example(letter)
    model, case = model_of(data), load_case(data, k)
    found = solve_static(assemble(model, reciprocal=False), case)
    if not data["geometric"]:
        return found
    for _ in range(200):  # Frame3DD takes the axial force at the first end of each member
        tension = found.line_forces[:, 0, 0, 0]
        frame = model.of_kind(Frame)[0]
        members = {
            name: replace(p, pretension=float(N))
            for (name, p), N in zip(frame.members.items(), tension, strict=True)
        }
        model = Model(model.mesh, (Frame(members=members), *model.effects[1:]))
        new = solve_static(assemble(model, reciprocal=False), case)
        change = np.abs(new.displacements - found.displacements).max()
        found = new
        if change < 1e-8 * np.abs(new.displacements).max():
            return found
    msg = f"example {letter}: the axial forces do not converge"
    raise AssertionError(msg)


def frequencies(letter: str, n: int) -> np.ndarray:
    """Return the lowest natural frequencies, with the axial forces of the last load case."""
    data = example(letter)
    loaded = solved(letter, len(data["cases"]) - 1).model
    model = Model(loaded.mesh, (*loaded.effects, *_masses(data)))
    return solve_modes(assemble(model), n).frequency[:n]


def _computed(letter: str) -> Iterator[np.ndarray]:
    data = example(letter)
    for k, case in enumerate(data["cases"]):
        found = solved(letter, k)
        u = found.displacements[:, 0].reshape(-1, 6)
        yield u[[int(node) - 1 for node in case["printed_displacements"]]]
        yield np.array(
            [
                [found.reactions.get((node, d), [0.0])[0] for d in DIRECTIONS]
                for node in case["printed_reactions"]
            ]
        )
    if "printed_frequencies" in data:
        yield frequencies(letter, len(data["printed_frequencies"].split()))


def _quantities(letter: str, loads: float, modes: float) -> Iterator[Quantity]:
    """Yield the quantities of an example; allowances are those of TWIST and TURNING."""
    data = example(letter)
    length, force = ("mm, rad", "N, N·mm") if letter in "BF" else ("in, rad", "kip, kip·in")
    for k, case in enumerate(data["cases"]):
        which = f", case {k + 1}" if len(data["cases"]) > 1 else ""
        more = {"allowance": loads, "reason": TWIST} if loads else {}
        for name, unit in (("displacements", length), ("reactions", force)):
            printed = " ".join(case[f"printed_{name}"].values())
            yield Quantity(name=name + which, unit=unit, printed=printed, **more)
    if "printed_frequencies" in data:
        printed = data["printed_frequencies"]
        yield Quantity(name="frequencies", unit="Hz", printed=printed, allowance=modes, reason=TURNING)


def _problem(letter: str, title: str, loads: float = 0.0, modes: float = 0.0) -> Problem:
    return Problem(
        name=f"Frame3DD {letter}",
        title=title,
        quantities=tuple(_quantities(letter, loads, modes)),
        compute=lambda: list(_computed(letter)),
    )


def moment_of_reactions(letter: str) -> float:
    """Return the moment about the global x axis of the reactions that an example prints."""
    data, total = example(letter), 0.0
    for node, words in data["cases"][0]["printed_reactions"].items():
        values = np.array([float(word) for word in words.split()])
        total += values[3] + np.cross(data["nodes"][int(node) - 1], values[:3])[0]
    return total


def moment_of_loads(letter: str) -> float:
    """Return the moment about the global x axis that holds the loads on the structure at rest."""
    data = example(letter)
    case = data["cases"][0]
    total = 0.0
    for node, *values in case["point_loads"]:
        total += values[3] + np.cross(data["nodes"][node - 1], values[:3])[0]
    for a, b, row in data["members"]:
        ends = np.array([data["nodes"][a - 1], data["nodes"][b - 1]], dtype=float)
        mass = data["sections"][row][0] * data["sections"][row][-1] * np.linalg.norm(ends[1] - ends[0])
        total += np.cross(ends.mean(axis=0), mass * np.array(case["gravity"]))[0]
    return -total


def _own_moment(letter: str) -> float:
    """Return the moment about the global x axis of Dovetail's reactions, of first order."""
    data = example(letter)
    model = model_of(data)
    found = solve_static(assemble(model, reciprocal=False), load_case(data, 0))
    total = 0.0
    for (node, d), (value,) in found.reactions.items():
        vector = np.eye(6)[DIRECTIONS.index(d)] * value
        total += vector[3] + np.cross(model.mesh.points[int(node) - 1], vector[:3])[0]
    return total


PROBLEMS = (
    _problem("A", "plane truss, settlements and temperatures"),
    _problem("B", "pyramid under points, trapezoids, temperature and member forces", 1.4e-7, 4e-5),
    _problem("C", "long tetrahedral frame", 1.1e-5, 1.5e-3),
    _problem("E", "platform on three slender columns", 5e-6, 2e-5),
    Problem(
        name="Frame3DD F",
        title="building on isolators",
        quantities=(
            Quantity(
                name="moment of the reactions about x",
                unit="N·mm",
                printed=f"{moment_of_reactions('F'):.0f}",
                exact=partial(moment_of_loads, "F"),
                proof=(
                    "the printed reactions miss 4.5 % of the moment of the loads, and the sway of the "
                    "weights would raise it: node radii shorten members without rigid arms"
                ),
            ),
        ),
        compute=lambda: [_own_moment("F")],
    ),
    _problem("G", "building with a set-back", 1e-6, 1.6e-4),
    _problem("H", "pedestrian ramp", 1.3e-5, 5e-4),
    _problem("I", "triangular tower", 8e-6, 2.5e-4),
)
