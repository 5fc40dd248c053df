"""FRFs among the arrays of MATLAB and HDF5 files: names, parts, axes, units, and files that are damaged."""

import os
import signal
import sys

import h5py
import numpy as np
import pytest
from scipy.io import savemat

from fem.io import G0, Asked, TableError, read_frf, read_frfs
from fem.io.mat_hdf5 import end_of_trial, read_hdf5
from tests.noise import complex_normal

RNG = np.random.default_rng(4)
F = np.linspace(1.0, 40.0, 12)
H = complex_normal(RNG, (12, 3, 2))
OUT, IN = ("a", "b", "c"), ("p", "q")


def mat(folder, **arrays):
    savemat(folder / "m.mat", arrays)
    return folder / "m.mat"


def mat73(folder, **arrays):
    """Write a file as MATLAB 7.3 does: HDF5 behind 512 bytes, axes reversed, complex numbers as pairs."""
    path = folder / "m.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, value in arrays.items():
            array = np.atleast_2d(value)
            if np.iscomplexobj(array):
                pairs = np.empty(array.T.shape, dtype=[("real", "f8"), ("imag", "f8")])
                pairs["real"], pairs["imag"] = array.T.real, array.T.imag
                file[name] = pairs
            elif array.dtype.kind == "U":
                file[name] = np.array([[ord(c)] for c in str(array[0, 0])], dtype="u2")
                file[name].attrs["MATLAB_class"] = np.bytes_("char")
                continue
            else:
                file[name] = array.T
            file[name].attrs["MATLAB_class"] = np.bytes_("double")
    raw = bytearray(path.read_bytes())
    raw[:19] = b"MATLAB 7.3 MAT-file"
    path.write_bytes(bytes(raw))
    return path


def read(path, **asked):
    asked.setdefault("kind", "mobility")
    return read_frfs(path, Asked(**asked))


@pytest.mark.parametrize("write", [mat, mat73])
@pytest.mark.parametrize("order", [(0, 1, 2), (1, 2, 0), (2, 1, 0), (2, 0, 1)])
def test_sizes_tell_the_order_of_axes(tmp_path, write, order):
    path = write(tmp_path, freq=F, FRF=H.transpose(order))
    for asked in ({"outputs": OUT}, {"inputs": IN}, {"outputs": OUT, "inputs": IN}):
        np.testing.assert_array_equal(read(path, **asked).frfs[0].H, H)
    axes = tuple(("frequency", "output", "input")[k] for k in order)
    np.testing.assert_array_equal(read(path, axes=axes).frfs[0].H, H)


SQUARE = np.concatenate([H, H[:, :, :1]], axis=2)


