"""The page for a browser, served by a process of its own that subscribes as any planner does.

``server`` answers, ``guard`` decides whom, ``update`` is what the page receives, ``saving`` makes a file of the last
seconds; ``page`` is the page itself: HTML, style and scripts as they are sent.
"""
