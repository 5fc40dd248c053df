"""An ensemble as tables, files and a picture."""

from pathlib import Path
from typing import Any

import numpy as np

from dovetail.ensemble.quantiles import PROBABILITIES, Quantiles
from dovetail.ensemble.run import Ensemble
from dovetail.file.contents import StudyContents
from dovetail.report.table import Column, Table, columns_of, write_csv
from fem.analysis.frf import FRF
from fem.array_types import Floats
from fem.io.atomic import replacing
from fem.summary import counted
from updating.correlation import DB_PER_NEPER
from updating.measurement.measurement import quantity_of

BANDS, FREQUENCIES, FRFS, PICTURE = "bands.npz", "frequencies.csv", "frf-bands.csv", "bands.png"
"""Files in the folder of an ensemble."""
MOST_DRAWN = 4
"""FRFs in the picture [-]."""


def write_files(ensemble: Ensemble, study: StudyContents, folder: Path) -> None:
    """Write bands as .npz and .csv and draw them."""
    model, names = ensemble.model, _names(study)
    f, levels = ensemble.frequency, ensemble.levels
    arrays = {
        "probabilities": np.array(PROBABILITIES),
        "natural_frequency": f.value,
        "natural_frequency_error": f.error,
        "frequency": model.frequency,
        "amplitude": np.exp(levels.value),
        "level_error": levels.error,
        "counted": ensemble.counted,
        "outputs": np.array([s.name for s in study.sensors], dtype=str),
        "inputs": np.array([s.name for s in study.excitations], dtype=str),
        "kind": np.array(str(model.kind)),
        "parameters": np.array([" ".join(r) for r in model.uncertainty.refs], dtype=str),
        "values": ensemble.values,
    }
    with replacing(folder / BANDS) as scratch, scratch.open("wb") as file:
        np.savez_compressed(file, **arrays)  # type: ignore[arg-type]
    write_csv(folder / FREQUENCIES, frequencies(ensemble))
    if levels.value.size:
        units = [quantity_of(model.kind, i)[1] for _ in study.sensors for i in study.excitations]
        by_frf = np.exp(levels.value).transpose(1, 2, 3, 0).reshape(len(model.frequency), -1)
        heads = [(f"{n} {q}", u) for n, u in zip(names, units, strict=True) for q in _words()]
        each = [Column(n, v, u) for (n, u), v in zip(heads, by_frf.T, strict=True)]
        write_csv(folder / FRFS, Table("FRFs", [Column("frequency", model.frequency, "Hz"), *each]))
    draw(ensemble, study, folder / PICTURE)


def frequencies(ensemble: Ensemble) -> Table:
    """Return quantiles of natural frequencies with their standard errors."""
    f = ensemble.frequency
    return Table.of(
        "natural frequencies",
        Column("mode", range(1, f.value.shape[1] + 1)),
        *columns_of(
            (w.replace("50 %", "median") for w in _words()), f.value.T, "Hz", ".4f", places=("text",)
        ),
        *columns_of(_words(), f.value.T, "Hz", places=("file",)),
        *columns_of((f"error of {q}" for q in _words()), f.error.T, "Hz", places=("file",)),
        Column("standard errors", [_errors(e) for e in f.error.T], "Hz", places=("text",)),
    )


def draw(ensemble: Ensemble, study: StudyContents, path: Path) -> None:
    """Draw the bands of the first FRFs and of the natural frequencies."""
    from viz.bands import plot_bands
    from viz.style import save

    measured, model, bands = measured_levels(ensemble, study), ensemble.model, []
    for i, output in enumerate(study.sensors):
        for j, force in enumerate(study.excitations):
            if ensemble.counted[i, j]:
                line = None if measured is None else np.exp(measured[:, i, j])
                name = f"{output.name} / {force.name}"
                bands.append((name, np.exp(ensemble.levels.value[:, :, i, j]), line))
    shown = f", {MOST_DRAWN} of {len(bands)} FRFs" if len(bands) > MOST_DRAWN else ""
    title = f"{study.name}: {ensemble.n} samples{shown}"
    quantities = dict.fromkeys(quantity_of(model.kind, i) for i in study.excitations)
    unit = ", ".join(f"{word} [{unit}]" for word, unit in quantities)
    save(plot_bands(model.frequency, bands[:MOST_DRAWN], ensemble.frequency.value, unit, title), path)


def measured_levels(ensemble: Ensemble, study: StudyContents) -> Floats | None:
    """Return ln |H| of the measurement at the ensemble's lines and channels; None where it has others."""
    if not study.measurements:
        return None
    frf: FRF = study.measurements[0].frf
    channels = tuple(s.name for s in study.sensors), tuple(s.name for s in study.excitations)
    inner = frf.frequency > 0
    alike = inner.sum() == len(ensemble.model.frequency) and np.allclose(
        frf.frequency[inner], ensemble.model.frequency, rtol=1e-9, atol=0
    )
    if (frf.outputs, frf.inputs) != channels or frf.kind != ensemble.model.kind or not alike:
        return None
    return np.log(np.maximum(np.abs(frf.H[inner]), 1e-300))


