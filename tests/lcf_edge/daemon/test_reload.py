"""What a reload can change is taken, what it cannot is named."""

from pathlib import Path

import msgspec
import pytest

from lcf_edge.config import Camera, Config, Filter, Imu, Log, Memory, Publish, Vehicle, Zenoh
from lcf_edge.daemon.reload import OTHER_KEYS, PIPELINE_KEYS, changed, merged, signature, wants_pipeline, wants_restart

OLD = Config()


def test_the_same_changes_nothing() -> None:
    assert changed(OLD, Config()) == set()
    assert merged(OLD, Config()) == OLD


@pytest.mark.parametrize(
    "new",
    [
        Config(filter=Filter(tr_s=4.0)),
        Config(vehicle=Vehicle(half_width_m=0.6)),
        Config(memory=Memory(corners=900)),
        Config(camera=Camera(pitch_rad=0.1)),
        Config(imu=Imu(time_offset_s=0.01)),
    ],
)
def test_what_the_pipeline_is_made_of_makes_a_new_one(new: Config) -> None:
    keys = changed(OLD, new)
    assert wants_pipeline(keys) == keys
    assert wants_restart(keys) == set()
    assert merged(OLD, new) == new


@pytest.mark.parametrize("new", [Config(log=Log(level="debug")), Config(memory=Memory(budget_mib=120))])
def test_some_keys_cost_nothing(new: Config) -> None:
    assert wants_pipeline(changed(OLD, new)) == wants_restart(changed(OLD, new)) == set()
    assert merged(OLD, new) == new


@pytest.mark.parametrize(
    ("new", "key"),
    [
        (Config(zenoh=Zenoh(listen=["tcp/127.0.0.1:1"])), "zenoh.listen"),
        (Config(publish=Publish(prefix="other")), "publish.prefix"),
        (Config(camera=Camera(device="/dev/video7")), "camera.device"),
        (Config(imu=Imu(driver="csv")), "imu.driver"),
        (Config(vehicle=Vehicle(speed_source="none")), "vehicle.speed_source"),
    ],
)
def test_devices_and_the_link_want_a_restart(new: Config, key: str) -> None:
    assert wants_restart(changed(OLD, new)) == {key}
    assert merged(OLD, new) == OLD


def test_of_one_table_a_part_may_change() -> None:
    new = Config(camera=Camera(device="/dev/video7", pitch_rad=0.1))
    assert merged(OLD, new) == Config(camera=Camera(pitch_rad=0.1))


def test_the_keys_that_are_named_exist() -> None:
    for tables in (PIPELINE_KEYS, OTHER_KEYS):
        for table, keys in tables.items():
            assert keys <= {field.name for field in msgspec.structs.fields(getattr(OLD, table))}


def test_a_file_that_is_written_or_replaced_is_noticed(tmp_path: Path) -> None:
    file = tmp_path / "config.toml"
    seen = [signature(file)]
    file.write_text("[log]\n")
    seen.append(signature(file))
    other = tmp_path / "new.toml"
    other.write_text("[log]\n")
    other.replace(file)
    seen.append(signature(file))
    assert seen[0] is None
    assert len(set(seen)) == 3
