"""Error in the constitutive relation: which part is wrong, and the best kind of effect there by BIC.

For each measured mode a displacement u and a displacement v, which carries the inertia forces of u, come as
close to one another and to the measurement as they can. Where their difference has energy, the stiffness or
the mass is wrong.
"""

import numpy as np

from benchmarks.open_test.rivals.common import Updating, paired, slopes_of

SOURCE = (
    "Ladevèze, Nedjar and Reynier, AIAA J. 32, 1994, 1485; Banerjee, Walsh, Aquino and Bonnet, Comput. "
    "Methods Appl. Mech. Eng. 253, 2013 (the measurement as a penalty)"
)
MEMBERS = {"member_stiffness"}
CONNECTIONS = {"joint_stiffness", "support_flexibility"}
EVERY = MEMBERS | CONNECTIONS | {"member_density", "point_mass", "stiffness_loss"}
LEAST_MAC = 0.3
"""A measured mode has a partner from this MAC on [-]."""
TRUST = 10.0
"""Weight of the measured shape against the energy of the mode."""
PLACES, TOGETHER = 4, 12
RESERVE = 20.0
"""CPU seconds that are left for the answer."""
TEMPERATURE, UNKNOWN, PENALTY = 45.0, 0.9, 6.0
"""Chosen on the practice set."""


def differences(case):
    """Return u - v and u of each measured mode, on the reduced basis (n_modes, n)."""
    reduced, (f, _, phi) = case.reduced, case.modes
    usual = Updating(case, [])
    K, M = usual.matrices(usual.settled())
    frequency, shapes, _ = reduced.solve_modes((K, M), len(K))
    partner, assurance = paired(frequency, shapes, f, phi.real)
    off, full = [], []
    for k, j in enumerate(partner):
        if assurance[j, k] < LEAST_MAC:
            continue
        w2 = (2 * np.pi * f[k]) ** 2
        a, b = shapes[:, j], phi[:, k].real
        target = b * (a @ b) / (b @ b)  # of the size of the computed mode of unit mass
        apart = np.eye(len(K)) - w2 * np.linalg.solve(K, M)
        weight = TRUST * w2 / (target @ target)
        whole = apart.T @ K @ apart + weight * reduced.S.T @ reduced.S
        u = np.linalg.solve(whole, weight * reduced.S.T @ target)
        off.append(apart @ u)
        full.append(u)
    return np.array(off), np.array(full)


def solve(case):
    """Return the kinds that explain the modes at the places where the error is largest."""
    off, full = differences(case)
    where = case.options(MEMBERS | CONNECTIONS)
    energy, energy_of_all = {}, float(np.sum((full @ case.reduced.base[0]) * full))
    for o, slope in zip(where, slopes_of(case.reduced, where), strict=True):
        K = slope[0]
        error, whole = (abs(float(np.sum((v @ K) * v))) for v in (off, full))
        place = case.words(o, o.sizes[0])[0]["place"]
        energy[place] = max(energy.get(place, 0.0), error / (whole + 0.01 * energy_of_all))
    worst = sorted(energy, key=energy.get, reverse=True)[:PLACES]
    options = [o for o in case.options(EVERY) if case.words(o, o.sizes[0])[0]["place"] in worst]
    model = Updating(case, options)
    found = [model.hypothesis([]), *(model.hypothesis([k]) for k in range(len(options)))]
    order = np.argsort([-w for _, w in found[1:]])
    for k in order[1:TOGETHER]:
        if case.left > RESERVE:
            found.append(model.hypothesis([int(order[0]), int(k)]))
    return case.said(dict(found), TEMPERATURE, UNKNOWN, PENALTY)
