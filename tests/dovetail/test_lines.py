"""Places of keys in TOML texts, against tomllib's own reading of the same text."""

import tomllib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dovetail.file import key_lines

TEXT = '''# comment with [brackets] and "quotes"
title = "a # b"
dotted.key.deep = 1

[table]
list = [1, 2,
  { x = 1, y = [3, # inner
    4] },
]
"quoted key" = """
[not.a.table]
""" # after
literal = 'C:\\'

[[items]]
name = "first"
[items.sub]
k = 2026-11-20
[[items]]
name = "second"
[[items.parts]]
z = +inf
'''


def walk(value, path=()):
    if path:
        yield path
    pairs = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, inner in pairs:
        yield from walk(inner, (*path, key))


def test_every_key_and_item_has_a_line():
    lines = key_lines(TEXT)
    assert set(walk(tomllib.loads(TEXT))) <= set(lines)


@pytest.mark.parametrize(
    ("path", "start"),
    [
        (("title",), "title ="),
        (("dotted", "key", "deep"), "dotted.key.deep"),
        (("table",), "[table]"),
        (("table", "list"), "list ="),
        (("table", "list", 1), "list ="),
        (("table", "list", 2), "  { x ="),
        (("table", "list", 2, "y"), "  { x ="),
        (("table", "list", 2, "y", 1), "    4]"),
        (("table", "quoted key"), '"quoted key"'),
        (("table", "literal"), "literal ="),
        (("items", 0, "name"), 'name = "first"'),
        (("items", 0, "sub", "k"), "k = 2026"),
        (("items", 1, "name"), 'name = "second"'),
        (("items", 1, "parts", 0), "[[items.parts]]"),
        (("items", 1, "parts", 0, "z"), "z = +inf"),
    ],
)
def test_line_of(path, start):
    assert TEXT.splitlines()[key_lines(TEXT)[path] - 1].startswith(start)


SCALARS = st.one_of(
    st.integers(-99, 99),
    st.booleans(),
    st.sampled_from(['"a]b"', "'}'", '"""x\ny"""', "''", '"\\""', "1e-3"]),
)


@st.composite
def values(draw, depth=2):
    if depth and draw(st.booleans()):
        inner = draw(st.lists(values(depth - 1), max_size=3))
        if draw(st.booleans()):
            return "[" + draw(st.sampled_from([", ", ",\n  ", " , # x\n"])).join(inner) + "]"
        return "{" + ", ".join(f"k{i} = {v}" for i, v in enumerate(inner) if "\n" not in v) + "}"
    scalar = draw(SCALARS)
    return str(scalar).lower() if isinstance(scalar, bool) else str(scalar)


@given(st.lists(values(), min_size=1, max_size=4))
def test_any_document_is_followed_to_its_end(parts):
    text = "\n".join(f"[[t]]\nkey = {v}\n" for v in parts)
    try:
        read = tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        return  # TOML 1.0 takes no line ends in inline tables
    lines = key_lines(text)
    assert set(walk(read)) <= set(lines)
    for i in range(len(parts)):
        assert text.splitlines()[lines["t", i, "key"] - 1].startswith("key")
