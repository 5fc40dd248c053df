"""Where the search goes on and where it ends, and by which bands it fits, with scores that are given."""

from collections import Counter
from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest

from fem import PointMass
from fem.effects import RigidEndZone, StiffnessLoss, SupportFlexibility, SupportShift
from tests.frames import beam, fix
from updating import FitResult
from updating.diagnosis.evidence import (
    N_STARTS,
    NORMAL,
    QUICK_STEPS,
    SHORT_STEPS,
    Fits,
    ScoredFit,
    Search,
    Start,
    near_to,
)
from updating.diagnosis.evidence import fits as fits_module
from updating.diagnosis.evidence import search as module
from updating.forecast import EffectEstimate
from updating.inference import ALONE
from updating.inference.belief import UNKNOWN_ODDS

CANTILEVER = beam(24).with_effect(fix(0))

ODDS = 8.0
"""What an effect has to gain beyond its score [nats]."""


@dataclass(frozen=True)
class Given:
    """A hypothesis by the letters of its effects."""

    letters: str
    score: float

    @property
    def effects(self):
        return [
            PointMass(name=letter, member=letter, mass=1.0, position=0.5, span=(0, 1))
            for letter in self.letters
        ]

    @property
    def key(self):
        return frozenset(self.letters)

    @property
    def places(self):
        return self.key

    @property
    def name(self):
        return self.letters or "nothing"

    @property
    def fitted(self):
        return SimpleNamespace(level=1.0)

    def at_score(self, score):
        return Given(self.letters, score)


@pytest.fixture
def run(monkeypatch):
    """Return a function that searches over given scores, and tells the best one and what was searched on."""

    def of(scores, unknown, nothing=None, rival=-np.inf, usual=None):
        """Scores by effects; each has those with one effect more as extensions. ``unknown`` is a score.

        ``usual`` is that of the unknown if it left no more than right models usually do.
        That without effects may be found to be better than it was, ``nothing``. Beside another model the best
        one has the score ``rival``.
        """
        known = {frozenset(k): Given(k, s) for k, s in scores.items()}
        went = []

        def extended(self, base, gone):
            went.append(base.name)
            more = [h for h in known.values() if base.key < h.key and len(h.key) == len(base.key) + 1]
            self.known.update({h.key: h for h in more})
            if nothing is not None:
                self.known[frozenset()] = Given("", nothing)
            return [h for h in more if h.key not in gone]

        def full(self, effects, values):
            return self.known.setdefault(frozenset(), known[frozenset()])

        for name, f in {
            "extended": extended,
            "full": full,
            "swapped": lambda self, h: h,
            "with_enriched_basis": lambda self, h: h,
            "unknown": lambda self, h: unknown,
            "suffices": lambda self, h: (unknown if usual is None else usual) < h.score,
            "short_of": lambda self, h: unknown - h.score - ODDS * len(h.letters) + UNKNOWN_ODDS,
        }.items():
            monkeypatch.setattr(Search, name, f)
        search = object.__new__(Search)
        search.known, search.say, search.budget, search.seeds = {}, lambda text: None, NORMAL, ()
        search.promised, search._extended, search.rival_score = {}, set(), rival
        search.fits = SimpleNamespace(floor=1.0, is_far=lambda h: True)
        return search.run().name, went

    return of


def test_the_search_ends_where_nothing_more_pays(run):
    scores = {"": 0.0, "a": 10.0, "ab": 4.0, "abc": 50.0}
    assert run(scores, unknown=-5.0) == ("a", ["nothing", "a"])


def test_it_goes_on_while_the_unknown_is_more_probable(run):
    """Of three effects that explain the data together neither one nor two pay for their odds."""
    scores = {"": 0.0, "a": -3.0, "ab": -5.0, "abc": 50.0}
    best, went = run(scores, unknown=20.0)
    assert best == "abc"
    assert went[:3] == ["nothing", "a", "ab"]


def test_it_goes_on_from_what_leaves_more_than_right_models_usually_do(run):
    """Errors of two sensors left 3.5 times the noise: no more was looked for, and 49 nats were missed."""
    scores = {"": 0.0, "a": -3.0, "ab": 50.0}
    assert run(scores, unknown=-5.0)[0] == "nothing"
    assert run(scores, unknown=-5.0, usual=20.0) == ("ab", ["nothing", "a", "ab"])


