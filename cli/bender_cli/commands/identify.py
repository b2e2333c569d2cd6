"""`bender identify`: a hysteresis model learned from records."""

from bender_identify.command import add_arguments, run

HELP = "learn a hysteresis model from records"
EXAMPLE = "bender identify record.csv --out model.toml"

__all__ = ["EXAMPLE", "HELP", "add_arguments", "run"]
