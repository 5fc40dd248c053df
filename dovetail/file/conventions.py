"""Whether measured FRFs belong to e^{+iωt} and have the phase of their kind; refused with the remedy."""

from collections.abc import Sequence

import numpy as np

from dovetail.file.measured import RawMeasurement
from dovetail.file.sensors import Channel
from dovetail.file.suspicions import LazyComparison, RatioToModel, kind_by_model, slope_of
from dovetail.file.table import StudyTable
from fem.analysis.frf import FRFKind
from updating.measurement.measurement import Measurement
from updating.quality.phase import (
    ANTICAUSAL_DEVIATIONS,
    QUADRATURE,
    Misphased,
    PhaseEvidence,
    driven_points,
    misphased,
    phase_evidence,
)

_SAME_PLACE = 1e-6
"""Distance of a force from a sensor at its place, relative to the mesh's size."""


def check_phase(
    comparisons: Sequence[LazyComparison],
    raw: Sequence[RawMeasurement],
    sensors: Sequence[Channel],
    excitations: Sequence[Channel],
    suspicions: list[str],
) -> list[PhaseEvidence | None]:
    """Return the evidence of phases for each measurement; None where the study does not want it.

    Parameters
    ----------
    comparisons : sequence of LazyComparison
        Of the measurements.
    raw : sequence of RawMeasurement
        Their files.
    sensors, excitations : sequence of Channel
        Those of the study.
    suspicions : list of str
        Gets uncertain findings.

    Raises
    ------
    StudyError
        For FRFs that certainly belong to e^{-iωt} or to another kind.
    """
    out: list[PhaseEvidence | None] = []
    for c, r in zip(comparisons, raw, strict=True):
        m = c.measurement
        evidence = phase_evidence(m.frf) if r.check_phase and m.has_structure_poles else None
        out.append(evidence)
        if evidence is None:
            continue
        driven = driven_points(m, _SAME_PLACE * c.model.mesh.size)
        found = misphased(evidence, driven)
        if not found:
            suspicions += _weak(c, r, evidence)
            _refuse_reversed(c, r, evidence, driven, suspicions)
            continue
        to_model = c.to_model if any(f.fault == "quarter turn" for f in found) else None
        words = []
        for f in found:
            text = _words(m, f, to_model)
            if f.of == "FRF" or not _supported(m, f, to_model):
                suspicions.append(f"the FRFs {_whose(f)} {r.name} {text}; check them")
            else:
                words.append((f, f"the FRFs {_whose(f)} {r.name} {text}"))
        if words:
            first = words[0][0]
            table, key = _place(r, first, {"sensor": sensors, "excitation": excitations})
            table.refuse(key, f"{'; '.join(t for _, t in words)}, or check_phase = false if they are right")
    return out


def _weak(comparison: LazyComparison, r: RawMeasurement, evidence: PhaseEvidence) -> list[str]:
    """Return a suspicion if FRFs that say too little each for itself run backwards together.

    Raises
    ------
    StudyError
        If the model says so as well.
    """
    z = evidence.deviations[np.isfinite(evidence.deviations)]
    if not z.size or z.sum() / np.sqrt(z.size) > -ANTICAUSAL_DEVIATIONS:
        return []
    to_model = comparison.to_model
    found = f"the FRFs of {r.name} seem to belong to e^{{-iωt}}: they ring before the impulse, not after it"
    if to_model is not None and float(np.median(to_model.dissipation)) < -0.5:
        r.table.refuse(
            "file",
            f"{found}, and their imaginary parts have the opposite sign of the model's; give conjugate = "
            "true in [[measurements]], or check_phase = false if they are right",
        )
    return [f"{found}, but the difference is too small to be sure; try conjugate = true in [[measurements]]"]


def _refuse_reversed(
    comparison: LazyComparison,
    r: RawMeasurement,
    evidence: PhaseEvidence,
    driven: Sequence[tuple[int, int, float]],
    suspicions: list[str],
) -> None:
    """Refuse receptance called accelerance or the reverse: their signs differ, which driven points show."""
    m = comparison.measurement
    sense = {(i, j): s * float(evidence.sense[i, j].real) for i, j, s in driven if evidence.axis[i, j] > 0}
    names = [m.frf.outputs[i] for (i, _), s in sense.items() if s < -QUADRATURE]
    if not names:
        return
    to_model = comparison.to_model if len(names) == len(sense) else None
    like = None if to_model is None else kind_by_model(m.frf, to_model, evidence, by_sign=True)
    if like is not None:
        factor = "(iω)²" if like.derivatives > m.frf.kind.derivatives else "1/(iω)²"
        r.table.refuse(
            "kind" if "kind" in r.table.values else "file",
            f"the FRFs of {r.name} are called {m.frf.kind}; their sign where force and sensor share a place, "
            f"{names[0]}, and their size compared with the model are those of {like}, "
            f"{factor} times as large; give kind = "
            f'"{like}", or check_phase = false if they are right',
        )
    suspicions.append(
        f"in {r.name} the structure gives power to the force at {', '.join(dict.fromkeys(names))}, where "
        "force and sensor share a place: one of the two has the opposite direction to the study's"
    )


