//! The whole render loop on `scenes/first-light.json`: camera rays, traversal, f64, layers onto the
//! film, against the bare loop over the same rays.

use std::path::Path;
use std::sync::Arc;

use etendue_accel::limit::{BareScene, Mode, RayHit16};
use etendue_accel::{Accel, BuildOptions};
use etendue_bench::timing::{Turn, take_turns, wall};
use etendue_benches::effort::Effort;
use etendue_camera::{Camera, PixelBlock};
use etendue_geometry::{
    Buffer, Geometry, Mesh, Placement, Positions, RayBatch, Transform, Vertices,
};
use etendue_render::output::Outputs;
use etendue_render::{Images, Plan, plan};
use etendue_scene::{LoadOptions, Scene, SceneFile, Setting};
use rayon::ThreadPool;
use rayon::prelude::*;

use crate::findings::{Contest, Findings, Part, Record};

/// The contest's name, in place of a mesh's.
pub(crate) const SCENE: &str = "first-light";

/// Title of the comparison.
pub(crate) const QUESTION: &str = "bare loop and render loop";

/// Name of what is rendered, as the page shows it.
pub(crate) const LIMIT: &str = "limit, packets";
pub(crate) const DATA: &str = "depth and normal";
pub(crate) const PICTURE: &str = "depth, normal and the facing picture";

/// Packets that one task of the bare loop traces: four tiles' worth.
const PACKETS: usize = 64;

/// Name of a contestant on so many threads.
pub(crate) fn title(who: &str, threads: usize) -> String {
    match threads {
        1 => format!("{who}, 1 thread"),
        _ => format!("{who}, {threads} threads"),
    }
}

pub(crate) fn measure(effort: Effort, findings: &mut Findings) -> anyhow::Result<()> {
    eprintln!("{SCENE}, the render loop");
    let data = Prepared::load(&[("tracer", "null")])?;
    let picture = Prepared::load(&[])?;
    let mode = Mode { quality: data.plan.quality, compact: false };
    let bare = BareScene::build(baked(&data.scene.geometry), mode, 0)?;
    let packets = RayHit16::of(&tiles(&data.scene.camera));
    let pool = |threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    let pools = [(1, pool(1)?), (2, pool(2)?)];
    let mut titles = Vec::new();
    let mut turns: Vec<Turn<'_>> = Vec::new();
    for (threads, pool) in &pools {
        titles.push(title(LIMIT, *threads));
        turns.push(Box::new(|| trace_bare(pool, &bare, &packets)));
        for (who, prepared) in [(DATA, &data), (PICTURE, &picture)] {
            titles.push(title(who, *threads));
            turns.push(Box::new(move || prepared.render(pool)));
        }
    }
    let series = take_turns(effort.rounds(), &mut turns);
    drop(turns);
    let records =
        titles.into_iter().zip(series).map(|(who, series)| Record { who, series, bytes: None });
    findings.contests.push(Contest {
        part: Part::FirstLight,
        mesh: SCENE.to_owned(),
        question: QUESTION.to_owned(),
        items: (packets.len() * 16) as f64,
        records: records.collect(),
    });
    Ok(())
}

/// A scene ready to render.
struct Prepared {
    scene: Scene,
    plan: Plan,
    accel: Box<dyn Accel>,
    images: Images,
}

impl Prepared {
    fn load(overrides: &[(&str, &str)]) -> anyhow::Result<Self> {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes/first-light.json");
        let overrides: Vec<Setting> =
            overrides.iter().map(|&(path, value)| Setting::new(path, value)).collect();
        let file = SceneFile::read(&path, &overrides)?;
        let scene = file.load(plan::wanted(&file.spec.all_layers()), &LoadOptions::default())?;
        let plan = Plan::new(&scene, Outputs { exr: true, ..Outputs::NONE });
        let accel = etendue_render::build(&scene, &plan, &BuildOptions::default())?;
        let images = Images::decode(&scene, &plan, None)?;
        Ok(Self { scene, plan, accel, images })
    }

    /// Seconds of a render without files.
    fn render(&self, pool: &ThreadPool) -> f64 {
        let Self { scene, plan, accel, images } = self;
        let (seconds, rendered) = wall(|| {
            pool.install(|| {
                etendue_render::render(scene, plan, &**accel, images, Vec::new(), &|_: f64| true)
            })
        });
        // A render that failed has to be seen.
        rendered.map_or(f64::NAN, |_| seconds)
    }
}

fn trace_bare(pool: &ThreadPool, scene: &BareScene, packets: &[RayHit16]) -> f64 {
    let mut records = packets.to_vec();
    let (seconds, ()) = wall(|| {
        pool.install(|| {
            records.par_chunks_mut(PACKETS).for_each(|chunk| scene.closest_packets(chunk));
        });
    });
    std::hint::black_box(&records);
    seconds
}

/// The chief rays of all pixels in blocks of 4 × 4, a packet's worth each.
fn tiles(camera: &Camera) -> Vec<RayBatch> {
    let [width, height] = camera.resolution();
    let blocks = (0..height).step_by(4).flat_map(|y| (0..width).step_by(4).map(move |x| (x, y)));
    blocks
        .map(|(x, y)| {
            let block = PixelBlock { x, y, width: 4.min(width - x), height: 4.min(height - y) };
            let mut rays = RayBatch::default();
            camera.chief_rays(block, &mut rays);
            rays
        })
        .collect()
}

/// The same triangles in world space, which is where the bare loop takes meshes to be.
fn baked(geometry: &Geometry) -> Arc<Geometry> {
    let mut baked = Geometry::default();
    for (index, placement) in (0..).zip(&geometry.placements) {
        let mesh = geometry.mesh_of(placement);
        let corners: Vec<[f32; 3]> = (0..mesh.positions.len())
            .map(|i| placement.world_from_mesh.point(mesh.positions.get(i)).as_vec3().to_array())
            .collect();
        let positions = Positions::F32(Vertices::from_arrays(&corners));
        let triangles = Buffer::from(mesh.triangles.to_vec());
        baked.meshes.push(Mesh::new(mesh.name.clone(), positions, triangles));
        baked.placements.push(Placement {
            mesh: index,
            world_from_mesh: Transform::IDENTITY,
            ..placement.clone()
        });
    }
    Arc::new(baked)
}
