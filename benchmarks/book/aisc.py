"""Second-order benchmarks of AISC 360-10, Commentary, figures C-C2.2 and C-C2.3; kip and inch.

The numbers were checked against two programs' examples that print them: without shear PyNite's test
test_AISC_PDelta_benchmarks, with and without shear the OpenSees examples of M. Denavit
(https://github.com/denavit/OpenSees-Examples). These have the web of 13.8 by 0.340 in as shear area.
"""

import numpy as np

from benchmarks.book.entry import Problem, Quantity
from fem import LineLoad, LoadCase, Material, Section, solve_second_order
from tests.frames import beam, fix, planar

KIP, INCH = 4448.2216152605, 0.0254
KSI = KIP / INCH**2
W14 = {"A": 14.1 * INCH**2, "Iy": 484 * INCH**4, "Iz": 51.4 * INCH**4, "J": 1.45 * INCH**4}
"""W14x48."""
HEIGHT = 28 * 12 * INCH


def column(ends, *, sheared):
    """Return a column of 28 ft."""
    web = 13.8 * 0.340 / 14.1
    section = Section(**W14, ky=web, kz=web if sheared else 0.0)
    material = Material("steel", 29000 * KSI, 7850.0, nu=29000 / 22400 - 1)  # G of 11200 ksi
    return planar(
        beam(12, HEIGHT, effects=ends, section=section, material=material, theory="timoshenko"),
        keep=("x", "z", "ry"),
    )


def pinned(axial, *, sheared):
    """Return moment and deflection at midheight of a pinned column under 0.200 kip/ft."""
    model = column((fix(0, ("x", "z")), fix(1, ("z",))), sheared=sheared)
    load = LineLoad(member="beam", force1=np.array([0, 0, -0.2 * KIP / (12 * INCH)]))
    found = solve_second_order(model, LoadCase(points={(1, "x"): -axial * KIP}, members=(load,))).solution
    middle = int(np.argmin(abs(model.mesh.points[:, 0] - HEIGHT / 2)))
    moment = abs(found.internal_forces("beam", [HEIGHT / 2])[0, 4, 0])
    return moment / (KIP * INCH), -found.displacements[6 * middle + 2, 0] / INCH


def cantilever(axial, *, sheared):
    """Return moment at the foot and deflection of the tip of a cantilever under 1 kip."""
    case = LoadCase(points={(1, "x"): -axial * KIP, (1, "z"): KIP})
    found = solve_second_order(column((fix(0),), sheared=sheared), case).solution
    foot = abs(found.reactions["support0", "ry"][0]) / (KIP * INCH)
    return foot, found.displacements[6 + 2, 0] / INCH


def _results(solve, axial):
    """Return moments and deflections with shear, and without."""
    for sheared in (True, False):
        yield from zip(*(solve(P, sheared=sheared) for P in axial), strict=True)


def _quantities(moments, deflections, **more):
    """Yield moments and deflections with shear, and without."""
    for words, M, u in zip(("with shear", "without shear"), moments, deflections, strict=True):
        yield Quantity(name=f"moments, {words}", unit="kip·in", printed=M, **more)
        yield Quantity(name=f"deflections, {words}", unit="in", printed=u, **more)


UNIT = {"allowance": 1.5e-3, "reason": "rounding of the figure: up to one unit of the last digit"}
AREA = {"allowance": 2e-3, "reason": "the figure does not state its shear area"}

PROBLEMS = (
    Problem(
        name="AISC 360, case 1",
        title="pinned column W14x48, 0, 150, 300 and 450 kip",
        quantities=tuple(
            _quantities(
                ("235 270 316 380", "235 269 313 375"),
                ("0.202 0.230 0.269 0.322", "0.197 0.224 0.261 0.311"),
                **UNIT,
            )
        ),
        compute=lambda: list(_results(pinned, (0, 150, 300, 450))),
    ),
    Problem(
        name="AISC 360, case 2",
        title="cantilever W14x48, 0, 100, 150 and 200 kip",
        quantities=tuple(
            _quantities(
                ("336 470 601 856", "336 469 598 848"),
                ("0.907 1.34 1.77 2.60", "0.901 1.33 1.75 2.56"),
                **AREA,
            )
        ),
        compute=lambda: list(_results(cantilever, (0, 100, 150, 200))),
    ),
)
