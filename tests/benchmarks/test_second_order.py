"""Second-order statics against the closed forms of beam-columns."""

from dataclasses import replace

import numpy as np
import pytest

from fem import LineLoad, LoadCase, ModelError, assemble, prestressed, solve_second_order, solve_static
from fem.analysis.buckling import lowest_factor
from tests.frames import FLAT, STEEL, beam, fix, planar, portal

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


@pytest.mark.parametrize("n", [400, 2000])
@pytest.mark.parametrize("part", [0.2, 0.8])
def test_rounding_on_a_fine_mesh_does_not_keep_the_iteration_going(part, n):
    """A pinned beam-column under equal end moments: M/P (1/cos u - 1), to the rounding of n⁴ ε in a chain."""
    P = part * np.pi**2 * EI / LENGTH**2
    model = column(n, PINNED)
    middle = int(np.argmin(abs(model.mesh.points[:, 0] - LENGTH / 2)))
    found = solve_second_order(model, pushed(P, {(0, "ry"): 1e-3, (1, "ry"): -1e-3}))
    exact = 1e-3 / P * (1 / np.cos(np.sqrt(P / EI) * LENGTH / 2) - 1)
    assert -found.solution.displacements[6 * middle + 2, 0] == pytest.approx(exact, rel=n**4 * 1e-16)
    assert found.n_rounds < 15


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


@pytest.mark.parametrize("part", [0.3, 0.6, 0.9])
def test_displacements_balance_the_geometric_stiffness_of_their_own_forces(part):
    """A portal whose sway changes the forces of its columns: several rounds, some with a new factor."""
    model = portal(0.2)
    dead = {(int(p), "z"): -1.0 for p in model.mesh.member_points("beam")}
    side = (int(model.mesh.member_points("beam")[0]), "x")
    load = LoadCase(name="dead", points={**dead, side: 0.2})
    size = part * lowest_factor(assemble(model), solve_static(assemble(model), load))
    load = replace(load, points={place: size * force for place, force in load.points.items()})
    found = solve_second_order(model, load)
    again = solve_static(assemble(prestressed(model, found.solution)), load)
    assert found.factor == pytest.approx(1 / part, rel=1e-9)
    assert found.n_rounds >= 2
    change = again.displacements - found.solution.displacements
    assert abs(change).max() < 1e-8 * abs(again.displacements).max()
