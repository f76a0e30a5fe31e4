"""A recording in place of a daemon, for the same page and the same table.

``player`` runs the pipeline over it and can be paused and sought in; ``alarms`` looks through all of it for where
something comes to be met; ``replayed`` is what is played, and what can be asked of it.
"""
