"""What the page shows, from the tables of a fleet."""
from pathlib import Path


def write_page(out: Path, action: str) -> Path:
    """Write."""
    return out / "fleet.html"
