"""The report page of a diagnosis, its pictures, and the summary on the terminal."""
