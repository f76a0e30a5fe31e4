"""The attack on the parsers: every byte that comes from outside, mutated, for as long as one likes.

It lies with the tests, not with the stand-ins, because nothing of it is installed on a vehicle and what it finds stays
here as a test. ``python -m tests.fuzz`` runs it: ``targets`` are the parsers, ``mutation`` makes inputs of good ones,
``hunt`` is one process that looks for what a parser must not do, ``coverage`` the same guided by atheris.
``regressions`` holds inputs that once broke a parser; ``test_regressions`` tries them with the other tests.
"""
