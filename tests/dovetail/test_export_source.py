"""``dovetail export`` into the deck that a study was made of: cards that the deck takes as they are."""

import json
import re
import warnings
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from dovetail import load_study, main
from fem import assemble, first_modes
from fem.io import read_model

CORNERS = {
    11: (0, 0, 0),
    12: (0, 0, 400),
    13: (0, 0, 800),
    14: (500, 0, 800),
    15: (1000, 0, 800),
    16: (1000, 0, 400),
    17: (1000, 0, 0),
    18: (1000, 600, 0),
}
SPANS = (
    (11, 12, "leg"),
    (12, 13, "leg"),
    (13, 14, "rail"),
    (14, 15, "rail"),
    (15, 16, "leg"),
    (16, 17, "leg"),
)
PIECES = 4
"""Elements of a span; a node behind a released end is free in a deck, which needs short elements."""


def frame() -> tuple[dict[int, np.ndarray], list[tuple[int, int, int, str]]]:
    """Return the nodes [mm] and the elements of a portal with a brace: number, two nodes, kind."""
    nodes = {n: np.array(p, dtype=float) for n, p in CORNERS.items()}
    elements: list[tuple[int, int, int, str]] = []
    for a, b, kind in (*SPANS, (15, 18, "brace")):
        chain = [a, *range(31 + 10 * len(elements), 31 + 10 * len(elements) + PIECES - 1), b]
        for k, n in enumerate(chain[1:-1], 1):
            nodes[n] = nodes[a] + (nodes[b] - nodes[a]) * k / PIECES
        elements += [(101 + len(elements) + k, i, j, kind) for k, (i, j) in enumerate(pairwise(chain))]
    return nodes, elements


def nastran() -> str:
    """The rail's second element has another form of orientation; two grid points have skew axes."""
    nodes, elements = frame()
    grids = [f"GRID,{n},,{p[0]},{p[1]},{p[2]}{',2' if n in (13, 14) else ''}" for n, p in nodes.items()]
    cards = {
        "leg": ("CBAR", 4, "1.,0.,0."),
        "rail": ("CBEAM", 5, "0.,0.,1."),
        "brace": ("CBAR", 9, "0.,0.,1."),
    }
    bars = [f"{cards[k][0]},{n},{cards[k][1]},{i},{j},{cards[k][2]}" for n, i, j, k in elements]
    return "\n".join(
        (
            "SOL 103",
            "CEND",
            "SPC = 3",
            "METHOD = 1",
            "BEGIN BULK",
            "EIGRL,1,,,10",
            "PARAM,COUPMASS,1",
            # G is not E / 2 (1 + nu), and there is more than a model needs
            "MAT1,7,210000.,81000.,,7.85-9,1.2-5",
            "MAT1,8,70000.,,0.33,2.7-9",
            "PBARL,4,7,,TUBE",
            "+,20.,16.",
            "PBEAM,5,7,400.,40000.,13333.,,30000.",
            "PBARL,9,8,,BAR",
            "+,20.,30.",
            "CORD2R,2,,0.,0.,0.,0.,0.,1.",
            "+,0.6,0.8,0.",
            *grids,
            *bars,
            "CONM2,201,14,,0.002",
            "CBUSH,202,50,18,,,,,0",
            "PBUSH,50,K,1.+6,1.+6,1.+6,1.+8,1.+8,1.+8",
            "SPC1,3,123456,11,17",
            "ENDDATA",
            "",
        )
    )


def abaqus() -> str:
    nodes, elements = frame()
    blocks = []
    for kind in ("leg", "rail", "brace"):
        blocks.append(f"*ELEMENT, TYPE=B31, ELSET={kind.upper()}")
        blocks += [f"{n}, {i}, {j}" for n, i, j, k in elements if k == kind]
    return "\n".join(
        (
            "*HEADING",
            "portal",
            "*NODE",
            *(f"{n}, {p[0]}, {p[1]}, {p[2]}" for n, p in nodes.items()),
            *blocks,
            "*MATERIAL, NAME=STEEL",
            "*DENSITY",
            "7.85E-9,",
            "*ELASTIC",
            "210000., 0.3",
            "*MATERIAL, NAME=ALU",
            "*ELASTIC",
            "70000., 0.33",
            "*DENSITY",
            "2.7E-9,",
            "*BEAM SECTION, ELSET=LEG, SECTION=PIPE, MATERIAL=STEEL",
            "20., 4.",
            "1., 0., 0.",
            "*BEAM SECTION, ELSET=RAIL, SECTION=RECT, MATERIAL=STEEL",
            "20., 30.",
            "0., 1., 0.",
            "*BEAM SECTION, ELSET=BRACE, SECTION=RECT, MATERIAL=ALU",
            "20., 30.",
            "1., 0., 0.",
            "*ELEMENT, TYPE=MASS, ELSET=PUMP",
            "201, 14",
            "*MASS, ELSET=PUMP",
            "0.002",
            "*ELEMENT, TYPE=SPRING1, ELSET=FOOT",
            "202, 18",
            "*SPRING, ELSET=FOOT",
            "1",
            "",
            "1.E6",
            "*BOUNDARY",
            "11, 1, 6",
            "17, 1, 6",
            "18, 2, 4",
            "*STEP",
            "*FREQUENCY",
            "10,",
            "*END STEP",
            "",
        )
    )


