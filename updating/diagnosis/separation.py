"""What tells two explanations of the same data apart: in these data, and in data that could be taken next."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.linalg import block_diag

from fem.analysis.frf import FRF
from fem.array_types import Complexes, Floats, Ints
from fem.lengths import length_text
from fem.model import Model, parameter_values
from updating.correlation import DB_PER_NEPER
from updating.forecast.forecast import MOST_COMPARED
from updating.forecast.information import ExpectedGains, Information, without
from updating.forecast.look import Look
from updating.inference.fit import FitProblem
from updating.inference.fit_data import FitData
from updating.inference.fit_function import ROBUST
from updating.inference.fit_result import FitResult
from updating.inference.fitting import FULL_LINES
from updating.inference.form_scatter import FormScatter
from updating.inference.frf_function import FrfFunction
from updating.inference.heartbeat import beat
from updating.inference.preparation import prepared_like
from updating.inference.scatter import form_scatter, with_channels
from updating.least_squares.costs import Levels, pseudo_huber, pseudo_huber_weight
from updating.measurement.measurement import STRAIN, Measurement, Sensor, directed_of

N_COMPARED_LINES = 60
"""Lines at which predictions are compared."""
MOST_PLACES = 120
"""Approximate largest number of places that are tried."""
N_AT_ONCE = 24
"""Number of new channels whose slopes are kept at once."""
BAND_BEYOND = 1.5
"""The band is tried up to this multiple of the present one."""


@dataclass(frozen=True, slots=True)
class Proposal:
    """A measurement that would separate two explanations.

    Attributes
    ----------
    kind : str
        ``"sensor"`` (with the present forces), ``"excitation"`` (with the present sensors) or ``"band"`` (the
        present channels beyond the present band).
    where : str
        In words.
    point : tuple of float
        Coordinates of the place [m]; empty for a band.
    direction : tuple of float
        Unit vector; empty for a band.
    band : (float, float)
        Frequencies [Hz].
    difference_db : float
        Root mean square difference of the two predictions' amplitudes [dB].
    evidence : float
        Expected gain of the log likelihood ratio once the wrong one of the two has been fitted again to all
        data [nats]; 3 is a ratio of 20 to 1.
    """

    kind: str
    where: str
    point: tuple[float, ...]
    direction: tuple[float, ...]
    band: tuple[float, float]
    difference_db: float
    evidence: float


@dataclass(frozen=True, slots=True)
class Decisive:
    """A piece of the data that prefers one explanation to another.

    Attributes
    ----------
    output, input : str
        The FRF.
    band : (float, float)
        Frequencies [Hz].
    first_db, second_db : float
        Error of the two there [dB].
    share : float
        Its share of what all pieces that prefer the first say for it [-].
    """

    output: str
    input: str
    band: tuple[float, float]
    first_db: float
    second_db: float
    share: float


def what_decides(problem: FitProblem, first: FitResult, second: FitResult) -> tuple[Decisive, ...]:
    """Return the four pieces of the data that speak most for the first of two fits, the strongest first.

    A piece is one FRF in one of eight bands with equally many lines. What it says is the difference of
    the sums of the squared weighted log ratios.
    """
    ratios = [problem.log_ratio(fit) for fit in (first, second)]
    weight, frf = problem.data.weight, problem.data.measurement.frf
    squares = [np.where(np.isfinite(r), np.abs(weight * r) ** 2, 0.0) for r in ratios]
    gain = squares[1] - squares[0]
    f = problem.data.frequency
    pieces = np.array_split(np.arange(len(f)), min(8, len(f)))
    evidence = np.stack([gain[lines].sum(axis=0) for lines in pieces])
    total = evidence[evidence > 0].sum()
    out = []
    for k in np.argsort(-evidence, axis=None)[:4]:
        b, i, j = np.unravel_index(k, evidence.shape)
        if evidence[b, i, j] <= 0:
            break
        lines = pieces[b]
        one, other = (float(np.sqrt(np.nanmean(r[lines, i, j].real ** 2)) * DB_PER_NEPER) for r in ratios)
        band = (float(f[lines[0]]), float(f[lines[-1]]))
        share = float(evidence[b, i, j] / total)
        out.append(Decisive(frf.outputs[i], frf.inputs[j], band, one, other, share))
    return tuple(out)


def next_measurements(
    problem: FitProblem, first: FitResult, second: FitResult, most: int = 3
) -> tuple[Proposal, ...]:
    """Return the measurements that would best separate two fits, at most ``most`` of each kind.

    The first predicts the new FRFs. The second follows them with all that may vary, as far as the present
    data leave it free. What remains beside the present residuals gives the expected log likelihood ratio
    (Lindley, Ann. Math. Stat. 27, 1956, in the linear case), by the code that plans a test
    (:mod:`updating.forecast.information`). Channels have noise as the present ones have, and an unknown gain.

    Parameters
    ----------
    problem : FitProblem
    first, second : FitResult
        The second is the one that is thought wrong.
    most : int
        How many of each kind.
    """
    model, m = problem.reduced.model, problem.data.measurement
    places = places_along(model)
    new = tuple(
        Sensor(f"new {point}{axis}", model.mesh.points[point], np.eye(3)[k])
        for point, _ in places
        for k, axis in enumerate("xyz")
    )
    f = problem.data.frequency
    band = (float(f[0]), float(f[-1]))
    lines = np.linspace(*band, N_COMPARED_LINES)
    told = _Separated.of(problem, first, second)
    found: list[Proposal] = []
    for kind, present in (("sensor", m.sensors), ("excitation", m.excitations)):
        d, evidence = told.by_new_channels(kind, new, lines)
        ranked = []
        for k in np.argsort(-evidence, kind="stable"):
            point, place = places[k // 3]
            axis = np.eye(3)[k % 3]
            xyz = model.mesh.points[point]
            if not np.isfinite(evidence[k]) or has_sensor(present, xyz, axis, model.mesh.size):
                continue
            where = f"{place}, along {'xyz'[k % 3]}"
            at, along = tuple(map(float, xyz)), tuple(map(float, axis))
            ranked.append(Proposal(kind, where, at, along, band, float(d[k]), float(evidence[k])))
            if len(ranked) == most:
                break
        found += ranked
    higher = (band[1], BAND_BEYOND * band[1])
    d_db, gain = told.by_higher_band(np.linspace(*higher, N_COMPARED_LINES // 2))
    if np.isfinite(gain):
        where = f"the present channels from {higher[0]:.4g} to {higher[1]:.4g} Hz"
        found.append(Proposal("band", where, (), (), higher, d_db, gain))
    return tuple(sorted(found, key=lambda p: -p.evidence))


def places_along(model: Model) -> list[tuple[int, str]]:
    """Return points of the mesh along the members and of reduced parts, each once, with their names."""
    mesh, out, seen = model.mesh, [], set()
    # Places along a member at which a sensor or a force is tried; fewer where there are many members
    count = int(np.clip(MOST_PLACES // max(len(mesh.members), 1), 2, 5))
    for member in mesh.members:
        points = mesh.member_points(member)
        along = mesh.member_positions(member)
        for k in np.unique(np.linspace(0, len(points) - 1, count).round().astype(int)):
            if int(points[k]) not in seen:
                seen.add(int(points[k]))
                out.append((int(points[k]), f"member {member} at {length_text(float(along[k]))}"))
    names = {point: name for name, point in mesh.point_names.items()}
    for part in (e for e in model.effects if e.reduced_part):
        for k, point in enumerate(part.points, start=1):  # type: ignore[attr-defined]
            if point not in seen:
                seen.add(point)
                out.append((point, names.get(point, f"attachment {k} of part {part.name}")))
    return out


def has_sensor(sensors: Sequence[Sensor], xyz: Floats, axis: Floats, size: float) -> bool:
    """Return whether one of some sensors is at a place along an axis, in a structure of a size [m]."""
    return any(
        np.linalg.norm(s.point - xyz) < 0.02 * size and abs(float(s.direction @ axis)) > 0.9
        for s in directed_of(sensors)
    )


def _without_channels(scatter: FormScatter | None) -> FormScatter | None:
    return None if scatter is None else replace(scatter, channels=None)


@dataclass(frozen=True, slots=True, eq=False)
class _Separated:
    """What new data would tell of two fits to the present ones.

    Attributes
    ----------
    problem : FitProblem
    fits : (FitResult, FitResult)
        The second follows what the first predicts.
    deviations : (FormScatter or None, FormScatter or None)
        Small deviations that each fit has, without those of channels.
    known : ndarray (u, u)
        Precision of the second fit's unknowns but for errors of channels, by the present data.
    n_fixed : int
        How many of them are parameters and damping; deviations of the modes follow.
    bands : ndarray of int (n_groups,)
        Band of each group of present residuals.
    sizes : ndarray (n_groups,)
        Numbers of these in a fit.
    levels : Levels
        Of these.
    left : (ndarray (n_groups,), ndarray (n_groups,))
        Mean squares of the present residuals of each fit.
    """

    problem: FitProblem
    fits: tuple[FitResult, FitResult]
    deviations: tuple[FormScatter | None, FormScatter | None]
    known: Floats
    n_fixed: int
    bands: Ints
    sizes: Floats
    levels: Levels
    left: tuple[Floats, Floats]

    @classmethod
    def of(cls, problem: FitProblem, first: FitResult, second: FitResult) -> "_Separated":
        """Look at the present data from where the second fit is."""

        def look_at(fit: FitResult) -> tuple[Look[Any, Any], FormScatter | None]:
            scatter = form_scatter(problem, fit, fit.size)
            there = replace(problem.with_forces_of(fit), scatter=scatter)
            return Look.of(there, fit, N_COMPARED_LINES, 0, MOST_COMPARED, bounded=False), scatter

        def left(look: Look[Any, Any]) -> Floats:
            return pseudo_huber(look.now, ROBUST) @ look.share

        (one, small), (two, scatter) = look_at(first), look_at(second)
        n_channels = 0 if scatter is None else scatter.n_channels
        J = np.roll(two.slopes * np.sqrt(two.trust), n_channels, axis=0)
        counts = problem.data.mask.sum(axis=(1, 2))
        bands = np.unique(problem.band_of(two.residuals.lines)[counts[two.residuals.lines] > 0])
        lines = problem.lines_up_to(np.inf, FULL_LINES)
        sizes = np.bincount(problem.band_of(lines), counts[lines], minlength=int(bands[-1]) + 1)
        return cls(
            problem,
            (first, second),
            (_without_channels(small), _without_channels(scatter)),
            without(J @ J.T, np.zeros((n_channels, n_channels))),
            len(two.prior_of) + len(problem.damping.start),
            bands,
            np.maximum(sizes[bands].astype(float), 1.0),
            two.likelihood,
            (left(one), left(two)),
        )

    def by_new_channels(self, kind: str, new: Sequence[Sensor], frequency: Floats) -> tuple[Floats, Floats]:
        """Return for each new sensor, or force, the difference [dB] and the evidence [nats]; NaN in noise."""
        m, groups = self.problem.data.measurement, self._groups(frequency)
        others = m.excitations if kind == "sensor" else m.sensors
        # Largest number of present sensors that count for a new force
        some = others[:: max(1, len(others) // 8)] if kind == "excitation" else others
        # one channel among those that there are, each line with as many values as before
        n_lines = np.bincount(groups, minlength=len(self.sizes))
        full = len(self.problem.lines_up_to(np.inf, FULL_LINES)) * n_lines / n_lines.sum()
        sizes = self.sizes + full * len(others)
        share = full * len(others) / np.maximum(n_lines * len(some), 1) / sizes
        levels = self.problem.likelihood(self.levels.n, sizes, self.levels.noise)
        # beside both fits new residuals are as those of the first
        mixed = (self.sizes * self.left[1] + full * len(others) * self.left[0]) / sizes
        now = self.levels.cost(self.left[1]) - self.levels.cost(self.left[0])
        more = levels.cost(mixed) - levels.cost(self.left[0]) - now
        out, u = np.full((2, len(new)), np.nan), len(self.known)
        here = np.repeat(groups, len(some))
        for first in range(0, len(new), N_AT_ONCE):
            beat()
            chunk = tuple(new[first : first + N_AT_ONCE])
            ends = (chunk, some) if kind == "sensor" else (some, chunk)
            d, slopes, weight, of = self._predicted(*ends, frequency, self.deviations)
            if kind == "excitation":
                d, slopes, weight = d.swapaxes(-1, -2), slopes.swapaxes(-1, -2), weight.swapaxes(-1, -2)
                of = of - len(some)
            for k in range(len(chunk)):
                w = weight[:, k].ravel()
                if not (w > 0).any():
                    continue
                # beside its own errors, those of the present channels are known
                unknown = np.r_[:u, u + np.flatnonzero(of == k)]
                rows = np.vstack([slopes[unknown, :, k].reshape(len(unknown), -1), d[:, k].reshape(1, -1)])
                known = block_diag(self.known, np.eye(len(unknown) - u))
                out[:, first + k] = self._evidence(rows, w, here, known, levels, mixed, share)
        return out[0], np.maximum(out[1] + more, 0.0)

    def by_higher_band(self, frequency: Floats) -> tuple[float, float]:
        """Return the difference [dB] and the evidence [nats] of the present channels in another band."""
        m, problem = self.problem.data.measurement, self.problem
        there = self._with_data(m.sensors, m.excitations, frequency)
        scatter = _without_channels(form_scatter(there, self.fits[1]))
        d, slopes, weight, of = self._predicted(m.sensors, m.excitations, frequency, (None, scatter))
        n, slopes = self.n_fixed, slopes[: len(slopes) - len(of)]
        # which modes deviate there is another question than which do here
        order = np.r_[n : len(self.known), :n]
        known = without(self.known[np.ix_(order, order)], np.zeros((len(self.known) - n,) * 2))
        known = block_diag(known, np.eye(len(slopes) - n))
        reach = (frequency[-1] - frequency[0]) / problem.data.frequency[-1]
        size = np.array([FULL_LINES * reach * d[0].size])
        mean = (self.sizes / self.sizes.sum()) @ np.stack([self.levels.noise, self.left[0]], axis=1)
        levels = problem.likelihood(np.array([problem.n_independent() * reach]), size, mean[:1])
        rows, w = np.vstack([slopes.reshape(len(slopes), -1), d.reshape(1, -1)]), weight.ravel()
        if not (w > 0).any():
            return np.nan, np.nan
        here, share = np.zeros(len(w), dtype=np.int64), np.array([1 / len(w)])
        return self._evidence(rows, w, here, known, levels, mean[1:], share)

    def _groups(self, frequency: Floats) -> Ints:
        """Return the present group that each new line is in, or the next one."""
        data = replace(self.problem.data, frequency=frequency)
        found = replace(self.problem, data=data).band_of(np.arange(len(frequency)))
        return np.minimum(np.searchsorted(self.bands, found), len(self.bands) - 1)

    @staticmethod
    def _evidence(
        rows: Complexes,
        weight: Floats,
        group: Ints,
        known: Floats,
        levels: Levels,
        level: Floats,
        share: Floats,
    ) -> tuple[float, float]:
        """Return the difference [dB] and the expected gain [nats] of new values, (m,).

        ``rows`` (u + 1, m) are what unknowns do to the weighted residuals and, last, these, and ``share``
        (n_groups,) what each counts for the mean square of its group.
        """
        worth = levels.weight(level)
        root = np.sqrt((worth * share)[group] * pseudo_huber_weight(rows[-1], ROBUST))
        flat = np.hstack([rows.real * root, rows.imag * root])
        both = np.tile(group, 2)
        by_group = [flat[:, both == g] for g in range(len(worth))]
        found = Information.of(by_group, len(known), 1).beyond(known)
        squares = found.squares / worth
        gain = ExpectedGains(levels, level).gains(np.ones(1), squares, found.known)[0]
        seen = weight > 0
        difference = rows[-1].real[seen] / weight[seen]
        return float(np.sqrt((difference**2).mean()) * DB_PER_NEPER), float(gain)

    def _predicted(
        self,
        sensors: Sequence[Sensor],
        excitations: Sequence[Sensor],
        frequency: Floats,
        deviations: Sequence[FormScatter | None],
    ) -> tuple[Complexes, Complexes, Floats, Ints]:
        """Return weighted residuals of the second fit in what the first predicts, slopes, and weights.

        (n_freq, n_out, n_in), (u, n_freq, n_out, n_in) and (n_freq, n_out, n_in), and the channels of whose
        errors the last slopes are, excitations behind sensors.
        """
        lines, present = np.arange(len(frequency)), self.problem.data.measurement
        number = {id(c): k for k, c in enumerate((*present.sensors, *present.excitations))}

        def function_of(k: int, problem: FitProblem) -> tuple[FrfFunction, Floats]:
            fit, small = self.fits[k], deviations[k]
            if len(fit.channels):
                zero = np.zeros((1, fit.channels.shape[1]))
                rows = [number.get(id(c), -1) for c in (*sensors, *excitations)]
                fit = replace(fit, channels=np.vstack([fit.channels, zero])[rows])
            there = problem.with_forces_of(fit)
            small = with_channels(there, fit, small)
            function = replace(there, scatter=small).function(
                fit.effects, [parameter_values(e) for e in fit.effects], lines
            )
            return function, function.moved_to(fit)

        problem = self._with_data(sensors, excitations, frequency)
        function, x = function_of(0, problem)
        H = function.receptance(x)
        data = self._as_measured(problem, H) if H.any() else replace(problem.data, mask=H != 0)
        problem = replace(problem, data=data)
        function, x = function_of(1, problem)
        keep = problem.data.mask
        r, J = function(x, True)
        assert J is not None
        d, slopes = np.zeros(keep.shape, dtype=complex), np.zeros((len(J), *keep.shape), dtype=complex)
        d[keep], slopes[:, keep] = r, J
        channels = None if function.scatter is None else function.scatter.channels
        of = np.zeros(0, dtype=np.int64) if channels is None else channels.of
        return d, slopes, np.where(keep, problem.data.weight, 0.0), of

    def _with_data(
        self, sensors: Sequence[Sensor], excitations: Sequence[Sensor], frequency: Floats
    ) -> FitProblem:
        """Return a problem with other channels and lines, whose data are none."""
        p, m = self.problem, self.problem.data.measurement
        shape = (len(frequency), len(sensors), len(excitations))
        outputs, inputs = ([s.name for s in part] for part in (sensors, excitations))
        base = [name for name in m.frf.base if name in inputs]
        strain = tuple(s.name for s in sensors if s.quantity == STRAIN)
        one, H = np.ones(shape), np.ones(shape, dtype=np.complex128)
        frf = FRF.from_arrays(frequency, H, m.frf.kind, outputs, inputs, base, strain)
        test = Measurement(frf, tuple(sensors), tuple(excitations), phase=m.phase, errors=m.errors)
        none = np.zeros(len(frequency), dtype=bool)
        data = FitData(test, frequency, H, one > 0, one, 0 * one, none)
        return replace(p, data=data, modes=None, scatter=None)

    def _as_measured(self, problem: FitProblem, H: Complexes) -> FitData:
        """Return data with receptances, as noisy as the present motions by the same forces.

        A part of the noise is in proportion to the response, another one the same at all lines.
        """
        test, present, f = problem.data.measurement, self.problem.data, problem.data.frequency
        motion = [s.quantity != STRAIN for s in present.measurement.sensors]
        known = (present.mask & (present.H != 0))[:, motion]
        share = present.noise[:, motion]
        added = (np.abs(present.H) * present.frequency[:, None, None] ** 2)[:, motion] * share

        def quiet(inputs: Sequence[int]) -> tuple[float, float]:
            here = known[:, :, inputs]
            if not here.any():
                return 0.0, 0.0
            # New channels have the noise that no more than this share of the present values is below [-]
            one, two = (float(np.quantile(x[:, :, inputs][here], 0.1)) for x in (share, added))
            return one, two

        number = {name: [k] for k, name in enumerate(present.measurement.frf.inputs)}
        every = list(range(known.shape[2]))
        parts = np.array([quiet(number.get(name, every)) for name in test.frf.inputs])
        with np.errstate(divide="ignore", invalid="ignore"):
            scatter = np.hypot(parts[:, 0], parts[:, 1] / (np.abs(H) * f[:, None, None] ** 2))
        scatter = np.where(H != 0, scatter, 0.0)
        return prepared_like(problem, replace(test, frf=test.frf.with_receptances(H, f), scatter=scatter))
