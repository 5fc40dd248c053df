"""All sources of the benchmark book, by the names that docs/benchmark-book.md calls them."""

from benchmarks.book import (
    aisc,
    code_aster,
    frame3dd,
    manuals,
    nafems,
    rotors,
    textbooks,
    time_and_random,
)

SOURCES = {
    "frame3dd": frame3dd,
    "textbooks": textbooks,
    "aisc": aisc,
    "manuals": manuals,
    "nafems": nafems,
    "code_aster": code_aster,
    "rotors": rotors,
    "time_and_random": time_and_random,
}
