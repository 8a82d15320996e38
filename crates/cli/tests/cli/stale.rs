//! Renders of one kind into the folder of another: nothing of ours is left that is stale.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use serde_json::{Value, json};

use crate::run::{Bench, text};

/// Kinds of output that a render can leave.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Picture,
    Frames,
    FramesByLayer,
    LightField,
    FocusedLightField,
    ReferenceViews,
    Exposures,
    Merged,
}

use Kind::{
    Exposures, FocusedLightField, Frames, FramesByLayer, LightField, Merged, Picture,
    ReferenceViews,
};

const KINDS: [Kind; 8] = [
    Picture,
    Frames,
    FramesByLayer,
    LightField,
    FocusedLightField,
    ReferenceViews,
    Exposures,
    Merged,
];

/// Files of the user's among those of a render.
const MINE: [&str; 4] = ["mine.txt", "frames/mine.txt", "views/mine.txt", "frames/000000/mine.txt"];

impl Kind {
    fn scene(self) -> Value {
        let sensor = json!({"resolution": [8, 6]});
        let light_field = |kind: &str| {
            json!({
                "type": kind, "focal_length": 20, "f_number": 4, "focus_distance": 0.5, "views": 2,
                "microlenses": {"pitch": 0.1}, "sensor": {"resolution": [60, 45], "pixel_pitch": 8}
            })
        };
        let mut camera = match self {
            Picture | Frames | FramesByLayer | Merged => {
                json!({"type": "pinhole", "sensor": sensor})
            }
            LightField => light_field("light_field"),
            FocusedLightField => {
                let mut camera = light_field("light_field");
                camera["microlenses"]["picture_distance"] = json!(2);
                camera.as_object_mut().unwrap().remove("views");
                camera
            }
            ReferenceViews => light_field("light_field_reference"),
            Exposures => json!({"type": "pinhole", "sensor":
                {"type": "raw", "resolution": [8, 6], "frames": 3, "moments": true}}),
        };
        camera["pose"] = json!({"from": [0, 0, 0.5], "look_at": [0, 0, 0]});
        let mut scene = json!({
            "etendue": 1, "tracer": {"type": "facing"}, "layers": ["depth"], "camera": camera,
            "render": {"samples": 1, "accel": "bvh"},
            "objects": [{"shape": "sphere", "radius": 0.03}]
        });
        if matches!(self, Frames | FramesByLayer) {
            scene["frames"] = json!([{}, {"camera.pose.from": [0, 0.1, 0.5]}]);
        }
        scene
    }

    fn render(self, bench: &Bench, out: &str) {
        bench.write("scene.json", self.scene().to_string().as_bytes());
        let run = |arguments: &[&str]| {
            let output = bench.run(&[arguments, &["-q"]].concat());
            assert!(output.status.success(), "{self:?}: {}", text(&output.stderr));
        };
        let into = ["render", "scene.json", "-o"];
        match self {
            Merged => {
                run(&[&into[..], &["shares", "--shard", "1/2"]].concat());
                run(&[&into[..], &["shares", "--shard", "2/2"]].concat());
                let shares = ["shares/shard-1-of-2.film", "shares/shard-2-of-2.film"];
                run(&[&["merge", out][..], &shares].concat());
            }
            FramesByLayer => run(&[&into[..], &[out, "--pattern", "{layer}/{frame}"]].concat()),
            Picture | Frames | LightField | FocusedLightField | ReferenceViews | Exposures => {
                run(&[&into[..], &[out]].concat());
            }
        }
    }
}

/// The files below a folder, and the folders that have none.
fn names(folder: &Path) -> BTreeSet<String> {
    let mut names = BTreeSet::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        match path.is_dir().then(|| self::names(&path)) {
            None => {
                names.insert(name);
            }
            Some(below) if below.is_empty() => {
                names.insert(format!("{name}/"));
            }
            Some(below) => names.extend(below.into_iter().map(|inner| format!("{name}/{inner}"))),
        }
    }
    names
}

#[test]
fn any_kind_of_render_over_any_other_leaves_its_own_files_and_the_users() {
    let bench = Bench::new();
    let alone = KINDS.map(|kind| {
        let out = format!("alone-{kind:?}");
        kind.render(&bench, &out);
        names(&bench.path(&out))
    });
    for mine in MINE {
        let path = bench.path("out").join(mine);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, "mine").unwrap();
    }
    // Every kind after every other, in one walk.
    let mut last = None;
    for i in 0..KINDS.len() {
        for j in i..KINDS.len() {
            for k in [i, j] {
                if last == Some(k) {
                    continue;
                }
                KINDS[k].render(&bench, "out");
                let mut expected = alone[k].clone();
                expected.extend(MINE.map(str::to_owned));
                let found = names(&bench.path("out"));
                let (stale, missing): (Vec<_>, Vec<_>) =
                    (found.difference(&expected).collect(), expected.difference(&found).collect());
                assert!(
                    stale.is_empty() && missing.is_empty(),
                    "{:?} over {:?}: stale {stale:?}, missing {missing:?}",
                    KINDS[k],
                    last.map(|last: usize| KINDS[last])
                );
                last = Some(k);
            }
        }
    }
    for mine in MINE {
        assert_eq!(fs::read_to_string(bench.path("out").join(mine)).unwrap(), "mine");
    }
}
