"""A process of its own before the daemon's TLS port: strangers are its business, the daemon sees parties only.

Zenoh accepts ten failed TLS handshakes a second and keeps every other connection open meanwhile: a few strangers keep
all others out, and use up the daemon's descriptors. So ``gate`` listens in its place, with bounds on all that it holds;
who has shown a certificate is connected through to the daemon, with the certificate that ``certificates`` has for it.
"""
