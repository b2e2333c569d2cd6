"""The emulated bench: a SCPI supply, the plant's FMU in real time, and a microscope, each in its own process."""
