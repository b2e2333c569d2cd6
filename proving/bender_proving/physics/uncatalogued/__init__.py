"""Physics of effects that no catalogue should have: energy exchange, random jumps between two states."""