def ansys() -> str:
    nodes, elements = frame()
    nodes |= {19: nodes[18], 20: np.array([3000.0, 900.0, 2000.0])}
    kinds = {"leg": (7, 4), "rail": (7, 5), "brace": (8, 5)}
    rows = [(kinds[k][0], 1, 1, kinds[k][1], n, i, j, 20) for n, i, j, k in elements]
    rows += [(1, 2, 2, 1, 201, 14), (1, 3, 3, 1, 202, 18, 19)]
    block = ["".join(f"{x:9d}" for x in (*row[:4], 0, 0, 0, 0, len(row) - 5, 0, *row[4:])) for row in rows]
    return "\n".join(
        (
            "/PREP7",
            "ET,1,188",
            "KEYOPT,1,3,3",
            "ET,2,21",
            "ET,3,14",
            "KEYOPT,3,2,1",
            "R,2,0.002,0.002,0.002,0.,0.,0.",
            "R,3,1000000.,0.",
            "MPTEMP,R5.0, 1, 1,  0.00000000    ,",
            "MPDATA,R5.0, 1,EX  ,       7, 1,  210000.",
            "MPDATA,R5.0, 1,PRXY,       7, 1,  0.3",
            "MPDATA,R5.0, 1,DENS,       7, 1,  7.85E-09",
            "MP,EX,8,70000.",
            "MP,PRXY,8,0.33",
            "MP,DENS,8,2.7E-9",
            "SECTYPE,4,BEAM,CTUBE",
            "SECDATA,16.,20.",
            "SECTYPE,5,BEAM,RECT",
            "SECDATA,20.,30.",
            f"NBLOCK,6,SOLID,{max(nodes):10d},{len(nodes):10d}",
            "(3i9,6e21.13e3)",
            *(f"{n:9d}{0:9d}{0:9d}" + "".join(f"{x:21.13E}" for x in p) for n, p in nodes.items()),
            "N,R5.3,LOC,       -1,",
            f"EBLOCK,19,SOLID,{202:10d},{len(rows):10d}",
            "(19i9)",
            *block,
            "       -1",
            "D,11,ALL,0",
            "D,17,ALL,0",
            "D,19,ALL,0",
            "D,18,UY,0,,,,UZ,ROTX",
            "/SOLU",
            "ANTYPE,MODAL",
            "",
        )
    )


DECKS = {
    "nastran": ("frame.bdf", nastran()),
    "abaqus": ("frame.inp", abaqus()),
    "ansys": ("frame.cdb", ansys()),
}
ADDED = '\n[[masses]]\nname = "cabinet"\npoint = "node 12"\nmass = 1.5\n'


def member(folder: Path, first: str, last: str) -> str:
    """Return the member that has two points."""
    mesh = load_study(folder / "study.toml").model.mesh
    ends = {mesh.point_names[first], mesh.point_names[last]}
    return next(name for name in mesh.members if ends <= set(mesh.member_points(name).tolist()))


def effect(candidate: str, **values: float) -> str:
    lines = "".join(f"{key} = {value!r}\n" for key, value in values.items())
    return f'\n[[effects]]\ncandidate = "{candidate}"\n{lines}'


def estimates(entries: dict[str, str]) -> str:
    return "\n[estimates]\n" + "".join(f"{json.dumps(name)} = {{ {of} }}\n" for name, of in entries.items())


def in_table(text: str, header: str, line: str) -> str:
    """Return a study with a line in one of its tables."""
    if header in text:
        return text.replace(header, f"{header}\n{line}")
    return f"{text}\n{header}\n{line}\n"


