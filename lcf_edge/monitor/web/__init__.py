"""The page for a browser, served by a process of its own that subscribes as any planner does.

``server`` serves it, ``update`` makes its data, ``saving`` a file of the last seconds;
``page`` is the page itself: HTML, style and scripts as they are sent.
"""
