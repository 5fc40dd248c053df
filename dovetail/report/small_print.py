"""The end of a report: notes, assumptions, thresholds, and the run itself."""

import ast
import importlib
import inspect
from collections.abc import Iterator
from itertools import pairwise

from dovetail.report import words
from dovetail.report.page import Markup, bullets, facts, folded, paragraph, section, table, tag
from dovetail.report.shown import Shown
from dovetail.result import RunResult, program_version

MODULES = (
    "updating.diagnosis.evidence.priors", "updating.diagnosis.evidence.search",
    "updating.inference.preparation", "updating.inference.fit", "updating.inference.fit_data",
    "updating.inference.fit_function", "updating.quality.fault_hypotheses",
    "updating.quality.sensor_faults", "updating.quality.faults",
)  # fmt: skip
"""Modules whose constants decide the verdict; the report lists them."""


def notes(result: RunResult, shown: Shown) -> Markup:
    """Return what a reader should know beside all else."""
    study = result.study
    known = [
        *study.model.mesh.notes,
        *study.measured_notes,
        *result.notes,
        *shown.album.failures,
        *shown.figures.failures,
    ]
    return section("Notes", bullets(known)) if known else Markup()


def assumptions(result: RunResult) -> Markup:
    """Return assumptions, the thresholds of the search, and the study file."""
    rows = [[tag("code", name), words.number(value), text] for name, value, text in thresholds()]
    study = result.study
    return section(
        "Assumptions and thresholds",
        bullets(study.assumptions)
        if study.assumptions
        else paragraph("The study says everything; nothing was assumed."),
        folded(
            "Thresholds of the search", table(["name", "value", "meaning"], rows, numbers=(1,), at_most=100)
        ),
        folded("The study file", tag("pre", study.text)),
    )


def thresholds() -> Iterator[tuple[str, float, str]]:
    """Yield name, value and meaning (the docstring under it) of every constant that decides a verdict."""
    for name in MODULES:
        module = importlib.import_module(name)
        body = ast.parse(inspect.getsource(module)).body
        for statement, after in pairwise(body):
            if not isinstance(statement, ast.Assign) or not isinstance(statement.targets[0], ast.Name):
                continue
            value = getattr(module, statement.targets[0].id)
            known = (
                isinstance(after, ast.Expr)
                and isinstance(after.value, ast.Constant)
                and isinstance(after.value.value, str)
            )
            if isinstance(value, int | float) and not isinstance(value, bool):
                text = str(after.value.value) if known else ""  # pyright: ignore[reportAttributeAccessIssue]
                yield statement.targets[0].id, value, " ".join(text.replace("``", "").split())


def _program() -> str:
    version = program_version()
    return "Dovetail, not installed" if version == "unknown" else f"Dovetail {version}"


def about(result: RunResult) -> Markup:
    """Return the facts of the run."""
    d, study = result.diagnosis, result.study
    mesh = study.model.mesh
    return section(
        "About this run",
        facts(
            [
                ("study file", study.path.name),
                ("program", _program()),
                ("date", result.finished.strftime("%Y-%m-%d %H:%M %Z")),
                ("duration", f"{result.seconds:.0f} s, of which the diagnosis took {d.seconds:.0f} s"),
                (
                    "mesh",
                    f"{mesh.n_lines} elements of {1e3 * mesh.lengths().min():.3g} to "
                    f"{1e3 * mesh.lengths().max():.3g} mm, {study.model.n_dof} degrees of freedom before "
                    "constraints",
                ),
                ("error of the mesh", f"{d.discretisation_db:.2g} dB, estimated by halving every element"),
                (
                    "error of the reduced basis",
                    f"{d.basis_db:.2g} dB, against direct solutions of the full model",
                ),
                (
                    "files beside this one",
                    "result.json (for programs), frf.npz (measured and computed FRFs of each step), "
                    "pictures/",
                ),
            ]
        ),
    )
