"""The picture of the imports: rooms are above those that they import, and circles are refused."""

from xml.etree import ElementTree

import pytest

from docs.make.imports import PACKAGES, direct, draw, levels, room_imports

ROOMS = {"p.a": {"p.b", "p.c"}, "p.b": {"p.c"}, "p.c": set(), "p.d": set()}


def test_each_room_is_above_those_that_it_imports():
    assert levels(ROOMS) == [["p.c", "p.d"], ["p.b"], ["p.a"]]


def test_imports_that_follow_from_others_are_left_out():
    assert sorted(direct(ROOMS)) == [("p.a", "p.b"), ("p.b", "p.c")]


def test_a_circle_is_refused():
    with pytest.raises(ValueError, match=r"circle: p\.a, p\.b"):
        levels({"p.a": {"p.b"}, "p.b": {"p.a"}, "p.c": set()})


def test_the_packages_are_drawn_and_import_only_to_the_right():
    rooms, between = room_imports()
    assert {"fem.elements", "updating.modal", "dovetail.commands", "viz.render", "joint.form"} <= set(rooms)
    assert all(PACKAGES.index(one) < PACKAGES.index(other) for one, other in between)
    drawing = ElementTree.fromstring(draw(rooms, between))
    texts = list(drawing.iter("{http://www.w3.org/2000/svg}text"))
    assert [e.text for e in texts if e.get("font-size") == "18"] == list(PACKAGES)
    boxes = [e.text for e in texts if e.get("text-anchor") == "middle"]
    assert sorted(boxes) == sorted(room.split(".")[1] for room in rooms)
