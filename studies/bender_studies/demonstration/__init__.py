"""What `bender demo` does: steps that return results, sections that tell them, one page that shows them.

A step is a function in `steps` that takes what it needs and returns a frozen result; `story` turns results into
sections of a page. A further step is one more function in each, and one more line in `run`.
"""
