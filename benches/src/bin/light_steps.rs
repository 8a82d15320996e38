//! What paths take through plain scenes by steps in single precision (`tracer/src/transport/plain.rs`) and by those of
//! all other scenes: the same rays by the same random numbers, in turns, and how far apart their light is.
#![expect(clippy::print_stdout, reason = "what it is for")]
#![expect(clippy::disallowed_methods, reason = "the processor's time stands in a file")]

use std::f64::consts::PI;
use std::sync::Arc;

use etendue_accel::{BuildOptions, Embree, Quality};
use etendue_geometry::glam::{DMat3, DVec3};
use etendue_geometry::{Geometry, HitPrecision, Mesh, Placement, RayBatch, Transform, Vertices};
use etendue_tracer::scattering::GltfSurface;
use etendue_tracer::transport::{Parts, RaySamples};
use etendue_tracer::{
    Emission, Emitters, EnvironmentImage, EnvironmentMap, Light, LightKind, LightingContext,
    Lights, Material, Paint, PlacedSurfaces, PlainScene, Rules, Samples, Scattering, SceneView,
    Scratch, Spectral, Traits, View,
};

/// Rays of a batch, and batches of a scene.
const BATCH: u32 = 1024;
const BATCHES: u32 = 64;

const ROUNDS: usize = 5;

/// Numbers by hashing, alike for both ways.
#[derive(Debug)]
struct Hashed(u32);

impl Hashed {
    fn numbers(&self, ray: u32, pair: u32) -> [u32; 2] {
        let mix = |x: u64| {
            let x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            x ^ (x >> 31)
        };
        let key = (u64::from(self.0 * BATCH + ray) << 32) | u64::from(pair);
        let bits = mix(key.wrapping_add(0x9e37_79b9_7f4a_7c15)).to_le_bytes();
        let [a, b] = [[bits[0], bits[1], bits[2], 0], [bits[4], bits[5], bits[6], 0]];
        [u32::from_le_bytes(a), u32::from_le_bytes(b)]
    }
}

impl Samples for Hashed {
    fn squares_of_pair(&self, rays: &[u32], pair: u32, out: &mut Vec<[f64; 2]>) {
        let number = |bits: u32| f64::from(bits) / 16_777_216.0;
        out.clear();
        out.extend(rays.iter().map(|&ray| self.numbers(ray, pair).map(number)));
    }

    #[expect(clippy::cast_precision_loss, reason = "they have 24 bits")]
    fn floats_of_pair(&self, rays: &[u32], pair: u32, out: &mut [Vec<f32>; 2]) {
        out.iter_mut().for_each(|column| column.resize(rays.len(), 0.0));
        for (i, &ray) in rays.iter().enumerate() {
            let [a, b] = self.numbers(ray, pair).map(|bits| bits as f32 / 16_777_216.0);
            (out[0][i], out[1][i]) = (a, b);
        }
    }
}

/// A scene under construction.
#[derive(Default)]
struct Draft {
    geometry: Geometry,
    materials: Vec<Material>,
    lights: Vec<Light>,
    map: Option<Arc<EnvironmentMap>>,
}

impl Draft {
    fn material(&mut self, color: [f64; 3], scattering: Scattering) -> u32 {
        self.materials.push(Material::new("", Paint::Plain(color), scattering));
        u32::try_from(self.materials.len() - 1).unwrap_or(0)
    }

    fn lamp(&mut self, radiance: [f64; 3]) -> u32 {
        let own = self.material([0.0; 3], Scattering::Black);
        self.materials[own as usize].emission = Some(Emission {
            radiance: Paint::Plain(radiance),
            strength: 1.0,
            illuminant: None,
            two_sided: false,
            group: None,
            modulation: None,
        });
        own
    }

    fn add(&mut self, points: &[[f64; 3]], faces: &[[u32; 3]], material: u32) {
        let mesh = Mesh::from_arrays("", points, faces).expect("a mesh");
        self.place(mesh, material);
    }

    fn place(&mut self, mesh: Mesh, material: u32) {
        let number = u32::try_from(self.geometry.meshes.len()).unwrap_or(0);
        self.geometry.meshes.push(mesh);
        let place = Placement::of(number, Transform::IDENTITY);
        self.geometry.placements.push(Placement { material, ..place });
    }

