//! Imports a model as a render of geometry alone does, three times, and prints what that took;
//! `blob:10000000` makes one instead, `tobj:model.obj` reads an OBJ file with crate `tobj`.
//!
//! ```sh
//! cargo run --release -p etendue-scene --example import -- model.glb
//! ```

use std::error::Error;
use std::path::Path;
use std::time::Instant;

use etendue_geometry::units::Metres;
use etendue_scene::import::{Options, Wanted, import};
use etendue_scene::shape::ShapeSpec;

fn main() -> Result<(), Box<dyn Error>> {
    let argument = std::env::args().nth(1).ok_or("usage: import MODEL|blob:TRIANGLES|tobj:OBJ")?;
    if let Some(triangles) = argument.strip_prefix("blob:") {
        return make_blob(triangles.parse()?);
    }
    if let Some(path) = argument.strip_prefix("tobj:") {
        return read_with_tobj(Path::new(path));
    }
    for _ in 0..3 {
        let start = Instant::now();
        let model = import(Path::new(&argument), Wanted::NOTHING, &Options::default())?;
        let seconds = start.elapsed().as_secs_f64();
        let triangles: usize = model.meshes.iter().map(|mesh| mesh.triangles.len()).sum();
        println!("{seconds:.3} s, {} meshes, {triangles} triangles", model.meshes.len());
        println!("    {:?}", model.stats);
        for note in &model.notes {
            println!("    {}: {} ({}x)", note.subject, note.message, note.count);
        }
    }
    Ok(())
}

fn make_blob(triangles: u64) -> Result<(), Box<dyn Error>> {
    let shape = ShapeSpec::Blob { radius: Metres(1.0), triangles, seed: 7, amplitude: 0.25 };
    let smooth = Wanted { normals: true, ..Wanted::NOTHING };
    for (what, wanted) in [("positions", Wanted::NOTHING), ("and normals", smooth)] {
        for _ in 0..2 {
            let start = Instant::now();
            let mesh = shape.build(wanted)?;
            let seconds = start.elapsed().as_secs_f64();
            println!("{seconds:.3} s, {} triangles, {what}", mesh.triangles.len());
        }
    }
    Ok(())
}

fn read_with_tobj(path: &Path) -> Result<(), Box<dyn Error>> {
    for _ in 0..2 {
        let start = Instant::now();
        let options = tobj::LoadOptions { triangulate: true, ..Default::default() };
        let (models, _) = tobj::load_obj(path, &options)?;
        let seconds = start.elapsed().as_secs_f64();
        let triangles: usize = models.iter().map(|model| model.mesh.indices.len() / 3).sum();
        println!("{seconds:.3} s, {triangles} triangles, by tobj");
    }
    Ok(())
}