Change = Callable[[Path, str], str]
CASES: dict[str, Change] = {
    "fitted modulus": lambda folder, text: text.replace("E = 210e9", "E = 199e9"),
    "end release": lambda folder, text: (
        text + effect(f"end_release:{member(folder, 'node 15', 'node 18')}.1.rz", compliance=2e-4)
    ),
    "end release next to a skew grid point": lambda folder, text: (
        text + effect(f"end_release:{member(folder, 'node 12', 'node 13')}.2.ry", compliance=2e-5)
    ),
    "end release at a support": lambda folder, text: in_table(
        text, f'[members."{member(folder, "node 11", "node 12")}"]', "spring1 = { ry = 50000.0 }"
    ),
    "added mass": lambda folder, text: text + ADDED,
    "mass within an element": lambda folder, text: (
        text + effect(f"point_mass:{member(folder, 'node 14', 'node 15')}", mass=0.7, position=0.62)
    ),
    "mass of the deck": lambda folder, text: re.sub(r"^mass = .*", "mass = 3.1", text, flags=re.MULTILINE),
    "soft support": lambda folder, text: text + effect("support_flexibility:node 17.ry", stiffness=9000.0),
    "softer member": lambda folder, text: (
        text + effect(f"member_stiffness:{member(folder, 'node 15', 'node 16')}", change=-0.2)
    ),
    "softer member and fitted modulus": lambda folder, text: (
        text.replace("E = 210e9", "E = 199e9")
        + effect(f"member_stiffness:{member(folder, 'node 15', 'node 16')}", change=-0.2)
    ),
    "thinner section": lambda folder, text: re.sub(r"^t = .*", "t = 0.0034", text, flags=re.MULTILINE),
    "spring of the deck": lambda folder, text: re.sub(r"kx = [\d.e+]+", "kx = 600000.0", text),
}


def followed(deck: str, cards: str) -> str:
    """Return a deck with cards in it, and without the lines that their comments name."""
    lines = deck.splitlines()
    gone: set[int] = set()
    for found in re.finditer(r"replaces .* of frame\.\w+, lines? ([\d, -]+)$", cards, re.MULTILINE):
        for part in found[1].split(","):
            first, _, last = part.partition("-")
            gone |= set(range(int(first), int(last or first) + 1))
    control = re.findall(r"^\$ case control: (.*)$", cards, re.MULTILINE)
    out: list[str] = []
    put = False
    for k, line in enumerate(lines, 1):
        if line == "BEGIN BULK":
            out += control
        if re.match(r"ENDDATA|\*STEP|/SOLU", line):
            out += cards.splitlines()
            put = True
        if k not in gone:
            out.append(line)
    assert put
    return "\n".join(out) + "\n"


def frequencies(path: Path) -> np.ndarray:
    model = load_study(path).model if path.suffix == ".toml" else None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # notes of the reader
        model = model or read_model(path, "mm-t-s")
    return first_modes(assemble(model), 6).frequency


@pytest.fixture
def made(tmp_path, request, monkeypatch):
    """A folder with a deck, and the study of it."""
    name, text = DECKS[request.param]
    monkeypatch.chdir(tmp_path)
    Path(name).write_text(text)
    assert main(["new", "s", "--from", name, "--units", "mm-t-s"]) == 0
    return request.param, name, text


@pytest.mark.parametrize("made", DECKS, indirect=True)
@pytest.mark.parametrize("case", CASES)
def test_deck_with_the_cards_has_the_frequencies_of_the_study(made, case, capsys):
    program, name, text = made
    study = Path("s/study.toml").read_text()
    found = Path("s/found.toml")
    found.write_text(CASES[case](Path("s"), study))
    assert found.read_text() != study
    out, merged = Path(f"cards{Path(name).suffix}"), Path(f"merged{Path(name).suffix}")
    capsys.readouterr()
    assert main(["export", str(found), "--fitted", f"--{program}", str(out), "--merge", str(merged)]) == 0
    Path("by_hand").mkdir()
    hand = Path("by_hand") / name
    hand.write_text(followed(text, out.read_text()))
    expected = frequencies(found)
    assert np.abs(frequencies(Path("s/study.toml")) / expected - 1).max() > 1e-4
    # a node that a deck has and the study has not is free there; all else is rounding
    bound = 5e-5 if "end release" in case or "within" in case else 1e-7
    for deck in (hand, merged):
        assert np.abs(frequencies(deck) / expected - 1).max() < bound, out.read_text()


