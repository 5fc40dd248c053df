"""An identified joint in words, as JSON and as a picture."""

from pathlib import Path
from typing import Any

import numpy as np

from fem.effects.joint import joint_unit
from fem.model import DIRECTIONS
from joint import JointIdentification, explain_stiffness
from joint.assembly import summarise
from joint.assembly_fit import Estimate
from joint.form import LAWS
from updating.inference.belief import FAR_STD

_WORDS = {"K": "k", "C": "c", "D": "d", **dict.fromkeys(LAWS, "k")}


def study_stiffness(found: Estimate, direction: str) -> float:
    """Return the study's own stiffness in a direction; infinite where it is rigid."""
    joint = found.task.joint
    i = DIRECTIONS.index(direction)
    return float("inf") if direction in joint.rigid else float(np.real(joint.K[i, i]))


def joint_result(
    study: str, found: Estimate, lines: JointIdentification | None, summary: list[dict[str, Any]]
) -> dict[str, Any]:
    """Return all that was found, as JSON holds it.

    Parameters
    ----------
    study : str
        Its name.
    found : Estimate
    lines : JointIdentification or None
        Line by line.
    summary : list of dict
        Its medians (`joint.assembly.summarise`).
    """
    fit = found.fit
    refused = found.refused
    rows = {row["parameter"]: row for row in found.rows()}
    directions = []
    for d in found.task.directions:
        stiff = next(rows[f"{kind} {d} {d}"] for kind in ("K", *LAWS) if f"{kind} {d} {d}" in rows)
        loss = rows.get(f"D {d} {d}")
        k_study = study_stiffness(found, d)
        directions.append(
            {
                "direction": d,
                "k": stiff["value"],
                "k_std": stiff["std"],
                "unit": joint_unit(d),
                "determined": stiff["determined"],
                "eta": None if loss is None or not stiff["value"] else loss["value"] / stiff["value"],
                "k_study": None if np.isinf(k_study) else k_study,
            }
        )
    return {
        "study": study,
        "joint": found.task.joint.name,
        "band": [float(fit.frequency[0]), float(fit.frequency[-1])],
        "lines": int(fit.frequency.size),
        "misfit_db": found.misfit_db,
        "message": fit.message,
        "directions": directions,
        "parameters": list(rows.values()),
        "correlated": [{"between": [a, b], "correlation": r} for a, b, r in found.correlated()],
        "uncertain": [
            {"parameter": name, "value": float(v), "std": float(s), "moved": float(m)}
            for name, v, s, m in zip(
                fit.part_names, fit.part_values, fit.part_std, found.moved(), strict=True
            )
        ],
        "left_out_above": None if refused is None else float(fit.frequency[-1]),
        "line_by_line": None
        if lines is None
        else {
            "lines": int(lines.frequency.size),
            "regular_lines": int(lines.regular.sum()),
            "amplification_limit": lines.amplification_limit,
            "directions": summary,
        },
    }


def joint_words(
    found: Estimate,
    lines: JointIdentification | None,
    summary: list[dict[str, Any]],
    reason: str,
) -> list[str]:
    """Return the printed lines: values with their uncertainty, open parameters, and values at lines.

    Parameters
    ----------
    found : Estimate
    lines, summary
        As `joint_result`.
    reason : str
        Why there is nothing line by line.
    """
    again = found.stages[-1].line_by_line()
    after = [] if lines is None or again is None else [_medians(summarise(again, found.task.directions))]
    return [*_fitted(found), *_open(found), *_line_by_line(lines, summary, reason), *after]


