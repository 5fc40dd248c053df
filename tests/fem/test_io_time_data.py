"""Time data of WAV, TDMS, text, archives and universal files; files that are cut, uneven or unnamed."""

import sys
import warnings

import numpy as np
import pytest
from scipy.io import savemat, wavfile

from fem.io import TableError
from fem.io.time_data import force_unit, motion_unit, read_time_data
from fem.io.uff import Function, write_uff
from fem.io.uff_units import G0

RATE = 512.0
T = np.arange(40) / RATE
X = np.random.default_rng(5).uniform(-0.9, 0.9, (40, 2))


def text(folder, table, head="", mark=";", decimal="."):
    lines = (mark.join(f"{v:.12g}".replace(".", decimal) for v in row) for row in table)
    (folder / "r.csv").write_text(head + "\n".join(lines) + "\n", encoding="utf-8")
    return folder / "r.csv"


def check(data, names, units=("", ""), rtol=1e-9):
    assert data.sample_rate == pytest.approx(RATE, rel=1e-9)
    assert data.channels == names
    assert data.units == units
    np.testing.assert_allclose(data.values, X, rtol=rtol, atol=rtol)


@pytest.mark.parametrize(("mark", "decimal"), [(";", ","), (",", "."), ("\t", ".")])
@pytest.mark.parametrize(
    "head",
    [
        "Time [s];hammer [N];acc [m/s²]\n",
        "Recorded\n\nTime;hammer;acc\ns;N;m/s²\n",
        "t (s);hammer (N);acc (m/s²)\n",
    ],
)
def test_text_with_time_names_and_units(tmp_path, head, mark, decimal):
    path = text(tmp_path, np.column_stack([T, X]), head.replace(";", mark), mark, decimal)
    check(read_time_data(path), ("hammer", "acc"), ("N", "m/s²"))


def test_text_without_a_header(tmp_path):
    check(read_time_data(text(tmp_path, np.column_stack([T, X]))), ("ch1", "ch2"))
    check(read_time_data(text(tmp_path, X), RATE), ("ch1", "ch2"))
    with pytest.raises(TableError, match=r"r\.csv: it does not say its sample rate; give it"):
        read_time_data(text(tmp_path, X))


@pytest.mark.parametrize(("digits", "rate"), [(6, 2048.0), (5, 204.8), (4, 25.6), (9, 51_200.0)])
def test_times_that_a_program_has_rounded_follow_evenly(tmp_path, digits, rate):
    t = np.arange(int(12 * rate)) / rate
    rows = [f"{v:.{digits}g},{k % 7}" for k, v in enumerate(t)]
    (tmp_path / "r.csv").write_text("Time [s],acc\n" + "\n".join(rows), encoding="utf-8")
    found = read_time_data(tmp_path / "r.csv")
    assert found.sample_rate == pytest.approx(rate, rel=10.0 ** (1 - digits))


@pytest.mark.parametrize("share", [0.05, 0.2])
def test_samples_that_jitter_are_not_taken_for_rounded_ones(tmp_path, share):
    t = np.arange(400) / 204.8
    t[1:-1] += share / 204.8 * np.random.default_rng(1).uniform(-1, 1, 398)
    rows = [f"{v:.9f},0" for v in t]
    (tmp_path / "r.csv").write_text("Time [s],acc\n" + "\n".join(rows), encoding="utf-8")
    with pytest.raises(TableError, match="do not follow evenly"):
        read_time_data(tmp_path / "r.csv")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda t: np.delete(t, 20, axis=0), r"do not follow evenly: .* follows .* \(sample 21\)"),
        (lambda t: t[np.r_[0:20, 19, 20:40]], "do not follow evenly"),
        (lambda t: np.where(t == t[7, 1], np.nan, t), "line 9, column 2 has a value that is not finite"),
    ],
    ids=["a gap", "a line twice", "not a number"],
)
def test_samples_that_do_not_follow_evenly_are_refused(tmp_path, change, words):
    with pytest.raises(TableError, match=rf"^r\.csv: .*{words}"):
        read_time_data(text(tmp_path, change(np.column_stack([T, X])), "Time;a;b\n"))


@pytest.mark.parametrize("dtype", ["int16", "int32", "uint8", "float32"])
def test_wav_in_parts_of_its_full_scale(tmp_path, dtype):
    size = {"int16": 2**15, "int32": 2**31, "uint8": 128, "float32": 1}[dtype]
    values = X * size + (128 if dtype == "uint8" else 0)
    values = values.astype(dtype) if dtype == "float32" else np.round(values).astype(dtype)
    wavfile.write(tmp_path / "r.wav", int(RATE), values)
    data = read_time_data(tmp_path / "r.wav")
    np.testing.assert_allclose(data.values, X, atol=0.5 / size + 1e-7)
    assert (data.sample_rate, data.channels) == (RATE, ("ch1", "ch2"))
    assert data.full_scale == (None if dtype == "float32" else 1.0)


