"""``dovetail frf-estimate``: from hits and noise on an oscillator to FRFs that a study reads."""

import numpy as np
import pytest
from scipy.signal import lfilter

from dovetail import main
from fem.io import read_frf, read_uff

RATE, F0, ZETA = 1024.0, 60.0, 0.02
G0 = 9.80665


def arrays(path):
    """Return the arrays of an npz file."""
    with np.load(path) as file:
        return dict(file)


def response(force):
    """Return the displacement of 1 kg on a spring by the impulse-invariant filter, exact for samples."""
    w = 2 * np.pi * F0
    d = w * np.sqrt(1 - ZETA**2) / RATE
    r = np.exp(-ZETA * w / RATE)
    gain = r * np.sin(d) / (w * np.sqrt(1 - ZETA**2) * RATE)
    return lfilter([0, gain], [1, -2 * r * np.cos(d), r * r], force)


def exact(f):
    """Return the receptance with the aliases that the filter's samples have."""
    w = 2 * np.pi * (f[:, None] + RATE * np.arange(-300, 301))
    return (1 / ((2 * np.pi * F0) ** 2 - w**2 + 2j * ZETA * 2 * np.pi * F0 * w)).sum(axis=1)


def hits(starts=(0.1, 1.6, 3.1, 4.6), width=6):
    force = np.zeros(int(6.2 * RATE))
    for start in starts:
        k = int(start * RATE)
        force[k : k + width] += 50 * np.sin(np.pi * (np.arange(width) + 0.5) / width)
    return force


def record(folder, force, scale=1e3, unit="mm", name="r.csv"):
    t = np.arange(force.size) / RATE
    table = np.column_stack([t, force, scale * response(force)])
    np.savetxt(
        folder / name, table, delimiter=";", header=f"Time [s];hammer [N];motion [{unit}]", comments=""
    )
    return folder / name


def run(path, *more):
    return main(["frf-estimate", str(path), "--out", str(path.parent / "frf.npz"), *more])


def test_hits_become_receptances_with_coherence(tmp_path, capsys):
    path = record(tmp_path, hits())
    assert run(path, "--hits", "1.4", "--band", "5", "150", "--picture", str(tmp_path / "p.png")) == 0
    found = arrays(tmp_path / "frf.npz")
    frf = read_frf(tmp_path / "frf.npz")
    assert (frf.kind, frf.outputs, frf.inputs) == ("receptance", ("motion",), ("hammer",))
    # the motion falls by exp(-2π 60 0.02 1.4) = 3e-5 within a block
    np.testing.assert_allclose(frf.H[:, 0, 0], exact(frf.frequency), rtol=2e-3)
    assert found["coherence"].min() > 0.999
    assert found["averages"] == 4
    assert (tmp_path / "p.png").stat().st_size > 10_000
    out = capsys.readouterr().out
    assert "H1 of 4 blocks" in out
    assert 'file = "frf.npz"' in out


def test_double_hits_and_overloads_are_left_out_with_a_warning(tmp_path, capsys):
    force = hits((0.1, 1.6, 1.65, 3.1, 4.6))
    force[int(3.1 * RATE) : int(3.1 * RATE) + 6] = 40.0  # an amplifier at its end
    assert run(record(tmp_path, force), "--hits", "1.4", "--band", "5", "150") == 0
    err = capsys.readouterr().err
    assert "hit 2 is left out: double hit" in err
    assert "hit 3 is left out: overload in force 1" in err
    assert arrays(tmp_path / "frf.npz")["averages"] == 2


def test_blocks_that_end_too_soon_and_the_exponential_window_are_said(tmp_path, capsys):
    path = record(tmp_path, hits())
    assert run(path, "--hits", "0.2", "--band", "5", "150") == 0
    assert "the response motion still has" in capsys.readouterr().out
    assert run(path, "--hits", "0.2", "--band", "5", "150", "--window", "exponential") == 0
    out = capsys.readouterr().out
    decay = -np.log(0.01) * RATE / 205  # samples of 0.2 s
    assert f"adds {decay:.4g} 1/s to the decay" in out
    assert arrays(tmp_path / "frf.npz")["added_decay"] == pytest.approx(decay)


def test_random_forces_by_blocks_into_a_universal_file(tmp_path):
    force = np.random.default_rng(1).standard_normal(60_000)
    path = record(tmp_path, force)
    out = tmp_path / "frf.uff"
    words = ["frf-estimate", str(path), "--out", str(out), "--block", "4096", "--estimator", "Hv"]
    assert main([*words, "--rename", "hammer=1Z+,motion=1Z+", "--band", "20", "100"]) == 0
    file = read_uff(out)
    frf = file.frf()
    near = abs(frf.frequency - F0) < 20
    # leakage of a Hann window over 0.25 Hz, a tenth of the half-power width 2.4 Hz
    np.testing.assert_allclose(abs(frf.H[near, 0, 0]), abs(exact(frf.frequency[near])), rtol=0.1)
    assert [f.function_type for f in file.functions if f.function_type == 6] == [6]