EFFECTS = {
    "added mass": lambda folder: effect(
        f"point_mass:{member(folder, 'node 12', 'node 13')}", mass=1.5, position=0.2
    ),
    "soft support": lambda folder: effect("support_flexibility:node 17.ry", stiffness=9000.0),
    "end release": lambda folder: effect(
        f"end_release:{member(folder, 'node 15', 'node 18')}.1.rz", compliance=2e-4
    ),
    "spring to the ground": lambda folder: effect(
        f"ground_spring:{member(folder, 'node 11', 'node 12')}.2.y", stiffness=4e5
    ),
}
INCLUDED = {
    "nastran": ("ENDDATA", "INCLUDE 'cards.bdf'\nENDDATA"),
    "abaqus": ("*STEP", "*INCLUDE, INPUT=cards.inp\n*STEP"),
}
"""How a deck includes cards; Dovetail reads no /INPUT of ANSYS."""


@pytest.mark.parametrize("made", DECKS, indirect=True)
@pytest.mark.parametrize("case", EFFECTS)
def test_deck_that_includes_the_effects_alone_is_the_deck_with_the_effects(made, case, capsys):
    """What was fitted beside them, here the modulus, stays as the deck has it."""
    program, name, text = made
    study = Path("s/study.toml").read_text()
    Path("s/effects.toml").write_text(study + EFFECTS[case](Path("s")))
    of = load_study("s/effects.toml").model.values()
    (modulus,) = (f"{e}.{p}" for (e, p), value in of.items() if value == 210e9)
    found_text = Path("s/effects.toml").read_text().replace("E = 210e9", "E = 199e9")
    Path("s/found.toml").write_text(found_text + estimates({modulus: "before = 210e9, std = 1e9"}))
    cards = Path(f"cards{Path(name).suffix}")
    capsys.readouterr()
    assert main(["export", "s/found.toml", f"--{program}", str(cards)]) == 0
    printed, written = capsys.readouterr().out, cards.read_text()
    left = f"not in this file, fitted values; --fitted exports them: E of {modulus.partition(':')[2]} 199.0"
    assert left in printed
    old, new = INCLUDED.get(program, ("/SOLU", f"{written}\n/SOLU"))
    including = text.replace(old, new, 1)
    for found in re.finditer(r"replaces .* of frame\.\w+, lines? (\d+)$", written, re.MULTILINE):
        including = including.replace(text.splitlines()[int(found[1]) - 1] + "\n", "")
    control = re.findall(r"^\$ case control: (.*)$", written, re.MULTILINE)
    including = including.replace("BEGIN BULK", "\n".join([*control, "BEGIN BULK"]))
    Path(name).with_stem("including").write_text(including)
    expected = frequencies(Path("s/effects.toml"))
    assert np.abs(frequencies(Path("s/study.toml")) / expected - 1).max() > 1e-4
    assert np.abs(frequencies(Path(f"including{Path(name).suffix}")) / expected - 1).max() < 5e-5, written


@pytest.mark.parametrize(("std", "divided"), [(0.002, False), (0.0005, True)])
def test_an_effect_is_at_a_node_that_is_as_near_as_its_position_is_known(found, capsys, std, divided):
    """Then one card is included and none replaced."""
    text = (found / "study.toml").read_text()
    mass = f"point_mass:{member(found, 'node 14', 'node 15')}"
    errors = estimates({f"{mass}.mass": "std = 0.01", f"{mass}.position": f"std = {std}"})
    (found / "found.toml").write_text(text + effect(mass, mass=0.7, position=0.126) + errors)
    (found / "at_node.toml").write_text(text + effect(mass, mass=0.7, position=0.126 if divided else 0.125))
    capsys.readouterr()
    words = ["--nastran", "cards.bdf", "--merge", "merged.bdf"]
    assert main(["export", "s/found.toml", *words]) == 0
    cards = Path("cards.bdf").read_text()
    assert ("replaces CBEAM" in cards) == ("GRID*" in cards) == divided
    assert ("at the nearest node, 1 mm away" in capsys.readouterr().out) != divided
    expected = frequencies(found / "at_node.toml")
    assert np.abs(frequencies(Path("merged.bdf")) / expected - 1).max() < 5e-5