def as_dict(ensemble: Ensemble, study: StudyContents) -> dict[str, Any]:
    """Return the ensemble as JSON has it: tables and errors, without the FRFs."""
    f, levels, checks = ensemble.frequency, ensemble.levels, ensemble.checks
    width, error = _of_frfs(ensemble)
    return {
        "study": study.name,
        "samples": ensemble.n,
        "seed": ensemble.model.seed,
        "parameters": [
            {"name": u.name, "unit": u.unit, "nominal": u.nominal, "std": u.prior_std}
            for u in ensemble.model.uncertainty.unknowns
        ],
        "damping_std": ensemble.model.uncertainty.damping_std,
        "probabilities": PROBABILITIES,
        "natural_frequencies": [
            {"mode": k + 1, "quantiles_Hz": f.value[:, k], "errors_Hz": f.error[:, k]}
            for k in range(f.value.shape[1])
        ],
        "frfs": levels.value.shape[2] * levels.value.shape[3],
        "band_dB": width,
        "quantile_error_dB": error,
        "measured_within": within(ensemble, study),
        "basis": {
            "vectors": ensemble.model.reduced.basis.T.shape[1],
            "checks": [
                {
                    "sample": c.sample,
                    "frequency": c.frequency,
                    "rms_dB": c.level * DB_PER_NEPER,
                    "of_peak": c.of_peak,
                }
                for c in checks
            ],
        },
        "failures": [{"unit": o.unit, "reason": o.failure} for o in ensemble.failures],
        "assumptions": study.assumptions,
        "warnings": study.warnings,
    }


def lines_of(ensemble: Ensemble, study: StudyContents) -> list[str | Table]:
    """Return the tables and sentences that the command prints."""
    model = ensemble.model
    n, refs = model.reduced.model.n_dof, model.uncertainty.unknowns
    return [
        f"{study.name}: {counted(ensemble.n, 'sample')} of {counted(len(refs), 'uncertain parameter')} and "
        f"the damping, {n} DOFs on {model.reduced.basis.T.shape[1]} vectors",
        frequencies(ensemble),
        *_sentences(ensemble, study),
    ]


def _sentences(ensemble: Ensemble, study: StudyContents) -> list[str]:
    out, checks = [], ensemble.checks
    with_frfs = bool(ensemble.levels.value.size)
    if with_frfs:
        width, error = _of_frfs(ensemble)
        out.append(
            f"FRFs: {ensemble.counted.sum()} of {ensemble.counted.size} counted, "
            f"{len(ensemble.model.frequency)} lines; 5 to 95 % is {width:.3g} dB wide in the median over "
            "lines; standard error of its ends "
            + ("not known from so few samples" if error is None else f"{error:.2g} dB (root mean square)")
        )
    share = within(ensemble, study)
    if share is not None:
        out.append(
            f"measured: {100 * share:.0f} % of the amplitudes lie within the bands; of a right model's, 90 %"
        )
    if checks:
        sizes = f"frequencies off by up to {max(c.frequency for c in checks):.2g}"
        if with_frfs:
            rms, largest = (max(getattr(c, key) for c in checks) for key in ("level", "of_peak"))
            sizes += f", FRFs by {rms * DB_PER_NEPER:.2g} dB (root mean square) and by at most "
            sizes += f"{largest:.2g} of their peaks"
        out.append(f"reduced basis against {counted(len(checks), 'full solution')}: {sizes}")
    else:
        out.append("reduced basis: not checked against full solutions (--checks 0)")
    if ensemble.failures:
        out.append(f"{counted(len(ensemble.failures), 'unit')} failed, and the same command tries again:")
        out += [f"  {' '.join(map(str, o.unit))}: {o.failure}" for o in ensemble.failures[:20]]
    return out


def within(ensemble: Ensemble, study: StudyContents) -> float | None:
    """Return the share of the measured amplitudes that lie within their bands; None without any."""
    measured = measured_levels(ensemble, study)
    if measured is None or not ensemble.counted.any():
        return None
    low, _, high = ensemble.levels.value
    return float(((measured >= low) & (measured <= high))[:, ensemble.counted].mean())


def _of_frfs(ensemble: Ensemble) -> tuple[float | None, float | None]:
    """Return the median width of the bands, and the root mean square of the standard errors [dB]."""
    levels: Quantiles = ensemble.levels
    if not levels.value.size or not ensemble.counted.any():
        return None, None
    width = float(np.median(levels.width[:, ensemble.counted])) * DB_PER_NEPER
    ends = levels.error[[0, 2]][:, :, ensemble.counted]
    error = float(np.sqrt((ends**2).mean())) * DB_PER_NEPER
    return width, error if np.isfinite(error) else None


def _names(study: StudyContents) -> list[str]:
    return [f"{o.name}/{i.name}" for o in study.sensors for i in study.excitations]


def _words() -> list[str]:
    return [f"{100 * p:g} %" for p in PROBABILITIES]


def _errors(e: Floats) -> str:
    return " ".join(f"{x:.2g}" if np.isfinite(x) else "?" for x in e)
