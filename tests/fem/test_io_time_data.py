"""Time data of WAV, TDMS, text, archives and universal files; files that are cut, uneven or unnamed."""

import re
import sys
import warnings

import numpy as np
import pytest
from scipy.io import savemat, wavfile

from fem.io import G0, Function, TableError, read_time_data, write_uff
from fem.io.time_data import force_unit, motion_unit

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
    with pytest.raises(TableError, match=r"r\.tdms: it is read by nptdms, .*pip install nptdms"):
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


@pytest.mark.parametrize(
    ("heading", "size"),
    [
        ("time_ms", 1e3),
        ("Time ms", 1e3),
        ("ms", 1e3),
        ("Time(milliseconds)", 1e3),
        ("timestamp_us", 1e6),
        ("Zeit [ms]", 1e3),
        ("t/ms", 1e3),
        ("Time [min]", 1 / 60),
        ("elapsed (s)", 1.0),
        ("clock [ms]", 1e3),
    ],
)
def test_times_of_text_in_other_units(tmp_path, heading, size):
    path = text(tmp_path, np.column_stack([size * T, X]), f"{heading};hammer [N];acc [m/s²]\n")
    check(read_time_data(path), ("hammer", "acc"), ("N", "m/s²"))


@pytest.mark.parametrize(
    ("heading", "words"),
    [
        ("Time [V]", "the column 'Time' is in 'V', which is no unit of time"),
        ("time (fortnights)", "is in 'fortnights'"),
        ("sample", "its first column 'sample' rises evenly, and is not called time"),
        ("ramp [N]", "does not say its sample rate"),
    ],
)
def test_a_first_column_that_is_no_time_is_refused(tmp_path, heading, words):
    path = text(tmp_path, np.column_stack([T, X]), f"{heading};hammer [N];acc [g]\n")
    with pytest.raises(TableError, match=re.escape(words)):
        read_time_data(path)


@pytest.mark.parametrize(
    ("first", "form"),
    [
        ("2024-02-28 23:59:59.95", "{}"),
        ("2024-02-29T23:59:59.95", "{}Z"),
        ("2024-03-01T12:00:00", '"{}+01:00"'),
    ],
)
@pytest.mark.parametrize("mark", [",", ";", "\t"])
def test_date_times_are_times(tmp_path, first, form, mark):
    separator = "T" if "T" in first else " "
    stamps = np.datetime64(first, "ns") + (T * 1e9).astype("timedelta64[ns]")
    rows = [
        mark.join([form.format(str(t).replace("T", separator)), f"{a:.12g}", f"{b:.12g}"])
        for t, (a, b) in zip(stamps, X, strict=True)
    ]
    head = mark.join(["time [UTC]", "hammer", "acc"])
    (tmp_path / "r.csv").write_text("\n".join([head, *rows, ""]), encoding="utf-8")
    data = read_time_data(tmp_path / "r.csv")
    assert data.sample_rate == pytest.approx(RATE, rel=1e-6)
    np.testing.assert_allclose(data.values, X, rtol=1e-9)


def test_a_unit_behind_a_name_that_states_its_quantity(tmp_path):
    path = text(tmp_path, np.column_stack([T, X]), "time;force_kN;acc_N\n")
    assert read_time_data(path).units == ("kN", "")
    path = text(tmp_path, np.column_stack([T, X]), "time;load_N;accel2_g\n")
    assert read_time_data(path).units == ("N", "g")


def test_two_columns_of_times_are_aligned(tmp_path):
    table = np.column_stack([T, X[:, 0], T + 3 / RATE, X[:, 1]])
    data = read_time_data(text(tmp_path, table, "time 1;a;time 2;b\n"))
    assert data.channels == ("a", "b")
    np.testing.assert_allclose(data.values, np.column_stack([X[3:, 0], X[:-3, 1]]), rtol=1e-9)
    assert "'b' 0.00585938 s after the first; the 37 samples" in data.notes[0]
    table[:, 2] = T
    assert read_time_data(text(tmp_path, table, "time 1;a;time 2;b\n")).values.shape == (40, 2)
    table[:, 2] = T + 0.4 / RATE
    with pytest.raises(TableError, match=r"'b' starts 0\.4 samples after the first one"):
        read_time_data(text(tmp_path, table, "time 1;a;time 2;b\n"))
    table[:, 2] = 1.1 * T
    with pytest.raises(TableError, match=r"different sample rates, 465\.455 to 512 Hz"):
        read_time_data(text(tmp_path, table, "time 1;a;time 2;b\n"))