def test_fitted_values_are_exported_where_they_are_asked_for(found, capsys):
    """A modulus that moved by eleven standard deviations: a note without, a card with."""
    text, mass = (found / "study.toml").read_text(), f"point_mass:{member(found, 'node 14', 'node 15')}"
    of = load_study(found / "study.toml").model.values()
    (modulus,) = (f"{e}.{p}" for (e, p), value in of.items() if value == 210e9)
    text = text.replace("E = 210e9", "E = 199e9") + effect(mass, mass=0.7, position=0.125)
    (found / "found.toml").write_text(text + estimates({modulus: "before = 210e9, std = 1e9"}))
    for more, fitted in (((), False), (("--fitted",), True)):
        capsys.readouterr()
        assert main(["export", "s/found.toml", "--nastran", "cards.bdf", *more]) == 0
        assert ("--fitted exports them: " in capsys.readouterr().out) != fitted
        assert bool(re.search(r"^MAT1", Path("cards.bdf").read_text(), re.M)) == fitted


def test_effects_alone_need_effects(found, capsys):
    assert main(["export", "s/study.toml", "--nastran", "c.bdf"]) == 2
    assert "it has no [[effects]]; dovetail run writes them into found.toml" in capsys.readouterr().err
    assert main(["export", "s/found.toml", "--nastran", "c.bdf", "--fitted", "--whole"]) == 2
    assert "give one of them" in capsys.readouterr().err


def test_effects_without_a_card_are_named_with_the_reason(found, capsys):
    text = (found / "study.toml").read_text()
    form = f"section_form:{member(found, 'node 14', 'node 15')}"
    (found / "found.toml").write_text(text + effect(form, A=0.02))
    assert main(["export", "s/found.toml", "--nastran", "cards.bdf"]) == 2
    error = capsys.readouterr().err
    assert "no card is for its [[effects]]: not in this file, uncertain form; --fitted exports" in error
    assert "section form: section of member " in error
    assert not Path("cards.bdf").exists()


def test_cards_without_a_deck_name_the_bar_of_a_released_end(found, capsys):
    """Of a bar that only gets another property, the property is written and nothing is to be removed."""
    study = (found / "study.toml").read_text()
    here = re.sub(r"\[source\]\nfile.*\nunits.*\n", "", study)
    brace, printed = member(found, "node 15", "node 18"), lambda: capsys.readouterr().out
    released = effect(f"end_release:{brace}.1.rz", compliance=2e-4)
    for found_effect, bars in ((released, 1), (effect(f"member_stiffness:{brace}", change=-0.2), 0)):
        (found / "found.toml").write_text(here + found_effect)
        assert main(["export", "s/found.toml", "--nastran", "cards.bdf"]) == 0
        written = numbers(Path("cards.bdf").read_text(), "CBAR|CBEAM")
        notes = re.findall(
            r"take out of the model the bars that these cards replace: (\d+)$", printed(), re.M
        )
        assert len(written) == bars
        assert notes == [str(n) for n in written]


@pytest.mark.parametrize(
    "case", ["softer member", "softer member and fitted modulus", "fitted modulus", "thinner section"]
)
def test_members_that_comments_name_share_a_card(tmp_path, monkeypatch, case):
    monkeypatch.chdir(tmp_path)
    text = nastran().replace("MAT1,", "$ metal\nMAT1,")
    for k in range(7):
        text = re.sub(rf"^(CBAR|CBEAM),{101 + PIECES * k},", rf"$ part{k}\n\g<0>", text, flags=re.MULTILINE)
    Path("frame.bdf").write_text(text)
    assert main(["new", "s", "--from", "frame.bdf", "--units", "mm-t-s"]) == 0
    folder = Path("s")
    study = (folder / "study.toml").read_text()
    assert "part5" in study
    assert {"[materials.metal]", '[materials."metal.2"]'} <= {*study.splitlines()}
    (folder / "found.toml").write_text(CASES[case](folder, study))
    assert (
        main(["export", "s/found.toml", "--fitted", "--nastran", "cards.bdf", "--merge", "merged.bdf"]) == 0
    )
    expected = frequencies(folder / "found.toml")
    assert np.abs(frequencies(folder / "study.toml") / expected - 1).max() > 1e-4
    assert np.abs(frequencies(Path("merged.bdf")) / expected - 1).max() < 1e-7
    one_card = case in ("fitted modulus", "thinner section")
    assert ("CBAR" not in Path("cards.bdf").read_text()) == one_card


