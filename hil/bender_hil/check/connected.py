"""What else is connected, for a source or a sensor that does not answer."""

import contextlib
import warnings
from pathlib import Path


def connected() -> list[str]:
    """Return the addresses that VISA and the system know of; network instruments are not found by searching."""
    found: list[str] = []
    with contextlib.suppress(Exception):
        from serial.tools.list_ports import comports

        found += [f"{port.device} ({port.description})" for port in comports() if port.hwid != "n/a"]
    with contextlib.suppress(Exception):
        import pyvisa

        with warnings.catch_warnings():
            # packages that would find more by searching are not worth a warning to somebody who knows the address
            warnings.simplefilter("ignore")
            manager = pyvisa.ResourceManager("@py")
            found += [name for name in manager.list_resources() if not name.startswith("ASRL")]
            manager.close()
    found += [str(path) for path in sorted(Path("/dev").glob("video*"))]
    return found
