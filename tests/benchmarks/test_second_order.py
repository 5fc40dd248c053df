"""Second-order statics against the closed forms of beam-columns, and the benchmarks of AISC 360."""

from dataclasses import replace

import numpy as np
import pytest

from fem.analysis.loads import LineLoad, LoadCase
from fem.analysis.second_order import solve_second_order
from fem.materials import Material
from fem.model import ModelError
from fem.sections.section import Section
from tests.frames import FLAT, STEEL, beam, fix, planar

THICK = replace(FLAT, A=1e6 * FLAT.A)
"""So stiff along its axis that it does not shorten: the closed forms leave that out."""
EI = STEEL.E * FLAT.Iy
LENGTH = 1.0
PINNED = (fix(0, ("x", "z")), fix(1, ("z",)))


def column(n, ends, **more):
    return planar(beam(n, LENGTH, effects=ends, section=THICK, **more), keep=("x", "z", "ry"))


def pushed(axial, lateral=(), members=()):
    return LoadCase(name="push", points={(1, "x"): -axial, **dict(lateral)}, members=members)


@pytest.mark.parametrize("part", [0.2, 0.8])
@pytest.mark.parametrize("kind", ["uniform", "middle", "moments"])
def test_a_pinned_beam_column(kind, part):
    """Timoshenko and Gere, Theory of Elastic Stability, ch. 1, with u = kL/2, k² = P/EI.

    Elements err by (kh)⁴/720 in the critical load, and so in the deflection by that times part/(1 - part).
    """
    P = part * np.pi**2 * EI / LENGTH**2
    k, n = np.sqrt(P / EI), 8
    u = k * LENGTH / 2
    model = column(n, PINNED)
    middle = int(np.argmin(abs(model.mesh.points[:, 0] - LENGTH / 2)))
    q = F = M = 1e-3
    if kind == "uniform":
        case = pushed(P, members=(LineLoad(member="beam", force1=np.array([0, 0, -q])),))
        deflection = q / (EI * k**4) * (1 / np.cos(u) - 1) - q * LENGTH**2 / (8 * EI * k**2)
        moment = q / k**2 * (1 / np.cos(u) - 1)
    elif kind == "middle":
        case = pushed(P, {(middle, "z"): -F})
        deflection = F / (2 * P * k) * (np.tan(u) - u)
        moment = F / (2 * k) * np.tan(u)
    else:
        case = pushed(P, {(0, "ry"): M, (1, "ry"): -M})
        deflection = M / P * (1 / np.cos(u) - 1)
        moment = M / np.cos(u)
    found = solve_second_order(model, case)
    error = (k * LENGTH / n) ** 4 / 720 * max(1.0, part / (1 - part))
    assert found.factor == pytest.approx(1 / part, rel=(np.pi / n) ** 4 / 720 * 1.1)
    assert -found.solution.displacements[6 * middle + 2, 0] == pytest.approx(deflection, rel=2 * error)
    bending = found.solution.internal_forces("beam", [LENGTH / 2])[0, :, 0]
    assert abs(bending[4]) == pytest.approx(moment, rel=2 * error)
    assert bending[0] == pytest.approx(-P, rel=1e-6)
    first = found.first.displacements[6 * middle + 2, 0]
    assert found.solution.displacements[6 * middle + 2, 0] / first > 1 / (1 - part) * 0.98


def test_a_tie_is_stiffer():
    """In tension cos and tan become cosh and tanh; nothing buckles."""
    P = 4 * np.pi**2 * EI / LENGTH**2
    k = np.sqrt(P / EI)
    u, n = k * LENGTH / 2, 16
    model = column(n, PINNED)
    middle = int(np.argmin(abs(model.mesh.points[:, 0] - LENGTH / 2)))
    found = solve_second_order(model, pushed(-P, {(middle, "z"): -1e-3}))
    assert found.factor == np.inf
    exact = 1e-3 / (2 * P * k) * (u - np.tanh(u))
    assert -found.solution.displacements[6 * middle + 2, 0] == pytest.approx(exact, rel=(k / n) ** 4 / 720)


