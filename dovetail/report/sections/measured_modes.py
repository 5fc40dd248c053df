"""Measured modes beside those of the nominal, the fitted and the reported model."""

import math
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from dovetail.report import cells
from dovetail.report.blocks import Block, Details, TableBlock, Text
from dovetail.report.table import Column, Table
from dovetail.result import RunResult, by_frfs, by_modes_alone
from fem.array_types import Floats
from fem.summary import percent
from updating.diagnosis.mode_table import ModeTable
from updating.diagnosis.verdict import Verdict

if TYPE_CHECKING:
    from dovetail.frf_modes import ModesInFrfs
    from dovetail.report.drawings import Album
    from dovetail.report.shown import Shown
    from viz.chart import Chart

Pair: TypeAlias = tuple[float, float]
"""Frequencies before and after [Hz]."""
DEVIATIONS = (
    "Computed less measured natural frequencies, mode by mode. The bars around zero are two standard "
    "deviations of the measurement."
)

MAC = "Modal assurance criterion of measured shapes with those of the model reported."
CORRECTED = (
    "Measured frequencies are those of the second state without what the calibrated model leaves on the "
    "baseline."
)


def steps(d: Verdict, of_models: Mapping[str, Floats]) -> dict[str, Floats]:
    """Return values of the models that are compared with the measured modes, by the label of each.

    Of two states the first model is that which was calibrated on the baseline.

    Parameters
    ----------
    d : Verdict
    of_models : mapping of str to ndarray
        ``computed`` or ``mac`` of a table of modes.
    """
    values = list(of_models.values())
    fitted, found = values[min(1, len(values) - 1)], values[-1]
    what = "effects" if len(d.found) > 1 else "effect"
    if d.baseline is None:
        return {"nominal": values[0], "fitted": fitted} | ({f"with the {what}": found} if d.found else {})
    return {"fitted to the baseline": fitted} | ({"with the change": found} if d.found else {})


def role(m: ModeTable, k: int) -> str:
    """Return what a mode was to the diagnosis."""
    if not m.belongs[k]:
        return f"does not belong to the model: {percent(m.bad[k])}"
    if not m.held_out[k]:
        return "fitted"
    return f"predicted: {m.predicted_text(k)}" if math.isfinite(m.found_std[k]) else "predicted"


def _remark(m: ModeTable, k: int) -> str:
    return role(m, k).replace("fitted", "", 1).replace("predicted", "predicted, not fitted", 1)


def table(d: Verdict, m: ModeTable) -> Table:
    """Return measured modes, the deviation of each model, and the MAC of the last one."""
    return Table.of(
        "modes",
        Column("measured", m.measured, "Hz"),
        *(Column(name, f / m.measured - 1, "%", "+.2f", 100) for name, f in steps(d, m.computed).items()),
        Column("MAC", m.mac_found, show=".3f"),
        Column("", [_remark(m, k) for k in range(len(m.measured))]),
    )


def page(result: RunResult[Verdict], shown: "Shown") -> list[Block | None]:
    """Return deviations, the table of the modes, and modal assurance criteria."""
    m, d = result.measured_modes, result.diagnosis
    if m is None:
        return [] if result.identified is None else _identified(result.identified, shown)
    models, macs = steps(d, m.computed), steps(d, m.mac)
    damped, shaped = np.isfinite(m.zeta).any(), np.isfinite(m.mac_found).any()
    head = ["measured [Hz]", "std [%]", *(f"{label} [%]" for label in models)]
    head += ["damping measured [%]", "damping computed [%]"] if damped else []
    head += [f"MAC {label}" for label in macs] if shaped else []
    rows = []
    for k, f in enumerate(m.measured):
        row = [f"{f:.5g}", f"{100 * m.std[k]:.2g}", *(cells.shift(f, g[k]) for g in models.values())]
        row += [cells.number(100 * x[k], 3) for x in (m.zeta, m.zeta_found)] if damped else []
        row += [cells.decimals(x[k], 3) for x in macs.values()] if shaped else []
        rows.append([*row, role(m, k)])
    errors = [
        [label, *(cells.number(100 * m.errors(f, out), 2) for out in (False, True))]
        for label, f in models.items()
    ]
    predicted = " Shaded modes were predicted, not fitted." if m.held_out.any() else ""
    alt = "Deviations of computed from measured natural frequencies, mode by mode; the table has the numbers."
    beside = TableBlock(
        ["model", "fitted modes [%]", "held-out modes [%]"],
        errors,
        numbers=(1, 2),
        caption="Root mean square of ln(f computed / f measured)",
    )
    return [
        _states(result, m),
        Text(CORRECTED if d.baseline is not None else ""),
        shown.figure("deviations", alt, DEVIATIONS + predicted, ["deviations"]),
        TableBlock([*head, ""], rows, numbers=range(len(head)), caption="Measured modes", at_most=25),
        beside if by_frfs(d) else None,  # the staircase has these errors elsewhere
        shown.figure("mac", "Modal assurance criteria as a map.", MAC, ["mac"]) if shaped else None,
    ]