@pytest.mark.parametrize("length", [20, 44, 60, 100])
def test_wav_that_was_cut_short_is_refused(tmp_path, length):
    wavfile.write(tmp_path / "r.wav", int(RATE), X.astype("float32"))
    (tmp_path / "r.wav").write_bytes((tmp_path / "r.wav").read_bytes()[:length])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(TableError, match=r"^r\.wav: it "):
            read_time_data(tmp_path / "r.wav")


@pytest.mark.parametrize("rate", [{"fs": RATE}, {"dt": 1 / RATE}, {"time": T}, {"t": T}])
def test_arrays_with_a_rate_a_step_or_times(tmp_path, rate):
    np.savez(tmp_path / "r.npz", hammer=X[:, 0], acc=X[:, 1], **rate)
    check(read_time_data(tmp_path / "r.npz"), ("hammer", "acc"))
    savemat(tmp_path / "r.mat", {"data": X.T, "channels": np.array(["hammer", "acc"], dtype=object), **rate})
    check(read_time_data(tmp_path / "r.mat"), ("hammer", "acc"))


def test_arrays_that_do_not_fit_are_refused(tmp_path):
    np.savez(tmp_path / "r.npz", a=X[:, 0], b=X[:, 1])
    with pytest.raises(TableError, match="does not say its sample rate"):
        read_time_data(tmp_path / "r.npz")
    np.savez(tmp_path / "r.npz", fs=RATE, name="text")
    with pytest.raises(TableError, match="it has no arrays of samples; it has fs, name"):
        read_time_data(tmp_path / "r.npz")
    np.savez(tmp_path / "r.npz", fs=RATE, a=np.where(X[:, 0] == X[3, 0], np.nan, X[:, 0]))
    with pytest.raises(TableError, match="sample 4 of channel 'a' is not finite, 1 in all"):
        read_time_data(tmp_path / "r.npz")


def test_time_responses_of_a_universal_file(tmp_path):
    records = [
        Function(1, f"{k + 1}Z+", "0S", "", "", T, X[:, k], 17, 12, 0, "s", unit, "", (), 0, 0, "")
        for k, unit in enumerate(("N", "g"))
    ]
    write_uff(tmp_path / "r.uff", functions=records)
    check(read_time_data(tmp_path / "r.uff"), ("1Z+", "2Z+"), ("N", "g"))


def test_tdms(tmp_path):
    nptdms = pytest.importorskip("nptdms")

    def write(*channels):
        with nptdms.TdmsWriter(tmp_path / "r.tdms") as writer:
            writer.write_segment([nptdms.ChannelObject("g", *c) for c in channels])
        return tmp_path / "r.tdms"

    own = {"wf_increment": 1 / RATE}
    path = write(
        ("hammer", X[:, 0], own | {"unit_string": "N"}), ("acc", X[:, 1], own | {"unit_string": "g"})
    )
    check(read_time_data(path), ("hammer", "acc"), ("N", "g"))
    raw = path.read_bytes()
    for part in (0.02, 0.3):
        path.write_bytes(raw[: int(part * len(raw))])
        with pytest.raises(TableError, match=r"^r\.tdms: it "):
            read_time_data(path)
    with pytest.raises(TableError, match="different numbers of samples"):
        read_time_data(write(("a", X[:, 0], own), ("b", X[:20, 1], own)))
    with pytest.raises(TableError, match="different sample steps"):
        read_time_data(write(("a", X[:, 0], own), ("b", X[:, 1], {"wf_increment": 2 / RATE})))
    with pytest.raises(TableError, match="does not say its sample rate"):
        read_time_data(write(("a", X[:, 0], {})))


def test_without_nptdms_the_extra_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "nptdms", None)
    (tmp_path / "r.tdms").write_bytes(b"TDSm")
    with pytest.raises(TableError, match=r"r\.tdms: it is read by nptdms, .*pip install 'dovetail\[tdms\]'"):
        read_time_data(tmp_path / "r.tdms")


def test_an_unknown_file_lists_what_is_read(tmp_path):
    (tmp_path / "r.mp3").write_bytes(b"ID3")
    with pytest.raises(TableError, match=r"\.wav \(WAV\); \.tdms .*not '\.mp3'"):
        read_time_data(tmp_path / "r.mp3")


def test_units_of_channels():
    assert force_unit("kN") == 1000
    assert force_unit("g") is None
    assert motion_unit("g") == ("accelerance", G0)
    assert motion_unit("mm/s") == ("mobility", 1e-3)
    assert motion_unit("µm") == ("receptance", pytest.approx(1e-6))
    assert motion_unit("V") is None
    assert motion_unit("") is None
