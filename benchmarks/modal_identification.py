"""Identify 14 modes, two at 88.0 and 89.2 Hz, from 3 x 60 FRFs in noise; beside sdypy-EMA if it is there.

OPENBLAS_NUM_THREADS=1 python -m benchmarks.modal_identification
OPENBLAS_NUM_THREADS=1 python -m benchmarks.modal_identification lines

The second command identifies 20 and 40 modes from 51 200 lines of nine FRFs, with one, three and nine forces.

sdypy-EMA runs under an interpreter of its own, `.venv-peers/bin/python` or that of DOVETAIL_PEERS_PYTHON,
after `make peers`. It takes the poles nearest to given frequencies: it gets the true ones.
"""

import subprocess
import sys
import tempfile
import time
import warnings
from pathlib import Path

import numpy as np

from benchmarks.peers.exchange import PEERS_PYTHON
from fem import FRF
from updating import identify_modes
from updating.correlation import mac

FREQUENCY = np.array(
    [14.2, 23.7, 31.0, 44.5, 52.3, 63.8, 75.1, 88.0, 89.2, 104.6, 121.3, 139.9, 158.2, 181.7]
)
RATIO = np.array([1.1, 0.8, 0.6, 0.9, 0.5, 0.7, 1.2, 0.6, 0.8, 0.5, 0.9, 0.7, 0.6, 0.8]) / 100

DRIVER = """
import sys, time, warnings
import numpy as np
import sdypy.EMA as EMA
warnings.simplefilter("ignore")
data = np.load(sys.argv[1])
H, order = data["H"], int(sys.argv[3])
frf = H.transpose(2, 1, 0).reshape(-1, len(H))  # as many locations as there are FRFs
start = time.process_time()
model = EMA.Model(frf, data["lines"], lower=5, upper=float(data["lines"][-1]), pol_order_high=order)
model.get_poles(method="lscf", show_progress=False)
model.select_closest_poles(data["frequency"].tolist(), f_window=2)
_, A = model.get_constants()
seconds = time.process_time() - start
n_out = H.shape[1]
first = np.asarray(A).reshape(H.shape[2], n_out, -1)[0]
np.savez(sys.argv[2], frequency=model.nat_freq, ratio=model.nat_xi, shapes=first, seconds=seconds)
"""


def measured(noise: float, rng: np.random.Generator) -> tuple[FRF, np.ndarray]:
    """Return FRFs of real modes with noise of a part of each FRF's root mean square, and the shapes."""
    phi = rng.standard_normal((60, FREQUENCY.size)) / 3
    places = [0, 20, 41]
    lines = np.linspace(0, 200, 1601)
    w, wn = 2 * np.pi * lines[:, None], 2 * np.pi * FREQUENCY
    H = (phi * (-(w**2) / (wn**2 - w**2 + 2j * RATIO * wn * w))[:, None]) @ phi[places].T
    size = noise * np.sqrt((np.abs(H) ** 2).mean(axis=0) / 2)
    H = H + size * (rng.standard_normal(H.shape) + 1j * rng.standard_normal(H.shape))
    labels = [f"{k + 1}Z+" for k in range(60)]
    return FRF.from_arrays(lines, H, "accelerance", labels, [labels[k] for k in places]), phi


def row(
    name: str, frequency: np.ndarray, ratio: np.ndarray, shapes: np.ndarray, phi: np.ndarray, seconds: float
):
    near = [int(np.argmin(np.abs(frequency - f))) for f in FREQUENCY]
    found = len({k for k, f in zip(near, FREQUENCY, strict=True) if abs(frequency[k] / f - 1) < 5e-3})
    alike = mac(shapes[:, near], phi).diagonal()
    print(
        f"{name:28s} {found:2d} of 14, {len(frequency) - found:2d} others   "
        f"frequency {100 * np.abs(frequency[near] / FREQUENCY - 1).max():8.5f} %   "
        f"ratio {100 * np.abs(ratio[near] / RATIO - 1).max():7.3f} %  MAC {alike.min():.6f}  {seconds:5.2f} s"
    )