def _states(result: RunResult[Verdict], m: ModeTable) -> TableBlock | None:
    """Return the natural frequencies of both states, measured and of the models; None for one state.

    A mode has the same number in the models of both states.
    """
    d, given = result.diagnosis, result.study.modes
    if not by_modes_alone(d) or d.baseline is None or given is None:
        return None
    first, numbers = d.baseline, d.problem.computed(d.final.fitted).partner
    rows: list[tuple[int, Pair, Pair]] = []
    for k, after in enumerate(given.modes.frequency):
        (same,) = np.nonzero((first.computed.partner == numbers[k]) & (numbers[k] >= 0))
        before, model = math.nan, math.nan
        if same.size:
            before = float(first.problem.targets.frequency[same[0]])
            model = float(first.computed.frequency[same[0]])
        rows.append((k + 1, (before, float(after)), (model, float(m.found[k]))))
    return states_table(rows)


def states_table(modes: Iterable[tuple[int, Pair, Pair]]) -> TableBlock:
    """Return the table of number, measured frequencies, and those of models, each before and after [Hz]."""
    rows = [
        [k, *(cell for pair in pairs for cell in (*(cells.number(f, 5) for f in pair), cells.shift(*pair)))]
        for k, *pairs in modes
    ]
    head = ["mode", "before [Hz]", "after [Hz]", "change [%]"]
    head += ["model before [Hz]", "model after [Hz]", "model's change [%]"]
    caption = "Natural frequencies before and after, as measured and of the models"
    return TableBlock(head, rows, numbers=range(7), caption=caption, at_most=25)


def _identified(found: "ModesInFrfs", shown: "Shown") -> list[Block | None]:
    """Return modes that were identified in FRFs beside computed ones, MAC, and CoMAC."""
    text = (
        "The study has FRFs and no measured modes: these modes were identified in the FRFs. Their partners "
        "have the most similar shape near their frequency. No fit saw them; the FRFs were fitted. "
        "Columns of models have their deviation from the measured frequency; ζ is the damping ratio."
    )
    rows = []
    for k, mode in enumerate(found.rows(), 1):
        f = mode["measured_Hz"]
        known = {key: math.nan if x is None else x for key, x in mode.items()}
        shifts = [cells.shift(f, known[f"{model}_Hz"]) for model in ("nominal", "reported")]
        damping = [cells.number(100 * known[f"damping_{of}"], 3) for of in ("measured", "reported")]
        macs = [cells.decimals(known[f"mac_{model}"], 3) for model in ("nominal", "reported")]
        rows.append([k, f"{f:.5g}", *shifts, *damping, *macs])
    head = ["mode", "measured [Hz]", "nominal [%]", "reported [%]", "ζ measured [%]", "ζ reported [%]"]
    head += ["MAC nominal", "MAC reported"]
    pairs = TableBlock(head, rows, numbers=range(8), caption="Modes in the measured FRFs", at_most=25)
    map_ = shown.figure("mac", "Modal assurance criteria as a map.", MAC, ["mac"])
    names = [s.name for s in found.measured.sensors]
    order = [int(k) for k in np.argsort(found.comac) if np.isfinite(found.comac[k])]
    each = [[names[k], f"{found.comac[k]:.3f}"] for k in order]
    about = "Similarity of measured and reported motions at each sensor over all pairs; the lowest first."
    table = TableBlock(["sensor", "CoMAC"], each, numbers=(1,))
    comac = Details("CoMAC of each sensor", [Text(about), table]) if each else None
    return [Text(text), pairs, map_, comac]


def deviations(result: RunResult[Verdict]) -> "Chart | None":
    """Return the figure of the deviations; None without measured modes."""
    from viz import frequencies

    m = result.measured_modes
    return m and frequencies.deviations(m.measured, m.std, steps(result.diagnosis, m.computed), m.held_out)


def mac(result: RunResult[Verdict]) -> "Chart | None":
    """Return the figure of modal assurance criteria; None without measured shapes."""
    from viz.frequencies import mac_map

    m, reported, found = result.measured_modes, result.reported, result.identified
    if found is not None:
        mac, measured, modes = found.mac, found.measured.modes.frequency, found.computed
    elif m is not None and reported is not None and reported.mac is not None:
        mac, measured, modes = reported.mac, m.measured, reported.modes
    else:
        return None
    computed = modes.frequency[modes.n_rigid :]
    return mac_map(mac, [f"{f:.4g}" for f in measured], [f"{f:.4g}" for f in computed])


def draw(result: RunResult[Verdict], album: "Album") -> None:
    """Draw the still pictures."""
    m, reported = result.measured_modes, result.reported
    if result.identified is not None:
        n, k = result.identified.mac.shape
        alt = f"Modal assurance criteria of {n} shapes identified in FRFs with {k} computed ones."
        album.plot("mac", alt, MAC, lambda: mac(result))
    if m is None:
        return
    models = ", ".join(steps(result.diagnosis, m.computed))
    alt = f"Deviations of the natural frequencies of {models} from {len(m.measured)} measured ones."
    album.plot("deviations", alt, DEVIATIONS, lambda: deviations(result))
    if reported is not None and reported.mac is not None:
        n, k = reported.mac.shape
        alt = f"Modal assurance criteria of {n} measured shapes with {k} computed ones."
        album.plot("mac", alt, MAC, lambda: mac(result))
