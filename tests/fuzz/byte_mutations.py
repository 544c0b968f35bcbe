"""Ways to spoil bytes."""

from __future__ import annotations

import random
import struct
from collections.abc import Callable, Sequence

__all__ = ["mutated", "mutated_text"]

NUMBERS = [0, 1, 2, 7, 127, 128, 255, 256, 4095, 65535, 65536, 2**24, 2**31 - 1, 2**31, 2**32 - 1, 2**48]
DOUBLES = [0.0, -0.0, 1e-320, 1e300, -1e300, float("nan"), float("inf"), float("-inf"), 2.0**53, 2.0**63]
WORDS = [
    b"", b"0", b"-1", b"1e999", b"nan", b"9" * 4300, b"9" * 100_000, b"\0", b"\xff\xfe", b"\xed\xa0\x80",
    b"%", b"&", b"<", b">", b"]]>", b"&#0;", b"'", b'"', b"{", b"}", b"[" * 50_000, b"{\"a\":" * 50_000,
    b"\x1b[31m", b"../../etc/passwd", b"/dev/zero", "\u202e".encode(), b"null", b"true", b"a" * 100_000,
    b"2147483648", b"18446744073709551616", b"1e-400", b"\r\n", b"\n\n", b"-0", b"0x10", b"1_000",
    "\u0663".encode(),
]  # fmt: skip


def mutated(data: bytes, source: random.Random, others: Sequence[bytes] = ()) -> tuple[str, bytes]:
    """Return what was done to `data`, and the result; parts of `others` may be put into it."""
    names: list[str] = []
    for _ in range(source.choice([1, 1, 1, 2, 3, 8])):
        change = source.choice(CHANGES)
        names.append(change.__name__)
        data = change(data, source, others)
    return "+".join(names), data


def mutated_text(data: bytes, source: random.Random, others: Sequence[bytes] = ()) -> tuple[str, bytes]:
    """Return what was done to the words and lines of `data`, and the result."""
    names: list[str] = []
    for _ in range(source.choice([1, 1, 1, 2, 3])):
        change = source.choice(TEXT_CHANGES)
        names.append(change.__name__)
        data = change(data, source, others)
    return "+".join(names), data


Change = Callable[[bytes, random.Random, Sequence[bytes]], bytes]


def _at(data: bytes, source: random.Random) -> int:
    """Return a place in `data`, often near its beginning, where headers are."""
    if source.random() < 0.3:
        return source.randrange(min(len(data), 64) + 1)
    return source.randrange(len(data) + 1)


def _times(part: bytes, source: random.Random) -> int:
    """Return how often to repeat a part: a few or many times, up to some 200 kB."""
    return min(source.choice([2, 3, 50, 5000]), 200_000 // max(len(part), 1) + 1)


def bits(data: bytes, source: random.Random, _: Sequence[bytes]) -> bytes:
    """Flip a few bits."""
    spoilt = bytearray(data)
    for _flip in range(source.choice([1, 1, 2, 5, 20])):
        if spoilt:
            spoilt[min(_at(data, source), len(spoilt) - 1)] ^= 1 << source.randrange(8)
    return bytes(spoilt)


def number(data: bytes, source: random.Random, _: Sequence[bytes]) -> bytes:
    """Write a number that stands at the border of something over some bytes."""
    form = source.choice(["<B", "<H", "<I", "<Q", ">H", ">I", ">Q", "<d", ">d"])
    at = _at(data, source) & ~(source.choice([0, 3, 7]))
    if form[1] == "d":
        piece = struct.pack(form, source.choice(DOUBLES))
    else:
        piece = struct.pack(form, source.choice(NUMBERS) & (256 ** struct.calcsize(form) - 1))
    return data[:at] + piece + data[at + len(piece) :]


def cut(data: bytes, source: random.Random, _: Sequence[bytes]) -> bytes:
    """Remove a part, or the end."""
    at = _at(data, source)
    return data[:at] + (b"" if source.random() < 0.5 else data[at + source.choice([1, 4, 8, 100, 1000]) :])


def noise(data: bytes, source: random.Random, _: Sequence[bytes]) -> bytes:
    """Insert, or write over some bytes, what is random."""
    at, size = _at(data, source), source.choice([1, 2, 4, 8, 64, 1000])
    return data[:at] + source.randbytes(size) + data[at + source.choice([0, size]) :]


def repeat(data: bytes, source: random.Random, _: Sequence[bytes]) -> bytes:
    """Repeat a part, a few or many times."""
    at, size = _at(data, source), source.choice([1, 4, 16, 100, 1000])
    part = data[at : at + size]
    return data[:at] + part * _times(part, source) + data[at:]


def splice(data: bytes, source: random.Random, others: Sequence[bytes]) -> bytes:
    """Go on with a part of another input."""
    other = source.choice([*others, data])
    return data[: _at(data, source)] + other[_at(other, source) :]


def word(data: bytes, source: random.Random, _: Sequence[bytes]) -> bytes:
    """Insert a hostile word."""
    at = _at(data, source)
    return data[:at] + source.choice(WORDS) + data[at + source.choice([0, 0, 1, 5]) :]


def whole_word(data: bytes, source: random.Random, _: Sequence[bytes]) -> bytes:
    """Replace one word by a hostile one, or by another one of the text."""
    words = data.split(b" ")
    words[source.randrange(len(words))] = source.choice([source.choice(WORDS), source.choice(words)])
    return b" ".join(words)


def quoted(data: bytes, source: random.Random, _: Sequence[bytes]) -> bytes:
    """Replace the contents of a pair of quotes."""
    parts = data.split(b'"')
    if len(parts) > 2:
        inside = source.choice(parts[1::2])
        parts[source.randrange(len(parts) // 2) * 2 + 1] = source.choice([source.choice(WORDS), inside])
    return b'"'.join(parts)


def line(data: bytes, source: random.Random, others: Sequence[bytes]) -> bytes:
    """Remove, repeat, or move one line, or take one of another input."""
    lines = data.split(b"\n")
    at, to = source.randrange(len(lines)), source.randrange(len(lines))
    match source.randrange(4):
        case 0:
            del lines[at]
        case 1:
            lines[at:at] = [lines[at]] * _times(lines[at], source)
        case 2:
            lines.insert(to, lines.pop(at))
        case _:
            lines.insert(at, source.choice(source.choice([*others, data]).split(b"\n")))
    return b"\n".join(lines)


CHANGES: list[Change] = [bits, bits, number, number, number, cut, noise, repeat, splice, word]
TEXT_CHANGES: list[Change] = [whole_word, whole_word, quoted, quoted, line, line, *CHANGES]
