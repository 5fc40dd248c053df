"""Nastran decks: cards that place or join grid points are applied, or refused or named by file and line."""

import math
import time

import numpy as np
import pytest

from fem import MeshError
from fem.io.nastran import read_nastran
from fem.io.nastran_names import HARMLESS, NAMED, READ, REFUSED

TWO = "GRID,1,,0.,0.,0.\nGRID,2,,1.,0.,0.\n"
BAR = "CBAR,1,1,1,2,0.,0.,1.\n"


def write(folder, text, name="a.bdf"):
    path = folder / name
    path.parent.mkdir(exist_ok=True, parents=True)
    path.write_text(text)
    return path


def raw_of(folder, text):
    return read_nastran(write(folder, text))


def points_of(folder, text):
    raw = raw_of(folder, text + TWO.replace(",1,", ",801,").replace(",2,", ",802,") + "CROD,800,1,801,802\n")
    return dict(zip(raw.point_numbers.tolist(), np.asarray(raw.points), strict=True))


def refused(folder, text, words):
    with pytest.raises(MeshError, match=words):
        raw_of(folder, text)


def test_components_with_blanks_between_them_are_one_field(tmp_path):
    text = "GRDSET                                                  12 4 6\n" + TWO + BAR
    assert any("permanent constraints" in note for note in raw_of(tmp_path, text).notes)


# Coordinate systems -------------------------------------------------------------------------------------


def test_systems_refer_to_others_and_come_in_any_order(tmp_path):
    text = (
        "GRID,1,9,1.,90.,0.\nCORD2C,9,8,0.,0.,1.,0.,0.,2.\n,1.,0.,1.\n"
        "CORD2R,8,,10.,0.,0.,10.,0.,1.\n,10.,1.,0.\n"
    )
    # system 8: x along global y, y along global -x, at (10, 0, 0); system 9 is 1 above it; θ = 90° is its y
    np.testing.assert_allclose(points_of(tmp_path, text)[1], [9, 0, 1], atol=1e-14)


def test_spherical_system_has_theta_from_z(tmp_path):
    text = "CORD2S,1,0,0.,0.,0.,0.,0.,1.\n,1.,0.,0.\nGRID,5,1,2.,30.,90.\n"
    np.testing.assert_allclose(points_of(tmp_path, text)[5], [0, 1, math.sqrt(3)], atol=1e-14)


def test_systems_of_grid_points_two_on_a_card(tmp_path):
    text = "GRID,1,,5.,0.,0.\nGRID,2,,5.,0.,1.\nGRID,3,,5.,1.,0.\nCORD1R,7,1,2,3,8,2,1,3\n"
    found = points_of(tmp_path, text + "GRID,4,7,2.,0.,0.\nGRID,5,8,0.,0.,3.\n")
    np.testing.assert_allclose(found[4], [5, 2, 0], atol=1e-14)
    np.testing.assert_allclose(found[5], [5, 0, -2], atol=1e-14)


