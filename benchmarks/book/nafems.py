"""NAFEMS benchmarks for the free vibration of beams: FV2, FV3, FV4 and FV5.

NAFEMS, Selected Benchmarks for Natural Frequency Analysis (1987), also printed in manuals of many codes.
`tests/literature/test_nafems.py` predicts the deviations of coarse meshes.
"""

import numpy as np

from benchmarks.book.entry import Problem, Quantity
from fem import AddedMass, Frame, Material, MemberProperties, Mesh, Model, Section, assemble, solve_modes
from tests.frames import beam, fix, planar

STEEL = Material("steel", 200e9, 8000.0, nu=0.3)
IN_PLANE = ("x", "y", "rz")


def frequencies(model, n):
    """Return the elastic natural frequencies among the lowest n."""
    modes = solve_modes(assemble(model), n)
    return modes.frequency[modes.n_rigid :]


def stretchless(section, material):
    """Return the same beam with ten thousand times the axial stiffness: same EI and mass per length."""
    stiff = Section(A=section.A * 1e4, Iy=section.Iy, Iz=section.Iz, J=section.J)
    return Material(material.name, material.E, material.rho / 1e4), stiff


FV2 = np.array([11.336] + 7 * [17.709] + [45.345] + 7 * [57.390])


def double_cross(n, material, section):
    """Return FV2: eight arms of 5 m with pinned ends."""
    angle = 2 * np.pi * np.arange(8) / 8
    points = np.vstack([np.zeros(3), 5.0 * np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])])
    arms = {f"arm{i}": [i] for i in range(8)}
    mesh = Mesh.from_lines(points, [[0, i + 1] for i in range(8)], arms).split(n)
    p = MemberProperties(material, section, theory="euler-bernoulli")
    ends = tuple(fix(i + 1, ("x", "y")) for i in range(8))
    return planar(Model(mesh, (Frame(members=dict.fromkeys(mesh.members, p)), *ends)), IN_PLANE)


FV3 = "3.261 5.668 11.136 11.136 12.849"


def square_frame(n, theory, material, section):
    """Return FV3: a free square of 10 m."""
    points = [[0, 0, 0], [10, 0, 0], [10, 10, 0], [0, 10, 0]]
    sides = {f"side{i}": [i] for i in range(4)}
    mesh = Mesh.from_lines(points, [[0, 1], [1, 2], [2, 3], [3, 0]], sides).split(n)
    p = MemberProperties(material, section, theory=theory)
    return planar(Model(mesh, (Frame(members=dict.fromkeys(mesh.members, p)),)), IN_PLANE)


FV4 = "1.723 1.727 7.413 9.972 18.155 26.957"


def with_masses(theory):
    """Return FV4: a cantilever of 10 m with two masses beside its end."""
    masses = [
        AddedMass(name=f"m{i}", point=1, mass=m, arm=np.array([0, y, 0]))
        for i, (m, y) in enumerate(((1e4, 2.0), (1e3, -2.0)))
    ]
    arms = {"section": Section.circle(0.5, nu=STEEL.nu), "material": STEEL, "effects": (fix(0), *masses)}
    return beam(40, 10.0, theory=theory, **arms)


FV5_BENDING, FV5_TORSION = "42.649 148.31 284.55", "71.20"
COWPER = 10 * (1 + 0.3) / (12 + 11 * 0.3)
"""Shear coefficient of a rectangle, ν = 0.3: Cowper, J. Appl. Mech. 33 (1966) 335-340."""


def square(a, k, J=None):
    """Return a square with a shear coefficient."""
    second = a**4 / 12
    return Section(A=a**2, Iy=second, Iz=second, J=J or 2 * second, ky=k, kz=k, label="square")


def deep_beam(section, n):
    """Return the elastic frequencies of FV5: a pinned beam of 10 m, 2 m deep."""
    ends = (fix(0, ("x", "y", "z", "rx")), fix(1, ("y", "z")))
    return frequencies(beam(n, 10.0, section=section, material=STEEL, theory="timoshenko", effects=ends), 9)


def _fv2():
    f = frequencies(double_cross(16, *stretchless(Section.rectangle(0.125, 0.125), STEEL)), 16)
    return [f]


def _fv5():
    f = deep_beam(square(2.0, COWPER), 40)
    twist = deep_beam(Section.rectangle(2.0, 2.0), 40)
    return [f[[0, 4, 7]], [f[3]], [twist[np.argmin(abs(twist - 71.2))]]]


PROBLEMS = (
    Problem(
        name="FV2",
        title="double cross with pinned ends",
        quantities=(
            Quantity(
                name="frequencies",
                unit="Hz",
                printed=" ".join(f"{f:.3f}" for f in FV2),
                allowance=3e-5,
                reason="mesh of 16 elements an arm: (βh)⁴/1440",
            ),
        ),
        compute=_fv2,
        remark="the reference leaves out stretching of the arms, and so does this model",
    ),
    Problem(
        name="FV3",
        title="free square frame",
        quantities=(
            Quantity(
                name="frequencies",
                unit="Hz",
                printed=FV3,
                allowance=2.5e-3,
                reason="the reference's own mesh",
            ),
        ),
        compute=lambda: [
            frequencies(square_frame(16, "euler-bernoulli", STEEL, Section.rectangle(0.25, 0.25)), 8)[:5]
        ],
    ),
    Problem(
        name="FV4",
        title="cantilever with masses beside its end",
        quantities=(
            Quantity(
                name="frequencies",
                unit="Hz",
                printed=FV4,
                allowance=1.5e-3,
                reason="the reference's own mesh",
            ),
        ),
        compute=lambda: [frequencies(with_masses("euler-bernoulli"), 6)[:6]],
    ),
    Problem(
        name="FV5",
        title="deep pinned beam",
        quantities=(
            Quantity(
                name="frequencies of bending",
                unit="Hz",
                printed=FV5_BENDING,
                allowance=4e-3,
                reason="the reference's shear coefficient is not stated; here that of Cowper",
            ),
            Quantity(
                name="axial frequency", unit="Hz", printed="125.00", allowance=1e-4, reason="mesh: (kh)²/24"
            ),
            Quantity(
                name="frequency of torsion",
                unit="Hz",
                printed=FV5_TORSION,
                allowance=1e-4,
                reason="mesh: (kh)²/24",
            ),
        ),
        compute=_fv5,
    ),
)
