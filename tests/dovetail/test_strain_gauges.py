"""Strain gauges in studies: files, comparisons and diagnoses, alone and beside accelerometers."""

from dataclasses import replace

import numpy as np
import pytest

from dovetail import StudyError, load_study, main
from fem import FRF
from fem.io import Points, read_frf, read_uff, write_npz, write_uff
from tests.studies import study_file, study_from
from updating import MeasurementError, identify_modes
from updating.correlation import DB_PER_NEPER, log_ratio

L, B, H, E, RHO = 0.8, 0.03, 0.008, 70e9, 2700.0
LOSS = 0.01
STUDY = """
[points]
root = [0.0, 0.0, 0.0]
tip = [0.8, 0.0, 0.0]

[members.beam]
from = "root"
to = "tip"
theory = "euler-bernoulli"

[materials.aluminium]
E = 70e9
rho = 2700.0

[sections.flat]
shape = "rectangle"
b = 0.03
h = 0.008

[[supports]]
point = "root"

[damping]
loss_factor = 0.01

[frequency]
start = 4.0
stop = 420.0
step = 1.0

[[excitations]]
name = "F"
point = "tip"
direction = "z"
"""
GAUGES = """
[[sensors]]
name = "G1"
quantity = "strain"
member = "beam"
position = 0.04
offset = [0.0, 0.004]

[[sensors]]
name = "G2"
quantity = "strain"
member = "beam"
position = 0.25
offset = [0.0, 0.004]

[[sensors]]
name = "G3"
quantity = "strain"
point = [0.5, 0.0, 0.0]
offset = [0.0, -0.004]
"""
ACCELEROMETERS = """
[[sensors]]
name = "A1"
point = "tip"
direction = "z"

[[sensors]]
name = "A2"
point = [0.45, 0.0, 0.0]
direction = "z"
"""
PLACES = {"G1": (0.04, 0.004), "G2": (0.25, 0.004), "G3": (0.5, -0.004)}
MOTIONS = {"A1": 0.8, "A2": 0.45}


def study(folder, sensors=GAUGES + ACCELEROMETERS, more=""):
    return study_file(folder, STUDY + sensors + more)


def exact(frequency, k=np.inf, names=(*PLACES, *MOTIONS)):
    """Return strain FRFs and accelerances of a cantilever whose root turns on a spring k, (n_freq, n_out, 1).

    The Euler-Bernoulli beam in closed form, EI w'''' = ρA ω² w, with no mesh: w(0) = 0, EI w''(0) = k w'(0),
    w''(L) = 0, EI w'''(L) = -1 for a force of 1 N at the tip.
    """
    EI, m = E * (1 + 1j * LOSS) * B * H**3 / 12, RHO * B * H
    out = []
    for f in frequency:
        omega = 2 * np.pi * f
        b = (m * omega**2 / EI) ** 0.25

        def waves(x, d=0, b=b):
            """Return the d-th derivatives of the four waves; those that decay do so from either end."""
            return np.array(
                [
                    (1j * b) ** d * np.exp(1j * b * x),
                    (-1j * b) ** d * np.exp(-1j * b * x),
                    b**d * np.exp(b * (x - L)),
                    (-b) ** d * np.exp(-b * x),
                ]
            )

        root = waves(0, 1) if np.isinf(k) else EI * waves(0, 2) - k * waves(0, 1)
        a = np.linalg.solve(np.array([waves(0), root, waves(L, 2), EI * waves(L, 3)]), [0, 0, 0, -1.0])
        rows = [
            -PLACES[n][1] * waves(PLACES[n][0], 2) @ a if n in PLACES else -(omega**2) * waves(MOTIONS[n]) @ a
            for n in names
        ]
        out.append(rows)
    return np.array(out)[:, :, None]


def db(a, b):
    return float(np.sqrt(np.mean(np.abs(log_ratio(a, b)) ** 2))) * DB_PER_NEPER


@pytest.mark.parametrize("kind", ["accelerance", "mobility", "receptance"])
def test_a_study_computes_strains_beside_motions_of_any_kind(tmp_path, kind):
    found = load_study(study(tmp_path)).frf(kind=kind)
    assert found.strain == ("G1", "G2", "G3")
    assert found.unit.endswith(", 1/N")
    closed = exact(found.frequency)
    strains, motions = found.select(found.strain), found.select(["A1", "A2"])
    assert strains.unit == "1/N"
    assert db(strains.H, closed[:, :3]) < 0.01  # but for the mesh, and rotary inertia, 1e-4 of a frequency
    assert db(motions.as_kind("accelerance").H, closed[:, 3:]) < 0.01
    assert (strains.as_kind("mobility").H == strains.H).all()


