"""Error messages of FMUs and their loaders that people meet, with what they mean."""

import re

from bender_loop.fmu.check.findings import Finding, error

# (pattern, why, remedy)
KNOWN: tuple[tuple[str, str, str], ...] = (
    (
        r"undefined symbol: _?Py",
        "the FMU needs a Python interpreter and its host has none",
        "start the host with LD_PRELOAD=libpython3.11.so.1.0 (the library of your Python)",
    ),
    (
        r"GLIBC_2\.\d+.* not found",
        "the binary was made for a newer Linux than this one",
        "run it on a system with that glibc (PythonFMU: 2.32 or newer), or export it here",
    ),
    (
        r"No module named",
        "the FMU is written in Python and imports a package that the interpreter of its host does not have",
        "install the package for the first python3 on the PATH, or set PYTHONPATH to where it is",
    ),
    (
        r"cannot open shared object file",
        "the binary needs a library that is not installed here",
        "install the library that the message names",
    ),
    (
        r"invalid ELF header|file too short|wrong ELF class|not a valid Win32|not a mach-o",
        "the binary is damaged or was made for another platform",
        "export or download the FMU anew, for this platform",
    ),
    (
        r"python3\.dll|The specified module could not be found|\[WinError 126\]",
        "Windows does not find a library that the binary needs, python3.dll for FMUs made by PythonFMU",
        "put the folder of python3.dll on the PATH before the host starts",
    ),
    (
        r"fmi2\w+' not found|function 'fmi2|symbol: fmi2|no attribute 'fmi2",
        "the binary lacks a function that the standard demands",
        "ask the maker of the FMU for one that follows FMI 2.0",
    ),
)


def explained_failure(what: str, why: str, remedy: str) -> Finding:
    """An error, with the explanation of a message that is known, else with the one given."""
    for pattern, known_why, known_remedy in KNOWN:
        if re.search(pattern, what):
            return error(what, known_why, known_remedy)
    return error(what, why, remedy)
