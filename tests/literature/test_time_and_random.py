"""Published responses to spectra, in time and to random vibration.

Units are those of the sources: kip, inch and second, or lb, inch and second, unless stated.
"""

import numpy as np
import pytest

from fem.analysis.excitation import Excitation
from fem.analysis.modes import solve_modes
from fem.analysis.random_vibration import solve_random
from fem.analysis.response_spectrum import solve_spectrum
from fem.analysis.tabulated import Tabulated
from fem.analysis.transient import solve_transient
from fem.effects.added_mass import AddedMass
from fem.elements.frame import Frame
from fem.elements.properties import MemberProperties
from fem.materials import Material
from fem.mesh import Mesh
from fem.model import Damping, Model
from fem.sections.section import Section
from fem.system import assemble
from tests.frames import fix, planar

G = 386.0886
"""[in/s²]"""
NEXT_TO_NOTHING = 1e-12
"""Density of members whose mass the sources leave out."""


def chain(stiffness, masses, damping):
    """Return springs in a row along x, as bars of unit length, with a mass at the end of each."""
    n = len(stiffness)
    mesh = Mesh.from_lines(
        [[float(k), 0, 0] for k in range(n + 1)],
        [[k, k + 1] for k in range(n)],
        {f"k{k + 1}": [k] for k in range(n)},
    )
    members = {
        f"k{k + 1}": MemberProperties(
            Material(f"material {k}", 1.0, NEXT_TO_NOTHING), Section(float(own), 1.0, 1.0, 1.0)
        )
        for k, own in enumerate(stiffness)
    }
    added = (AddedMass(name=f"mass{k + 1}", point=k + 1, mass=m) for k, m in enumerate(masses))
    model = planar(Model(mesh, (Frame(members=members), fix(0), *added)), ("x",))
    return Model(model.mesh, model.effects, Damping.modal(damping))


SPECTRUM = np.array(
    [[0.03, 0.5], [0.125, 1.355], [0.587, 1.355], [0.66, 1.355], [1.562, 0.576], [4.12, 0.218], [10, 0.037]]
)
"""Periods [s] and pseudo-accelerations [g] of a design spectrum for 5 % of damping (Chopra 1995)."""


def chopra_frame():
    """Return a two-storey frame that bends alone, masses in its upper and lower beam."""
    points = [[0, 0, 0], [240, 0, 0], [0, 0, 120], [240, 0, 120], [0, 0, 240], [240, 0, 240]]
    lines = [[0, 2], [1, 3], [2, 4], [3, 5], [2, 3], [4, 5]]
    names = {"column 1": [0, 1], "column 2": [2, 3], "beam 1": [4], "beam 2": [5]}
    flat = {f"{name} {i}": [row] for name, rows in names.items() for i, row in enumerate(rows)}
    I = {"column 1": 2000.0, "column 2": 1000.0, "beam 1": 2000.0, "beam 2": 1000.0}
    material = Material("concrete", 3000.0, 1e-6 * NEXT_TO_NOTHING)
    members = {
        name: MemberProperties(
            material, Section(1e8, I[name[:-2]], I[name[:-2]], 1e4), theory="euler-bernoulli"
        )
        for name in flat
    }
    mesh = Mesh.from_lines(points, lines, flat)
    m = 0.5182
    masses = [
        AddedMass(name=f"m{p}", point=p, mass=own) for p, own in ((2, m), (3, m), (4, m / 2), (5, m / 2))
    ]
    model = planar(Model(mesh, (Frame(members=members), fix(0), fix(1), *masses)), ("x", "z", "ry"))
    return Model(model.mesh, model.effects, Damping.modal(0.05))


@pytest.fixture(scope="module")
def chopra():
    """Chopra, Dynamics of Structures (1995), a frame whose results SAP2000's example 1-020 prints too."""
    spectrum = Tabulated.of(1 / SPECTRUM[::-1, 0], G * SPECTRUM[::-1, 1])
    model = chopra_frame()
    outputs = [(2, "x"), (4, "x")]
    return {
        n: solve_spectrum(
            assemble(model), {"x": spectrum}, outputs, n_modes=n, combination="srss", missing_mass=False
        )
        for n in (1, 2)
    }


def test_chopra_frame_periods_and_displacements(chopra):
    found = chopra[2]
    assert 1 / found.modes.frequency == pytest.approx([1.562, 0.5868], abs=0.00055)
    # the book has g = 386 in/s² and spectrum values to three digits: 18.81 and 7.566 in
    assert found.displacement == pytest.approx([7.566, 18.81], rel=2e-3)


