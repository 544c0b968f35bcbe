"""Ways to spoil the text of a scenario."""

from __future__ import annotations

import random
from collections.abc import Callable

__all__ = ["mutated"]

HOSTILE = [
    "null", "true", "[]", "{}", "''", "-1", "0", "1e999", ".nan", ".inf", "-.inf", "1" * 100_000,
    "0x" + "f" * 100_000, "0b" + "1" * 5_000, "'80 " + "a" * 100_000 + "'", "'1 " + "(" * 10_000 + "m'",
    "'1 " + "(" * 45 + "m" + ")" * 45 + "'", "'9**9**9 m'", "'1 m**9'", "/" + "a" * 100_000,
    "x/" * 100 + "file.csv", "a" * 300, "a" * 300 + ".csv", '"\\ud800"', '"\\0"', '"\\x1b[31m"', "'${HOME}'",
    "../../../../etc/passwd", "/dev/zero", "/dev/stdin", "/proc/self/mem", "hub.participant:Stepped",
    "hub.participant:Device", "hub.command_line.__main__:x", "this:x", "json:loads", ":", "a:", "::", ".:x",
    "..a:b", "mujoco", "fmu", "scripted", "endoscope", "!!int x", "!!binary '*'", "!!set {a, b}",
    "!!omap [a: 1]",
    "!!timestamp x", "2001-99-99", "2001-01-01", "!!python/object:os.system x", "!!float abc", "!!bool maybe",
    "!!null x", "!x y", "{? [a, b] : c}", "{[a]: b}", "{{a: b}: c}", "{1: 2}", "{null: 1}", "{1.5: 1}",
    "[" * 20_000, "[" * 200 + "]" * 200, "{a: " * 500 + "1" + "}" * 500, "&a [*a]", "&a {b: *a}", "*none",
    "[" + "1, " * 3_000 + "1]", "[" + "1, " * 400_000 + "1]", "'" + "b" * 1_000_000 + "'", "10000000000",
    "4294967296", "-9223372036854775808", "18446744073709551616", "1e-300", "1e300", "99999999 km",
    "300 years",
    "0.1 ns", "a.b", "a.*", "*.*", "'a.b -> c.d'", "'* -> *'", "\u202e", "\ufeff", "\u2028", "'\U0001f600'",
]  # fmt: skip

BOMBS = [
    "a0: &a0 [x, x, x, x, x, x, x, x, x]\n"
    + "".join(f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]\n" for i in range(1, 20)),
    "m0: &m0 {k: x}\n"
    + "".join(f"m{i}: &m{i}\n  <<: [*m{i - 1}, *m{i - 1}, *m{i - 1}]\n  k{i}: 1\n" for i in range(1, 30)),
    "m: &m {<<: *m}\n",
    "big: [" + ", ".join(["1"] * 300_000) + "]\n",
    "# " + "c" * 2_000_000 + "\n",
    "#\n" * 1_000_000,
    "%YAML " + "9" * 10_000 + "\n---\n",
    "scene: {" + ", ".join(f"k{i}: 1" for i in range(3_000)) + "}\n",
    "".join(f"k{i}: 1\n" for i in range(4_000)),
    "k: &t " + "z" * 4_000 + "\nl: [" + ", ".join(["*t"] * 4_000) + "]\n",
    "--- \n---\n",
    "? " * 1_000,
    "- " * 1_000,
]

Change = Callable[[str, random.Random], str]


def mutated(text: str, source: random.Random) -> tuple[str, bytes, list[str]]:
    """Return what was done to `text`, the result, and overrides for the command line."""
    names: list[str] = []
    for _ in range(source.choice([1, 1, 1, 2, 3])):
        change = source.choice(CHANGES)
        names.append(change.__name__)
        text = change(text, source)
    data = text.encode("utf-8", errors="surrogatepass")
    if source.random() < 0.05:
        names.append("bytes")
        at = source.randrange(len(data) + 1)
        data = data[:at] + source.randbytes(source.randint(1, 8)) + data[at:]
    overrides: list[str] = []
    if source.random() < 0.2:
        names.append("override")
        overrides = [_override(text, source)]
    return "+".join(names), data, overrides


