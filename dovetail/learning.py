"""Learning the form from frames that lack nothing: fits of studies, and the file of what they say."""

from collections.abc import Sequence
from pathlib import Path

from dovetail.file.contents import StudyContents
from dovetail.pipeline import fit_settings, measured, without_held_out
from updating.diagnosis.evidence.diagnosis import prepare_search, search_of_problem
from updating.inference.learned_form import FormData, Priors


class NothingLearnedError(ValueError):
    """No frame of which the model explains the data."""


def form_data(study: StudyContents) -> FormData | None:
    """Return what the FRFs of a frame say of its form; None if its model does not explain them.

    Raises
    ------
    StudyError
        If the study has no FRFs.
    """
    data = without_held_out(study, measured(study, phases=False)[0])
    prepared = prepare_search(study.model, data, study.nuisances, **fit_settings(study))
    search = search_of_problem(*prepared, progress=lambda text, done: None).search
    nothing = search.full((), ())
    return FormData.of(search.fits.problem, nothing.fitted) if search.suffices(nothing) else None


def written(priors: Priors, studies: Sequence[Path]) -> str:
    """Return a text in TOML: mean and standard deviation of each parameter."""
    lines = [f"# learned from {', '.join(map(str, studies))}", "# mean, standard deviation"]
    for place in dict.fromkeys(place for place, _ in priors):
        lines += ["", f"[{place}]"]
        of_place = ((key, pair) for (where, key), pair in priors.items() if where == place)
        lines += [f"{key} = [{mean:.4g}, {std:.4g}]" for key, (mean, std) in of_place]
    return "\n".join(lines) + "\n"
