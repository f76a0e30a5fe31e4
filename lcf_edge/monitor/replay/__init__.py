"""A recording in place of a daemon, for the same page and the same table.

``player`` runs the pipeline over it and can pause and seek; ``alarms`` searches all of it for places where a contact
becomes probable; ``replayed`` identifies the recording, and has its commands.
"""
