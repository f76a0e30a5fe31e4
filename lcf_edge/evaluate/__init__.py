"""Many recordings through the pipeline, and one report of how well it did.

``corpus`` finds the recordings, with the settings and the truth beside each; ``truth`` reads what is known of their
pictures and ``score`` compares what was reported with it. ``one_recording`` does that for one, in the process that
calls it: ``workers`` are processes here, or those of a Dask cluster. ``evaluation`` hands the recordings out and
writes what comes back: numbers (``report``), a line a frame, pictures (``drawings``) and a page that shows them
(``page``).
"""
