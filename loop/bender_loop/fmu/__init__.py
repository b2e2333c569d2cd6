"""FMUs of any make: file, ports, instance, calls, log, and the plant made of them."""
