"""The daemon: the pipeline in real time, for as long as the vehicle runs.

A thread for each device (``reader``), one for the pipeline (``loop``), one for the preview (``preview``), and the main
thread with all that is done once a second (``service``). Between them are the newest frame and a fixed ring of samples
(``mailbox``): nothing is queued, every loss is counted, nothing grows.
"""
