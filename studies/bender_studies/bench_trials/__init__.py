"""Trials of the bench against its emulator: every fault in every state, reaction times, cadence."""
