"""Files that other programs wrote: each is read, or it says in a line why not."""

import json
import warnings
from pathlib import Path

import numpy as np
import pytest
import pyuff

from fem.io import UffError, label_of, parse_label, read_frf, read_uff

SHARED = Path(__file__).resolve().parents[3] / "shared"
EXAMPLES = sorted((SHARED / "data/uff-examples").glob("*.uff"))
CASES = sorted((SHARED / "data/independent-cases").glob("*/*.uff"))
FRAME = SHARED / "data/southampton-frame"

HOLDS = {
    "1858.uff": "nothing that can be read",
    "Artemis export - Geometry RPBC_setup_05_14102016_105117.uff": "74 points, 2 trace lines, 108 elements",
    "MPSTD#Set001_2024_10_08_10_27_07.uff": "4 x time response",
    "Sample_UFF58_ascii.uff": "1 x time response",
    "Sample_UFF58b_bin.uff": "1 x time response",
    "TestLab 161 164 18 15 82.uff": "36 points, 3 trace lines",
    "binary8byte.uff": "1 x time response",
    "heat_engine_housing.uff": "10 points, 8 elements",
    "mesh_Oros-modal_uff15_uff2412.uff": "96 points, 72 elements",
    "non_ascii_header.uff": "1 x frequency response function",
    "sample_dataset58_psd.uff": "1 x power spectral density",
    "simcenter_exported_result.uff": "11520 points, 16688 elements",
    "time-history-not-all-columns-filled.uff": "1 x time response",
    "uff55_translation.uff": "3 mode shapes",
    "uff55_translation_rotation.uff": "1 mode shapes",
}

pytestmark = pytest.mark.shared


def read_quietly(path):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return read_uff(path)


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda p: p.name)
def test_example_is_read_or_refused_in_a_line(path):
    file = read_quietly(path)
    assert file.contents == HOLDS[path.name]
    assert all("\n" not in line for line in file.skipped)
    if file.contents.startswith("nothing"):
        with pytest.raises(UffError, match="no FRFs that can be used"):
            file.frf()


@pytest.mark.parametrize("path", [p for p in EXAMPLES if p.stat().st_size < 2e6], ids=lambda p: p.name)
def test_example_agrees_with_pyuff(path):
    """The files that pyuff's own tests read: the same numbers by both."""
    ours = read_quietly(path)
    sets = pyuff.UFF(str(path)).read_sets()
    sets = [sets] if isinstance(sets, dict) else sets
    functions = [s for s in sets if s["type"] == 58]
    assert len(functions) == len(ours.functions)
    for theirs, one in zip(functions, ours.functions, strict=True):
        np.testing.assert_array_equal(one.values, theirs["data"])
        np.testing.assert_allclose(one.x, theirs["x"], rtol=1e-15)
    for theirs in (s for s in sets if s["type"] in (15, 2411)):
        scale = ours.units.length if ours.units else 1
        np.testing.assert_array_equal(ours.points.labels, theirs["node_nums"])
        np.testing.assert_allclose(ours.points.coordinates[:, 0] * scale, theirs["x"], rtol=1e-15)
    for k, theirs in enumerate(s for s in sets if s["type"] == 55):
        np.testing.assert_array_equal(
            ours.modes[0].shapes[:: len(ours.modes[0].labels) // len(theirs["r1"]), k], theirs["r1"]
        )


def test_a_kind_makes_the_unlabelled_frf_usable():
    path = SHARED / "data/uff-examples/non_ascii_header.uff"
    frf = read_frf(path, kind="accelerance")
    assert (frf.outputs, frf.H.shape) == (("0S",), (6, 1, 1))
    assert frf.H[1, 0, 0] == -5.99924e-02 - 5.53260e-02j


@pytest.mark.parametrize("path", CASES, ids=lambda p: f"{p.parent.name}/{p.stem}")
def test_independent_case_is_read_exactly(path):
    file = read_quietly(path)
    frf = file.frf()
    assert frf.kind == "accelerance"
    assert file.skipped == ()
    reader = pyuff.UFF(str(path))
    kinds = reader.get_set_types()
    assert (kinds == 58).sum() == len(frf.outputs) * len(frf.inputs)
    for k in np.flatnonzero(kinds == 58):
        theirs = reader.read_sets(int(k))
        i = frf.outputs.index(label_of(theirs["rsp_node"], theirs["rsp_dir"]))
        j = frf.inputs.index(label_of(theirs["ref_node"], theirs["ref_dir"]))
        np.testing.assert_array_equal(frf.H[:, i, j], theirs["data"])
        np.testing.assert_allclose(frf.frequency, theirs["x"], rtol=1e-12)


@pytest.mark.parametrize("path", [p for p in CASES if p.stem == "frf"], ids=lambda p: p.parent.name)
def test_labels_lead_to_the_sensors_of_the_study(path):
    nominal = json.loads((path.parent / "nominal.json").read_text())
    file = read_quietly(path)
    found = {parse_label(label) for label in file.frf().outputs}
    for sensor in nominal["sensors"]:
        direction = "xyz".index(sensor["direction"]) + 1
        assert (sensor["node"], direction) in found or (sensor["node"], -direction) in found
        np.testing.assert_allclose(
            file.points.at(sensor["node"]), nominal["points"][str(sensor["node"])], atol=1e-5
        )
    assert file.mesh().n_lines == sum(len(t.strokes[0]) - 1 for t in file.trace_lines)


@pytest.mark.skipif(not FRAME.exists(), reason="needs ../shared/data/southampton-frame")
def test_measured_frame_equals_its_tables():
    frf = read_frf(FRAME / "accelerance_3x3.uff")
    assert frf.outputs == frf.inputs == ("1X+", "2X+", "3X+")
    for j in range(3):
        path = FRAME / f"accelerance_force_floor{j + 1}.csv"
        table = read_frf(path, kind="accelerance", outputs=frf.outputs, inputs=[frf.inputs[j]])
        np.testing.assert_array_equal(table.frequency, frf.frequency)
        np.testing.assert_array_equal(table.H[:, :, 0], frf.H[:, :, j])
