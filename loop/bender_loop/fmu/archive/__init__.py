"""What an FMU file may be before it is used: `bounds` of the archive, `binary` for the libraries in it."""
