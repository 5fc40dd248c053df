"""What leaves the desk: a study file with the hypothesis in it, and a report of it."""

from pathlib import Path

import numpy as np

from dovetail.disk.output import Output, check_outputs
from dovetail.file.config import Study
from dovetail.file.paths import input_files
from dovetail.found import Reported, reported_text
from fem.io.atomic import replacing
from updating.inference.preparation import fitted_model
from updating.live.engine import LiveModel
from updating.live.hypothesis import Hypothesis


def save_study(study: Study, live: LiveModel, h: Hypothesis, path: Path) -> Path:
    """Write the study with a hypothesis in it, and beside it which values were compared.

    `dovetail compare` with this file prints the errors that the desk shows.

    Parameters
    ----------
    study : Study
    live : LiveModel
    h : Hypothesis
    path : Path
        The study file; the choice of values has its name and ``.npz``.

    Returns
    -------
    Path
        The study file.

    Raises
    ------
    OutputError
        If a file that the study reads would be overwritten.
    """
    compared = path.with_suffix(".npz")
    check_outputs(input_files(study.path), Output("path", path), Output("path", compared))
    result, data = h.result(), live.data_of(h)
    reported = Reported(
        study, live.problem, result, fitted_model(study.model, result), result.effects, h.faults
    )
    text = reported_text(reported, path.parent, compared.name)
    frf = data.measurement.frf
    with replacing(compared) as scratch, scratch.open("wb") as file:
        np.savez_compressed(
            file,
            frequency=frf.frequency,
            outputs=np.array(frf.outputs, dtype=str),
            inputs=np.array(frf.inputs, dtype=str),
            compared=data.mask,
        )
    with replacing(path) as scratch:
        scratch.write_text(text, encoding="utf-8")
    return path