@pytest.mark.parametrize(
    "ends", ["1.25;0.5;0.123\n2.5;0.25;0.1", "1;0.5;1.25e-03\n2;0.25;1.25e-0", "1;2;3\n2;3;1.2e"]
)
def test_text_that_is_cut_is_refused(tmp_path, ends):
    (tmp_path / "r.csv").write_text(
        f"time;a;b\n0;0.75;{ends.split(';')[2].split()[0]}\n{ends}", encoding="utf-8"
    )
    with pytest.raises(TableError, match=r"^r\.csv: .*line"):
        read_time_data(tmp_path / "r.csv")


def test_text_whose_last_line_has_no_end_is_read(tmp_path):
    path = text(tmp_path, np.column_stack([T, X]), "Time [s];hammer;acc\n")
    path.write_text(path.read_text(encoding="utf-8").rstrip("\n"), encoding="utf-8")
    check(read_time_data(path), ("hammer", "acc"))


@pytest.mark.parametrize(
    "rate",
    [
        {"time_ms": 1e3 * T},
        {"fs_kHz": RATE / 1e3},
        {"dt_us": 1e6 / RATE},
        {"sample_rate_hz": RATE},
        {"time_hammer": T, "time_acc": T},
    ],
)
def test_rates_and_times_of_arrays_in_other_units(tmp_path, rate):
    np.savez(tmp_path / "r.npz", hammer=X[:, 0], acc=X[:, 1], **rate)
    check(read_time_data(tmp_path / "r.npz"), ("hammer", "acc"))


def test_arrays_with_two_vectors_of_times(tmp_path):
    np.savez(tmp_path / "r.npz", a=X[:, 0], b=X[:, 1], time_a=T, time_b=T + 2 / RATE)
    data = read_time_data(tmp_path / "r.npz")
    np.testing.assert_allclose(data.values, np.column_stack([X[2:, 0], X[:-2, 1]]))
    np.savez(tmp_path / "r.npz", a=X[:, 0], b=X[:, 1], time1=T, time2=T + 2 / RATE)
    with pytest.raises(TableError, match=r"several vectors of times that differ \(time1, time2\)"):
        read_time_data(tmp_path / "r.npz")


def test_times_of_another_length_than_every_array_are_refused(tmp_path):
    savemat(tmp_path / "r.mat", {"t": T[:-1], "x": X})
    with pytest.raises(
        TableError, match=r"no array has as many samples as its times \(t 39\); it has x 40 × 2"
    ):
        read_time_data(tmp_path / "r.mat")


def test_units_of_channels_in_an_array_of_texts(tmp_path):
    texts = {"channels": np.array(["hammer", "acc"]), "units": np.array(["N", "g"])}
    np.savez(tmp_path / "r.npz", fs=RATE, data=X, **texts)
    check(read_time_data(tmp_path / "r.npz"), ("hammer", "acc"), ("N", "g"))


def test_attributes_of_hdf5(tmp_path):
    h5py = pytest.importorskip("h5py")

    def written(**attributes):
        with h5py.File(tmp_path / "r.h5", "w") as file:
            for key, values, unit in (("hammer", X[:, 0], "N"), ("time", 1e3 * T, "ms")):
                file[key] = values
                file[key].attrs["Units"] = unit
            file["hammer"].attrs.update(attributes)
        return read_time_data(tmp_path / "r.h5")

    data = written()
    assert data.sample_rate == pytest.approx(RATE)
    assert data.units == ("N",)
    assert written(scale_factor=1.0, add_offset=0.0).channels == ("hammer",)
    with pytest.raises(TableError, match=r"channel 'hammer' has the attribute scale_factor = 0\.01"):
        written(scale_factor=0.01)
    with pytest.raises(TableError, match="attribute add_offset = 2"):
        written(add_offset=2)


def test_records_of_a_universal_file_that_start_later(tmp_path):
    records = [
        Function(1, f"{k + 1}Z+", "0S", "", "", T + late, X[:, k], 17, 12, 0, "s", "N", "", (), 0, 0, "")
        for k, late in enumerate((0.0, 5 / RATE))
    ]
    write_uff(tmp_path / "r.uff", functions=records)
    data = read_time_data(tmp_path / "r.uff")
    np.testing.assert_allclose(data.values, np.column_stack([X[5:, 0], X[:-5, 1]]))


