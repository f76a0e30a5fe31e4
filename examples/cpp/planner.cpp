// What will probably be met, with zenoh-cpp over zenoh-c: https://github.com/eclipse-zenoh/zenoh-cpp
#include <cstdio>
#include <zenoh.hxx>
#include "scene.hpp"

int main() {
  auto config = zenoh::Config::create_default();
  config.insert_json5("mode", "\"client\"");
  config.insert_json5("connect/endpoints", "[\"tcp/127.0.0.1:7447\"]");
  auto session = zenoh::Session::open(std::move(config));
  auto scenes = session.declare_subscriber(zenoh::KeyExpr("lcf/scene"), zenoh::channels::RingChannel(4));
  for (auto next = scenes.handler().recv(); std::holds_alternative<zenoh::Sample>(next); next = scenes.handler().recv()) {
    const Scene scene = decode(std::get<zenoh::Sample>(next).get_payload().as_vector());
    for (const Object& object : scene.objects)
      if (object.probability >= 0.5f)
        std::printf("%lu: class %u at %.2f rad, contact in %.1f s\n", static_cast<unsigned long>(scene.frame_seq), object.class_id, object.bearing, object.ttc);
  }
}
