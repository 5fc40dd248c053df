"""Static frames of textbooks, by way of PyNite's tests: https://github.com/JWock82/Pynite, folder Testing.

Units are those of the sources, kip and inch unless stated.
"""

import numpy as np

from benchmarks.book.entry import Problem, Quantity
from fem import (
    Frame,
    Joint,
    LineLoad,
    LoadCase,
    Material,
    MemberForce,
    MemberProperties,
    Mesh,
    Model,
    Section,
    assemble,
    solve_one_sided,
    solve_static,
)
from tests.frames import beam, fix, planar

IN_PLANE = ("x", "y", "rz")


def plane_frame(points, lines, section, E, supports):
    """Return a frame in the x-y plane that bends with Iz, Euler-Bernoulli, members m1, m2, …"""
    xyz = np.column_stack([np.asarray(points, dtype=float), np.zeros(len(points))])
    names = {f"m{k + 1}": [k] for k in range(len(lines))}
    part = MemberProperties(Material("material", E, 7e-7), section, theory="euler-bernoulli")
    mesh = Mesh.from_lines(xyz, lines, names)
    return planar(Model(mesh, (Frame(members=dict.fromkeys(names, part)), *supports)), IN_PLANE)


def logan():
    points = [(0, 0), (0, 360), (180, 480), (420, 480), (600, 360), (600, 0)]
    lines = [(0, 1), (1, 2), (2, 3), (3, 4), (4, 5)]
    section = Section(12.0, 250.0, 200.0, 250.0)
    model = plane_frame(points, lines, section, 30000.0, (fix(0, IN_PLANE, "N1"), fix(5, IN_PLANE, "N6")))
    found = solve_static(assemble(model), {(2, "y"): -30.0, (3, "y"): -30.0})
    forces = [found.reactions[key][0] for key in (("N1", "x"), ("N1", "y"), ("N6", "x"))]
    u = found.displacements[12:18, 0]
    return [forces, [found.reactions["N1", "rz"][0]], [u[1]], [u[5]]]


def portal():
    points = [(0, 0), (0, 7.667), (7.75, 7.667), (7.75, 0)]
    section = Section(5.26 / 144, 18.3 / 12**4, 82.7 / 12**4, 0.346 / 12**4)
    hinges = fix(0, ("x", "y"), "N1"), fix(3, ("x", "y"), "N4")
    model = plane_frame(points, [(0, 1), (1, 2), (3, 2)], section, 29000.0 * 144, hinges)
    loads = (
        MemberForce(member="m2", position=7.75 / 2, force=[0, -5, 0]),
        LineLoad(member="m2", force1=[0, -0.024, 0]),
    )
    found = solve_static(assemble(model), LoadCase(members=loads))
    return [[found.displacements[5, 0]]]


SPAN, LINE_LOAD, STIFFNESS = 240.0, 2 / 12, 29000.0 * 7800.0
SINK = np.array([0, 0.625, 1.5, 0.75])


def settling_beam():
    points = [(SPAN * k, 0.0) for k in range(4)]
    supports = [fix(k, ("x", "y") if k == 0 else ("y",), "ABCD"[k]) for k in range(4)]
    section = Section(20.0, 1000.0, 7800.0, 8800.0)
    model = plane_frame(points, [(0, 1), (1, 2), (2, 3)], section, 29000.0, supports)
    load = LoadCase(
        members=tuple(LineLoad(member=f"m{k}", force1=[0, -LINE_LOAD, 0]) for k in (1, 2, 3)),
        displacements={("ABCD"[k], "y"): -SINK[k] for k in (1, 2, 3)},
    )
    found = solve_static(assemble(model), load)
    return [[found.reactions[name, "y"][0] for name in "ABCD"]]


def three_moments():
    """Return the reactions by the three-moment equation with settlements.

    M₁ + 4 M₂ + M₃ = -q L²/2 + (6EI/L²)(2 w₂ - w₁ - w₃).
    """
    fall = [2 * SINK[k] - SINK[k - 1] - SINK[k + 1] for k in (1, 2)]
    right = [-LINE_LOAD * SPAN**2 / 2 + 6 * STIFFNESS / SPAN**2 * w for w in fall]
    M = np.array([0, *np.linalg.solve([[4, 1], [1, 4]], right), 0])
    shear = np.diff(M) / SPAN
    return LINE_LOAD * SPAN * np.array([0.5, 1, 1, 0.5]) + np.append(shear, 0) - np.append(0, shear)


def two_spans():
    points = [(0, 0), (120, 0), (240, 0)]
    supports = [fix(0, ("x", "y")), fix(1, ("y",)), fix(2, ("y",))]
    model = plane_frame(points, [(0, 1), (1, 2)], Section(20.0, 100.0, 150.0, 250.0), 29000.0, supports)
    load = LoadCase(members=tuple(LineLoad(member=m, force1=[0, -10, 0]) for m in ("m1", "m2")))
    found = solve_static(assemble(model), load)
    return [[abs(found.line_forces[0, 1, 5, 0])]]


STEEL_KSI = Material("steel", 29000.0, 7e-7, nu=0.3)


