"""From a model and measured modes, of one state or of two, to the posterior over what is missing."""

import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from fem.linalg.solvers import one_thread
from fem.model import Effect, Model, ModelError
from updating.diagnosis.baseline import calibrate, judged
from updating.diagnosis.candidates import situated
from updating.diagnosis.evidence.diagnosis import search_progress
from updating.diagnosis.evidence.mode_ranking import ModeRanking
from updating.diagnosis.evidence.search import Search
from updating.diagnosis.mode_diagnosis import (
    Baseline,
    ModeDiagnosis,
    candidates_for,
    concluded,
    searched_modes,
)
from updating.diagnosis.states import change_since
from updating.inference.defaults import EXPLAINED_LEVEL
from updating.inference.formed import formed_mode_problem
from updating.inference.heartbeat import Progress, beating
from updating.inference.mode_fit import BAD_PRIOR
from updating.inference.mode_targets import ModeTargets
from updating.inference.parameters import Nuisance


@one_thread()
def diagnose_modes(
    model: Model,
    targets: ModeTargets,
    nuisances: Sequence[Nuisance] = (),
    *,
    damping_std: float = 0.5,
    kinds: Sequence[str] | None = None,
    exclude: Sequence[str] = (),
    model_error: float = EXPLAINED_LEVEL,
    baseline: ModeTargets | Baseline | None = None,
    changes: Sequence[Effect] = (),
    known: Sequence[Effect] = (),
    progress: Progress | None = None,
) -> ModeDiagnosis:
    """Find what a model lacks by measured natural frequencies, damping and shapes.

    With a ``baseline``, measured in an earlier state, it finds what has changed since then. Uncertain
    parameters have one value in both states: what the first state leaves uncertain of it varies in all fits
    to the second one.

    The search, the priors and the posterior are those of
    :func:`updating.diagnosis.diagnose.diagnose`.

    Parameters
    ----------
    model : Model
        With a point of the mesh at every sensor; in the first state, if there are two.
    targets : ModeTargets
    nuisances : sequence of Nuisance
    damping_std : float
        Standard deviation of the logarithm of damping ratios [-].
    kinds, exclude : sequence of str, optional
        Kinds of candidates.
    model_error : float
        Level up to which a model of beams counts as right, as for FRFs [nepers]; 0 for a right form.
    baseline : ModeTargets or Baseline, optional
        Modes of an earlier state, or what it says of the model; the latter was fitted with nuisances of its
        own.
    changes : sequence of Effect
        Effects that are known to have come since then; the model has none of them.
    known : sequence of Effect
        Effects that the earlier state is known to have; the model has none of them. Their values are fitted.
    progress : callable, optional
        Called with a text and the fraction done.

    Raises
    ------
    ModelError
        If changes or known effects are stated without the modes of an earlier state.
    """
    if (changes and baseline is None) or (known and not isinstance(baseline, ModeTargets)):
        msg = "changes are those since an earlier state, and known effects its own: baseline=…"
        raise ModelError(msg)
    start_time = time.perf_counter()
    model = situated(model, kinds)
    more: dict[str, Any] = {"damping_std": damping_std, "model_error": model_error}
    with beating(progress or (lambda text, done: None)) as say:
        if baseline is None:
            say("reducing the model", 0.0)
            problem, made = formed_mode_problem(model, targets, nuisances, **more)
            problem = replace(problem, bad_prior=BAD_PRIOR)
            say("fitting the uncertain parameters", 0.05)
            candidates = candidates_for(made.model, targets, kinds, exclude)
            tell = search_progress(say, start_time)
            search = Search(problem, made.form, candidates, tell, ranking=ModeRanking())
            found = concluded(searched_modes(search, made.formed, say))
        else:
            if isinstance(baseline, ModeTargets):
                say("calibrating on the first state", 0.0)
                first = calibrate(model, baseline, nuisances, known=known, **more)
                baseline = (
                    Baseline(first, (first,), np.zeros(1))
                    if known
                    else judged(first, kinds, exclude, say=say)
                )
            found = change_since(baseline, targets, changes, kinds=kinds, exclude=exclude, say=say, **more)
    return replace(found, seconds=time.perf_counter() - start_time)