@pytest.mark.parametrize(
    ("arrays", "asked", "words"),
    [
        ({"f": F, "H": SQUARE}, {}, r"shape \(12, 3, 3\).*do not tell responses from forces.*axes = "),
        ({"f": F, "H": SQUARE}, {"outputs": OUT}, "do not tell responses from forces"),
        ({"f": F, "H": H}, {}, "do not tell responses from forces"),
        ({"f": F[:3], "H": H[:3]}, {"outputs": OUT}, "2 axes of it have the 3 frequencies; give the order"),
        ({"f": F[:5], "H": H}, {}, "no axis of it has the 5 frequencies"),
        ({"f": F, "H": H}, {"outputs": ("a", "b", "c", "d")}, "do not fit"),
        (
            {"f": F, "H": H[:, :, 0]},
            {"outputs": ("a", "b")},
            "3 FRFs at each frequency do not fit 2 responses",
        ),
        (
            {"f": F, "H": H},
            {"axes": ("frequency", "input", "output"), "outputs": OUT},
            "axis output has 2 values",
        ),
        ({"f": F, "H": H}, {"axes": ("output", "input")}, "one of frequency, output, input for each axis"),
        ({"f": F, "H": H, "FRF": H}, {}, r"the arrays H, FRF could each be the H; state it"),
        ({"x": F, "H": H}, {}, r"no array has a usual name of frequencies .*it has x \(1, 12\), H"),
        ({"f": F, "y": H}, {}, "no array has a usual name of FRFs"),
        ({"f": F, "H": H}, {"arrays": {"H": "G"}}, "there is no array 'G' for H"),
        ({"f": F, "H": H}, {"arrays": {"frf": "H"}}, "arrays has the key 'frf'; allowed are frequency, H"),
        ({"f": F[::-1], "H": H}, {"outputs": OUT}, "frequencies must increase strictly"),
        ({"f": F, "H": np.where(H[3, 1, 0] == H, np.nan, H)}, {"outputs": OUT}, "1 FRF value.*not finite"),
        ({"f": F, "re": H.real, "im": H.imag[:, :2]}, {}, "must be real and of one shape"),
        ({"f": F, "mag": H.real}, {}, "real with negative values"),
        ({"f": F, "mag": abs(H), "phase": np.angle(H)}, {"outputs": OUT}, "are degrees or radians"),
        ({"f": F, "H": H}, {"kind": None, "outputs": OUT}, "does not say the kind"),
        ({"f": F, "H": H}, {"kind": "impedance", "outputs": OUT}, "the FRF kind is 'impedance'"),
        ({"f": H, "H": H}, {}, "a list of real frequencies is needed"),
    ],
)
def test_what_arrays_do_not_tell_is_refused(tmp_path, arrays, asked, words):
    with pytest.raises(TableError, match=rf"^m\.mat: .*(?:{words})"):
        read(mat(tmp_path, **arrays), **asked)


@pytest.mark.parametrize(
    "arrays",
    [
        {"f": F, "H_real": H.real, "H_imag": H.imag},
        {"f": F, "mag": abs(H), "phase_rad": np.angle(H)},
        {"f": F, "mag": abs(H), "phase": np.rad2deg(np.angle(H))},
        {"f": F, "mag_dB": 20 * np.log10(abs(H)), "phase_deg": np.rad2deg(np.angle(H))},
        {"omega": 2 * np.pi * F, "Mobility": H},
        {"data": {"freq": F, "FRF": H, "note": "by hand"}},
    ],
    ids=["parts", "radians", "degrees", "levels", "rad/s and a kind's name", "a structure"],
)
def test_parts_and_names(tmp_path, arrays):
    reading = read(mat(tmp_path, **arrays), outputs=OUT)
    np.testing.assert_allclose(reading.frfs[0].H, H, rtol=1e-12)
    np.testing.assert_allclose(reading.frfs[0].frequency, F)
    assert any("are taken" in note for note in reading.notes)


def test_stated_arrays_go_before_usual_names(tmp_path):
    path = mat(tmp_path, f=F, H=H, x=2 * F, run2=2 * H)
    frf = read(path, arrays={"frequency": "x", "H": "run2"}, outputs=OUT).frfs[0]
    np.testing.assert_array_equal(frf.H, 2 * H)
    np.testing.assert_array_equal(frf.frequency, 2 * F)


def test_labels_and_coherence_of_the_file(tmp_path):
    gamma = RNG.uniform(size=H.shape)
    texts = np.array(OUT, dtype=object)
    reading = read(
        mat(tmp_path, f=F, H=H.transpose(2, 1, 0), outputs=texts, coherence=gamma.transpose(2, 1, 0))
    )
    assert reading.frfs[0].outputs == OUT
    np.testing.assert_array_equal(reading.coherence, gamma)


def test_amplitudes_alone_have_no_phase(tmp_path):
    reading = read(mat(tmp_path, f=F, H=abs(H)), outputs=OUT)
    assert not reading.phase
    np.testing.assert_allclose(reading.frfs[0].H, abs(H))
    with pytest.raises(TableError, match="amplitudes without phase"):
        read_frf(tmp_path / "m.mat", kind="mobility", outputs=OUT)


