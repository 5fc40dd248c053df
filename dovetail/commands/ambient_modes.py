"""``dovetail identify-modes`` of responses to unknown forces: identify, draw, write and print."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from dovetail.commands.answer import Answer
from dovetail.commands.common import Options, noted, write_with_nodes
from dovetail.commands.labels import NodeNumbers
from dovetail.disk.output import OutputError, Progress
from dovetail.file.ambient import AmbientChannels, read_channels
from dovetail.file.table import StudyError
from dovetail.report.table import Column, Table
from dovetail.study import Study
from fem.io import UFF_SUFFIXES, write_npz
from fem.io.arrays import MODE_STD
from updating.ambient.ambient_modes import AmbientModes, unexplained_words
from updating.ambient.identification import identify_ambient
from updating.ambient.set_ups import MergedModes, merge_set_ups
from updating.modal.identified_modes import IdentifiedModes

Values = Sequence[Any] | np.ndarray
NULLS = {
    "shape": "no set-up with the mode has the channel",
    "shape_std": "no set-up with the mode has the channel",
    "frequency_scatter": "the mode is in one set-up alone",
    "mac_of_set_ups": "the mode is in one set-up alone, or set-ups share fewer than two channels with it",
}
"""Why numbers are missing."""


def std_of(found: AmbientModes | MergedModes | IdentifiedModes) -> dict[str, np.ndarray]:
    """Return relative standard deviations as a file with modes has them [-].

    Exact data have deviations of zero, and modes without damping no relative one: these are left out.
    """
    frequency, shape = found.relative_std()
    zeta = np.zeros(found.modes.n_modes) if found.modes.zeta is None else np.abs(found.modes.zeta)
    of_zeta = np.divide(found.zeta_std, zeta, out=np.zeros(zeta.shape), where=zeta > 0)
    every = dict(zip(MODE_STD, (frequency, of_zeta, shape), strict=True))
    return {key: std for key, std in every.items() if np.isfinite(std).all() and (std > 0).all()}


def identify_ambient_modes(options: Options, study: Study, progress: Progress) -> Answer:
    """Return the modes in a study's ambient responses with their uncertainty; draw and write them."""
    if study.ambient is None:
        msg = f"{study.path}: it has no [ambient]; --ambient needs the time data of an ambient test"
        raise StudyError(msg)
    for given, name in ((options.synthesis, "--synthesis"), (options.measurement, "--measurement")):
        if given is not None:
            msg = f"{name} is for FRFs; the modes are identified from time data, {study.ambient.name}"
            raise OutputError(msg)
    progress("reading")
    test = study.ambient
    data = read_channels(test)
    band = None if options.band is None else (options.band[0], options.band[1])
    set_ups = []
    for k, each in enumerate(data):
        progress("identifying modes", 0.2 + 0.7 * k / len(data))
        names = tuple(s.name for s in each.sensors)
        with test.table.at("file"):
            set_ups.append(
                identify_ambient(each.values, each.sample_rate, names, band or test.band or study.band)
            )
    with test.table.at("file"):
        found = set_ups[0] if len(set_ups) == 1 else merge_set_ups(set_ups)
    _write(options, study, found, data)
    if options.picture is not None:
        progress("drawing", 0.9)
        _draw(options.picture, set_ups, [path.name for path in test.paths])
    cycles = found.duration * float(found.modes.frequency.min(initial=np.inf))
    parts = "" if len(set_ups) == 1 else f"{len(set_ups)} set-ups, "
    table = table_of_modes(found, **_quality(found))
    return Answer(
        study,
        [
            f"{study.name}: {found.modes.n_modes} mode(s) identified from {test.name}, {parts}"
            f"{len(found.modes.labels)} channels, {found.duration:.4g} s"
            + (f" or {cycles:.3g} periods of the lowest mode" if np.isfinite(cycles) else ""),
            found.table(),
            *noted(*(each.notes for each in data)),
            *_key_lines(options, found),
        ],
        _as_json(study, found, data) | {"modes": table.records()},
        NULLS,
        sheets=[table],
    )


