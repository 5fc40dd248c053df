"""Time statics and 20 modes of cubic grids in Dovetail, OpenSees and PyNite, and compare what they find.

    python -m benchmarks.peers [--repeat N] [points per side …]

Sizes are 17 unless given, 27 744 free directions, which takes minutes; 8 has 2 688 and takes seconds. Each
program computes in a process of its own with one thread. Times are CPU seconds, the least of the repetitions,
with assembly and without making the model; ratios within a run are what to compare.
"""

import argparse
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

import numpy as np

from benchmarks.lattice import lattice
from benchmarks.peers.exchange import PEERS_PYTHON, PeerFrame, PeerResult, run, with_changes
from fem import Frame

N_MODES = 20
OURS = "drive_dovetail"


@dataclass(frozen=True, slots=True)
class Way:
    """A program and its settings: its driver, and options for statics and modes."""

    label: str
    driver: str
    statics: str = ""
    modes: str = ""


# OpenSees' systems of equations differ in statics and in modes. Of those left out, UmfPack took longer than
# SparseGEN for modes, ProfileSPD longer than BandSPD; SparseSYM gave negative squares of frequencies.
WAYS = (
    Way("Dovetail", OURS),
    Way("OpenSees, band", "drive_opensees", "BandSPD RCM -genBandArpack", "BandSPD RCM -genBandArpack"),
    Way("OpenSees, sparse", "drive_opensees", "SparseSYM AMD -genBandArpack", "SparseGEN RCM -genBandArpack"),
    Way("PyNite", "drive_pynite"),
)


def cube(n: int) -> PeerFrame:
    """Return the grid of `benchmarks.lattice`, Euler-Bernoulli, with a force on its last corner."""
    model = lattice(n)
    (beams,) = model.of_kind(Frame)
    properties = next(iter(beams.members.values()))
    mesh, material, section = model.mesh, properties.material, properties.section
    loads = np.zeros((mesh.n_points, 6))
    loads[-1, :3] = 300.0, -500.0, -1000.0
    one = np.ones(mesh.n_lines)
    return PeerFrame(
        points=mesh.points,
        lines=mesh.lines,
        local_z=beams.rotations(mesh)[:, 2],
        E=material.E * one,
        G=material.G * one,
        rho=material.rho * one,
        **{name: getattr(section, name) * one for name in ("A", "Iy", "Iz", "J", "ky", "kz")},
        fixed=np.repeat(mesh.points[:, 2:] == 0, 6, axis=1),
        loads=loads,
        uniform=np.zeros((mesh.n_lines, 3)),
        released=np.zeros((mesh.n_lines, 2, 2), dtype=bool),
    )


def least(results: list[PeerResult]) -> PeerResult:
    """Return one result with the least of each time."""
    times = {
        name: min(getattr(r, name) for r in results) for name in ("build", "static_seconds", "modes_seconds")
    }
    return with_changes(results[0], **times)


def solve(way: Way, frame: PeerFrame, repeat: int, folder: Path) -> PeerResult:
    """Return a program's displacements, reactions and frequencies."""
    python = Path(sys.executable) if way.driver == OURS else PEERS_PYTHON
    asked = (
        with_changes(frame, options=way.statics),
        with_changes(frame, options=way.modes, static=False, n_modes=N_MODES),
    )
    static, modes = (least(run(way.driver, [wish] * repeat, folder, python)) for wish in asked)
    return with_changes(static, frequency=modes.frequency, modes_seconds=modes.modes_seconds)


def timing_table(found: Mapping[str, PeerResult]) -> str:
    """Return CPU seconds and their ratios to Dovetail's."""
    reference = next(iter(found.values()))
    rows = [f"{'':18s}{'model':>9s}{'statics':>10s}{'modes':>9s}{'statics':>12s}{'modes':>9s}"]
    for label, r in found.items():
        ratios = r.static_seconds / reference.static_seconds, r.modes_seconds / reference.modes_seconds
        rows.append(
            f"{label:18s}{r.build:9.2f}{r.static_seconds:10.2f}{r.modes_seconds:9.2f}"
            f"{ratios[0]:11.1f}×{ratios[1]:8.1f}×"
        )
    return "\n".join(rows)


def digits(a: np.ndarray, b: np.ndarray, size: np.ndarray) -> float:
    """Return to how many decimal digits of a size two arrays agree, in the worst place."""
    worst = np.max(np.abs(a - b) / size)
    return float(-np.log10(max(worst, 1e-16))) if np.isfinite(worst) else 0.0


def agreement_table(found: Mapping[str, PeerResult]) -> str:
    """Return the digits to which every two programs agree."""
    rows = [f"{'':38s}{'displacements':>14s}{'reactions':>11s}{'frequencies':>13s}"]
    for (first, a), (second, b) in combinations(found.items(), 2):
        same = [
            min(
                digits(x[:, kind], y[:, kind], np.abs(x[:, kind]).max())
                for kind in (slice(0, 3), slice(3, 6))
            )
            for x, y in ((a.displacements, b.displacements), (a.reactions, b.reactions))
        ]
        frequencies = digits(a.frequency, b.frequency, a.frequency)
        rows.append(f"{first + ' and ' + second:38s}{same[0]:14.1f}{same[1]:11.1f}{frequencies:13.1f}")
    return "\n".join(rows)


def compare(n: int, repeat: int) -> str:
    """Return the tables of one size."""
    frame = cube(n)
    with tempfile.TemporaryDirectory() as folder:
        found = {way.label: solve(way, frame, repeat, Path(folder)) for way in WAYS}
    programs = ", ".join(sorted({r.program for r in found.values()}))
    return "\n".join(
        (
            f"cube of {n}³ points, {frame.n_free} free directions, {N_MODES} modes; {programs}",
            "CPU seconds, and their ratios to Dovetail's",
            timing_table(found),
            "",
            "who agrees with whom: decimal digits in the worst place, of the largest displacement, rotation,",
            "force and moment, and of each frequency",
            agreement_table(found),
            "",
        )
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("sizes", nargs="*", type=int, default=[17], help="points per side")
    parser.add_argument("--repeat", type=int, default=1, help="runs of each; the least time counts")
    arguments = parser.parse_args()
    for size in arguments.sizes:
        print(compare(size, arguments.repeat), flush=True)
