"""Models of code_aster's test cases that `benchmarks.book.code_aster` lists."""

import re
from functools import cache

import numpy as np
from scipy.optimize import brentq

from fem import (
    AddedMass,
    Effect,
    Excitation,
    Frame,
    InitialStrain,
    LineLoad,
    LoadCase,
    Material,
    MemberProperties,
    Mesh,
    Model,
    MultiPointConstraint,
    RigidLink,
    Section,
    assemble,
    compute_frf,
    solve_modes,
    solve_static,
    solve_transient,
)
from fem.effects import SprungMass
from tests.benchmarks.test_tapered_closed_form import shooting_frequencies
from tests.frames import STEEL as OTHER
from tests.frames import beam, fix, planar

STEEL = Material("steel", 2e11, 7800.0, nu=0.3)
SHORT = Section(0.02, 0.16666667e-4, 0.6666667e-4, 0.45776042e-4, ky=1 / 1.17692, kz=1 / 1.17692)
FLAT = ("x", "y", "rz")
"""Motions in the x-y plane."""


def short_beam(depth):
    """Return the frequencies of SDLL01: a short beam on two supports, at or below its axis."""
    points = [[0, 0, 0], [1, 0, 0], [0, -depth, 0], [1, -depth, 0]][: 4 if depth else 2]
    mesh = Mesh.from_lines(points, [[0, 1]], {"beam": [0]}).split(80)
    feet = (2, 3) if depth else (0, 1)
    effects: list[Effect] = [Frame(members={"beam": MemberProperties(STEEL, SHORT)})]
    if depth:
        effects += [RigidLink(name=f"arm {p}", point=p, dependents=(2 + p,)) for p in (0, 1)]
    supports = fix(feet[0], ("x", "y")), fix(feet[1], ("y",))
    return solve_modes(assemble(planar(Model(mesh, (*effects, *supports)), FLAT)), 6).frequency


def with_oscillator(ratio):
    """Return the frequencies of SDLL04: a pinned beam of 10 m with a sprung mass at a quarter.

    The mass is a part of the beam's, and tuned to its lowest frequency.
    """
    section = Section(0.01, 1e-3, 0.39e-5, 1e-3, ky=1 / 1.2, kz=1 / 1.2)
    mesh = Mesh.from_lines([[0, 0, 0], [10, 0, 0]], [[0, 1]], {"beam": [0]}).with_point_on("beam", 2.5)
    mesh = mesh.split([5, 15])
    effects = [Frame(members={"beam": MemberProperties(STEEL, section)}), fix(0, ("x", "y")), fix(1, ("y",))]
    model = planar(Model(mesh, tuple(effects)), FLAT)
    if ratio:
        body = SprungMass(name="body", point=2, mass=780 * ratio, k={"y": 75979.1 * ratio})
        model = model.with_effect(body)
    return solve_modes(assemble(model), 3).frequency


SHAKEN_AT = np.array([10, 15, 20, 24, 26, 30, 35, 40, 45, 49, 51, 55, 60, 65, 70, 75, 80, 85]) / 1000
"""Times of SDLL06 [s]."""


def shaken_mass():
    """Return the displacements of SDLL06 relative to the base, whose acceleration is a triangle of 50 ms."""
    mesh = Mesh.from_lines([[0, 0, 0], [1, 0, 0]], [[0, 1]], {"spring": [0]})
    spring = MemberProperties(Material("spring", 3.942e7, 1e-9), Section(1.0, 1.0, 1.0, 1.0), theory="bar")
    body = AddedMass(name="mass", point=1, mass=43.8e3)
    model = planar(Model(mesh, (Frame(members={"spring": spring}), fix(0), body)), ("x",))
    t = np.arange(0, 0.0901, 0.001)
    pulse = np.interp(t, [0, 0.025, 0.05], [0, 9.81, 0])
    excitation = Excitation.of(model, t, base={"x": pulse})
    found = solve_transient(assemble(model), excitation, [(1, "x")], relative=True).displacement[:, 0]
    return found[np.round(SHAKEN_AT / 0.001).astype(int)]


