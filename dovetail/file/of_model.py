"""A study of a model that was built in Python, with the tables of a study file that say how to judge it."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from dovetail.file.channel_errors import read_channel_errors
from dovetail.file.contents import StudyContents
from dovetail.file.fit_table import read_fit
from dovetail.file.measured_modes import ModalTest, match_modes, read_raw_modes
from dovetail.file.plausible import implausible
from dovetail.file.sensors import Channel
from dovetail.file.settings import (
    read_candidates,
    read_frequency,
    read_relevant,
    with_stated_form,
)
from dovetail.file.table import Source, StudyTable
from dovetail.file.uncertain import read_uncertain, with_shear
from fem.model import Model
from updating.measurement.measurement import Measurement, Sensor, sensor_rows, with_sensor_masses

TABLES = ("modes", "uncertain", "candidates", "fit", "form", "frequency", "relevant", "channel_errors")
"""Tables of a study file that do not describe the structure or where files are."""


def _plain(value: Any) -> Any:
    """Return a value with lists and dictionaries for arrays, tuples and mappings, as TOML has them."""
    if isinstance(value, Mapping):
        return {str(key): _plain(one) for key, one in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    return [_plain(one) for one in value] if isinstance(value, list | tuple) else value


def contents_of_model(
    model: Model,
    measurements: Sequence[Measurement],
    sensors: Sequence[Sensor],
    excitations: Sequence[Sensor],
    name: str,
    tables: Mapping[str, Any],
) -> StudyContents:
    """Return a study of a model as it is: its mesh is not refined, and sensors sit at its points.

    Parameters
    ----------
    model : Model
    measurements : sequence of Measurement
    sensors, excitations : sequence of Sensor
        Beside those of the measurements.
    name : str
    tables : mapping
        By name, some of ``TABLES``, as the study file has them.

    Raises
    ------
    StudyError
        For an unknown table or key, and a value that cannot be meant.
    MeasurementError
        If a sensor or excitation is at no point of the mesh.
    """
    notes: list[str] = []
    measured_notes: list[str] = []
    top = StudyTable(Source(name, {}), (), _plain(tables))
    for key in TABLES:
        top.get(key, None)
    top.finish()
    ends = tuple(
        tuple({s.name: s for s in (*own, *(s for m in measurements for s in getattr(m, key)))}.values())
        for key, own in (("sensors", sensors), ("excitations", excitations))
    )
    model = with_sensor_masses(model, [*ends[0], *ends[1]])
    outputs, inputs = ([Channel(s, top) for s in group] for group in ends)
    fit = read_fit(top, outputs, inputs, measured_notes)
    raw_modes = read_raw_modes(top, Path(), measured_notes)
    modes = match_modes(raw_modes, ModalTest(outputs, inputs, not measurements), measured_notes)
    tops = [float(m.frf.frequency[-1]) for m in measurements]
    tops += [] if modes is None else [float(modes.modes.frequency.max())]
    highest = None if not tops else max(tops) if fit.band is None else min(fit.band[1], max(tops))
    frequency, highest = read_frequency(top, highest, notes)
    kinds, exclude, environment, belief = read_candidates(top)
    model = with_shear(top, model).in_environment(*environment)
    model = with_stated_form(top, model.with_belief(belief), Path(), form=fit.model_error > 0)
    for group in ends:
        sensor_rows(model, [s for s in group if not s.moves_base])
    errors = read_channel_errors(top, ends[0], ends[1])
    spreads: list[str] = []
    nuisances, damping_std = read_uncertain(top, model, spreads)
    odd = implausible(top, model, highest)
    lengths = model.mesh.lengths()
    return StudyContents(
        name=name,
        description="",
        path=Path(name),
        text="",
        model=model,
        measurements=tuple(replace(m, errors=errors) for m in measurements),
        sensors=ends[0],
        excitations=ends[1],
        nuisances=nuisances,
        damping_std=damping_std,
        kinds=kinds,
        exclude=exclude,
        **fit.contents,
        frequency=frequency,
        max_frequency=highest,
        element_size=(float(lengths.min(initial=np.inf)), float(lengths.max(initial=0.0))),
        assumptions=(*notes, *spreads),
        assumed_spreads=tuple(spreads),
        modes=modes,
        warnings=odd,
        implausible=odd,
        relevant=read_relevant(top),
        channel_errors=errors,
        measured_notes=tuple(measured_notes),
    )
