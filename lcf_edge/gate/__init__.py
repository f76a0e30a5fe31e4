"""A process of its own in front of the daemon: it deals with strangers, the daemon sees only parties.

Zenoh handles only ten failing TLS handshakes a second and keeps all other connections waiting: a few strangers keep
all others out, and use up the daemon's descriptors. And it has no limits for the keys of those who are let in. So
``gate`` listens in its place, within bounds: whoever has shown a certificate is connected through to the daemon, with
the certificate that ``certificates`` has for it; or, on the computer itself, whoever has begun a session with it.
``own`` is the gate that the daemon itself starts.
"""
