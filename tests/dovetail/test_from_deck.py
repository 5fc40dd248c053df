"""``dovetail new --from`` a deck: the study is the model of the deck."""

import re
from dataclasses import replace

import numpy as np
import pytest

from dovetail import load_study, main
from fem import Damping, MeshError, Section
from fem.io import BarProperty, model_of, read_mesh
from tests.decks import STEEL, deck, everything
from tests.frames import frequencies


@pytest.fixture
def reads(monkeypatch, tmp_path):
    """Return a function that makes the reader of decks give a deck, and the path of its file."""

    def of(given):
        def read(path, units="SI"):
            if isinstance(given, str):
                raise MeshError(given)
            return given

        monkeypatch.setattr("dovetail.file.from_deck.read_deck", read)
        (tmp_path / "frame.bdf").write_text("GRID,1,,0.,0.,0.\nGRID,2,,1.,0.,0.\nCBAR,1,3,1,2,0.,0.,1.\n")
        return tmp_path / "frame.bdf"

    return of


def tapered():
    """Return a portal of tapered columns and a beam by constants, in decks' words."""
    points = [[0, 0, 0], [0, 0, 0.5], [0, 0, 1], [1, 0, 1], [1, 0, 0]]
    column = BarProperty(
        name="column",
        material=STEEL,
        section=Section.i_section(b=0.1, h=0.1, tf=0.01, tw=0.006),
        section2=Section.i_section(b=0.1, h=0.2, tf=0.01, tw=0.006),
    )
    beam = BarProperty(name="beam", material=STEEL, section=Section(A=2e-3, Iy=4e-6, Iz=2e-6, J=1e-6))
    damping = Damping(np.array([1.0, 9.0]), np.array([0.01, 0.02]), 0.1, 1e-5, 0.02)
    return deck(
        points,
        [(0, 1), (2, 1), (2, 3), (4, 3)],
        column,
        beam,
        kinds=[0, 0, 1, 0],
        damping=damping,
        supports={0: ("x", "y", "z", "rx", "ry", "rz"), 4: ("x", "y", "z")},
    )


@pytest.mark.parametrize("make", [everything, tapered])
def test_the_study_is_the_model(make, reads, tmp_path, capsys):
    d = make()
    assert main(["new", str(tmp_path / "s"), "--from", str(reads(d))]) == 0
    out = capsys.readouterr()
    assert "study.toml is written, with mesh.inp" in out.out
    assert not out.err
    for note in d.notes:
        assert f"note: frame.bdf: {note}" in out.out
    study, model = load_study(tmp_path / "s" / "study.toml"), model_of(d)
    assert study.warnings == ()
    n = 15
    np.testing.assert_allclose(frequencies(study.model, n), frequencies(model, n), rtol=1e-9)
    for key in ("frequency", "ratio", "alpha", "beta", "loss_factor"):
        wanted = getattr(model.damping if d.damping else Damping.modal(0.01), key)
        np.testing.assert_array_equal(getattr(study.model.damping, key), wanted)
    assert {e.name for e in study.model.effects} == {e.name for e in model.effects}


def test_without_its_element_size_a_study_converges_to_the_same_model(reads, tmp_path):
    d = tapered()
    main(["new", str(tmp_path / "s"), "--from", str(reads(d))])
    file = tmp_path / "s" / "study.toml"
    lines = file.read_text(encoding="utf-8").splitlines()
    file.write_text("\n".join(x for x in lines if not x.startswith("element_size")), encoding="utf-8")
    study, model = load_study(file), model_of(d)
    assert study.model.mesh.n_lines > 4
    fine = model.with_mesh(model.mesh.refined(0.01))
    errors = [frequencies(m, 4) / frequencies(fine, 4) - 1 for m in (model, study.model)]
    assert errors[0].max() > 1e-3
    np.testing.assert_allclose(errors[1], 0, atol=1e-4)


def test_frfs_and_a_deck_in_any_order(reads, root, tmp_path, capsys):
    example = root / "examples" / "first-frame"
    mesh = read_mesh(example / "frame.msh")
    kinds = np.zeros(mesh.n_lines, dtype=int)
    d = deck(mesh.points, mesh.lines, kinds=kinds, supports={0: ("x", "y", "z")})
    for k, files in enumerate(([reads(d), example / "test.uff"], [example / "test.uff", reads(d)])):
        assert main(["new", str(tmp_path / f"{k}"), "--from", *map(str, files)]) == 0
        assert "placeholders" not in capsys.readouterr().out
        study = load_study(tmp_path / f"{k}" / "study.toml")
        assert len(study.sensors) == 7
        assert study.model.effect("frame").materials["steel"].E == STEEL.E
        assert study.model.effect("node 1").fixed == ("x", "y", "z")


