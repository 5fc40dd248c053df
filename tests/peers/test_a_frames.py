"""A-frames of OpenSees: what is left of them is noise once shear coefficients are uncertain, too."""

import json
import re

import numpy as np
import pytest

from benchmarks.independent.convert import convert
from dovetail import load_study
from tests.conftest import ROOT
from tests.peers.interpreter import run_peers
from tests.studies import fit_problem
from updating import assessed_fit

pytestmark = [pytest.mark.peer, pytest.mark.slow]
SHARED = ROOT.parent / "shared" / "data" / "independent-cases" / "truth.json"

FREQUENCIES = """
from benchmarks.independent.a_frames import Hidden, Mesh, free_motions, matrices_of
from scipy.linalg import eigvalsh
import json, math
out = []
for hidden in (Hidden(), Hidden(hinge=("R1_12", "ry", 1e9))):
    mesh = Mesh(hidden)
    K, M, _ = matrices_of(mesh, hidden)
    B = free_motions(mesh, hidden, K)
    squared = eigvalsh(B.T @ K @ B, B.T @ M @ B, subset_by_index=[0, 4])
    out.append([math.sqrt(x) / (2 * math.pi) for x in squared])
print(json.dumps(out))
"""


def test_it_is_the_shared_structure():
    plain, hinged = json.loads(run_peers("-c", FREQUENCIES).stdout.splitlines()[0])
    np.testing.assert_allclose(hinged, plain, rtol=1e-5)
    if not SHARED.exists():
        pytest.skip("the shared cases are not there")
    truth = json.loads(SHARED.read_text(encoding="utf-8"))["a-frame-nothing-missing"]
    np.testing.assert_allclose(plain, truth["f_first5"], rtol=1e-3)


def test_no_more_than_noise_is_left_of_one_with_nothing_hidden(tmp_path):
    run_peers("-m", "benchmarks.independent.a_frames", str(tmp_path), "a-frame-nothing")
    case, study = tmp_path / "a-frame-nothing", tmp_path / "study.toml"
    nominal = json.loads((case / "nominal.json").read_text(encoding="utf-8"))
    text = convert(nominal, case, study)
    left = []
    for more in ("", "shear = 0\n"):
        study.write_text(re.sub(r"(\[uncertain\].*\n)", rf"\g<1>{more}", text), encoding="utf-8")
        problem = fit_problem(load_study(study))
        left.append(assessed_fit(problem).fit_db)
    noise = problem.data.noise_db
    assert left[0] < 1.2 * noise  # 0.52 of 0.47 dB
    assert left[1] > 1.7 * noise  # 0.94