    fn quad(&mut self, a: [f64; 3], u: [f64; 3], v: [f64; 3], material: u32) {
        let sum = |a: [f64; 3], b: [f64; 3]| [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
        let points = [a, sum(a, u), sum(sum(a, u), v), sum(a, v)];
        self.add(&points, &[[0, 1, 2], [0, 2, 3]], material);
    }

    /// A box by its middle and size, turned about +Y (degrees).
    fn block(&mut self, middle: [f64; 3], size: [f64; 3], turn: f64, material: u32) {
        let (sin, cos) = turn.to_radians().sin_cos();
        let corner = |k: u32| {
            let side = |bit: u32, axis: usize| size[axis] * (f64::from((k >> bit) & 1) - 0.5);
            let [x, y, z] = [side(2, 0), side(1, 1), side(0, 2)];
            [middle[0] + cos * x + sin * z, middle[1] + y, middle[2] - sin * x + cos * z]
        };
        let points: Vec<_> = (0..8).map(corner).collect();
        let quads =
            [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]];
        let faces: Vec<_> = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
        self.add(&points, &faces, material);
    }

    /// A ball of 9000 triangles with normals.
    #[expect(clippy::cast_possible_truncation, reason = "single normals")]
    fn ball(&mut self, middle: DVec3, radius: f64, material: u32) {
        let rows = 48_u32;
        let (mut points, mut normals, mut faces) = (Vec::new(), Vec::new(), Vec::new());
        for row in 0..=rows {
            for column in 0..=2 * rows {
                let [polar, azimuth] = [row, column].map(|k| PI * f64::from(k) / f64::from(rows));
                let (sin, cos) = polar.sin_cos();
                let normal = DVec3::new(sin * azimuth.cos(), cos, sin * azimuth.sin());
                points.push((middle + radius * normal).to_array());
                normals.push(normal.to_array().map(|axis| axis as f32));
                if row < rows && column < 2 * rows {
                    let a = row * (2 * rows + 1) + column;
                    let c = a + 2 * rows + 1;
                    faces.extend([[a, a + 1, c], [a + 1, c + 1, c]]);
                }
            }
        }
        let mut mesh = Mesh::from_arrays("", &points, &faces).expect("a mesh");
        mesh.normals = Some(Vertices::from_arrays(&normals));
        self.place(mesh, material);
    }

    /// The Cornell box of `benches/light_scenes.py`.
    fn room(&mut self) {
        let [white, red, green] = [[0.73; 3], [0.65, 0.05, 0.05], [0.12, 0.45, 0.15]]
            .map(|color| self.material(color, Scattering::Matte));
        self.quad([-1.0, 0.0, -1.0], [0.0, 0.0, 2.0], [2.0, 0.0, 0.0], white);
        self.quad([-1.0, 2.0, -1.0], [2.0, 0.0, 0.0], [0.0, 0.0, 2.0], white);
        self.quad([-1.0, 0.0, -1.0], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0], white);
        self.block([-0.35, 0.6, -0.35], [0.6, 1.2, 0.6], 18.0, white);
        self.block([0.35, 0.3, 0.3], [0.6, 0.6, 0.6], -17.0, white);
        self.quad([-1.0, 0.0, -1.0], [0.0, 2.0, 0.0], [0.0, 0.0, 2.0], red);
        self.quad([1.0, 0.0, -1.0], [0.0, 0.0, 2.0], [0.0, 2.0, 0.0], green);
    }

    fn floor(&mut self) {
        let white = self.material([0.73; 3], Scattering::Matte);
        self.quad([-4.0, 0.0, -4.0], [0.0, 0.0, 8.0], [8.0, 0.0, 0.0], white);
    }

    fn shine(&mut self, kind: LightKind, color: [f64; 3]) {
        self.lights.push(Light::steady(kind, color));
    }

    /// A sky of 512 × 256 texels with a small sun.
    fn sky(&mut self) {
        let texel = |k: usize| match (k % 512, k / 512) {
            (330..334, 64..68) => [2400.0, 2200.0, 1800.0],
            (_, 0..128) => [0.3, 0.4, 0.6],
            _ => [0.15, 0.13, 0.1],
        };
        let texels = (0..512 * 256).map(texel).collect();
        self.map = Some(Arc::new(EnvironmentMap::new([512, 256], texels)));
        let image = EnvironmentImage::File("sky.hdr".into());
        let turn = DMat3::IDENTITY;
        self.shine(LightKind::Environment { image, turn, visible: true }, [1.0; 3]);
    }
}

