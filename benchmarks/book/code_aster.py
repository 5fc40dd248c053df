"""Test cases of code_aster: those of the guide VPCS (SDLL, SSLL), and both its numbers and those computed.

https://gitlab.com/codeaster/src, folder astest; SFM, Guide de validation des progiciels de calcul de
structures (1990).
"""

import warnings
from dataclasses import replace

import numpy as np

from benchmarks.book import code_aster_models as models
from benchmarks.book.entry import Problem, Quantity
from tests.benchmarks.test_beams_closed_form import timoshenko_pinned
from tests.benchmarks.test_lateral_buckling import arch_factors, right_angle_factor

ITERATED = {"allowance": 1e-7, "reason": "its iteration for two near modes"}
ROUNDED = {"allowance": 1e-8, "reason": "rounding of both programs"}


def _theirs(name, unit, printed, **more):
    """Return a quantity that code_aster computes on the same mesh, with the digits that it prints."""
    return Quantity(name=f"{name}, code_aster", unit=unit, printed=printed, **(ROUNDED | more))


def _short_beam_exactly():
    """Return the closed form of SDLL01: bending of Timoshenko's theory, and odd quarter waves along it."""
    upright = replace(models.SHORT, Iy=models.SHORT.Iz)
    bending = [timoshenko_pinned(m, 1.0, models.STEEL, upright)[0] for m in (1, 2, 3, 4)]
    speed = np.sqrt(models.STEEL.E / models.STEEL.rho)
    return np.sort([*bending, speed / 4, 3 * speed / 4])


def _arch():
    with warnings.catch_warnings():  # of the displacements before it buckles, which the reference leaves out
        warnings.simplefilter("ignore", UserWarning)
        return [arch_factors(4)]


