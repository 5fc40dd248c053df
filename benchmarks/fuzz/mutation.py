"""Damage to a valid file: bytes, numbers, words, lines and lengths, drawn from a random generator."""

import random
import re
import struct

_INTEGERS = "2147483647 2147483648 -2147483649 9223372036854775808 90000000"
_SYMBOLS = "+ --1 ½ a é [ ] { } = * $"
EXTREMES = (
    *("0", "-0", "-1", "1", "2", "7", "1e308", "-1e308", "1e-320", "1e999", "nan", "inf", "-inf", "NaN"),
    *_INTEGERS.split(),
    *("9" * 400, "0x10", "1_000", "1.5", "1d3", "1,5", "1.0e-"),
    *_SYMBOLS.split(),
    *('"', "'", "\\", "", " ", "\x00"),
)
"""What stands in place of a number or a word."""

_NUMBER = re.compile(rb"[-+]?\d+(?:\.\d*)?(?:[eEdD][-+]?\d+)?")
_WORD = re.compile(rb"[A-Za-z_]{2,}")
_CELL = re.compile(rb"[^;,\t ]+|[;,\t ]+")
"""Cells of a line and what is between them."""
_PACKED = tuple(
    struct.pack(order + kind, value)
    for order in "<>"
    for kind, values in {
        "i": (0, 1, -1, 2, 2**31 - 1, 90_000_000),
        "q": (-1, 2**62),
        "f": (float("nan"), float("inf")),
        "d": (float("nan"), float("-inf"), 1e308, -1.0, 5e-324),
    }.items()
    for value in values
)
"""Extreme numbers of binary files."""


def mutated(rng: random.Random, seeds: list[bytes]) -> bytes:
    """Return one of the seeds after 1 to 6 mutations, at times spliced with another."""
    data = rng.choice(seeds)
    for _ in range(rng.choice((1, 1, 1, 2, 2, 3, 6))):
        data = rng.choice(_MUTATIONS)(rng, data, seeds)
    return data


def _flip(rng: random.Random, data: bytes, _: list[bytes]) -> bytes:
    if not data:
        return data
    out = bytearray(data)
    for _k in range(rng.choice((1, 1, 2, 8))):
        out[rng.randrange(len(out))] = rng.choice((0, 255, 10, 32, rng.randrange(256)))
    return bytes(out)


def _cut(rng: random.Random, data: bytes, _: list[bytes]) -> bytes:
    a, b = sorted(rng.randrange(len(data) + 1) for _k in range(2))
    return rng.choice((data[:a], data[a:], data[:a] + data[b:]))


def _number(rng: random.Random, data: bytes, _: list[bytes]) -> bytes:
    return _replace(rng, data, _NUMBER, lambda: rng.choice(EXTREMES).encode())


def _other_number(rng: random.Random, data: bytes, _: list[bytes]) -> bytes:
    found = _NUMBER.findall(data)
    return _replace(rng, data, _NUMBER, lambda: rng.choice(found)) if found else data


def _near(rng: random.Random, data: bytes, _: list[bytes]) -> bytes:
    """Change a whole number, such as a count, by a little, or its sign."""
    spans = [m.span() for m in re.finditer(rb"\b\d{1,9}\b", data)]
    if not spans:
        return data
    a, b = rng.choice(spans)
    n = int(data[a:b])
    return data[:a] + str(rng.choice((n - 1, n + 1, n + 1, 2 * n, -n))).encode() + data[b:]


def _column(rng: random.Random, data: bytes, _: list[bytes]) -> bytes:
    """Change one column of a run of lines: leave it out, double it, exchange it, fill it, or end it early."""
    lines = [_CELL.findall(line) for line in data.split(b"\n")]
    first = rng.randrange(len(lines))
    last = rng.choice((len(lines), min(len(lines), first + rng.randrange(1, 9))))
    at, other = (rng.randrange(max(1, max(map(len, lines)))) for _k in range(2))
    action, extreme = rng.randrange(5), rng.choice(EXTREMES).encode()
    for row in lines[rng.choice((0, first)) : last]:
        if at >= len(row):
            continue
        if action == 0:
            del row[at : at + 2]
        elif action == 1:
            row[at:at] = row[at : at + 2]
        elif action == 2 and other < len(row):
            row[at], row[other] = row[other], row[at]
        elif action == 3:
            row[at] = extreme
        elif action == 4:
            del row[at:]
    return b"\n".join(b"".join(row) for row in lines)


def packed(rng: random.Random, data: bytes, _: list[bytes] | None = None) -> bytes:
    """Put an extreme number into a place where a binary file may have one."""
    new = rng.choice(_PACKED)
    at = rng.randrange(max(1, len(data) // 4)) * 4
    return data[:at] + new + data[at + len(new) :]


def _word(rng: random.Random, data: bytes, seeds: list[bytes]) -> bytes:
    words = _WORD.findall(rng.choice(seeds)) or [b"x"]
    return _replace(rng, data, _WORD, lambda: rng.choice(words))


def _replace(rng: random.Random, data: bytes, what: re.Pattern[bytes], by) -> bytes:
    spans = [m.span() for m in what.finditer(data)]
    if not spans:
        return data
    a, b = rng.choice(spans)
    new = by()
    if rng.random() < 0.5:  # columns of fixed width keep theirs
        new = new.rjust(b - a)[: b - a]
    return data[:a] + new + data[b:]


def _lines(rng: random.Random, data: bytes, seeds: list[bytes]) -> bytes:
    lines = data.split(b"\n")
    k, other = rng.randrange(len(lines)), rng.choice(rng.choice(seeds).split(b"\n"))
    action = rng.randrange(6)
    if action == 0:
        del lines[k]
    elif action == 1:
        lines.insert(k, lines[rng.randrange(len(lines))])
    elif action == 2:
        lines.insert(k, other)
    elif action == 3:
        j = rng.randrange(len(lines))
        lines[k], lines[j] = lines[j], lines[k]
    elif action == 4:
        lines[k] = lines[k] + rng.choice((b",", b" ", b"+", b"\t", lines[k]))
    else:
        j = min(len(lines), k + rng.randrange(1, 20))
        lines[k:j] = lines[k:j] * rng.choice((2, 2, 5))
    return b"\n".join(lines)


def _long(rng: random.Random, data: bytes, _: list[bytes]) -> bytes:
    at = rng.randrange(len(data) + 1)
    piece = rng.choice(
        (
            b"[",
            b"{",
            b"(",
            b"1",
            b" ",
            b"a",
            b",",
            b'"',
            b"1,",
            b"- ",
            b"\n",
            b"\x00",
            data[at : at + 3] or b"x",
        )
    )
    return data[:at] + piece * rng.choice((10, 100, 3000, 16000)) + data[at:]


def _splice(rng: random.Random, data: bytes, seeds: list[bytes]) -> bytes:
    other = rng.choice(seeds)
    return data[: rng.randrange(len(data) + 1)] + other[rng.randrange(len(other) + 1) :]


def _ends(rng: random.Random, data: bytes, _: list[bytes]) -> bytes:
    return rng.choice(
        (data.replace(b"\n", b"\r\n"), data.replace(b"\n", b"\r"), b"\xef\xbb\xbf" + data, data.rstrip())
    )


_MUTATIONS = (
    _flip,
    _cut,
    _number,
    _number,
    _number,
    _other_number,
    _near,
    _column,
    packed,
    _word,
    _lines,
    _lines,
    _lines,
    _long,
    _splice,
    _ends,
)