def test_it_goes_back_once_from_an_end_that_does_not_explain_the_data(run):
    """A hypothesis with as many effects as there may be is no end while another one has room."""
    many = "abcdefgh"[: NORMAL.most_effects]
    scores = {"": 0.0, "x": -15.0, "xy": 90.0} | {
        many[:n]: 10.0 + n for n in range(1, NORMAL.most_effects + 1)
    }
    best, went = run(scores, unknown=60.0)
    assert best == "xy"
    assert went.index("x") == NORMAL.most_effects
    assert NORMAL.most_back == 1
    hopeless = {"": 0.0, "a": -1.0, "b": -2.0, "c": -3.0, "d": -4.0}
    assert run(hopeless, unknown=60.0) == ("nothing", ["nothing", "a", "b", "c"])


def test_it_ends_after_three_rounds_that_do_not_pay(run):
    scores = {"": 0.0, "a": -1.0, "ab": -2.0, "abc": -3.0, "abcd": -4.0, "abcde": -5.0}
    assert run(scores, unknown=30.0) == ("nothing", ["nothing", "a", "ab"])


@pytest.mark.parametrize(("rival", "went"), [(19.0, ["nothing", "a", "ab"]), (21.0, [])])
def test_it_ends_where_another_model_has_more_than_it_can_find(run, rival, went):
    assert run({"": 0.0, "a": -3.0, "ab": -5.0}, unknown=20.0, rival=rival)[1] == went


def test_it_begins_again_from_a_better_fit_without_effects(run):
    scores = {"": 0.0, "a": 10.0, "ab": 20.0}
    assert run(scores, unknown=-5.0, nothing=12.0) == ("nothing", ["nothing", "nothing"])


@pytest.mark.parametrize(("gain", "simpler"), [(8.0, True), (-3.0, False)])
def test_an_effect_that_does_nothing_gives_way_to_the_fit_without_it(monkeypatch, gain, simpler):
    nothing, found = Given("", 20.0), Given("a", 12.0)
    monkeypatch.setattr(module, "gains_without", lambda *given: np.array([gain]))
    monkeypatch.setattr(Search, "on_few_lines", lambda self, free, h, others: (h, [nothing]))
    monkeypatch.setattr(Search, "full", lambda self, effects, values, near, anew: nothing)
    search = object.__new__(Search)
    search.known, search.say, search._n_fits = {frozenset(): Given("", 5.0)}, lambda text: None, Counter()
    search.fits = SimpleNamespace(free=lambda h: None, odds=None)
    assert search.simplified(found) is (nothing if simpler else found)


@pytest.mark.parametrize(("n", "bands"), [(N_STARTS, [30.0]), (N_STARTS + 1, [10.0, 20.0, 30.0])])
def test_of_many_starts_the_best_are_fitted_band_by_band(monkeypatch, n, bands):
    """Springs of a block are far from their values: in the whole band at once resonances pass each other."""
    fitted = []

    def fit(self, problem, effects, values, stages, **how):
        fitted.append((values, list(stages)))
        return SimpleNamespace(fitted=SimpleNamespace(log_evidence=values, log_likelihood=values))

    monkeypatch.setattr(Fits, "_fit", fit)
    monkeypatch.setattr(fits_module, "with_forces", lambda problem, effects, values: problem)
    quick = SimpleNamespace(stages=(10.0, 20.0, 30.0))
    starts = [Start(k, None) for k in range(n)]
    best = object.__new__(Fits).shortly(quick, (), starts)
    assert [h.fitted.log_evidence for h in best] == list(range(n))[::-1][:N_STARTS]
    assert [stages for _, stages in fitted[-N_STARTS:]] == [bands] * N_STARTS


def test_an_end_of_a_member_is_near_to_what_holds_that_member():
    zone = RigidEndZone(name="zone", ends=(("arm", 1),), length=0.0, longest=0.1)
    shift = SupportShift(name="s", support="S", member="arm", at=0.0, amount=0.0, lower=0.0, upper=0.1)
    assert near_to(zone) & near_to(shift) == {"arm"}


