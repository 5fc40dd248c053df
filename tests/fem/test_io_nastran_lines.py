"""Lines of Nastran decks in free field: what is a value, and what is the label of a continuation line."""

import numpy as np
import pytest

from fem import MeshError
from fem.io import DeckUnits
from fem.io.nastran_cards import BulkData, each_card
from fem.io.nastran_frame import read_nastran_frame

GRIDS = "".join(f"GRID,{k},,{k}.,0.,0.\n" for k in range(1, 21))
BARS = "".join(f"CBAR,{k},1,{k},{k + 1},0.,1.,0.\n" for k in range(1, 20))
FRAME = GRIDS + BARS + "PBAR,1,1,1.-4,1.-8,1.-8,1.-8\nMAT1,1,2.+11,,.3,7850.\n"


def cards(folder, text):
    """Return the values of the first card of a text, without the blanks at its end."""
    path = folder / "a.bdf"
    path.write_text(text)
    _, fields, _ = next(each_card(BulkData.of(path)))
    while fields and not fields[-1]:
        fields = fields[:-1]
    return [field or "-" for field in fields]


def numbers(last):
    return [str(k) for k in range(1, last + 1)]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("SPC1,1,2,3,4,5,6,7,8,9", numbers(9)),
        ("SPC1,1,2,3,4,5,6,7,8,9\nGRID,1", numbers(9)),
        ("SPC1,1,2,3,4,5,6,7,8,9,", numbers(9)),
        ("SPC1,1,2,3,4,5,6,7,8,9,10", numbers(10)),
        ("SPC1," + ",".join(numbers(27)), numbers(27)),
        ("SPC1,1,2,3,4,5,6,7,8,+,9,10", numbers(10)),
        ("SPC1,1,2,3,4,5,6,7,8,+A,9,10", numbers(10)),
        ("SPC1,1,2,3,4,5,6,7,8,,10", [*numbers(8), "-", "10"]),
        ("SPC1,1,2,3,4,5,6,7,8,+\n+,9,10", numbers(10)),
        ("SPC1,1,2,3,4,5,6,7,8,\n,9,10", numbers(10)),
        ("SPC1,1,2,3,4,5,6,7,8\n,9,10", numbers(10)),
        ("SPC1,1,2,3,4,5,6,7,8,+A\n+A,9,10", numbers(10)),
        ("SPC1,1,2,3,4,5,6,7,8,A\n+A,9,10", numbers(10)),
        ("SPC1,1,2,3,4,5,6,7,8,A\n,9,10", numbers(10)),
        ("SPC1,1,2,3,4,5,6,7,8,+1\n+1,9,10", numbers(10)),
        ("SPC1,1,2,3,4,5,6,7,8,7\n+7,9,10", numbers(10)),
        ("SPC1,1,2,3,4,5,6,7,8,9,10\n,17,18", [*numbers(10), *"------", "17", "18"]),
        ("SPC1," + ",".join(numbers(16)) + ",+B\n+B,17", numbers(17)),
        ("SPC1 1 2 3 4 5 6 7 8 9", numbers(9)),
        ("SPC1 1 2 3 4 5 6 7 8 9 10", numbers(10)),
        ("SPC1*,1,2,3,4,5", numbers(5)),
        ("SPC1*,1,2,3,4,*A\n*A,5,6", numbers(6)),
        ("SPC1,1,2,3,4,5,6,7,8,+9.5", [*numbers(8), "+9.5"]),
    ],
)
def test_a_ninth_value_is_a_value_unless_a_line_continues_it(tmp_path, text, expected):
    assert cards(tmp_path, text) == expected


def test_a_ninth_number_before_a_line_without_a_label_is_refused(tmp_path):
    with pytest.raises(
        MeshError, match=r"a\.bdf: line 1: '9' may be a value or the label of the continuation"
    ):
        cards(tmp_path, "SPC1,1,2,3,4,5,6,7,8,9\n,10,11")


@pytest.mark.parametrize("after", ["", "\n+,10,11", "\nSPC1,2,3,4"])
def test_a_ninth_number_with_a_sign_is_no_label_that_no_line_has(tmp_path, after):
    with pytest.raises(MeshError, match=r"'\+9' may be a value or the label .* write \+9 at both places"):
        cards(tmp_path, f"SPC1,1,2,3,4,5,6,7,8,+9{after}")


@pytest.mark.parametrize("count", [6, 7, 8, 14, 15, 16])
def test_a_long_line_supports_all_its_grid_points(tmp_path, count):
    path = tmp_path / "a.bdf"
    path.write_text(f"{FRAME}SPC1,1,123456,{','.join(numbers(count))}\n")
    assert list(read_nastran_frame(path, DeckUnits()).supports) == list(range(count))


def test_values_beyond_the_eighth_are_those_of_the_next_line_of_other_cards(tmp_path):
    """A pin flag of CBAR, I11 of CONM2, and dimensions of PBARL."""
    path = tmp_path / "a.bdf"
    text = FRAME.replace("CBAR,1,1,1,2,0.,1.,0.\n", "CBAR,1,1,1,2,0.,1.,0.,,,6\n")
    text = text.replace("PBAR,1,1,1.-4,1.-8,1.-8,1.-8", "PBARL,1,1,,TUBE,,,,,.05,.04")
    path.write_text(f"{text}CONM2,90,20,,40.,,,,,.7\n")
    deck = read_nastran_frame(path, DeckUnits())
    assert np.isfinite(deck.bars.stiffness[0]).sum() == 1
    assert pytest.approx(np.pi * (0.05**2 - 0.04**2)) == deck.properties[0].section.A
    assert deck.bodies[0].inertia[0, 0] == 0.7
