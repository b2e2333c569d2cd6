"""What pydantic finds wrong with a file, in one sentence that a person can act on."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pydantic import ValidationError


def first_complaint(error: "ValidationError", table: str = "") -> str:
    """Return the key of the first problem and what to do about it, as "guard.bogus: unknown key; ...".

    Args:
        error: what pydantic raised.
        table: name of the table that was checked, where the file has several.
    """
    problem = error.errors()[0]
    key = ".".join([*([table] if table else []), *(str(part) for part in problem["loc"])])
    return f"{key}: {_sentence(problem['type'], problem['msg'], problem['input'])}"


def _sentence(kind: str, message: str, found: object) -> str:
    if kind == "extra_forbidden":
        return "unknown key; remove it or correct its spelling"
    if kind == "missing":
        return "is missing"
    return f"found {found!r}, {message[:1].lower()}{message[1:]}"
