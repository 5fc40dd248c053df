"""The example of a Nastran deck and a test: its page finds the hidden connection and writes the card."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "missing-card.md"
HIDDEN = 8.0
"""Rotational stiffness about x at the end of the crossbeam, of simulate.py [kN·m/rad]."""


def test_the_page_finds_the_hidden_connection_and_writes_its_card():
    page = PAGE.read_text(encoding="utf-8")
    interval = r"stiffness\s([\d.]+)\skN·m/rad\s\((?:above\s)?([\d.]+)(?:\sto\s([\d.]+))?\skN·m/rad\)"
    value, low, high = re.findall(interval, page)[0]
    assert float(low) < float(value) < HIDDEN
    assert float(low) > HIDDEN / 50  # far from rigid, and no hinge
    assert not high or float(high) > HIDDEN
    assert "CBUSH" in page.partition("missing.bdf --merge")[2]
