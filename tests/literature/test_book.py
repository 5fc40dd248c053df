"""Every number of the benchmark book agrees with its reference as far as the entry states."""

import numpy as np
import pytest

from benchmarks.book.entry import Compared, Quantity, compare, half_digit
from benchmarks.book.shelf import SOURCES

PROBLEMS = {problem.name: problem for source in SOURCES.values() for problem in source.PROBLEMS}


@pytest.mark.parametrize("name", PROBLEMS)
def test_numbers_agree(name):
    for compared in compare(PROBLEMS[name]):
        q, i = compared.quantity, compared.worst
        assert compared.agrees, (
            f"{q.name}: {compared.ours[i]:.9g} beside {compared.quantity.reference[i]:.9g} {q.unit}; "
            f"{q.allowed[i]:.2g} is allowed"
        )


def test_names_differ():
    assert len(PROBLEMS) == sum(len(source.PROBLEMS) for source in SOURCES.values())


def test_digits_state_the_accuracy():
    assert [half_digit(w) for w in ("1.20", "-0.5e-3", "814", "2.6517e-4")] == [0.005, 5e-5, 0.5, 5e-9]


def test_a_wrong_number_of_ours_is_seen():
    q = Quantity(name="f", unit="Hz", printed="10.0 20.00")
    assert Compared(q, np.array([10.05, 20.0])).agrees
    assert not Compared(q, np.array([10.0, 20.006])).agrees


def test_a_printed_number_is_wrong_only_if_it_deviates():
    q = Quantity(name="f", unit="Hz", printed="10.0", exact=lambda: [10.04], proof="none")
    assert not Compared(q, np.array([10.04])).agrees
    q = Quantity(name="f", unit="Hz", printed="10.0", exact=lambda: [11.0], proof="a closed form")
    assert Compared(q, np.array([11.0])).agrees
    assert not Compared(q, np.array([10.0])).agrees


def test_an_allowance_has_a_reason():
    with pytest.raises(ValueError, match="needs a reason"):
        Quantity(name="f", unit="Hz", printed="10.0", allowance=0.1)