fn cornell() -> Draft {
    let mut scene = Draft::default();
    scene.room();
    let lamp = scene.lamp([17.0, 12.0, 7.0]);
    scene.quad([-0.25, 1.99, -0.25], [0.5, 0.0, 0.0], [0.0, 0.0, 0.5], lamp);
    scene
}

fn points(count: u32) -> Draft {
    let mut scene = Draft::default();
    scene.room();
    for k in 0..count {
        let n = f64::from(k);
        let (angle, height) = (2.4 * n, 0.1 + 1.8 * (n * 0.618).fract());
        let radius = 0.9 * ((n + 0.5) / f64::from(count)).sqrt();
        let at = DVec3::new(radius * angle.cos(), height, radius * angle.sin());
        scene.shine(LightKind::Point(at), [0.02 + 0.08 * f64::from(k % 3); 3]);
    }
    scene
}

fn lamps() -> Draft {
    let mut scene = Draft::default();
    scene.room();
    let lamp = scene.lamp([20.0, 18.0, 15.0]);
    let (mut corners, mut faces) = (Vec::new(), Vec::new());
    for k in 0..1000_u32 {
        let [x, z] = [f64::from(k % 40) / 39.0, f64::from(k / 40) / 24.0].map(|s| 1.9 * s - 0.95);
        let y = 1.9 - 0.05 * (7.0 * x).sin() * (5.0 * z).cos();
        corners.extend([[x, y, z], [x + 0.02, y, z], [x, y, z + 0.02]]);
        faces.push([3 * k, 3 * k + 1, 3 * k + 2]);
    }
    scene.add(&corners, &faces, lamp);
    scene
}

fn balls(scattering: impl Fn(f64) -> Scattering) -> Draft {
    let mut scene = Draft::default();
    scene.floor();
    for k in 0..5 {
        let n = f64::from(k);
        let color = [0.9, 0.6 + 0.06 * n, 0.3 + 0.12 * n];
        let own = scene.material(color, scattering(0.15 + 0.12 * n));
        scene.ball(DVec3::new(-1.4 + 0.7 * n, 0.33, 0.3 * f64::from(k % 2)), 0.33, own);
    }
    scene.sky();
    scene
}

/// Traces all batches, whose light goes to `sums`; the processor's time that it took (s).
fn traced(
    ctx: &LightingContext<'_>,
    rules: Rules,
    batches: &[RayBatch],
    sums: &mut Vec<f64>,
) -> f64 {
    let (mut scratch, mut out) = (Scratch::default(), Vec::new());
    sums.clear();
    let start = processor_time();
    for (number, rays) in (0..).zip(batches) {
        let samples = Hashed(number);
        let camera = RaySamples { rays, samples: &samples, bands: 0..3, parts: Parts::Whole };
        rules.radiance(ctx, &camera, &mut scratch, &mut out);
        sums.extend_from_slice(&out);
    }
    processor_time() - start
}

/// The processor's time of this thread, as Linux tells it (s).
fn processor_time() -> f64 {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").expect("Linux");
    let nanoseconds = text.split(' ').next().and_then(|number| number.parse().ok());
    nanoseconds.map_or(f64::NAN, |nanoseconds: f64| nanoseconds * 1e-9)
}

fn batches([from, look_at]: [DVec3; 2], fov: f64) -> Vec<RayBatch> {
    let back = (from - look_at).normalize();
    let right = DVec3::Y.cross(back).normalize();
    let up = back.cross(right);
    let half = (0.5 * fov).to_radians().tan();
    let count = f64::from(BATCH * BATCHES);
    let batch = |number: u32| {
        let mut rays = RayBatch::with_capacity(BATCH as usize).with_coherence(true);
        for k in 0..BATCH {
            let n = f64::from(number * BATCH + k);
            let [x, y] = [(n * 0.754_877_666).fract(), n / count].map(|s| half * (2.0 * s - 1.0));
            rays.push(from, (x * right - y * up - back).normalize());
        }
        rays.precision = HitPrecision::Single;
        rays
    };
    (0..BATCHES).map(batch).collect()
}

