"""What every page of ours for a browser rests on.

``serving`` listens and sends files, ``library`` is what it needs, ``guard`` decides who is let in, ``doorkeeper`` how
many connections there may be; ``page`` is what the pages have in common.
"""