def test_chopra_frame_bending_moments(chopra):
    """Of the first mode alone, and of the second by SRSS with it; kip·ft."""
    first = np.abs(chopra[1].line_forces[:, :, 4]) / 12
    both = np.abs(chopra[2].line_forces[:, :, 4]) / 12
    second = np.sqrt(np.maximum(both**2 - first**2, 0))
    places = [(4, 0), (5, 0), (0, 1), (0, 0), (2, 1), (2, 0)]
    published = [(814, 57), (396, 179), (425, 374), (968, 412), (396, 179), (389, 317)]
    for (line, end), (one, two) in zip(places, published, strict=True):
        assert first[line, end] == pytest.approx(one, rel=3e-3)
        # differences of squares of numbers with three digits
        assert second[line, end] == pytest.approx(two, rel=2e-2)


def test_shear_building_of_four_storeys():
    """ENERCALC 3D's verification example F-08: bars of 1 m as the columns' stiffness; N, m and kg.

    Forces of 14.7, 29.4, 29.4 and 44.1 kN become masses. Reference periods 0.5789, 0.2595 and 0.1873 s, and
    displacements of three modes under its spectrum in cm.
    """
    E = 199.948e9
    areas = np.array([16, 12, 8, 4]) * 1e-6  # from the ground
    masses = np.array([44.1, 29.4, 29.4, 14.7]) * 1e3 / 9.80665
    model = chain(E * areas, masses, 0.05)
    modes = solve_modes(assemble(model), 3)
    assert 1 / modes.frequency == pytest.approx([0.5789, 0.2595, 0.1873], abs=0.00015)
    # at periods of 0.5789 and 0.2595 s its spectrum has lines between points in period, not logarithms
    sa = np.interp(1 / modes.frequency, np.arange(0, 7) / 10, [0.15, 0.18, 0.25, 0.38, 0.5, 0.5, 0.4])
    spectrum = Tabulated.of(modes.frequency, 9.80665 * sa)
    published = np.abs(
        [
            [1.22125, 0.175157, 0.0456209],
            [2.57982, 0.216095, 0.0103938],
            [4.04779, 0.0398752, 0.0646441],
            [5.19545, 0.400257, 0.0582355],
        ]
    )
    outputs = [(k, "x") for k in range(1, 5)]
    more = {"combination": "srss", "missing_mass": False}
    found = [solve_spectrum(assemble(model), {"x": spectrum}, outputs, n_modes=n, **more) for n in (1, 2, 3)]
    squares = np.diff([np.zeros(4), *(f.displacement**2 for f in found)], axis=0)
    np.testing.assert_allclose(100 * np.sqrt(squares[0]), published[:, 0], rtol=1e-3)
    np.testing.assert_allclose(100 * np.sqrt(squares[1]), published[:, 1], rtol=5e-3)


def test_ansys_vm68_random_vibration_of_two_masses():
    """PSD Response of a Two DOF Spring-Mass System, ANSYS' VM68, after Vierck (1979); lb, inch, g.

    White noise of 0.1 g²/Hz from 10 to 100 Hz at the base, 2 % of damping. The published standard deviations
    are those of the accelerations relative to the base, integrated by steps of 0.001 Hz.
    """
    model = chain([42832.0, 32416.0], [0.5, 1.0], 0.02)
    system = assemble(model)
    assert solve_modes(system, 2).frequency == pytest.approx([20.572, 64.885], abs=0.0006)
    white = Tabulated.of([10, 100], [0.1, 0.1])
    found = solve_random(system, [(1, "x"), (2, "x")], base={"x": white}, relative=True)
    assert found.rms == pytest.approx([9.059, 10.63], abs=0.006)


def test_ansys_mechanical_039_pulse_on_two_masses():
    """Transient Response of a Spring-Mass System, after Vierck (1979) section 5-8; N, m and kg.

    A force of 50 N on the outer of two masses of 2 kg for 1.8 s, springs of 16 N/m to the ground and 6 N/m.
    """
    model = chain([16.0, 6.0], [2.0, 2.0], 0.0)
    h, end = 1e-3, 1.8
    t = h * np.arange(2401)
    load = np.zeros(model.n_dof)
    load[12] = 50.0
    # half of it at the last sample: the straight line between samples then has the pulse's area
    pulse = (t < end - h / 2) + 0.5 * (abs(t - end) < h / 2)
    found = {
        method: solve_transient(
            assemble(model),
            Excitation.of(model, t, load, pulse),
            [(2, "x"), (1, "x")],
            method=method,
            n_modes=2,
        ).displacement
        for method in ("modal", "newmark")
    }
    for u in found.values():
        assert u[1300] == pytest.approx([14.48, 3.99], abs=0.006)
        assert u[2400] == pytest.approx([18.32, 6.14], abs=0.006)
