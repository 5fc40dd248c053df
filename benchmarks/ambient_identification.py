"""Scatter of identified ambient modes beside their stated deviations: the table of docs/ambient-vibration.md.

python -m benchmarks.ambient_identification
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment
from scipy.signal import lfilter

from updating import identify_ambient

Floats = NDArray[np.float64]
ZETA = 0.01
FAR = 6.0
"""A mode that is farther from the true one than so many standard deviations is another [-]."""


def chain(n: int, stiffness: float) -> tuple[Floats, Floats]:
    """Return natural frequencies [Hz] and shapes of equal masses on equal springs, clamped at one end."""
    i = np.arange(1, n + 1)
    f = np.sqrt(stiffness) * np.sin((2 * i - 1) * np.pi / (4 * n + 2)) / np.pi
    return f, 2 / np.sqrt(2 * n + 1) * np.sin(np.outer(i, (2 * i - 1) * np.pi / (2 * n + 1)))


def pairs() -> tuple[Floats, Floats]:
    """Return twenty modes in pairs 0.5 % apart: two chains of ten, seen along turned axes, at six places."""
    (f, phi), (g, psi) = chain(10, 4e4), chain(10, 4.04e4)
    c, s = np.cos(0.6), np.sin(0.6)
    both = np.block([[c * phi, -s * psi], [s * phi, c * psi]])
    order = np.argsort(np.concatenate([f, g]))
    return np.concatenate([f, g])[order], both[:, order]


def response(f: Floats, phi: Floats, rate: float, n: int, rng: np.random.Generator) -> Floats:
    """Return accelerations at all places under forces that are random and constant over each sample."""
    still = int(8 / (2 * np.pi * ZETA * f.min()) * rate)
    force = rng.standard_normal((n + still, len(phi)))
    y = np.zeros_like(force)
    for k, omega in enumerate(2 * np.pi * f):
        omega_d = omega * np.sqrt(1 - ZETA**2)
        e, c, s = np.exp(-ZETA * omega / rate), np.cos(omega_d / rate), np.sin(omega_d / rate)
        rise = [1.0, -e * (c + ZETA * omega / omega_d * s)]
        q = lfilter(np.convolve(rise, [1, -1]), [1, -2 * e * c, e * e], force @ phi[:, k])
        y += np.outer(q, phi[:, k])
    return np.asarray(y[still:], dtype=float)


def noisy(y: Floats, part: float, rng: np.random.Generator) -> Floats:
    """Return channels with noise in parts of their root mean square."""
    return y + part * y.std(axis=0) * rng.standard_normal(y.shape)


def varied(y: Floats, phase: float) -> Floats:
    """Return responses to coloured forces whose level varies by a factor of five."""
    level = np.exp(0.8 * np.sin(np.linspace(0, 7, len(y)) + phase))
    return np.asarray(lfilter([1], [1, -0.6, 0.3], y, axis=0), dtype=float) * level[:, None]


def measure(
    name: str, f: Floats, rate: float, band: tuple[float, float], record: Callable[[int], Floats], n: int
) -> None:
    """Print a row: modes found, scatter of scores, coverage, and scatter over the least possible."""
    false, of_f, of_zeta, best_f, best_zeta = 0, [], [], [], []
    for seed in range(n):
        y = record(seed)
        found = identify_ambient(y, rate, band=band)
        zeta = np.asarray(found.modes.zeta, dtype=float)
        score = (found.modes.frequency[:, None] - f) / found.frequency_std[:, None]
        rows, columns = linear_sum_assignment(np.minimum(np.abs(score), 3 * FAR))
        good = np.abs(score[rows, columns]) < FAR
        rows, columns = rows[good], columns[good]
        false += found.modes.n_modes - len(rows)
        least = np.sqrt(ZETA / (2 * np.pi * f[columns] * len(y) / rate))
        of_f += score[rows, columns].tolist()
        of_zeta += ((zeta[rows] - ZETA) / found.zeta_std[rows]).tolist()
        best_f += ((found.modes.frequency[rows] / f[columns] - 1) / least).tolist()
        best_zeta += ((zeta[rows] - ZETA) / least).tolist()
    words = [f"{len(of_f)} of {n * len(f)}, {false} false"]
    if of_f:
        a, b, c, d = (np.array(x) for x in (of_f, of_zeta, best_f, best_zeta))
        root, inside = (lambda x: np.sqrt((x**2).mean())), (lambda x: 100 * (np.abs(x) < 1.96).mean())
        words += [f"{root(a):.2f} / {root(b):.2f}", f"{inside(a):.0f} % / {inside(b):.0f} %"]
        # the median of squares of normal numbers is 0.455: one record that went wrong does not count alone
        words.append(" / ".join(f"{np.sqrt(np.median(x**2) / 0.4549):.2f}" for x in (c, d)))
    print(f"| {name}, {n} records | {' | '.join(words)} |", flush=True)


def main() -> None:
    """Print the table."""
    f, phi = chain(4, 1000.0)
    rng = np.random.default_rng
    for n in (2000, 4000, 20_000):

        def plain(seed: int, n: int = n) -> Floats:
            return noisy(response(f, phi, 40.0, n, rng(seed)), 0.05, rng(1000 + seed))

        measure(f"{n // 40} s", f, 40.0, (1, 16), plain, 40)

    def coloured(seed: int) -> Floats:
        return noisy(varied(response(f, phi, 40.0, 12_000, rng(seed)), seed), 0.1, rng(1000 + seed))

    measure("300 s, coloured forces whose level varies", f, 40.0, (1, 16), coloured, 40)
    g, psi = pairs()
    places = [2, 5, 9, 12, 15, 19]
    measure(
        "20 modes in pairs 0.5 % apart, 6 channels, 600 s",
        g,
        160.0,
        (3, 66),
        lambda seed: noisy(response(g, psi, 160.0, 96_000, rng(seed))[:, places], 0.1, rng(1000 + seed)),
        10,
    )
    measure(
        "noise alone, 200 s",
        f,
        40.0,
        (1, 16),
        lambda seed: lfilter([1], [1, -0.5], rng(seed).standard_normal((8000, 4)), axis=0),
        40,
    )


if __name__ == "__main__":
    main()
