"""Rendered drives with exact truth: what ``demo`` and ``bench`` run on where there is no camera.

``scenes`` is the entry. It rests on ``drives`` (what a drive is), ``layouts``, ``lookalikes``, ``placing`` and ``plan``
(the kinds of drive), ``trajectory`` (how the vehicle moves), ``projection`` (what appears where), ``textures`` and
``rendering`` (images) and ``truth`` (time to contact, misses, threats).
"""
