"""The result of a run: the object, and its form as ``result.json`` and ``frf.npz``; see docs/result.md."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field
from datetime import datetime
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, TypeAlias, TypeGuard, TypeVar

import numpy as np
from numpy.typing import NDArray

from dovetail.distribution import DISTRIBUTION
from dovetail.file.contents import StudyContents
from dovetail.spots import axis_text, spot_of
from fem.model import Effect, Model, Parameter
from fem.summary import summary
from updating.correlation import DB_PER_NEPER, Comparison
from updating.diagnosis.departures import Departure
from updating.diagnosis.diagnosis import Diagnosis
from updating.diagnosis.findings import EffectParameter, Finding, Ranked, parameters_of
from updating.diagnosis.fitted_modes import FittedModePair
from updating.diagnosis.localisation import Localisation
from updating.diagnosis.mode_diagnosis import Baseline, ModeDiagnosis
from updating.diagnosis.mode_table import ModeTable
from updating.diagnosis.reported_modes import ReportedModes
from updating.diagnosis.verdict import Explanation, Verdict
from updating.inference.belief import FAR_STD
from updating.inference.fit_result import FitResult
from updating.inference.parameters import DampingCurve
from updating.inference.problem import Problem
from updating.measurement.measurement import Measurement
from updating.plan.plan import Plan
from updating.quality.faults import Fault

if TYPE_CHECKING:
    from dovetail.frf_modes import ModesInFrfs

SCHEMA = "dovetail-result/2"
REPORT, JSON, FRFS, PICTURES = "report.html", "result.json", "frf.npz", "pictures"
FOUND = "found.toml"
NAMES = (REPORT, JSON, FRFS, PICTURES, FOUND)
"""Files in the folder of a run."""
DAMPING_RATIO = "damping ratio at"
"""How the report calls a level of the damping, before its frequency."""
CONNECTIONS_LEVEL = "damping of connections over that of members"
"""How the report calls how much more connections are damped."""
CONNECTIONS_POWER = "power of the frequency in that ratio"
"""How it calls the power of the frequency that their damping goes with."""


GAIN_ERROR, TURNED, SHIFTED = "gain too large by", "turned towards", "shifted along"
"""Errors of channels in words."""
CHANNEL_UNITS = "-", "rad", "rad", "m", "m"
FORM_QUANTITIES = {
    "u": "stiffness",
    "plane": "stiffness in its plane",
    "mass": "mass",
    "inertia": "rotary inertia",
    "A": "mass per length",
    "Iy": "Iy",
    "Iz": "Iz",
    "J": "J",
    "shear": "shear flexibility",
}
LOGARITHMS = ("u", "plane")
"""Parameters of the form that are the logarithm of a factor."""
ADDED = {"mass": "mass", "across": "stiffness across the force"}
"""What an instrument adds, by the parameter of its form."""
_QUANTITIES = {
    "rho": "density",
    "k": "shear coefficients",
    "ky": "shear coefficient along y",
    "kz": "shear coefficient along z",
}


@dataclass(frozen=True, slots=True)
class UncertainValue:
    """An uncertain parameter before and after the fit.

    Attributes
    ----------
    name : str
        ``effect.parameter``, or the damping at a frequency.
    unit : str
    nominal, fitted : float
        ``fitted`` is NaN where a found effect took its place.
    prior_std, std : float
        Standard deviations before and after.
    at_bound : bool
        True if the fit ended at the edge of the allowed range.
    form_of : str
        Section or connection whose form it lets vary; empty for others.
    where : str
        Place of its effect; empty of what belongs to no effect.
    """

    name: str
    unit: str
    nominal: float
    fitted: float
    prior_std: float
    std: float
    at_bound: bool
    form_of: str = ""
    where: str = ""

    @property
    def moved(self) -> float:
        """Return how far the fit went from nominal, in prior standard deviations; NaN if it did not vary."""
        return (self.fitted - self.nominal) / self.prior_std if self.prior_std > 0 else np.nan

    @property
    def stays(self) -> bool:
        """Whether the fit left it within its standard deviation of nominal."""
        return not self.at_bound and abs(self.fitted - self.nominal) <= self.std

    @property
    def is_logarithm(self) -> bool:
        """Whether it is the logarithm of a factor, as of a connection's stiffness."""
        return bool(self.form_of) and self.name.rpartition(".")[2] in LOGARITHMS

    @property
    def far(self) -> bool:
        """Whether the fit went further from nominal than its prior makes plausible."""
        return bool(abs(self.moved) > FAR_STD)

    @property
    def words(self) -> str:
        """Its name as a reader would say it: ``E of steel`` for ``frame.E:steel``."""
        return uncertain_words(self.name, self.unit, self.form_of, self.where)