DYNAMICS = (
    Problem(
        name="SDLL01",
        title="short beam on two supports",
        quantities=(
            Quantity(
                name="frequencies, supports on the axis",
                unit="Hz",
                printed="431.555 1265.924 1498.295 2870.661 3797.773 4377.837",
                allowance=6e-4,
                reason="mesh of 80 elements",
                exact=_short_beam_exactly,
                proof="bending frequencies are up to 0.3 % off the roots of Timoshenko's frequency equation",
            ),
            _theirs(
                "frequencies, supports 0.1 m below",
                "Hz",
                "394.477395644 922.607263469 1638.23105 2778.69999 3261.66994",
                allowance=6e-4,
                reason="mesh of 40 elements there, of 80 here",
            ),
        ),
        compute=lambda: [models.short_beam(0.0), models.short_beam(0.1)[:5]],
        remark="with supports below the axis the guide's approximation is 0.4 to 6 % off code_aster",
    ),
    Problem(
        name="SDLL02",
        title="cantilever folded back on itself",
        quantities=(
            Quantity(
                name="frequencies",
                unit="Hz",
                printed="11.76 11.76 105.88 105.88 294.1 294.1 576.44 576.44",
                allowance=1e-3,
                reason="mesh of ten elements a half: (βh)⁴/1440",
            ),
            _theirs(
                "frequencies",
                "Hz",
                "11.7641834045 11.7641834381 105.881130032 105.881203672 294.177995325 294.180625511 "
                "576.98022671 577.007933722",
            ),
        ),
        compute=lambda: [models.folded_beam()] * 2,
    ),
    Problem(
        name="SDLL04",
        title="pinned beam with a tuned sprung mass of 0, 0.1 and 1 % of its own",
        quantities=(
            Quantity(
                name="frequencies without",
                unit="Hz",
                printed="1.5707 6.2831",
                allowance=3e-4,
                reason="shear, which the guide leaves out",
            ),
            Quantity(
                name="frequencies, 0.1 %",
                unit="Hz",
                printed="1.5460 1.5958",
                allowance=1e-4,
                reason="shear, which the guide leaves out",
            ),
            _theirs("frequencies, 0.1 %", "Hz", "1.54603758626 1.5957059479 6.28166736164", **ITERATED),
            Quantity(
                name="frequencies, 1 %",
                unit="Hz",
                printed="1.4937 1.6506 6.2874",
                allowance=4e-4,
                reason="shear, which the guide leaves out",
            ),
            _theirs("frequencies, 1 %", "Hz", "1.49362757399 1.65058296308 6.28543844831", **ITERATED),
        ),
        compute=lambda: [
            models.with_oscillator(0.0)[:2],
            models.with_oscillator(1e-3)[:2],
            models.with_oscillator(1e-3),
            *2 * [models.with_oscillator(1e-2)],
        ],
        remark="the guide prints 6.2336 Hz for mode 3 with 0.1 %, between its other two rows of 6.28 Hz",
    ),
    Problem(
        name="SDLL06",
        title="mass on a spring, its base accelerated by a triangle of 50 ms",
        quantities=(
            _theirs(
                "displacements relative to the base",
                "m",
                "-6.49464794e-5 -2.18267893e-4 -5.13564438e-4 -8.80599477e-4 -1.11454464e-3 -1.67908346e-3 "
                "-2.52313040e-3 -3.45738926e-3 -4.41191920e-3 -5.14280698e-3 -5.48510584e-3 -6.10941810e-3 "
                "-6.76530517e-3 -7.26925524e-3 -7.60995044e-3 -7.77973937e-3 -7.77480885e-3 -7.59526962e-3",
                allowance=6e-5,
                reason="central differences of 0.5 ms there, exact steps here",
            ),
        ),
        compute=lambda: [models.shaken_mass()],
    ),
    Problem(
        name="SDLL08",
        title="grid of hinged beams",
        quantities=(
            Quantity(
                name="frequencies 1, 3",
                unit="Hz",
                printed="16.456 38.165",
                allowance=3.2e-3,
                reason="approximation of the guide; code_aster's own number follows",
            ),
            _theirs("frequencies 1, 3", "Hz", "16.419020194 38.046795004"),
            _theirs("deflections at 80 rad/s", "m", "-0.100377195 -0.227396528"),
        ),
        compute=lambda: [
            models.grid_results()[0],
            models.grid_results()[0],
            np.ravel(models.grid_results()[1])[:2],
        ],
    ),
    Problem(
        name="SDLL09",
        title="cantilevers that taper to a square",
        quantities=(
            Quantity(
                name="frequencies, 40 by 40 to 10 by 10 mm",
                unit="Hz",
                printed="54.18 171.94 384.40 697.24 1112.28",
                allowance=2.5e-4,
                reason="the guide's numbers are 0.02 to 0.03 % below those of Bessel's functions",
            ),
            Quantity(
                name="frequencies, 50 by 40 to 10 by 10 mm",
                unit="Hz",
                printed="56.55 175.19 389.01 702.36 1117.63",
                allowance=1e-4,
                reason="mesh of 30 elements",
                exact=models.wedge_exactly,
                proof="the differential equation gives 175.83 Hz for mode 2, which is 0.36 % more",
            ),
        ),
        compute=lambda: [
            models.tapered_cantilever((0.04, 0.04), (0.01, 0.01)),
            models.tapered_cantilever((0.05, 0.04), (0.01, 0.01)),
        ],
    ),
    Problem(
        name="SDLL10",
        title="clamped beam of exponential width",
        quantities=(
            Quantity(
                name="frequencies",
                unit="Hz",
                printed="143.303 396.821 779.425 1289.577",
                allowance=2e-6,
                reason="mesh of 60 elements",
                exact=models.narrowing_exactly,
                proof=(
                    "the closed form gives 145.877 Hz for mode 1, 1.8 % more: a beam that narrows between "
                    "clamps vibrates faster than the uniform one (144.64 Hz), not slower"
                ),
            ),
        ),
        compute=lambda: [models.narrowing_beam()],
    ),
    Problem(
        name="SDLL15",
        title="cantilever with a mass at or beside its end",
        quantities=(
            _theirs(
                "frequencies, mass at the end",
                "Hz",
                "1.655433398 1.655433398 16.071161667 16.071161667 50.023996028 50.023996028 76.472717539 "
                "80.468757907 103.204375129 103.204375129",
            ),
            Quantity(
                name="frequencies, mass 1 m beside it",
                unit="Hz",
                printed="1.636 1.642 13.46 13.59 28.90 31.96 61.62 63.93",
                allowance=2e-4,
                reason="the guide's own mesh",
            ),
            _theirs(
                "frequencies, mass 1 m beside it",
                "Hz",
                "1.63632661089 1.64164565077 13.4551406844 13.5918959130 28.8971786385 31.9593814621 "
                "61.6090927260 63.9289417127",
            ),
        ),
        compute=lambda: [models.end_mass(0.0), *2 * [models.end_mass(1.0)[:8]]],
    ),
)

