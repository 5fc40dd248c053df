"""Frames of OpenSees on a table and over a reference: noise is left of them where nothing is hidden."""

import json

import pytest

from benchmarks.independent.convert import convert
from dovetail import load_study
from tests.peers.interpreter import run_peers
from tests.studies import fit_problem
from updating import assessed_fit

pytestmark = [pytest.mark.peer, pytest.mark.slow]


@pytest.mark.parametrize("name", ["table-mast-nothing", "reference-bay-nothing"])
def test_no_more_than_noise_is_left_of_one_with_nothing_hidden(tmp_path, name):
    run_peers("-m", "benchmarks.independent.base_motion", str(tmp_path), name)
    case, study = tmp_path / name, tmp_path / "study.toml"
    nominal = json.loads((case / "nominal.json").read_text(encoding="utf-8"))
    study.write_text(convert(nominal, case, study), encoding="utf-8")
    loaded = load_study(study)
    assert loaded.measurements[0].frf.quantity == "transmissibility"
    problem = fit_problem(loaded)
    assert assessed_fit(problem).fit_db < 1.6 * problem.data.noise_db
