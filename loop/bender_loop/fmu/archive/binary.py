"""What the header of a machine code file says: whether it is a shared library, and for which machine.

Nothing is loaded. Formats: ELF (System V ABI, chapter 4), PE/COFF (Microsoft's specification), Mach-O (Apple's
mach-o/loader.h and mach-o/fat.h).
"""

import struct
from dataclasses import dataclass
from pathlib import PurePosixPath

HEADER_BYTES = 1 << 16
"""Enough for every header that is read here."""

_ELF_MACHINES = {
    3: "x86", 62: "x86_64", 40: "arm", 183: "aarch64", 8: "mips", 20: "powerpc", 21: "powerpc64", 22: "s390",
    243: "riscv",
}  # fmt: skip
_PE_MACHINES = {0x14C: "x86", 0x8664: "x86_64", 0x1C4: "arm", 0xAA64: "aarch64"}
_MACH_MACHINES = {7: "x86", 0x01000007: "x86_64", 12: "arm", 0x0100000C: "aarch64"}
_SHARED_OBJECT, _LOADABLE_SEGMENT = 3, 1
_DLL = 0x2000
_MACH_LIBRARIES = (6, 8)
_FAT = 0xCAFEBABE
_MOST_SLICES = 32
_ENDINGS = {"linux": ".so", "windows": ".dll", "darwin": ".dylib"}
_FORMATS = {"linux": "ELF", "windows": "PE", "darwin": "Mach-O"}
_FMI_2_FOLDERS = {
    "linux32": ("linux", "x86"),
    "linux64": ("linux", "x86_64"),
    "win32": ("windows", "x86"),
    "win64": ("windows", "x86_64"),
    "darwin32": ("darwin", "x86"),
    "darwin64": ("darwin", "x86_64"),
}


@dataclass(frozen=True, slots=True)
class Binary:
    """What a header says.

    Attributes:
        format: "ELF", "PE" or "Mach-O".
        machines: "x86", "x86_64", "aarch64" and others; several in a universal file.
        shared: whether it is a library rather than a program or an object file.
        needed_bytes: the file must be this long to be whole, as far as the header tells.
    """

    format: str
    machines: tuple[str, ...]
    shared: bool
    needed_bytes: int


def platform_of(folder: str) -> tuple[str, str] | None:
    """Return (system, machine) of a folder under `binaries`, of FMI 1.0 to 3.0; None for one that is not known."""
    if folder in _FMI_2_FOLDERS:
        return _FMI_2_FOLDERS[folder]
    machine, _, system = folder.partition("-")
    return (system, machine) if system in _ENDINGS else None


def is_library(path: PurePosixPath) -> bool:
    """Whether `path` is binaries/PLATFORM/NAME with the ending of that platform."""
    if len(path.parts) != 3 or path.parts[0] != "binaries":
        return False
    platform = platform_of(path.parts[1])
    return platform is not None and path.suffix == _ENDINGS[platform[0]]


def binary_fault(folder: str, header: bytes, size: int) -> str | None:
    """Return what is wrong with a library in `binaries/<folder>`, or None.

    Args:
        folder: of FMI 1.0, 2.0 or 3.0.
        header: the first `HEADER_BYTES` of the file.
        size: of the whole file in bytes.
    """
    platform = platform_of(folder)
    if platform is None:
        return None
    system, machine = platform
    wanted = f"expected a shared library for {machine} ({_FORMATS[system]})"
    try:
        found = read_header(header)
    except (struct.error, OverflowError):
        return f"its header is cut off, {wanted}"
    if found is None:
        return f"found {_first_bytes(header)}, {wanted}"
    if found.format != _FORMATS[system]:
        return f"found a {found.format} file for {' and '.join(found.machines)}, {wanted}"
    # darwin64 holds libraries for both processors that its systems run on
    allowed = (machine, "aarch64") if folder == "darwin64" else (machine,)
    if not any(known in allowed for known in found.machines):
        return f"found a {found.format} file for {' and '.join(found.machines)}, {wanted}"
    if not found.shared:
        return f"found a {found.format} file that is no shared library (a program or an object file), {wanted}"
    if size < found.needed_bytes:
        return f"found {size} bytes, its header asks for {found.needed_bytes}: it is cut off"
    return None