def test_grdset_fills_blank_fields_but_not_zeros(tmp_path):
    text = (
        "CORD2C,7,0,0.,0.,0.,0.,0.,1.\n,1.,0.,0.\nGRID,1,,2.,90.,0.\nGRID,2,0,2.,90.,0.\nGRDSET,,7,,,,7,456\n"
    )
    raw = raw_of(tmp_path, text + BAR)
    np.testing.assert_allclose(raw.points, [[0, 2, 0], [2, 90, 0]], atol=1e-14)
    assert raw.notes == [
        "2 cards with displacement systems (first: GRID 1 at line 3); CD turns the directions "
        "of loads and results; "
        "positions stay",
        "2 cards with permanent constraints (first: GRDSET at line 5); give [[supports]] in the study file",
    ]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            "GRID,3,7,0.,0.,0.\n",
            "line 4: grid point 3 is in coordinate system 7, which the file does not have",
        ),
        (
            "CORD2R,7,8,0.,0.,0.,0.,0.,1.\n,1.,0.,0.\nCORD2R,8,7,0.,0.,0.,0.,0.,1.\n,1.,0.,0.\n"
            "GRID,3,7,0.,0.,0.\n",
            "line 6: coordinate systems refer to each other: 7 → 8 → 7",
        ),
        ("CORD1R,7,3,1,2\nGRID,3,7,0.,0.,0.\n", "line 4: coordinate systems refer to each other: 7 → 7"),
        (
            "CORD2R,7,8,0.,0.,0.,0.,0.,1.\n,1.,0.,0.\nGRID,3,7,1.,1.,1.\n",
            "line 4: coordinate system 7 is in coordinate system 8",
        ),
        (
            "CORD2R,7,,0.,0.,0.,0.,0.,1.\n,0.,0.,2.\nGRID,3,7,1.,1.,1.\n",
            "line 4: coordinate system 7 has no axes",
        ),
        ("CORD1R,7,1,2,99\nGRID,3,7,1.,1.,1.\n", "line 4: coordinate system 7 refers to grid point 99"),
        (
            "CORD1R,7,1,2,3\nCORD1C,7,1,2,3\n",
            "line 5: coordinate system 7 is already defined, differently, at a.bdf: line 4;",
        ),
        ("CORD3G,7,1,2,3\n", r"line 4: CORD3G \(a coordinate system\) is not supported"),
        ("GRDSET,,7\nGRDSET,,8\n", "line 5: GRDSET gives other defaults than the one at a.bdf: line 4"),
        ("GRID,3,,1e999,0.,0.\n", "line 4: GRID 3, , 1e999.* is not a finite number"),
        ("GRID,3,,nan,0.,0.\n", "line 4: GRID 3, , nan"),
        ("GRID,3,,1_0.,0.,0.\n", "line 4: GRID 3.*'1_0.' is not a number"),
        ("GRID,0,,1.,0.,0.\n", "line 4: GRID 0.*'0' is not allowed; a number of at least 1"),
        ("GRID,2,,1.,5.,0.\n", "line 4: grid point 2 is already defined, differently, at a.bdf: line 2;"),
        ("CROD,1,1,1,2\n", "line 4: element 1 is already defined, differently, at a.bdf: line 3;"),
        ("CROD,2,1,1,1\n", "line 4: CROD 2 joins a grid point with itself"),
        ("CROD,2,1,1,77\n", "line 4: CROD 2 refers to grid point 77"),
        (
            "GRID,3,,1.,0.,0.,,,,,1.,2.\n",
            "line 4: GRID 3, , 1., 0., 0. cannot be read: it has 1. after its eight fields",
        ),
        ("BEGIN SUPER=1\nGRID,3,,1.,0.,0.\n", "line 4: BEGIN SUPER=1 begins another model"),
        (
            "CBAR,2,1,1,2,0.,0.,1.,,+B1\nCROD,3,1,1,2\n+B1,5\n",
            "line 6: the continuation line \\+B1 belongs to a.bdf: line 4",
        ),
    ],
)
def test_what_is_wrong_is_named_with_its_line(tmp_path, text, words):
    refused(tmp_path, TWO + BAR + text, rf"^a\.bdf: .*{words}")


def test_the_same_card_twice_is_harmless(tmp_path):
    raw = raw_of(tmp_path, TWO + BAR + "GRID*,2,,1.,0.\n*,0.\n" + BAR)
    assert (len(raw.points), len(raw.lines), raw.notes) == (2, 1, [])


def test_a_long_chain_of_systems_needs_no_recursion(tmp_path):
    chain = "".join(f"CORD2R,{k},{k + 1},0.,0.,1.,0.,0.,2.\n,1.,0.,1.\n" for k in range(1, 3000))
    chain += "CORD2R,3000,0,0.,0.,1.,0.,0.,2.\n,1.,0.,1.\nGRID,1,1,0.,0.,0.\n"
    np.testing.assert_allclose(points_of(tmp_path, chain)[1], [0, 0, 3000])


# Bars ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["CBAR", "CBEAM"])
def test_offsets_and_pin_flags_are_counted_with_the_first(tmp_path, name):
    more = (
        f"{name},1,1,1,2,0.,0.,1.\n,5,456,0.,0.,.25\n{name},2,1,1,2,0.,0.,1.\n,,,,,,0.,0.,-.5\n"
        f"{name},3,1,1,2,0.,0.,1.\n,0,0,0.\n"
    )
    notes = raw_of(tmp_path, TWO + more).notes
    assert notes[0].startswith(
        f"1 card with pin flags (first: {name} 1 at line 3, PA = 5, PB = 456); give the members release1"
    )
    assert notes[1:] == [
        f"2 cards with offsets (first: {name} 1 at line 3, WA = 0, 0, 0.25); give the members "
        "offset1 and offset2 in the "
        "study file"
    ]


def test_offsets_of_many_bars_are_not_lost_in_bulk(tmp_path):
    grids = "".join(f"GRID    {k:8d}        {float(k):8.1f}      0.      0.\n" for k in range(1, 42))
    bars = "".join(
        f"CBAR    {k:8d}       1{k:8d}{k + 1:8d}      0.      0.      1.\n"
        f"+               {'456' if k == 17 else '':8s}\n"
        for k in range(1, 41)
    )
    assert (
        raw_of(tmp_path, grids + bars)
        .notes[0]
        .startswith("1 card with pin flags (first: CBAR 17 at line 74, PB = 456)")
    )


