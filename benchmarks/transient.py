"""Time the responses in time of cubic grids in Dovetail and OpenSees, and compare what they find.

    python -m benchmarks.transient [--steps N] [points per side …]

Sizes are 17 unless given, 27 744 free directions; 8 has 2 688. A pulse pushes the last corner. Dovetail
superposes its first modes over 10 000 steps. Step by step, Dovetail and OpenSees take a few steps of the
same history, from which 10 000 are extrapolated: the first step has assembly and factorisation, the others
cost alike. CPU seconds of one thread; ratios within a run are what to compare.
"""

import argparse
import sys
import tempfile
from pathlib import Path

import numpy as np

from benchmarks.peers.__main__ import cube
from benchmarks.peers.exchange import PEERS_PYTHON, PeerFrame, PeerResult, run, with_changes

N_STEPS = 10_000
N_MODES = 60
LEAST_STEPS = 2
OPENSEES = "SparseSYM AMD -genBandArpack"


def pushed(n: int, first: float) -> PeerFrame:
    """Return a cube whose last corner is pushed for a period, and swings; 40 steps a period."""
    frame = cube(n)
    step = 1 / first / 40
    t = step * np.arange(N_STEPS + 1)
    corner = 6 * (len(frame.points) - 1)
    return with_changes(
        frame,
        static=False,
        history=np.sin(np.pi * np.minimum(t * first, 1)) ** 2,
        step=step,
        alpha=0.02 * first,
        beta=0.001 / first,
        watched=np.array([corner, corner + 1, corner + 2]),
    )


def stepped(
    frame: PeerFrame, driver: str, python: Path, steps: int, folder: Path
) -> tuple[PeerResult, float]:
    """Return the responses of some steps, and seconds extrapolated to all."""
    few, many = (
        with_changes(frame, history=frame.history[: k + 1], options=OPENSEES) for k in (LEAST_STEPS, steps)
    )
    short, long = run(driver, [few, many], folder, python)
    each = (long.transient_seconds - short.transient_seconds) / (steps - LEAST_STEPS)
    return long, short.transient_seconds + each * (N_STEPS - LEAST_STEPS)


def compare(n: int, steps: int) -> str:
    """Return the table of one size."""
    here = Path(sys.executable)
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        (modes,) = run("drive_dovetail", [with_changes(cube(n), static=False, n_modes=1)], place, here)
        frame = pushed(n, float(modes.frequency[0]))
        (modal,) = run("drive_dovetail", [with_changes(frame, way="modal", n_modes=N_MODES)], place, here)
        ours, our_seconds = stepped(frame, "drive_dovetail", here, steps, place)
        theirs, their_seconds = stepped(frame, "drive_opensees", PEERS_PYTHON, steps, place)
    size = np.abs(theirs.responses).max(axis=0)
    digits = -np.log10(np.max(np.abs(ours.responses - theirs.responses) / size))
    apart = np.max(np.abs(modal.responses[: steps + 1] - theirs.responses) / size)
    rows = (
        (f"Dovetail, {N_MODES} modes", modal.transient_seconds),
        ("Dovetail, Newmark", our_seconds),
        ("OpenSees, Newmark", their_seconds),
    )
    return "\n".join(
        (
            f"cube of {n}³ points, {frame.n_free} free directions, {N_STEPS} steps; {theirs.program}",
            f"CPU seconds; Newmark's are extrapolated from {steps} steps",
            *(f"{word:22s}{s:10.1f}{s / modal.transient_seconds:9.1f}×" for word, s in rows),
            f"Newmark of both: {digits:.1f} digits of the largest displacement; modes and Newmark: "
            f"{100 * apart:.2g} % apart",
            "",
        )
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("sizes", nargs="*", type=int, default=[17], help="points per side")
    parser.add_argument("--steps", type=int, default=40, help="steps of Newmark's method that are timed")
    arguments = parser.parse_args()
    for size in arguments.sizes:
        print(compare(size, arguments.steps), flush=True)
