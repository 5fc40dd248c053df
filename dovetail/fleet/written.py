"""A fleet as tables, files, a picture and a page."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.file.contents import StudyContents
from dovetail.fleet.diagnosing import cause_text
from dovetail.fleet.run import Triaged
from dovetail.report.blocks import Facts, Items, Picture, ReportSection, TableBlock, Text
from dovetail.report.page import page, tag
from dovetail.report.table import Column, Table, write_csv
from dovetail.units.folder import Record
from dovetail.units.outcome import Outcome
from fem.io.atomic import replacing
from fem.summary import counted

RANKING, PAGE, PICTURE = "ranking.csv", "fleet.html", "fleet.png"
"""Files in the folder of a fleet."""

PRINTED, BANDS = 20, 8
"""Units of the printed table, and bands of frequency by which the largest rest is located [-]."""

MODEL = (
    "A regular unit's parameters scatter normally about the population's, and the logarithm of its rest is "
    "normal. An outlier's distance in the parameters, its rest or both are anything beyond the median of the "
    "regular ones, uniform in the logarithm. Shares and scatter are estimated together; no threshold is set."
)


@dataclass(frozen=True, slots=True)
class Row:
    """A unit in the ranking.

    Attributes
    ----------
    file : Path
    probability, odds : float
        That it is an outlier, and the logarithm of the odds [-].
    distance : float
        In the parameters, in standard deviations of the population, √(d²) [-].
    rest : float
        Root mean square rest in units of the population's spread [-].
    where : str
        Sensor and band with the largest rest, or the parameters where these alone are far.
    cause : str
        Of the diagnosis; empty without one.
    warnings : tuple of str
    """

    file: Path
    probability: float
    odds: float
    distance: float
    rest: float
    where: str
    cause: str
    warnings: tuple[str, ...]


def rows_of(triaged: Triaged, diagnoses: Mapping[Path, Record]) -> list[Row]:
    """Return all units, the most probable outlier first."""
    p, rows = triaged.population, []
    for k in p.order:
        file = triaged.files[k]
        record = diagnoses.get(file)
        rows.append(
            Row(
                file,
                float(p.probability[k]),
                float(p.odds[k]),
                float(np.sqrt(p.distance[k])),
                float(np.sqrt(p.rest[k])),
                _where(triaged, int(k)),
                cause_text(record) if record else "",
                triaged.units[k].warnings,
            )
        )
    return rows


def _where(triaged: Triaged, k: int) -> str:
    """Return where a unit differs most from the population."""
    p, fleet = triaged.population, triaged.fleet
    if p.by_parameters[k] > 0.5:
        off = (triaged.units[k].x - p.mean) / np.sqrt(np.maximum(np.diag(p.scatter), 1e-300))
        worst = int(np.where(p.determined > 0.5, np.abs(off), 0.0).argmax())
        return f"{names_of(triaged)[worst]} {off[worst]:+.1f} deviations"
    square = p.scaled_residual(triaged.units[k].residual) ** 2
    f = fleet.frequency
    edges = np.linspace(f[0], f[-1], BANDS + 1)
    band = np.clip(np.searchsorted(edges, f, side="right") - 1, 0, BANDS - 1)
    known = np.isfinite(square)
    size = np.stack([np.where(known, square, 0)[band == b].sum(axis=(0, 2)) for b in range(BANDS)])
    number = np.stack([known[band == b].sum(axis=(0, 2)) for b in range(BANDS)])
    mean = size / np.maximum(number, 1)
    b, i = np.unravel_index(int(mean.argmax()), mean.shape)
    sensor = fleet.problem.data.measurement.sensors[int(i)].name
    return f"{sensor}, {edges[b]:.4g} to {edges[b + 1]:.4g} Hz"


def names_of(triaged: Triaged) -> list[str]:
    """Return the names of all that scatters."""
    problem = triaged.fleet.problem
    variables = triaged.fleet.variables
    knots = [f"damping at {f:.4g} Hz" for f in problem.damping.knots]
    rest = ["damping of connections", "its slope"][
        : triaged.population.mean.size - len(variables) - len(knots)
    ]
    return [*(v.name for v in variables), *knots, *rest]


def population_rows(triaged: Triaged) -> list[tuple[str, str, float, float, float]]:
    """Return name, unit, nominal value, mean and relative scatter of what the units' data determine."""
    problem, p = triaged.fleet.problem, triaged.population
    variables = triaged.fleet.variables
    std: NDArray[np.float64] = np.sqrt(np.diag(p.scatter))
    out = []
    for k, name in enumerate(names_of(triaged)):
        if p.determined[k] < 0.5:
            continue
        if k < len(variables):
            v = variables[k]
            value = v.to_value(float(p.mean[k]))
            relative = std[k] if v.log else std[k] * v.scale / (abs(value) or 1.0)
            out.append((name, v.unit, v.nominal, value, float(relative)))
        else:
            nominal = float(problem.damping.start[k - len(variables)])
            out.append((name, "-", nominal, float(np.exp(p.mean[k])), float(std[k])))
    return out


def ranking(rows: Sequence[Row]) -> Table:
    """Return the ranking for files: all that is known of each unit."""
    numbers = {"probability": "probability", "odds": "log odds", "distance": "distance", "rest": "rest"}
    return Table.of(
        "ranking",
        Column("unit", [str(r.file) for r in rows]),
        *(Column(name, [getattr(r, key) for r in rows]) for key, name in numbers.items()),
        *(Column(name, [getattr(r, name) for r in rows]) for name in ("where", "cause")),
        Column("warnings", ["; ".join(r.warnings) for r in rows]),
    )