@pytest.mark.parametrize("file", ["frf.npz", "frf.csv", "frf.uff"])
def test_written_frfs_are_read_back_as_they_were(tmp_path, file):
    labels = GAUGES.replace('quantity = "strain"', 'quantity = "strain"\nlabel = "{}X+"')
    labels = labels.format(11, 12, 13) + ACCELEROMETERS
    path = study(tmp_path, labels)
    main(["frf", str(path), "--out", str(tmp_path / file)])
    path = study(tmp_path, labels, f'\n[[measurements]]\nfile = "{file}"\n')
    if file == "frf.uff":  # sensors without a label have the numbers of the mesh's points
        frf = read_uff(tmp_path / file).frfs[0]
        assert frf.strain == ("11X+", "12X+", "13X+")
        names = dict(zip(["A1", "A2"], frf.outputs[3:], strict=True))
        text = path.read_text().replace('name = "F"', f'name = "F"\nlabel = "{frf.inputs[0]}"')
        for name, label in names.items():
            text = text.replace(f'name = "{name}"', f'name = "{name}"\nlabel = "{label}"')
        path.write_text(text)
    else:
        assert read_frf(tmp_path / file).strain == ("11X+", "12X+", "13X+")
    again = load_study(path)
    (measured,) = again.measurements
    assert measured.frf.strain == ("G1", "G2", "G3")
    assert db(again.frf().H, measured.frf.H) < (1e-4 if file == "frf.uff" else 1e-9)


def measured(folder, sensors, names, k=np.inf, noise=0.01, **factors):
    rng = np.random.default_rng(3)
    f = np.arange(4.0, 420.5, 1.0)
    values = exact(f, k, names) * np.array([factors.get(n, 1.0) for n in names])[:, None]
    values = values * (1 + noise * (rng.normal(size=values.shape) + 1j * rng.normal(size=values.shape)))
    strain = [n for n in names if n in PLACES]
    write_npz(folder / "frf.npz", FRF.from_arrays(f, values, "accelerance", names, ["F"], strain=strain))
    more = '\n[[measurements]]\nfile = "frf.npz"\n\n[candidates]\n'
    more += 'kinds = ["support_flexibility", "point_mass", "member_stiffness", "sensor_mass"]\n'
    return load_study(study(folder, sensors, more))


@pytest.mark.parametrize(
    ("sensors", "names"),
    [(GAUGES, tuple(PLACES)), (GAUGES + ACCELEROMETERS, (*PLACES, *MOTIONS))],
    ids=["gauges", "mixed"],
)
def test_a_root_that_gives_way_is_found_from_strains(tmp_path, sensors, names):
    k = 1200.0
    found = measured(tmp_path, sensors, names, k).diagnose()
    assert not found.faults
    (finding,) = found.findings
    assert finding.effect.kind == "support_flexibility"
    (stiffness,) = finding.parameters
    assert abs(stiffness.value - k) < 2 * stiffness.std < 0.06 * k


@pytest.mark.parametrize(
    ("sensors", "names", "wrong"),
    [
        (GAUGES, tuple(PLACES), "G2"),
        (GAUGES + ACCELEROMETERS, (*PLACES, *MOTIONS), "G2"),
        (GAUGES + ACCELEROMETERS, (*PLACES, *MOTIONS), "A2"),
    ],
    ids=["among gauges", "among both", "accelerometer"],
)
def test_a_channel_that_is_wired_in_reverse_is_found(tmp_path, sensors, names, wrong):
    found = measured(tmp_path, sensors, names, **{wrong: -1.0}).diagnose()
    assert [f.name for f in found.faults] == [f"sensor_sign:{wrong}"]
    assert not found.findings


def test_a_gauge_with_a_wrong_gain_is_found_beside_accelerometers(tmp_path):
    found = measured(tmp_path, GAUGES + ACCELEROMETERS, (*PLACES, *MOTIONS), G2=1.4).diagnose()
    (fault,) = found.faults
    assert fault.name == "sensor_gain:G2"
    assert fault.value == pytest.approx(1.4, rel=0.03)


