"""Processes that compute side by side."""

import os
from types import MappingProxyType

import numpy as np
import pytest
import scipy.sparse as sp

from fem.lengths import length_text, metres_afterwards, show_lengths
from fem.linalg.solvers import factorise
from updating.inference import Workers, cores
from updating.inference.workers import workers


def solved(shared, load):
    """Return what a shared factor and a shared mapping make of a load, and the process that did it."""
    factor, weights = shared
    return weights["x"] * factor.solve(load), os.getpid()


def dies(shared, here):
    """End the process, unless it is the one named."""
    if os.getpid() != here:
        os._exit(1)
    return shared + here


@pytest.fixture(scope="module")
def shared():
    matrix = sp.diags_array([[-1.0] * 39, [2.5] * 40, [-1.0] * 39], offsets=[-1, 0, 1]).tocsc()
    return factorise(matrix), MappingProxyType({"x": 2.0})


def test_other_processes_give_the_same_in_the_same_order(shared):
    loads = [np.eye(40)[k] for k in range(6)]
    expected = [x for x, _ in Workers().map(solved, shared, loads)]
    with workers(2) as crew:
        found = crew.map(solved, shared, loads)
        assert os.getpid() not in {process for _, process in found}
        np.testing.assert_allclose([x for x, _ in found], expected, rtol=1e-13)
        # A process that was stopped from outside costs time, not the result.
        assert crew.map(dies, 1, [os.getpid(), os.getpid()]) == [1 + os.getpid()] * 2
        assert crew.pool is None


def worded(_, length):
    """Return a length in words, and the process that worded it."""
    return length_text(length), os.getpid()


def test_texts_of_other_processes_have_the_unit_of_this_one():
    with metres_afterwards():
        show_lengths(0.001)
        with workers(2) as crew:
            found = crew.map(worded, None, [0.6, 0.8])
    assert [text for text, _ in found] == ["600 mm", "800 mm"]
    assert os.getpid() not in {process for _, process in found}


def test_one_process_is_this_one(shared):
    with workers(1) as crew:
        (_, process), *_ = crew.map(solved, shared, [np.ones(40)] * 2)
    assert process == os.getpid()
    assert cores() >= 1
