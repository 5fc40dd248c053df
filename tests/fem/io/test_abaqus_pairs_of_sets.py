"""Constraints between two node sets of an Abaqus deck: the sets are sorted unless they are UNSORTED."""

import pytest

from tests.fem.io.abaqus_decks import STEEL, deck_of

BARS = (
    "*NODE\n1, 0, 0, 0\n3, 2, 0, 0\n2, 1, 0, 0\n4, 0, 1, 0\n6, 2, 1, 0\n5, 1, 1, 0\n"
    "*ELEMENT, TYPE=B31, ELSET=BAR\n1, 1, 2\n2, 2, 3\n3, 4, 5\n4, 5, 6\n"
    "*BEAM SECTION, ELSET=BAR, MATERIAL=STEEL, SECTION=RECT\n0.02, 0.03\n" + STEEL
)
B = "*NSET, NSET=B\n5, 6\n"
EQUATION = "*EQUATION\n2\nA, 3, 1., B, 3, -1.\n"
SORTED, WRITTEN = [(2, 5), (3, 6)], [(3, 5), (2, 6)]


def pairs(folder, text):
    """Return the numbers of the nodes that the deck's equations and links pair."""
    deck = deck_of(folder, text)
    found = [{row for row, _, _ in e.terms} for e in deck.equations]
    found += [{d, link.node} for link in deck.links for d in link.dependents]
    pairs = {tuple(sorted(deck.nodes[list(rows)].tolist())) for rows in found}
    return sorted(pairs, key=lambda pair: pair[1])


@pytest.mark.parametrize(
    ("sets", "expected"),
    [
        ("*NSET, NSET=A\n3, 2\n", SORTED),
        ("*NSET, NSET=A\n3\n2\n", SORTED),
        ("*NSET, NSET=A\n3,\n*NSET, NSET=A\n2,\n", SORTED),
        ("*NSET, NSET=A, UNSORTED\n3, 2\n", WRITTEN),
        ("*NSET, NSET=A, UNSORTED\n3, 2, 3\n", WRITTEN),
        ("*NODE, NSET=A\n3, 2, 0, 0\n2, 1, 0, 0\n", SORTED),
        ("*NSET, NSET=A, GENERATE\n3, 3\n2, 2\n", SORTED),
        ("*NSET, NSET=TIP\n3\n*NSET, NSET=MID\n2\n*NSET, NSET=A\nTIP, MID\n", SORTED),
        ("*NSET, NSET=TIP\n3\n*NSET, NSET=MID\n2\n*NSET, NSET=A, UNSORTED\nTIP, MID\n", WRITTEN),
        ("*NSET, NSET=U, UNSORTED\n3, 2\n*NSET, NSET=A\nU\n", SORTED),
        ("*NSET, NSET=U, UNSORTED\n3, 2\n*NSET, NSET=A, UNSORTED\nU\n", WRITTEN),
        ("*NSET, NSET=S\n3, 2\n*NSET, NSET=A, UNSORTED\nS\n", SORTED),
        ("*NSET, NSET=A, UNSORTED\nS\n*NSET, NSET=S\n3, 2\n", SORTED),
        ("*ELSET, ELSET=E\n2\n*NSET, NSET=A, ELSET=E\n", SORTED),
    ],
)
def test_equations_pair_the_nodes_of_sets_in_the_order_of_the_sets(tmp_path, sets, expected):
    assert pairs(tmp_path, BARS + sets + B + EQUATION) == expected


@pytest.mark.parametrize("kind", ["TIE", "BEAM", "LINK", "PIN"])
def test_multi_point_constraints_pair_sorted_sets(tmp_path, kind):
    assert pairs(tmp_path, f"{BARS}*NSET, NSET=A\n3, 2\n{B}*MPC\n{kind}, A, B\n") == SORTED


def test_sets_of_instances_are_sorted_one_instance_after_the_other(tmp_path):
    part = BARS[: BARS.index("*MATERIAL")].replace("4, 0, 1, 0\n6, 2, 1, 0\n5, 1, 1, 0\n", "")
    part = part.replace("3, 4, 5\n4, 5, 6\n", "")
    text = (
        f"*PART, NAME=P\n{part}*END PART\n*ASSEMBLY, NAME=M\n"
        "*INSTANCE, NAME=LOW, PART=P\n*END INSTANCE\n*INSTANCE, NAME=TOP, PART=P\n0., 1., 0.\n*END INSTANCE\n"
        "*NSET, NSET=A, INSTANCE=LOW\n3, 2\n*NSET, NSET=B, INSTANCE=TOP\n2, 3\n"
        f"{EQUATION}*END ASSEMBLY\n{STEEL}"
    )
    assert pairs(tmp_path, text) == [(2, 2), (3, 3)]


def test_generators_take_a_sorted_set_that_an_unsorted_one_includes(tmp_path):
    """*NFILL puts a node with the next number midway between 2 and 5, and between 3 and 6."""
    fill = "*NSET, NSET=S\n30, 20\n*NSET, NSET=A, UNSORTED\nS\n*NSET, NSET=B\n50, 60\n*NFILL\nA, B, 2, 1\n"
    bars = BARS
    for number in (2, 3, 5, 6):
        bars = bars.replace(f"\n{number}, ", f"\n{number}0, ").replace(f", {number}\n", f", {number}0\n")
    bars = (
        bars.replace("20, 2, 30", "2, 20, 30")
        .replace("30, 4, 50", "3, 4, 50")
        .replace("4, 5, 60", "4, 50, 60")
    )
    deck = deck_of(tmp_path, bars + fill)
    places = dict(zip(deck.nodes.tolist(), deck.points.tolist(), strict=True))
    assert places[21] == [1.0, 0.5, 0.0]
    assert places[31] == [2.0, 0.5, 0.0]
