"""When a search that explains nothing ends, and which reading of the data it reports."""

from types import SimpleNamespace

import pytest

from updating.diagnosis.evidence import Search
from updating.diagnosis.evidence.budget import NORMAL
from updating.diagnosis.evidence.diagnosis import _go_on, _most_probable_first


@pytest.mark.parametrize(
    ("short", "hopeless"),
    [
        ([100.0, 99.0], False),  # two effects of one cause may work only together
        ([100.0, 99.0, 97.0], True),  # four more effects of 2 nats leave 89
        ([100.0, 99.0, 74.0], False),  # four more of 25 nats do not
        ([100.0, 60.0, 59.0], False),
        ([12.0, 11.0, 10.0], False),  # the unknown costs 9.2 nats itself
    ],
)
def test_a_search_ends_if_its_rounds_cannot_add_up_to_an_explanation(short, hopeless):
    n_effects = len(short) - 1
    assert Search.is_hopeless(SimpleNamespace(budget=NORMAL), short, n_effects) == hopeless


@pytest.mark.parametrize("explains", [True, False])
def test_a_reading_with_a_fault_is_reported_if_it_leaves_less_of_what_nothing_explains(explains):
    """By its prior odds a fault loses, where the misfit of a model that is wrong counts as noise."""

    def way(score, short):
        search = SimpleNamespace(best=SimpleNamespace(score=score))
        search.explains, search.short_of = (lambda h: explains), (lambda h: short)
        return SimpleNamespace(search=search)

    corrected, as_read = way(3.1, 31.0), way(5.3, 34.0)
    assert _most_probable_first([corrected, as_read])[0] is (as_read if explains else corrected)


@pytest.mark.parametrize(
    ("near", "may_reach", "began"), [(True, 50.0, 1), (True, 200.0, 2), (False, 50.0, 2)]
)
def test_a_second_reading_begins_only_if_it_may_be_better(near, may_reach, began):
    """Two faults of sensors beside an effect: the reading without them took 76 of 127 s, and lost."""
    begun = []

    def way(score, unknown):
        search = SimpleNamespace(
            best=SimpleNamespace(score=score), fits=SimpleNamespace(is_near=lambda h: near)
        )
        search.unknown, search.so_far = (lambda best: unknown), (lambda: "")

        def rounds():
            begun.append(score)
            yield search.best

        search.rounds = rounds
        return SimpleNamespace(search=search)

    _go_on([way(100.0, 90.0), way(20.0, may_reach)], lambda text, share: None)
    assert len(begun) == began
