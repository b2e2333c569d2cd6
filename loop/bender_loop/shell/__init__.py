"""What commands share: progress, tables, whole files, complaints about files.

| module | holds |
|---|---|
| `bounded` | reading of files that may be anything |
| `cache` | what is kept between runs: where, how large, and to clear it |
| `closed_at_exit` | what is closed at the end of a `with` block |
| `complaint` | what pydantic finds wrong with a file, in one sentence that a person can act on |
| `completion` | the script that lets a shell complete commands and options |
| `extras` | what an optional part needs, and the command that installs it here |
| `failures` | failures as exit statuses and one line |
| `file_lock` | a lock on an open file, which ends with its process |
| `files` | files that are written whole or not at all, and text files that are read within bounds |
| `last_word` | the last word of a command: whether an output that it had switched on is known to be off |
| `messages` | messages between processes: lines of JSON over a loopback socket |
| `opencv` | OpenCV, imported where it is used: it belongs to the extra `bench` |
| `options` | the options that every command has |
| `plugins` | what other installed packages add |
| `process_group` | a process of its own group: keys typed at the terminal do not reach it |
| `progress` | what a command shows while it works and when it is done: a progress line and a table |
| `readable` | text on a stream that cannot show every sign |
| `run` | one run of a command: what it reads, how much it says, where its results come from |
| `silence` | what libraries write past Python goes nowhere |
| `toml_file` | TOML files, read within bounds of size and depth |
"""