def _fitted(found: Estimate) -> list[str]:
    fit, stage = found.fit, found.stages[-1]
    n_out, n_in = found.measured.shape[1:]
    out = [
        f"joint {found.task.joint.name}: fitted to {n_out * n_in} FRFs at {fit.frequency.size} lines, "
        f"{fit.frequency[0]:.4g}-{fit.frequency[-1]:.4g} Hz; the fit started from {stage.start}",
        f"  parameter              value         std   95 % interval{'':18s}unit       study",
    ]
    for row in found.rows():
        kind, a, b = row["parameter"].split(" ")[:3]
        inner = row["parameter"].split(" ")[3:]
        name = f"{inner[0] if inner else _WORDS[kind]} {a}" + (f"·{b}" if a != b else "")
        known = ""
        if a == b and not inner and kind in ("K", *LAWS):
            value = study_stiffness(found, a)
            known = "rigid" if np.isinf(value) else f"{value:.4g}"
        unit = row["unit"].replace("N m/", "N·m/").replace("N m s/", "N·m·s/").replace("N s/", "N·s/")
        std = "" if row["std"] is None else f"{row['std']:.2g}"
        low_high = "" if row["low"] is None else f"{row['low']:.5g} … {row['high']:.5g}"
        if not row["determined"]:  # a deviation would read as if the data determined the parameter
            std = low_high = ""
        out.append(
            f"  {name:12s} {row['value']:15.5g} {std:>11s}   {low_high:30s} {unit:10s} {known}"
            + ("" if row["determined"] else "  at its bound" if row["at_bound"] else f"  {row['words']}")
        )
        if kind == "D" and row["determined"]:
            k = next(r["value"] for r in found.rows() if r["parameter"] == f"K {a} {a}")
            out[-1] += f"  loss factor {row['value'] / k:.3g}"
    levels = ", ".join(f"{error:.0%} up to {f:.0f} Hz" for f, error in stage.levels)
    out.append(f"  misfit {found.misfit_db:.2f} dB; model error of the FRFs, as the fit found it: {levels}")
    return out


def _open(found: Estimate) -> list[str]:
    fit, out = found.fit, []
    if not fit.converged:
        out.append(
            "  the fit did not converge: its iterations ran out, and the values are the best it reached"
        )
    if found.refused is not None:
        off = found.stages[-1].disagreement(found.refused)
        off = np.where(found.stages[-1].sharp, off, 0.0)
        k = int(np.argmax(off))
        out.append(
            f"  lines above {fit.frequency[-1]:.0f} Hz are not used: lines up to {found.refused.highest:.0f} "
            f"Hz would change {fit.form.names[k]} to {found.refused.fit.values[k]:.4g}, by {off[k]:.0f} "
            "standard deviations, so the model is wrong at these frequencies"
        )
    worst = max(error for _, error in found.stages[-1].levels)
    # Misfit beyond which the values are those of no right model [dB]
    if found.misfit_db > 3.0:
        out.append(
            f"  a misfit of {found.misfit_db:.1f} dB is too large for a correct model. Do not rely on these "
            "values, which are the best that were found. Name other directions, or search for a missing "
            "effect with dovetail run"
        )
    # Error of an FRF beside the model's beyond which the model's own error governs the values [-]
    elif worst > 0.08:
        out.append(
            f"  the model misses these FRFs by up to {worst:.0%}, which is more than noise. The intervals "
            "allow for it as one error of the frequency of each mode"
        )
    loose = [row["parameter"] for row in found.rows() if not row["determined"] and not row["at_bound"]]
    if loose:
        out.append(
            f"  the data do not determine {', '.join(loose)}: their values are little more than "
            "the assumed start"
        )
    names = set(fit.form.names)
    pairs = found.correlated(0.7)
    if pairs:
        shown = ", ".join(f"{a} with {b} {r:+.2f}" for a, b, r in pairs[:6])
        out.append(f"  correlated: {shown}{f', and {len(pairs) - 6} more' if len(pairs) > 6 else ''}")
        if any(b in names for _, b, _ in pairs):
            relative, words = fit.identifiability.weakest[0]
            out.append(f"  least certain combination: {words}, known to {relative:.0%}")
    far = [
        f"{name} {value:.4g} ({moved:+.1f})"
        for name, value, moved in zip(fit.part_names, fit.part_values, found.moved(), strict=True)
        if abs(moved) > FAR_STD
    ]
    if far:
        out.append(
            f"  uncertain parameters that moved by more than {FAR_STD:g} prior standard deviations: "
            f"{', '.join(far)}. The model may lack an effect; search for it with dovetail run"
        )
    return out


