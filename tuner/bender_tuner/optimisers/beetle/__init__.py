"""Beetle antennae search: as the paper prints it, as Jiang and Li describe it, and a reliable variant."""
