"""Published responses to spectra, in time and to random vibration.

Units are those of the sources: kip, inch and second, or lb, inch and second, unless stated.
"""

from functools import cache

import numpy as np

from benchmarks.book.entry import Problem, Quantity
from fem import (
    AddedMass,
    Damping,
    Excitation,
    Frame,
    Material,
    MemberProperties,
    Mesh,
    Model,
    Section,
    Tabulated,
    assemble,
    solve_modes,
    solve_random,
    solve_spectrum,
    solve_transient,
)
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


@cache
def chopra(n):
    """Return the frame's response to its spectrum by its first n modes."""
    spectrum = Tabulated.of(1 / SPECTRUM[::-1, 0], G * SPECTRUM[::-1, 1])
    outputs = [(2, "x"), (4, "x")]
    return solve_spectrum(
        assemble(chopra_frame()), {"x": spectrum}, outputs, n_modes=n, combination="srss", missing_mass=False
    )


MOMENTS_AT = ((4, 0), (5, 0), (0, 1), (0, 0), (2, 1), (2, 0))
"""Lines and their ends."""


def _chopra():
    first, both = (np.abs(chopra(n).line_forces[:, :, 4]) / 12 for n in (1, 2))
    second = np.sqrt(np.maximum(both**2 - first**2, 0))
    periods = 1 / chopra(2).modes.frequency
    moments = [[m[place] for place in MOMENTS_AT] for m in (first, second)]
    return [periods, chopra(2).displacement, *moments]


def _four_storeys():
    """Return ENERCALC's F-08 with bars of 1 m as the columns' stiffness; N, m and kg.

    Forces of 14.7, 29.4, 29.4 and 44.1 kN become masses.
    """
    E = 199.948e9
    areas = np.array([16, 12, 8, 4]) * 1e-6  # from the ground
    masses = np.array([44.1, 29.4, 29.4, 14.7]) * 1e3 / 9.80665
    model = chain(E * areas, masses, 0.05)
    modes = solve_modes(assemble(model), 3)
    # its spectrum has straight lines in period between points, not in logarithms
    sa = np.interp(1 / modes.frequency, np.arange(0, 7) / 10, [0.15, 0.18, 0.25, 0.38, 0.5, 0.5, 0.4])
    spectrum = Tabulated.of(modes.frequency, 9.80665 * sa)
    outputs = [(k, "x") for k in range(1, 5)]
    more = {"combination": "srss", "missing_mass": False}
    found = [solve_spectrum(assemble(model), {"x": spectrum}, outputs, n_modes=n, **more) for n in (1, 2)]
    squares = np.diff([np.zeros(4), *(f.displacement**2 for f in found)], axis=0)
    return [1 / modes.frequency, *(100 * np.sqrt(squares))]


def _vm68():
    """Return frequencies and root mean squares of the accelerations relative to the base."""
    system = assemble(chain([42832.0, 32416.0], [0.5, 1.0], 0.02))
    white = Tabulated.of([10, 100], [0.1, 0.1])
    found = solve_random(system, [(1, "x"), (2, "x")], base={"x": white}, relative=True)
    return [solve_modes(system, 2).frequency, found.rms]


def _vierck(method):
    """Return displacements of two masses of 2 kg at 1.3 and 2.4 s; 50 N on the outer one for 1.8 s.

    Springs of 16 N/m to the ground and 6 N/m.
    """
    model = chain([16.0, 6.0], [2.0, 2.0], 0.0)
    h, end = 1e-3, 1.8
    t = h * np.arange(2401)
    load = np.zeros(model.n_dof)
    load[12] = 50.0
    # half of it at the last sample: the straight line between samples then has the pulse's area
    pulse = (t < end - h / 2) + 0.5 * (abs(t - end) < h / 2)
    excitation = Excitation.of(model, t, load, pulse)
    u = solve_transient(
        assemble(model), excitation, [(2, "x"), (1, "x")], method=method, n_modes=2
    ).displacement
    return u[[1300, 2400]]


PROBLEMS = (
    Problem(
        name="SAP2000 1-020",
        title="two-storey frame under a design spectrum (Chopra, Dynamics of Structures, 1995)",
        quantities=(
            Quantity(
                name="periods", unit="s", printed="1.562 0.5868", allowance=3e-5, reason="g of 386 in/s²"
            ),
            Quantity(
                name="displacements",
                unit="in",
                printed="7.566 18.81",
                allowance=2e-3,
                reason="the book has g = 386 in/s² and three digits of the spectrum",
            ),
            Quantity(
                name="moments of mode 1",
                unit="kip·ft",
                printed="814 396 425 968 396 389",
                allowance=3e-3,
                reason="the same",
            ),
            Quantity(
                name="moments of mode 2",
                unit="kip·ft",
                printed="57 179 374 412 179 317",
                allowance=5e-3,
                reason="here differences of squares of those of both modes",
            ),
        ),
        compute=_chopra,
    ),
    Problem(
        name="ENERCALC F-08",
        title="shear building of four storeys under a spectrum",
        quantities=(
            Quantity(
                name="periods", unit="s", printed="0.5789 0.2595 0.1873", allowance=3e-4, reason="rounded g"
            ),
            Quantity(
                name="displacements of mode 1",
                unit="cm",
                printed="1.22125 2.57982 4.04779 5.19545",
                allowance=1e-3,
                reason="rounded periods, at which the spectrum is read",
            ),
            Quantity(
                name="displacements of mode 2",
                unit="cm",
                printed="0.175157 0.216095 0.0398752 0.400257",
                allowance=5e-3,
                reason="rounded periods, at which the spectrum is read",
            ),
        ),
        compute=_four_storeys,
    ),
    Problem(
        name="ANSYS VM68",
        title="random vibration of two masses (Vierck, 1979); lb, inch, g",
        quantities=(
            Quantity(name="frequencies", unit="Hz", printed="20.57 64.88"),
            Quantity(
                name="relative accelerations, root mean squares",
                unit="g",
                printed="9.059 10.63",
                allowance=6e-4,
                reason="the manual integrates by steps of 0.001 Hz",
            ),
        ),
        compute=_vm68,
    ),
    Problem(
        name="ANSYS Mechanical 039",
        title="pulse on two masses (Vierck, 1979, section 5-8)",
        quantities=(
            Quantity(
                name="displacements at 1.3 and 2.4 s, by modes", unit="m", printed="14.48 3.99 18.32 6.14"
            ),
            Quantity(name="the same, by Newmark's method", unit="m", printed="14.48 3.99 18.32 6.14"),
        ),
        compute=lambda: [_vierck("modal"), _vierck("newmark")],
    ),
)