STATICS = (
    Problem(
        name="SSLL10",
        title="four members of a node",
        quantities=(
            Quantity(
                name="rotation of the node",
                unit="rad",
                printed="0.227118",
                allowance=1.5e-3,
                reason="the guide's solution leaves out stretching and shear",
            ),
            _theirs("rotation of the node", "rad", "0.227441498"),
            _theirs("moments at the node", "N·m", "-11020.9874 -113.717904875 12347.4765 -1212.77121"),
        ),
        compute=lambda: [*2 * [models.branching_frame()[0]], models.branching_frame()[1]],
    ),
    Problem(
        name="SSLL11",
        title="truss of four bars",
        quantities=(
            Quantity(
                name="displacements of C and D",
                unit="m",
                printed="2.6517e-4 8.839e-5 3.47902e-3 -5.60084e-3",
                exact=models.four_bars_by_unit_loads,
                proof="the unit-load theorem gives -5.60035e-3 m for the last",
            ),
        ),
        compute=models.four_bars,
    ),
    Problem(
        name="SSLL12",
        title="truss with a support at 30°: heat, forces, settlements, all",
        quantities=tuple(
            quantity
            for name, guide, computed in models.TRUSS_FORCES
            for quantity in (
                Quantity(
                    name=f"forces, {name}",
                    unit="N",
                    printed=guide,
                    allowance=1.3e-3,
                    reason="approximation of the guide; code_aster's own number follows",
                ),
                _theirs(f"forces, {name}", "N", computed),
            )
        ),
        compute=lambda: [forces for forces in models.inclined_truss() for _ in (0, 1)],
    ),
    Problem(
        name="SSLL14",
        title="hinged portal with a pitched roof",
        quantities=(
            Quantity(
                name="displacements of the ridge, cases 1 to 5",
                unit="m",
                printed=(
                    "0.0110476 -0.0124228 0 -0.0149733 -0.0300095 -0.00299466 0.0273532 -0.00121564 "
                    "0.00839124 -0.03160598"
                ),
                allowance=6e-5,
                reason="approximation of the guide; code_aster's own numbers follow",
            ),
            Quantity(
                name="reactions at A, cases 1 to 5",
                unit="N",
                printed="5175.37 24233.2 4881.48 10000 5976.30 4000 4576.40 -5000 20609.548 33233.24",
                allowance=2e-6,
                reason="approximation of the guide; code_aster's own numbers follow",
            ),
            _theirs(
                "reactions at A, cases 1 to 5",
                "N",
                "5175.35661567 24233.2416337 4881.46908848 10000.0000003 5976.30525471 3999.9999966 "
                "4576.3846712 -4999.99999679 20609.5156301 33233.2416337",
            ),
        ),
        compute=lambda: [models.pitched_portal()[0], *2 * [models.pitched_portal()[1]]],
    ),
    Problem(
        name="SSLL105",
        title="lateral buckling of a right angle (Argyris et al. 1979)",
        quantities=(
            Quantity(
                name="forces towards and away from the clamp",
                unit="N",
                printed="0.680 1.088",
                allowance=1e-3,
                reason="mesh of 16 elements a leg: (kh)²/24",
            ),
        ),
        compute=lambda: [[right_angle_factor(16, -1.0), right_angle_factor(16, 1.0)]],
    ),
    Problem(
        name="SSLL404",
        title="lateral buckling of an arch (Timoshenko and Gere)",
        quantities=(
            Quantity(
                name="moments",
                unit="N·m",
                printed="2.86074 8.63207 -8.78382 14.4147",
                allowance=6e-3,
                reason="mesh of 36 straight elements; the arch bends before it buckles",
            ),
        ),
        compute=_arch,
    ),
)

PROBLEMS = (*DYNAMICS, *STATICS)
