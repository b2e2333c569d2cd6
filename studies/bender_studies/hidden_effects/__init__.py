"""The judge of `bender diagnose`: benches with something hidden are diagnosed, and the answers held to the truth.

What is judged runs in processes of its own that are given records and nothing else; the truth stays with the judge.
"""