def parameter_in_words(model: Model, name: str, unit: str) -> str:
    """Return ``effect.parameter`` in words, such as ``mass of excitation at K`` or ``E of steel``."""
    effect = next((e for e in model.effects if name.startswith(f"{e.name}.")), None)
    if effect is None:
        return uncertain_words(name, unit, "")
    parameter = name.removeprefix(f"{effect.name}.")
    form_of = effect.where if effect.is_form else ""
    return uncertain_words(f"{effect.kind}.{parameter}", unit, form_of, effect.where)


def uncertain_words(name: str, unit: str, form_of: str, where: str = "") -> str:
    """Return the name of an uncertain parameter in words; arguments as of :class:`UncertainValue`."""
    # effects may have dots in their names, and so may materials, of which all values belong to the frame
    effect, _, parameter = name.partition(".") if name.startswith("frame.") else name.rpartition(".")
    if form_of:
        names = FORM_QUANTITIES if unit == "-" else ADDED
        return f"{form_of}: {names.get(parameter, parameter)}"
    if not effect or (" " in effect and not where):
        return name
    key, _, of = parameter.partition(":")
    return f"{_QUANTITIES.get(key, key) if of else key.replace('_', ' ')} of {of or where or effect}"


def form_words(parameters: Iterable[Parameter]) -> str:
    """Return what the parameters of a form are, with units: ``relative changes: A (mass per length), Iy``."""
    groups: dict[str, list[str]] = {}
    for p in parameters:
        logarithm = "logarithms of factors" if p.name in LOGARITHMS else "relative changes"
        words = (FORM_QUANTITIES if p.unit == "-" else ADDED).get(p.name, p.name)
        named = p.name if words == p.name else f"{p.name} ({words})"
        groups.setdefault(logarithm if p.unit == "-" else f"added [{p.unit}]", []).append(named)
    return "; ".join(f"{what}: {', '.join(names)}" for what, names in groups.items())


V = TypeVar("V", bound=Verdict, covariant=True)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class RunResult(Generic[V]):
    """Everything that a run found.

    Attributes
    ----------
    study : Study
    diagnosis : Diagnosis or ModeDiagnosis
    comparisons : tuple of Comparison
        For each step of the diagnosis, on all lines.
    held_out_channels : mapping of str to tuple of float
        For ``excitation NAME`` and ``sensor NAME`` that no fit has seen, the error of each step [dB].
    localisation : Localisation or None
        Where the model fails once its uncertain parameters are fitted.
    modes : tuple of FittedModePair
        Natural frequencies and damping before and after.
    uncertain : tuple of UncertainValue
        Before and after the fit; of two states, that to the first one.
    finished : datetime
    seconds : float
    folder : Path
        Where the files are.
    measured_modes : ModeTable or None
        Measured modes, fitted or held out, and those of the model of each step.
    identified : ModesInFrfs or None
        Modes in the measured FRFs beside computed ones, of a study that has no measured modes.
    excluded : Plan or None
        What data in which nothing is missing would have shown.
    states : (dict, dict) or None
        Of two states by FRFs, the frequencies measured before and after, by the number of the mode of the
        calibrated and of the reported model [Hz].
    reported : ReportedModes or None
        Modes of the reported model, of a diagnosis by modes alone.
    """

    study: StudyContents
    diagnosis: V
    uncertain: tuple[UncertainValue, ...]
    finished: datetime
    seconds: float
    folder: Path
    comparisons: tuple[Comparison, ...] = ()
    held_out_channels: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    localisation: Localisation | None = None
    modes: tuple[FittedModePair, ...] = ()
    measured_modes: ModeTable | None = None
    identified: "ModesInFrfs | None" = None
    excluded: Plan | None = None
    states: tuple[Mapping[int, float], Mapping[int, float]] | None = None
    reported: ReportedModes | None = None

    def __repr__(self) -> str:
        """Return the study, the diagnosis, and where the report is on one line."""
        return summary(self, f"{self.study.name!r}: {self.diagnosis!r}; report: {self.report}")

    @property
    def notes(self) -> tuple[str, ...]:
        """What a reader should know."""
        return notes_of(self.diagnosis)

    @property
    def report(self) -> Path:
        """The report."""
        return self.folder / REPORT

    @property
    def json(self) -> Path:
        """The result for programs."""
        return self.folder / JSON