def _whose(f: Misphased) -> str:
    what = {"sensor": "of the sensor", "excitation": "of the force", "FRF": ""}.get(f.of, "")
    names = ", ".join(f.names[:6]) + (" …" if len(f.names) > 6 else "")
    many = "s" if what and len(f.names) > 1 else ""
    return f"{what}{many} {names} in".lstrip() if f.names else "of"


def _place(r: RawMeasurement, f: Misphased, channels: dict[str, Sequence[Channel]]) -> tuple[StudyTable, str]:
    table = next((c.table for c in channels.get(f.of, ()) if c.sensor.name == f.names[0]), None)
    return (r.table, "file") if table is None else (table, "")


def _table(f: Misphased) -> str:
    """Return the table that the remedy belongs to."""
    return {
        "all": "in [[measurements]]",
        "sensor": "in its [[sensors]]",
        "excitation": "in its [[excitations]]",
    }.get(f.of, "")


def _words(m: Measurement, f: Misphased, to_model: RatioToModel | None) -> str:
    """Return the finding and its remedy."""
    if f.fault == "conjugate":
        found = (
            f"belong to e^{{-iωt}}: they ring before the impulse, with {float(f'{f.size:.2g}'):g} times the "
            "energy that follows it"
        )
        return f"{found}; give conjugate = true {_table(f)}" if _table(f) else found
    turn, power, options = _turn_remedies(m, f, to_model)
    by_phase = {1: "i times", -1: "-i times", 0: "i or -i times"}[turn]
    factor = {1: "iω times", -1: "1/(iω) times", 3: "(iω)³ times", -3: "1/(iω)³ times"}.get(power, by_phase)
    found = f"are {factor} the {m.frf.kind}"
    found += ": " if power else ", or another kind of FRF: "
    found += "their phase at and between resonances is a quarter turn off"
    found += ", and their size beside the model's follows that factor" if power else ""
    if f.of == "sensor":
        found += " (so is the motion next to a strong damper)"
    if not options:
        return f"{found}; a file cannot have this kind: divide its values by that factor"
    return f"{found}; give {' or '.join(options)} {_table(f)}" if _table(f) else found


def _part(m: Measurement, f: Misphased, to_model: RatioToModel) -> np.ndarray:
    """Return the ratios (n, k) of the FRFs of a group."""
    rows = [i for i, n in enumerate(m.frf.outputs) if f.of != "sensor" or n in f.names]
    columns = [j for j, n in enumerate(m.frf.inputs) if f.of != "excitation" or n in f.names]
    return to_model.ratio[:, rows][:, :, columns].reshape(len(to_model.frequency), -1)


def _supported(m: Measurement, f: Misphased, to_model: RatioToModel | None) -> bool:
    """Return whether the model does not contradict a quarter turn."""
    if f.fault == "conjugate" or to_model is None:
        return True
    ratio = _part(m, f, to_model)
    ratio = ratio[np.isfinite(ratio) & (ratio != 0)]
    return not ratio.size or float(((ratio / np.abs(ratio)) ** 2).real.mean()) < 0


def _turn_remedies(m: Measurement, f: Misphased, to_model: RatioToModel | None) -> tuple[int, int, list[str]]:
    """Return the sense of a quarter turn, its power of iω, and keys that undo it.

    The power is 0 for a factor i and where nothing tells the two apart. The keys are a kind, a phase, or both
    if undecided; none for a kind that no file can have.
    """
    turn, power = f.turn, None
    if to_model is not None:
        ratio = _part(m, f, to_model)
        seen = np.isfinite(ratio) & (ratio != 0)
        if not turn and seen.any():
            turn = int(np.sign((ratio[seen] / np.abs(ratio[seen])).imag.mean()))
        power = _power(to_model.frequency, np.abs(np.where(seen, ratio, np.nan)), turn)
    turns = (turn,) if turn else (1, -1)
    no_kind = f.of == "excitation" or (f.of == "sensor" and set(f.names) <= set(m.frf.strain))
    powers = turns if power is None else (power,)
    of_kind = [
        f'kind = "{k}"' for k in FRFKind if not no_kind and k.derivatives - m.frf.kind.derivatives in powers
    ]
    by_phase = [f"phase = {-90 * t}" for t in turns]
    if power is None:
        return turn, 0, [*of_kind, *by_phase]
    return turn, power, by_phase if not power else [] if no_kind else of_kind


def _power(frequency: np.ndarray, size: np.ndarray, turn: int) -> int | None:
    """Return the power of iω between measured and computed FRFs, 0 for i alone; None where nothing says it.

    Their slope over frequency tells it, whatever the gain is; over a narrow band their size does.
    """
    seen = np.isfinite(size).mean(axis=1) > 0.5
    if seen.sum() < 8 or not turn:
        return None
    x = np.log10(frequency[seen])
    with np.errstate(divide="ignore"):
        y = np.nanmedian(np.log10(size[seen]), axis=1)
    slope = slope_of(x, y)
    if slope is not None:
        return min((0, turn, -3 * turn), key=lambda power: abs(slope - power))
    other = y - turn * np.log10(2 * np.pi * frequency[seen])
    return turn if abs(float(np.median(other))) < abs(float(np.median(y))) else 0
