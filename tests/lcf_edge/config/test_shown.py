"""Whoever asks for the configuration, or gets a recording, gets no keys."""

from lcf_edge.config import Config, Zenoh
from lcf_edge.config.shown import shown


def test_what_an_endpoint_carries_is_not_shown() -> None:
    inline = "tls/127.0.0.1:7448#listen_private_key_base64=c2VjcmV0;so_sndbuf=1"
    text = shown(Config(zenoh=Zenoh(listen=[inline], connect=[inline])))
    assert "secret" not in text
    assert "c2VjcmV0" not in text
    assert text.count("tls/127.0.0.1:7448") == 2
