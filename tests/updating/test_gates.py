"""Noise from coherence and repeats, and force levels, from a study's files to the gates of its diagnosis."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.hidden.cases import make_case
from dovetail import StudyError, load_study
from fem import FRF
from fem.io import Function, read_uff, write_uff
from tests.studies import study_file
from updating import Fault, MeasurementError, Reciprocity, assessed_fit, build_problem, check_gates
from updating.diagnosis import force_levels
from updating.measurement import at_values_of
from updating.quality import reciprocity_check, with_last_faults

AVERAGES = 25


@pytest.fixture(scope="module")
def sound():
    """A case with nothing hidden: 12 sensors, 2 forces."""
    return make_case(5)


def noisy(frf, sigma, seed, n=1):
    """Return n copies of FRFs with noise of σ in each part, relative."""
    g = np.random.default_rng(seed).standard_normal((n, 2, *frf.H.shape)) * sigma
    return [replace(frf, H=frf.H * (1 + a + 1j * b)) for a, b in g]


def test_noise_of_a_measurement_follows_its_lines_and_channels(sound):
    frf = sound.measurement.frf
    coherence = np.linspace(0.5, 1, frf.H.size).reshape(frf.H.shape)
    m = replace(sound.measurement, coherence=coherence, averages=AVERAGES)
    np.testing.assert_allclose(m.noise, np.sqrt((1 - coherence) / (2 * AVERAGES * coherence)))
    assert m.noise_source == "the coherence over 25 averages"
    some = frf.select(frf.outputs[3:1:-1], frf.inputs[1:], lines=np.arange(5, 50, 3))
    np.testing.assert_array_equal(m.with_frf(some).coherence, coherence[5:50:3, 3:1:-1, 1:])
    other = FRF.from_arrays(some.frequency + 1e-3, some.H, some.kind, some.outputs, some.inputs)
    assert np.isnan(at_values_of(coherence, frf, other)).all()
    known = replace(m, scatter=np.full(frf.H.shape, 0.02))
    assert known.noise_source == "the scatter of repeats"
    assert (known.noise == 0.02).all()
    with pytest.raises(MeasurementError, match=r"runs from .* to 1\.5; 0 to 1 is allowed"):
        replace(m, coherence=coherence * 1.5)
    with pytest.raises(MeasurementError, match="shape"):
        replace(m, coherence=coherence[1:])
    with pytest.raises(MeasurementError, match="a standard deviation is at least 0"):
        replace(m, scatter=np.full(frf.H.shape, -0.02))


def test_noise_from_coherence_weighs_the_fit_and_is_named_by_the_gate(sound):
    """γ² of 0.2 over 25 averages is a noise of √(0.8/10) = 0.28, above what is compared at all."""
    coherence = np.full(sound.measurement.frf.H.shape, 0.999)
    coherence[:, 2] = 0.2
    coherence[:, 3] = np.nan
    m = replace(sound.measurement, coherence=coherence, averages=AVERAGES)
    problem = build_problem(sound.model, m, sound.nuisances)
    bare = build_problem(sound.model, sound.measurement, sound.nuisances)
    assert not problem.data.mask[:, 2].any()
    np.testing.assert_array_equal(problem.data.noise[:, 3], bare.data.noise[:, 3])
    np.testing.assert_allclose(problem.data.noise[:, 0], np.sqrt(0.001 / (2 * AVERAGES * 0.999)))
    gate = check_gates(problem, assessed_fit(problem)).checks[0]
    assert "the coherence over 25 averages" in gate.found
    noise = replace(m, coherence=np.full(coherence.shape, 0.2))
    with pytest.raises(MeasurementError, match=r"no FRF .* uncertain by more than 20 % .* 25 averages"):
        build_problem(sound.model, noise, sound.nuisances)
    few = m.with_frf(m.frf.select(lines=np.arange(0, 90, 10)))
    with pytest.raises(MeasurementError, match=r"has 9 line\(s\) .* at least 10 are needed"):
        build_problem(sound.model, few, sound.nuisances)


def test_lines_of_zeros_and_of_noise_alone_are_left_out_of_the_fit(sound):
    """The first 40 lines tell nothing: what is fitted to the others must be what all lines say."""
    frf, m = sound.measurement.frf, sound.measurement
    nothing, unknown = np.array(frf.H), np.full(frf.H.shape, np.nan)
    nothing[:40], unknown[:40] = 0.0, 1.0
    whole = assessed_fit(build_problem(sound.model, m, sound.nuisances))
    for data in (m.with_frf(replace(frf, H=nothing)), replace(m, scatter=unknown)):
        problem = build_problem(sound.model, data, sound.nuisances)
        assert not problem.data.mask[:40].any()
        assert (problem.stages > frf.frequency[40]).all()
        assert np.isfinite(problem.data.noise).all()
        fit = assessed_fit(problem)
        assert fit.level < 1.2 * whole.level
        assert np.isfinite(check_gates(problem, fit).cross_misfit).all()
        for ref, value in fit.values.items():
            assert abs(value - whole.values[ref]) < 2 * whole.std[ref]


def test_what_the_gates_say_of_forces_and_of_reciprocity_is_what_failed(sound):
    frf = sound.measurement.frf
    m = sound.measurement.with_frf(frf.select(outputs=frf.outputs[:2]))
    problem = build_problem(sound.model, m, sound.nuisances)
    faults = (Fault("excitation_sign", frf.inputs[0], -1.0, 0.0),)
    gates = check_gates(problem, assessed_fit(problem), faults=faults)
    said = {c.name: c for c in gates.checks}["sensors and forces"]
    assert said.outcome == "failed"
    assert frf.inputs[0] in said.found
    gain = Fault("sensor_gain", frf.outputs[1], 1.2, 0.01)
    for last, outcome, found in (
        ((gain,), "failed", f"1 fault corrected, at {gain.sensor}; the apparent fault of"),
        ((), "passed", f"the apparent fault of {frf.inputs[0]} is explained by the effects that were found"),
    ):
        after = {c.name: c for c in with_last_faults(gates, faults, last).checks}
        assert [*after] == [c.name for c in gates.checks]
        assert after["sensors and forces"].outcome == outcome
        assert found in after["sensors and forces"].found
    # A difference of 0.1 dB is no fault, though it is 10 times its noise; one of 2 dB is at 4 times.
    pairs = (Reciprocity("a", "b", 0.1, 0.01), Reciprocity("c", "d", 2.0, 0.5))
    check = reciprocity_check(problem, replace(gates, reciprocity=pairs))
    assert check.outcome == "failed"
    assert "c and d" in check.found


def test_a_force_level_without_a_value_that_counts_is_no_level(sound):
    first = replace(sound.measurement, force_level=1.0)
    noise = replace(first, force_level=2.0, scatter=np.ones(first.frf.H.shape))
    problem = build_problem(sound.model, first, sound.nuisances)
    assert force_levels(problem, [first, noise]) == ()
    assert len(force_levels(problem, [first, replace(first, force_level=2.0)])) == 2


def test_equal_levels_pass_and_a_resonance_that_moves_by_two_per_cent_fails(sound):
    """Noise of 1 % in each part; the resonances of half the band are 2 % higher at the other level."""
    m = replace(sound.measurement, scatter=np.full(sound.measurement.frf.H.shape, 0.01))
    problem = build_problem(sound.model, replace(m, frf=noisy(m.frf, 0.01, 1)[0]), sound.nuisances)
    null = assessed_fit(problem)
    same = replace(m, frf=noisy(m.frf, 0.01, 2)[0], name="twice the force")
    (level,) = check_gates(problem, null, [same]).homogeneity
    assert not level.violated
    assert 0.8 < level.ratio < 1.2
    f = m.frf.frequency
    low = f < np.median(f)
    moved = np.array(same.frf.H)
    for part in np.ndindex(moved.shape[1:]):
        log = np.unwrap(np.angle(m.frf.H[(slice(None), *part)])) * 1j + np.log(
            np.abs(m.frf.H[(slice(None), *part)])
        )
        moved[(slice(None), *part)] *= np.exp(np.where(low, np.interp(f / 1.02, f, log.real) - log.real, 0))
    (level,) = check_gates(problem, null, [replace(same, frf=replace(same.frf, H=moved))]).homogeneity
    assert level.violated


BEAM = """
[materials.steel]
E = 210e9
rho = 7850.0
[points]
A = [0.0, 0.0, 0.0]
B = [1.0, 0.0, 0.0]
[members.beam]
from = "A"
to = "B"
material = "steel"
section = { shape = "rectangle", b = 0.03, h = 0.01 }
[[sensors]]
name = "s1z"
label = "1Z+"
point = [0.3, 0.0, 0.0]
direction = "z"
[[sensors]]
name = "s2z"
label = "2Z+"
point = [0.8, 0.0, 0.0]
direction = "z"
[[excitations]]
sensor = "s1z"
[[measurements]]
check_units = false
"""


def written(folder, keys, functions=()):
    f = np.linspace(5.0, 200.0, 60)
    H = (1 + 0.1j) / (1 - (f / 90) ** 2 + 0.05j)
    frf = FRF.from_arrays(f, np.stack([H, 2 * H], axis=1)[:, :, None], "accelerance", ["1Z+", "2Z+"], ["1Z+"])
    first, second, third = noisy(frf, 0.02, 4, 3)
    for name, each in (("a.uff", first), ("b.uff", second), ("c.uff", third)):
        write_uff(folder / name, each, functions=functions)
    path = study_file(folder, BEAM + 'file = "a.uff"\n' + keys)
    return path, (first, second, third)


def coherences(f, values):
    return [
        Function(
            6, f"{k + 1}Z+", "1Z+", "", "", f, np.full(f.size, v), 18, 0, 0, "Hz", "", "", ("",) * 5, 0, 0, ""
        )
        for k, v in enumerate(values)
    ]


def test_a_study_reads_coherence_from_the_universal_file_itself(tmp_path):
    f = np.linspace(5.0, 200.0, 60)
    path, _ = written(tmp_path, "averages = 8\n", coherences(f, (0.9, 0.98)))
    assert {g.type_name for g in read_uff(tmp_path / "a.uff").functions} == {"coherence"}
    (m,) = load_study(path).measurements
    assert m.coherence is not None
    assert m.noise is not None
    np.testing.assert_allclose(m.coherence[:, :, 0], np.broadcast_to([0.9, 0.98], (60, 2)), rtol=1e-6)
    np.testing.assert_allclose(m.noise[0, :, 0], np.sqrt([0.1 / (16 * 0.9), 0.02 / (16 * 0.98)]), rtol=1e-5)
    path, _ = written(tmp_path, "", coherences(f, (0.9, 0.98)))
    study = load_study(path)
    assert study.measurements[0].noise is None
    assert any("averages = … is not given" in text for text in study.assumptions)


def test_a_study_reads_coherence_from_arrays_and_repeats_from_files(tmp_path):
    path, frfs = written(tmp_path, 'averages = 8\ncoherence = "coherence.npz"\nband = [50.0, 150.0]\n')
    f = np.linspace(5.0, 200.0, 60)
    values = np.linspace(0.5, 1.0, 120).reshape(60, 2, 1)
    swapped = {"frequency": f, "coherence": values[:, ::-1], "outputs": ["2Z+", "1Z+"], "inputs": ["1Z+"]}
    np.savez(tmp_path / "coherence.npz", **swapped)
    (m,) = load_study(path).measurements
    keep = (f >= 50) & (f <= 150)
    assert m.coherence is not None
    np.testing.assert_allclose(m.coherence, values[keep])

    path, frfs = written(tmp_path, 'repeats = ["b.uff", "c.uff"]\n')
    (m,) = load_study(path).measurements
    H = np.stack([x.H for x in frfs])
    np.testing.assert_allclose(m.frf.H, H.mean(axis=0), rtol=1e-5)
    deviation = np.sqrt((abs(H - H.mean(axis=0)) ** 2).sum(axis=0) / 2 / 2 / 3) / abs(H.mean(axis=0))
    assert m.scatter is not None
    np.testing.assert_allclose(m.scatter, deviation, rtol=1e-3, atol=1e-6)


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ("averages = 8\n", "averages is used with coherence only"),
        ("averages = 2.5\n", "a whole number of averages"),
        ('coherence = "none.npz"\naverages = 3\n', "there is no file"),
        ('coherence = "study.toml"\naverages = 3\n', "a universal file or .npz is needed"),
        ('coherence = "a.uff"\naverages = 3\n', "has no coherence at the lines"),
        ('coherence = "bad.npz"\naverages = 3\n', "coherence has shape"),
        ('coherence = "high.npz"\naverages = 3\n', "0 to 1 is allowed"),
        ('repeats = ["d.uff"]\n', "other lines, channels or another kind"),
        ('repeats = ["none.uff"]\n', "there is no file"),
        ('repeats = ["a.uff"]\n', "a repeat is measured by itself"),
        ('repeats = ["b.uff", "b.uff"]\n', "a repeat is measured by itself"),
        ('coherence = "cut.uff"\naverages = 3\n', r"measurements\[1\]\.coherence: .*no end"),
        ('coherence = "cut.npz"\naverages = 3\n', r"measurements\[1\]\.coherence: .*cannot be read as .npz"),
    ],
)
def test_what_cannot_be_meant_is_refused_with_its_place(tmp_path, keys, message):
    path, (frf, *_) = written(tmp_path, keys)
    write_uff(tmp_path / "d.uff", frf.select(lines=np.arange(30)))
    np.savez(tmp_path / "bad.npz", frequency=frf.frequency, coherence=np.ones((60, 3, 1)))
    (tmp_path / "cut.uff").write_text("    -1\n    58\n", encoding="ascii")
    (tmp_path / "cut.npz").write_bytes((tmp_path / "bad.npz").read_bytes()[:300])
    np.savez(tmp_path / "high.npz", frequency=frf.frequency, coherence=np.full((60, 2, 1), 1.2))
    with pytest.raises(StudyError, match=message):
        load_study(path)
