"""The end of a report: notes, assumptions, thresholds, and the run itself."""

import ast
import importlib
import inspect
from collections.abc import Iterator, Sequence
from itertools import pairwise

from dovetail.file.contents import StudyContents
from dovetail.file.geometry import describe_sizes
from dovetail.report import words
from dovetail.report.blocks import Details, Facts, Items, ReportMark, ReportSection, TableBlock, Text
from dovetail.report.shown import Shown
from dovetail.result import RunResult, by_frfs, by_modes_alone, program_version
from updating.diagnosis.verdict import Verdict

MODULES = (
    "updating.inference.belief",
    "updating.diagnosis.evidence.search",
    "updating.inference.preparation",
    "updating.inference.fit",
    "updating.inference.fit_data",
    "updating.inference.fit_function",
    "updating.quality.fault_hypotheses",
    "updating.quality.sensor_faults",
    "updating.quality.signs",
    "updating.quality.faults",
)
"""Modules whose constants decide the verdict; the report lists them."""


MODULES_OF_MODES = (
    "updating.inference.belief",
    "updating.diagnosis.evidence.search",
    "updating.diagnosis.evidence.ranking",
    "updating.inference.mode_changes",
    "updating.diagnosis.verdict",
    "updating.diagnosis.mode_table",
    "updating.diagnosis.mode_diagnosis",
    "updating.diagnosis.states",
    "updating.inference.mode_preparation",
    "updating.inference.mode_fit",
    "updating.inference.mode_targets",
)
"""The same of a diagnosis from modes."""


def notes(result: RunResult[Verdict], shown: Shown) -> ReportSection:
    """Return notes for the reader on methods and limits."""
    study = result.study
    failures = *shown.album.failures, *shown.figures.failures
    known = [*study.model.mesh.notes, *study.measured_notes, *result.notes, *failures]
    return ReportSection("Notes", [Items(known)])


def assumptions(result: RunResult[Verdict], shown: Shown) -> ReportSection:
    """Return assumptions, the thresholds of the search, and the study file."""
    rows = [
        [ReportMark(name, "code"), words.number(value) if isinstance(value, float) else str(value), text]
        for name, value, text in thresholds(MODULES if by_frfs(result.diagnosis) else MODULES_OF_MODES)
    ]
    study, table = result.study, TableBlock(["name", "value", "meaning"], rows, numbers=(1,), at_most=100)
    blocks = [
        Items(study.assumptions) or Text("The study states everything; nothing was assumed."),
        Details("Thresholds of the search", [table]),
        Details("The study file", [Text(study.text, "pre")]),
    ]
    return ReportSection("Assumptions and thresholds", blocks)


def thresholds(modules: Sequence[str] = MODULES) -> Iterator[tuple[str, float, str]]:
    """Yield name, value and meaning (the docstring under it) of every constant that decides a verdict."""
    for name in modules:
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


def about(result: RunResult[Verdict], shown: Shown) -> ReportSection:
    """Return the facts of the run."""
    d = result.diagnosis
    facts = [
        ("study file", result.study.path.name),
        ("program", _program()),
        ("date", result.finished.strftime("%Y-%m-%d %H:%M %Z")),
        ("duration", f"{result.seconds:.0f} s, of which the diagnosis took {d.seconds:.0f} s"),
        _mesh(result.study),
    ]
    files = "result.json (for programs), found.toml, pictures/"
    if by_frfs(d):
        facts += [
            ("error of the mesh", f"{d.discretisation_db:.2g} dB, estimated by halving every element"),
            (
                "error of the reduced basis",
                f"{d.basis_db:.2g} dB, against direct solutions of the full model",
            ),
        ]
        files += ", frf.npz (measured and computed FRFs of each step)"
    if by_modes_alone(d):
        level = d.calibration[0].mesh_level
        facts.append(("error of the mesh", f"{100 * level:.2g} % of natural frequencies"))
    return ReportSection("About this run", [Facts([*facts, ("files next to this one", files)])])


def _mesh(study: StudyContents) -> tuple[str, str]:
    mesh = study.model.mesh
    if not mesh.n_lines:
        return "mesh", f"no members; {study.model.n_dof} degrees of freedom before constraints"
    size = f"{mesh.n_lines} elements of {describe_sizes(mesh.lengths())}"
    return "mesh", f"{size}, {study.model.n_dof} degrees of freedom before constraints"
