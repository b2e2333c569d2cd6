"""Export of the plant and of the PID block as FMI 2.0 co-simulation FMUs: the only room that knows PythonFMU."""
