"""What the columns of a table drive: forces at excitations, load cases, and motions of the base."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dovetail.file.histories import HistoryColumns
from dovetail.file.table import StudyError, suggest
from dovetail.study import Study
from fem.analysis.statics import load_vectors
from fem.model import DIRECTIONS
from updating.measurement.measurement import sensor_rows

BASE = "base "
"""Begins the name of a column that moves the base, such as ``base z``."""


@dataclass(frozen=True, slots=True, eq=False)
class Driven:
    """Loads and motions of the base that columns of a table drive.

    Attributes
    ----------
    values : ndarray (n, n_names)
        The columns in SI.
    loads : ndarray (n_dof, k)
        Per unit of the columns ``of_loads``.
    of_loads : tuple of int
    base : dict of str to int
        Columns of the base's motions by direction.
    """

    values: NDArray[np.float64]
    loads: NDArray[np.float64]
    of_loads: tuple[int, ...]
    base: dict[str, int]


def driven_by(study: Study, columns: HistoryColumns, density: bool = False) -> Driven:
    """Return what columns drive by their names.

    A name is that of an excitation (a force at it), of a load case or combination (times its loads), or
    ``base x`` … ``base rz``. Columns without a unit are in SI.

    Parameters
    ----------
    study : Study
    columns : Columns
    density : bool
        Whether the columns are densities over Hz.

    Raises
    ------
    StudyError
        For a name that is none of these, and a unit that does not fit what the column drives.
    ModelError
        For a load case that moves supports.
    """
    excitations = {e.name: e for e in study.excitations}
    cases = {c.name: c for c in study.loads.all_cases(study.model)}
    known = [*excitations, *cases, *(BASE + d for d in DIRECTIONS)]
    columns = columns.named(known)
    units: list[str] = []
    loads: list[NDArray[np.float64]] = []
    of_loads: list[int] = []
    base: dict[str, int] = {}
    for k, name in enumerate(columns.names):
        direction = name.lower().removeprefix(BASE)
        if name.lower() == BASE + direction and direction in DIRECTIONS:
            base[direction] = k
            units.append("rad/s^2" if direction.startswith("r") else "m/s^2")
            continue
        if name in excitations:
            units.append(excitations[name].signal_unit)
            loads.append(sensor_rows(study.model, [excitations[name]])[0])
        elif name in cases:
            units.append("1")
            loads.append(load_vectors(study.model, cases[name])[:, 0])
        else:
            msg = f"{columns.file}: nothing is called '{name}'; {suggest(name, known)}"
            raise StudyError(msg)
        of_loads.append(k)
    stacked = np.column_stack(loads) if loads else np.zeros((study.model.n_dof, 0))
    values = [columns.in_si(k, unit, density) for k, unit in enumerate(units)]
    return Driven(np.column_stack(values) if values else columns.values, stacked, tuple(of_loads), base)