def table_of_modes(found: AmbientModes | MergedModes | IdentifiedModes, **quality: Values) -> Table:
    """Return identified modes with standard deviations, and values of their quality by key, for files."""
    zeta = np.zeros(found.modes.n_modes) if found.modes.zeta is None else found.modes.zeta
    return Table.of(
        "identified modes",
        Column("frequency", found.modes.frequency, "Hz", key="frequency_Hz"),
        Column("std of frequency", found.frequency_std, "Hz", key="frequency_std_Hz"),
        Column("damping", zeta, "%", scale=100, key="damping_ratio"),
        Column("std of damping", found.zeta_std, "%", scale=100, key="damping_ratio_std"),
        *(
            Column(key, values, key=key, places=() if key == "set_ups" else ("file",))
            for key, values in quality.items()
        ),
        Column("", list(found.modes.shapes.T), key="shape", places=()),
        Column("", list(found.shape_std.T), key="shape_std", places=()),
    )


def _draw(path: Path, set_ups: Sequence[AmbientModes], names: Sequence[str]) -> None:
    """Draw each set-up; of several each has its file as heading, and its number in the picture's name."""
    from viz.modal import plot_ambient
    from viz.style import save

    for k, (found, name) in enumerate(zip(set_ups, names, strict=True), 1):
        file = path if len(set_ups) == 1 else path.with_stem(f"{path.stem}-{k}")
        save(plot_ambient(found, name if len(set_ups) > 1 else ""), file)


def _write(
    options: Options, study: Study, found: AmbientModes | MergedModes, data: Sequence[AmbientChannels]
) -> None:
    """Write the modes as a study's [modes] reads them."""
    if options.out is None:
        return
    if options.out.suffix.lower() == ".npz":
        write_npz(options.out, found.modes, std_of(found))
        return
    nodes = NodeNumbers(study)
    by_name = {s.name: s for each in data for s in each.sensors}
    sensors = tuple(by_name[name] for name in found.modes.labels)
    names = dict(zip(found.modes.labels, nodes.labels("outputs", sensors), strict=True))
    write_with_nodes(options.out, nodes, modes=found.modes, dofs=names)


def _key_lines(options: Options, found: AmbientModes | MergedModes) -> tuple[str, ...]:
    """Return the table of a study that reads the modes; universal files hold no standard deviations."""
    if options.out is None or not found.modes.n_modes:
        return ()
    lines = ["in a study:", "  [modes]", f'  file = "{options.out.name}"']
    if options.out.suffix.lower() in UFF_SUFFIXES:
        for key, values in std_of(found).items():
            lines.append(f"  {key} = [{', '.join(f'{v:.3g}' for v in values)}]")
    return tuple(lines)


def _as_json(
    study: Study, found: AmbientModes | MergedModes, data: Sequence[AmbientChannels]
) -> dict[str, object]:
    set_ups: tuple[AmbientModes, ...] = found.set_ups if isinstance(found, MergedModes) else (found,)
    warnings = found.unexplained if isinstance(found, MergedModes) else unexplained_words(found.unexplained)
    peaks = [p for s in set_ups for p in s.unexplained]
    return {
        "record": None if study.ambient is None else study.ambient.name,
        "duration_s": found.duration,
        "band_Hz": next(iter(set_ups)).band,
        "order": [s.order for s in set_ups] if isinstance(found, MergedModes) else found.order,
        "outputs": found.modes.labels,
        "scaled": False,
        "unexplained_peaks": [{"frequency_Hz": p.frequency, "rise_dB": p.rise_db} for p in peaks],
        "notes": [text for each in data for text in each.notes],
        "warnings": (*warnings, *study.warnings),
    }


def _quality(found: AmbientModes | MergedModes) -> dict[str, Values]:
    """Return how well each mode's shape and its parts agree."""
    if isinstance(found, MergedModes):
        numbers = [{str(s + 1): mode + 1 for s, mode in each.items()} for each in found.members]
        return {
            "set_ups": numbers,
            "frequency_scatter": found.scatter,
            "mac_of_set_ups": found.agreement,
        }
    return {"mpc": found.mpc, "mpd_deg": found.mpd, "spectra_mac": found.spectra_mac}
