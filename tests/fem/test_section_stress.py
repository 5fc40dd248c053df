"""Normal stresses of sections against beam theory in axes that are not principal."""

import numpy as np
import pytest

from fem import LoadCase, MemberProperties, Section, StaticCases, assemble, solve_static
from fem.analysis.stations import normal_stresses
from tests.frames import STEEL, beam, fix


def extremes(section, **forces):
    own = np.zeros((1, 6, 1))
    for name, value in forces.items():
        own[0, ["N", "Vy", "Vz", "T", "My", "Mz"].index(name)] = value
    found = normal_stresses(MemberProperties(STEEL, section), np.zeros(1), own)
    assert found is not None
    low, high = found
    return low.item(), high.item()


def test_bending_about_both_axes_of_a_rectangle():
    b, h, N, My, Mz = 0.04, 0.06, 5e3, 200.0, -90.0
    bent = My / (b * h**2 / 6) + abs(Mz) / (h * b**2 / 6)
    found = extremes(Section.rectangle(b, h), N=N, My=My, Mz=Mz)
    assert found == pytest.approx((N / (b * h) - bent, N / (b * h) + bent))


@pytest.mark.parametrize("section", [Section.circle(0.05), Section.tube(0.05, 0.01)], ids=["bar", "tube"])
def test_round_sections_are_round(section):
    bent = np.hypot(300.0, 400.0) * 0.025 / section.Iy
    assert extremes(section, My=300.0, Mz=400.0) == pytest.approx((-bent, bent))


def test_sections_without_an_outline_have_none():
    constants = Section(A=1e-3, Iy=1e-6, Iz=2e-6, J=1e-6)
    assert normal_stresses(MemberProperties(STEEL, constants), np.zeros(1), np.zeros((1, 6, 1))) is None


def test_an_angle_bends_about_its_own_axes():
    """A force along one leg: σ = a + b y + c z with ∫σ = 0, ∫σz = My and ∫σy = 0 over the two legs."""
    b, h, t, length, force = 0.08, 0.12, 0.01, 2.0, 100.0
    section = Section.angle_section(b, h, t)
    model = beam(4, length, section=section, effects=(fix(0),), orientation=[0.0, 1.0, 0.0])
    tip = LoadCase(name="tip", points={(1, "y"): force})
    cases = StaticCases((solve_static(assemble(model), [tip]),))
    found = cases.stresses("beam", 1)
    assert found is not None
    low, high = found.low[0, 0], found.high[0, 0]
    # the legs as rectangles: y, z of their middles and their sizes, from the outer corner
    legs = [(t / 2, h / 2, t, h), ((b + t) / 2, t / 2, b - t, t)]
    A = [w * d for *_, w, d in legs]
    at = [np.average([leg[k] for leg in legs], weights=A) for k in (0, 1)]
    own = [(y - at[0], z - at[1], w, d) for y, z, w, d in legs]
    Iyy = sum(w * d * (d**2 / 12 + z**2) for _, z, w, d in own)
    Izz = sum(w * d * (w**2 / 12 + y**2) for y, _, w, d in own)
    Iyz = sum(w * d * y * z for y, z, w, d in own)
    # The orientation is z, along global y, and the local y points along -z: My = -force · length at the foot.
    slope = np.linalg.solve([[Izz, Iyz], [Iyz, Iyy]], [0.0, -force * length])
    corners = np.array([(0, 0), (b, 0), (b, t), (t, t), (t, h), (0, h)]) - at
    expected = corners @ slope
    assert (low, high) == pytest.approx((expected.min(), expected.max()), rel=1e-6)