FrfResult: TypeAlias = RunResult[Diagnosis]
"""A run by FRFs."""


def least_frac(c: Comparison) -> NDArray[np.float64]:
    """Return the least FRAC of each sensor over the FRFs that count, (n_out,), NaN where there is none."""
    known = np.isfinite(c.error_db).any(axis=0)
    least = np.where(known, c.frac, np.inf).min(axis=1)
    return np.where(np.isfinite(least), least, np.nan)


def bands_of_lines(
    frequency: NDArray[np.float64], chosen: NDArray[np.bool_]
) -> tuple[tuple[float, float], ...]:
    """Return the bands that neighbouring chosen lines make [Hz]."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], chosen.astype(int), [0]])))
    f = frequency
    return tuple((float(f[a]), float(f[b - 1])) for a, b in zip(edges[::2], edges[1::2], strict=True))


def uncertain_parameters(d: Verdict) -> tuple[UncertainValue, ...]:
    """Return the uncertain parameters before and after the last fit; of two states, that to the first.

    The damping is among them where any was measured.
    """
    return uncertain_values(*d.calibration)


def uncertain_values(problem: Problem[Any], final: FitResult, model: Model) -> tuple[UncertainValue, ...]:
    """Return the uncertain parameters before and after a fit, those of effects that the model has."""
    out = []
    there = {e.name for e in model.effects}
    for u in problem.nuisance_unknowns:
        name, parameter = u.ref
        if name not in there:  # corners that were in the model before the verdict was "unexplained"
            continue
        effect = problem.reduced.model.effect(name)
        fitted = float(final.values.get(u.ref, np.nan))
        moved = (u.to_x(fitted) - u.mean) / u.std
        out.append(
            UncertainValue(
                f"{name}.{parameter}",
                u.unit,
                u.nominal,
                fitted,
                float(u.std * (abs(u.nominal) if u.log else u.scale)),
                float(final.std.get(u.ref, np.nan)),
                bool(np.isfinite(moved) and abs(moved) > 3.9),
                effect.where if effect.is_form else "",
                effect.where,
            )
        )
    if (test := problem.test_of(final)) is not None:
        out += channels_of(test, final)
    if not problem.data.has_damping:
        return tuple(out)
    curve = problem.damping
    first = len(final.values)
    n = len(curve.start)
    sd = np.sqrt(np.maximum(np.diag(final.covariance), 0.0))[first : first + n]
    sd = sd if len(sd) == n else np.full(n, np.nan)
    names = [f"{DAMPING_RATIO} {f:.4g} Hz" for f in curve.knots]
    if any(e.connection for e in model.effects):
        names += [CONNECTIONS_LEVEL, CONNECTIONS_POWER]
    for name, nominal, fitted, s in zip(names, curve.start, final.zeta, sd, strict=False):
        moved = float(np.log(fitted / nominal))
        known = nominal, fitted, nominal * curve.std, fitted * np.sinh(s)
        if name == CONNECTIONS_POWER:  # its unknown is e to it
            known = 0.0, moved, curve.std, s
        before, after, prior, std = map(float, known)
        out.append(UncertainValue(name, "-", before, after, prior, std, abs(moved) > 3.9 * curve.std))
    return tuple(out)


def channels_of(m: Measurement, final: FitResult) -> list[UncertainValue]:
    """Return the errors of channels that are farther from the test's description than its accuracy says."""
    out, prior = [], m.errors.std
    for number, (channel, values, stds) in enumerate(
        zip((*m.sensors, *m.excitations), final.channels, final.channels_std, strict=False)
    ):
        sort = "sensor" if number < len(m.sensors) else "excitation"
        words = [
            GAIN_ERROR,
            *(f"{sort_of} {axis_text(t)}" for sort_of in (TURNED, SHIFTED) for t in channel.axes_across),
        ]
        for word, unit, value, before, std in zip(words, CHANNEL_UNITS, values, prior, stds, strict=True):
            moved = UncertainValue(
                f"{sort} {channel.name}: {word}", unit, 0.0, float(value), float(before), float(std), False
            )
            out += [moved] if moved.far else []
    return out


