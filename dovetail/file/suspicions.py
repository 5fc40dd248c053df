"""Suspicions about measured FRFs compared with the model's: their unit, their kind, their frequency axis.

Data and model may each be at fault, and nothing here tells which. So these are warnings that give both
suspects with the size of their fault. Proofs by phase and causality are in :mod:`dovetail.file.conventions`.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
from numpy.typing import NDArray

from dovetail.file.measured import FREQUENCY_UNITS, G0, RawMeasurement
from dovetail.file.measured_modes import MeasuredModes
from fem.analysis.condensed import frf_function
from fem.analysis.frf import FRF, FRFKind
from fem.analysis.modes import Modes, first_modes
from fem.array_types import Floats
from fem.linalg.solvers import factorise
from fem.model import Model
from fem.system import System, assemble
from updating.inference.mode_targets import mac_of
from updating.measurement.measurement import Measurement, outputs_of, sensor_rows
from updating.quality.phase import PhaseEvidence

SUSPECTS: tuple[tuple[float, str], ...] = (
    (1 / G0, "in g/N where (m/s²)/N is meant"),
    (G0, "multiplied by 9.81 once too often"),
    (1e3, "in mm where m is meant, (mm/s²)/N"),
    (1e-3, "in kN for N or km for m, a thousand times too small"),
    (1e6, "in µm where m is meant"),
    (1e3 / G0, "in g/kN where (m/s²)/N is meant"),
    (1e-3 / G0, "in g/N, divided by a thousand"),
    (4.44822, "per pound-force where N is meant"),
    (4.44822 / G0, "in g/lbf where (m/s²)/N is meant"),
    (39.3701, "in inches where m is meant"),
    (39.3701 * 4.44822, "in inches per pound-force where m/N is meant"),
)
"""Measured over computed, and possible causes in the data."""

RATIO_SUSPECTS: tuple[tuple[float, str], ...] = (
    (G0, "of responses in m/s² to a {} in g"),
    (1 / G0, "of responses in g to a {} in m/s²"),
    (1e3, "of responses in mm to a {} in m"),
    (1e-3, "of responses in m to a {} in mm"),
    (1e3 * G0, "of responses in mm/s² to a {} in g"),
)
"""The same of responses to a motion, of the base for example: their size does not depend on all stiffness."""

UNIT_FACTORS = (1 / G0, G0, 1e3, 1e-3, 1e6, 1e-6, 39.3701, 1 / 39.3701)
"""Between units of single channels."""

STILL = 1e-3
"""Motion of the model at the sensors, relative to its largest, below which it counts as at rest there [-]."""

LARGE_FACTOR = 2.5
"""Ratio of measured to computed FRFs beyond which a word is said [-]."""

_LEAST_LINES, _LEAST_CHANNELS = 8, 3
_SPREAD_OF_UNITS = 0.1
"""Median deviation over lines of a channel's ratio to the model, if that may be one factor [decades]."""


@dataclass(frozen=True, slots=True, eq=False)
class RatioToModel:
    """Ratio of measured FRFs to the model's at some lines.

    Attributes
    ----------
    frequency : ndarray (n,)
        [Hz].
    ratio : ndarray of complex (n, n_out, n_in)
        Measured over computed; NaN where the model does not move [-].
    computed : ndarray of complex (n, n_out, n_in)
        The model's FRFs.
    """

    frequency: NDArray[np.float64]
    ratio: NDArray[np.complex128]
    computed: NDArray[np.complex128]

    @property
    def dissipation(self) -> NDArray[np.float64]:
        """Correlation of the imaginary parts, in the sense in which the real parts agree, (n_out, n_in) [-].

        Of FRFs that are a multiple of the model's 1, and of their conjugates -1.
        """
        a, b = self.computed, np.where(np.isfinite(self.ratio), self.ratio, 0) * self.computed
        real, imag = ((x * y).sum(axis=0) for x, y in ((a.real, b.real), (a.imag, b.imag)))
        size = np.sqrt((a.imag**2).sum(axis=0) * (b.imag**2).sum(axis=0))
        return np.sign(real) * imag / np.where(size > 0, size, 1.0)

    @property
    def log(self) -> NDArray[np.float64]:
        """Decimal logarithm of the ratio's size; NaN for none or zero, (n, n_out, n_in)."""
        size = np.abs(self.ratio)
        return np.log10(np.where(size > 0, size, np.nan))

    @property
    def misfit(self) -> float:
        """Median distance of the logarithms from their channel's median [decades]."""
        log = self.log
        seen = np.isfinite(log).mean(axis=0) > 0.5
        if not seen.any():
            return float("nan")
        log = log[:, seen]
        return float(np.nanmedian(np.abs(log - np.nanmedian(log, axis=0))))