@pytest.mark.parametrize(
    ("far", "explains", "precise", "steps"),
    [
        (True, False, True, SHORT_STEPS),
        (False, True, True, QUICK_STEPS),
        (False, False, True, QUICK_STEPS),
        (False, False, False, SHORT_STEPS),
        (False, True, False, QUICK_STEPS),
    ],
)
def test_near_the_data_first_fits_go_as_far_as_later_ones(monkeypatch, far, explains, precise, steps):
    """There everything else must follow an effect before its score says anything.

    By modes this is so of what explains them: looks say too little of the others.
    """
    asked = []

    def shortly(quick, effects, starts, steps):
        asked.append(steps)
        return []

    search, base = object.__new__(Search), Given("", 0.0)
    search.candidates, search.tell, search.budget, search.workers = (), print, NORMAL, ALONE
    search.fits = SimpleNamespace(
        problems=lambda base: (None, None),
        is_far=lambda base: far,
        ranking=SimpleNamespace(breadth=4, precise_looks=precise),
        shortly=shortly,
    )
    search.known, search.promised = {base.key: base}, {}
    new = module.NextHypotheses(tuple(Given("a", 0.0).effects), [Start({}, None)], 5.0, False)
    monkeypatch.setattr(Search, "proposals", lambda self, base, quick, far, settled: [new])
    monkeypatch.setattr(Search, "settled", lambda self, h: explains)
    monkeypatch.setattr(Search, "suffices", lambda self, h: explains)
    search.from_near(base, SimpleNamespace(far_start=lambda fitted: None), now=0.0, far=far)
    assert asked == [steps]


@pytest.mark.parametrize(
    ("far", "explains", "near", "ways"),
    [
        (True, True, [], ["near its form", "first", "others"]),
        (True, True, ["near its form"], ["near its form"]),
        (True, False, ["first"], ["first"]),
        (True, False, [], ["first", "others"]),
        (False, True, [], ["near its form"]),
    ],
)
def test_a_search_from_afar_ends_where_one_way_leads_to_the_data(monkeypatch, far, explains, near, ways):
    """A bent model that explains the data keeps its form: without, 53 g worth 80 nats were "nothing"."""
    went, base = [], Given("", 0.0)
    search = object.__new__(Search)
    search.fits = SimpleNamespace(
        free=lambda h: None,
        is_far=lambda h: far,
        is_bent=lambda h: far,
        is_near=lambda h: h.name in near,
        quickly=lambda *a: Given("", 0.0),
    )
    search.workers, search.budget, search.known = ALONE, NORMAL, {}

    def tried(name):
        went.append(name)
        return [SimpleNamespace(name=name, score=10.0)]

    def from_afar(self, *a):
        for name in ("first", "others"):
            yield [SimpleNamespace(name=name, score=10.0, cost=0.0)]

    seen = SimpleNamespace(for_look=lambda: "damped")
    monkeypatch.setattr(module, "Damped", SimpleNamespace(of=lambda *a, **k: seen))
    monkeypatch.setattr(module, "_ended", lambda shared, trial: tried(trial.name)[0])
    monkeypatch.setattr(Search, "suffices", lambda self, h: explains)
    monkeypatch.setattr(Search, "from_afar", from_afar)
    monkeypatch.setattr(
        Search, "from_near", lambda self, *a, far: tried("near nominal" if far else "near its form")
    )
    found = search.tried_beside(base, SimpleNamespace(), 0.0, far=far)
    assert [h.name for h in found] == went == ways


@pytest.mark.parametrize(
    ("near", "ended"), [(["third"], ["first", "third"]), ([], ["first", "third", "second"])]
)
def test_what_is_far_behind_on_damped_frfs_is_fitted_last(monkeypatch, near, ended):
    went = []
    search = object.__new__(Search)
    search.fits = SimpleNamespace(is_bent=lambda h: False, is_near=lambda h: h.name in near)
    search.workers = ALONE
    ways = iter([[("first", -400.0), ("second", -300.0)], [("third", -520.0)]])

    def fitted(shared, trial):
        went.append(trial.name)
        return SimpleNamespace(name=trial.name, score=10.0)

    seen = SimpleNamespace(for_look=lambda: "damped")
    monkeypatch.setattr(module, "Damped", SimpleNamespace(of=lambda *a, **k: seen))
    monkeypatch.setattr(module, "_ended", fitted)
    monkeypatch.setattr(Search, "suffices", lambda self, h: False)
    monkeypatch.setattr(
        Search,
        "from_afar",
        lambda self, *a: ([SimpleNamespace(name=n, cost=cost) for n, cost in way] for way in ways),
    )
    search.tried_beside(Given("", 0.0), SimpleNamespace(), 0.0, far=True)
    assert went == ended