def program_version() -> str:
    """Return the version of the program."""
    try:
        return metadata.version(DISTRIBUTION)
    except metadata.PackageNotFoundError:
        return "unknown"


def uncertain_dict(u: UncertainValue) -> dict[str, Any]:
    """Return an uncertain parameter in plain types."""
    return {**asdict(u), "moved": u.moved, "far": u.far}


def fault_dict(f: Fault) -> dict[str, Any]:
    """Return a fault in plain types."""
    plain = {"kind": f.kind, "sensor": f.sensor, "value": f.value, "std": f.std, "unit": f.unit}
    vectors = {"direction": list(f.direction), "shift": list(f.shift)}
    more = {"other": f.other, **vectors, "tolerance": f.tolerance}
    return plain | {key: value for key, value in more.items() if value}


def added_parameters(effect: Effect, fit: FitResult | None) -> tuple[EffectParameter, ...]:
    """Return an added effect's parameters; their deviations are NaN where no fit has had the effect."""
    if fit is not None and any(e.name == effect.name for e in fit.effects):
        return parameters_of(effect, fit)
    return tuple(EffectParameter(p.name, p.value, p.unit, np.nan) for p in effect.parameters())


def effect_dict(effect: Effect, fit: FitResult | None) -> dict[str, Any]:
    """Return an effect that was added by hand in plain types."""
    parameters = [_parameter(p) for p in added_parameters(effect, fit)]
    return {"candidate": effect.name, "kind": effect.kind, "where": effect.where, "parameters": parameters}


def _damping(curve: DampingCurve, unknowns: NDArray[np.float64]) -> dict[str, Any]:
    members, *connections = np.atleast_2d(curve.ratio(curve.knots, unknowns))
    connected = {"connections_ratio": connections[0]} if connections else {}
    return {"frequency_Hz": curve.knots, "ratio": members, **connected}


def notes_of(d: Verdict) -> tuple[str, ...]:
    """Return what a reader of a diagnosis should know, channels first that were not compared."""
    return (*(d.problem.data.uncompared if by_frfs(d) else ()), *d.notes)


def by_any(d: Verdict) -> bool:
    """Whether a verdict is one: of sections that every report has."""
    return True


def by_frfs(d: Verdict) -> TypeGuard[Diagnosis]:
    """Whether FRFs led to a verdict."""
    return bool(d.steps)


def has_frfs(result: RunResult[Verdict]) -> TypeGuard[FrfResult]:
    """Whether a run compared FRFs."""
    return by_frfs(result.diagnosis)


def by_modes_alone(d: Verdict) -> TypeGuard[ModeDiagnosis]:
    """Whether measured modes alone led to a verdict."""
    return d.modes is not None