class LazyComparison:
    """A measurement and the model's FRFs at some of its lines, which are computed when they are asked for.

    Parameters
    ----------
    model : Model
    system : callable
        Returns the assembled model; several measurements may share one that assembles it once.
    measurement : Measurement
    """

    def __init__(self, model: Model, system: Callable[[], System], measurement: Measurement) -> None:
        self.model, self.measurement, self._system = model, measurement, system

    @classmethod
    def of(cls, model: Model, measurements: Sequence[Measurement]) -> list["LazyComparison"]:
        """Return those of several measurements, with one assembled model."""
        system = cache(lambda: assemble(model, reciprocal=False))
        return [cls(model, system, m) for m in measurements]

    @cached_property
    def to_model(self) -> RatioToModel | None:
        """Ratio of the measurement to the model at some lines; None where there are too few."""
        return self.on_axis(1.0)

    def on_axis(self, factor: float) -> RatioToModel | None:
        """Return the same with a factor on the measured frequencies, as if they were in another unit.

        None where the mesh shows nothing at such frequencies.
        """
        if self._lines.size < _LEAST_LINES:
            return None
        frequency = factor * self.measurement.frf.frequency[self._lines]
        if factor > 1 and not _shown(self._system(), float(np.median(frequency))):
            return None
        frf = self.measurement.frf
        return _ratio_to_model(frequency, frf.H[self._lines], self._computed(frequency), frf.is_strain)

    def motion_at_sensors(self, frequency: NDArray[np.float64]) -> float:
        """Return the largest motion at a sensor relative to the model's largest, the median of lines [-].

        Translations of points, under the forces of the test at some of the frequencies [Hz].
        """
        model, system, m = self.model, self._system(), self.measurement
        n_points = model.mesh.n_points
        forces = sensor_rows(model, m.excitations).T
        rows = sensor_rows(model, m.sensors) / np.array([s.gain for s in m.sensors])[:, None]
        shares = []
        for f in np.quantile(frequency, np.linspace(0.1, 0.9, 5)):
            Z = system.dynamic_stiffness(2 * np.pi * f)
            u = np.asarray(system.Q @ factorise(Z).solve(system.Q.T @ forces))
            moved = np.abs(u[: 6 * n_points].reshape(n_points, 6, -1)[:, :3])
            largest = moved.max(axis=(0, 1))
            shares.append(float((np.abs(rows @ u).max(axis=0) / np.where(largest > 0, largest, 1.0)).max()))
        return float(np.median(shares))

    @cached_property
    def _lines(self) -> NDArray[np.int64]:
        usable = np.flatnonzero(self.measurement.frf.frequency > 0)
        return usable[np.unique(np.linspace(0, usable.size - 1, min(usable.size, 240)).astype(int))]

    @cached_property
    def _computed(self) -> Callable[[NDArray[np.float64]], NDArray[np.complex128]]:
        m = self.measurement
        every, references = outputs_of(m.sensors, m.excitations)
        rows, columns = (sensor_rows(self.model, part) for part in (every, m.excitations))
        lines, moving = m.frf.frequency[self._lines], ~m.frf.is_strain
        receptances = frf_function(self._system(), lines, rows, columns, FRFKind.RECEPTANCE)

        def computed(frequency: NDArray[np.float64]) -> NDArray[np.complex128]:
            omega = 2 * np.pi * frequency
            H = np.array(receptances(frequency))
            H = H if references is None else references.read(H, omega)
            H[:, moving] *= (1j * omega[:, None, None]) ** m.frf.kind.derivatives
            return H

        return computed


