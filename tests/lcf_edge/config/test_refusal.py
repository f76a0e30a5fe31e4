"""A value that cannot be used is refused in the words of the configuration, with what can be written instead."""

from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lcf_edge.config import load
from lcf_edge.errors import ConfigError


def refusal(setting: str) -> str:
    """What is said of it, behind the key."""
    with pytest.raises(ConfigError) as error:
        load(None, [setting])
    start = f"--set: {setting.partition('=')[0]}"
    assert str(error.value).startswith(start)
    return str(error.value).removeprefix(start)


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        (
            "camera.driver=v4l",
            '"v4l" is not allowed; did you mean v4l2? write one of auto, libcamera, recording, v4l2',
        ),
        ("camera.power_line_hz=55", "55 is not allowed; write one of 0, 50, 60"),
        ("log.level=LOUD", '"LOUD" is not allowed; write one of debug, error, info, warning'),
        ("log.level=INFO", '"INFO" is not allowed; did you mean info? write one of debug, error, info, warning'),
        ("imu.gyro_range_dps=333", "333 is not allowed; write one of 250, 500, 1000, 2000"),
        ('imu.gyro_range_dps="500"', '"500" is not allowed; did you mean 500? write one of 250, 500, 1000, 2000'),
        ("vehicle.half_width_m=wide", 'a number (at least 0.001, at most 10000) is needed, not "wide"'),
        ("camera.width=99999", "a whole number (at least 1, at most 16384) is needed, not 99999"),
        ("camera.width=640.5", "a whole number (at least 1, at most 16384) is needed, not 640.5"),
        ("camera.width=true", "a whole number (at least 1, at most 16384) is needed, not true"),
        ("camera.pitch_rad=2", "a number (above -1.5, below 1.5) is needed, not 2"),
        ("camera.exposure_s=auto", 'a number (at least 1e-06, at most 100) is needed, not "auto"'),
        ("publish.ros2=yes", 'true or false is needed, not "yes"'),
        ("camera.device=0", "a string in quotes is needed, not 0"),
        ("camera.device=2026-01-01", "a string in quotes is needed, not 2026-01-01"),
        ("imu=mpu6050", 'a table of keys is needed, not "mpu6050"'),
        ("zenoh.gossip=[]", "true or false is needed, not a list"),
    ],
)
def test_what_can_be_written_instead_is_said(setting: str, message: str) -> None:
    assert refusal(setting) == f": {message}"


def test_a_driver_is_suggested_and_all_are_listed() -> None:
    message = refusal("imu.driver=mpu650")
    assert "; did you mean mpu6500 or mpu6050? write one of " in message
    assert {"none", "bno08x_uart", "xsens"} <= set(message.partition("write one of ")[2].split(", "))


def test_the_place_in_a_list_is_reported() -> None:
    assert refusal('camera.intrinsics=[500, 500, "middle", 240]').startswith("[2]: a number (")


def test_keys_in_an_endpoint_are_not_reported() -> None:
    assert refusal('zenoh.listen="tls/rover:7447#connect_private_key_base64=c2VjcmV0"') == (
        ": a list in brackets is needed, not a string"
    )


@pytest.mark.parametrize("key", ["camera.power_line_hz", "camera.width", "camera.fps"])
def test_a_number_of_thousands_of_digits_is_refused_in_a_short_line(key: str, tmp_path: Path) -> None:
    digits = "f" * 9000
    assert len(refusal(f"{key}=0x{digits}")) < 200
    file = tmp_path / "config.toml"
    file.write_text(f"{key} = 0x{digits}\n")
    with pytest.raises(ConfigError, match="not valid TOML: a number of a thousand digits"):
        load(file)


@settings(max_examples=60)
@given(value=st.text() | st.integers() | st.floats(), key=st.sampled_from(("imu.driver", "camera.fps", "zenoh.mode")))
def test_whatever_is_written_is_taken_or_refused_in_one_line(value: str | float, key: str) -> None:
    try:
        load(None, [f"{key}={value}"])
    except ConfigError as error:
        assert str(error).isprintable()  # noqa: PT017
