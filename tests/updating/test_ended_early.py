"""A search that is ended early tells what is known so far."""

import pickle

import pytest

from tests.updating.test_evidence_modes import E, cantilever, measured, with_mass
from updating import diagnose_modes
from updating.diagnosis.verdict import UNFINISHED
from updating.inference.heartbeat import EndEarlyError, Lasting, beat, beating


def told_until(text, told):
    """Return a progress function that ends the work when it is told something that begins with a text."""

    def say(now, done):
        if isinstance(now, Lasting):
            told.append(str(now))
        if now.startswith(text):
            raise EndEarlyError

    return say


def diagnosed(told, until):
    model = cantilever()
    targets = measured(with_mass(model, 0.3, 0.7), shapes=False)
    say = told_until(until, told)
    return diagnose_modes(model, targets, (E,), kinds=["point_mass"], model_error=0.0, progress=say)


def test_a_search_that_is_ended_early_has_the_best_so_far():
    told = []
    found = diagnosed(told, "refining")
    assert found.verdict == UNFINISHED
    assert [e.kind for e in found.found] == ["point_mass"]
    assert "ended early" in found.reason
    assert sum(e.probability for e in found.explanations) == pytest.approx(1.0)
    first, place, *_, last = told
    assert first.startswith("so far: no effect found, error of the natural frequencies ")
    assert place.startswith("so far: the error is explained best by changes at member beam")
    assert last.startswith("so far: point mass at member beam")


def test_a_diagnosis_with_a_progress_function_pickles():
    found = diagnosed([], "none of its texts")
    again = pickle.loads(pickle.dumps(found))
    assert repr(again) == repr(found)
    assert again.searched.evidence == found.searched.evidence


def test_before_anything_is_found_the_places_are_known():
    found = diagnosed([], "so far: the error")
    assert found.verdict == UNFINISHED
    assert found.found == ()
    assert "changes at member beam" in found.reason


def test_what_is_known_is_not_repeated_by_later_beats(monkeypatch):
    monkeypatch.setattr("updating.inference.heartbeat.INTERVAL", -1.0)
    told = []
    with beating(lambda text, done: told.append(text)) as say:
        say("fitting", 0.1)
        say(Lasting("so far: nothing"), 0.1)
        beat()
    assert told == ["fitting", "so far: nothing", "fitting"]


def test_a_diagnosis_by_modes_can_be_ended_at_each_candidate_that_it_looks_at(monkeypatch):
    monkeypatch.setattr("updating.inference.heartbeat.INTERVAL", -1.0)
    model, told = cantilever(), []
    targets = measured(with_mass(model, 0.3, 0.7), shapes=False)
    diagnose_modes(
        model,
        targets,
        (E,),
        kinds=["point_mass"],
        model_error=0.0,
        progress=lambda text, done: told.append(text),
    )
    looks = [text for text in told if text.startswith("looking at")]
    assert len(looks) > 3 * len(set(looks))


def test_the_fraction_done_never_falls():
    told = []
    with beating(lambda text, done: told.append((text, done))) as say:
        for text, done in (("one search", 0.4), ("another search", 0.1), ("concluding", 0.9)):
            say(text, done)
    assert told == [("one search", 0.4), ("another search", 0.4), ("concluding", 0.9)]
