"""``dovetail update``: uncertain parameters fitted to modes or FRFs."""

import argparse
from typing import Any

from dovetail.commands.answer import Answer
from dovetail.commands.argument_types import add_pool, add_report_folder, integer_up_to, natural
from dovetail.commands.common import Options, check_places, loaded, noted
from dovetail.commands.stepping import step_progress
from dovetail.commands.update_report import write_update_report
from dovetail.disk.output import Output, OutputError, Progress, result_folder, write_json
from dovetail.ensemble.bootstrap import JOURNAL, LEAST, Bootstrap, as_dict, lines_of, run_bootstrap
from dovetail.report.table import Column, Table, columns_of, write_csv
from dovetail.result import PICTURES, REPORT
from dovetail.units.pool import pool_of
from dovetail.update import StudyUpdate, update_study, updated_text
from updating.inference.updated import Updated

EXAMPLE = "dovetail update study.toml --out out/updated"
STUDY, JSON = "study.toml", "update.json"
REFITS = "bootstrap.csv"

_UNDETERMINED = "the data do not determine it, or it is at a bound"
NULLS = {
    "std": _UNDETERMINED,
    "interval_95": _UNDETERMINED,
    "correlation": "a parameter has no standard deviation",
    "prior_std": "it has no prior",
    "from_prior": "it has no prior",
    "frequency_error": "no modes were fitted, or none was paired",
    "mac": "no shapes were fitted, or none was paired",
    "frf_db": "no FRFs were fitted",
}
"""Why numbers are missing."""


def add_arguments(p: argparse.ArgumentParser) -> None:
    """Add the options of the command to its parser."""
    add_report_folder(p, "report.html, update.json, study.toml with the new values, and pictures/")
    p.add_argument(
        "--bootstrap",
        type=integer_up_to(1_000_000),
        metavar="N",
        help=f"fit N resamples too, at least {LEAST}, for standard deviations that are not linearised; "
        "DIR-bootstrap keeps the refits, and a run that was stopped continues there",
    )
    p.add_argument("--seed", type=natural, default=0, metavar="S", help="seed of the resamples (default 0)")
    add_pool(p, "refits")


def run(options: Options, progress: Progress) -> Answer:
    """Update a study's model to its measurement; write a report and the study with the new values."""
    if options.bootstrap is not None and options.bootstrap < LEAST:
        msg = f"--bootstrap {options.bootstrap}: at least {LEAST} resamples are needed"
        raise OutputError(msg)
    places = [Output("--out", options.out, (REPORT, STUDY, JSON, REFITS, PICTURES))]
    folder = options.out.with_name(f"{options.out.name}-bootstrap")
    if options.bootstrap is not None:
        places.append(Output("--out", folder, (JOURNAL,)))
    check_places(options, *places)
    study = loaded(options)
    progress("updating")
    result = update_study(study)
    text, unsaid = updated_text(study, result.updated, options.out)
    refits = None
    if options.bootstrap is not None:
        with pool_of(options.processes, options.scheduler) as pool:
            shown = step_progress(options, progress)
            refits = run_bootstrap(result.updated, options.bootstrap, options.seed, folder, pool, shown)
    data = _update_dict(result, unsaid) | ({"bootstrap": as_dict(refits)} if refits is not None else {})
    with result_folder(options.out, options.force) as scratch:
        progress("drawing", 0.8)
        (scratch / STUDY).write_text(text, encoding="utf-8")
        write_json(scratch / JSON, data, NULLS)
        write_update_report(result, unsaid, scratch, refits)
        if refits is not None:
            write_csv(scratch / REFITS, _table_of(refits))
    u = result.updated
    return Answer(
        None,  # JSON is update.json
        [
            *result.printed(),
            *_sampled(u),
            *(lines_of(refits) if refits is not None else ()),
            *noted(result.notes, unsaid, study.measured_notes),
            f"{options.out / REPORT} and {options.out / STUDY} are written",
        ],
        data,
        NULLS,
        sheets=[_parameters(u), Table("correlation", columns_of(u.names, u.correlation))],
    )


def _table_of(found: Bootstrap) -> Table:
    """Return the values of all refits."""
    each = zip(found.updated.parameters, found.values.T, strict=True)
    return Table("refits", [Column(p.name, values, p.unit) for p, values in each])


def _parameters(u: Updated) -> Table:
    """Return the parameters, their bounds and their uncertainty."""
    keys = ("name", "unit", "start", "lower", "upper", "prior_std", "value", "std", "interval_95")
    keys += ("at_bound", "determined", "from_prior")
    rows = [[p.interval(0.95) if k == "interval_95" else getattr(p, k) for k in keys] for p in u.parameters]
    columns = [
        Column(key.replace("_", " "), values, key=key, places=() if key == "interval_95" else ("file",))
        for key, values in zip(keys, zip(*rows, strict=True), strict=True)
    ]
    return Table("parameters", columns)


def _quantiles(u: Updated) -> list[dict[str, Any]]:
    """Return quantiles of the samples of all parameters."""
    assert u.samples is not None
    each = {"5": 0.05, "50": 0.5, "95": 0.95}
    rows = [u.samples.quantile(q) for q in each.values()]
    return [
        {"name": p.name, "unit": p.unit, **{k: float(row[i]) for k, row in zip(each, rows, strict=True)}}
        for i, p in enumerate(u.parameters)
    ]


def _sampled(u: Updated) -> list[str]:
    if u.samples is None:
        return []
    lines = [f"samples: {len(u.samples.values)}, worth {u.samples.n_independent:.0f} independent ones"]
    for q in _quantiles(u):
        lines.append(f"  {q['name']}: {q['50']:.5g}, 5 to 95 %: {q['5']:.5g} to {q['95']:.5g} {q['unit']}")
    return lines


def _update_dict(result: StudyUpdate, unsaid: tuple[str, ...]) -> dict[str, Any]:
    u = result.updated
    return {
        "study": result.study.name,
        "to": result.to,
        "ending": u.ending.value[0],
        "parameters": _parameters(u).records(),
        "correlation": u.correlation,
        "misfit": dict(u.misfit),
        **({} if u.samples is None else {"samples": _quantiles(u)}),
        "path": [
            {
                "stage": s.stage,
                "values": s.values,
                "frequency_error": s.errors.frequency,
                "mac": s.errors.mac,
                "frf_db": s.errors.frf_db,
            }
            for s in u.path
        ],
        "messages": u.messages,
        "notes": (*result.notes, *unsaid),
        "warnings": result.study.warnings,
        "mesh_notes": result.study.model.mesh.notes,
        "measured_notes": result.study.measured_notes,
    }
