"""Own parts in view, drawn by hand on a page for a browser.

``watcher`` follows the source and makes a proposal, ``server`` serves the page and takes what was drawn; ``page`` is
the page itself: HTML, style and scripts as they are sent.
"""
