"""Where a model comes from: the records it was learned from, the numbers learned, and the report that tells of both."""

from dataclasses import dataclass, fields

from bender_plant.parameter import ModelError


@dataclass(frozen=True, slots=True)
class Origin:
    """What a model file and the FMUs made of it say of their making.

    Attributes:
        records: names of the files that the model was learned from.
        numbers: what was learned, one sentence each with its interval of 95 %.
        command_unit: of the records; 1 V of the model is 1 of it.
        reading_unit: of the records; 1 um of the model is 1 of it.
        report: name of the file beside the model file that tells of all this; "" for none.

    Raises:
        ModelError: a value is no text, or the report is not a plain file name.
    """

    records: tuple[str, ...] = ()
    numbers: tuple[str, ...] = ()
    command_unit: str = "V"
    reading_unit: str = "um"
    report: str = ""

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            is_list = field.name in ("records", "numbers")
            if not (isinstance(value, tuple) if is_list else isinstance(value, str)):
                wanted = "a list of texts" if is_list else "a text"
                raise ModelError(f"origin.{field.name}: found {value!r}, expected {wanted}")
            if is_list and not all(isinstance(x, str) for x in value):
                raise ModelError(f"origin.{field.name}: found {value!r}, expected a list of texts")
        if self.report != self.report.replace("\\", "/").rpartition("/")[2] or self.report in (".", ".."):
            raise ModelError(f"origin.report: found {self.report!r}, expected the name of a file beside the model file")
        for name in ("records", "numbers"):
            object.__setattr__(self, name, tuple(_printable(x) for x in getattr(self, name)))
        for name in ("command_unit", "reading_unit", "report"):
            object.__setattr__(self, name, _printable(getattr(self, name)))


def _printable(text: str) -> str:
    """Return a text as it may stand in XML."""
    return "".join(sign if sign.isprintable() else "?" for sign in text)