def _shown(system: System, frequency: float) -> bool:
    """Return whether the mesh is fine enough to show waves at a frequency [Hz].

    √(K_ii / M_ii) of a coordinate is the frequency of waves that are two or three elements long.
    """
    K, M = system.K.diagonal(), system.M.diagonal()
    moved = (K > 0) & (M > 0)
    return bool(moved.any()) and 2 * np.pi * frequency < float(np.median(np.sqrt(K[moved] / M[moved])))


def _ratio_to_model(
    frequency: NDArray[np.float64],
    measured: NDArray[np.complex128],
    H: NDArray[np.complex128],
    strain: NDArray[np.bool_],
) -> RatioToModel:
    H = np.where(np.isfinite(H), H, 0.0)  # at a resonance without damping there is no ratio
    # Motions by rounding alone, as across the plane of a plane frame, have no ratio.
    size = np.median(np.abs(H), axis=0)
    largest = np.zeros(size.shape)
    for alike in (strain, ~strain):
        largest[alike] = size[alike].max(initial=0.0)
    # Share of the largest FRF's size below which one of the model does not tell a unit
    there = (H != 0) & (size > 1e-4 * largest)
    ratio = np.where(there, measured / np.where(there, H, 1.0), complex("nan"))
    return RatioToModel(frequency, ratio, H)


def suspicions(
    comparisons: Sequence[LazyComparison],
    raw: Sequence[RawMeasurement],
    evidence: Sequence[PhaseEvidence | None],
) -> list[str]:
    """Return suspicions about the order of magnitude and the frequencies of measured FRFs, in sentences.

    The median over channels of |measured| / |computed|, a line at a time, hardly depends on where resonances
    are. Its size tells another unit, its slope over frequency another kind of FRF.

    Parameters
    ----------
    comparisons : sequence of LazyComparison
    raw : sequence of RawMeasurement
        Their files.
    evidence : sequence of PhaseEvidence or None
        Of each measurement; a kind that its phases contradict is not suspected.
    """
    out = []
    for c, r, e in zip(comparisons, raw, evidence, strict=True):
        to_model = c.to_model if r.check_units else None
        if to_model is None:
            continue
        text = _axis_words(c, to_model, r.axis_unit) or _size_words(c, to_model, e)
        texts = [text] if text else _channel_words(c.measurement, to_model)
        out += [f"the FRFs of {r.name} {text}; check_units = false switches this check off" for text in texts]
    return out


def _axis_words(comparison: LazyComparison, to_model: RatioToModel, given: str) -> str:
    """Return of which other unit the frequencies look, for one that halves the misfit to the model.

    ``given`` is the unit that the study says.
    """
    # Median misfit of the amplitudes, levels aside, above which other frequency axes are tried (3 dB)
    if not to_model.misfit > 0.15:
        return ""
    best, name = 0.5 * to_model.misfit, ""
    size = FREQUENCY_UNITS[given]
    first = {f: unit for unit, f in reversed(FREQUENCY_UNITS.items()) if f != size}  # of units of one size
    for factor, unit in first.items():
        other = comparison.on_axis(factor / size)
        if other is not None and other.misfit < best:
            best, name = other.misfit, unit
    if not name:
        return ""
    f = comparison.measurement.frf.frequency / size
    factor = FREQUENCY_UNITS[name] / size
    return (
        f"fit the model better if their frequencies, {f[0]:.4g} to {f[-1]:.4g}, are in {name} (median "
        f"misfit of the amplitudes {20 * best:.2g} dB; in {given} {20 * to_model.misfit:.2g} dB): either "
        f'they are in {name}, and frequency_unit = "{name}" converts them, or the model\'s natural '
        f"frequencies are off by a factor of {factor:.4g}"
    )


