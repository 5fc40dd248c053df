"""How a posterior is judged: credible sets, losses, starts at the truth; and calibration over records."""

import json
from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.validation import run as runner
from benchmarks.validation.calibration import (
    RecordsError,
    as_markdown,
    calibrate,
    main,
    read_records,
    reliability,
    reliability_diagram,
)
from benchmarks.validation.cases import CaseSettings, draw_case
from benchmarks.validation.evidence import Stated, at_truth, credible_set, loss_of
from benchmarks.validation.judging import are_hidden, stated
from updating import propose
from updating.diagnosis.evidence import Searched

SETTINGS = CaseSettings(3, small=True)


def searched(unknown, **probabilities):
    """Return a search that has ended, with hypotheses of some probabilities."""
    known = {n: SimpleNamespace(name=n, score=float(np.log(p))) for n, p in probabilities.items()}
    search = SimpleNamespace(
        known=known, elsewhere=[], promises=list, unknown=lambda best: float(np.log(unknown))
    )
    best = max(known.values(), key=lambda h: h.score)
    return Searched(search, best, (), 0.0, None)


def test_a_credible_set_is_the_fewest_hypotheses_with_nine_tenths():
    done = searched(0.05, a=0.6, b=0.25, c=0.07, d=0.03)
    members = credible_set(done)
    assert [h.name for h, _ in members] == ["a", "b", "c"]  # a and b have 0.85
    assert sum(p for _, p in members) == pytest.approx(0.92)
    alone = credible_set(searched(0.95, a=0.05))
    assert alone[0][0] is None
    assert len(alone) == 1


@pytest.mark.parametrize(
    ("right", "faults_right", "truth", "loss"),
    [
        (True, True, 99.0, "-"),
        (False, True, None, "not in library"),
        (False, True, 10.6, "search loss"),
        (False, True, 10.4, "information loss"),
        (False, True, 2.0, "information loss"),
        (False, False, 99.0, "wrong fault"),
    ],
)
def test_a_truth_that_scores_better_is_lost_by_the_search(right, faults_right, truth, loss):
    assert loss_of(right, faults_right, 10.0, truth) == loss


@pytest.fixture(scope="module")
def soft():
    return draw_case(SETTINGS, "connection", 0)


def fake_search(candidates):
    """Return a search whose fits score by how many effects they have and tell where they began."""
    begun = []

    best = SimpleNamespace(score=0.0)

    def fully(effects, values, near, *, anew):
        assert (near, anew) == (best, True)  # from nominal values and from where the search is
        begun.append({e.name: v for e, v in zip(effects, values, strict=True)})
        return SimpleNamespace(score=float(len(effects)))

    problem = SimpleNamespace(surroundings=lambda key: 1.0)
    fits = SimpleNamespace(problem=problem, fully=fully)
    return SimpleNamespace(candidates=candidates, fits=fits, known={}, best=best), begun


def test_a_soft_connection_is_started_from_all_its_directions_with_their_stiffness(soft):
    search, begun = fake_search(propose(soft.model, test=soft.measurement))
    truth = at_truth(search, [stated(soft.model, soft.implants)])
    assert truth is not None
    wanted = {}
    for implant in soft.implants:
        place, k = implant.hidden.place, implant.hidden.values(implant.amplitude)["stiffness"]
        wanted[f"support_flexibility:{place.support}.{place.direction}"] = {"stiffness": pytest.approx(k)}
    assert begun == [wanted]


def test_what_the_library_lacks_has_no_start_and_nothing_is_a_truth_too(soft):
    search, _ = fake_search([c for c in propose(soft.model) if c.kind != "support_flexibility"])
    assert at_truth(search, [stated(soft.model, soft.implants)]) is None
    search.known[frozenset()] = "nothing"
    assert at_truth(search, [()]) == "nothing"


def test_parameters_that_the_truth_does_not_state_begin_on_the_grid(soft):
    search, begun = fake_search(propose(soft.model, kinds=["stiffness_loss"]))
    member = next(c.member for c in search.candidates)
    at_half = Stated(
        ("stiffness_loss",), lambda e: e.member == member, lambda e: {"position": 0.1, "nonsense": 3.0}
    )
    at_truth(search, [[at_half]])
    values = [next(iter(b.values())) for b in begun]
    assert len(values) > 1
    assert {v["position"] for v in values} == {0.1}
    assert all("nonsense" not in v for v in values)


def test_effects_are_what_is_hidden_only_with_all_directions_and_no_others(soft):
    candidates = propose(soft.model, kinds=["support_flexibility"])
    hidden = {i.hidden.place.direction for i in soft.implants}
    right = [c for c in candidates if c.direction in hidden]
    other = next(c for c in candidates if c.direction not in hidden)
    assert are_hidden(soft.model, soft.implants, right)
    assert not are_hidden(soft.model, soft.implants, right[:1])
    assert not are_hidden(soft.model, soft.implants, [*right, other])
    assert not are_hidden(soft.model, soft.implants, [right[0], right[0]])
    assert not are_hidden(soft.model, soft.implants, ())
    assert are_hidden(soft.model, (), ())