@pytest.mark.parametrize(
    ("sensors", "names"),
    [(GAUGES, tuple(PLACES)), (GAUGES + ACCELEROMETERS, (*PLACES, *MOTIONS))],
    ids=["gauges", "mixed"],
)
def test_strain_modes_are_identified_and_show_what_is_missing(tmp_path, sensors, names):
    path = measured(tmp_path, sensors, names, 1200.0, noise=0.003).path
    main(["identify-modes", str(path), "--out", str(tmp_path / "modes.npz"), "--quiet"])
    more = '\n[modes]\nfile = "modes.npz"\n\n[candidates]\n'
    more += 'kinds = ["support_flexibility", "point_mass", "member_stiffness"]\n'
    test = load_study(study(tmp_path, sensors, more))
    assert test.modes is not None
    sizes = np.sqrt((np.abs(test.modes.modes.shapes) ** 2).mean(axis=1))
    assert sizes.max() < 10 * sizes.min()  # of mixed shapes the strains count as much as the motions
    found = test.diagnose()
    ((effect,),) = [e.effects for e in found.explanations[:1]]
    assert effect.kind == "support_flexibility"
    assert (found.modes.mac_found > 0.999).all()
    assert (found.modes.mac_nominal < 0.998).any()


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("offset = [0.0, 0.004]", "", r"sensors\[1\]: 'offset' is missing"),
        (
            "offset = [0.0, 0.004]",
            "offset = [0.004]",
            r"sensors\[1\].offset: \[0.004\] is not allowed; 2 numbers",
        ),
        ("offset = [0.0, 0.004]", "offset = [0.0, 0.004]\nmass = 0.1", "mass: unknown key; .*allowed are"),
        ("position = 0.04\n", "", r"position"),
        ('member = "beam"\nposition = 0.04\n', "", "the place of the gauge is missing: give member"),
        ('quantity = "strain"', 'quantity = "stress"', "motion, strain"),
        ('point = "tip"\ndirection = "z"', 'sensor = "G1"', "'G1' measures strain; a force acts where"),
    ],
)
def test_gauges_that_are_stated_wrongly_are_refused_with_the_place(tmp_path, old, new, words):
    path = study(tmp_path)
    path.write_text(path.read_text().replace(old, new, 1))
    with pytest.raises(StudyError, match=words):
        load_study(path)


def test_a_strain_in_a_file_is_no_accelerometers(tmp_path):
    accelerometer = '\n[[sensors]]\nname = "G1"\npoint = "tip"\ndirection = "z"\n'
    with pytest.raises(StudyError, match=r"channel G1 of frf\.npz measures strain, and sensor 'G1' a motion"):
        measured(tmp_path, accelerometer, ("G1",))


def test_a_table_of_sensors_has_gauges_with_their_offsets(tmp_path):
    (tmp_path / "sensors.csv").write_text(
        "name,quantity,member,position,offset_y [mm],offset_z [mm],direction,sign\n"
        "G1,strain,beam,0.04,0,4,,\nG4,strain,beam,0.04,-10,4,,-1\nA1,,beam,0.8,,,z,\n"
    )
    gauge, other, motion = load_study(study(tmp_path, '\n[[sensors]]\nfile = "sensors.csv"\n')).sensors
    assert (gauge.offset, other.offset) == ((0.0, 0.004), (-0.01, 0.004))
    assert (gauge.direction == -other.direction).all()
    assert motion.quantity == "motion"


def test_other_commands_take_the_motions_alone(tmp_path, capsys):
    path = study(tmp_path)
    main(["base", str(path), "--motion", "z", "--stop", "20", "--step", "5"])
    said = capsys.readouterr().out
    assert "of 2 sensor(s)" in said
    assert "G1" not in said
    path.write_text(path.read_text() + "\n[uncertain]\nE = 0.05\n")
    assert main(["ensemble", str(path), "--out", str(tmp_path / "e"), "--samples", "4"]) != 0
    assert "G1, G2, G3 measure no motion" in capsys.readouterr().err


def test_reports_give_each_frf_its_unit(tmp_path):
    from dovetail.report import magnitude_title
    from viz import plot_frf

    frf = measured(tmp_path, GAUGES + ACCELEROMETERS, (*PLACES, *MOTIONS)).measurements[0].frf
    labels = [a.get_ylabel() for a in plot_frf(frf, pairs=[("A1", "F"), ("G1", "F")]).axes]
    assert labels[0::2] == ["accelerance [(m/s²)/N]", "strain per force [1/N]"]
    assert magnitude_title(frf.select(["G2"])) == "strain per force<br>[dB re 1 1/N]"