def test_matrices_that_a_merged_deck_is_read_without_are_named(found, capsys):
    text = (found / "study.toml").read_text()
    rail = member(found, "node 14", "node 15")
    text += effect(f"distributed_mass:{rail}", mass=5.0, position=0.2, width=0.1)
    (found / "found.toml").write_text(text)
    assert (
        main(["export", "s/found.toml", "--fitted", "--nastran", "cards.bdf", "--merge", "merged.bdf"]) == 0
    )
    printed = capsys.readouterr().out
    assert "Dovetail does not read its matrices (M2GG)" in printed
    assert "released" not in printed


def test_form_beside_the_effects_is_that_of_the_report(found, capsys):
    """Beyond its standard deviation a form may be as usual: no report names it, and no card is for it."""
    text = (found / "study.toml").read_text()
    form = f"section_form:{member(found, 'node 14', 'node 15')}"
    fitted = f'\n[fitted_form]\n"{form}" = {{ A = 0.08, Iy = 0.03 }}\n'
    errors = {f"{form}.A": "std = 0.05", f"{form}.Iy": "std = 0.01, outside = true"}
    (found / "found.toml").write_text(text + fitted + estimates(errors))
    assert (
        main(["export", "s/found.toml", "--fitted", "--nastran", "cards.bdf", "--merge", "merged.bdf"]) == 0
    )
    printed = capsys.readouterr().out
    assert "Iy 0.030 ± 0.010" in printed
    member_name = form.partition(":")[2]
    usual = f"form within its usual range: section of member {member_name}: mass per length"
    assert f"note: not in this file, {usual}" in printed
    assert not numbers(Path("cards.bdf").read_text(), "MAT1")  # A changes a section's mass by its density
    assert re.search(r"frequencies agree with those of the study to [\d.e-]+ %", printed)


def test_only_released_ends_explain_differences(found, capsys):
    text = (found / "study.toml").read_text()
    rail = member(found, "node 14", "node 15")
    (found / "found.toml").write_text(text + effect(f"section_form:{rail}", A=0.5, Iy=0.9, Iz=0.9, J=0.5))
    assert (
        main(["export", "s/found.toml", "--fitted", "--nastran", "cards.bdf", "--merge", "merged.bdf"]) == 0
    )
    assert "released" not in capsys.readouterr().out


@pytest.fixture
def found(tmp_path, monkeypatch):
    """The folder of a study of a Nastran deck with an end release."""
    monkeypatch.chdir(tmp_path)
    Path("frame.bdf").write_text(nastran())
    assert main(["new", "s", "--from", "frame.bdf", "--units", "mm-t-s"]) == 0
    folder = Path("s")
    text = (folder / "study.toml").read_text()
    (folder / "found.toml").write_text(CASES["end release"](folder, text.replace("E = 210e9", "E = 199e9")))
    return folder


def numbers(deck: str, card: str) -> list[int]:
    return [int(n) for n in re.findall(rf"^(?:{card})(?:\*\s+|,)(\d+)", deck, re.MULTILINE)]


def test_cards_keep_the_numbers_of_the_deck_and_name_what_they_replace(found, capsys):
    assert (
        main(["export", "s/found.toml", "--fitted", "--nastran", "cards.bdf", "--merge", "merged.bdf"]) == 0
    )
    printed, cards = capsys.readouterr().out, Path("cards.bdf").read_text()
    deck = nastran()
    assert numbers(cards, "MAT1") == [7]
    assert "$ replaces MAT1 7 of frame.bdf, line 8" in cards
    assert "1.2-5" in cards  # thermal expansion, which no frame model has
    (element,) = numbers(cards, "CBAR")
    assert element in numbers(deck, "CBAR")
    assert f"$ replaces CBAR {element} of frame.bdf" in cards
    assert "PBAR" not in cards
    assert "PBEAM" not in cards
    assert min(numbers(cards, "GRID")) > max(numbers(deck, "GRID"))
    assert min(numbers(cards, "CBUSH")) > 202
    assert min(numbers(cards, "PBUSH")) > 50
    assert "$ case control: MPC = 1" in cards
    assert "units mm-t-s" in cards
    assert "\nMPC = 1\nBEGIN BULK" in Path("merged.bdf").read_text()
    assert "$ replaced: MAT1,7," in Path("merged.bdf").read_text()
    assert "merged.bdf, read again: its natural frequencies are those of the study" in printed