# --------------------------------------------------------------------------------------- calibration


def record(probability, right, *, verdict="effect", loss="information loss", holds=True, place=None, of="a"):
    return {
        "case": "a:0",
        "set": of,
        "cpu_seconds": 3.0,
        "evidence": {
            "verdict": verdict,
            "right": right,
            "in_three": right,
            "probability": probability,
            "sure_and_wrong": verdict != "unexplained" and probability >= 0.9 and not right,
            "place_probability": probability,
            "place_right": place,
            "loss": "-" if right else loss,
            "credible": [{"name": "h", "probability": 0.9, "right": holds}],
            "covered": holds,
        },
    }


def test_answers_are_counted_in_the_bin_of_what_was_stated():
    shares = reliability([0.0, 0.49, 0.5, 0.9, 0.95, 0.989, 0.99, 1.0], [0, 1, 1, 1, 1, 0, 1, 1])
    assert [(s.hits, s.cases) for s in shares] == [(1, 2), (1, 1), (0, 0), (1, 1), (1, 2), (2, 2)]
    assert shares[4].stated == pytest.approx((0.95 + 0.989) / 2)
    assert np.isnan(shares[2].rate)


def test_shares_that_are_aimed_at():
    records = [
        record(0.97, True),
        record(0.92, False, loss="search loss", place=True),
        record(0.99, False, verdict="unexplained", holds=False),
        record(0.95, True, verdict="nothing missing", place=True),
        record(0.4, False, place=False),
        {"case": "a:9", "set": "a", "outcome": "failed"},
    ]
    c = calibrate(records)
    assert (c.sure.hits, c.sure.cases) == (2, 3)  # the unexplained case is never sure
    assert c.sure.stated == pytest.approx((0.97 + 0.92 + 0.95) / 3)
    assert (c.sure_findings.hits, c.sure_findings.cases) == (1, 2)
    assert (c.sure_and_wrong.hits, c.sure_and_wrong.cases) == (1, 5)
    assert (c.coverage.hits, c.coverage.cases) == (4, 5)
    assert (c.attainable.hits, c.attainable.cases) == (2, 3)
    assert [(s.hits, s.cases) for s in c.places] == [(0, 1), (0, 0), (0, 0), (1, 1), (1, 1), (0, 0)]
    text = as_markdown(records)
    assert "| a | 6 | 2 | 2 | 4 | 1 | 1 | 2 | 0 | 0 | 1 | 67 % | 3, 3 |" in text
    assert "| 95-99 % | 2 of 2, 100.0 %" in text


def test_records_of_several_sets_become_tables_and_a_picture(tmp_path, capsys):
    own, other = tmp_path / "own", tmp_path / "foreign"
    own.mkdir()
    lines = [{"settings": {"seed": 3}}, record(0.97, True), record(0.6, False)]
    (own / "cases.jsonl").write_text("".join(json.dumps(r) + "\n" for r in lines))
    other.mkdir()
    (other / "records.jsonl").write_text(json.dumps(record(0.8, True, of="two", place=True)) + "\n")
    out = tmp_path / "pictures" / "reliability.png"
    assert main([str(own), str(other), "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert "| a | 2 | 1 |" in said
    assert "| two | 1 | 1 |" in said
    assert out.read_bytes()[:4] == b"\x89PNG"
    figure = reliability_diagram(calibrate([*read_records(own), *read_records(other)]))
    answers, places = (len([c for c in ax.containers if len(c) == 3]) for ax in figure.axes)
    assert (answers, places) == (3, 1)


def test_records_without_probabilities_are_refused(tmp_path, capsys):
    with pytest.raises(RecordsError, match=r"neither cases\.jsonl nor records\.jsonl"):
        read_records(tmp_path)
    (tmp_path / "cases.jsonl").write_text('{"settings": {}}\n{"case": "single:0", "set": "single"}\n')
    assert main([str(tmp_path)]) == 2
    assert "no record has 'evidence'" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.parametrize("name", ["connection", "connections", "mixed", "mounting"])
def test_a_small_case_of_each_set_ends_and_its_truth_was_within_reach(name):
    settings = CaseSettings(3, small=True)
    made = runner.run_case(settings, (name, 0))
    told = made["evidence"]
    assert told["truth"] is not None
    assert told["right"] == (made["outcome"] == "right")
    assert (told["loss"] == "-") == told["right"]
    assert sum(c["probability"] for c in told["credible"]) >= 0.9
    assert made["cpu_seconds"] > 0
