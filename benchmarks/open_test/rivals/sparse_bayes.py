"""Hierarchical sparse Bayesian learning of losses of stiffness from modes.

Each loss has a normal prior whose variance the evidence determines (automatic relevance), so that most become
none. Members, stretches of them and connections may be softer.
"""

import numpy as np

from benchmarks.open_test.rivals.common import Updating

SOURCE = (
    "Huang and Beck, Int. J. Uncertainty Quantification 5, 2015, 139; Huang, Beck and Li, Mech. Syst. Signal "
    "Process. 90, 2017; Tipping, J. Mach. Learn. Res. 1, 2001 (fixed points of the variances)"
)
KINDS = {"member_stiffness", "stiffness_loss", "joint_stiffness", "support_flexibility"}
ITERATIONS, MOST = 60, 3
TEMPERATURE, UNKNOWN, PENALTY = 300.0, 0.9, 6.0
"""Chosen on the practice set."""
LEAST, LARGEST = 1e-6, 1e2
"""Variances of losses over usual ones, between which the evidence decides [-]."""


def relevance(A, b, noise=1.0):
    """Return the mean and the variances of the priors of sparse x in A x = b + noise (Tipping 2001)."""
    variance, mean = np.full(A.shape[1], 0.1), np.zeros(A.shape[1])
    for _ in range(ITERATIONS):
        AV = A * variance
        whole = noise * np.eye(len(b)) + AV @ A.T
        mean = AV.T @ np.linalg.solve(whole, b)
        kept = 1 - np.einsum("ij,ji->i", AV.T, np.linalg.solve(whole, A))  # posterior over prior variance
        relevant = np.clip(1 - kept, 1e-12, 1.0)
        variance = np.clip(mean**2 / relevant, LEAST, LARGEST)
        noise = max(float(np.sum((b - A @ mean) ** 2)) / max(len(b) - relevant.sum(), 1.0), 1.0)
    return mean, variance


def solve(case):
    """Return the relevant losses, as many as BIC asks for of the most relevant ones."""
    model = Updating(case, case.options(KINDS))
    found = {}

    def sparse(A, b):
        mean, found["variance"] = relevance(A * usual, b)
        return usual * mean

    usual = np.array([o.usual for o in model.options])
    changes = model.fit(sparse)[0]
    order = np.argsort(-np.abs(changes / usual))
    relevant = [int(k) for k in order if found["variance"][k] > 10 * LEAST][:MOST]
    return case.said(model.largest(relevant, changes), TEMPERATURE, UNKNOWN, PENALTY)