def test_a_deck_without_sections_is_a_mesh(reads, tmp_path, capsys):
    bare = replace(everything(), properties=())
    assert main(["new", str(tmp_path / "s"), "--from", str(reads(bare))]) == 0
    assert "Material, sections, supports and damping are placeholders" in capsys.readouterr().out
    study = load_study(tmp_path / "s" / "study.toml")
    assert list(study.model.mesh.members) == ["property 3"]
    assert main(["new", str(tmp_path / "t"), "--from", str(reads("line 3: CQUAD4 is no bar"))]) == 2
    assert "line 3: CQUAD4 is no bar" in capsys.readouterr().err
    assert main(["new", str(tmp_path / "t"), "--from", "a", "b", "c"]) == 2
    assert "--from takes a deck or a mesh, and FRFs" in capsys.readouterr().err


def test_a_deck_that_is_no_model_keeps_its_mesh_beside_a_test(reads, root, tmp_path, capsys):
    example = root / "examples" / "first-frame"
    mesh = read_mesh(example / "frame.msh")
    points = "".join(f"GRID,{k},,{x:.6f},{y:.6f},{z:.6f}\n" for k, (x, y, z) in enumerate(mesh.points, 1))
    bars = "".join(f"CBAR,{k},3,{a + 1},{b + 1},0.,1.,0.1\n" for k, (a, b) in enumerate(mesh.lines, 1))
    file = reads("frame.bdf, line 3: CQUAD4 is no bar")
    file.write_text(points + bars)
    assert main(["new", str(tmp_path / "s"), "--from", str(example / "test.uff"), str(file)]) == 0
    out = capsys.readouterr().out
    assert "note: the deck is read as a mesh: frame.bdf, line 3: CQUAD4 is no bar" in out
    assert "placeholders" in out
    assert load_study(tmp_path / "s" / "study.toml").model.mesh.n_points >= mesh.n_points


def test_no_file_is_written_over(reads, tmp_path):
    (tmp_path / "s").mkdir()
    (tmp_path / "s" / "mesh.inp").write_text("mine")
    assert main(["new", str(tmp_path / "s"), "--force", "--from", str(reads(tapered()))]) == 2
    assert (tmp_path / "s" / "mesh.inp").read_text() == "mine"


LUMPED = (
    "$ mm, N, tonne\n$ post left\nPBARL,1,1,,TUBE\n+,25.,22.\nPBAR,2,1,400.,4.+4,1.+4,2.+4\n"
    "MAT1,1,210000.,,.3,7.85-9\nGRID,1,,0.,0.,0.\nGRID,2,,0.,0.,500.\nGRID,3,,0.,0.,900.\n"
    "CBAR,1,1,1,2,1.,0.,0.\nCBAR,2,2,2,3,1.,0.,0.\n"
)
"""Bars of lumped mass without inertia of torsion, free of supports [mm, t, s]."""


def made(tmp_path, text):
    """Return the study that ``new`` makes of a deck in mm, t and s."""
    (tmp_path / "a.bdf").write_text(text)
    assert main(["new", str(tmp_path / "s"), "--from", str(tmp_path / "a.bdf"), "--units", "mm-t-s"]) == 0
    return tmp_path / "s" / "study.toml"


def test_lumped_mass_without_inertia_of_torsion_is_no_fault(tmp_path, capsys):
    study = made(tmp_path, f"{LUMPED}SPC1,1,123456,1\n")
    assert "Ip = " in study.read_text()
    assert main(["check", str(study)]) == 0
    out = capsys.readouterr().out
    assert "no faults found" in out
    study.write_text(re.sub(r"Ip = .*", "Ip = 1e-9", study.read_text()))
    main(["check", str(study)])
    assert "is not Iy + Iz" in capsys.readouterr().out


def test_unknown_units_of_a_deck_are_refused_alone(tmp_path, root, capsys):
    (tmp_path / "a.bdf").write_text(f"{LUMPED}SPC1,1,123456,1\n")
    test = root / "examples" / "first-frame" / "test.uff"
    words = ["--from", str(tmp_path / "a.bdf"), str(test), "--units", "mm-N-t"]
    assert main(["new", str(tmp_path / "s"), *words]) == 2
    err = capsys.readouterr().err
    assert err.startswith("dovetail: the units are 'mm-N-t'; allowed are")
    assert err.count("\n") == 1


