// Scenes as lcf-edge sends them, for little-endian computers. C++17.
#pragma once
#include <cstdint>
#include <cstring>
#include <stdexcept>
#include <vector>

struct Circle {
  uint32_t id; uint8_t kind, cause; uint16_t support;
  float x, y, radius, direction, speed, trust, ttc, bearing, elevation, range, lateral;
};
struct PsiRegion { uint32_t id; uint8_t shape; float x, y, width, height, trust; };
struct Object {
  uint32_t id; uint8_t class_id, state; uint16_t support;
  float x, y, width, height, ttc, ttc_sigma, bearing, bearing_sigma, elevation, elevation_sigma, range, range_sigma;
  float lateral, lateral_sigma, v_forward, v_forward_sigma, v_right, v_right_sigma, closest, closest_sigma;
  float probability, trust, age, unseen;
};
static_assert(sizeof(Circle) == 52 && sizeof(PsiRegion) == 28 && sizeof(Object) == 104);

struct Scene {
  int64_t stamp_ns; uint64_t frame_seq; uint32_t image_width, image_height; float vehicle_speed;
  std::vector<Circle> circles; std::vector<PsiRegion> psi; std::vector<Object> objects;
};

class Reader {  // of CDR: every field is aligned to its size
 public:
  Reader(const std::vector<uint8_t>& payload) : data_(payload.data() + 4), size_(payload.size() - 4) {
    if (payload.size() < 4 || payload[1] != 1) throw std::runtime_error("not little-endian CDR");
  }
  const uint8_t* take(uint64_t size, uint64_t align) {
    const uint64_t start = (at_ + align - 1) / align * align;
    if (start > size_ || size > size_ - start) throw std::runtime_error("cut short");
    at_ = start + size;
    return data_ + start;
  }
  template <class T> T get() { T value; std::memcpy(&value, take(sizeof(T), sizeof(T)), sizeof(T)); return value; }
  template <class T> std::vector<T> sequence() {
    const uint64_t count = get<uint32_t>();
    const uint8_t* start = take(count * sizeof(T), alignof(T));
    std::vector<T> rows(count);
    if (count) std::memcpy(rows.data(), start, count * sizeof(T));
    return rows;
  }
  bool ended() const { return at_ == size_; }
 private:
  const uint8_t* data_; uint64_t size_; uint64_t at_ = 0;
};

inline Scene decode(const std::vector<uint8_t>& payload) {
  Reader in(payload);
  Scene scene;
  scene.stamp_ns = in.get<int32_t>() * INT64_C(1000000000);
  scene.stamp_ns += in.get<uint32_t>();
  in.take(in.get<uint32_t>(), 1);  // frame_id
  scene.frame_seq = in.get<uint64_t>();
  scene.image_width = in.get<uint32_t>();
  scene.image_height = in.get<uint32_t>();
  scene.vehicle_speed = in.get<float>();
  scene.circles = in.sequence<Circle>();
  scene.psi = in.sequence<PsiRegion>();
  if (!in.ended()) scene.objects = in.sequence<Object>();  // payloads of older versions end here
  return scene;
}
