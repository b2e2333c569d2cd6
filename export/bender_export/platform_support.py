"""Which machines can run the FMUs: PythonFMU ships ready-made libraries for two of them."""

import platform

from bender_loop.errors import RunError

_SYSTEMS = ("Linux", "Windows")
_MACHINES = ("x86_64", "amd64")
_OLDEST_GLIBC = (2, 32)


def unsupported() -> str | None:
    """Return why the FMUs made here cannot run on this machine, and what still works; None where they can."""
    system, machine = platform.system(), platform.machine()
    found = f"{system} {machine}"
    if system in _SYSTEMS and machine.lower() in _MACHINES:
        if system == "Windows":
            return None
        library, version = platform.libc_ver()
        if library == "glibc" and tuple(int(x) for x in version.split(".")[:2]) >= _OLDEST_GLIBC:
            return None
        found = f"{found} with {library or 'another C library'} {version}".rstrip()
    return (
        f"PythonFMU ships no library for {found}, only for x86-64 Linux with glibc 2.32 or newer and x86-64 "
        "Windows: the FMUs can be built here and run there, FMUs of other makers run here as far as they carry a "
        "library for this machine, everything that needs no FMU works, and so do FMUs without Python "
        "where there is a C compiler: bender fmu build --native"
    )


def require_support() -> None:
    """Make sure that the FMUs can run here.

    Raises:
        RunError: they cannot; says why and what still works.
    """
    reason = unsupported()
    if reason is not None:
        raise RunError(reason)