def test_scales_go_before_units_and_channels_without_units_are_said(tmp_path, capsys):
    path = record(tmp_path, hits(), scale=1 / 0.25, unit="V")
    assert run(path, "--hits", "1.4", "--band", "5", "150", "--kind", "receptance") == 0
    assert (
        "channel motion of r.csv has the unit 'V' and is taken to be in SI units" in capsys.readouterr().out
    )
    plain = arrays(tmp_path / "frf.npz")["H"]
    assert (
        run(path, "--hits", "1.4", "--band", "5", "150", "--kind", "receptance", "--scale", "motion=0.25")
        == 0
    )
    assert "taken to be" not in capsys.readouterr().out
    np.testing.assert_allclose(arrays(tmp_path / "frf.npz")["H"], 0.25 * plain)


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (["--force", "nothing"], r"there is no channel 'nothing'; it has hammer, motion"),
        (["--scale", "x=1"], "there is no channel 'x'"),
        (["--force", "hammer", "--response", "hammer"], "the forces are hammer, the responses hammer"),
        (["--hits", "10"], "no hit has 10240 samples after it"),
        (["--window", "hamming"], "invalid choice"),
        (["--rename", "motion"], "CHANNEL=LABEL is needed"),
        (["--picture", "p.jpg"], "is written as .png, not"),
    ],
)
def test_bad_requests_are_one_line(tmp_path, capsys, more, words):
    assert run(record(tmp_path, hits()), *more) == 2
    assert words in capsys.readouterr().err


def test_records_of_hits_are_joined(tmp_path, capsys):
    paths = [
        str(record(tmp_path, hits(s), name=n)) for s, n in (((0.1, 1.6), "a.csv"), ((0.2, 2.0), "b.csv"))
    ]
    out = ["--out", str(tmp_path / "frf.npz"), "--band", "5", "150"]
    assert main(["frf-estimate", *paths, *out, "--hits", "1.4"]) == 0
    assert arrays(tmp_path / "frf.npz")["averages"] == 4
    assert main(["frf-estimate", *paths, *out]) == 2
    assert "several records are joined where --hits" in capsys.readouterr().err
    other = record(tmp_path, hits(), unit="m", name="c.csv")
    other.write_text(other.read_text(encoding="utf-8").replace("motion", "other"), encoding="utf-8")
    assert main(["frf-estimate", paths[0], str(other), *out, "--hits", "1.4"]) == 2
    assert "c.csv: it has other channels" in capsys.readouterr().err


def test_without_a_channel_of_force_they_are_listed(tmp_path, capsys):
    path = record(tmp_path, hits())
    path.write_text(path.read_text(encoding="utf-8").replace("[N]", "[V]"), encoding="utf-8")
    assert run(path) == 2
    assert (
        "no channel is in a unit of force; name the forces, of hammer [V], motion [mm]"
        in capsys.readouterr().err
    )


def pair(folder, units=("g", "g"), names=("a1", "a2")):
    """Write the motion of a base and twice that with a little noise, in the units of their labels."""
    motion, noise = np.random.default_rng(3).standard_normal((2, 8192))
    table = np.column_stack([np.arange(motion.size) / RATE, motion, 2 * motion + 1e-4 * noise])
    head = f"time [s],{names[0]} [{units[0]}],{names[1]} [{units[1]}]"
    np.savetxt(folder / "r.csv", table, delimiter=",", header=head, comments="")
    return folder / "r.csv"


@pytest.mark.parametrize("more", [[], ["--kind", "transmissibility"]])
@pytest.mark.parametrize(("units", "ratio"), [(("g", "g"), 2), (("m/s^2", "g"), 2 * G0), (("mm", "m"), 2e3)])
def test_two_motions_of_one_kind_make_a_transmissibility(tmp_path, capsys, more, units, ratio):
    assert run(pair(tmp_path, units), "--reference", "a1", *more) == 0
    frf = read_frf(tmp_path / "frf.npz")
    assert (frf.quantity, frf.unit, frf.base) == ("transmissibility", "-", ("a1",))
    np.testing.assert_allclose(frf.H, ratio, rtol=1e-3)
    assert arrays(tmp_path / "frf.npz")["kind"] == "transmissibility"
    assert "transmissibility [-], 1 responses to 1 reference(s)" in capsys.readouterr().out


def test_a_transmissibility_is_one_in_a_universal_file(tmp_path):
    out = tmp_path / "frf.uff"
    assert (
        main(
            [
                "frf-estimate",
                str(pair(tmp_path)),
                "--out",
                str(out),
                "--force",
                "a1",
                "--rename",
                "a1=1Z+,a2=2Z+",
            ]
        )
        == 0
    )
    frf = read_frf(out)
    assert frf.quantity == "transmissibility"
    np.testing.assert_allclose(frf.H, 2, rtol=1e-3)


def test_a_displacement_for_an_acceleration_keeps_its_unit(tmp_path):
    assert run(pair(tmp_path, ("g", "mm")), "--force", "a1") == 0
    frf = read_frf(tmp_path / "frf.npz")
    assert (frf.quantity, frf.unit) == ("displacement per acceleration", "s²")
    np.testing.assert_allclose(frf.H, 2e-3 / G0, rtol=1e-3)


@pytest.mark.parametrize(
    ("units", "more", "words"),
    [
        (("g", "g"), ["--kind", "accelerance"], "the reference a1 is in 'g', a unit of motion"),
        (("N", "g"), ["--kind", "transmissibility"], "the reference a1 is in 'N', a unit of force"),
        (("m/s", "g"), ["--kind", "transmissibility"], "needs two motions of one kind"),
        (("m", "g"), [], "needs two motions of one kind"),
        (("N", "Nm"), [], "channel a2 is in 'Nm', which is neither a force nor a motion"),
        (("ms", "g"), [], "channel a1 is in 'ms', which is neither a force nor a motion"),
        (("N", "kN"), [], "the response a2 is in 'kN', a unit of force"),
    ],
)
def test_units_that_do_not_fit_the_kind_are_named(tmp_path, capsys, units, more, words):
    assert run(pair(tmp_path, units), "--force", "a1", *more) == 2
    assert words in capsys.readouterr().err
