"""Runs the code of a page: files are written, commands and Python run, what is printed compared."""

import contextlib
import io
import os
import re
import shlex
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

from pneumo_casadi.cli import app as cli

BLOCK = re.compile(r"(?:<!-- file: (\S+) -->\n)?^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


@dataclass(frozen=True)
class Block:
    """A block of code with its language, and the file that it is to be written to."""

    file: str
    language: str
    text: str


def blocks(page: Path) -> list[Block]:
    """Return the blocks of a page in their order."""
    return [Block(*match) for match in BLOCK.findall(page.read_text("utf-8"))]


def run(page: Path, folder: Path) -> dict:
    """Run all blocks in a folder; return the names that Python has defined.

    A block of text that follows Python is what must have been printed.
    """
    names: dict = {"__name__": "page"}
    printed = None
    with contextlib.chdir(folder), _importable(folder):
        for block in blocks(page):
            if block.file:
                Path(block.file).parent.mkdir(parents=True, exist_ok=True)
                Path(block.file).write_text(block.text, "utf-8")
                continue
            if block.language == "text" and printed is not None:
                assert printed.rstrip() == block.text.rstrip()
            printed = None
            if block.language == "python":
                stream = io.StringIO()
                with contextlib.redirect_stdout(stream):
                    exec(compile(block.text, f"{page.name}, python", "exec"), names)
                printed = stream.getvalue()
            elif block.language == "sh":
                for line in block.text.splitlines():
                    _command(line)
    return names


@contextlib.contextmanager
def _importable(folder: Path):
    """Let Python find what a page has written, and forget it afterwards."""
    sys.path.insert(0, str(folder))
    try:
        yield
    finally:
        sys.path.remove(str(folder))
        for path in folder.glob("*.py"):
            sys.modules.pop(path.stem, None)


def _command(line: str) -> None:
    words = shlex.split(line, comments=True)
    if words[0] == "pneumo-casadi":
        assert cli.run(words[1:]) == 0, line
    else:
        subprocess.run(words, check=True, env=os.environ)
