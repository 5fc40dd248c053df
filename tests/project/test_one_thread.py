"""Public functions that compute much with small matrices keep BLAS to one thread."""

import inspect

import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from fem.analysis.campbell import solve_campbell
from fem.analysis.complex_modes import solve_complex_modes
from fem.linalg.solvers import one_thread
from updating import (
    build_mode_problem,
    build_problem,
    diagnose,
    diagnose_modes,
    identify_ambient,
    identify_modes,
    locate,
    plan_test,
    update,
)
from updating.diagnosis.evidence.diagnosis import prepare_search, search_of_problem
from updating.inference.fitting import fit, fit_given
from updating.plan.choose import choose
from updating.plan.plan import plan_from_search, with_averages


class ReadError(Exception):
    """The function has read an argument, with so many threads."""


def threads():
    return {lib["filepath"]: lib["num_threads"] for lib in threadpool_info() if lib["user_api"] == "blas"}


class Probe:
    """An argument that tells how many threads BLAS has when it is first read."""

    def _read(self, *_):
        raise ReadError(threads())

    __getattr__ = __getitem__ = __len__ = __iter__ = __array__ = __float__ = __bool__ = _read
    __eq__ = __lt__ = __le__ = __gt__ = __ge__ = _read


@pytest.mark.parametrize(
    "function",
    [
        build_mode_problem, build_problem, choose, diagnose, diagnose_modes, fit, fit_given, identify_ambient,
        identify_modes, locate, plan_from_search, plan_test, prepare_search, search_of_problem,
        solve_campbell, solve_complex_modes, update, with_averages,
    ],
    ids=lambda function: function.__name__,
)  # fmt: skip
def test_a_function_begins_with_one_thread(function):
    needed = inspect.Parameter.empty
    every = inspect.signature(function).parameters.values()
    required = [p for p in every if p.default is needed or p.name == "H"]  # without H, an FRF is needed
    positional = [Probe() for p in required if p.kind is p.POSITIONAL_OR_KEYWORD]
    by_name = {p.name: Probe() for p in required if p.kind is p.KEYWORD_ONLY}
    with threadpool_limits(2, "blas"):
        if 1 in threads().values():
            pytest.skip("BLAS has one thread on this machine")
        before = threads()
        with one_thread():
            expected = threads()  # a BLAS that another program has loaded keeps its number
        assert 1 in expected.values()
        with pytest.raises(ReadError) as read:
            function(*positional, **by_name)
        assert threads() == before
    assert read.value.args == (expected,)
