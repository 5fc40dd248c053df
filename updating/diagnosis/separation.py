"""What tells two explanations of the same data apart: in these data, and in data that could be taken next."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fem.analysis.referred import References
from fem.model import Model, parameter_values
from fem.reduction.parametric_frf import ParametricFRF
from updating.correlation import DB_PER_NEPER, log_ratio
from updating.inference.fit import FitProblem
from updating.inference.fit_data import SYSTEMATIC_FROM
from updating.inference.fit_result import FitResult
from updating.inference.fitting import FULL_LINES
from updating.measurement.measurement import Sensor, directed_of

N_COMPARED_LINES = 60
"""Lines at which predictions are compared."""
POINTS_PER_MEMBER = 5
"""Places along a member at which a sensor or a force is tried; fewer where there are many members."""
MOST_PLACES = 120
"""Approximate largest number of places that are tried."""
MOST_CHANNELS = 8
"""Largest number of present sensors that count for a new force."""
BAND_BEYOND = 1.5
"""The band is tried up to this multiple of the present one."""

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]


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
        data [nepers]; 3 is a ratio of 20 to 1.
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


def what_decides(
    problem: FitProblem, first: FitResult, second: FitResult, n_bands: int = 8, most: int = 4
) -> tuple[Decisive, ...]:
    """Return the pieces of the data that speak most for the first of two fits, the strongest first.

    A piece is one FRF in one of ``n_bands`` bands with equally many lines. What it says is the difference of
    the sums of the squared weighted log ratios.
    """
    ratios = [problem.log_ratio(fit) for fit in (first, second)]
    weight, frf = problem.data.weight, problem.data.measurement.frf
    squares = [np.where(np.isfinite(r), np.abs(weight * r) ** 2, 0.0) for r in ratios]
    gain = squares[1] - squares[0]
    f = problem.data.frequency
    pieces = np.array_split(np.arange(len(f)), min(n_bands, len(f)))
    evidence = np.stack([gain[lines].sum(axis=0) for lines in pieces])
    total = evidence[evidence > 0].sum()
    out = []
    for k in np.argsort(-evidence, axis=None)[:most]:
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

    Both predict the new FRFs; d is the difference of their logarithms. Part of it the second would follow by
    moving its parameters, whose posterior covariance is C and by which its prediction changes with J. With an
    error level s of the data, what remains is ½ dᵀ (s² I + J C Jᵀ)⁻¹ d, the expected log likelihood ratio
    (Lindley, Ann. Math. Stat. 27, 1956, in the linear case). Lines count as in the fits
    (:class:`updating.least_squares.levels.Levels`).

    Parameters
    ----------
    problem : FitProblem
    first, second : FitResult
        The second is the one that is thought wrong; its covariance is used.
    most : int
        How many of each kind.
    """
    model = problem.reduced.model
    places = places_along(model)
    new = np.zeros((model.n_dof, 3 * len(places)))
    for k, (point, _) in enumerate(places):
        new[6 * point : 6 * point + 3, 3 * k : 3 * k + 3] = np.eye(3)
    outputs, inputs = problem.vectors
    references, behind = problem.references[:2]
    f = problem.data.frequency
    band = (float(f[0]), float(f[-1]))
    lines = np.linspace(*band, N_COMPARED_LINES)
    predict = _Prediction(problem, first, second)
    found: list[Proposal] = []

    # Present forces, measured at new places; by reciprocity also new forces, measured by present sensors.
    step = max(1, outputs.shape[1] // MOST_CHANNELS)
    for kind, columns in (("sensor", inputs), ("excitation", outputs[:, ::step])):
        # A new force would be measured: its FRFs refer to no sensor.
        refer = references.behind(new.shape[1]) if references and kind == "sensor" else None
        d, evidence = predict.compare(np.hstack([new, behind]) if refer else new, columns, lines, refer)
        taken = _present(problem, kind)
        ranked = []
        for k in np.argsort(-evidence, kind="stable"):
            point, place = places[k // 3]
            axis = np.eye(3)[k % 3]
            xyz = model.mesh.points[point]
            if not np.isfinite(evidence[k]) or _is_there(taken, xyz, axis, model.mesh.size):
                continue
            where = f"{place}, along {'xyz'[k % 3]}"
            at, along = tuple(map(float, xyz)), tuple(map(float, axis))
            ranked.append(Proposal(kind, where, at, along, band, float(d[k]), float(evidence[k])))
            if len(ranked) == most:
                break
        found += ranked
    higher = (band[1], BAND_BEYOND * band[1])
    every, lines = np.hstack([outputs, behind]), np.linspace(*higher, N_COMPARED_LINES // 2)
    d, evidence = predict.compare(every, inputs, lines, references)
    good = np.isfinite(evidence)
    if good.any():
        where = f"the present channels from {higher[0]:.4g} to {higher[1]:.4g} Hz"
        rms = float(np.sqrt((d[good] ** 2).mean()))
        found.append(Proposal("band", where, (), (), higher, rms, float(evidence[good].sum())))
    return tuple(sorted(found, key=lambda p: -p.evidence))


def places_along(model: Model) -> list[tuple[int, str]]:
    """Return points of the mesh along the members and of reduced parts, each once, with their names."""
    mesh, out, seen = model.mesh, [], set()
    count = int(np.clip(MOST_PLACES // max(len(mesh.members), 1), 2, POINTS_PER_MEMBER))
    for member in mesh.members:
        points = mesh.member_points(member)
        along = mesh.member_positions(member)
        for k in np.unique(np.linspace(0, len(points) - 1, count).round().astype(int)):
            if int(points[k]) not in seen:
                seen.add(int(points[k]))
                out.append((int(points[k]), f"member {member} at {along[k]:.3g} m"))
    names = {point: name for name, point in mesh.point_names.items()}
    for part in (e for e in model.effects if e.reduced_part):
        for k, point in enumerate(part.points, start=1):  # type: ignore[attr-defined]
            if point not in seen:
                seen.add(point)
                out.append((point, names.get(point, f"attachment {k} of part {part.name}")))
    return out


def _present(problem: FitProblem, kind: str) -> Sequence[Sensor]:
    m = problem.data.measurement
    return m.sensors if kind == "sensor" else m.excitations


def _is_there(sensors: Sequence[Sensor], xyz: Floats, axis: Floats, size: float) -> bool:
    return any(
        np.linalg.norm(s.point - xyz) < 0.02 * size and abs(float(s.direction @ axis)) > 0.9
        for s in directed_of(sensors)
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Prediction:
    problem: FitProblem
    first: FitResult
    second: FitResult

    def compare(
        self, outputs: Floats, inputs: Floats, frequency: Floats, references: References | None
    ) -> tuple[Floats, Floats]:
        """Return for each output the difference [dB] and the evidence [nepers]; NaN where nothing moves.

        The last outputs are those that the first refer to.
        """
        p, n_par = self.problem, len(self.second.values)
        H1, _ = self._frf(self.first, outputs, inputs, frequency, references, slopes=False)
        H2, J = self._frf(self.second, outputs, inputs, frequency, references, slopes=True)
        assert J is not None
        size = np.sqrt((np.abs(H1 * frequency[:, None, None] ** 2) ** 2).mean(axis=(0, 2)))
        d: Complexes = log_ratio(H1, H2)
        n_independent = p.n_independent()
        reach = (frequency[-1] - frequency[0]) / p.data.frequency[-1]
        # The data's own error level: new channels count as the present ones do.
        misfit = min(self.first.level, self.second.level) ** 2
        noise = (SYSTEMATIC_FROM * p.data.noise_level) ** 2
        n_in = inputs.shape[1]
        n, count = n_independent * reach * n_in / max(p.data.H.shape[2], 1), FULL_LINES * reach * n_in
        levels = p.likelihood(*(np.array([x]) for x in (n, count, noise)))
        s2 = d[:, 0].size / float(levels.weight(np.array([misfit]))[0])
        covariance = self.second.covariance[:n_par, :n_par]
        std = np.sqrt(covariance.diagonal())
        units = np.outer(*2 * (np.where(std > 0, std, 1.0),))
        A = np.linalg.pinv(covariance / units, hermitian=True) / units
        out_d, out_e = np.full(len(size), np.nan), np.full(len(size), np.nan)
        for i in range(len(size)):
            di, Ji = d[:, i].ravel(), J[:, :, i].reshape(n_par, -1)
            if size[i] < 1e-3 * size.max() or not np.isfinite(di).all():
                continue
            real, slopes = np.concatenate([di.real, di.imag]), np.hstack([Ji.real, Ji.imag])
            real = np.clip(real, -1.0, 1.0)  # a shifted resonance counts once, not by its height
            part = slopes @ real / s2
            information = A + slopes @ slopes.T / s2
            size_of = np.sqrt(np.maximum(information.diagonal(), 1e-300))  # each parameter in its own unit
            scaled = information / np.outer(size_of, size_of) + 1e-12 * np.eye(n_par)
            remaining = real @ real / s2 - (part / size_of) @ np.linalg.solve(scaled, part / size_of)
            out_d[i] = np.sqrt((di.real**2).mean()) * DB_PER_NEPER
            out_e[i] = 0.5 * max(float(remaining), 0.0)
        return out_d, out_e

    def _frf(
        self,
        fit: FitResult,
        outputs: Floats,
        inputs: Floats,
        frequency: Floats,
        references: References | None,
        *,
        slopes: bool,
    ) -> tuple[Complexes, Complexes | None]:
        p, refs = self.problem.with_forces_of(fit), list(fit.values)
        engine = ParametricFRF(
            p.reduced,
            outputs,
            inputs,
            frequency,
            refs,
            fit.effects,
            viscous=p.viscous,
            references=references,
        )
        zeta = p.damping.ratio(frequency, fit.zeta)
        values = np.array([fit.values[r] for r in refs])
        H, dH, _ = engine.evaluate(values, zeta, gradient=slopes)
        if dH is None:
            return H, None
        starts = [parameter_values(e) for e in fit.effects]
        function = p.function(fit.effects, starts, np.zeros(0, dtype=np.int64))
        slope_of = {v.ref: v.slope(v.to_x(fit.values[v.ref])) / v.size for v in function.variables}
        scale = np.array([slope_of[r] for r in refs])
        safe = np.where(H != 0, H, 1.0)
        return H, scale[:, None, None, None] * dH / safe
