"""Cases: what is hidden in which bench, drawn, selected and written to files."""
