"""BMI270: the vendor's configuration file, and the gyro's lean."""

import re
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from drivers.errors import DeviceLostError
from drivers.imu.bmi270 import FirmwareError
from hil_mocks.i2c.bmi import Bmi270

RigMaker = Callable[..., Any]


def test_a_missing_file_is_reported(rig: RigMaker, tmp_path: Path) -> None:
    bench = rig("bmi270")
    bench.firmware = tmp_path / "nothing.fw"
    with pytest.raises(FirmwareError) as raised:
        bench.open()
    assert str(raised.value) == (
        f"{tmp_path}/nothing.fw: cannot be read (No such file or directory);"
        " put Bosch's bmi270-init-data.fw there (see docs/imus.md) or set imu.firmware"
    )
    assert not raised.value.retry
    assert bench.wire.closed


def test_the_documents_recipe_makes_the_file_of_boschs_source(rig: RigMaker, tmp_path: Path) -> None:
    document = (Path(__file__).parents[3] / "docs/imus.md").read_text(encoding="utf-8")
    (recipe,) = re.findall(r"^```bash\n(.*?bmi270.*?)^```$", document, re.M | re.S)
    rows = [", ".join(f"0x{byte:02x}" for byte in Bmi270.firmware[at : at + 14]) for at in range(0, 8192, 14)]
    (tmp_path / "bmi270.c").write_text(
        "#define BMI270_CHIP_ID 0x24\n"
        "/*! @name  Global array that stores the configuration file of BMI270 */\n"
        "const uint8_t bmi270_config_file[] = {\n    " + ",\n    ".join(rows) + "\n};\n\n"
        "const struct bmi2_feature_config bmi270_feat_in[] = { { .page = 0x01, .start_addr = 0x0C } };\n"
    )
    said = subprocess.run(["bash", "-ec", recipe], cwd=tmp_path, check=True, capture_output=True, text=True).stdout
    assert said.startswith("8192 ")
    bench = rig("bmi270")
    bench.firmware = tmp_path / "bmi270-init-data.fw"
    assert bench.read_for(0.2)


@pytest.mark.parametrize("size", [0, 8191, 8193, 100_000])
def test_a_file_of_another_size_is_reported(rig: RigMaker, tmp_path: Path, size: int) -> None:
    bench = rig("bmi270")
    bench.firmware = tmp_path / "other.fw"
    bench.firmware.write_bytes(bytes(size))
    with pytest.raises(FirmwareError, match=r"other\.fw: not the 8192 bytes that a BMI270 needs"):
        bench.open()


def test_a_file_that_the_chip_refuses_is_reported(rig: RigMaker, tmp_path: Path) -> None:
    bench = rig("bmi270")
    bench.firmware = tmp_path / "other.fw"
    bench.firmware.write_bytes(Bmi270.firmware[::-1])
    with pytest.raises(DeviceLostError, match=r"refuses the configuration file \(status 2\); is .* for a BMI270\?"):
        bench.open()


@pytest.mark.parametrize("lean", [-64, -20, 0, 63])
def test_the_gyros_lean_is_taken_out(rig: RigMaker, lean: int) -> None:
    bench = rig("bmi270", motion=lambda _: ((0.2, 0.1, 1.5), (0.0, 0.0, 9.8)))
    bench.chip.lean = lean
    samples = bench.read_for(0.2)
    assert samples[-1].gyro == pytest.approx((0.2, 0.1, 1.5), abs=6e-4)


@pytest.mark.parametrize(
    "frame",
    [bytes.fromhex("027f00800080 010002000300"), bytes.fromhex("010002000300 017f00800080")],
    ids=["gyro", "accelerometer"],
)
def test_a_frame_in_which_a_sensor_has_no_data_is_no_sample(rig: RigMaker, frame: bytes) -> None:
    bench = rig("bmi270")
    bench.read_for(0.5)
    bench.chip._fifo.append(frame)
    samples = bench.read_for(0.1)
    assert bench.device.counts["no_data"] == 1
    assert not any(sample.saturated for sample in samples)
    for sample in samples:
        assert sample.gyro == pytest.approx(bench.true(sample)[0], abs=0.01)
