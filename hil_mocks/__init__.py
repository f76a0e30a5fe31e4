"""Stand-ins for hardware: rendered drives with exact truth, recordings as devices, mock chips and ports.

`scenes` is the entry to rendered drives. It rests on `drives` (what a drive is), `layouts` and `plan` (the
kinds of drive), `trajectory` (how the vehicle moves), `projection` (what appears where), `textures` and
`rendering` (pictures) and `truth` (time to contact, misses, threats).
"""
