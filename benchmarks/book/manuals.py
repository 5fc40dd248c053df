"""Static and modal problems of the verification manuals of ANSYS and SAP2000.

Inputs and target values of ANSYS are those of https://github.com/ansys/pymapdl-examples, folder verif-manual;
those of SAP2000 of https://github.com/OpenSees/OpenSees, folder EXAMPLES/verification. Units are lb and inch,
kip and inch, or kip and ft, with seconds.
"""

import numpy as np

from benchmarks.book.entry import Problem, Quantity
from fem import (
    Frame,
    Joint,
    LineLoad,
    LoadCase,
    Material,
    MemberProperties,
    Mesh,
    Model,
    MultiPointConstraint,
    Section,
    assemble,
    section_stresses,
    solve_modes,
    solve_second_order,
    solve_static,
)
from tests.frames import beam, fix, planar

STEEL = Material("steel", 30e6, 7.3e-4, nu=0.3)
"""[psi, lb·s²/in⁴]"""


def _stresses(model, case):
    """Return the stresses at the first end of a beam."""
    found = solve_static(assemble(model), case)
    forces = found.internal_forces("beam", [0.0])
    return section_stresses(model.effect("frame").members["beam"], np.zeros(1), forces)


def _vm10():
    """Return the stresses of a T-beam whose flange is in tension."""
    section = Section.t_section(9.0, 20.0, 4.0, 1.5)
    found = _stresses(beam(1, 100.0, effects=(fix(0),), section=section, material=STEEL), {(1, "ry"): 1e5})
    return [[found.high[0, 0], found.low[0, 0]]]


def _vm12():
    """Return the largest principal and shear stress, of the normal and the von Mises stress."""
    model = beam(
        1, 300.0, effects=(fix(0),), section=Section.circle(4.67017), material=STEEL, along=(0, 0, 1.0)
    )
    found = _stresses(model, {(1, "x"): -250.0, (1, "rz"): 9000.0})
    sigma, equivalent = found.high[0, 0], found.von_mises[0, 0]
    shear = np.sqrt((sigma / 2) ** 2 + (equivalent**2 - sigma**2) / 3)
    return [[sigma / 2 + shear], [shear]]


def _vm21():
    """Return deflection, slope and moment of half a tie rod, with its tension and without."""
    ends = (fix(0, ("z",)), fix(1, ("x", "ry")))
    section = Section.rectangle(2.5, 2.5)
    model = planar(beam(16, 100.0, effects=ends, section=section, material=STEEL), ("x", "z", "ry"))
    load = LineLoad(member="beam", force1=[0, 0, -1.79253])
    pulled = LoadCase(name="pulled", members=(load,), points={(0, "x"): -21972.6})
    free = LoadCase(name="free", members=(load,))
    out = []
    for found in (solve_second_order(model, pulled).solution, solve_static(assemble(model), free)):
        u = found.displacements[:, 0]
        out += [[u[6 + 2]], [u[4]], [-abs(found.reactions["support1", "ry"][0])]]
    return out


def _grid(heights, width, n_bays, properties, **more):
    """Return a plane frame of rectangular bays, clamped at the feet.

    ``properties(kind, bay, floor)`` are those of the column or beam.
    """
    z = np.concatenate([[0.0], np.cumsum(heights)])
    n = n_bays + 1
    points = [[width * i, 0.0, h] for h in z for i in range(n)]
    columns = {f"c{i}.{j}": [n * j + i, n * (j + 1) + i] for j in range(len(heights)) for i in range(n)}
    beams = {f"b{i}.{j}": [n * j + i, n * j + i + 1] for j in range(1, len(z)) for i in range(n_bays)}
    lines = {**columns, **beams}
    mesh = Mesh.from_lines(points, list(lines.values()), {name: [k] for k, name in enumerate(lines)})
    members = {name: properties(name[0], *map(int, name[1:].split("."))) for name in lines}
    return Model(mesh, (Frame(members=members), *(fix(i) for i in range(n)), *more.get("effects", ())))


def _bathe_wilson():
    concrete = Material("concrete", 432000.0, 1.0)
    alike = MemberProperties(concrete, Section(3.0, 1.0, 1.0, 2.0), theory="euler-bernoulli", mass="lumped")
    model = planar(_grid([10.0] * 9, 20.0, 10, lambda *_: alike), ("x", "z", "ry"))
    return [(2 * np.pi * solve_modes(assemble(model), 3).frequency) ** 2]


