"""FRFs whose responses are strains: their kind, their units, and the files that have them."""

import numpy as np
import pytest

from fem import FRF, FRFError
from fem.io import Asked, read_csv, read_frf, read_frfs, read_uff, write_csv, write_npz, write_uff
from fem.io.frf_labels import Unit, frf_unit
from tests.fem.test_io_uff_meaning import VALUES, read, record, units

STRAIN = (3, "m/m")


def mixed(kind="accelerance", base=()):
    rng = np.random.default_rng(1)
    H = rng.normal(size=(6, 3, 2)) + 1j * rng.normal(size=(6, 3, 2))
    outputs, inputs = ("1Z+", "2X+", "3X+"), ("1Z+", "4Z+")
    return FRF.from_arrays(np.arange(1, 7) * 2.0, H, kind, outputs, inputs, base, ["2X+", "3X+"])


def test_strains_are_the_same_in_every_kind():
    frf = mixed("receptance")
    other = frf.as_kind("accelerance")
    assert (other.H[:, 1:] == frf.H[:, 1:]).all()
    assert other.H[:, 0] == pytest.approx(-(frf.omega[:, None] ** 2) * frf.H[:, 0])
    assert pytest.approx(frf.H) == other.as_kind("receptance").H
    assert other.strain == frf.strain
    only = FRF.from_arrays([0.0, 1.0], np.ones((2, 1, 1)), "accelerance", ["g"], ["f"], strain=["g"])
    assert (only.as_kind("receptance").H == 1).all()  # nothing to integrate at 0 Hz


def test_quantity_and_unit_name_what_there_is():
    frf = mixed(base=["4Z+"])
    assert frf.quantity == "accelerance, transmissibility, strain per force, strain per acceleration"
    assert frf.unit == "(m/s²)/N, -, 1/N, s²/m"
    assert frf.select(["3X+"], ["1Z+"]).unit == "1/N"
    assert frf.select(["1Z+"], ["1Z+"]).strain == ()
    assert frf.is_strain.tolist() == [False, True, True]


def test_a_strain_that_is_no_output_is_refused():
    with pytest.raises(FRFError, match="no output 'x' that could be a strain; the data have a"):
        FRF.from_arrays([1.0], np.ones((1, 1, 1)), "receptance", ["a"], ["f"], strain=["x"])


@pytest.mark.parametrize("suffix", ["npz", "csv", "uff"])
@pytest.mark.parametrize("kind", ["receptance", "accelerance"])
def test_files_say_which_responses_are_strains(tmp_path, suffix, kind):
    path, frf = tmp_path / f"frf.{suffix}", mixed(kind)
    {"npz": write_npz, "csv": write_csv, "uff": write_uff}[suffix](path, frf)
    again = read_frf(path)
    assert (again.kind, again.strain, again.outputs) == (frf.kind, frf.strain, frf.outputs)
    assert pytest.approx(frf.H, rel=1e-11) == again.H


@pytest.mark.parametrize(
    ("label", "factor"),
    [
        ("1/N", 1.0),
        ("strain/N", 1.0),
        ("(m/m)/N", 1.0),
        ("ue/N", 1e-6),
        ("uE/N", 1e-6),
        ("µε/N", 1e-6),
        ("με/kN", 1e-9),
        ("microstrain/N", 1e-6),
        ("um/m/N", 1e-6),
        ("%/lbf", 0.01 / 4.4482216152605),
    ],
)
def test_units_of_strain_per_force_are_known(label, factor):
    unit = frf_unit(label)
    assert unit is not None
    assert unit.kind is None
    assert unit.factor == pytest.approx(factor, rel=1e-12)


def test_motions_per_moment_are_no_strains():
    assert frf_unit("m/(N m)") == Unit(frf_unit("m/N").kind, 1.0)
    assert frf_unit("1/(N m)") is None
    assert frf_unit("rad/N") is None


def test_columns_of_strains_stand_beside_those_of_one_kind(tmp_path):
    path = tmp_path / "frf.csv"
    path.write_text(
        "Frequency [Hz];FRF a/f Real [g/N];FRF a/f Imag [g/N];FRF s/f Real [µε/N];FRF s/f Imag [µε/N]\n"
        "1;1;0;2;-1\n2;1;0;3;-1\n"
    )
    frf = read_csv(path)
    assert (frf.kind, frf.strain) == ("accelerance", ("s",))
    assert frf.H[0, :, 0] == pytest.approx([9.80665, 2e-6 - 1e-6j])
    path.write_text("Frequency [Hz];FRF s/f Real [ue/N];FRF s/f Imag [ue/N]\n1;2;-1\n2;3;-1\n")
    assert read_csv(path).strain == ("s",)
    assert read_frfs(path, Asked("accelerance")).frfs[0].kind == "receptance"


def test_strain_records_of_a_universal_file_join_the_motions(tmp_path):
    parts = [
        units(1e3, 1e3),  # mm and mN
        record(ends=(1, 3, 1, 3)),
        record(ends=(2, 1, 1, 3), y=STRAIN),
        record(ends=(3, 1, 1, 3), y=(3, "uE")),
        record(ends=(4, 1, 1, 3), y=(3, "NONE")),
    ]
    with pytest.warns(UserWarning, match="'uE' and 'N' are multiplied by 1e-06 to SI"):
        (frf,) = read(tmp_path / "a.uff", *parts).frfs
    assert frf.kind == "accelerance"
    assert (frf.outputs, frf.strain) == (("1Z+", "2X+", "3X+", "4X+"), ("2X+", "3X+", "4X+"))
    for k, factor in ((0, 1.0), (1, 1.0), (2, 1e-6), (3, 1.0)):  # labels of units precede dataset 164
        assert frf.H[:, k, 0] == pytest.approx(factor * VALUES)
    bare = [units(1e3, 1e3), record(ends=(4, 1, 1, 3), y=(3, "NONE"), force=(13, "NONE"))]
    with pytest.warns(UserWarning, match="forces by 1000 in FRFs"):
        found = read(tmp_path / "b.uff", *bare)
    assert found.frfs[0].H[:, 0, 0] == pytest.approx(1e3 * VALUES)  # 1/mN


def test_strains_alone_need_no_kind(tmp_path):
    (frf,) = read(tmp_path / "a.uff", record(y=STRAIN)).frfs
    assert (frf.kind, frf.strain, frf.unit) == ("receptance", ("1Z+",), "1/N")


def test_a_motion_and_a_strain_of_one_degree_of_freedom_are_told_apart(tmp_path):
    found = read(tmp_path / "a.uff", record(values=2 * VALUES, y=STRAIN), record())
    (frf,) = found.frfs
    assert set(frf.outputs) == {"1Z+", "1Z+ strain"}
    assert frf.strain == ("1Z+ strain",)
    assert frf["1Z+", "1Z+"] == pytest.approx(VALUES)


def test_unknown_labels_of_strains_are_named(tmp_path):
    found = read_uff_of(tmp_path, record(y=(3, "wombats")))
    assert any("'wombats' is not known for strains" in words for words in found.skipped)


def read_uff_of(folder, *parts):
    (folder / "a.uff").write_text("".join(parts))
    return read_uff(folder / "a.uff")