def test_a_cantilever():
    """Tip force F under P: deflection F/(Pk) (tan kL - kL), moment at the foot F tan(kL)/k."""
    part, n, F = 0.6, 8, 1e-3
    P = part * np.pi**2 * EI / (4 * LENGTH**2)
    k = np.sqrt(P / EI)
    found = solve_second_order(column(n, (fix(0),)), pushed(P, {(1, "z"): F}))
    error = 2 * (k / n) ** 4 / 720 * part / (1 - part)
    exact = F / (P * k) * (np.tan(k) - k)
    assert found.solution.displacements[6 + 2, 0] == pytest.approx(exact, rel=error)
    assert abs(found.solution.reactions["support0", "ry"][0]) == pytest.approx(F * np.tan(k) / k, rel=error)
    assert abs(found.solution.reactions["support0", "z"][0]) == pytest.approx(F, rel=1e-9)
    assert 1 <= found.n_rounds <= 3  # statically determinate


def test_loads_beyond_buckling_are_refused():
    P = np.pi**2 * EI / LENGTH**2
    model = column(8, PINNED)
    with pytest.raises(ModelError, match=r"'push' makes the structure buckle at 0\.8[0-9]* times its size"):
        solve_second_order(model, pushed(1.25 * P, {(2, "z"): 1.0}))
    with pytest.raises(ModelError, match=r"buckle at 0\.9999 times its size"):
        solve_second_order(model, pushed(1.0001 * P))
    straight = solve_second_order(model, pushed(0.999 * P))
    assert abs(straight.solution.displacements[2::6]).max() < 1e-9


KIP, INCH = 4448.2216152605, 0.0254
KSI = KIP / INCH**2
W14 = {"A": 14.1 * INCH**2, "Iy": 484 * INCH**4, "Iz": 51.4 * INCH**4, "J": 1.45 * INCH**4}
"""W14×48; its web, 13.8 by 0.340 in, carries the shear."""
HEIGHT = 28 * 12 * INCH


def aisc(ends, *, sheared):
    web = 13.8 * 0.340 / 14.1
    section = Section(**W14, ky=web, kz=web if sheared else 0.0)
    material = Material("steel", 29000 * KSI, 7850.0, nu=29000 / 22400 - 1)  # G of 11200 ksi
    return planar(
        beam(12, HEIGHT, effects=ends, section=section, material=material, theory="timoshenko"),
        keep=("x", "z", "ry"),
    )


@pytest.mark.parametrize(
    ("axial", "moment", "deflection"),
    [
        (0, (235, 235), (0.202, 0.197)),
        (150, (270, 269), (0.230, 0.224)),
        (300, (316, 313), (0.269, 0.261)),
        (450, (380, 375), (0.322, 0.311)),
    ],
)
@pytest.mark.parametrize("sheared", [True, False])
def test_aisc_benchmark_case_1(axial, moment, deflection, sheared):
    """AISC 360-10, Commentary, figure C-C2.2: pinned column, 0.200 kip/ft, moments [kip in] and [in]."""
    model = aisc((fix(0, ("x", "z")), fix(1, ("z",))), sheared=sheared)
    load = LineLoad(member="beam", force1=np.array([0, 0, -0.2 * KIP / (12 * INCH)]))
    found = solve_second_order(model, pushed(axial * KIP, members=(load,))).solution
    middle = int(np.argmin(abs(model.mesh.points[:, 0] - HEIGHT / 2)))
    bending = abs(found.internal_forces("beam", [HEIGHT / 2])[0, 4, 0]) / (KIP * INCH)
    sag = -found.displacements[6 * middle + 2, 0] / INCH
    # printed to three digits
    assert bending == pytest.approx(moment[not sheared], abs=1.0)
    assert sag == pytest.approx(deflection[not sheared], abs=1e-3)


@pytest.mark.parametrize(
    ("axial", "moment", "deflection"),
    [
        (0, (336, 336), (0.907, 0.901)),
        (100, (470, 469), (1.34, 1.33)),
        (150, (601, 598), (1.77, 1.75)),
        (200, (856, 848), (2.60, 2.56)),
    ],
)
@pytest.mark.parametrize("sheared", [True, False])
def test_aisc_benchmark_case_2(axial, moment, deflection, sheared):
    """AISC 360-10, Commentary, figure C-C2.3: cantilever, 1.00 kip at its tip."""
    found = solve_second_order(
        aisc((fix(0),), sheared=sheared), pushed(axial * KIP, {(1, "z"): KIP})
    ).solution
    # the reference does not state its shear area; 856 is 0.18 % below that with the web's
    foot = abs(found.reactions["support0", "ry"][0]) / (KIP * INCH)
    sway = found.displacements[6 + 2, 0] / INCH
    assert foot == pytest.approx(moment[not sheared], abs=1.0, rel=2e-3)
    assert sway == pytest.approx(deflection[not sheared], abs=1e-2 if axial else 1e-3)
