"""From a picture to the corners that the filter takes.

``detector`` is the whole way. It rests on ``fast`` (the corners of a picture and of parts of it) with ``fast_scores``
and ``fast_threshold`` (how many are found), ``along_edge`` (which of them are places along an edge), ``spread`` (which
are kept) and ``appearance`` (what is round them). The loops are compiled. ``own_parts`` says where none are looked
for, ``image_quality`` what a picture lacks.
"""