def diagnosis_dict(d: Verdict) -> dict[str, Any]:
    """Return a diagnosis in plain types: verdict, effects, probabilities, and what its data have to tell."""
    return {
        "verdict": d.verdict,
        "reason": d.reason,
        "effects": [_finding(f, d.model) | (_rivals(f, d.model) if by_frfs(d) else {}) for f in d.findings],
        "posterior": [{"effects": names, "probability": p} for names, p in d.posterior],
        "credible": [_explanation(e, d.model) for e in d.credible],
        "places": [{"place": name, "misfit_left": share} for name, share in d.places],
        "uncertain": [uncertain_dict(u) for u in uncertain_parameters(d)],
        "images": [_explanation(e, d.model) for e in d.images],
        **(_of_frfs(d) if by_frfs(d) else {}),
        **(_of_modes(d) if by_modes_alone(d) else {}),
    }


def _of_frfs(d: Diagnosis) -> dict[str, Any]:
    return {
        "faults": [fault_dict(f) for f in d.every_fault],
        "error_db": [
            {"step": s.label, "fit": s.fit_db, "held_out": s.held_out_db, "level": s.level * DB_PER_NEPER}
            for s in d.steps
        ],
        "noise_floor_db": d.noise_floor_db,
        "noise_db": d.noise_db,
        "discretisation_db": d.discretisation_db,
        "basis_db": d.basis_db,
        "gates": [asdict(c) for c in d.gates.checks] if d.gates else [],
        "ranking": [[_ranked(r, d.model) for r in round_] for round_ in d.rounds],
        "form": [_departure(f) for f in d.departures],
    }


def _of_modes(d: ModeDiagnosis) -> dict[str, Any]:
    m = d.modes
    columns = {
        "measured_Hz": m.measured,
        "std": m.std,
        "nominal_Hz": m.nominal,
        "fitted_Hz": m.fitted,
        "found_Hz": m.found,
        "zeta": m.zeta,
        "zeta_found": m.zeta_found,
        "mac_nominal": m.mac_nominal,
        "mac_fitted": m.mac_fitted,
        "mac_found": m.mac_found,
        "held_out": m.held_out,
        "found_std": m.found_std,
        "bad_probability": m.bad,
    }
    bad = [
        {"mode": b.reading.mode + 1, "measured_Hz": b.frequency, "reading": b.reading.words}
        | {"probability": b.probability}
        for b in d.bad_readings
    ]
    return {
        "bad_readings": bad,
        "next_measurements": list(d.next_measurements),
        "modes": [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)],
        "frequency_error": mode_errors(m),
        **({} if d.judged is None else {"baseline": _baseline(d.judged, d.model)}),
    }


def mode_errors(m: ModeTable) -> dict[str, dict[str, float]]:
    """Return the error of natural frequencies of each step, of fitted and of held-out modes [-]."""
    return {
        step: {"fit": m.errors(f, False), "held_out": m.errors(f, True)} for step, f in m.computed.items()
    }


def modes_dict(m: ModeTable | None) -> dict[str, Any]:
    """Return measured modes and their partners of each step in plain types; nothing without any."""
    if m is None:
        return {}
    rows = [
        {
            "measured_Hz": m.measured[k],
            "std": m.std[k],
            "held_out": bool(m.held_out[k]),
            "computed_Hz": {step: f[k] for step, f in m.computed.items()},
            "mac": {step: mac[k] for step, mac in m.mac.items()},
        }
        for k in range(len(m.measured))
    ]
    return {"measured_modes": {"modes": rows, "error": mode_errors(m)}}


def _baseline(judged: Baseline, model: Model) -> dict[str, Any]:
    """Return what the first state says of the calibrated model."""
    t, found = judged.first.problem.targets, judged.first.computed.frequency
    rows = zip(t.frequency, found, judged.first.missed, strict=True)
    return {
        "stands": judged.diagnosis is None,
        "modes": [{"measured_Hz": f, "calibrated_Hz": g, "missed_std": off} for f, g, off in rows],
        "causes": [_explanation(c, model) for c in judged.causes],
    }


