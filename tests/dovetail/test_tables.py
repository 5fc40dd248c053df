"""One table, four writers: text, CSV, JSON and Excel."""

import csv
import json

import numpy as np
import pytest

from dovetail import OutputError, main
from dovetail.cli import COMMANDS, WITHOUT_TABLES, build_parser
from dovetail.report import Column, Table, write_csv, write_xlsx
from dovetail.report import table as tables
from tests.frames import STUDY

NAMES = ["a,b", 'say "x"', "=1+1"]


@pytest.fixture
def table():
    return Table.of(
        "three: rows",
        Column("name", NAMES),
        Column("share", np.array([0.5, np.nan, 1.0]), "%", ".1f", 100, key="share"),
        Column("n", range(3), key="n"),
        Column("hidden", [1.0, 2.0, 3.0], key="raw", places=()),
    )


def test_text_has_words_at_the_left_and_numbers_at_the_right(table):
    assert table.lines() == [
        "name     share %  n",
        "a,b         50.0  0",
        'say "x"        -  1',
        "=1+1       100.0  2",
    ]
    assert [line[2:] for line in Table("t", table.columns, "  ").lines()] == table.lines()


def test_json_has_values_as_they_are_by_key(table):
    share = [row["share"] for row in table.records()]
    np.testing.assert_array_equal(share, [0.5, np.nan, 1.0])
    assert [(row["n"], row["raw"]) for row in table.records()] == [(0, 1.0), (1, 2.0), (2, 3.0)]
    assert "name" not in table.records()[0]


def test_csv_is_read_back(table, tmp_path):
    write_csv(tmp_path / "t.csv", table)
    with (tmp_path / "t.csv").open(encoding="utf-8", newline="") as file:
        head, *rows = csv.reader(file)
    assert head == ["name", "share [%]", "n"]
    assert [row[0] for row in rows] == NAMES
    np.testing.assert_array_equal([float(row[1]) for row in rows], [50, np.nan, 100])


def test_excel_has_words_numbers_and_empty_cells(table, tmp_path):
    openpyxl = pytest.importorskip("openpyxl")
    write_xlsx(tmp_path / "t.xlsx", [table, table])
    book = openpyxl.load_workbook(tmp_path / "t.xlsx")
    assert book.sheetnames == ["three- rows", "three- rows (2)"]  # a colon is not allowed, nor one name twice
    rows = list(book["three- rows"].iter_rows(values_only=True))
    assert rows[0] == ("name", "share [%]", "n")
    assert rows[1:] == [("a,b", 50, 0), ('say "x"', None, 1), ("=1+1", 100, 2)]
    assert book["three- rows"]["A4"].data_type == "s"  # no formula


def test_a_table_larger_than_a_sheet_is_refused(table, tmp_path, monkeypatch):
    pytest.importorskip("openpyxl")
    monkeypatch.setattr(tables, "LARGEST_SHEET", (3, 10))  # a heading and two rows
    with pytest.raises(OutputError, match=r"three: rows has 3 rows and 3 columns.* write \.csv"):
        write_xlsx(tmp_path / "t.xlsx", [table])
    assert not (tmp_path / "t.xlsx").exists()


def test_columns_of_different_lengths_are_refused():
    with pytest.raises(ValueError, match=r"columns of \[1, 2\] rows"):
        Table.of("t", Column("a", [1]), Column("b", [1, 2]))


def test_all_commands_that_print_tables_write_them_for_excel(capsys):
    parser = build_parser()
    for name in COMMANDS:
        with pytest.raises(SystemExit):
            parser.parse_args([name, "--help"])
        assert ("--xlsx" in capsys.readouterr().out) == (name not in WITHOUT_TABLES), name


def test_sheets_hold_what_json_holds(tmp_path):
    openpyxl = pytest.importorskip("openpyxl")
    study, out, data = (tmp_path / name for name in ("study.toml", "m.xlsx", "m.json"))
    study.write_text(STUDY, encoding="utf-8")
    assert main(["modes", str(study), "--xlsx", str(out), "--json", str(data), "--quiet"]) == 0
    head, *rows = openpyxl.load_workbook(out)["modes"].iter_rows(values_only=True)
    modes = json.loads(data.read_text(encoding="utf-8"))["modes"]
    assert head[:3] == ("mode", "frequency [Hz]", "damping [%]")
    assert [row[1] for row in rows] == pytest.approx([m["frequency_Hz"] for m in modes])
    assert [row[2] for row in rows] == pytest.approx([100 * m["damping_ratio"] for m in modes])


def test_excel_over_the_study_or_the_json_is_refused(tmp_path, capsys):
    pytest.importorskip("openpyxl")
    study, out = tmp_path / "study.toml", tmp_path / "m.xlsx"
    study.write_text(STUDY, encoding="utf-8")
    assert main(["modes", str(study), "--xlsx", str(out), "--json", str(out)]) == 2
    assert "are the same place" in capsys.readouterr().err
    assert main(["modes", str(study), "--xlsx", str(tmp_path / "m.xls")]) == 2
    assert "is written as .xlsx, not '.xls'" in capsys.readouterr().err
