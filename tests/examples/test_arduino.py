"""The sketch for an Arduino sends lines that the driver reads; run on this computer, with a model of board and chip."""

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from drivers.imu.csv_line import CsvParser

SKETCH = Path(__file__).parents[2] / "examples/arduino_imu/arduino_imu.ino"

ARDUINO_H = """
#pragma once
#include <cstdint>
#include <cstdio>
#include <string>
constexpr double PI = 3.14159265358979;
struct String : std::string {
  String(uint32_t value) : std::string(std::to_string(value)) {}
  String(double value, int digits) : std::string(64, 0) { resize(snprintf(&(*this)[0], 64, "%.*f", digits, value)); }
};
inline uint32_t micros() { static uint32_t now = 4294900000u; return now += 20; }  // wraps soon
struct { void begin(long) {} void print(const std::string& text) { fputs(text.c_str(), stdout); } } Serial;
"""

WIRE_H = """
#pragma once
#include <cstdint>
struct {
  uint8_t registers[128] = {0x12, 0x34};
  uint8_t at = 0;
  bool naming = false;
  void begin() {}
  void setClock(long) {}
  void beginTransmission(uint8_t) { naming = true; }
  void write(uint8_t value) { if (naming) at = value; else registers[at] = value; naming = false; }
  void endTransmission(bool = true) {}
  void requestFrom(uint8_t, uint8_t) {}
  int read() { return registers[at++]; }
} Wire;
"""

MAIN = """
#include "arduino_imu.ino"
int main() {
  setup();
  const int16_t values[7] = {1000, -2000, 8192, 0, 100, -200, 32767};  // ax ay az temperature gx gy gz
  for (int i = 0; i < 7; i++) {
    Wire.registers[0x3B + 2 * i] = static_cast<uint16_t>(values[i]) >> 8;
    Wire.registers[0x3C + 2 * i] = values[i] & 255;
  }
  for (int i = 0; i < 40; i++) loop();
  const uint8_t* set = Wire.registers;
  return !(set[0x6B] == 1 && set[0x1A] == 3 && set[0x1B] == 8 && set[0x1C] == 8);
}
"""


@pytest.mark.skipif(shutil.which("g++") is None, reason="no g++ here")
def test_its_lines_are_read(tmp_path: Path) -> None:
    for name, text in (("Arduino.h", ARDUINO_H), ("Wire.h", WIRE_H), ("main.cpp", MAIN)):
        (tmp_path / name).write_text(text)
    shutil.copy(SKETCH, tmp_path)
    subprocess.run(("g++", "-std=c++17", "-I.", "-o", "board", "main.cpp"), cwd=tmp_path, check=True, timeout=120)
    sent = subprocess.run((tmp_path / "board",), check=True, capture_output=True).stdout
    parser = CsvParser()
    readings = parser.feed(b"\n" + sent)
    assert len(readings) == 40
    assert not parser.counts
    radps, mps2 = np.radians(500) / 32768, 4 * 9.80665 / 32768
    for reading in readings:
        assert reading.gyro == pytest.approx(np.array([100, -200, 32767]) * radps, abs=1e-5)
        assert reading.accel == pytest.approx(np.array([1000, -2000, 8192]) * mps2, abs=1e-4)
        assert reading.saturated
    assert np.diff([reading.ticks for reading in readings]).astype(np.int64) % 2**32 == pytest.approx(5000, abs=40)
