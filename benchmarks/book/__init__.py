"""The benchmark book: published problems, their numbers as printed, and functions that compute them.

A module holds the problems of one source in `PROBLEMS`. `tests/literature/test_book.py` checks every number.
`docs/make/book.py` writes the tables of docs/benchmark-book.md from the same entries.
"""
