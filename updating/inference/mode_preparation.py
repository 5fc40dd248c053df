"""Preparation of a diagnosis from measured modes: a reduced model and its accuracy."""

from collections.abc import Sequence

import numpy as np

from fem.analysis.modes import first_modes
from fem.connection_damping import ConnectionDamping
from fem.elements.splitting import split
from fem.linalg.solvers import one_thread
from fem.model import Model
from fem.reduction.reduced_model import reduce_model
from fem.system import assemble
from updating.inference.defaults import EXPLAINED_LEVEL
from updating.inference.mode_fit import ModeProblem
from updating.inference.mode_targets import ModeTargets
from updating.inference.parameters import DampingCurve
from updating.inference.preparation import (
    LEAST_DAMPING_STD,
    MESH_SHARE,
    MODE_MARGIN,
    MOST_SPLITS,
    forces_at,
    nominal_ratio,
)
from updating.inference.unknowns import Uncertain
from updating.inference.visible_modes import mass_of
from updating.measurement.measurement import with_sensor_masses

HIGHEST = 1.2
"""Computed modes up to this multiple of the highest measured frequency may be its partner."""


@one_thread()
def build_mode_problem(
    model: Model,
    targets: ModeTargets,
    nuisances: Sequence[Uncertain] = (),
    *,
    damping_std: float = 0.5,
    model_error: float = EXPLAINED_LEVEL,
    mesh_level: float = 0.0,
) -> ModeProblem:
    """Reduce a model for fits to measured modes.

    Parameters are those of :func:`updating.inference.preparation.build_problem`; ``mesh_level`` is the
    relative error of frequencies that the mesh leaves.
    """
    model = with_sensor_masses(model, targets.sensors)
    other = next(iter(model.of_kind(ConnectionDamping)), None)
    model = model.without_effect(other.name) if other else model
    undamped = model.with_damping(model.damping.without_modal())
    highest = HIGHEST * float(targets.frequency[-1])
    reduced = reduce_model(undamped, forces_at(model, targets.sensors), highest, margin=MODE_MARGIN)
    damped = np.flatnonzero(np.isfinite(targets.zeta) & ~targets.held_out)
    f = targets.frequency[damped] if len(damped) else targets.frequency
    n_knots = int(np.clip(len(damped) // 2, 1, 8))
    knots = np.unique(np.quantile(f, np.linspace(0, 1, n_knots))) if n_knots > 1 else np.array([np.median(f)])
    nominal = nominal_ratio(model, knots, other, connections=True)
    curve = DampingCurve(
        knots,
        np.atleast_2d(nominal(knots))[0],
        max(damping_std, LEAST_DAMPING_STD),
        True,
        nominal if np.ptp(model.damping.ratio) or other else None,
    )
    return ModeProblem(
        reduced=reduced,
        data=targets,
        nuisances=tuple(nuisances),
        damping=curve,
        model_error=model_error,
        mesh_level=mesh_level,
        mass=mass_of(undamped),
    )


def fine_enough(model: Model, targets: ModeTargets) -> tuple[Model, float]:
    """Return a model whose elements are short enough for measured modes, and the remaining error of the mesh.

    The error of frequencies falls with the fourth power of the elements' length, so that halving them shows
    15/16 of it; with the second, where sections taper, 3/4.
    """
    n = targets.n + 2
    f, error = _frequencies(model, n), 0.0
    for _ in range(MOST_SPLITS // 2):
        finer = split(model, 2)
        g = _frequencies(finer, n)
        both = min(len(f), len(g))
        error = 4 / 3 * float(np.abs(np.log(f[:both] / g[:both])).max(initial=0.0))
        if error <= MESH_SHARE * float(np.min(targets.frequency_std)):
            return model, error
        model, f = finer, g
    return model, error / 4


def _frequencies(model: Model, n: int) -> np.ndarray:
    modes = first_modes(assemble(model, reciprocal=False), n)
    f = modes.frequency[modes.n_rigid :]
    return f[f > 0][:n]
