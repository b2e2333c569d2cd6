"""Supplies: capabilities and dialects as tables, one driver over them, links over PyVISA."""
