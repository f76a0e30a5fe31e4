"""Many recordings through the pipeline, and one report of how well it did.

``corpus`` finds the recordings, with the settings and the truth beside each; ``truth`` reads what is known of their
images and ``score`` compares the results with it. ``one_recording`` does that for one recording, in the calling
process: ``workers`` are processes here, or those of a Dask cluster. ``evaluation`` hands the recordings out and
writes what comes back: numbers (``report``), a line a frame, images (``drawings``) and a page that shows them
(``page``).
"""
