"""Starting points of a joint's fits, and searches around fitted values: the cost has many minima."""

from collections.abc import Callable, Sequence
from itertools import product

import numpy as np

from fem.array_types import Complexes, Floats
from joint.assembly import JointTask
from joint.average import identify_average
from joint.form import LAWS, JointForm
from joint.identification import JointIdentification, JointIdentificationError
from joint.interface import SubstructureFRF
from joint.joint_fit import JointFit
from joint.output_error import SCAN
from joint.released import ReleasedParts
from joint.synthesis import couple

WALK = (1.2, 1.05, 1.0125)
"""Factors of ever finer steps along one stiffness [-]."""


SEARCHES = 6
"""Number of further searches for stiffnesses around the fitted values."""


def vague_prior(task: JointTask, form: JointForm, theta: Floats) -> tuple[Floats, Floats]:
    """Return the prior of θ: stiffnesses to a factor of 20, damping below the stiffness.

    It is next to nothing for a parameter that the data determine, and holds the others.
    """
    k = dict(zip(task.directions, task.springs, strict=True))
    omega = 2 * np.pi * float(np.median(task.measurement.frf.frequency))
    mean, std = np.zeros(len(form.names)), np.full(len(form.names), np.inf)
    for n, name in enumerate(form.names):
        kind, a, b = name.split(" ")[:3]
        if len(name.split(" ")) > 3:  # a law's own parameter, which has bounds
            continue
        now = [max(abs(theta[form.names.index(f"{form.terms[0].kind} {d} {d}")]), k[d]) for d in (a, b)]
        size = float(np.sqrt(now[0] * now[1]))
        if kind in ("C", "D"):
            std[n] = size / (omega if kind == "C" else 1.0)
        elif a == b:
            mean[n], std[n] = k[a], np.log(20.0)
        else:
            std[n] = size
    return mean, std


def relative_distance(form: JointForm, parts: SubstructureFRF, H: Complexes, theta: Floats) -> float:
    """Return the mean of |ln H / measured|, at most 1 each [-]."""
    with np.errstate(all="ignore"):
        off = np.abs(np.log(couple(parts, form.Z(parts.frequency, theta)).H_nn / H))
    return float(np.nanmean(np.minimum(off, 1.0)))


def searched(task: JointTask, form: JointForm, theta: Floats, far: Callable[[Floats], float]) -> Floats:
    """Return θ with one stiffness after another changed, with its damping, to where the FRFs come nearest.

    The direction that helps most comes first: another may only imitate it.
    """
    best = far(theta)
    for _ in task.directions:
        points = []
        for d in task.directions:
            diagonal = np.array([name.split(" ")[1:3] == [d, d] for name in form.names])
            points += [np.where(diagonal, factor * theta, theta) for factor in SCAN]
        size, nearest = min(((far(p), k) for k, p in enumerate(points)), default=(best, 0))
        if size > 0.99 * best:
            break
        best, theta = size, points[nearest]
    return theta


def walked(
    task: JointTask,
    form: JointForm,
    found: JointFit,
    fit: Callable[..., JointFit],
    standard: Callable[[Floats], Floats],
) -> JointFit:
    """Return the best fit along one stiffness after another, all else fitted at each of its values.

    The cost has a small minimum wherever a resonance of the model lies between two lines, and descent ends
    there. Steps from one to the next, and then finer ones, see the valley that they lie in.
    """

    def moved(at: JointFit, i: int, factor: float) -> JointFit:
        theta = at.values.copy()
        theta[i] *= factor
        mean, std = vague_prior(task, form, theta)
        # Relative standard deviation that fixes a stiffness while all else is fitted [-]
        mean[i], std[i] = theta[i], 1e-4
        start = standard(at.part_values)
        return fit(theta, prior=(mean, std), part_start=start, stages=(1.0,), max_iterations=4)

    best = found
    for step, d in product(WALK, task.directions):
        i, begin = form.names.index(f"{form.terms[0].kind} {d} {d}"), best
        for factor in (1 / step, step):
            at, missed = begin, 0
            # Steps in a row that do not lower the cost after which a walk turns round, coarse and finer [-];
            # one that doubles it counts twice
            while missed < (3, 1)[step != WALK[0]]:
                at = moved(at, i, factor)
                if at.chi2 < 0.99 * best.chi2:
                    best, missed = at, 0
                else:
                    missed += 2 if at.chi2 > 2 * best.chi2 else 1
    return best


def starting_values(
    task: JointTask,
    form: JointForm,
    parts: ReleasedParts,
    H: Complexes,
    lines: JointIdentification | None,
    before: Sequence[tuple[str, Floats]],
) -> list[tuple[str, Floats]]:
    """Return up to two starts with their names: of the model, line by line, averages, a search, other bands.

    ``before`` are the results of narrower bands.
    """
    omega = 2 * np.pi * float(np.median(parts.at_mean.frequency))
    eta = task.joint.eta or 0.01

    def values(k: Floats, loss: Floats) -> Floats:
        out = np.zeros(len(form.names))
        for i, d in enumerate(task.directions):
            for kind, value in (("K", k[i]), ("D", loss[i]), ("C", loss[i] / omega)):
                if f"{kind} {d} {d}" in form.names:
                    out[form.names.index(f"{kind} {d} {d}")] = value
            for law in LAWS:
                if f"{law} {d} {d}" in form.names:
                    at = form.names.index(f"{law} {d} {d}")
                    out[at] = k[i]
                    out[[n.startswith(f"{law} {d} {d} ") for n in form.names]] = np.nan
        return out

    k = task.springs
    tried = [("the model's values", values(k, eta * k))]
    if lines is not None and lines.regular.sum() >= 8:
        middle = np.median(np.diagonal(lines.z[lines.regular], axis1=1, axis2=2), axis=0)
        size = np.where(middle.real > 0, middle.real, k)
        loss = np.where(middle.imag > 0, middle.imag, eta * size)
        tried.append(("the middle of the lines", values(size, loss)))
    if form.linear and np.isfinite(H).all():
        try:
            mean = identify_average(
                parts.at_mean, parts.at_mean.frequency, H, form, complete=True, misfit_limit=np.inf
            ).values
        except JointIdentificationError:
            pass
        else:
            usual = values(k, eta * k)
            tried.append(("the average solution", np.where(form.semidefinite & (mean <= 0), usual, mean)))
    tried += before
    if np.isnan(tried[0][1]).any():
        return tried[-1:]

    def far(theta: Floats) -> float:
        return relative_distance(form, parts.at_mean, H, theta)

    if not before:
        tried.append(("a search over six decades", searched(task, form, tried[0][1], far)))
    first, *others = sorted(tried, key=lambda each: far(each[1]))
    scale = np.maximum(np.abs(first[1]), 1e-3 * np.abs(first[1]).max())
    # Relative difference from which two starts are worth a fit each [-]
    apart = [each for each in others if np.abs((each[1] - first[1]) / scale).max() > 0.1]
    return [first, *apart[:1]] if len(before) == 1 else [first]
