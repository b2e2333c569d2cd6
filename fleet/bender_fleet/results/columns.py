"""The columns of the tables, by what was done; imports nothing heavy until a table is made."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pyarrow import Schema

DIAGNOSE, COMPARE, IDENTIFY, WATCH = "diagnose", "compare", "identify", "watch"
_NUMBER, _TEXT, _FLAG, _TEXTS = "number", "text", "flag", "texts"
_COLUMNS: dict[str, dict[str, str]] = {
    DIAGNOSE: {
        "verdict": _TEXT,
        "complete": _FLAG,
        "effects": _TEXTS,
        "sentence": _TEXT,
        "before_um": _NUMBER,
        "recalibrated_um": _NUMBER,
        "after_um": _NUMBER,
        "noise_floor_um": _NUMBER,
        "after_percent": _NUMBER,
        "gain": _NUMBER,
        "offset_um": _NUMBER,
        "next_experiment": _TEXT,
        "has_model": _FLAG,
        "warnings": _TEXTS,
    },
    COMPARE: {
        "before_um": _NUMBER,
        "recalibrated_um": _NUMBER,
        "after_percent": _NUMBER,
        "gain": _NUMBER,
        "offset_um": _NUMBER,
    },
    IDENTIFY: {
        "learned": _TEXT,
        "equation": _TEXT,
        "held_out_percent": _NUMBER,
        "floor_percent": _NUMBER,
        "has_model": _FLAG,
    },
    WATCH: {
        "verdict": _TEXT,
        "effects": _TEXTS,
        "sentence": _TEXT,
        "alarms": _NUMBER,
        "since_s": _NUMBER,
        "change_um": _NUMBER,
        "noise_um": _NUMBER,
        "gain_change": _NUMBER,
        "offset_change_um": _NUMBER,
    },
}


def row_fields(action: str) -> list[tuple[str, Any]]:
    """Return names and Arrow types of what an action says of a unit."""
    import pyarrow as pa

    types = {_NUMBER: pa.float64(), _TEXT: pa.string(), _FLAG: pa.bool_(), _TEXTS: pa.list_(pa.string())}
    return [(name, types[kind]) for name, kind in _COLUMNS[action].items()]


def effect_fields() -> list[tuple[str, Any]]:
    """Return names and Arrow types of what is said of one effect of a unit."""
    import pyarrow as pa

    parameter = pa.struct(
        [("name", pa.string()), ("value", pa.float64()), ("std", pa.float64()), ("unit", pa.string())]
    )
    return [
        ("effect", pa.string()),
        ("stage", pa.string()),
        ("certain", pa.bool_()),
        ("share_of_gap", pa.float64()),
        ("rivals", pa.list_(pa.string())),
        ("evidence", pa.string()),
        ("parameters", pa.list_(parameter)),
    ]


def unit_schema(action: str, more: tuple[str, ...]) -> "Schema":
    """Return the schema of the table of units; `more` are further columns of the manifest, kept as text."""
    import pyarrow as pa

    known = ("unit", "date", "batch", "model", "records", "status", "reason")
    fields: list[tuple[str, Any]] = [
        (x, pa.list_(pa.string()) if x == "records" else pa.date32() if x == "date" else pa.string()) for x in known
    ]
    fields += row_fields(action)
    taken = {name for name, _ in fields}
    return pa.schema([*fields, *((_free(x, taken), pa.string()) for x in more)])


def _free(name: str, taken: set[str]) -> str:
    """Return the name of a column of the manifest, marked where we have one of that name."""
    return f"manifest_{name}" if name in taken else name


def effect_schema() -> "Schema":
    """Return the schema of the table of effects."""
    import pyarrow as pa

    return pa.schema([("unit", pa.string()), *effect_fields()])
