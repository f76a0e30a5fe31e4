"""From an image to the corners that the filter takes.

``detector`` does all of it. It uses ``fast`` (the corners of an image and of parts of it) with ``fast_scores`` and
``fast_threshold`` (how many are found), ``hot_pixels`` and ``along_edge`` (which of them are defects of the sensor, or
places along an edge), ``spread`` (which are kept) and ``appearance`` (what surrounds them). The loops are compiled.
``own_parts`` says where none are looked for, ``image_quality`` what is wrong with an image.
"""
