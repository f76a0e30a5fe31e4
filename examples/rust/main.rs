//! What will probably be met, with the zenoh crate: https://crates.io/crates/zenoh

mod scene;
use zenoh::Wait;

fn main() -> zenoh::Result<()> {
    let mut config = zenoh::Config::default();
    config.insert_json5("mode", "\"client\"")?;
    config.insert_json5("connect/endpoints", "[\"tcp/127.0.0.1:7447\"]")?;
    let session = zenoh::open(config).wait()?;
    let scenes = session.declare_subscriber("lcf/scene").wait()?;
    while let Ok(sample) = scenes.recv() {
        let Some(scene) = scene::decode(&sample.payload().to_bytes()) else { continue };
        for object in scene.objects.iter().filter(|object| object.probability >= 0.5) {
            println!("{}: class {} at {:.2} rad, contact in {:.1} s", scene.frame_seq, object.class_id, object.bearing[0], object.ttc[0]);
        }
    }
    Ok(())
}
