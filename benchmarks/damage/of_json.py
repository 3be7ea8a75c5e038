"""Damage to any JSON file: its bytes, its structure, its numbers."""

import json
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from random import Random
from typing import Any

from damage.kind import Damage, Due, Kind, Subject

#: Numbers that JSON can write and a machine cannot hold.
IMPOSSIBLE = ("9" * 5000, "1e999", "-1e400", "NaN", "Infinity", "-Infinity", "9" * 400)


def kinds(name: str, subject: Subject, closed: bool) -> Iterator[Kind]:
    """Yield what may happen to a JSON file; `closed` if every field of it is read."""
    leaf_due = Due.REFUSE if closed else Due.ANY

    def kind(what: str, due: Due, damage: Damage) -> Kind:
        return Kind(f"{name}: {what}", due, damage, name, subject)

    def of_bytes(change: Callable[[bytes, Random], bytes]) -> Damage:
        def damage(folder: Path, rng: Random) -> None:
            path = folder / name
            path.write_bytes(change(path.read_bytes(), rng))

        return damage

    def of_content(change: Callable[[dict[str, Any], Random], Any]) -> Damage:
        def damage(folder: Path, rng: Random) -> None:
            content = json.loads((folder / name).read_text("utf-8"))
            changed = change(content, rng)
            (folder / name).write_text(json.dumps(content if changed is None else changed))

        return damage

    def instead(make: Callable[[Path], None]) -> Damage:
        def damage(folder: Path, rng: Random) -> None:
            (folder / name).unlink()
            make(folder / name)

        return damage

    yield kind("cut short", Due.REFUSE, of_bytes(lambda b, r: b[: r.randrange(1, len(b) - 3)]))
    yield kind("empty", Due.REFUSE, of_bytes(lambda b, r: b""))
    yield kind("a byte changed", Due.ANY, of_bytes(flipped))
    yield kind("noise", Due.REFUSE, of_bytes(lambda b, r: r.randbytes(len(b))))
    yield kind("zeros", Due.REFUSE, of_bytes(lambda b, r: bytes(len(b))))
    yield kind("brackets", Due.REFUSE, of_bytes(lambda b, r: b"[" * r.choice((2000, 100_000))))
    yield kind("deep objects", Due.REFUSE, of_bytes(lambda b, r: b'{"a":' * r.choice((900, 10**5))))
    yield kind("a list", Due.REFUSE, of_bytes(lambda b, r: b"[" + b + b"]"))
    yield kind("a word", Due.REFUSE, of_bytes(lambda b, r: r.choice((b"null", b'"x"', b"7"))))
    yield kind("a key twice", Due.REFUSE, of_bytes(first_key_twice))
    yield kind("many keys", Due.REFUSE if closed else Due.ANY, of_bytes(many_keys))
    yield kind("many keys twice", Due.REFUSE, of_bytes(many_keys_twice))
    yield kind("an impossible number", Due.REFUSE, of_content_text(name))
    yield kind("text for a number", leaf_due, of_content(lambda c, r: put(c, r, number, "17 kg")))
    yield kind("null for a number", Due.ANY, of_content(lambda c, r: put(c, r, number, None)))
    yield kind("a list for a number", leaf_due, of_content(lambda c, r: put(c, r, number, [1.0])))
    yield kind("true for a number", leaf_due, of_content(lambda c, r: put(c, r, number, True)))
    yield kind("an object for text", leaf_due, of_content(lambda c, r: put(c, r, str, {"a": 1})))
    yield kind("a number for text", leaf_due, of_content(lambda c, r: put(c, r, str, 3)))
    yield kind("a list for an object", leaf_due, of_content(lambda c, r: put(c, r, dict, [1])))
    yield kind("a folder", Due.REFUSE, instead(lambda p: p.mkdir()))
    yield kind("a pipe", Due.REFUSE, instead(lambda p: os.mkfifo(p)))
    yield kind("a link to nothing", Due.REFUSE, instead(lambda p: p.symlink_to("gone")))
    yield kind("a device", Due.REFUSE, instead(lambda p: p.symlink_to("/dev/zero")))
    yield kind("byte order mark", Due.ACCEPT, of_bytes(lambda b, r: b"\xef\xbb\xbf" + b))
    yield kind("UTF-16", Due.ACCEPT, of_bytes(lambda b, r: b.decode().encode("utf-16")))
    yield kind("Windows line ends", Due.ACCEPT, of_bytes(lambda b, r: b.replace(b"\n", b"\r\n")))
    yield kind("one line", Due.ACCEPT, of_content(lambda c, r: None))
    yield kind("another order", Due.ACCEPT, of_content(reordered))


def number(value: Any) -> bool:
    """Return whether a value is a number."""
    return isinstance(value, int | float) and not isinstance(value, bool)


def flipped(content: bytes, rng: Random) -> bytes:
    """Change one byte."""
    at = rng.randrange(len(content))
    return content[:at] + bytes([rng.randrange(256)]) + content[at + 1 :]


def first_key_twice(content: bytes, rng: Random) -> bytes:
    """Name the first key again."""
    return content.replace(b"{", b'{"format": 1, "format": 1, ', 1)


def many_keys(content: bytes, rng: Random) -> bytes:
    """Add keys that mean nothing."""
    keys = ", ".join(f'"key {k}": {k}' for k in range(50_000))
    return content.replace(b"{", f"{{{keys}, ".encode(), 1)


def many_keys_twice(content: bytes, rng: Random) -> bytes:
    """Add keys, all of them twice."""
    keys = ", ".join(f'"key {k % 25_000}": {k}' for k in range(50_000))
    return content.replace(b"{", f"{{{keys}, ".encode(), 1)


def of_content_text(name: str) -> Damage:
    """Put a number that no machine holds in place of one."""

    def damage(folder: Path, rng: Random) -> None:
        content = json.loads((folder / name).read_text("utf-8"))
        put(content, rng, number, "@")
        text = json.dumps(content).replace('"@"', rng.choice(IMPOSSIBLE))
        (folder / name).write_text(text)

    return damage


def put(content: Any, rng: Random, fits: Any, value: Any) -> None:
    """Put a value in place of one that fits, at random."""
    suits = fits if callable(fits) and not isinstance(fits, type) else None
    places = [
        (holder, key)
        for holder, key in _places(content)
        if (suits(holder[key]) if suits else isinstance(holder[key], fits))
        and key not in ("comment", "law", "note", "law_text")
    ]
    if places:
        holder, key = rng.choice(places)
        holder[key] = value


def _places(content: Any) -> Iterator[tuple[Any, Any]]:
    keys = content if isinstance(content, dict) else range(len(content))
    for key in list(keys):
        yield content, key
        if isinstance(content[key], dict | list):
            yield from _places(content[key])


def reordered(content: dict[str, Any], rng: Random) -> dict[str, Any]:
    """Return the same keys in another order."""
    items = list(content.items())
    rng.shuffle(items)
    return dict(items)
