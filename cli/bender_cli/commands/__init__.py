"""One file per command, each with HELP, EXAMPLE, add_arguments and run; heavy imports stay inside run."""
