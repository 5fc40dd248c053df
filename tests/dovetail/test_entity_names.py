"""Entity names of dataset 58 (record 6) name the sensors and excitations of a new study."""

import csv

import numpy as np
import pytest

from dovetail import load_study, main
from fem.io import Function, Points, write_uff

DECK = (
    "GRID,1,,0.,0.,0.\nGRID,2,,1.,0.,0.\nGRID,3,,1.,1.,0.\nGRID,4,,0.,1.,1.\nCBAR,1,1,1,2,0.,0.,1.\n"
    "CBAR,2,1,2,3,0.,0.,1.\nCBAR,3,1,3,4,0.,0.,1.\nPBARL,1,1,,BAR\n+,.02,.03\nMAT1,1,2.+11,,.3,7850.\n"
    "SPC1,1,123456,1\n"
)
NO_TITLE = ("NONE",) * 5


def names(folder, ends):
    """Return the names of sensors and excitations by their labels, for records of (label, name) of both."""
    (folder / "a.bdf").write_text(DECK)
    f = np.arange(1.0, 9.0)
    records = [
        Function(
            4,
            out,
            ref,
            out_name,
            ref_name,
            f,
            f * (1 + 1j) * k,
            18,
            12,
            13,
            "Hz",
            "m/s^2",
            "N",
            NO_TITLE,
            0,
            0,
            "",
        )
        for k, ((out, out_name), (ref, ref_name)) in enumerate(ends, 1)
    ]
    xyz = np.array([[1.0, 0, 0], [1, 1, 0], [0, 1, 1]])
    write_uff(folder / "t.uff", functions=records, geometry=Points(np.array([2, 3, 4]), xyz))
    main(["new", str(folder / "s"), "--from", str(folder / "a.bdf"), str(folder / "t.uff")])
    found = []
    for table in ("sensors.csv", "excitations.csv"):
        with (folder / "s" / table).open(newline="") as file:
            found.append({row["label"]: row["name"] for row in csv.DictReader(file)})
    load_study(folder / "s" / "study.toml")
    return found


HAMMER = ("4Z+", "hammer")


@pytest.mark.parametrize(
    ("outputs", "expected"),
    [
        ([("2X+", "leg top"), ("3Z-", "PF-0301")], {"2X+": "leg top", "3Z-": "PF-0301"}),
        ([("2X+", "leg"), ("2Y+", "leg"), ("3Z-", "")], {"2X+": "leg X+", "2Y+": "leg Y+", "3Z-": "3Z-"}),
        ([("2X+", ""), ("3Z-", "a")], {"2X+": "2X+", "3Z-": "a"}),
        # a component, a name that is another label, one that would be a comment
        ([("2X+", "frame"), ("3Z-", "frame")], {"2X+": "2X+", "3Z-": "3Z-"}),
        ([("2X+", "3Z-"), ("3Z-", "2X+")], {"2X+": "2X+", "3Z-": "3Z-"}),
        ([("2X+", "#1"), ("3Z-", "a,b")], {"2X+": "2X+", "3Z-": "a,b"}),
        ([("2X+", "leg"), ("2Y+", "leg"), ("3Z-", "leg X+")], {"2X+": "2X+", "2Y+": "leg Y+", "3Z-": "3Z-"}),
    ],
)
def test_entities_name_sensors(tmp_path, outputs, expected):
    assert names(tmp_path, [(out, HAMMER) for out in outputs]) == [expected, {"4Z+": "hammer"}]
