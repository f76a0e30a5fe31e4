"""State of a running daemon for viewers: subscribed over Zenoh, in memory of fixed size.

``daemon_address`` identifies the daemon; ``monitor`` holds the latest data and whether the daemon is present;
``history`` the last seconds as they were sent, ``traces`` the figures of the last minutes; ``lines`` a scene as JSON.
"""