def _medians(to_model: RatioToModel) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return decimal logarithms of frequencies and of measured over computed, the median over channels."""
    log = to_model.log.reshape(to_model.frequency.size, -1)
    log = log[:, np.isfinite(log).mean(axis=0) > 0.5]
    some = np.isfinite(log).any(axis=1)
    if some.sum() < _LEAST_LINES:
        return np.zeros(0), np.zeros(0)
    return np.log10(to_model.frequency[some]), np.nanmedian(log[some], axis=1)


def _size_words(comparison: LazyComparison, to_model: RatioToModel, evidence: PhaseEvidence | None) -> str:
    """Return a likely cause of the ratio of measured to computed FRFs; nothing where it is about 1."""
    frf = comparison.measurement.frf
    x, y = _medians(to_model)
    if not x.size:
        return ""
    level, _ = _centre(y)
    factor = 10**level
    like = kind_by_model(frf, to_model, evidence)
    if like is not None:
        return (
            f"are called {frf.kind}, and compared with the model they look like {like}, {factor:.3g} times "
            f'the model\'s in the median: either kind = "{like}" is right, or the model is far too stiff at '
            "one end of the band and too soft at the other"
        )
    if abs(level) < np.log10(LARGE_FACTOR):
        return ""
    share = comparison.motion_at_sensors(to_model.frequency) if factor > 1 / STILL else 1.0
    if share < STILL:
        return (
            f"are {factor:.3g} times the model's, which hardly moves at its sensors ({share:.2g} of its "
            "largest motion): look at the places and directions of sensors and excitations"
        )
    words = {e.per_acceleration for e in comparison.measurement.excitations}
    driven = " or ".join(sorted(words)) if "" not in words else ""
    suspects = RATIO_SUSPECTS if driven else SUSPECTS
    distance, suspect, suspicion = min((abs(level - np.log10(f)), f, text) for f, text in suspects)
    data = "their unit is wrong"
    # A unit is named if it explains the ratio up to this factor [-]
    if distance < np.log10(1.5):
        data = f"they are {suspicion.format(driven)} (scale = {1 / suspect:.6g} corrects that)"
    off = f"{max(factor, 1 / factor):.3g} times too {'light and soft' if factor < 1 else 'heavy and stiff'}"
    model = f"is as if {off}; look at its sections, densities, masses, joints and damping"
    if driven:
        model = (
            f"moves otherwise than its {driven}; look at its supports and at the place and direction of the "
            f"{driven}"
        )
    return (
        f"are {factor:.3g} times the model's (median over {x.size} lines): either {data}, or the model "
        f"{model}"
    )


def _channel_words(m: Measurement, to_model: RatioToModel) -> list[str]:
    """Return channels whose ratio to the model is that of the others times a factor between units."""
    log, out = to_model.log.copy(), []
    log[:, m.frf.is_strain] = np.nan
    for axis, word, names in ((1, "sensor", m.frf.outputs), (2, "excitation", m.frf.inputs)):
        if len(names) < _LEAST_CHANNELS:
            continue
        each = np.moveaxis(log, axis, 0).reshape(len(names), -1)
        each = [x[np.isfinite(x)] if np.isfinite(x).mean() > 0.5 else x[:0] for x in each]
        levels = [_centre(x) if x.size else (np.nan, np.inf) for x in each]
        known = [level for level, _ in levels if np.isfinite(level)]
        middle = float(np.median(known)) if known else np.nan
        for name, (level, spread) in zip(names, levels, strict=True):
            # a wrong place changes the ratio from line to line, a unit does not
            if not spread < _SPREAD_OF_UNITS:
                continue
            off = (level - middle) * (1 if word == "sensor" else -1)
            distance, suspect = min((abs(off - np.log10(f)), f) for f in UNIT_FACTORS)
            if distance < np.log10(1.2):
                out.append(
                    f"at {word} {name} are {10 ** (level - middle):.3g} times those at the others, compared "
                    f"with the model: either its unit is another one (gain = {suspect:.6g} corrects that), "
                    "or the model moves otherwise there; look at its place and direction"
                )
    return out


def kind_by_model(
    frf: FRF, to_model: RatioToModel, evidence: PhaseEvidence | None, *, by_sign: bool = False
) -> FRFKind | None:
    """Return the kind that FRFs look like compared with the model's, None for the stated one.

    Parameters
    ----------
    frf : FRF
        Measured; its strains say nothing of the kind.
    to_model : RatioToModel
    evidence : PhaseEvidence or None
        A kind whose phase it contradicts is left out.
    by_sign : bool
        Whether driven points have the opposite sign: the slope then tells the kind whatever the gain is.
    """
    kind, moving = frf.kind, ~frf.is_strain
    x, y = _medians(RatioToModel(to_model.frequency, to_model.ratio[:, moving], to_model.computed[:, moving]))
    if not x.size:
        return None
    level, spread = _centre(y)
    slope = slope_of(x, y) or 0.0
    right = evidence is not None and bool((evidence.axis > 0).any())
    for like in FRFKind:
        power = like.derivatives - kind.derivatives
        if power == 0 or (power % 2 and right):  # iω would turn phases that are right
            continue
        # (iω)^power lies between the stated kind of the data and their apparent one
        other, other_spread = _centre(y - power * np.log10(2 * np.pi * 10**x))
        by_slope = abs(slope - power) < 0.4 and (abs(other) < 1.3 or (by_sign and abs(power) == 2))
        by_size = abs(level) > np.log10(LARGE_FACTOR) and abs(other) < np.log10(1.6)
        if by_slope or (by_size and other_spread < 0.9 * spread):
            return like
    return None


def _centre(y: NDArray[np.float64]) -> tuple[float, float]:
    """Return median and median absolute deviation."""
    centre = float(np.median(y))
    return centre, float(np.median(np.abs(y - centre)))


def slope_of(x: NDArray[np.float64], y: NDArray[np.float64]) -> float | None:
    """Return the median slope between points far apart (Theil and Sen); None over less than half a decade."""
    if np.ptp(x) <= 0.5:
        return None
    i, j = np.triu_indices(x.size, 1)
    far = np.abs(x[i] - x[j]) > 0.25 * np.ptp(x)
    return float(np.median((y[i] - y[j])[far] / (x[i] - x[j])[far]))


# Suspicions about measured modes: their units, their deviations, and modes that are given twice -------------
# Data and model may each be at fault, so these are warnings, as those of :mod:`dovetail.file.suspicions`.


SAME_SHAPE = 0.999
"""MAC of two shapes of one frequency that are one mode given twice [-]."""
MORE_MODES = 10
"""Modes of the model beyond the number of measured ones."""


def mode_suspicions(measured: MeasuredModes, model: Model) -> list[str]:
    """Return suspicions about measured modes, in sentences."""
    number = _unit(measured, model) or _unseen(measured, model)
    words = (number, _ratios(measured), _deviations(measured), *_twice(measured))
    return [f"{measured.name}: {text}" for text in words if text]


def _ratios(measured: MeasuredModes) -> str:
    """Return that damping ratios look like percent."""
    zeta = measured.modes.zeta
    known = np.zeros(0) if zeta is None else zeta[np.isfinite(zeta)]
    # Median damping ratio above which ratios look like percent [-]
    if not known.size or np.median(known) <= 0.2:
        return ""
    return (
        f"the damping ratios are {known.min():.3g} to {known.max():.3g}; are they in percent? 1 % is 0.01, "
        "or the heading 'zeta [%]' of a table"
    )


def _deviations(measured: MeasuredModes) -> str:
    """Return that standard deviations look like percent or Hz."""
    largest = float(measured.frequency_std.max(initial=0.0))
    # Relative standard deviation of a frequency above which it looks like percent or Hz [-]
    if largest <= 0.3:
        return ""
    return (
        f"frequency_std is {largest:.3g}, {100 * largest:.3g} % of the frequency; is it in percent or Hz? "
        "It is relative: 0.1 % is 0.001"
    )


def _twice(measured: MeasuredModes) -> list[str]:
    """Return which modes look as if they were given twice."""
    f, shapes = measured.modes.frequency, measured.modes.shapes
    alike = mac_of(shapes, np.nan_to_num(shapes)) if measured.has_shapes else np.ones((f.size, f.size))
    return [
        f"the modes {k + 1} and {k + 2} have the same frequency, {f[k]:.6g} Hz"
        + (", and the same shape" if measured.has_shapes else "")
        + "; is one given twice?"
        for k in np.flatnonzero(np.diff(f) == 0)
        if alike[k, k + 1] > SAME_SHAPE
    ]


def _unseen(measured: MeasuredModes, model: Model) -> str:
    """Return that the model has more modes than were measured, and nothing says which of them."""
    named = measured.numbers or measured.plane or measured.sensors or measured.driven
    f = measured.modes.frequency
    if named or not f.size:
        return ""
    computed = first_modes(assemble(model), f.size + MORE_MODES)
    n = int((computed.frequency[computed.n_rigid :] <= f[-1]).sum())
    if n <= f.size:
        return ""
    most = " or more" if n >= f.size + MORE_MODES else ""
    return (
        f"the model has {n}{most} modes up to {f[-1]:.4g} Hz, {f.size} were measured: without shapes "
        "torsional or axial modes may become their partners. Name sensors and excitations of the test in "
        "[modes], or its plane, or numbers"
    )


def _unit(measured: MeasuredModes, model: Model) -> str:
    """Return in which other unit the frequencies look, if that brings them to the model's."""
    f = measured.modes.frequency
    ratio = _over_computed(measured, first_modes(assemble(model), f.size + MORE_MODES), model)
    if not ratio.size or not f.size:
        return ""
    level = float(np.median(ratio))
    # Largest median deviation of these logarithms from their median, above which no unit is at fault [-]
    if np.median(np.abs(ratio - level)) > 0.15:
        return ""
    others = {unit: np.log(size) for unit, size in FREQUENCY_UNITS.items() if size != 1 and unit != "cpm"}
    unit, log_size = min(others.items(), key=lambda each: abs(abs(level) - abs(each[1])))
    # Largest deviation of ln(measured / computed) from that of another unit [-]
    if abs(abs(level) - abs(log_size)) > 0.3:
        return ""
    heading = f"'frequency [{unit}]'"
    why = f"they are in {unit}, and have to be given in Hz or, in a table, below {heading}"
    if level * log_size > 0:  # converted although they were in Hz
        why = f"they were converted from {unit} and were in Hz already, as below a heading {heading} over Hz"
    return (
        f"the natural frequencies, {f[0]:.4g} to {f[-1]:.4g} Hz, are {np.exp(level):.3g} times the model's: "
        f"either {why}, or the model is off by as much"
    )


def _over_computed(measured: MeasuredModes, computed: Modes, model: Model) -> Floats:
    """Return ln(measured / computed) of modes that are alike, or in their order without shapes."""
    f, elastic = measured.modes.frequency, computed.frequency[computed.n_rigid :]
    shapes = computed.shapes[:, computed.n_rigid :]
    if measured.has_shapes:
        alike = mac_of(measured.modes.shapes, sensor_rows(model, measured.sensors) @ shapes)
        # Least MAC of a measured mode and the model's mode whose frequencies are compared [-]
        return np.log(f / elastic[alike.argmax(axis=1)])[alike.max(axis=1) >= 0.8]
    if measured.numbers:
        known = np.array(measured.numbers) - 1
        return np.log(f[known < elastic.size] / elastic[known[known < elastic.size]])
    if measured.plane:
        motion = (np.abs(shapes.reshape(-1, 6, shapes.shape[1])[:, :3]) ** 2).sum(axis=0)
        within = motion[["xyz".index(axis) for axis in measured.plane]].sum(axis=0)
        elastic = elastic[within > 0.5 * motion.sum(axis=0)]
    n = min(f.size, elastic.size)
    return np.log(f[:n] / elastic[:n])
