// An MPU-6050 over I2C, 200 lines a second. Replace readImu() by your sensor's library.
#include <Arduino.h>
#include <Wire.h>

const uint8_t MPU = 0x68;
const float RADPS = 500.0 / 32768 * PI / 180;  // range of 500 deg/s
const float MPS2 = 4 * 9.80665 / 32768;        // range of 4 g

void writeRegister(uint8_t address, uint8_t value) {
  Wire.beginTransmission(MPU);
  Wire.write(address);
  Wire.write(value);
  Wire.endTransmission();
}

void readImu(int16_t values[7]) {  // ax ay az temperature gx gy gz
  Wire.beginTransmission(MPU);
  Wire.write(0x3B);
  Wire.endTransmission(false);
  Wire.requestFrom(MPU, (uint8_t)14);
  for (int i = 0; i < 7; i++) {
    values[i] = Wire.read() << 8;
    values[i] |= Wire.read();
  }
}

void setup() {
  Serial.begin(230400);
  Wire.begin();
  Wire.setClock(400000);
  writeRegister(0x6B, 0x01);  // wake up, clock of the gyro
  writeRegister(0x1A, 0x03);  // 44 Hz low pass
  writeRegister(0x1B, 0x08);  // 500 deg/s
  writeRegister(0x1C, 0x08);  // 4 g
}

void loop() {
  static uint32_t next = micros();
  while ((int32_t)(micros() - next) < 0) {}
  next += 5000;

  uint32_t time = micros();
  int16_t raw[7];
  readImu(raw);
  bool clipped = false;
  for (int i = 0; i < 7; i++) clipped |= i != 3 && (raw[i] == 32767 || raw[i] == -32768);

  String line = String(time);
  for (int i = 4; i < 7; i++) line += "," + String(raw[i] * RADPS, 5);
  for (int i = 0; i < 3; i++) line += "," + String(raw[i] * MPS2, 4);
  line += clipped ? ",1" : ",0";

  uint8_t checksum = 0;
  for (unsigned i = 0; i < line.length(); i++) checksum ^= line[i];
  char end[6];
  snprintf(end, sizeof end, "*%02X\n", checksum);
  Serial.print(line + end);
}