def folded_beam():
    """Return the frequencies of SDLL02: a beam of twice 0.5 m that comes back to its clamp."""
    n = 10
    x = [*np.linspace(0, 0.5, n + 1), *np.linspace(0.5, 0, n + 1)[1:]]
    points = [[v, 0, 0] for v in x]
    names = {"out": list(range(n)), "back": list(range(n, 2 * n))}
    part = MemberProperties(
        Material("steel", 2.1e11, 7800.0, nu=0.3),
        Section.rectangle(0.05, 0.005),
        theory="euler-bernoulli",
        orientation=np.array([0, 1.0, 0]),
    )
    mesh = Mesh.from_lines(points, [[k, k + 1] for k in range(2 * n)], names)
    model = Model(mesh, (Frame(members=dict.fromkeys(names, part)), fix(0)))
    return solve_modes(assemble(planar(model, FLAT)), 8).frequency


def tapered_cantilever(first, second):
    """Return the frequencies of SDLL09: a cantilever of 1 m from one rectangle to another."""
    model = beam(
        30,
        1.0,
        effects=(fix(0),),
        material=STEEL,
        section=Section.rectangle(*first),
        section2=Section.rectangle(*second),
        orientation=np.array([0, 1.0, 0]),
        theory="euler-bernoulli",
    )
    return solve_modes(assemble(planar(model, FLAT)), 5).frequency


@cache
def wedge_exactly():
    """Return the frequencies of SDLL09's second case by its differential equation (Runge and Kutta).

    The integration is that of a beam of half the size, in another material.
    """
    speed = np.sqrt(STEEL.E / STEEL.rho / (OTHER.E / OTHER.rho))
    half = Section.rectangle(0.025, 0.02), Section.rectangle(0.005, 0.005)
    return shooting_frequencies(*half, 2300 / speed, shear=False, steps=100)[:5] * speed / 2


DECAY, WIDE, THICK, SPAN = 2.0, 0.03, 0.01, 0.6


def narrowing_beam(n=60):
    """Return the frequencies of SDLL10: a clamped beam of 0.6 m, its width falling as exp(-2x)."""
    x = np.linspace(0, SPAN, n + 1)
    width = WIDE * np.exp(-DECAY * x)
    names = {f"m{k}": [k] for k in range(n)}
    members = {
        name: MemberProperties(
            STEEL,
            Section.rectangle(width[k], THICK),
            section2=Section.rectangle(width[k + 1], THICK),
            theory="euler-bernoulli",
            orientation=np.array([0, 1.0, 0]),
        )
        for k, name in enumerate(names)
    }
    mesh = Mesh.from_lines([[v, 0, 0] for v in x], [[k, k + 1] for k in range(n)], names)
    model = Model(mesh, (Frame(members=members), fix(0), fix(n)))
    return solve_modes(assemble(planar(model, FLAT)), 4).frequency


def narrowing_exactly():
    """Return the same from (b w'')'' = k⁴ b w with b = exp(-2ax): exponents a ± √(a² ± k²)."""
    a = DECAY / 2

    def determinant(k):
        inner = [complex(a**2 + s * k**2) ** 0.5 for s in (1, -1)]
        r = np.array([a + v for v in inner] + [a - v for v in inner])
        end = np.exp(r * SPAN)
        return np.linalg.det(np.array([np.ones(4), r, end, r * end]) / np.abs(end)).imag

    grid = np.linspace(5, 25, 200)
    values = [determinant(k) for k in grid]
    k = [brentq(determinant, *grid[i : i + 2]) for i in range(len(grid) - 1) if values[i] * values[i + 1] < 0]
    return np.array(k[:4]) ** 2 / (2 * np.pi) * np.sqrt(STEEL.E * THICK**2 / 12 / STEEL.rho)