@pytest.mark.parametrize(("n", "looks"), [(3, [True]), (200, [False, True])])
def test_where_the_short_list_fails_all_effects_are_looked_at_from_afar(monkeypatch, n, looks):
    """A stiff spring to the ground was not on it, as little of it does something else: "unexplained"."""
    masses = [PointMass(name=str(k), member="arm", position=0.1, mass=1.0) for k in range(n)]
    asked, tried = [], []

    def screened(looked, now, others, listed):
        asked.append(listed(others[0]))
        last = [SimpleNamespace(effect=e, starts=[Start(({},), None)]) for e in reversed(others)]
        return tuple(last if asked[-1] else last[::-1])

    def halved(damped, workers, blocks, singles):
        tried.append([e.name for effects, _ in singles for e in effects])
        return [SimpleNamespace(candidate=c) for c in singles]

    search, base = object.__new__(Search), Given("", 0.0)
    search.candidates, search.tell, search.budget, search.workers = tuple(masses), print, NORMAL, ALONE
    search.places, search.scanned = (), ()
    search.fits = SimpleNamespace(ranking=SimpleNamespace(screened=screened))
    monkeypatch.setattr(Search, "scan", lambda self, now: ())
    monkeypatch.setattr(module, "halved", halved)
    damped = SimpleNamespace(problem=SimpleNamespace(far_start=lambda now: now))
    ways = list(search.from_afar(base, damped, None))
    assert asked == looks
    each = [min(n, module.N_PROMISING), min(n, NORMAL.n_singles)]
    assert [len(names) for names in tried[:-1]] == each * len(looks)
    assert tried[-2][0] == str(n - 1)  # the best of all, not of the short list
    found = [t.candidate[0][0].name for way in ways for t in way]
    assert len(found) == len(set(found))  # each goes on once


def test_what_a_short_fit_did_not_reach_is_no_promise(monkeypatch):
    """Looks promised dampers 16 nats, and fits gained none: reports gave them half of the probability."""
    reached = {"a": -2.0, "b": -4.0}
    fits = SimpleNamespace(
        problems=lambda base: (None, None),
        is_far=lambda base: False,
        ranking=SimpleNamespace(breadth=4, precise_looks=True),
        shortly=lambda quick, effects, starts, steps: [Given(effects[0].name, reached[effects[0].name])],
        continued=lambda quick, short: short[0],
        pruned=lambda quick, h, base: h,
    )
    search, base = object.__new__(Search), Given("", 0.0)
    search.candidates, search.tell, search.budget, search.workers = (), print, NORMAL, ALONE
    search.fits, search.known = fits, {base.key: base}
    looks = {"a": 16.0, "b": 12.0, "c": -50.0}
    search.promised = {frozenset({k}): Given(k, w) for k, w in looks.items()}
    asked = [
        module.NextHypotheses(tuple(Given(k, 0.0).effects), [Start({}, None)] if w > 0 else [], w, False)
        for k, w in looks.items()
    ]
    monkeypatch.setattr(Search, "proposals", lambda self, base, quick, far, settled: asked)
    monkeypatch.setattr(Search, "settled", lambda self, h: True)
    monkeypatch.setattr(Search, "suffices", lambda self, h: True)
    search.from_near(base, SimpleNamespace(), now=0.0, far=False)
    assert {p.effects[0].name: p.score for p in search.promises()} == {**looks, **reached}


