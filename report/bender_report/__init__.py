"""One look for every page and picture: palette, charts, words and number formats."""
