"""A recording in place of a daemon, for the same page and the same table.

``player`` runs the pipeline over it and can pause and seek; ``alarms`` searches all of it for places where
something comes to be met; ``replayed`` says what is played, and has its commands.
"""
