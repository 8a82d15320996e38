//! Single against double precision, with the distance from the origin.

use std::sync::Arc;

use anyhow::Context;
use etendue_accel::Quality;
use etendue_bench::accelerators::{self, Method, RENDER_WIDTH};
use etendue_bench::hits::HitErrors;
use etendue_bench::hits::Rays;
use etendue_benches::effort::Effort;
use etendue_benches::meshes;
use etendue_benches::rays::View;
use etendue_camera::{CameraSpec, Pose};
use etendue_chart::{Axis, Chart, Series};
use etendue_geometry::glam::DVec3;
use etendue_geometry::{Bounds, Geometry, Placement, Transform};

use crate::page::Page;

const TRIANGLES: u64 = 20_000;

/// The farthest is 10 to this power (m).
const FARTHEST: i32 = 7;

const DEPTH: &str = "\
    Pick refinement, which is on unless turned off, for anything that is measured: its error is that of the file's \
    coordinates, as long as f32 finds the right triangle. Without it, distances are good to some millionths of what \
    the scene spans, which does for pictures.";
const WRONG: &str = "\
    Split a scene, or pick `bvh` or `exact`, when it spans more than some five hundred times the size of the objects \
    that are looked at. f64 measures what f32 has found; what f32 cannot tell apart, it does not find.";

/// Lines that are drawn: a name, the method, and whether the scene reaches to the origin.
const SHOWN: [(&str, Method, bool); 5] = [
    ("f32, the object alone", Method::EMBREE_ROBUST, false),
    ("f64, the object alone", Method::EMBREE_REFINED, false),
    ("f32, scene from the origin on", Method::EMBREE_ROBUST, true),
    ("f64, scene from the origin on", Method::EMBREE_REFINED, true),
    ("bvh, scene from the origin on", Method::BVH, true),
];

pub(crate) fn measure(effort: Effort, page: &mut Page) -> anyhow::Result<()> {
    page.heading("Refinement in f64, with the distance from the origin");
    page.paragraph(
        "An object of two metres, seen from some eight metres away, stands farther and farther from the file's origin; \
         alone, or with another that stays there, so that the scene spans the whole distance. `f32` is \
         `embree robust`, `f64` is `embree robust + f64`.",
    );
    let mut lines = SHOWN.map(|_| (Vec::new(), Vec::new()));
    for power in 1..=FARTHEST {
        let distance = 10f64.powi(power);
        for ((_, method, is_wide), (depth, wrong)) in SHOWN.into_iter().zip(&mut lines) {
            let errors = errors(effort, distance, method, is_wide)?;
            wrong.push([distance, errors.wrong_share()]);
            depth.extend(errors.distance.map(|quantiles| [distance, quantiles.p999]));
        }
    }
    let chart = |title: &str, upwards: Axis, points: &dyn Fn(usize) -> Vec<[f64; 2]>| Chart {
        title: title.to_owned(),
        axes: [Axis::new("distance from the origin (m)"), upwards],
        series: (0..SHOWN.len())
            .map(|k| Series { colour: k, ..Series::line(SHOWN[k].0, points(k)) })
            .collect(),
        ..Chart::default()
    };
    let upwards = Axis::new("error of the distance that 99.9 % of hits stay below (m)");
    let depth =
        chart("Error of the distance, far from the origin", upwards.with_zero("none"), &|k| {
            lines[k].0.clone()
        });
    page.chart("distance-depth", &depth, DEPTH)?;
    let upwards = Axis::new("share of rays with a wrong answer").with_zero("not one ray");
    let wrong =
        chart("Rays with a wrong answer, far from the origin", upwards, &|k| lines[k].1.clone());
    page.chart("distance-hits", &wrong, WRONG)
}

fn errors(
    effort: Effort,
    distance: f64,
    method: Method,
    is_wide: bool,
) -> anyhow::Result<HitErrors> {
    let near = meshes::blob(TRIANGLES)?;
    let mut geometry = Geometry { meshes: near.meshes.clone(), placements: Vec::new() };
    let mut moved = Transform::IDENTITY;
    moved.translation = DVec3::new(distance, 0.0, 0.0);
    let place = |mesh, world_from_mesh| Placement {
        mesh,
        object: mesh,
        instance: mesh,
        node: mesh,
        material: 0,
        world_from_mesh,
        motion: None,
    };
    geometry.placements.push(place(0, moved));
    if is_wide {
        // A mesh of its own: placed twice it would be an instance.
        geometry.meshes.extend(near.meshes.iter().cloned());
        geometry.placements.push(place(1, Transform::IDENTITY));
    }
    let view = View::framing(near.bounds());
    let shift = moved.translation;
    let pose = Pose::look_at(view.from + shift, view.look_at + shift, DVec3::Y);
    let pose = pose.context("a view upright")?;
    let camera = CameraSpec::perspective(pose, view.fov.to_radians(), 1.0)
        .build(|| Bounds::EMPTY, &|name: &str| Err(name.to_owned()))?;
    let rays = Rays::primary(&camera, crate::rays(effort) / 2);
    let effort = accelerators::Effort {
        methods: vec![method],
        widths: vec![RENDER_WIDTH],
        threads: vec![1],
        rounds: 1,
        quality: Quality::Medium,
        memory_limit: None,
    };
    let mut findings = accelerators::measure(&Arc::new(geometry), &rays, &effort, &|_| true)?;
    Ok(findings.pop().context("a finding")?.errors)
}
