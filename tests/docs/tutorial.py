"""Markdown pages as programs: the fenced blocks of a page, in order, are written to files, run and compared.

- ```` ```python title="name.py" ````, `yaml`, `toml`: a file of that name in the page's directory; one of
  `examples/` is compared with that of the repository.
- ```` ```python ````: run, neighbouring blocks in one namespace; a `text` block right after one is what it
  prints.
- ```` ```console ````: each `$ command` is run in a shell; the lines after it are what it prints, `...`
  stands for anything. A command whose expected text begins with `error:` fails.
- `<!-- not run: reason -->` on the line before a block: left out.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
_FENCE = re.compile(
    r"(?:<!-- not run: (?P<skip>[^\n]+) -->\n)?^```(?P<language>\w*)(?: title=\"(?P<title>[^\"]+)\")?[^\n]*\n"
    r"(?P<text>.*?)^```$",
    re.MULTILINE | re.DOTALL,
)


@dataclass(frozen=True)
class Block:
    """One fenced block of a page."""

    language: str
    title: str
    text: str
    skip: str
    line: int


def blocks(page: Path) -> Iterator[Block]:
    """Yield the fenced blocks of a page in order."""
    text = page.read_text("utf-8")
    for found in _FENCE.finditer(text):
        line = text.count("\n", 0, found.start("text"))
        yield Block(found["language"], found["title"] or "", found["text"], found["skip"] or "", line)


class Runner:
    """Runs the blocks of one page in a directory of its own."""

    def __init__(self, page: Path, directory: Path) -> None:
        self._page, self._directory = page, directory
        (directory / "examples").symlink_to(ROOT / "examples")

    def run(self) -> int:
        """Run all blocks; return how many commands and programs were run."""
        found = [block for block in blocks(self._page) if not block.skip]
        count = 0
        program: list[tuple[Block, Block | None]] = []
        for block, after in zip(found, [*found[1:], None], strict=True):
            if block.title.startswith("examples/"):
                where = f"{self._page.name}:{block.line}"
                assert block.text == (ROOT / block.title).read_text("utf-8"), (
                    f"{where}: another {block.title}"
                )
            elif block.title:
                (self._directory / block.title).write_text(block.text)
            elif block.language == "python":
                program.append((block, after if after is not None and after.language == "text" else None))
            elif block.language == "console":
                count += self._python(program) + self._console(block)
                program = []
        return count + self._python(program)

    def _python(self, parts: list[tuple[Block, Block | None]]) -> int:
        """Run blocks of Python as one program and compare what each of them prints."""
        if not parts:
            return 0
        mark = "@end of block@"
        text = "".join(f"{block.text}\nprint({mark!r})\n" for block, _ in parts)
        (self._directory / "page_program.py").write_text(text)
        done = self._run([sys.executable, "page_program.py"])
        where = f"{self._page.name}:{parts[0][0].line}"
        assert done.returncode == 0, f"{where}: {done.stdout}{done.stderr}"
        for (block, after), printed in zip(parts, done.stdout.split(mark + "\n"), strict=False):
            if after is not None:
                compare(after.text, printed, f"{self._page.name}:{block.line}")
        return len(parts)

    def _console(self, block: Block) -> int:
        commands = re.split(r"^\$ ", block.text, flags=re.MULTILINE)[1:]
        for command in commands:
            line, _, expected = command.partition("\n")
            done = self._run(line, shell=True)
            if "Address already in use" in done.stderr:  # another session of this machine was quicker
                for begun in re.findall(r"--record (\S+)", line):
                    shutil.rmtree(self._directory / begun, ignore_errors=True)
                done = self._run(line, shell=True)
            where = f"{self._page.name}:{block.line}: {line}"
            fails = expected.startswith("error:")
            printed = done.stdout + done.stderr
            assert (done.returncode != 0) == fails, f"{where}: exit code {done.returncode}\n{printed}"
            if expected:
                compare(expected, printed, where)
        return len(commands)

    def _run(self, command: str | list[str], *, shell: bool = False) -> subprocess.CompletedProcess[str]:
        environment = os.environ | {
            "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
            "COLUMNS": "200",
        }
        return subprocess.run(
            command,
            cwd=self._directory,
            shell=shell,
            env=environment,
            capture_output=True,
            text=True,
            timeout=120,
            check=False,
        )


def compare(expected: str, printed: str, where: str) -> None:
    """Compare line by line; `...` stands for any text, alone in a line for any lines."""
    tidy = "\n".join(line.rstrip() for line in printed.strip().splitlines())
    pattern = r"\n".join(_line(line.rstrip()) for line in expected.strip().splitlines())
    pattern = pattern.replace(r"@any lines@\n", r"(?:.*\n)*?").replace(r"\n@any lines@", r"(?:\n.*)*")
    assert re.fullmatch(pattern, tidy), f"{where} prints\n{tidy}\n\nand not, as the page says,\n{expected}"


def _line(line: str) -> str:
    if line.strip() == "...":
        return "@any lines@"
    return re.sub(r"(?:\\ )+", r"\\s+", re.escape(line)).replace(r"\.\.\.", ".*")