def end_mass(offset):
    """Return the frequencies of SDLL15: a tubular cantilever with a mass of 1 t at its end or beside it."""
    mass = AddedMass(name="mass", point=1, mass=1000.0, arm=np.array([0, offset, 0]))
    model = beam(
        20,
        10.0,
        effects=(fix(0), mass),
        material=Material("steel", 2.1e11, 7800.0, nu=0.3),
        section=Section.tube(0.35, 0.015),
    )
    return solve_modes(assemble(model), 10).frequency


def grid_of_beams():
    """Return the model of SDLL08: two beams on four supports, and a third on hinges between their middles.

    No member twists.
    """
    xy = [(0, 0), (0, 2.5), (0, 5), (5, 0), (5, 2.5), (5, 5), (0, 2.5), (2.5, 2.5), (5, 2.5)]
    points = [(*p, 0.0) for p in xy]
    lines = [[0, 1], [1, 2], [3, 4], [4, 5], [6, 7], [7, 8]]
    names = {"ABC": [0, 1], "DEF": [2, 3], "HGI": [4, 5]}
    part = MemberProperties(
        STEEL, Section(2.872e-3, 0.1943e-4, 0.1943e-4, 0.5165e-7), theory="euler-bernoulli"
    )
    mesh = Mesh.from_lines(points, lines, names).split(5)
    along_y = set(mesh.lines[np.concatenate([mesh.members["ABC"], mesh.members["DEF"]])].ravel().tolist())
    held = [
        fix(p, ("x", "y", "rz", "ry" if p in along_y else "rx", *(("z",) if p in (0, 2, 3, 5) else ())))
        for p in range(mesh.n_points)
    ]
    hinges = [
        MultiPointConstraint(name=f"hinge {p}", terms=((p, "z", 1.0), (q, "z", -1.0)))
        for p, q in ((1, 6), (4, 8))
    ]
    return Model(mesh, (Frame(members=dict.fromkeys(names, part)), *held, *hinges))


def grid_results():
    system = assemble(grid_of_beams())
    modes = solve_modes(system, 3)
    rows = [(1, "z"), (7, "z")]
    H = compute_frf(system, np.array([80 / (2 * np.pi)]), rows, [(7, "z")], "receptance").H[0, :, 0]
    return [modes.frequency[[0, 2]], -1e5 * H.real]


def branching_frame():
    """Return SSLL10: four members of a node, one of them hinged at its foot."""
    points = [[0, 0, 0], [4, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -2, 0], [-0.5, 0, 0]]
    names = {"AB": [0], "AC": [1], "AG": [2], "GD": [3], "AE": [4]}
    sizes = {"AB": 0.04, "AC": 0.01, "AG": 0.01, "GD": 0.01, "AE": 0.02}
    material = Material("steel", 2e11, 7800.0, nu=0.0)
    members = {name: MemberProperties(material, Section.rectangle(h, h)) for name, h in sizes.items()}
    mesh = Mesh.from_lines(points, [[0, 1], [0, 2], [0, 5], [5, 3], [0, 4]], names)
    ends = fix(1, FLAT), fix(3, FLAT), fix(4, FLAT), fix(2, ("x", "y"))
    model = planar(Model(mesh, (Frame(members=members), *ends)), FLAT)
    load = LoadCase(points={(5, "y"): -1e5}, members=(LineLoad(member="AB", force1=[0, -1e3, 0]),))
    found = solve_static(assemble(model), load)
    at = [mesh.members[name][0] for name in ("AB", "AC", "AG", "AE")]
    return [[found.displacements[5, 0]], [found.line_forces[line, 0, 5, 0] for line in at]]


