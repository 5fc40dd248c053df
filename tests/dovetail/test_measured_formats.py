"""A study reads FRFs of MATLAB, HDF5 and analysers' text, in one file or one for each pair."""

import numpy as np
import pytest
from scipy.io import savemat

from dovetail import StudyError
from tests.frames import MAST
from tests.noise import complex_normal
from tests.studies import study_from

STUDY = f"""\
{MAST}
[[sensors]]
name = "s1"
point = [0.0, 0.0, 0.5]
direction = "x"

[[sensors]]
name = "s2"
point = "tip"
direction = "x"

[[excitations]]
sensor = "s2"

[frequency]
stop = 60.0

[[measurements]]
check_units = false
check_phase = false
"""
F = np.linspace(1.0, 50.0, 30)
RNG = np.random.default_rng(2)
H = complex_normal(RNG, (30, 2, 1))


def load(folder, lines):
    return study_from(folder, STUDY + lines)


def text_of(*curves, head=""):
    columns = [F, *(part for c in curves for part in (c.real, c.imag))]
    return head + "".join("\t".join(f"{v:.15g}" for v in row) + "\n" for row in np.column_stack(columns))


def one_file_each(folder):
    for k in (0, 1):
        text = text_of(H[:, k, 0], head="Freq\tReal\tImag\nHz\t(m/s²)/N\t(m/s²)/N\n")
        (folder / f"frf {k + 1}.txt").write_text(text, encoding="utf-8")
    return 'file = ["frf 1.txt", "frf 2.txt"]\n'


def test_arrays_of_matlab_with_axes_in_another_order(tmp_path):
    savemat(tmp_path / "m.mat", {"fr": F, "meas": H.transpose(2, 0, 1)})
    lines = 'file = "m.mat"\nkind = "accelerance"\noutputs = ["s1", "s2"]\ninputs = ["s2"]\n'
    study = load(tmp_path, lines + 'arrays = { frequency = "fr", H = "meas" }\n')
    np.testing.assert_array_equal(study.measurements[0].frf.H, H)
    with pytest.raises(StudyError, match=r"line \d+, measurements\[1\]\.file: m\.mat: no array has a usual"):
        load(tmp_path, lines)


def test_one_file_for_each_pair(tmp_path):
    files = one_file_each(tmp_path)
    study = load(tmp_path, files + 'pairs = ["s1/s2", "s2/s2"]\n')
    np.testing.assert_allclose(study.measurements[0].frf.H, H, rtol=1e-12)
    assert study.measurements[0].name == "frf 1.txt"
    with pytest.raises(StudyError, match=r"frf 2\.txt: out1/in1 is in frf 1\.txt, too; give pairs"):
        load(tmp_path, files)
    with pytest.raises(StudyError, match=r"1 pairs are given for 2 files"):
        load(tmp_path, files + 'pairs = ["s1/s2"]\n')
    (tmp_path / "frf 2.txt").write_text(
        text_of(H[:, 1, 0]).replace("\n", "\n", 1).split("\n", 1)[1], encoding="utf-8"
    )
    with pytest.raises(StudyError, match=r"frf 2\.txt: .*(same lines|one kind|kind)"):
        load(tmp_path, files + 'kind = "accelerance"\npairs = ["s1/s2", "s2/s2"]\n')
    with pytest.raises(StudyError, match=r"there is no file '.*none\.txt'"):
        load(tmp_path, 'file = ["frf 1.txt", "none.txt"]\n')
    with pytest.raises(StudyError, match="a file name, or a list of file names"):
        load(tmp_path, "file = []\n")


def test_columns_by_the_names_of_the_file(tmp_path):
    text = text_of(H[:, 1, 0], H[:, 0, 0], head="Hz\tCh 7 Re\tCh 7 Im\tCh 3 Re\tCh 3 Im\n")
    (tmp_path / "m.txt").write_text(text, encoding="utf-8")
    lines = 'file = "m.txt"\nkind = "accelerance"\n'
    study = load(tmp_path, lines + '[measurements.pairs]\n"Ch 3 Re" = "s1/s2"\n"Ch 7 Re" = "s2/s2"\n')
    np.testing.assert_allclose(study.measurements[0].frf.H, H, rtol=1e-12)


def test_keys_that_a_format_does_not_use_are_refused(tmp_path):
    np.savez(tmp_path / "m.npz", frequency=F, H=H, outputs=["s1", "s2"], inputs=["s2"], kind="accelerance")
    with pytest.raises(StudyError, match=r"delimiter: it is not used for m\.npz, .* read as a NumPy archive"):
        load(tmp_path, 'file = "m.npz"\ndelimiter = ";"\n')


def test_coherence_and_averages_of_an_archive_give_the_noise(tmp_path):
    gamma = RNG.uniform(0.5, 1.0, H.shape)
    np.savez(
        tmp_path / "m.npz",
        frequency=F,
        H=H,
        outputs=["s1", "s2"],
        inputs=["s2"],
        kind="accelerance",
        coherence=gamma,
        averages=8,
    )
    found = load(tmp_path, 'file = "m.npz"\nband = [2.0, 40.0]\n').measurements[0]
    keep = (F >= 2) & (F <= 40)
    np.testing.assert_array_equal(found.coherence, gamma[keep])
    assert found.averages == 8
    assert load(tmp_path, 'file = "m.npz"\naverages = 5\n').measurements[0].averages == 5
