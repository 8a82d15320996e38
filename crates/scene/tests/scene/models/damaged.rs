//! Files with damaged bytes.

use etendue_scene::import::{Import, Options, Wanted, import};
use etendue_tracer::Paint;
use serde_json::json;

use super::build::square_glb;
use super::ply::{ply_binary, ply_text};
use super::{folder, strict, write};

/// A generator of which every platform gives the same numbers (Marsaglia, *Xorshift RNGs*, 2003).
struct Random(u64);

impl Random {
    fn below(&mut self, n: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        usize::try_from(self.0 % n as u64).unwrap()
    }
}

/// Files with bytes changed, cut, doubled and swapped are read or refused; nothing panics.
/// `ETENDUE_MUTATIONS` asks for more of each than 600.
#[test]
fn damaged_files_never_panic() {
    let folder = folder();
    let quads = square_glb(
        json!({"indices": 1, "material": 0}),
        json!({
            "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
            "textures": [{"source": 0}], "images": [{"bufferView": 0}],
            "cameras": [{"type": "perspective", "perspective": {"yfov": 0.7, "znear": 0.1}}],
            "nodes": [{"children": [1, 2], "matrix": [1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,1]},
                      {"mesh": 0, "scale": [1, 2, 3], "extensions": {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 0}}}},
                      {"camera": 0}]
        }),
        |b| {
            b.u32s(&[0, 1, 2, 1, 3, 2]);
        },
    );
    let obj =
        b"mtllib m.mtl\no a b\nv 0 0 0 1 0 1\nv 1 0 0\nv 1 1.5e1 0\nv 0 1 0\nvt 0 1\nvn 0 0 1\n\
        usemtl x\nf 1/1/1 2/1/1 3/1/1 4/1/1\nf -1//1 -2//1 -3//1\ng c\nusemtl y\nf 1 2 3\nl 1 2\n"
            .to_vec();
    let mtl = b"newmtl x\nKd 0.5 1 2\nmap_Kd -s 1 2 3 a.png\nKs 1\nNs 3\nd 1\nillum 2\nnewmtl y\nKd 1 1 1\n".to_vec();
    let originals = [
        ("a.glb", quads),
        ("a.obj", obj.clone()),
        ("m.mtl", mtl.clone()),
        ("t.ply", ply_text()),
        ("l.ply", ply_binary(false)),
        ("b.ply", ply_binary(true)),
    ];
    write(&folder, "m.mtl", &mtl);
    write(&folder, "base.obj", &obj);
    let mut random = Random(0x9E37_79B9_7F4A_7C15);
    let rounds = std::env::var("ETENDUE_MUTATIONS").map_or(600, |n| n.parse().unwrap());
    let mut outcomes = [0, 0];
    for (name, original) in &originals {
        for _ in 0..rounds {
            let mut bytes = original.clone();
            for _ in 0..=random.below(4) {
                mutate(&mut bytes, &mut random);
            }
            let path = write(&folder, name, &bytes);
            let model = if name.ends_with("mtl") { folder.path().join("base.obj") } else { path };
            for options in [Options::default(), strict()] {
                let outcome = import(&model, Wanted::EVERYTHING, &options);
                outcomes[usize::from(outcome.is_err())] += 1;
                if let Ok(import) = outcome {
                    check_promises(&import);
                }
            }
        }
        write(&folder, "m.mtl", &mtl);
    }
    println!("read {}, refused {}", outcomes[0], outcomes[1]);
    assert!(outcomes.iter().all(|&count| count > 500), "{outcomes:?}");
}

fn mutate(bytes: &mut Vec<u8>, random: &mut Random) {
    if bytes.is_empty() {
        return;
    }
    let at = random.below(bytes.len());
    match random.below(6) {
        0 => bytes.truncate(at),
        1 => bytes[at] ^= 1 << random.below(8),
        2 => bytes[at] = u8::try_from(random.below(256)).unwrap(),
        3 => bytes[at] = b"0123456789-+.eE/\\ \n\"[]{},:#"[random.below(27)],
        4 => {
            let end = (at + 1 + random.below(20)).min(bytes.len());
            let part = bytes[at..end].to_vec();
            bytes.splice(at..at, part);
        }
        _ => {
            let other = random.below(bytes.len());
            bytes.swap(at, other);
        }
    }
}

/// Checks what other crates rely on without looking again.
fn check_promises(import: &Import) {
    for mesh in &import.meshes {
        for &corner in mesh.triangles.iter().flatten() {
            assert!((corner as usize) < mesh.positions.len());
            assert!(mesh.positions.get(corner as usize).is_finite());
        }
        let count = mesh.positions.len();
        assert!(mesh.normals.as_ref().is_none_or(|v| v.len() == count));
        assert!(mesh.colors.as_ref().is_none_or(|v| v.len() == count));
        assert!(mesh.uvs.iter().all(|v| v.len() == count));
    }
    for placement in &import.placements {
        assert!((placement.mesh as usize) < import.meshes.len());
        assert!((placement.material as usize) < import.materials.len());
        assert!(placement.model_from_mesh.is_finite());
    }
    for material in &import.materials {
        if let Paint::Image { image, .. } = &material.base_color {
            assert!((image.texture as usize) < import.textures.len());
        }
    }
}
