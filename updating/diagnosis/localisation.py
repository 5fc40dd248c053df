"""Where a model fails.

Which sensors and bands carry the misfit, and which members and joints could take it away.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fem.array_types import Floats
from fem.linalg.solvers import one_thread
from fem.model import Effect
from fem.summary import fields_summary
from updating.correlation import DB_PER_NEPER, compare
from updating.diagnosis.candidates import propose, released_together
from updating.forecast.forecast import Forecast
from updating.forecast.grid import Grid
from updating.forecast.look import Look
from updating.inference.fit import FitProblem
from updating.inference.fit_result import FitResult
from updating.inference.frf_changes import n_lines

LEAST_SHARE = 0.1
"""Shares say something of the place if one of them is at least this [-]."""
LINEAR = (
    "Shares come from an estimate in which all that is uncertain follows to first order: they say where a "
    "change would help, not what is wrong. Only the fits of the candidates decide."
)
NOWHERE = (
    f"No change of a member, joint or support explains {100 * LEAST_SHARE:.0f} % of the misfit by itself, by "
    "an estimate in which all that is uncertain follows to first order: it does not say where the model "
    "fails. Only the fits of the candidates decide."
)
N_LINES, MOST_VALUES = 44, 1500
"""Lines, and largest number of values of FRFs, at which changes are judged."""


@dataclass(frozen=True, slots=True, eq=False)
class Localisation:
    """Where the misfit of a fitted model is.

    Attributes
    ----------
    sensors, inputs : tuple of str
        Names of responses and forces.
    by_sensor_db, by_input_db : ndarray (n_out,), (n_in,)
        Root mean square of the amplitude's error [dB]; NaN where nothing was compared.
    bands : ndarray (n_bands + 1,)
        Edges [Hz].
    by_band_db : ndarray (n_out, n_bands)
        The same in each band [dB].
    members : mapping of str to float
        For each member, the share of the misfit (sum of squared weighted residuals) that the best effect on
        it would explain, 0 to 1.
    places : tuple of (str, float)
        The same for joints and supports, best first.
    points : mapping of str to ndarray (n, 3)
        Points of each of these places [m].
    note : str
        How far this is to be trusted.
    """

    sensors: tuple[str, ...]
    inputs: tuple[str, ...]
    by_sensor_db: Floats
    by_input_db: Floats
    bands: Floats
    by_band_db: Floats
    members: Mapping[str, float]
    places: tuple[tuple[str, float], ...]
    points: Mapping[str, Floats]
    note: str

    __repr__ = fields_summary

    @property
    def says_where(self) -> bool:
        """Whether an effect at some place would explain a part of the misfit worth the name."""
        shares = [*self.members.values(), *(share for _, share in self.places)]
        return max(shares, default=0.0) >= LEAST_SHARE


@one_thread()
def locate(problem: FitProblem, result: FitResult, n_bands: int = 8) -> Localisation:
    """Find where a fitted model fails.

    Members, joints and supports are judged by the best effect there, of any kind: by the forecast of what a
    little of it does, and of the most promising ones by what they do at the values of their grids, solved for
    (:mod:`updating.forecast`). What nuisance parameters can do is taken away.

    Parameters
    ----------
    problem : FitProblem
    result : FitResult
        Usually with fitted nuisance parameters and no added effect.
    n_bands : int
        Equal bands for the map.
    """
    m = problem.measured  # set right for faults, unlike the FRFs of the measurement
    comparison = compare(m, problem.frf(result), n_bands, problem.data.mask)
    by_input = np.array([_rms(comparison.log_ratio[:, :, j].real) for j in range(len(m.inputs))])
    model = problem.reduced.model
    every = propose(model, None, (), problem.data.measurement)
    candidates = released_together([e for e in every if not (e.is_form or e.amplitude_dependent)])
    shares = _shares(problem, result, candidates)
    members: dict[str, float] = dict.fromkeys(model.mesh.members, 0.0)
    places: dict[str, float] = {}
    points: dict[str, Floats] = {}
    for effect, share in zip(candidates, shares.tolist(), strict=True):
        place, in_member = place_named(effect)
        found = members if in_member else places
        found[place] = max(found.get(place, 0.0), share)
        if not in_member and place not in points:
            points[place] = effect.locations(model)
    found = Localisation(
        sensors=m.outputs,
        inputs=m.inputs,
        by_sensor_db=comparison.by_sensor(),
        by_input_db=by_input,
        bands=comparison.bands,
        by_band_db=comparison.by_band(),
        members=members,
        places=tuple(sorted(places.items(), key=lambda item: -item[1])),
        points=points,
        note=LINEAR,
    )
    return found if found.says_where else replace(found, note=NOWHERE)


def place_named(effect: Effect) -> tuple[str, bool]:
    """Return the name of an effect's place, and whether that is a member."""
    member = getattr(effect, "member", None)
    if isinstance(member, str):
        return member, True
    return effect.where.thing, False


def _shares(problem: FitProblem, result: FitResult, candidates: Sequence[Effect]) -> Floats:
    """Return the shares of the misfit that candidates explain, (n_candidates,) [-]."""
    look = Look.of(problem.with_forces_of(result), result, min(N_LINES, n_lines(problem)), 0, MOST_VALUES)
    grids = [Grid.of(problem, e) for e in candidates]
    # what releases a constraint is far from small at all values that are plausible
    small = [k for k, e in enumerate(candidates) if not e.released()]
    forecast, out = Forecast.of(look, [grids[k] for k in small]), np.zeros(len(grids))
    out[small] = forecast.best_shares
    order = np.argsort(-out, kind="stable").tolist()
    best = {place_named(candidates[k])[0]: k for k in reversed(order)}
    # Of the candidates that explain most to first order so many, and the best of each place, are solved for
    solved = {*order[:40], *best.values()}
    tried = {k: _about_best(forecast, n) for n, k in enumerate(small) if k in solved}
    tried |= {k: grids[k] for k in set(range(len(grids))) - set(small)}
    rows = list(tried)
    out[rows] = np.maximum(out[rows], look.explained(list(tried.values())))
    return out


def _about_best(forecast: Forecast, k: int) -> Grid:
    """Return the grid of a candidate at its best place and the next ones on either side."""
    little, rows = forecast.littles[k], np.flatnonzero(forecast.owner == k)
    i, grid = int(np.argmax(forecast.share[rows])), little.grid
    near = {grid.direction(point, little.absent) for point in little.points[max(i - 1, 0) : i + 2]}
    return Grid(grid.effect, tuple(p for p in grid.points if grid.direction(p, little.absent) in near))


def _rms(x: Floats) -> float:
    x = x[np.isfinite(x)]
    return float(np.sqrt((x**2).mean()) * DB_PER_NEPER) if x.size else float("nan")
