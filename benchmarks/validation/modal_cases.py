"""Cases of measured modes: frequencies with and without shapes, two states, and ambient responses."""

import time
from dataclasses import replace

import numpy as np

from benchmarks.validation.ambient_cases import ambient_targets
from benchmarks.validation.cases import CaseSettings, Implant, frames_that_show, generator, nuisances_of
from benchmarks.validation.frames import Draft, Generator, build_model, n_elements, sensors_of
from benchmarks.validation.judging import Record, are_hidden, evidence_of, heading
from benchmarks.validation.true_modes import ModesError, seen_modes
from benchmarks.validation.truth import TrueFrame
from updating import EFFECT, NOTHING, ModeTargets, diagnose_modes

FREQUENCY_NOISE, SHAPE_NOISE = (0.001, 0.005), (0.02, 0.05)
"""Least and largest relative noise of a frequency, and of a shape's component over its root mean square."""
STATE_WEAKER = 10.0
"""Factor by which changes of state are smaller than single effects [-]."""
STATE_NOISE = 0.1
"""Noise of the frequencies and shapes of two states in parts of that of one: repeats of one set-up [-]."""
MOST_MODES = 12
"""Modes of a test at most."""


def run_modal_case(settings: CaseSettings, set_name: str, index: int) -> Record:
    """Draw a case of a modal set, diagnose it, and judge the answer."""
    rng = generator(settings, set_name, index)
    for draft, truth, implants in frames_that_show(rng, settings, set_name, index, _limited):
        if set_name.startswith("states"):
            implants = tuple(replace(i, amplitude=i.amplitude / STATE_WEAKER) for i in implants)
        try:
            return _judged(settings, set_name, index, draft, truth, implants, rng)
        except ModesError:
            continue
    raise AssertionError  # frames_that_show has raised an error


def _limited(draft: Draft) -> Draft:
    """Return a test with few modes: its band ends where a usual identification does."""
    if draft.n_modes <= MOST_MODES:
        return draft
    f = draft.frequency
    top = f[-1] * MOST_MODES / draft.n_modes
    return replace(draft, n_modes=MOST_MODES, frequency=f[f <= top])


def _judged(
    settings: CaseSettings,
    set_name: str,
    index: int,
    draft: Draft,
    truth: TrueFrame,
    implants: tuple[Implant, ...],
    rng: Generator,
) -> Record:
    changed = truth
    for i in implants:
        changed = i.hidden.change(changed, i.amplitude)
    noise = [float(np.exp(rng.uniform(*np.log(x)))) for x in (FREQUENCY_NOISE, SHAPE_NOISE)]
    if set_name.startswith("states"):
        noise = [STATE_NOISE * x for x in noise]
    with_shapes = not set_name.startswith("frequencies")
    model = build_model(draft.frame, draft.materials, draft.sensors, n_elements(draft.frame))
    nuisances = nuisances_of(settings, draft)
    if set_name.startswith("ambient"):
        after = ambient_targets(changed, draft, rng)
        noise = [float(np.median(after.frequency_std)), float(np.median(after.shape_std))]
    else:
        after = _measured(changed, draft, noise, with_shapes, rng)
    start = time.process_time()
    two = set_name.startswith("states")
    before = _measured(truth, draft, noise, with_shapes, rng) if two else None
    found = diagnose_modes(model, after, nuisances, baseline=before, model_error=0.0)
    cpu = time.process_time() - start
    right = found.verdict == EFFECT and are_hidden(model, implants, found.found)
    if not implants:
        right = found.verdict == NOTHING
    wrong = {EFFECT: "wrong", NOTHING: "not noticed"}.get(found.verdict, "unexplained")
    return {
        **heading((set_name, index), draft, implants, found),
        "modes": after.n,
        "noise": noise,
        "outcome": "right" if right else wrong,
        "cpu_seconds": cpu,
        "evidence": evidence_of(model, implants, found.searched, found, right),
    }


def _measured(
    truth: TrueFrame, draft: Draft, noise: list[float], with_shapes: bool, rng: Generator
) -> ModeTargets:
    """Return the modes in the band as a test would give them."""
    f, phi = seen_modes(truth, draft)
    f = f * (1 + noise[0] * rng.standard_normal(len(f)))
    size = np.sqrt((phi**2).mean(axis=0))
    phi = phi + noise[1] * size * rng.standard_normal(phi.shape)
    if not with_shapes:
        return ModeTargets.of(f, noise[0])
    sensors = sensors_of(draft.frame, draft.sensors)
    return ModeTargets.of(f, noise[0], shapes=phi, shape_std=noise[1], sensors=sensors)