@pytest.mark.filterwarnings("ignore:.*cards left out")
def test_a_card_that_is_no_bar_is_named_where_units_of_a_deck_are_stated(tmp_path, root, capsys):
    """Read as a mesh the deck would be 1000 times as large as its test, of which alone the message spoke."""
    (tmp_path / "a.bdf").write_text(f"{LUMPED}CQUAD4,9,1,1,2,3,3\n")
    test = root / "examples" / "first-frame" / "test.uff"
    words = ["--from", str(tmp_path / "a.bdf"), str(test)]
    assert main(["new", str(tmp_path / "s"), *words, "--units", "mm-t-s"]) == 2
    assert "CQUAD4" in capsys.readouterr().err
    assert main(["new", str(tmp_path / "s"), *words]) == 2
    err = capsys.readouterr().err.replace(f"{tmp_path}/", "")
    assert "give --units mm; the deck is read as a mesh: a.bdf" in err


@pytest.mark.parametrize("comment", ["", "$ Länge in mm\n"])
def test_a_deck_in_place_of_a_study_is_named(tmp_path, capsys, comment):
    (tmp_path / "a.bdf").write_text(comment + LUMPED, encoding="latin-1")
    assert main(["compare", str(tmp_path / "a.bdf")]) == 2
    message = "a.bdf: it is a deck of Nastran; 'dovetail new DIR --from a.bdf' makes a study of it"
    assert message in capsys.readouterr().err


def test_a_folder_in_place_of_a_study_names_the_study_in_it(tmp_path, capsys):
    assert main(["check", str(tmp_path)]) == 2
    assert "did you mean" not in capsys.readouterr().err
    (tmp_path / "study.toml").write_text("")
    assert main(["check", str(tmp_path)]) == 2
    assert f"a folder; did you mean '{tmp_path / 'study.toml'}'?" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("support", "words"),
    [
        ("", "the structure is free. If something holds it, [[supports]] are missing (in a deck SPC"),
        ("CBUSH,9,9,1,,,,,0\nPBUSH,9,K,1.+3,1.+3,1.+3,1.+6,1.+6,1.+6\n", "held by CBUSH 9 alone\n"),
        ("CBUSH,9,9,1,,,,,0\nPBUSH,9,K,1.+3\n", "CBUSH 9 alone, and free in 5 rigid-body motions"),
        ("SPC1,1,123456,1\n", ""),
    ],
)
def test_a_structure_without_supports_is_noted_and_is_no_fault(tmp_path, capsys, support, words):
    # with lumped mass alone a straight frame would turn about its axis without mass
    study = made(tmp_path, f"{LUMPED}PARAM,COUPMASS,1\n{support}")
    new = capsys.readouterr().out
    assert main(["check", str(study)]) == 0
    check = capsys.readouterr().out
    assert "no faults found" in check
    for out in (new, check):
        assert words in out
        assert ("no supports are given" in out) == bool(words)


@pytest.mark.parametrize("springs", ["CBUSH,5,5,2,3,,,,0", ""])
def test_points_that_springs_join_are_no_fault(tmp_path, capsys, springs):
    """Two springs between grid points at one place: only points that nothing joins are noted."""
    cards = (
        "SOL 103",
        "CEND",
        "SPC = 3",
        "BEGIN BULK",
        "PARAM,COUPMASS,1",
        "MAT1,1,210000.,,0.3,7.85-9",
        "PBARL,1,1,,BAR",
        "+,20.,30.",
        "GRID,1,,0.,0.,0.",
        "GRID,2,,500.,0.,0.",
        "GRID,3,,500.,0.,0.",
        "GRID,4,,1000.,0.,0.",
        "CBAR,1,1,1,2,0.,0.,1.",
        "CBAR,2,1,3,4,0.,0.,1.",
        springs,
        springs.replace(",5,5,", ",6,6,"),
        "PBUSH,5,K,1.+6,1.+6,1.+6",
        "PBUSH,6,K,,,,1.+8,1.+8,1.+8",
        "SPC1,3,123456,1",
        "ENDDATA",
    )
    (tmp_path / "f.bdf").write_text("\n".join(cards))
    study = str(tmp_path / "s" / "study.toml")
    assert main(["new", str(tmp_path / "s"), "--from", str(tmp_path / "f.bdf"), "--units", "mm-t-s"]) == 0
    assert main(["check", study]) == 0
    printed = capsys.readouterr().out
    assert ("at the place of another" in printed) == (not springs)
    assert ("no faults found" in printed) == bool(springs)