def sdypy(data: FRF, order: int) -> dict[str, np.ndarray]:
    with tempfile.TemporaryDirectory() as folder:
        given, result = Path(folder) / "given.npz", Path(folder) / "result.npz"
        np.savez(given, H=data.H, lines=data.frequency, frequency=FREQUENCY)
        command = [str(PEERS_PYTHON), "-c", DRIVER, str(given), str(result), str(order)]
        subprocess.run(command, check=True, capture_output=True, text=True)
        with np.load(result) as found:
            return dict(found)


def many_lines(n_out: int, n_in: int, n_modes: int, rng: np.random.Generator) -> tuple[FRF, np.ndarray]:
    """Return 51 200 lines up to 3200 Hz of random modes with noise of 1 %, and the poles."""
    lines = np.linspace(0.0625, 3200, 51200)
    f, ratio = np.sort(rng.uniform(32, 3136, n_modes)), rng.uniform(0.002, 0.012, n_modes)
    phi = rng.standard_normal((9, n_modes))
    w, wn = 2 * np.pi * lines[:, None], 2 * np.pi * f
    terms = -(w**2) / (wn**2 - w**2 + 2j * ratio * wn * w)
    H = (terms @ (phi[:n_out, None] * phi[:n_in]).reshape(-1, n_modes).T).reshape(-1, n_out, n_in)
    size = 0.01 * np.sqrt((np.abs(H) ** 2).mean(axis=0) / 2)
    H = H + size * (rng.standard_normal(H.shape) + 1j * rng.standard_normal(H.shape))
    labels = [f"{k + 1}Z+" for k in range(9)]
    poles = wn * (-ratio + 1j * np.sqrt(1 - ratio**2))
    return FRF.from_arrays(lines, H, "accelerance", labels[:n_out], labels[:n_in]), poles


def identify_many_lines() -> None:
    """Print modes found, errors over half-widths and over stated deviations, and time of one core."""
    for n_out, n_in in ((9, 1), (3, 3), (1, 9)):
        for n_modes in (20, 40):
            data, poles = many_lines(n_out, n_in, n_modes, np.random.default_rng(0))
            start = time.process_time()
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", UserWarning)  # of weak modes that are left out
                found = identify_modes(data)
            seconds = time.process_time() - start
            true = poles[np.argmin(np.abs(found.poles[:, None] - poles), axis=1)]
            off = np.abs(found.poles - true) / -true.real
            score = (found.modes.frequency - np.abs(true) / (2 * np.pi)) / found.frequency_std
            print(
                f"{n_out} x {n_in} FRFs, {n_modes} modes: {len(found.poles)} found   error {off.max():.4f} "
                f"of a half-width, {np.sqrt((score**2).mean()):.2f} stated deviations rms   {seconds:.1f} s"
            )


if __name__ == "__main__":
    if "lines" in sys.argv[1:]:
        identify_many_lines()
        sys.exit()
    print("largest errors of all modes; time of one core")
    for noise in (0.01, 0.05):
        data, phi = measured(noise, np.random.default_rng(0))
        print(f"noise {100 * noise:g} % of the root mean square of each FRF")
        start = time.process_time()
        ours = identify_modes(data)
        row(
            "Dovetail",
            ours.modes.frequency,
            ours.modes.zeta,
            ours.modes.shapes,
            phi,
            time.process_time() - start,
        )
        if not PEERS_PYTHON.exists():
            print(f"sdypy-EMA: no interpreter at {PEERS_PYTHON}")
            continue
        for order in (30, 60):
            try:
                found = sdypy(data, order)
            except subprocess.CalledProcessError as reason:
                print(f"sdypy-EMA, order {order}: {reason.stderr.strip().splitlines()[-1]}")
                continue
            seconds = float(found["seconds"])
            row(
                f"sdypy-EMA, order {order}", found["frequency"], found["ratio"], found["shapes"], phi, seconds
            )
