"""Updating to FRFs with each candidate alone, and the best one by BIC: what a careful engineer would script.

E, density, joint stiffnesses within their tolerances and damping vary in all fits. With the best candidate
kept, all are tried once more beside it.
"""

import numpy as np
import scipy.linalg

from benchmarks.open_test.rivals.common import common_slopes

SOURCE = (
    "Imregun, Visser and Ewins, Mech. Syst. Signal Process. 9, 1995 (FRF-based updating); Grafe, PhD thesis, "
    "Imperial College, 1998 (logarithms of FRFs as residuals); Schwarz, Ann. Stat. 6, 1978"
)
KINDS = {
    "member_stiffness", "member_density", "joint_stiffness", "support_flexibility", "point_mass",
    "stiffness_loss", "ground_spring", "ground_damper", "joint_viscous_damping", "preload",
}  # fmt: skip
N_LINES, STEPS = 48, 4
NOISE, DAMPING_STD = 0.02, 0.3
RESERVE = 25.0
"""CPU seconds that are left for the answer."""


class Frfs:
    """Least squares on logarithms of FRFs, on few lines, in standard deviations."""

    def __init__(self, case):
        self.case, reduced = case, case.reduced
        pick = np.unique(np.linspace(0, len(reduced.frequency) - 1, N_LINES).round().astype(int))
        self.lines, self.measured = reduced.frequency[pick], reduced.H[pick]
        self.common = common_slopes(case)
        self.std = max(self._noise(), NOISE)
        self.x = np.zeros(len(self.common) + 1)
        self.base = reduced.base
        for _ in range(STEPS):
            r, J = self.linearised(self.base, self.x)
            whole = J.T @ J + np.eye(len(self.x))
            self.x = self.x + np.clip(np.linalg.solve(whole, J.T @ r - self.x), -1.0, 1.0)
        self.root = None
        r, J = self.linearised(self.base, self.x)
        self.root = np.linalg.cholesky(np.eye(len(r)) + J @ J.T)

    def _noise(self):
        """Return the relative noise by differences of neighbouring lines [-]."""
        H = self.case.reduced.H
        curve = H[:-2] - 2 * H[1:-1] + H[2:]
        return float(np.median(np.abs(curve) / np.abs(H[1:-1]))) / np.sqrt(6)

    def moved(self, matrices, x):
        """Return matrices after changes of what is uncertain."""
        return [
            m + sum(a * s[i] for a, s in zip(x, self.common, strict=False)) for i, m in enumerate(matrices)
        ]

    def computed(self, matrices, x):
        """Return accelerances at the lines."""
        zeta = self.case.reduced.zeta * np.exp(DAMPING_STD * x[-1])
        return self.case.reduced.accelerance(self.moved(matrices, x), self.lines, zeta)

    def residual(self, matrices, x):
        """Return ln(measured / computed), real and imaginary, in standard deviations."""
        ratio = np.log(self.measured / self.computed(matrices, x)) / self.std
        return np.concatenate([ratio.real.ravel(), ratio.imag.ravel()])

    def linearised(self, matrices, x):
        """Return the residual and its slopes with what is uncertain, by closed forms of the FRFs' slopes."""
        reduced = self.case.reduced
        zeta = reduced.zeta * np.exp(DAMPING_STD * x[-1])
        K, M, C, D = self.moved(matrices, x)
        slopes = np.empty((len(x), *self.measured.shape), dtype=complex)
        dK, dM = (np.array([s[i] for s in self.common]) for i in (0, 1))
        for k, f in enumerate(self.lines):
            w = 2 * np.pi * f
            Z = K * (1 + 2j * zeta) + 1j * D + 1j * w * C - w**2 * M
            both = np.linalg.solve(Z, np.column_stack([reduced.F.T, reduced.S.T]))
            X, Y = both[:, : len(reduced.F)], both[:, len(reduced.F) :]
            H = reduced.S @ X
            dZ = dK * (1 + 2j * zeta) - w**2 * dM
            slopes[:-1, k] = -np.matmul(Y.T, np.matmul(dZ, X)) / H
            slopes[-1, k] = -(Y.T @ (K * 2j * zeta * DAMPING_STD) @ X) / H
        slopes = slopes.reshape(len(x), -1) / self.std
        return self.residual(matrices, x), np.concatenate([slopes.real, slopes.imag], axis=1).T

    def misfit(self, matrices):
        """Return the sum of squares with matrices, beside what is uncertain to first order."""
        r = self.residual(matrices, self.x)
        return float(np.sum(scipy.linalg.solve_triangular(self.root, r, lower=True) ** 2))

    def weight(self, square, k):
        """Return the logarithm of BIC's weight of a fit with k sizes."""
        n = 2 * self.measured.size
        return -0.5 * (n * np.log(square / n) + k * np.log(n))


def best_size(frfs, option, beside=()):
    """Return the size of an option that fits best and the misfit, by three points of a parabola at a time."""

    def misfit(size):
        matrices = frfs.case.reduced.with_effects([*beside, option.at(size)])
        return np.inf if matrices is None else frfs.misfit(matrices)

    found = min(((misfit(s), s) for s in option.sizes), key=lambda pair: pair[0])
    step = 1.0
    for _ in range(3):
        square, size = found
        around = [size * np.exp(step), size * np.exp(-step)]
        lower = min(((misfit(s), s) for s in around), key=lambda pair: pair[0])
        found, step = (lower, step) if lower[0] < square else (found, 0.4 * step)
    return found


def solve(case):
    """Return the candidates by BIC, one and two at a time."""
    frfs = Frfs(case)
    found = {(): frfs.weight(frfs.misfit(case.reduced.base), 0)}
    single = {}
    for option in case.options(KINDS):
        if case.left < 0.35 * case.limit:
            break
        square, size = best_size(frfs, option)
        single[option.key] = (option, size, square)
        found[((option, float(size), None),)] = frfs.weight(square, 1)
    order = sorted(single.values(), key=lambda each: each[2])
    first, size, _ = order[0]
    for option, _, _ in order[1:]:
        if case.left < RESERVE:
            break
        if option.effect.name == first.effect.name:
            continue
        square, other = best_size(frfs, option, [first.at(size)])
        found[(first, float(size), None), (option, float(other), None)] = frfs.weight(square, 2)
    return case.said(found, None)