def four_bars():
    """Return SSLL11: a truss of four bars under a weight of 1 t."""
    points = [[0, 0, 0], [1, 0, 0], [0.5, 0.5, 0], [2, 1, 0]]
    names = {"AC": [0], "BC": [1], "CD": [2], "BD": [3]}
    material = Material("steel", 1.962e11, 7800.0)
    members = {
        name: MemberProperties(material, Section(A, 1e-9, 1e-9, 1e-9), theory="bar")
        for name, A in (("AC", 2e-4), ("BC", 2e-4), ("CD", 1e-4), ("BD", 1e-4))
    }
    mesh = Mesh.from_lines(points, [[0, 2], [1, 2], [2, 3], [1, 3]], names)
    model = Model(mesh, (Frame(members=members), fix(0, ("x", "y")), fix(1, ("x", "y"))))
    found = solve_static(assemble(planar(model, ("x", "y"))), {(3, "y"): -9810.0})
    u = found.displacements.reshape(-1, 6)
    return [[u[2, 0], u[2, 1], u[3, 0], u[3, 1]]]


def four_bars_by_unit_loads():
    """Return the displacements of SSLL11's statically determinate truss, Σ N n L/EA."""
    points = np.array([[0, 0], [1, 0], [0.5, 0.5], [2, 1.0]])
    lines = [(0, 2), (1, 2), (2, 3), (1, 3)]
    rows = np.zeros((4, 4))  # equilibrium of the free points C and D
    length = np.empty(4)
    for k, (a, b) in enumerate(lines):
        axis = points[b] - points[a]
        length[k] = np.hypot(*axis)
        for end, sign in ((a, 1), (b, -1)):
            if end > 1:
                rows[2 * (end - 2) : 2 * (end - 2) + 2, k] += sign * axis / length[k]
    N = np.linalg.solve(rows, [0, 0, 0, 9810.0])
    unit = np.linalg.solve(rows, -np.eye(4))
    return unit.T @ (N * length / (1.962e11 * np.array([2e-4, 2e-4, 1e-4, 1e-4])))


TRUSS_LIGHT = (1, 3, 5, 7, 9, 13, 15, 17)
"""Members of SSLL12 with the smaller area."""


TRUSS_FORCES = (
    (
        "heat",
        (
            "-4777.1 -3676.7 7651.2 -5968.2 -7651.2 8272.6 7651.2 -17918 5295 12946 -5036.1 12946 "
            "2757.5 -15937 10189 4285.2 -10189"
        ),
        (
            "-4782.50321 -3681.57269 7655.74055 -5978.12901 -7655.74055 8274.68534 7655.74055 "
            "-17934.387 5298.38382 12954.1244 -5025.58053 12954.1244 2746.47031 -15941.6774 "
            "10207.6541 4289.26599 -10207.6541"
        ),
    ),
    (
        "forces",
        (
            "-51947 -20753 83102 -64930 -83102 109020 -156900 -7303.1 69761 -87137 -53204 -87137 "
            "15340 35265 -102480 24158 -57524"
        ),
        (
            "-51937.8568 -20736.7718 83141.1374 -64922.321 -83141.1374 109107.87 -156976.021 "
            "-7266.96304 69863.1248 -87112.8967 -53307.0105 -87112.8967 15469.728 35207.144 "
            "-102582.625 24159.6562 -57495.4813"
        ),
    ),
    (
        "settlements",
        (
            "-24346.3 -18738.1 38993.7 -30416.4 -38993.7 42160.7 38993.7 -91315.1 26985.5 65979.1 "
            "-25665.9 65979.1 14053.6 -81220.3 51925.6 21839.1 -51925.6"
        ),
        (
            "-24357.434 -18750.3614 38990.919 -30446.7925 -38990.919 42143.2236 38990.919 "
            "-91340.3775 26984.8296 65975.7486 -25595.4342 65975.7486 13987.8566 -81191.4466 "
            "51987.892 21845.3619 -51987.892"
        ),
    ),
    (
        "all",
        (
            "-81070 -43168 129750 -101310 -129750 159450 -110250 -116540 102040 -8211.2 -83906 "
            "-8211.2 32151 -61892 -40362 50282 -119640"
        ),
        (
            "-81077.794 -43168.706 129787.797 -101347.243 -129787.797 159525.779 -110329.362 "
            "-116541.728 102146.338 -8183.02366 -83928.0253 -8183.02366 32204.0549 -61925.98 "
            "-40387.0786 50294.2841 -119691.027"
        ),
    ),
)
"""Load cases of SSLL12, with the forces M1 to M17 of the guide and those of code_aster [N]."""