@pytest.mark.parametrize(("extended", "promised"), [(False, {"a": -1.0, "b": -2.5}), (True, {})])
def test_candidates_beside_what_explains_the_data_share_the_posterior(monkeypatch, extended, promised):
    """Of a bent model too: "nothing missing" had 99.9 % where the data did not show the hidden effect."""
    gains = {"a": 2.0, "b": 0.5}
    fitted = FitResult(None, {}, {}, np.zeros(0), (), 1.0, 1.0, 0.1, log_evidence=0.0)
    search, base = object.__new__(Search), ScoredFit(fitted, 0.0)
    search.fits = SimpleNamespace(
        free=lambda h: None,
        odds=SimpleNamespace(prior=lambda effects: -3.0 * len(effects)),
        ranking=SimpleNamespace(
            estimates=lambda problem, fitted, effects: [
                EffectEstimate(e, {"mass": 2.0}, {"mass": 0.5}, gains[e.name]) for e in effects
            ],
        ),
    )
    search.known, search.promised = {base.key: base}, {}
    search._extended = {base.key} if extended else set()
    every = [Given(k, 0.0).effects[0] for k in gains]
    monkeypatch.setattr(Search, "compatible_with", lambda self, effects: every)
    search.promise_rest(base)
    assert all(
        p.effects[0].mass == p.fitted.values[p.effects[0].name, "mass"] == 2.0 for p in search.promises()
    )
    assert {p.effects[0].name: p.score for p in search.promises()} == promised


def test_an_effect_may_be_swapped_for_any_other(monkeypatch):
    """From afar the first way to the data is taken: rivals elsewhere were not tried."""
    asked = []

    def rivals(free, last, candidates, n_best):
        asked.append([c.name for c in candidates])
        return ()

    masses = [
        PointMass(name=name, member=member, position=0.1, mass=1.0)
        for name, member in (("found", "arm"), ("near", "arm"), ("alike", "post"))
    ]
    other = RigidEndZone(name="other", ends=(("post", 1),), length=0.0, longest=0.1)
    result = FitResult(None, {}, {}, np.zeros(1), (masses[0],), 0.0, 0.0, 0.0)
    h = SimpleNamespace(
        name="found",
        effects=(masses[0],),
        key=frozenset({"found"}),
        score=1.0,
        fitted=result,
    )
    monkeypatch.setattr(Search, "suffices", lambda self, best: True)
    monkeypatch.setattr(Search, "on_few_lines", lambda self, free, h, others: (h, []))
    search = object.__new__(Search)
    search.budget, search._n_fits, search.tell = NORMAL, Counter(), print
    search.candidates, search.known, search.say = (*masses, other), {h.key: h}, lambda text: None
    search.fits = SimpleNamespace(free=lambda h: None, ranking=SimpleNamespace(rivals=rivals))
    search.workers = ALONE
    assert search.swapped(h) is h
    assert asked == [["near", "alike", "other"]]


def test_springs_side_by_side_at_one_constraint_are_no_hypothesis():
    """Of two feet soft alike and one of them, the second says all where both would add up."""
    both, one, other = (
        SupportFlexibility(name="+".join(feet), supports=feet, direction="rx", stiffness=1e5)
        for feet in (("S1", "S2"), ("S2",), ("S1",))
    )
    given = SimpleNamespace(candidates=(both, one, other))
    assert Search.compatible_with(given, (one,)) == [other]
    assert Search.compatible_with(given, (both,)) == []
    assert Search.compatible_with(given, ()) == [both, one, other]


def test_what_is_alike_at_several_places_is_tried_at_each():
    feet = [
        SupportFlexibility(name=f"{'+'.join(at)}.{axis}", supports=at, direction=axis, stiffness=1e5)
        for at in (("S1", "S2"), ("S1",), ("S2",), ("S3",))
        for axis in ("rx", "ry")
    ]
    given = SimpleNamespace(candidates=feet)
    assert [e.name for e in Search.parts_of(given, feet[0])] == ["S1.rx", "S2.rx"]
    assert Search.parts_of(given, feet[2]) == []