def test_a_universal_file_with_an_unknown_unit_of_time_is_refused(tmp_path):
    record = Function(1, "1Z+", "0S", "", "", T, X[:, 0], 17, 12, 0, "fortnight", "N", "", (), 0, 0, "")
    write_uff(tmp_path / "r.uff", functions=[record])
    with pytest.raises(TableError, match=r"the abscissa of 1Z\+ is in 'fortnight', which is no unit of time"):
        read_time_data(tmp_path / "r.uff")


def tdms(path, *channels):
    nptdms = pytest.importorskip("nptdms")
    with nptdms.TdmsWriter(path) as writer:
        writer.write_segment(
            [
                nptdms.ChannelObject("g", name, values, {"wf_increment": 1 / RATE} | p)
                for name, values, p in channels
            ]
        )
    return path


@pytest.mark.parametrize(
    ("one", "other", "late"),
    [
        ({}, {"wf_start_offset": 4 / RATE}, 4),
        ({"wf_start_offset": 1.0}, {"wf_start_offset": 1.0}, 0),
        (
            {"wf_start_time": np.datetime64("2024-03-01T12:00:00")},
            {"wf_start_time": np.datetime64("2024-03-01T12:00:00.015625")},
            8,
        ),
    ],
)
def test_channels_of_tdms_that_start_at_different_times_are_aligned(tmp_path, one, other, late):
    data = read_time_data(tdms(tmp_path / "r.tdms", ("a", X[:, 0], one), ("b", X[: 40 - late, 1], other)))
    np.testing.assert_allclose(data.values, np.column_stack([X[late:, 0], X[: 40 - late, 1]]))
    assert bool(data.notes) == (late > 0)


def test_channels_of_tdms_that_cannot_be_aligned_are_refused(tmp_path):
    with pytest.raises(TableError, match=r"'b' starts 0\.5 samples after the first one"):
        read_time_data(
            tdms(tmp_path / "r.tdms", ("a", X[:, 0], {}), ("b", X[:, 1], {"wf_start_offset": 0.5 / RATE}))
        )
    with pytest.raises(TableError, match="no time in common"):
        read_time_data(
            tdms(tmp_path / "r.tdms", ("a", X[:, 0], {}), ("b", X[:, 1], {"wf_start_offset": 9.0}))
        )
    dates = [{"wf_start_time": np.datetime64(f"2024-03-01T12:00:0{k}")} for k in (0, 1)]
    bare = [("a", X[:, 0], dates[0]), ("b", X[:, 1], dates[1]), ("c", X[:, 1], {})]
    with pytest.raises(TableError, match="channel 'c' has no wf_start_time"):
        read_time_data(tdms(tmp_path / "r.tdms", *bare))


def test_scales_and_units_of_tdms(tmp_path):
    data = read_time_data(tdms(tmp_path / "r.tdms", ("a", X[:, 0], {"NI_UnitDescription": "g"})))
    assert data.units == ("g",)
    scale = {"NI_Number_Of_Scales": 1, "NI_Scaling_Status": "unscaled", "NI_Scale[0]_Scale_Type": "Spline"}
    with pytest.raises(TableError, match=r"channel 'a' has the scale 'Spline' \(NI_Scale\[0\]_Scale_Type\)"):
        read_time_data(tdms(tmp_path / "r.tdms", ("a", X[:, 0], scale)))
    step = {"wf_increment": 1e3 / RATE, "wf_xunit_string": "ms"}
    assert read_time_data(tdms(tmp_path / "r.tdms", ("a", X[:, 0], step))).sample_rate == pytest.approx(RATE)
    with pytest.raises(TableError, match="is in 'Hz', which is no unit of time"):
        read_time_data(tdms(tmp_path / "r.tdms", ("a", X[:, 0], {"wf_xunit_string": "Hz"})))


def test_tdms_that_is_cut_anywhere_is_refused(tmp_path):
    nptdms = pytest.importorskip("nptdms")
    with nptdms.TdmsWriter(tmp_path / "r.tdms") as writer:
        for k in range(2):
            writer.write_segment(
                [nptdms.ChannelObject("g", "a", X[20 * k : 20 * k + 20, 0], {"wf_increment": 0.1})]
            )
    raw = (tmp_path / "r.tdms").read_bytes()
    second = raw.index(b"TDSm", 4)
    assert read_time_data(tmp_path / "r.tdms").values.shape == (40, 1)
    for size in (*range(5, second, 7), *range(second + 1, len(raw), 7)):
        (tmp_path / "r.tdms").write_bytes(raw[:size])
        with pytest.raises(TableError, match=r"^r\.tdms: it "):
            read_time_data(tmp_path / "r.tdms")