def twisted():
    """Return the end torques of a shaft clamped at both ends under two torques, 5 and 10 kip·in."""
    mesh = Mesh.from_lines([[0, 0, 0], [168.0, 0, 0]], [[0, 1]], {"shaft": [0]})
    mesh = mesh.with_point_on("shaft", 36.0).with_point_on("shaft", 132.0)
    part = MemberProperties(STEEL_KSI, Section(20.0, 100.0, 150.0, 250.0))
    model = Model(mesh, (Frame(members={"shaft": part}), fix(0, name="left"), fix(1, name="right")))
    found = solve_static(assemble(model), {(2, "rx"): 5.0, (3, "rx"): 10.0})
    return [[found.reactions["left", "rx"][0], found.reactions["right", "rx"][0]]]


def on_springs():
    """Return deflection and moment under 40 kip on a beam with springs of 22.5 kip/in each 15 in."""
    model = beam(16, 240.0, section=Section(10.3, 42.6, 128.5, 0.769), material=STEEL_KSI)
    order = np.argsort(model.mesh.points[:, 0])
    ground = np.diag([0, 22.5, 0, 0, 0, 0])
    springs = [
        Joint(name=f"spring {p}", point1=int(p), location=model.mesh.points[p], K=ground) for p in order[1:-1]
    ]
    ends = fix(0, ("x", "y", "z", "rx")), fix(1, ("y", "z"))
    whole = Model(model.mesh, (*model.effects, *springs, *ends))
    middle = int(order[8])
    found = solve_static(assemble(whole), {(middle, "y"): -40.0})
    return [[found.displacements[6 * middle + 1, 0]], [abs(found.internal_forces("beam", [120.0])[0, 5, 0])]]


def braces():
    """Return the forces of a strut between two braces that carry tension alone, under 10 kip."""
    xy = [(0, 0), (100, 0), (0, 10), (0, -10)]
    names = {"both": [0], "above": [1], "below": [2]}
    mesh = Mesh.from_lines([(*p, 0.0) for p in xy], [[0, 1], [2, 1], [3, 1]], names)
    material, section = Material("material", 29000.0, 7e-7), Section(1.94, 3.0, 3.0, 0.0438)
    members = {
        name: MemberProperties(material, section, theory="bar", only="" if name == "both" else "tension")
        for name in names
    }
    model = Model(mesh, (Frame(members=members), *(fix(p, ("x", "y")) for p in (0, 2, 3))))
    found = solve_one_sided(planar(model, ("x", "y")), LoadCase(points={(1, "y"): -10.0})).solution
    return [found.line_forces[[1, 0, 2], 0, 0, 0]]


PROBLEMS = (
    Problem(
        name="Logan 5-30",
        title="gable frame under two forces (Logan, A First Course in the Finite Element Method, 4th ed.)",
        quantities=(
            Quantity(name="reactions N1x, N1y, N6x", unit="kip", printed="11.6877 30 -11.6877"),
            Quantity(name="moment at N1", unit="kip·in", printed="-1810.0745"),
            Quantity(name="deflection at N3", unit="in", printed="-6.666757"),
            Quantity(name="rotation at N3", unit="rad", printed="-0.032"),
        ),
        compute=logan,
    ),
    Problem(
        name="portal of W8x24",
        title="hinged portal, a force and a uniform load on its beam (kip, ft)",
        quantities=(
            Quantity(
                name="rotation of the hinge",
                unit="rad",
                printed="0.00022794540510395617",
                allowance=1e-10,
                reason="rounding of both programs",
            ),
        ),
        compute=portal,
    ),
    Problem(
        name="Kassimali 13-14",
        title="beam on four supports that settle (Kassimali, Structural Analysis, 3rd ed.)",
        quantities=(
            Quantity(
                name="reactions",
                unit="kip",
                printed="-1.098 122.373 -61.451 60.176",
                exact=three_moments,
                proof="the book rounds its flexibilities to four digits; the three-moment equation is exact",
            ),
        ),
        compute=settling_beam,
    ),
    Problem(
        name="two spans",
        title="uniform load over two spans, qL²/8 over the middle support",
        quantities=(Quantity(name="moment", unit="kip·in", printed="18000"),),
        compute=two_spans,
    ),
    Problem(
        name="tension alone",
        title="two braces that carry tension alone, and a strut",
        quantities=(Quantity(name="axial forces", unit="kip", printed="100.499 -100.000 0.000"),),
        compute=braces,
    ),
    Problem(
        name="torques",
        title="shaft between clamps under two torques",
        quantities=(Quantity(name="torques of the clamps", unit="kip·in", printed="-6.07 -8.93"),),
        compute=twisted,
    ),
    Problem(
        name="McGuire 4-15",
        title="beam on springs (McGuire, Gallagher and Ziemian, Matrix Structural Analysis, 2nd ed.)",
        quantities=(
            Quantity(
                name="deflection under the force",
                unit="in",
                printed="-0.238",
                allowance=0.034,
                reason="the number is that of an infinite beam on a continuous bed, Pβ/2k",
            ),
            Quantity(name="moment under the force", unit="kip·in", printed="547"),
        ),
        compute=on_springs,
    ),
)