def _explanation(e: Explanation, model: Model) -> dict[str, Any]:
    effects = zip(e.effects, e.parameters, strict=True)
    return {
        "explanation": e.label,
        "probability": e.probability,
        "effects": [_finding(Finding(x, parameters, ()), model) for x, parameters in effects],
    }


def excluded_dict(plan: Plan | None) -> dict[str, Any]:
    """Return at which sizes data in which nothing is missing would have shown effects, by kind."""
    if plan is None:
        return {}

    def value(e: Effect | None) -> float | None:
        return None if e is None else e.parameters()[0].value

    hidden = (plan.hidden(some) for some in plan.kinds.values())
    rows = [
        {key: r[key] for key in ("kind", "unit", "n", "blind")}
        | {key: value(r[key]) for key in ("least", "most")}
        | {"hidden_by": [{"parameter": ".".join(ref), "least_if_known": value(e)} for ref, e in by]}
        for r, by in zip(plan.sizes_of("seen"), hidden, strict=True)
    ]
    return {"excluded": rows}


def _departure(d: Departure) -> dict[str, Any]:
    return {
        "where": d.where,
        "parameter": d.parameter,
        "unit": d.unit,
        "change": d.value,
        "std": d.std,
        "prior_std": d.prior_std,
        "probability": d.probability,
        "rivals": [{"effects": [e.name for e in effects], "probability": p} for effects, p in d.rivals],
    }


def result_dict(result: RunResult[Verdict]) -> dict[str, Any]:
    """Return a result in plain types, as in ``result.json``; see docs/result.md."""
    d, study = result.diagnosis, result.study
    return {
        "schema": SCHEMA,
        "version": program_version(),
        "study": study.name,
        "finished": result.finished.isoformat(timespec="seconds"),
        "seconds": result.seconds,
        "model": {"values": {f"{a}.{b}": v for (a, b), v in d.model.values().items()}},
        "assumptions": list(study.assumptions),
        "mesh_notes": list(study.model.mesh.notes),
        "measured_notes": list(study.measured_notes),
        "notes": list(result.notes),
        "warnings": list(study.warnings),
        **diagnosis_dict(d),
        **excluded_dict(result.excluded),
        **(_compared_frfs(result, d) if by_frfs(d) else {}),
    }


def _compared_frfs(result: RunResult[Verdict], d: Diagnosis) -> dict[str, Any]:
    damping = _damping(d.problem.damping, d.steps[-1].result.zeta)
    return {
        "held_out_channels": [
            {"channel": name, "error_db": db} for name, db in result.held_out_channels.items()
        ],
        "model": {"values": {f"{a}.{b}": v for (a, b), v in d.model.values().items()}, "damping": damping},
        "modes": [
            {
                "nominal_Hz": m.nominal,
                "fitted_Hz": m.fitted,
                "nominal_damping": m.nominal_zeta,
                "fitted_damping": m.fitted_zeta,
                "mac": m.mac,
                **_measured_in_states(result, m),
            }
            for m in result.modes
        ],
        **modes_dict(result.measured_modes),
        **({} if result.identified is None else {"identified_modes": result.identified.rows()}),
        "misfit": localisation_dict(result.localisation) if result.localisation else None,
    }


def _measured_in_states(result: RunResult[Verdict], m: FittedModePair) -> dict[str, float]:
    """Return the frequencies of a mode measured before and after; nothing for one state."""
    if result.states is None:
        return {}
    before, after = result.states
    keys = ("measured_before_Hz", before.get(m.nominal_index)), ("measured_after_Hz", after.get(m.index))
    return {key: math.nan if f is None else f for key, f in keys}