def test_swaps_try_each_of_what_is_alike_and_no_second_spring_at_a_constraint():
    both, one, two, turned = (
        SupportFlexibility(name="+".join(at) + axis, supports=at, direction=axis, stiffness=k)
        for at, axis, k in (
            (("A", "B"), "rx", 3e4),
            (("A",), "rx", 1e5),
            (("B",), "rx", 1e5),
            (("A",), "ry", 2e5),
        )
    )
    asked, tried = [], []
    given = Search.__new__(Search)
    given.budget, given._n_fits, given.tell = NORMAL, Counter(), print
    given.candidates, given.known = (both, one, two, turned), {}
    given.say, given.workers = (lambda text: None), ALONE
    ranking = SimpleNamespace(
        rivals=lambda problem, last, near, n: asked.append({c.name for c in near}) or ()
    )
    given.fits = SimpleNamespace(free=lambda h: None, ranking=ranking)

    def on_few_lines(self, quick, h, others):
        tried.extend(others)
        return h, []

    result = FitResult(*[None] * 8)
    h = SimpleNamespace(
        name="found",
        effects=(both, turned),
        key=frozenset({both.name, turned.name}),
        score=1.0,
        fitted=result,
    )
    given.known = {h.key: h}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module.Search, "on_few_lines", on_few_lines)
        patch.setattr(module.Search, "suffices", lambda self, h: False)
        assert given.swapped(h) is h
    assert asked == [{one.name, two.name}, set()]
    ((effects, values),) = tried
    assert [e.name for e in effects] == [turned.name, one.name, two.name]
    assert [v["stiffness"] for v in values] == [2e5, 3e4, 3e4]


@pytest.mark.parametrize(
    ("scores", "kept"),
    [
        ({"yrz": 10.0, "yr": 4.0, "yz": 3.0, "rz": 2.0, "z": 20.0, "y": 5.0, "r": 5.0}, "z"),
        ({"yrz": 10.0, "yr": 12.0, "yz": 3.0, "rz": 2.0, "y": 5.0, "r": 5.0}, "yr"),
        ({"yrz": 10.0, "yr": 4.0, "yz": 3.0, "rz": 2.0, "z": 9.0, "y": 5.0, "r": 5.0}, "yrz"),
    ],
)
def test_two_springs_that_only_need_each_other_are_left_out_together(monkeypatch, scores, kept):
    """Of a support that seems soft in y and about z: each of both alone is worse than the two."""

    def support(direction):
        return SupportFlexibility(name=direction, supports=("S",), direction=direction, stiffness=1.0)

    def given(letters):
        effects = [support("rz" if c == "r" else c) for c in letters]
        return SimpleNamespace(effects=effects, key=frozenset(letters), score=scores[letters], name=letters)

    def without(self, quick, h, groups):
        gone = [{"r" if n == "rz" else n for n in group} for group in groups]
        return [given("".join(c for c in h.name if c not in g)) for g in gone]

    monkeypatch.setattr(Fits, "_without", without)
    monkeypatch.setattr(fits_module, "left_out", lambda *_: set())
    nothing = SimpleNamespace(effects=[], key=frozenset())
    assert Fits.pruned(Fits(None, (), None, None), None, given("yrz"), nothing).name == kept


@pytest.mark.parametrize(("of_one", "near"), [(1.7, True), (2.6, False)])
def test_a_hypothesis_is_near_the_data_although_one_of_many_values_is_unusual(of_one, near):
    problem = SimpleNamespace(
        data=SimpleNamespace(noise_level=0.02),
        mesh_level=0.0,
        strain=lambda result: 3.4,
        strain_of_one=lambda result: of_one,
    )
    h = SimpleNamespace(fitted=SimpleNamespace(level=0.03), effects=())
    fits = Fits(problem, (), None, None)
    assert fits.is_near(h) is near
    assert fits.is_bent(h)


@pytest.mark.parametrize(("loss", "possible"), [(0.4, True), (0.6, False)])
def test_a_model_with_a_motion_of_negative_stiffness_has_no_probability(monkeypatch, loss, possible):
    """Two losses of one stretch add up: of more than all of its stiffness the data may see nothing."""
    (member,) = CANTILEVER.mesh.members
    losses = [
        replace(StiffnessLoss.propose(CANTILEVER)[0], name=name, loss=loss, position=0.3, member=member)
        for name in "ab"
    ]
    fitted = SimpleNamespace(values={}, effects=tuple(losses), log_evidence=5.0)
    problem = SimpleNamespace(reduced=SimpleNamespace(model=CANTILEVER), stages=())
    monkeypatch.setattr(Fits, "_where_it_is", lambda self, *_, **__: ScoredFit(fitted, 1.0))
    monkeypatch.setattr(Fits, "scattered", lambda self, problem, h: h)
    monkeypatch.setattr(fits_module, "with_forces", lambda problem, *_: problem)
    h = Fits(problem, (), None, None).fully(losses, ())
    assert h.score == (6.0 if possible else -np.inf)
