"""Damaged FMUs: bytes of the archive, entries of it, the model description and what stands under resources.

Machine code is left alone: whoever loads a changed library runs whatever it says.
"""

import io
import random
import re
import zipfile
from collections.abc import Callable

NASTY = (
    "", " ", "0", "-1", "1e999", "NaN", "INF", "99999999999999999999", "true", "input", "output", "parameter", "Real",
    "fixed", "calculated", "../../etc", "a b", "é\u4e2d", "x" * 5000, "1.0", "3.0", "<", "&amp;", "m", "V", "{}",
    "\u0000",
)  # fmt: skip
# entities that grow tenfold from letter to letter, to eat the memory of a careless parser
_ENTITIES = "".join(f'<!ENTITY {b} "{f"&{a};" * 10}">' for a, b in zip("abcdefgh", "bcdefghi", strict=True))
_BOMB = f'<!DOCTYPE r [<!ENTITY a "aaaaaaaaaa">{_ENTITIES}]><r>&i;</r>'

Mutation = Callable[[bytes, random.Random], bytes]


def mutated(data: bytes, random_numbers: random.Random) -> tuple[bytes, str]:
    """Return a damaged copy of an FMU and the name of what was done to it."""
    mutation = random_numbers.choice(_MUTATIONS)
    damaged = mutation(data, random_numbers)
    if random_numbers.random() < 0.2:
        damaged = random_numbers.choice(_OF_BYTES)(damaged, random_numbers)
    return damaged, mutation.__name__.removeprefix("_")


def _flip_bytes(data: bytes, random_numbers: random.Random) -> bytes:
    damaged = bytearray(data)
    for _ in range(random_numbers.choice((1, 3, 50))):
        if damaged:
            damaged[random_numbers.randrange(len(damaged))] ^= random_numbers.randrange(1, 256)
    return bytes(damaged)


def _flip_directory(data: bytes, random_numbers: random.Random) -> bytes:
    """Damage the table at the end, which says what is where."""
    begin = max(len(data) - random_numbers.choice((30, 300, 6000)), 0)
    return data[:begin] + _flip_bytes(data[begin:], random_numbers)


def _cut(data: bytes, random_numbers: random.Random) -> bytes:
    return data[: random_numbers.randrange(len(data) + 1)]


def _surround(data: bytes, random_numbers: random.Random) -> bytes:
    return random_numbers.randbytes(random_numbers.randrange(40)) + data + random_numbers.randbytes(40)


def _overwrite(data: bytes, random_numbers: random.Random) -> bytes:
    begin, length = random_numbers.randrange(len(data) + 1), random_numbers.choice((1, 100, 10_000))
    return data[:begin] + bytes(length) + data[begin + length :]


def _drop_entry(data: bytes, random_numbers: random.Random) -> bytes:
    def edit(entries: dict[str, bytes]) -> None:
        del entries[random_numbers.choice(list(entries))]

    return _edited(data, edit)


def _rename_entry(data: bytes, random_numbers: random.Random) -> bytes:
    def edit(entries: dict[str, bytes]) -> None:
        name = random_numbers.choice(list(entries))
        entries[random_numbers.choice(("../x", "/x", "a\\b", ".", "x/", name.upper(), "x" * 300))] = entries.pop(name)

    return _edited(data, edit)


def _strange_compression(data: bytes, random_numbers: random.Random) -> bytes:
    return _edited(
        data, lambda _: None, random_numbers.choice((zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA, zipfile.ZIP_STORED))
    )


def _attribute(data: bytes, random_numbers: random.Random) -> bytes:
    def edit(text: str) -> str:
        places = list(re.finditer(r'[\w:]+="([^"]*)"', text))
        if not places:
            return text
        place = random_numbers.choice(places)
        if random_numbers.random() < 0.3:
            return text[: place.start()] + text[place.end() :]
        return text[: place.start(1)] + random_numbers.choice(NASTY) + text[place.end(1) :]

    return _description(data, edit, random_numbers.choice((1, 1, 3)))


def _element(data: bytes, random_numbers: random.Random) -> bytes:
    def edit(text: str) -> str:
        lines = text.splitlines(keepends=True)
        k = random_numbers.randrange(len(lines))
        lines[k] = random_numbers.choice(
            ("", lines[k] * 2, lines[random_numbers.randrange(len(lines))], lines[k][::-1])
        )
        return "".join(lines)

    return _description(data, edit, random_numbers.choice((1, 2, 5)))


def _encoding(data: bytes, random_numbers: random.Random) -> bytes:
    encoding = random_numbers.choice(("utf-16", "latin-1", "utf-8-sig", "utf-7"))

    def edit(entries: dict[str, bytes]) -> None:
        text = entries["modelDescription.xml"].decode()
        entries["modelDescription.xml"] = text.encode(encoding, "replace")

    return _edited(data, edit)


def _whole_description(data: bytes, random_numbers: random.Random) -> bytes:
    texts = ("", "<a/>", "<fmiModelDescription/>", "{}", "\x00", "<a>" * 3000, _BOMB)
    return _description(data, lambda _: random_numbers.choice(texts), 1)


def _resource(data: bytes, random_numbers: random.Random) -> bytes:
    def edit(entries: dict[str, bytes]) -> None:
        name = random_numbers.choice([name for name in entries if name.startswith("resources/")])
        whole = entries[name]
        entries[name] = random_numbers.choice(
            (b"", whole[: random_numbers.randrange(len(whole) + 1)], b"\x00" + whole, whole * 2)
        )

    return _edited(data, edit)


_OF_BYTES: tuple[Mutation, ...] = (_flip_bytes, _flip_directory, _cut, _surround, _overwrite)
_MUTATIONS: tuple[Mutation, ...] = (
    *_OF_BYTES,
    _drop_entry,
    _rename_entry,
    _strange_compression,
    _attribute,
    _attribute,
    _attribute,
    _element,
    _element,
    _encoding,
    _whole_description,
    _resource,
    _resource,
)


def _description(data: bytes, edit: Callable[[str], str], times: int) -> bytes:
    def edit_entries(entries: dict[str, bytes]) -> None:
        for _ in range(times):
            text = entries["modelDescription.xml"].decode("utf-8", "replace")
            entries["modelDescription.xml"] = (edit(text) if text else text).encode("utf-8", "replace")

    return _edited(data, edit_entries)


def _edited(data: bytes, edit: Callable[[dict[str, bytes]], None], compression: int = zipfile.ZIP_STORED) -> bytes:
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        entries = {name: archive.read(name) for name in archive.namelist()}
    edit(entries)
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, content in entries.items():
            archive.writestr(zipfile.ZipInfo(name), content, compression)
    return buffer.getvalue()