def inclined_truss():
    """Return the axial forces of SSLL12: a truss with a support at 30° under four loads."""
    xy = [(0, 0), (0, 4), (5, 0), (10, 4), (15, 0), (20, -4), (20, 4), (30, 4), (35, 0), (25, 0)]
    ends = re.findall("..", "A1A2121E2E23E3E4343BB4BD4D4FDFDCFC")
    order = "A12E3B4FCD"
    lines = [[order.index(a), order.index(b)] for a, b in ends]
    names = {f"M{k + 1}": [k] for k in range(17)}
    material = Material("steel", 2.1e11, 7800.0, nu=0.3)
    wall = 3.58942e-3
    box = 0.2**2 - (0.2 - 2 * wall) ** 2
    areas = {f"M{k}": 1.41e-3 if k in TRUSS_LIGHT else box for k in range(1, 18)}
    members = {
        name: MemberProperties(material, Section(A, 1e-9, 1e-9, 1e-9), theory="bar")
        for name, A in areas.items()
    }
    mesh = Mesh.from_lines([(*p, 0.0) for p in xy], lines, names)
    n = np.array([-0.5, np.sqrt(0.75)])  # normal of the inclined support
    slide = MultiPointConstraint(name="C", terms=((8, "x", n[0]), (8, "y", n[1])))
    model = Model(mesh, (Frame(members=members), fix(0, ("x", "y"), "A"), fix(5, ("y",), "B"), slide))
    heat = tuple(InitialStrain(member=name, axial=1e-5 * 30) for name in names)
    push = {(3, "y"): -150e3, (7, "y"): -100e3}
    key = next(c.key for c in slide.constraints(model))
    sink = {("A", "y"): -0.020, ("B", "y"): -0.030, key: -0.015}
    cases = [
        LoadCase(name="heat", members=heat),
        LoadCase(name="forces", points=push),
        LoadCase(name="settlements", displacements=sink),
        LoadCase(name="all", members=heat, points=push, displacements=sink),
    ]
    found = solve_static(assemble(planar(model, ("x", "y"))), cases)
    return [found.line_forces[:, 0, 0, k] for k in range(4)]


def pitched_portal():
    """Return SSLL14: a hinged portal with a pitched roof under four loads and their sum."""
    points = [[0, 0, 0], [0, 8, 0], [10, 12, 0], [20, 8, 0], [20, 0, 0]]
    names = {"D1": [0], "D2": [1], "D3": [2], "D4": [3]}
    material = Material("steel", 2.1e11, 7800.0, nu=0.3)
    members = {
        name: MemberProperties(material, Section(1.0, own, own, 2 * own), theory="euler-bernoulli")
        for name, own in (("D1", 5e-4), ("D2", 2.5e-4), ("D3", 2.5e-4), ("D4", 5e-4))
    }
    mesh = Mesh.from_lines(points, [[0, 1], [1, 2], [2, 3], [3, 4]], names)
    model = Model(mesh, (Frame(members=members), fix(0, ("x", "y"), "A"), fix(4, ("x", "y"), "B")))
    roof = (LineLoad(member="D2", force1=[0, -3000, 0]),)
    forces = [{(2, "y"): -20000.0}, {(1, "x"): -10000.0}, {(1, "rz"): -100000.0}]
    cases = [LoadCase(name="1", members=roof)]
    cases += [LoadCase(name=str(k + 2), points=f) for k, f in enumerate(forces)]
    cases += [LoadCase(name="5", members=roof, points=forces[0] | forces[1] | forces[2])]
    found = solve_static(assemble(planar(model, FLAT)), cases)
    top = found.displacements[12:14]
    foot = [found.reactions["A", d] for d in ("x", "y")]
    return [top.T.ravel(), np.array(foot).T.ravel()]
