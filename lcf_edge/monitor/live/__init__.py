"""What viewers know of a running daemon: subscribed over Zenoh, in memory of fixed size.

``daemon_address`` says which daemon; ``monitor`` holds the newest of everything and whether the daemon is there;
``history`` the last seconds as they were sent, ``traces`` the figures of the last minutes; ``lines`` a scene as JSON.
"""
