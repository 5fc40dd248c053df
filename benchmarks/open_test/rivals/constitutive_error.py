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
TRUST = 10.0
"""Weight of the measured shape against the energy of the mode."""
PLACES = 3


def differences(case):
    """Return u - v and u of each measured mode, on the reduced basis (n_modes, n)."""
    reduced, (f, _, phi) = case.reduced, case.modes
    K, M = reduced.base[:2]
    frequency, shapes, _ = reduced.solve_modes(reduced.base, len(K))
    partner, mac = paired(frequency, shapes, f, phi.real)
    off, full = [], []
    for k, j in enumerate(partner):
        if mac[j, k] < 0.3:
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
        energy[place] = max(energy.get(place, 0.0), error / max(whole, 1e-6 * energy_of_all))
    worst = sorted(energy, key=energy.get, reverse=True)[:PLACES]
    options = [o for o in case.options(EVERY) if case.words(o, o.sizes[0])[0]["place"] in worst]
    model = Updating(case, options)
    found = [model.hypothesis([])]
    for k in range(len(options)):
        if case.left > 20:
            found.append(model.hypothesis([k]))
    best = int(np.argmax([w for _, w in found])) - 1
    for k in range(len(options) if best >= 0 else 0):
        if k != best and case.left > 20:
            found.append(model.hypothesis([best, k]))
    return case.said(dict(found), None)