def read_header(data: bytes) -> Binary | None:
    """Return what the header at the start of `data` says, or None for no machine code.

    Raises:
        struct.error, OverflowError: it is cut off.
    """
    if data[:4] == b"\x7fELF":
        return _elf(data)
    if data[:2] == b"MZ":
        return _pe(data)
    if data[:4] in (b"\xcf\xfa\xed\xfe", b"\xce\xfa\xed\xfe"):
        machine, _, kind = struct.unpack_from("<III", data, 4)
        return Binary("Mach-O", (_MACH_MACHINES.get(machine, f"machine {machine}"),), kind in _MACH_LIBRARIES, 0)
    if len(data) >= 8 and struct.unpack_from(">I", data)[0] == _FAT:
        return _universal(data)
    return None


def _elf(data: bytes) -> Binary:
    order = ">" if data[5:6] == b"\x02" else "<"
    wide = data[4:5] == b"\x02"
    kind, machine = struct.unpack_from(f"{order}HH", data, 16)
    start, entry_bytes, count = (
        (*struct.unpack_from(f"{order}Q", data, 32), *struct.unpack_from(f"{order}HH", data, 54))
        if wide
        else (*struct.unpack_from(f"{order}I", data, 28), *struct.unpack_from(f"{order}HH", data, 42))
    )
    name = _ELF_MACHINES.get(machine, f"machine {machine}")
    if name == "x86_64" and not wide:
        name = "x86_64 with 32 bit addresses"
    if name == "riscv":
        name = "riscv64" if wide else "riscv32"
    needed, loadable = start + count * entry_bytes, False
    if len(data) == HEADER_BYTES and needed > len(data):  # the table stands further down: not looked at
        return Binary("ELF", (name,), kind == _SHARED_OBJECT, needed)
    for k in range(min(count, 64)):
        at = start + k * entry_bytes
        type_, offset, filled = (
            (*struct.unpack_from(f"{order}I", data, at), *struct.unpack_from(f"{order}Q16xQ", data, at + 8))
            if wide
            else (*struct.unpack_from(f"{order}II", data, at), *struct.unpack_from(f"{order}I", data, at + 16))
        )
        loadable = loadable or type_ == _LOADABLE_SEGMENT
        needed = max(needed, offset + filled)
    return Binary("ELF", (name,), kind == _SHARED_OBJECT and loadable, needed)


def _pe(data: bytes) -> Binary | None:
    at = struct.unpack_from("<I", data, 60)[0]
    if data[at : at + 4] != b"PE\0\0":
        return None
    machine, sections = struct.unpack_from("<HH", data, at + 4)
    optional_bytes, characteristics = struct.unpack_from("<HH", data, at + 20)
    needed = 0
    for k in range(sections):
        size, start = struct.unpack_from("<II", data, at + 24 + optional_bytes + 40 * k + 16)
        needed = max(needed, start + size if size else 0)
    name = _PE_MACHINES.get(machine, f"machine {machine:#x}")
    return Binary("PE", (name,), bool(characteristics & _DLL), needed)


def _universal(data: bytes) -> Binary | None:
    count = struct.unpack_from(">I", data, 4)[0]
    if not 0 < count <= _MOST_SLICES:  # a class file of Java begins alike
        return None
    machines, needed = [], 0
    for k in range(count):
        machine, _, offset, size = struct.unpack_from(">IIII", data, 8 + 20 * k)
        machines.append(_MACH_MACHINES.get(machine, f"machine {machine}"))
        needed = max(needed, offset + size)
    return Binary("Mach-O", tuple(machines), shared=True, needed_bytes=needed)


def _first_bytes(header: bytes) -> str:
    if not header:
        return "an empty file"
    shown = header[:16]
    return f"no machine code (it begins with {shown!r})"
