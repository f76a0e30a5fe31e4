//! Scenes as lcf-edge sends them. Needs no crate.

pub struct Circle {
    pub id: u32, pub kind: u8, pub cause: u8, pub support: u16,
    /// x, y, radius (px), direction (rad), speed (px/s), trust
    pub image: [f32; 6],
    /// ttc (s), bearing, elevation (rad), range, lateral (m)
    pub world: [f32; 5],
}

pub struct PsiRegion {
    pub id: u32, pub shape: u8,
    /// x, y, width, height (px), trust
    pub image: [f32; 5],
}

/// A figure and its standard deviation.
pub type Measured = [f32; 2];

pub struct Object {
    pub id: u32, pub class_id: u8, pub state: u8, pub support: u16,
    /// x, y, width, height (px)
    pub image: [f32; 4],
    /// s, rad, m
    pub ttc: Measured, pub bearing: Measured, pub elevation: Measured, pub range: Measured, pub lateral: Measured,
    /// m/s, s
    pub v_forward: Measured, pub v_right: Measured, pub closest: Measured,
    pub probability: f32, pub trust: f32, pub age: f32, pub unseen: f32,
}

pub struct Scene {
    pub stamp_ns: i64, pub frame_seq: u64, pub image_width: u32, pub image_height: u32, pub vehicle_speed: f32,
    pub circles: Vec<Circle>, pub psi: Vec<PsiRegion>, pub objects: Vec<Object>,
}

/// Of CDR: every field is aligned to its size.
struct Reader<'a> { data: &'a [u8], at: usize }

impl Reader<'_> {
    fn bytes<const N: usize>(&mut self) -> Option<[u8; N]> {
        let start = self.at.next_multiple_of(N);
        self.at = start + N;
        self.data.get(start..self.at)?.try_into().ok()
    }
    fn u32(&mut self) -> Option<u32> { self.bytes().map(u32::from_le_bytes) }
    fn f32(&mut self) -> Option<f32> { self.bytes().map(f32::from_le_bytes) }
    fn floats<const N: usize>(&mut self) -> Option<[f32; N]> {
        let mut values = [0.0; N];
        for value in &mut values { *value = self.f32()?; }
        Some(values)
    }
    fn circle(&mut self) -> Option<Circle> {
        Some(Circle {
            id: self.u32()?, kind: self.bytes::<1>()?[0], cause: self.bytes::<1>()?[0],
            support: self.bytes().map(u16::from_le_bytes)?, image: self.floats()?, world: self.floats()?,
        })
    }
    fn region(&mut self) -> Option<PsiRegion> {
        Some(PsiRegion { id: self.u32()?, shape: self.bytes::<1>()?[0], image: self.floats()? })
    }
    fn object(&mut self) -> Option<Object> {
        Some(Object {
            id: self.u32()?, class_id: self.bytes::<1>()?[0], state: self.bytes::<1>()?[0],
            support: self.bytes().map(u16::from_le_bytes)?, image: self.floats()?,
            ttc: self.floats()?, bearing: self.floats()?, elevation: self.floats()?, range: self.floats()?,
            lateral: self.floats()?, v_forward: self.floats()?, v_right: self.floats()?, closest: self.floats()?,
            probability: self.f32()?, trust: self.f32()?, age: self.f32()?, unseen: self.f32()?,
        })
    }
}

/// None: the payload is no scene.
pub fn decode(payload: &[u8]) -> Option<Scene> {
    let mut cdr = Reader { data: payload.strip_prefix(&[0, 1])?.get(2..)?, at: 0 };
    let sec = cdr.bytes().map(i32::from_le_bytes)?;
    let nanosec = cdr.u32()?;
    cdr.at += cdr.u32()? as usize; // frame_id
    let mut scene = Scene {
        stamp_ns: i64::from(sec) * 1_000_000_000 + i64::from(nanosec),
        frame_seq: cdr.bytes().map(u64::from_le_bytes)?,
        image_width: cdr.u32()?, image_height: cdr.u32()?, vehicle_speed: cdr.f32()?,
        circles: Vec::new(), psi: Vec::new(), objects: Vec::new(),
    };
    for _ in 0..cdr.u32()? { scene.circles.push(cdr.circle()?); }
    for _ in 0..cdr.u32()? { scene.psi.push(cdr.region()?); }
    if cdr.at < cdr.data.len() { // payloads of older versions end here
        for _ in 0..cdr.u32()? { scene.objects.push(cdr.object()?); }
    }
    Some(scene)
}