SHAPES = {176: (51.7, 2150.0), 211: (62.1, 2670.0), 246: (72.3, 3230.0), 287: (84.4, 3910.0)}
"""A [in²] and I [in⁴] of columns, W14; and of beams, W24."""
BEAMS = {110: (32.5, 3330.0), 130: (38.3, 4020.0), 160: (47.1, 5120.0)}
OUTER, INNER = (246, 246, 246, 211, 211, 176, 176), (287, 287, 287, 246, 246, 211, 211)
FLOORS = (160, 160, 130, 130, 110, 110, 110)


def _seven_storeys():
    """Return periods, sway of the top, and axial force and moment at the foot of the left column."""
    steel = Material("steel", 29500.0, 1e-15)

    def properties(kind, bay, floor):
        A, I = BEAMS[FLOORS[floor - 1]] if kind == "b" else SHAPES[(INNER if bay == 1 else OUTER)[floor]]
        return MemberProperties(steel, Section(A, I, I, 2 * I), theory="euler-bernoulli")

    floors = range(1, 8)
    rigid = [
        MultiPointConstraint(name=f"floor{j}.{i}", terms=((3 * j + 1, "x", 1.0), (3 * j + i, "x", -1.0)))
        for j in floors
        for i in (0, 2)
    ]
    plain = _grid([162.0, 162.0, *[156.0] * 5], 360.0, 2, properties, effects=rigid)
    at = plain.mesh.points
    along_x = np.diag([0.49, 0, 0, 0, 0, 0])
    masses = [Joint(name=f"m{j}", point1=p, location=at[p], M=along_x) for j in floors for p in [3 * j + 1]]
    model = plain.with_effect(*masses)
    system = assemble(planar(model, ("x", "z", "ry")))
    loads = {(3 * j, "x"): f for j, f in zip(floors, (2.5, 5, 7.5, 10, 12.5, 15, 20), strict=True)}
    found = solve_static(system, loads)
    return [
        1 / solve_modes(system, 7).frequency,
        [found.displacements[6 * 21, 0]],
        [abs(found.reactions["support0", "z"][0])],
        [abs(found.reactions["support0", "ry"][0])],
    ]


_LENGTHENED = "equilibrium on the structure that the tension has lengthened, by N/EA = 1.2e-4"

PROBLEMS = (
    Problem(
        name="ANSYS VM10",
        title="T-beam under a moment (Crandall and Dahl, 1959): stresses; psi",
        quantities=(Quantity(name="largest and least normal stress", unit="psi", printed="300 -700"),),
        compute=_vm10,
    ),
    Problem(
        name="ANSYS VM12",
        title="bar under bending and torsion (Timoshenko, 1955): stresses",
        quantities=(
            Quantity(name="largest principal stress", unit="psi", printed="7527"),
            Quantity(name="largest shear stress", unit="psi", printed="3777"),
        ),
        compute=_vm12,
    ),
    Problem(
        name="ANSYS VM21",
        title="tie rod under a lateral load (Timoshenko, 1956), second order and first order",
        quantities=(
            Quantity(
                name="deflection under tension",
                unit="in",
                printed="-0.19945",
                allowance=1.2e-4,
                reason=_LENGTHENED,
            ),
            Quantity(
                name="slope under tension",
                unit="rad",
                printed="0.0032352",
                allowance=1.2e-4,
                reason=_LENGTHENED,
            ),
            Quantity(
                name="moment under tension",
                unit="lb·in",
                printed="-4580.1",
                allowance=1.2e-4,
                reason=_LENGTHENED,
            ),
            Quantity(name="deflection", unit="in", printed="-0.38241"),
            Quantity(name="slope", unit="rad", printed="0.0061185"),
            Quantity(name="moment", unit="lb·in", printed="-8962.7"),
        ),
        compute=_vm21,
    ),
    Problem(
        name="SAP2000 1-021",
        title="frame of 10 bays and 9 storeys (Bathe and Wilson, 1972), lumped masses",
        quantities=(Quantity(name="eigenvalues", unit="1/s²", printed="0.589541 5.52696 16.5879"),),
        compute=_bathe_wilson,
    ),
    Problem(
        name="SAP2000 example 1",
        title="frame of 2 bays and 7 storeys: modes and static loads",
        quantities=(
            Quantity(name="periods", unit="s", printed="1.2732 0.4313 0.2420 0.1602 0.1190 0.0951 0.0795"),
            Quantity(name="sway of the top", unit="in", printed="1.45076"),
            Quantity(name="axial force at the left foot", unit="kip", printed="69.99"),
            Quantity(name="moment at the left foot", unit="kip·in", printed="2324.68"),
        ),
        compute=_seven_storeys,
    ),
)
