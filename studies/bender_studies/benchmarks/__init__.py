"""The benchmarks behind `bender benchmark`, one file each; they are listed in `bender_cli.commands.benchmark`."""
