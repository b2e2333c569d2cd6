"""The paper's own identification: its recipe and its simulated model."""
