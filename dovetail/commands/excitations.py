"""What the columns of a table drive: forces at excitations, load cases, and motions of the base."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dovetail.file.histories import Columns
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
    loads : ndarray (n_dof, k)
        Per unit of the columns ``of_loads``.
    of_loads : tuple of int
    base : dict of str to int
        Columns of the base's motions by direction.
    """

    loads: NDArray[np.float64]
    of_loads: tuple[int, ...]
    base: dict[str, int]


def driven_by(study: Study, columns: Columns) -> Driven:
    """Return what columns drive by their names.

    A name is that of an excitation (a force at it), of a load case or combination (times its loads), or
    ``base x`` … ``base rz``.

    Raises
    ------
    StudyError
        For a name that is none of these.
    ModelError
        For a load case that moves supports.
    """
    excitations = {e.name: e for e in study.excitations}
    cases = {c.name: c for c in study.loads.all_cases(study.model)}
    loads: list[NDArray[np.float64]] = []
    of_loads: list[int] = []
    base: dict[str, int] = {}
    for k, name in enumerate(columns.names):
        direction = name.lower().removeprefix(BASE)
        if name.lower() == BASE + direction and direction in DIRECTIONS:
            base[direction] = k
            continue
        if name in excitations:
            loads.append(sensor_rows(study.model, [excitations[name]])[0])
        elif name in cases:
            loads.append(load_vectors(study.model, cases[name])[:, 0])
        else:
            known = [*excitations, *cases, *(BASE + d for d in DIRECTIONS)]
            msg = f"{columns.file}: nothing is called '{name}'; {suggest(name, known)}"
            raise StudyError(msg)
        of_loads.append(k)
    stacked = np.column_stack(loads) if loads else np.zeros((study.model.n_dof, 0))
    return Driven(stacked, tuple(of_loads), base)
