"""The likelihood of a joint's parameters, given the assembly's FRFs and the substructures' uncertainty."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.linalg.blas import zherk

from fem.array_types import Bools, Complexes, Floats
from joint._checks import checked_noise, solve_lines
from joint.form import JointForm
from joint.interface import SubstructureFRF
from joint.parts import Parts, ReceptanceBlocks
from updating.least_squares.costs import pseudo_huber, pseudo_huber_weight
from updating.measurement.noise import relative_noise

_CHUNK = 1 << 18
"""Complex numbers of the Jacobian that are held at a time."""


@dataclass(frozen=True, slots=True, eq=False)
class LikelihoodPoint:
    """Values with their cost, and half the gradient and the Gauss-Newton matrix there.

    Attributes
    ----------
    theta : (n,) array
        The joint's parameters.
    x : (m,) array
        The parts' uncertain parameters, in prior standard deviations from the models' values [-].
    count : int
        Lines that it is of, from the lowest.
    cost : float
        Negative log posterior up to a constant: Σ|r|², of circular complex noise [nats].
    A, g : (n + m, n + m) array, (n + m,) array
        Half the Gauss-Newton matrix of the cost and half its gradient; 0 if they were not asked for.
    H : (count, M, L) complex array
        Rebuilt receptances.
    """

    theta: Floats
    x: Floats
    count: int
    cost: float
    A: Floats
    g: Floats
    H: Complexes

    @property
    def point(self) -> Floats:
        """All values, θ then x."""
        return np.concatenate([self.theta, self.x])


@dataclass(frozen=True, slots=True, eq=False)
class Likelihood:
    """The negative log posterior of a joint's and the parts' parameters.

    Attributes
    ----------
    form : JointForm
    parts : Parts
    lines : (n_freq,) array
        [Hz].
    measured : (n_freq, M, L) complex array
    weight : (n_freq, M, L) array
        1/σ; 0 where there is no value.
    positive : (n,) bool array
        Parameters that move by factors and stay positive.
    huber : float or None
        Where the loss of ln H turns linear [-]; None for plain residuals of H.
    prior : tuple or None
        Mean and standard deviation of θ, and where they are those of ln θ.
    known : dict
        The substructures at the last x, which many points share.
    """

    form: JointForm
    parts: Parts
    lines: Floats
    measured: Complexes
    weight: Floats
    positive: Bools = field(default_factory=lambda: np.zeros(0, dtype=bool))
    huber: float | None = None
    prior: tuple[Floats, Floats, Bools] | None = None
    known: dict[bytes, Any] = field(default_factory=dict, repr=False)

    def rough(self, state: LikelihoodPoint, count: int) -> Likelihood:
        """Return the problem with robust residuals of ln H, for points far from the data."""
        plain = self.state(state.theta, state.x, count)
        r = np.abs(self._logarithmic(plain.H, slice(0, count))[0])
        return replace(self, huber=max(float(np.median(r[r > 0])) if r.any() else 0.0, 3.0))

    def at(self, state: LikelihoodPoint) -> LikelihoodPoint:
        """Return the cost of a point over all lines."""
        return self.state(state.theta, state.x, len(self.lines), False)

    def _parts_at(self, x: Floats) -> tuple[SubstructureFRF, tuple[ReceptanceBlocks, ...]]:
        key = x.tobytes()
        if key not in self.known:
            self.known.clear()
            self.known[key] = self.parts.evaluate(x)
        return self.known[key]

    def _logarithmic(self, H: Complexes, at: slice) -> tuple[Complexes, Complexes]:
        """Return ln(H / measured) over the relative noise, and its derivative by H."""
        measured = self.measured[at]
        use = (self.weight[at] > 0) & (measured != 0) & (H != 0)
        safe, model = np.where(use, measured, 1.0), np.where(use, H, 1.0)
        size = np.where(use, self.weight[at] * np.abs(safe), 0.0)
        return np.asarray(size * np.log(model / safe), dtype=complex), np.asarray(size / model, dtype=complex)

    def state(self, theta: Floats, x: Floats, count: int, gradient: bool = True) -> LikelihoodPoint:
        """Evaluate the cost and, if asked, Gauss-Newton matrix and gradient over the first lines."""
        data = self.of_lines(theta, x, 0, count, gradient)
        n, m = len(theta), len(x)
        A, g, cost = data.A, data.g, data.cost
        # 2 Σ|r|²/2 … the prior ½ x² beside Σ|r|²: in units of the negative log likelihood
        A[n:, n:] += 0.5 * np.eye(m)
        g[n:] += 0.5 * x
        cost += 0.5 * float(x @ x)
        if self.prior is not None:
            middle, std, log = self.prior
            ratio = np.where(log, theta / np.where(log, middle, 1.0), 1.0)
            u = np.where(log, np.log(np.maximum(ratio, 1e-300)), theta - middle) / std
            du = np.where(log, 1 / np.where(log, np.maximum(theta, 1e-300), 1.0), 1.0) / std
            A[:n, :n] += 0.5 * np.diag(du**2)
            g[:n] += 0.5 * u * du
            cost += 0.5 * float(u @ u)
        return replace(data, cost=cost)

    def of_lines(
        self, theta: Floats, x: Floats, first: int, end: int, gradient: bool = True
    ) -> LikelihoodPoint:
        """Evaluate the likelihood of the lines from one up to another, without priors."""
        frf, slopes = self._parts_at(x)
        count = end - first
        omega = 2 * np.pi * self.lines[first:end]
        n, m, n_matrices = len(theta), len(x), len(self.form.matrices)
        factors, which = self.form.slopes(omega, theta)
        coefficients = self.form.coefficients(omega, theta)
        A, g, cost = np.zeros((n + m, n + m)), np.zeros(n + m), 0.0
        # parameters of one kind share their factor, so that few sums over lines serve all of them
        rows = np.vstack([factors, np.ones((m, count))])
        shared, kind = np.unique(rows, axis=0, return_inverse=True)
        kind = kind.ravel()  # NumPy 2.0 gives it a second axis
        column = np.append(which, n_matrices + np.arange(m))
        H = np.empty((count, *self.measured.shape[1:]), dtype=complex)
        values = self.measured.shape[1] * self.measured.shape[2]
        step = max(1, _CHUNK // (values * (n_matrices + m + 1)))
        for start in range(0, count, step):
            here = slice(start, min(start + step, count))
            at = slice(first + here.start, first + here.stop)
            Z = np.einsum("uf,uij->fij", coefficients[:, here], self.form.matrices, optimize=True)
            N = len(self.form.coordinates)
            unit = np.eye(N)
            H_jn = solve_lines(unit + frf.H_bb[at] @ Z, frf.H_ba[at])
            H[here] = frf.H_aa[at] - frf.H_ab[at] @ (Z @ H_jn)
            w = self.weight[at]
            if self.huber is None:
                r = (w * (H[here] - self.measured[at])).reshape(len(H_jn), -1)
            else:
                r, w = self._logarithmic(H[here], at)
                r = r.reshape(len(H_jn), -1)
            loss = np.abs(r) ** 2 if self.huber is None else pseudo_huber(r, self.huber)
            cost += float(loss.sum())
            if not gradient:
                continue
            H_nj = solve_lines((unit + Z @ frf.H_bb[at]).mT, frf.H_ab[at].mT).mT
            J = self._jacobian(H_nj, H_jn, Z, slopes, at)
            J *= w.mT[:, None]
            J = J.reshape(len(J), n_matrices + m, -1)
            r = r.reshape(w.shape).mT.reshape(len(r), -1)
            if self.huber is not None:
                root = np.sqrt(pseudo_huber_weight(r, self.huber))
                J *= root[:, None]
                r = r * root
            G = _gram(J)
            b = (J @ r.conj()[:, :, None]).conj()
            f = shared[:, here]
            pairs = (f.conj()[:, None] * f).reshape(-1, f.shape[1])
            sums = (pairs @ G.reshape(len(G), -1)).reshape(len(f), len(f), *G.shape[1:])
            A += sums[kind[:, None], kind, column[:, None], column].real
            g += (f.conj() @ b[:, :, 0])[kind, column].real
        return LikelihoodPoint(theta, x, end, cost, A, g, H)

    def _jacobian(
        self,
        H_nj: Complexes,
        H_jn: Complexes,
        Z: Complexes,
        slopes: tuple[ReceptanceBlocks, ...],
        at: slice,
    ) -> Complexes:
        """Return the transposes of -H_nj T H_jn for each matrix, then of the derivatives by the parts.

        Both are (lines, n, L, M): one product for all matrices costs less than many small ones.
        """
        n_lines, N, n_in = H_jn.shape
        moved = (self.form.matrices.reshape(-1, N) @ H_jn).reshape(n_lines, -1, N, n_in)
        turned = np.swapaxes(moved, 2, 3).reshape(n_lines, -1, N)
        by_joint = (turned @ (-H_nj).mT).reshape(n_lines, -1, n_in, H_nj.shape[1])
        if not slopes:
            return by_joint
        left, right = H_nj @ Z, Z @ H_jn
        by_parts = [
            s.H_aa[at] - left @ s.H_ba[at] - s.H_ab[at] @ right + left @ (s.H_bb[at] @ right) for s in slopes
        ]
        return np.concatenate([by_joint, np.stack([part.mT for part in by_parts], axis=1)], axis=1)


def _gram(J: Complexes) -> Complexes:
    """Return J* Jᵀ at each line, (n_lines, u, u), of which only one triangle is computed."""
    upper = np.array([zherk(1.0, line.T, trans=2) for line in J])
    return upper + np.triu(upper, 1).conj().mT


def noise_of(measured: Complexes, noise: npt.ArrayLike | None, reference: Complexes) -> Floats:
    """Return the noise's standard deviation at every value; relative noise is one of a reference."""
    size = np.abs(reference)
    least = 1e-6 * np.sqrt((size**2).mean(axis=0)) + 1e-300
    if noise is None:
        return np.maximum(np.sqrt(2) * relative_noise(measured) * size, least)
    level = checked_noise(noise, measured.shape)
    return level if level.ndim else np.maximum(level * size, least * 1e-3)


def checked_prior(
    prior: tuple[npt.ArrayLike, npt.ArrayLike] | None, log: Bools, n: int
) -> tuple[Floats, Floats, Bools] | None:
    """Check the prior of θ."""
    if prior is None:
        return None
    mean, std = (np.asarray(v, dtype=float) for v in prior)
    if mean.shape != (n,) or std.shape != (n,) or not (np.isfinite(mean).all() and (std > 0).all()):
        msg = (
            f"the prior has a mean of shape {mean.shape} and deviations of shape {std.shape}; ({n},) each is "
            "needed, finite means and positive deviations"
        )
        raise ValueError(msg)
    if (wrong := log & (mean <= 0) & np.isfinite(std)).any():
        msg = f"the prior's mean {mean[wrong][0]:g} is of a parameter that stays positive; it must be too"
        raise ValueError(msg)
    return np.where(log & (mean <= 0), 1.0, mean), std, log