fn compare(name: &str, scene: Draft, rules: Rules, [from, look_at]: [[f64; 3]; 2], fov: f64) {
    let Draft { geometry, materials, lights, map } = scene;
    let geometry = Arc::new(geometry);
    let options = BuildOptions { robust: true, quality: Quality::High, ..BuildOptions::default() };
    let accel = Embree::build(Arc::clone(&geometry), &options).expect("a structure");
    let spectral = Spectral::of(&etendue_spectrum::Bands::Rgb, &materials);
    let from = DVec3::from_array(from);
    let view = View { origin: from, axes: DMat3::IDENTITY, pixel: None };
    let seen = SceneView { geometry: &geometry, materials: &materials, images: &[], view };
    let lights = Lights::new(&lights, map, (&seen, [0.0; 2]), &spectral).expect("lights");
    let emitters = Emitters::of(&geometry, &materials);
    let placed = PlacedSurfaces::of(&geometry, &materials, &spectral);
    let traits = Traits::of(&geometry, &materials, &placed);
    let plain = PlainScene::of(&accel, &lights, (&placed, traits), &spectral);
    let plain = plain.expect("a plain scene");
    let old = LightingContext {
        accel: &accel,
        scene: seen,
        lights: &lights,
        spectral: &spectral,
        traits,
        emitters: emitters.as_ref(),
        placed: &placed,
        precision: HitPrecision::Single,
        plain: None,
    };
    let new = LightingContext { plain: Some(&plain), ..old };
    let batches = batches([from, DVec3::from_array(look_at)], fov);
    let mut sums = [Vec::new(), Vec::new()];
    let mut times = [Vec::new(), Vec::new()];
    for _ in 0..ROUNDS {
        for (k, ctx) in [&old, &new].into_iter().enumerate() {
            times[k].push(traced(ctx, rules, &batches, &mut sums[k]));
        }
    }
    let [old, new] = times.map(|mut times| {
        times.sort_by(f64::total_cmp);
        times[ROUNDS / 2]
    });
    let [a, b] = &sums;
    let differ = a.iter().zip(b).filter(|(a, b)| (*a - *b).abs() > 1e-3 * (1e-3 + a.abs())).count();
    let means = [a, b].map(|sums| sums.iter().sum::<f64>() / sums.len() as f64);
    println!(
        "{name}: {old:.3} s, {new:.3} s, {:.2} times as fast; {:.3}% of samples differ; means {:.6} {:.6}",
        old / new,
        100.0 * differ as f64 / a.len() as f64,
        means[0],
        means[1]
    );
}

fn main() {
    let indoors = [[0.0, 1.0, 4.4], [0.0, 1.0, 0.0]];
    let outdoors = [[0.0, 1.6, 4.2], [0.0, 0.5, 0.0]];
    let direct = Rules::direct();
    compare("Cornell box, direct", cornell(), direct, indoors, 32.0);
    compare("Cornell box, five bounces", cornell(), Rules::path(5), indoors, 32.0);
    compare("a point, direct", points(1), direct, indoors, 32.0);
    compare("100 points, direct", points(100), direct, indoors, 32.0);
    compare("1000 lamps, direct", lamps(), direct, indoors, 32.0);
    compare("1000 lamps, five bounces", lamps(), Rules::path(5), indoors, 32.0);
    let matte = balls(|_| Scattering::Matte);
    compare("matte balls under a sky, five bounces", matte, Rules::path(5), outdoors, 40.0);
    let metal = balls(|roughness| Scattering::Metal { roughness, named: None });
    compare("metal balls under a sky, five bounces", metal, Rules::path(5), outdoors, 40.0);
    let gltf = balls(|roughness| {
        let surface = GltfSurface { metallic: 0.2, roughness, ..GltfSurface::default() };
        Scattering::Gltf(Box::new(surface))
    });
    compare("glTF balls under a sky, five bounces", gltf, Rules::path(5), outdoors, 40.0);
    let mut lit = balls(|_| Scattering::Matte);
    (lit.lights, lit.map) = (Vec::new(), None);
    let image = EnvironmentImage::Constant;
    lit.shine(
        LightKind::Environment { image, turn: DMat3::IDENTITY, visible: true },
        [0.4, 0.5, 0.7],
    );
    compare("matte balls under an even sky", lit, Rules::path(5), outdoors, 40.0);
}