@pytest.mark.parametrize("stated", ["receptance", "mobility"])
def test_a_wrong_kind_is_seen_by_the_motions_beside_gauges(tmp_path, stated):
    path = measured(tmp_path, GAUGES + ACCELEROMETERS, (*PLACES, *MOTIONS)).path
    path.write_text(path.read_text().replace('file = "frf.npz"', f'file = "frf.npz"\nkind = "{stated}"'))
    with pytest.raises(StudyError, match=f'{stated}.*kind = "accelerance"'):
        load_study(path)
    right = 'file = "frf.npz"\nkind = "accelerance"'
    path.write_text(path.read_text().replace(f'file = "frf.npz"\nkind = "{stated}"', right))
    again = load_study(path)
    assert not again.warnings
    assert again.compare().total_db < 0.2


def test_gauges_and_strains_of_a_measurement_agree(tmp_path):
    m = measured(tmp_path, GAUGES, tuple(PLACES)).measurements[0]
    with pytest.raises(MeasurementError, match=r"have the strains none, the strain gauges are G1, G2, G3"):
        replace(m, frf=replace(m.frf, strain=()))


def test_the_desk_shows_each_quantity_with_its_unit_and_saves_gauges(tmp_path):
    from dovetail.desk import Desk, DeskState, History, Stair, figures, live_model, save_study
    from updating.live import Hypothesis

    test = measured(tmp_path, GAUGES + ACCELEROMETERS, (*PLACES, *MOTIONS))
    live = live_model(test)
    start = Hypothesis.nominal(live.problem)
    first = DeskState("open the study", start, (Stair.of("nominal model", live.evaluate(start)),))
    desk = Desk(test, live, History((first,)))
    for output, unit in (("G1", "1/N"), ("A1", "(m/s²)/N")):
        figure = figures.frf(desk, (output, "F"), 400)
        assert figure.layout.yaxis.title.text.endswith(f"re 1 {unit}]")
    saved = load_study(save_study(test, live, start, tmp_path / "saved.toml"))
    assert [s.quantity for s in saved.sensors] == [s.quantity for s in test.sensors]
    assert saved.compare().total_db == pytest.approx(test.compare().total_db, abs=1e-3)


def test_identified_modes_are_those_of_motions_and_their_frfs_of_the_kind_of_the_data(tmp_path):
    found = {}
    f = np.arange(4.0, 420.5, 1.0)
    for names in (tuple(MOTIONS), (*PLACES, *MOTIONS)):
        strain = [n for n in names if n in PLACES]
        frf = FRF.from_arrays(f, exact(f, 1200.0, names), "accelerance", names, ["F"], strain=strain)
        found[names] = identify_modes(frf, driving=[("A1", "F")])
        fit = found[names].synthesised
        assert (fit.kind, fit.strain) == (frf.kind, frf.strain)
        off = (np.abs(fit.H - frf.H) ** 2).sum(axis=0) / (np.abs(frf.H) ** 2).sum(axis=0)
        assert (off < 0.05**2).all()
    alone, mixed = found.values()
    assert mixed.modes.frequency == pytest.approx(alone.modes.frequency, rel=1e-3)
    assert mixed.modes.shapes[3:] == pytest.approx(alone.modes.shapes, rel=0.02)


def test_universal_files_have_shapes_of_the_motions_alone(tmp_path):
    path = measured(tmp_path, GAUGES + ACCELEROMETERS, (*PLACES, *MOTIONS)).path
    main(["identify-modes", str(path), "--out", str(tmp_path / "modes.uff"), "--quiet"])
    assert len(read_uff(tmp_path / "modes.uff").modes[0].labels) in (2, 6)
    path = measured(tmp_path, GAUGES, tuple(PLACES)).path
    assert main(["identify-modes", str(path), "--out", str(tmp_path / "no.uff"), "--quiet"]) != 0


def test_without_sensors_the_strains_of_a_file_are_left_out(tmp_path):
    f = np.arange(4.0, 420.5, 1.0)
    names = (*PLACES, *MOTIONS)
    frf = FRF.from_arrays(f, exact(f), "accelerance", names, ["F"], strain=list(PLACES))
    nodes = Points(np.array([1, 2, 3]), np.array([[0.25, 0, 0], [0.45, 0, 0], [0.8, 0, 0]]))
    dofs = {"G1": "1X+", "G2": "2X+", "G3": "3X+", "A1": "3Z+", "A2": "2Z+", "F": "3Z+"}
    write_uff(tmp_path / "frf.uff", frf, geometry=nodes, dofs=dofs)
    text = STUDY[: STUDY.index("[[excitations]]")] + '\n[[measurements]]\nfile = "frf.uff"\n'
    test = study_from(tmp_path, text)
    assert [s.name for s in test.sensors] == ["3Z+", "2Z+"]
    assert [n for n in (*test.measured_notes, *test.assumptions) if "1X+, 2X+, 3X+ match no" in n], (
        test.measured_notes
    )
