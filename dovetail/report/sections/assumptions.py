"""Assumptions, the thresholds of the search, and the study file."""

import ast
import importlib
import inspect
from collections.abc import Iterator, Sequence
from itertools import pairwise

from dovetail.report import words
from dovetail.report.blocks import Details, Items, ReportMark, ReportSection, TableBlock, Text
from dovetail.report.shown import Shown
from dovetail.result import RunResult, by_any, by_frfs
from updating.diagnosis.verdict import Verdict

applies = by_any


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


def page(result: RunResult[Verdict], shown: Shown) -> ReportSection:
    """Return assumptions, the thresholds of the search, and the study file."""
    rows = [
        [ReportMark(name, "code"), words.number(value) if isinstance(value, float) else str(value), text]
        for name, value, text in thresholds(MODULES if by_frfs(result.diagnosis) else MODULES_OF_MODES)
    ]
    study, table = result.study, TableBlock(["name", "value", "meaning"], rows, numbers=(1,), at_most=100)
    blocks = [
        Items(study.assumptions) or Text("The study states everything; nothing was assumed."),
        Details("Thresholds of the search", [table]),
        *([Details("The study file", [Text(study.text, "pre")])] if study.text else []),
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