def localisation_dict(where: Localisation) -> dict[str, Any]:
    """Return a localisation in plain types."""
    return {
        "sensors": [
            {"sensor": s, "error_db": db, "by_band_db": row}
            for s, db, row in zip(where.sensors, where.by_sensor_db, where.by_band_db, strict=True)
        ],
        "inputs": [
            {"input": s, "error_db": db} for s, db in zip(where.inputs, where.by_input_db, strict=True)
        ],
        "bands_Hz": where.bands,
        "members": [{"member": m, "share": share} for m, share in where.members.items()],
        "places": [{"place": p, "share": share} for p, share in where.places],
        "note": where.note,
    }


def comparison_dict(c: Comparison) -> dict[str, Any]:
    """Return a comparison in plain types."""
    return {
        "error_db": c.total_db,
        "bands_Hz": c.bands,
        "sensors": [
            {"sensor": s, "error_db": db, "by_band_db": row, "frac": fracs}
            for s, db, row, fracs in zip(c.outputs, c.by_sensor(), c.by_band(), c.frac, strict=True)
        ],
        "excitations": [
            {"excitation": s, "error_db": db, "by_band_db": row}
            for s, db, row in zip(c.inputs, c.transposed().by_sensor(), c.transposed().by_band(), strict=True)
        ],
        "inputs": list(c.inputs),
    }


def frf_arrays(d: Diagnosis) -> dict[str, NDArray[Any]]:
    """Return the arrays of ``frf.npz``: measured FRFs and those of each step."""
    measured, data = d.measured, d.problem.data
    return {
        "frequency": measured.frequency,
        "H": measured.H,
        "kind": np.array(str(measured.kind)),
        "outputs": np.array(measured.outputs, dtype=str),
        "inputs": np.array(measured.inputs, dtype=str),
        **({"strain": np.array(measured.strain, dtype=str)} if measured.strain else {}),
        "steps": np.array([s.label for s in d.steps], dtype=str),
        "H_model": np.stack([d.frf(k).as_kind(measured.kind).H for k in range(len(d.steps))]),
        "deviation": _deviation(d),
        "compared": np.broadcast_to(data.mask, measured.H.shape),
        "pieces": np.array(d.problem.pieces),
        "held_out": data.held_out,
        "noise": np.broadcast_to(data.noise, measured.H.shape),
    }


def _deviation(d: Diagnosis) -> NDArray[np.float64]:
    spread = d.deviation(len(d.steps) - 1)
    return np.full(d.measured.H.shape, np.nan) if spread is None else spread


def _finding(f: Finding, model: Model) -> dict[str, Any]:
    return {
        "kind": f.effect.kind,
        "where": f.effect.where,
        "name": f.effect.name,
        "spot": _spot(f.effect, model),
        "parameters": [_parameter(p) for p in f.parameters],
    }


def _spot(effect: Effect | None, model: Model) -> dict[str, Any] | None:
    spot = None if effect is None else spot_of(effect, model)
    return None if spot is None else spot.fields()


def _rivals(f: Finding, model: Model) -> dict[str, Any]:
    """Return what could stand in the place of a finding, and what tells them apart."""
    return {
        "twins": [_ranked(t, model) for t in f.twins],
        "rival": _ranked(f.rival, model) if f.rival else None,
        "equal_fits": [_ranked(r, model) for r in f.equal_fits],
        "decisive": [asdict(d) for d in f.decisive],
        "next_measurements": [
            {"twin": t.name, "proposals": [asdict(p) for p in proposals]}
            for t, proposals in zip(f.alternatives, f.proposals, strict=False)
        ],
    }


def _ranked(r: Ranked, model: Model) -> dict[str, Any]:
    return {
        "kind": r.kind,
        "where": r.where,
        "name": r.name,
        "spot": _spot(r.effect, model),
        "parameters": [_parameter(p) for p in r.parameters],
        "level_db": r.level * DB_PER_NEPER,
        "fit_db": r.fit_db,
        "held_out_db": r.held_out_db,
        "similarity": r.similarity,
        "score": r.score,
    }


def _parameter(p: EffectParameter) -> dict[str, Any]:
    std = None if p.at_bound else p.std
    return {"name": p.name, "value": p.value, "unit": p.unit, "std": std, "at_bound": p.at_bound}
