//! A method that is broken on purpose moves its point on the chart: robustness off leaks, refinement
//! off loses digits. Only errors are asserted, never times.
#![cfg(feature = "embree")]

use std::sync::Arc;

use etendue_accel::Quality;
use etendue_bench::accelerators::{AcceleratorMeasurement, Effort, Method, RENDER_WIDTH, measure};
use etendue_bench::findings::Findings;
use etendue_bench::hits::Rays;
use etendue_geometry::glam::DVec3;
use etendue_geometry::units::Metres;
use etendue_geometry::{Geometry, RayBatch, Transform};
use etendue_scene::import::Wanted;
use etendue_scene::shape::ShapeSpec;

/// A closed mesh of small triangles around the origin, moved away from it.
fn blob(place: DVec3) -> Arc<Geometry> {
    let shape =
        ShapeSpec::Blob { radius: Metres(1.0), triangles: 20_000, seed: 7, amplitude: 0.25 };
    let mesh = shape.build(Wanted::NOTHING).unwrap();
    let mut world_from_mesh = Transform::IDENTITY;
    world_from_mesh.translation = place;
    Arc::new(Geometry::alone(mesh, world_from_mesh))
}

/// Rays from inside at every vertex of the mesh and at two places of every edge: where robustness is
/// needed, and where no ray may get out.
fn aimed(geometry: &Geometry) -> Rays {
    let placement = &geometry.placements[0];
    let mesh = geometry.mesh_of(placement);
    let eye = placement.world_from_mesh.point(DVec3::new(0.02, -0.03, 0.01));
    let mut rays = RayBatch::default().with_coherence(true);
    for triangle in mesh.triangles.iter() {
        let [a, b, c] =
            triangle.map(|i| placement.world_from_mesh.point(mesh.positions.get(i as usize)));
        for target in [a, 0.5 * (a + b), 0.3 * a + 0.7 * c] {
            rays.push(eye, (target - eye).normalize());
        }
    }
    Rays::new(rays)
}

fn measured(place: DVec3) -> Vec<AcceleratorMeasurement> {
    let geometry = blob(place);
    let effort = Effort {
        methods: Method::all(),
        widths: vec![RENDER_WIDTH],
        threads: vec![1],
        rounds: 1,
        quality: Quality::Medium,
        memory_limit: None,
    };
    measure(&geometry, &aimed(&geometry), &effort, &|_| true).unwrap()
}

/// The height of a method's point on a chart.
fn on_chart(findings: &[AcceleratorMeasurement], chart: &str, method: Method) -> f64 {
    let findings = Findings {
        machine: Vec::new(),
        scene: Vec::new(),
        rounds: 1,
        accelerators: findings.to_vec(),
        samplers: None,
        cameras: None,
        target: None,
        notes: Vec::new(),
    };
    let charts = findings.charts();
    let (_, chart) = charts.iter().find(|(stem, _)| *stem == chart).unwrap();
    let series = chart.series.iter().find(|series| series.name == method.name()).unwrap();
    series.points[0].at[1]
}

#[test]
fn without_robustness_rays_leak_and_the_chart_shows_it() {
    let findings = measured(DVec3::ZERO);
    let of = |method: Method| findings.iter().find(|f| f.method == method.name()).unwrap();
    let exact = &of(Method::EXACT).errors;
    let rays = exact.rays;
    assert!(rays > 50_000 && exact.hits == rays, "{exact:?}");
    for method in [Method::EMBREE_REFINED, Method::BVH, Method::EXACT] {
        assert_eq!(of(method).errors.missed, 0, "{} is watertight", method.name());
    }
    // Aimed at edges and corners, about six rays of a thousand slip through, by Embree 3.13.
    let fast = &of(Method::EMBREE_FAST).errors;
    assert!(fast.missed * 1000 > rays, "{} of {rays} rays leak", fast.missed);
    let height = |method| on_chart(&findings, "accelerators-hits", method);
    assert!(
        height(Method::EMBREE_FAST) > 10.0 * height(Method::EMBREE_REFINED),
        "{} {}",
        height(Method::EMBREE_FAST),
        height(Method::EMBREE_REFINED)
    );
}

#[test]
fn without_refinement_digits_are_lost_and_the_chart_shows_it() {
    let findings = measured(DVec3::new(1000.0, 0.0, 0.0));
    let height = |method| on_chart(&findings, "accelerators-depth", method);
    // Single precision has 2⁻²⁴ of the distance at best, double a few 2⁻⁵³ over the cosine.
    assert!(height(Method::EMBREE_REFINED) < 1e-13, "{}", height(Method::EMBREE_REFINED));
    for broken in [Method::EMBREE_ROBUST, Method::EMBREE_FAST] {
        assert!(height(broken) > 1e-8, "{}: {}", broken.name(), height(broken));
    }
}

#[test]
fn a_stop_is_heeded() {
    let geometry = blob(DVec3::ZERO);
    let effort = Effort {
        methods: vec![Method::BVH],
        widths: vec![16],
        threads: vec![1],
        rounds: 3,
        quality: Quality::Low,
        memory_limit: None,
    };
    let stopped = measure(&geometry, &aimed(&geometry), &effort, &|_| false);
    assert!(matches!(stopped, Err(etendue_bench::BenchError::Stopped)));
}
