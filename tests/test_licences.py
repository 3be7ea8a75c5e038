"""The repository holds only what was written for it: no file carries another project's licence."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent

#: Words that stand in the headers and licences of other projects.
LICENCE_WORDS = (
    "Modelica Association",
    "Redistribution and use in source and binary forms",
    "Permission is hereby granted",
    "GNU General Public",
    "GNU Lesser General Public",
    "Apache License",
    "Mozilla Public License",
    "Creative Commons",
    "All rights reserved",
    "SPDX-License-Identifier",
    "Licensed under the",
)
#: Files in which some of these words may stand.
ALLOWED = {
    "LICENSE": {"Permission is hereby granted"},
    "tests/test_licences.py": set(LICENCE_WORDS),
}


def licence_words(content: bytes) -> set[str]:
    """Return the licence words in a file, also where comment marks and line ends break them."""
    text = content.decode("utf-8", errors="replace")
    plain = re.sub(r"[\s*#/%;\"\\]+", " ", text).casefold()
    return {words for words in LICENCE_WORDS if words.casefold() in plain}


def tracked_files() -> list[str]:
    git = shutil.which("git")
    if git is None or not (ROOT / ".git").exists():
        pytest.skip("not a git checkout: what belongs to the repository is unknown")
    listed = subprocess.run([git, "ls-files", "-z"], cwd=ROOT, capture_output=True, check=True)
    return [name for name in listed.stdout.decode().split("\0") if name]


def test_no_file_carries_the_licence_of_another_project():
    found = {
        name: words
        for name in tracked_files()
        if (ROOT / name).is_file()
        and (words := licence_words((ROOT / name).read_bytes()) - ALLOWED.get(name, set()))
    }
    assert not found, f"files of other projects, or their licences: {found}"


def test_every_exception_is_needed():
    tracked = tracked_files()
    for name, words in ALLOWED.items():
        assert name in tracked and licence_words((ROOT / name).read_bytes()) >= words


@pytest.mark.parametrize(
    "text",
    [
        "/* Copyright (C) Modelica\n * Association Project */",
        "# Redistribution and use in source and\n# binary forms, with or without modification",
        "// SPDX-License-Identifier: BSD-2-Clause",
        "   all rights\r\n   reserved.",
    ],
)
def test_words_are_found_across_line_ends_and_comment_marks(text):
    assert licence_words(text.encode())
    assert not licence_words(b"MIT licence; see the file of that name")