def _line_by_line(lines: JointIdentification | None, summary: list[dict[str, Any]], reason: str) -> list[str]:
    if lines is None:
        return [f"line by line: {reason}"]
    f, regular = lines.frequency, lines.regular
    bands = np.array_split(np.arange(f.size), min(8, f.size))
    out = [
        f"line by line: {int(regular.sum())} of {f.size} lines are usable (error amplification at most "
        f"{lines.amplification_limit:g})",
        "         band Hz   cond(A)   cond(B)  residual  usable lines",
        *(
            f"{f[b[0]]:8.1f}-{f[b[-1]]:<8.1f} {np.median(lines.condition_A[b]):8.2g}  "
            f"{np.median(lines.condition_B[b]):8.2g}  {_middle(lines.residual[b]):8.2g}  "
            f"{int(regular[b].sum())} of {b.size}"
            for b in bands
        ),
        "medians over the usable lines, with the scatter of a single line:",
        *(
            f"  {s['direction']:>2}: k = {s['k']:.4g} {s['unit']} (scatter {s['k_scatter']:.2g}), loss "
            f"factor {s['eta']:.3g}, or viscous c = {s['c']:.3g} {s['unit_c']}"
            for s in summary
        ),
    ]
    if regular.sum() >= 8:
        names = [s["direction"] for s in summary]
        laws = explain_stiffness(f, lines.z, names, use=regular, weight=1 / lines.amplification)
        out += [
            f"  {law.sentence}"
            if law.explained
            else f"  {law.name}: no law explains the lines; the best one leaves "
            f"{law.best.misfit:.0%} of the stiffness"
            for law in laws
        ]
    return out


def _medians(summary: list[dict[str, Any]]) -> str:
    shown = ", ".join(f"{s['direction']} {s['k']:.4g} (scatter {s['k_scatter']:.2g})" for s in summary)
    return f"  the same medians with the uncertain parameters at their fitted values: {shown}"


def _middle(values: np.ndarray) -> float:
    """Return the median of the finite values."""
    finite = values[np.isfinite(values)]
    return float(np.median(finite)) if finite.size else float("nan")


def draw_joint(found: Estimate, path: Path, amplification: float = 1e3) -> None:
    """Draw the dynamic stiffness over frequency: line by line, and as fitted with its confidence band.

    Points are those of the structure as fitted: without the joint, but with its uncertain parameters fitted.

    Parameters
    ----------
    found : Estimate
    path : Path
        A .png file.
    amplification : float
        Largest amplification of errors of a line that is shown [-].
    """
    from viz.joints import plot_stiffness_entries
    from viz.style import save

    directions = found.task.directions
    lines = found.stages[-1].line_by_line(amplification)
    frequency = found.fit.frequency
    Z = found.fit.Z(frequency)
    points = np.full(Z.shape, complex(np.nan, np.nan))
    dots = "line by line" if lines is not None and lines.regular.any() else "line by line: not determined"
    if lines is not None:
        points[lines.regular] = lines.z[lines.regular]
    study = np.zeros_like(Z)
    for i, d in enumerate(directions):
        k = study_stiffness(found, d)
        study[:, i, i] = k * (1 + 1j * found.task.joint.eta) if np.isfinite(k) else complex(np.nan, np.nan)
    figure = plot_stiffness_entries(
        frequency,
        {dots: points, "study": study, "fitted, 95 %": Z},
        [(i, i) for i in range(len(directions))],
        directions,
        {"fitted, 95 %": found.fit.Z_std(frequency)},
        title=f"Joint {found.task.joint.name}: dynamic stiffness",
        focus="fitted, 95 %",
    )
    save(figure, path)
