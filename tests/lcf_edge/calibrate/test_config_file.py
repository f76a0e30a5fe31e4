"""What was found goes into the configuration file, and nothing else of it changes."""

import os
import tomllib
from pathlib import Path

import pytest

from lcf_edge.calibrate.config_file import as_toml, check_writable, write
from lcf_edge.config import load
from lcf_edge.errors import ConfigError

FILE = """# my rover
[camera]
device = "/dev/video2"  # the front one
pitch_rad = 0.5   # measured with a ruler

[vehicle]
half_width_m = 0.4
"""


def test_comments_and_other_keys_stay(tmp_path: Path) -> None:
    path = tmp_path / "rover.toml"
    path.write_text(FILE, encoding="utf-8")
    write(path, "camera", {"pitch_rad": -0.0175, "yaw_rad": 0.004})
    write(path, "imu", {"axes": [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]})
    text = path.read_text(encoding="utf-8")
    kept = [line for line in FILE.splitlines() if line and "pitch_rad" not in line]
    assert [line for line in text.splitlines() if line in kept] == kept
    assert "pitch_rad = -0.0175   # measured with a ruler" in text
    config = load(path)
    assert (config.camera.pitch_rad, config.camera.yaw_rad, config.vehicle.half_width_m) == (-0.0175, 0.004, 0.4)
    assert config.imu.axes[0] == [1.0, 0.0, 0.0]


def test_a_link_stays_one_and_the_mode_stays(tmp_path: Path) -> None:
    path, link = tmp_path / "rover.toml", tmp_path / "config.toml"
    path.write_text(FILE, encoding="utf-8")
    path.chmod(0o640)
    link.symlink_to(path)
    write(link, "camera", {"pitch_rad": 0.1})
    assert link.is_symlink()
    assert path.stat().st_mode & 0o777 == 0o640
    assert load(path).camera.pitch_rad == 0.1
    assert sorted(file.name for file in tmp_path.iterdir()) == ["config.toml", "rover.toml"]


@pytest.mark.skipif(os.geteuid() != 0, reason="only root may write for others")
def test_the_owner_stays(tmp_path: Path) -> None:
    path = tmp_path / "rover.toml"
    path.write_text(FILE, encoding="utf-8")
    path.chmod(0o640)
    os.chown(path, 1234, 4321)
    write(path, "camera", {"pitch_rad": 0.1})
    assert (path.stat().st_uid, path.stat().st_gid, path.stat().st_mode & 0o777) == (1234, 4321, 0o640)


def test_what_would_not_be_valid_changes_nothing(tmp_path: Path) -> None:
    path = tmp_path / "rover.toml"
    path.write_text(FILE, encoding="utf-8")
    with pytest.raises(ConfigError, match=r"rover.toml: left as it was, it would not be valid: camera.distortion"):
        write(path, "camera", {"distortion_model": "equidistant", "distortion": [0.1]})
    assert path.read_text(encoding="utf-8") == FILE
    assert [file.name for file in tmp_path.iterdir()] == ["rover.toml"]


def test_a_file_that_is_none_is_refused_before_work_begins(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"rover.toml: no such file; name yours with -c"):
        check_writable(tmp_path / "rover.toml")
    broken = tmp_path / "broken.toml"
    broken.write_text("[camera", encoding="utf-8")
    with pytest.raises(ConfigError, match="not valid TOML"):
        write(broken, "camera", {"pitch_rad": 0.1})


def test_the_lines_are_toml() -> None:
    values = {"axes": [[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]], "gyro_noise_radps": 0.0052}
    assert tomllib.loads(as_toml("imu", values)) == {"imu": values}
