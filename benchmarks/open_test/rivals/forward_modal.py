"""Forward selection in the modal domain: the candidate that improves frequencies and MAC most, then the next.

Candidates at members next to the sensors of the lowest COMAC come first. As many as BIC asks for are named.
"""

import numpy as np

from benchmarks.open_test.rivals.common import Updating, paired
from updating import comac

SOURCE = (
    "Lieven and Ewins, IMAC 1988 (COMAC); Lallement and Piranda, IMAC 1990 (forward selection); Friswell, "
    "Penny and Garvey, Inverse Probl. Eng. 5, 1997 (selection of subsets)"
)
KINDS = {
    "member_stiffness", "member_density", "joint_stiffness", "support_flexibility", "point_mass",
    "stiffness_loss", "ground_spring",
}  # fmt: skip
MOST = 3
TRIED = 80, 25, 25
"""How many candidates are tried as the first, second and third effect."""
TEMPERATURE, UNKNOWN, PENALTY = 3.0, 0.9, 4.0
"""Chosen on the practice set."""


def by_sensor(case):
    """Return the COMAC of each sensor, paired by MAC (n_sensors,)."""
    reduced, (f, _, phi) = case.reduced, case.modes
    frequency, shapes, _ = reduced.solve_modes(reduced.base, len(reduced.base[0]))
    partner, _ = paired(frequency, shapes, f, phi.real)
    return comac(phi.real, shapes[:, partner])


def solve(case):
    """Return what forward selection finds, with BIC's weights for each number of effects."""
    poor = np.argsort(by_sensor(case))
    members = [case.structure.told["sensors"][i]["member"] for i in poor]
    order = {m: k for k, m in reversed(list(enumerate(members)))}
    options = sorted(
        case.options(KINDS), key=lambda o: order.get(getattr(o.effect, "member", None), len(members))
    )
    model, chosen, changes, found = Updating(case, options), [], np.zeros(0), {}
    told, weight = model.hypothesis([])
    found[told] = weight
    for _ in range(MOST):
        tried = {}
        for k in _promising(model, chosen, changes, TRIED[len(chosen)]):
            if case.left < 20:
                break
            tried[k] = model.hypothesis([*chosen, k], changes)
        if not tried:
            break
        found |= dict(tried.values())
        best = max(tried, key=lambda k: tried[k][1])
        if tried[best][1] < weight:
            break
        (told, weight), chosen = tried[best], [*chosen, best]
        changes = np.array([o.change(size) for o, size, _ in told])
    return case.said(found, TEMPERATURE, UNKNOWN, PENALTY)


def _promising(model, chosen, changes, most):
    """Return the candidates whose slope explains most of what is left, beside what is chosen already."""
    total = np.zeros(model.n + model.n_common)
    total[chosen] = changes
    r, S, groups = model.linearised(total)
    weight = 1 / np.sqrt(1 + np.bincount(groups, r**2) / np.bincount(groups))[groups]
    r, S = r * weight, S * weight[:, None]
    usual = np.column_stack([S[:, model.n :], S[:, chosen]])
    whole = np.linalg.inv(np.eye(len(r)) + usual @ usual.T)
    own = S[:, : model.n]
    gain = (own.T @ whole @ r) ** 2 / np.maximum(np.einsum("ik,ij,jk->k", own, whole, own), 1e-12)
    gain[list(chosen)] = -1.0
    return [int(k) for k in np.argsort(-gain)[:most] if gain[k] > 0]