def population(triaged: Triaged) -> Table:
    """Return name, unit, nominal value, mean and relative scatter of what the units' data determine."""
    rows = population_rows(triaged)
    names, units, nominal, mean, scatter = zip(*rows, strict=True) if rows else ((),) * 5
    return Table.of(
        "population",
        Column("population", names, key="name"),
        Column("unit", units, key="unit", places=("file",)),
        Column("nominal", nominal, key="nominal"),
        Column("mean", mean, key="mean"),
        Column("scatter", scatter, "%", ".3g", 100, key="scatter"),
    )


def write_files(
    triaged: Triaged, rows: Sequence[Row], study: StudyContents, folder: Path, failures: Sequence[Outcome]
) -> None:
    """Write the ranking as CSV, the picture and the page."""
    write_csv(folder / RANKING, ranking(rows))
    from viz.fleet import plot_fleet
    from viz.style import save

    p = triaged.population
    title = f"{study.name}: {counted(len(rows), 'unit')}"
    figure = plot_fleet(np.sqrt(p.distance), np.sqrt(p.rest), p.probability, p.n_determined, title)
    save(figure, folder / PICTURE)
    with replacing(folder / PAGE) as scratch:
        scratch.write_text(_page(triaged, rows, study, folder / PICTURE, failures), encoding="utf-8")


def _page(
    triaged: Triaged, rows: Sequence[Row], study: StudyContents, picture: Path, failures: Sequence[Outcome]
) -> str:
    cells = [
        (r.file.name, f"{r.probability:.3f}", f"{r.distance:.2f}", f"{r.rest:.2f}", r.where, r.cause)
        for r in rows
    ]
    outliers = [k for k, r in enumerate(rows) if r.probability > 0.5]
    head = ("unit", "probability", "distance in parameters [σ]", "rest [σ]", "where", "cause")
    shown = max(PRINTED, len(outliers) + 10)
    ranking = TableBlock(head, cells, numbers=(1, 2, 3), marked=outliers, at_most=shown)
    drawn = Picture(picture, "Distance in the parameters and rest of each unit", MODEL)
    population = [
        (n, u, f"{a:.5g}", f"{b:.5g}", f"{100 * s:.3g}") for n, u, a, b, s in population_rows(triaged)
    ]
    scatter = ("parameter", "unit", "nominal", "mean", "scatter [%]")
    lost = [f"{Path(_name(o)).name}: {o.failure}" for o in (*triaged.failures, *failures)]
    warned = [f"{r.file.name}: {w}" for r in rows for w in r.warnings]
    size = f"{triaged.fleet.problem.reduced.model.n_dof} DOFs"
    title = f"{study.name}: fleet"
    return page(
        title,
        tag("h1", title),
        ReportSection("Ranking", [Text(tuple(summary_of(triaged, rows))), ranking]),
        ReportSection("Distance and rest of all units", [drawn]),
        ReportSection("Population", [TableBlock(scatter, population, numbers=(2, 3, 4))]),
        ReportSection("Units that failed", [Items(lost)]),
        ReportSection("Warnings", [Items(warned)]),
        ReportSection("About", [Facts([("study", study.path.name), ("model", size)])]),
    )


def summary_of(triaged: Triaged, rows: Sequence[Row]) -> list[str]:
    """Return how many units are outliers, in sentences."""
    p = triaged.population
    likely = sum(r.probability > 0.5 for r in rows)
    return [
        f"{counted(len(rows), 'unit')}; share of outliers {100 * p.share:.1f} %; {likely} more probably an "
        "outlier than not."
    ]


def lines_of(
    triaged: Triaged, rows: Sequence[Row], study: StudyContents, failures: Sequence[Outcome]
) -> list[str | Table]:
    """Return the tables that the command prints."""
    shown = rows[:PRINTED]
    causes = [f"cause of {r.file.name}: {r.cause}" for r in shown if r.cause]
    out: list[str | Table] = [
        f"{study.name}: {' '.join(summary_of(triaged, rows))}",
        Table.of(
            "ranking",
            Column("unit", [r.file.name for r in shown]),
            Column("probability", [r.probability for r in shown], show=".4f"),
            Column("distance", [r.distance for r in shown], show=".2f"),
            Column("rest", [r.rest for r in shown], show=".2f"),
            Column("where", [r.where for r in shown]),
        ),
        *causes,
    ]
    if len(rows) > len(shown):
        out.append(f"… and {len(rows) - len(shown)} more in {RANKING}")
    out += ["", population(triaged)]
    lost = (*triaged.failures, *failures)
    if lost:
        out += ["", f"{counted(len(lost), 'unit')} failed, and the same command tries again:"]
        out += [f"  {Path(_name(o)).name}: {o.failure}" for o in lost[:PRINTED]]
    return out


def as_dict(
    triaged: Triaged,
    rows: Sequence[Row],
    study: StudyContents,
    diagnoses: Mapping[Path, Record],
    failures: Sequence[Outcome],
) -> dict[str, Any]:
    """Return the fleet as JSON has it."""
    p = triaged.population
    return {
        "study": study.name,
        "model": MODEL,
        "units": [
            {
                "file": r.file,
                "probability": r.probability,
                "log_odds": r.odds,
                "distance": r.distance,
                "rest": r.rest,
                "where": r.where,
                "diagnosis": diagnoses.get(r.file),
                "warnings": r.warnings,
            }
            for r in rows
        ],
        "share_of_outliers": p.share,
        "rest_of_regular": {"mean_log": p.rest_mean, "std_log": p.rest_std},
        "population": population(triaged).records(),
        "failures": [{"file": _name(o), "reason": o.failure} for o in (*triaged.failures, *failures)],
    }


def _name(outcome: Outcome) -> str:
    return outcome.unit if isinstance(outcome.unit, str) else outcome.unit[0]