def test_hdf5_by_labelled_axes_and_units(tmp_path):
    path = tmp_path / "m.h5"
    with h5py.File(path, "w") as file:
        file["run/frf"] = SQUARE.transpose(1, 0, 2)  # square: sizes alone could not tell
        file["run/frf"].attrs["units"] = "g/N"
        file["frequency"] = F / 1e3
        file["frequency"].attrs["units"] = "kHz"
        file["output"] = np.array(OUT, dtype=h5py.string_dtype())
        for axis, name in ((0, "output"), (1, "frequency")):
            file[name].make_scale(name)
            file["run/frf"].dims[axis].attach_scale(file[name])
        file["run/frf"].dims[2].label = "input"
    reading = read_frfs(path, Asked())
    frf = reading.frfs[0]
    assert (frf.kind, frf.outputs) == ("accelerance", OUT)
    np.testing.assert_allclose(frf.H, G0 * SQUARE)
    np.testing.assert_allclose(frf.frequency, F)
    assert reading.axes == (("kHz",),)
    with pytest.raises(TableError, match="has the unit 'g/N', that of accelerance, and kind is mobility"):
        read_frfs(path, Asked("mobility"))
    np.testing.assert_array_equal(read_frfs(path, Asked("mobility", unit_labels=False)).frfs[0].H, SQUARE)


@pytest.mark.parametrize("write", [mat, mat73])
@pytest.mark.parametrize("part", [0.05, 0.3, 0.6, 0.95])
def test_files_that_were_cut_short_are_refused(tmp_path, write, part):
    path = write(tmp_path, f=F, H=H)
    raw = path.read_bytes()
    path.write_bytes(raw[: int(part * len(raw))])
    with pytest.raises(TableError, match=r"^m\.mat: "):
        read(path, outputs=OUT)


def test_no_damage_to_a_matlab_file_ends_otherwise_than_by_a_message(tmp_path):
    """Sizes that a damaged file states reach beyond its end; SciPy's reader ends the process on some."""
    raw = mat(tmp_path, f=F, H=H, outputs=np.array(OUT, dtype=object), s={"note": "x"}).read_bytes()
    rng, refused = np.random.default_rng(1), 0
    for _ in range(100):
        damaged = bytearray(raw)
        for at in rng.integers(128, len(raw), 3):
            damaged[at] = rng.integers(256)
        (tmp_path / "m.mat").write_bytes(bytes(damaged))
        try:
            read(tmp_path / "m.mat", outputs=OUT)
        except TableError:
            refused += 1
    assert refused > 5


def test_without_h5py_the_extra_is_named(tmp_path, monkeypatch):
    path = mat73(tmp_path, f=F, H=H)
    monkeypatch.setitem(sys.modules, "h5py", None)
    with pytest.raises(TableError, match=r"m\.mat: it is read by h5py, .*pip install h5py"):
        read(path)


def test_the_error_for_an_unknown_file_lists_what_is_read(tmp_path):
    (tmp_path / "m.xls").write_bytes(b"\xd0\xcf\x11\xe0")
    with pytest.raises(
        TableError, match=r"\.uff, .*\(universal file\).*\.npz .*\.h5.*\.mat .*\.csv.*not '\.xls'"
    ):
        read(tmp_path / "m.xls")


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
def test_a_file_that_ends_the_library_is_refused(tmp_path, monkeypatch):
    """libhdf5 frees memory twice on some damaged files, which ends the process (benchmarks.fuzz, hdf5)."""
    assert end_of_trial(lambda: None) is None
    assert end_of_trial(lambda: {}["key"]) is None
    path = tmp_path / "f.h5"
    with h5py.File(path, "w") as file:
        file["f"] = np.arange(3.0)
    monkeypatch.setattr("fem.io.mat_hdf5._arrays", lambda h5py, path: os.kill(os.getpid(), signal.SIGABRT))
    with pytest.raises(TableError, match=r"f\.h5: .* damaged \(the library ends with SIGABRT\)"):
        read_hdf5(path)


def test_an_array_larger_than_its_file_can_hold_is_refused(tmp_path):
    path = tmp_path / "f.h5"
    with h5py.File(path, "w") as file:
        file.create_dataset("H", shape=(10**12,), chunks=(1000,), dtype="f8")
    with pytest.raises(TableError, match="H would have 8000000000000 bytes, too many for the file"):
        read_hdf5(path)