def test_source_may_be_given_and_lost(found, capsys):
    study = Path("s/found.toml").read_text()
    Path("deck").mkdir()
    Path("frame.bdf").rename("deck/frame.bdf")
    assert main(["export", "s/found.toml", "--fitted", "--nastran", "lost.bdf"]) == 0
    assert "frame.bdf, the deck of [source], is not there: new cards are numbered from 900001" in (
        capsys.readouterr().out
    )
    lost = Path("lost.bdf").read_text()
    assert {numbers(lost, card)[0] for card in ("GRID", "MAT1", "PBEAM", "MPC")} == {900001}
    Path("s/found.toml").write_text(re.sub(r"\[source\]\nfile.*\nunits.*\n", "", study))
    into = ["--into", "deck/frame.bdf", "--units", "mm-t-s"]
    assert main(["export", "s/found.toml", "--fitted", "--nastran", "cards.bdf", *into]) == 0
    assert "$ replaces MAT1 7 of frame.bdf, line 8" in Path("cards.bdf").read_text()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--merge", "m.bdf", "--units", "SI"], "--units SI: the units of frame.bdf are mm-t-s"),
        (["--merge", "m.bdf", "--into", "none.bdf"], "--into none.bdf: a deck that is there is needed"),
        (["--merge", "m.bdf", "--whole"], "--merge m.bdf needs the source deck: it takes no --whole"),
        (["--merge", "frame.bdf"], "frame.bdf"),
        (["--merge", "m.bdf", "--into", "frame.bdf", "--units", "SI"], "are these its units?"),
    ],
)
def test_errors_of_the_source_are_one_line(found, capsys, options, message):
    capsys.readouterr()
    assert main(["export", "s/found.toml", *options]) == 2
    error = capsys.readouterr().err.strip()
    assert message in error
    assert "\n" not in error
    assert Path("frame.bdf").read_text() == nastran()


def test_study_of_an_unchanged_deck_has_nothing_to_export(found, capsys):
    assert main(["export", "s/study.toml", "--fitted", "--nastran", "cards.bdf"]) == 2
    assert "its model is that of frame.bdf: there is nothing to export" in capsys.readouterr().err


def test_constant_shear_stiffness_does_not_follow_a_fitted_modulus(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = abaqus().replace("0., 1., 0.\n", "0., 1., 0.\n*TRANSVERSE SHEAR STIFFNESS\n2.E6, 1.E6\n")
    Path("frame.inp").write_text(text)
    assert main(["new", "s", "--from", "frame.inp", "--units", "mm-t-s"]) == 0
    found = Path("s/found.toml")
    found.write_text(Path("s/study.toml").read_text().replace("E = 210e9", "E = 160e9"))
    assert main(["export", "s/found.toml", "--fitted", "--abaqus", "cards.inp", "--merge", "merged.inp"]) == 0
    assert np.abs(frequencies(Path("merged.inp")) / frequencies(found) - 1).max() < 1e-9


def test_deck_with_parts_keeps_its_numbers_apart(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    head, _, rest = abaqus().partition("*NODE")
    body, _, step = rest.partition("*BOUNDARY")
    feet = step.replace("11, 1, 6", "P-1.11, 1, 6").replace("17, 1, 6", "P-1.17, 1, 6")
    feet = feet.replace("18, 2, 4", "P-1.18, 2, 4")
    materials, _, rest = body.partition("*MATERIAL")
    materials, _, sections = ("*MATERIAL" + rest).partition("*BEAM SECTION")
    part = f"*PART, NAME=P\n*NODE{body.partition('*MATERIAL')[0]}*BEAM SECTION{sections}*END PART\n"
    assembly = "*ASSEMBLY, NAME=A\n*INSTANCE, NAME=P-1, PART=P\n*END INSTANCE\n*END ASSEMBLY\n"
    Path("frame.inp").write_text(f"{head}{part}{assembly}{materials}*BOUNDARY{feet}")
    assert main(["new", "s", "--from", "frame.inp", "--units", "mm-t-s"]) == 0
    Path("s/found.toml").write_text(
        Path("s/study.toml").read_text() + effect("support_flexibility:node 17.ry", stiffness=9000.0)
    )
    assert main(["export", "s/found.toml", "--fitted", "--abaqus", "cards.inp"]) == 0
    assert "the deck has parts and instances, whose numbers repeat: new cards are numbered from 900001" in (
        capsys.readouterr().out
    )
