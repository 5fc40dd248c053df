"""The example of a Nastran deck and a test: its page finds the hidden connection and writes the card."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "missing-card.md"
HIDDEN = 8.0
"""Rotational stiffness about x at the end of the crossbeam, of simulate.py [kN·m/rad]."""


def test_the_page_finds_the_hidden_connection_and_writes_its_card():
    page = PAGE.read_text(encoding="utf-8")
    value, std = map(float, re.findall(r"stiffness\s([\d.]+)\s±\s([\d.]+)\skN·m/rad", page)[0])
    assert abs(value - HIDDEN) < 2 * std
    assert std < HIDDEN
    assert "CBUSH" in page.partition("missing.bdf --merge")[2]