def test_properties_default_to_baror_and_to_the_number(tmp_path):
    raw = raw_of(
        tmp_path, TWO + "BAROR,,40,,,0.,0.,1.\nCBAR,1,,1,2\nCBAR,2,7,2,1\nCROD,3,,1,2\nCONROD,4,1,2,9,1.\n"
    )
    assert {name: rows.tolist() for name, rows in raw.sets.items()} == {
        "property 40": [0],
        "property 7": [1],
        "property 3": [2],
        "CONROD": [3],
    }


def test_three_node_and_curved_beams(tmp_path):
    raw = raw_of(tmp_path, TWO + "GRID,3,,.5,.1,0.\nCBEAM3,1,1,1,2,3,0.,0.,1.\nCBEND,2,1,1,2,0.,0.,1.,1\n")
    assert raw.lines.tolist() == [[0, 1, 2], [0, 1, -1]]
    assert raw.notes == [
        "1 card with curved elements (first: CBEND 2 at line 5); they are read as straight "
        "lines between their ends"
    ]


def test_plotel_are_lines_only_where_there_are_no_others(tmp_path):
    plot = "GRID,3,,2.,0.,0.\nPLOTEL,1,1,2,,2,2,3\n"
    raw = raw_of(tmp_path, TWO + plot)
    assert (raw.lines.tolist(), list(raw.sets)) == ([[0, 1], [1, 2]], ["PLOTEL"])
    raw = raw_of(tmp_path, TWO + plot + BAR)
    assert len(raw.lines) == 1
    assert raw.notes == [
        "2 PLOTEL lines left out (first at line 4): they carry nothing, and the file has other elements"
    ]


def test_other_cards_are_counted_by_name(tmp_path):
    text = (
        "CVISC,3,2,1,2\nCELAS1,4,2,1,1,2,1\nCELAS1,5,2,1,1,2,1\nRBE2,6,1,123456,2\n"
        "MPC,1,1,1,1.,2,1,-1.\nSPC1,1,123456,1\n"
    )
    text += (
        "CONM2,7,1,,.5\nCQUAD4,8,1,1,2,1,2\nFOOBAR,1\nPBAR,1,1\nMAT1,1,1.\nmisplaced text\n"
        "DTI,UNITS,1,KG,N,MM,S\n"
    )
    raw = raw_of(tmp_path, TWO + BAR + text)
    assert raw.left_out == {"CQUAD4 cards": 1}
    assert raw.notes == [
        "line 16: DTI,UNITS says KG N MM S; coordinates are taken as they are; give [mesh] scale "
        "if they are not in metres",
        "left out: CVISC (line 4), CELAS1 (2, first at line 5); give [[joints]] in the study file",
        "left out: RBE2 (line 7), MPC (line 8); tie the places with [[rigid_links]], "
        "[[joints]] or [[constraints]] "
        "in the study file",
        "left out: SPC1 (line 9); give [[supports]] in the study file",
        "left out: CONM2 (line 10); give [[masses]] in the study file",
        "left out, because their meaning is not known: FOOBAR (line 12), MISPLACED (line 15)",
    ]


def test_no_card_is_in_two_tables():
    tables = [set(READ), set(REFUSED), set(NAMED), set(HARMLESS)]
    assert len(set().union(*tables)) == sum(map(len, tables))


# Forms --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "text",
    [
        "GRID    3               1.5-3   -2.     +3.D0\n",
        "GRID*   3                               1.5-3           -2.\n*       3.\n",
        "GRID*,3,,1.5E-3,-2.\n*,3.\n",
        "grid,3,0,1.5-3,-2.,3.0 $ comment\n",
        "GRID 3 0 1.5-3 -2. 3.\n",
        "GRID    3 0 1.5-3 -2. 3.\n",
        "GRID\t3\t\t1.5-3\t-2.\t3.\n",
        "GRID,3,,1.5-3,-2.,3.,,,,+A\n",
    ],
)
def test_a_grid_point_in_every_form(tmp_path, text):
    np.testing.assert_allclose(points_of(tmp_path, text)[3], [1.5e-3, -2, 3])


@pytest.mark.parametrize(
    "rows",
    [
        "=,*(1),=,*(1.),==\n=(2)\n",
        "=,*1,=,*1.,==\n=2\n",
        "=       *(1)    =       *(1.)   ==\n=(2)\n",
        "=,*(1),=,*(1.),==\n" * 3,
        "GRID,*(1),=,*(1.),==\n=(2)\n",
    ],
)
def test_replication(tmp_path, rows):
    raw = raw_of(
        tmp_path, "GRID,1,,0.,2.,0.\n" + rows + "CBAR,1,7,1,2,0.,0.,1.\n=,*(1),=,*(1),*(1),==\n=(1)\n"
    )
    np.testing.assert_allclose(raw.points, [[k, 2, 0] for k in range(4)])
    assert raw.lines.tolist() == [[0, 1], [1, 2], [2, 3]]
    assert list(raw.sets) == ["property 7"]


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        ("=(3)\n", r"line 4: =\(3\) repeats no line with steps"),
        ("=,*(1),=,*(1),==\n=(900000000)\n", "line 5: .*at most 1000000"),
        ("=,*(x),==\n", "line 4: the field '1' cannot be continued in steps of 'x'"),
        ("CBAR,5,1,1,2\n,5\n=,*(1),==\n", "line 6: = repeats a card that is not there or has several lines"),
        ("CROD,=,==\n", "line 4: CROD takes fields of a CBAR card"),
    ],
)
def test_replication_of_what_cannot_be(tmp_path, rows, words):
    refused(tmp_path, TWO + BAR + rows, words)