def _override(text: str, source: random.Random) -> str:
    keys = [line.split(":")[0].strip(" -{") for line in text.splitlines() if ":" in line] or ["name"]
    dotted = ".".join(source.choices([*keys, "0", "x"], k=source.choice([1, 2, 3, 3, 50])))
    dotted = source.choice([dotted, dotted, f"participants.{dotted}", "9" * 5_000, "step", "participants"])
    # the operating system rejects longer arguments, and those with a null character
    return f"{dotted}={source.choice(HOSTILE)}".replace("\0", "")[:100_000]


def value(text: str, source: random.Random) -> str:
    """Replace the value of one key."""
    lines = text.splitlines()
    found = [i for i, line in enumerate(lines) if ": " in line and not line.lstrip().startswith("#")]
    if not found:
        return text
    index = source.choice(found)
    key, _, rest = lines[index].rpartition(": ") if source.random() < 0.5 else lines[index].partition(": ")
    end = rest[rest.index("}") :] if "}" in rest and source.random() < 0.7 else ""
    lines[index] = f"{key}: {source.choice(HOSTILE)}{end}"
    return "\n".join(lines) + "\n"


def word(text: str, source: random.Random) -> str:
    """Replace one word by a hostile one or by another word of the scenario."""
    words = text.split(" ")
    words[source.randrange(len(words))] = source.choice([source.choice(HOSTILE), source.choice(words)])
    return " ".join(words)


def line(text: str, source: random.Random) -> str:
    """Remove, repeat, move or indent one line."""
    lines = text.splitlines() or [""]
    index = source.randrange(len(lines))
    match source.randrange(4):
        case 0:
            del lines[index]
        case 1:
            lines.insert(index, lines[index])
        case 2:
            lines.insert(source.randrange(len(lines)), lines.pop(index))
        case _:
            lines[index] = " " * source.randint(1, 5) + lines[index]
    return "\n".join(lines) + "\n"


def character(text: str, source: random.Random) -> str:
    """Replace a few characters."""
    characters = list(text) or [" "]
    for _ in range(source.randint(1, 6)):
        characters[source.randrange(len(characters))] = source.choice(
            [*":{}[],&*!|>'\"%@`#-?.\t\n ", "\0", "\ud800", chr(source.randrange(32, 0x3000)), "9"]
        )
    return "".join(characters)


def cut(text: str, source: random.Random) -> str:
    """Cut a part out of the text, or its end."""
    start = source.randrange(len(text) + 1)
    end = source.choice([len(text), start + source.randint(1, 200)])
    return text[:start] + text[end:]


def bomb(text: str, source: random.Random) -> str:
    """Add what is small to write and large to read."""
    return source.choice([source.choice(BOMBS) + text, text + "\n" + source.choice(BOMBS)])


def crowd(text: str, source: random.Random) -> str:
    """Repeat the lines of the participants many times under other names."""
    head, mark, tail = text.partition("\nparticipants:\n")
    if not mark:
        return text
    kind = source.choice(["mujoco", "bullet", "motion", "scripted", "teleoperation", "fmu", "mirror"])
    number = source.choice([30, 60, 300, 1_000, 1_001, 20_000])
    return head + mark + "".join(f"  p{i}: {{kind: {kind}}}\n" for i in range(number)) + tail


def wiring(text: str, source: random.Random) -> str:
    """Add connections at random between the participants that the text names."""
    words = [part.strip(",{}[]'\"") for part in text.split() if "." in part] or ["a.b"]
    number = source.choice([1, 5, 400, 6_000])
    links = "".join(f"  - {source.choice(words)} -> {source.choice(words)}\n" for _ in range(number))
    return text.replace("\nconnections:\n", f"\nconnections:\n{links}")


CHANGES: list[Change] = [value, value, value, word, line, character, cut, bomb, crowd, wiring]
