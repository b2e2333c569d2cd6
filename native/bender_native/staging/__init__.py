"""The staging translator: plain Python functions run with some numbers unknown, and the C99 that is left of them."""