def test_replication_of_what_is_left_out_is_left_out(tmp_path):
    assert raw_of(tmp_path, TWO + BAR + "MAT1,1,1.\n=,*(1),==\n").notes == []


@pytest.mark.parametrize(
    "quote",
    ["INCLUDE './\nsub/\ng.inc'", 'include "sub/g.inc"', "INCLUDE sub/g.inc", "INCLUDE\n'sub\\g.inc'"],
)
def test_includes_in_bulk_data_and_case_control(tmp_path, quote):
    write(tmp_path, TWO, "sub/g.inc")
    write(tmp_path, "METHOD=1\nSPC=1\n", "case.inc")
    raw = raw_of(
        tmp_path, f"SOL 103\nCEND\nINCLUDE 'case.inc'\nBEGIN BULK\n{quote}\n{BAR}ENDDATA\nGRID,9,,9.,9.,9.\n"
    )
    assert (len(raw.points), raw.notes) == (
        2,
        [f"1 lines after ENDDATA (line {6 + quote.count(chr(10)) + 1}) left out"],
    )


def test_includes_that_do_not_end_or_are_not_there(tmp_path):
    write(tmp_path, "INCLUDE 'a.bdf'\n", "b.inc")
    refused(tmp_path, "INCLUDE 'b.inc'\n", r"^b\.inc: line 1: .*includes itself \(a\.bdf → b\.inc → a\.bdf\)")
    refused(tmp_path, "INCLUDE 'c.inc'\n", r"^a\.bdf: line 1: the included file c\.inc cannot be read")
    refused(
        tmp_path, "INCLUDE 'c.inc\n" + TWO * 20, "line 1: INCLUDE has a file name whose quote ' does not end"
    )


def test_lines_in_included_files_are_named_by_their_file(tmp_path):
    write(tmp_path, "$ comment\n\nGRID,3,,x,0.,0.\n", "g.inc")
    refused(tmp_path, TWO + BAR + "INCLUDE 'g.inc'\n", r"^g\.inc: line 3: GRID 3, , x.*'x' is not a number")


def large(k):
    return f"GRID*   {k:16d}                {k / 3:16.9f}{-k / 7:16.9f}\n*       {k / 11:16.9f}\n"


def free(k):
    return f"GRID,{k},,{k / 3:.9f},{-k / 7:.9f},{k / 11:.9f}\n"


def small(k):
    return f"GRID    {k:8d}        {k / 3:8.5f}{-k / 7:8.5f}{k / 11:8.5f}\n"


@pytest.mark.parametrize("form", [large, free, small])
@pytest.mark.parametrize("bar", ["CBAR,{k},1,{k},{j},0.,0.,1.\n", "CROD    {k:8d}       1{k:8d}{j:8d}\n"])
def test_many_cards_are_as_each_of_them(tmp_path, form, bar):
    n = 60
    grids = [form(k) for k in range(1, n + 1)]
    bars = [bar.format(k=k, j=k + 1) for k in range(1, n)]
    bulk = raw_of(tmp_path, "".join(grids + bars))
    single = raw_of(tmp_path, "".join(x for pair in zip(grids, [*bars, ""], strict=True) for x in pair))
    np.testing.assert_array_equal(bulk.points, single.points)
    np.testing.assert_array_equal(bulk.lines, single.lines)
    np.testing.assert_allclose(bulk.points[-1], [n / 3, -n / 7, n / 11], atol=1e-5)
    bad = grids[40].rstrip()[:-1] + "x\n"
    refused(tmp_path, "".join([*grids[:40], bad, *grids[41:]]), r"^a\.bdf: line \d+: GRID 41")


def test_a_file_that_is_no_deck_ends_at_once(tmp_path):
    begin = time.perf_counter()
    rng = np.random.default_rng(1)
    path = tmp_path / "a.bdf"
    path.write_bytes(bytes(rng.integers(0, 256, 200_000, dtype=np.uint8).tolist()))
    raw = read_nastran(path)
    assert len(raw.lines) == 0
    assert sum(map(len, raw.notes)) < 2000
    assert time.perf_counter() - begin < 5
