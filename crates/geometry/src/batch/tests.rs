use super::*;

fn ray(number: f64) -> (DVec3, DVec3) {
    (DVec3::splat(number), DVec3::new(0.0, 0.0, number))
}

/// Every array of a batch has one entry a ray, or none for triangles that no ray has.
fn assert_sound(rays: &RayBatch) {
    let len = rays.len();
    assert!(rays.shared_arrays().all(|array| array.len() == len), "{rays:?}");
    assert!(rays.endpoint_triangles().is_none_or(|all| all.len() == len), "{rays:?}");
    assert!(rays.times().is_empty() || rays.times().len() == len, "{rays:?}");
}

#[test]
fn rays_with_and_without_triangles_mix() {
    let mut rays = RayBatch::default();
    let (origin, direction) = ray(1.0);
    rays.push(origin, direction);
    assert_eq!(rays.endpoint_triangles(), None);
    rays.push_between_triangles(origin, direction, [0.0, 2.0], [[3, 4], [5, 6]]);
    rays.push_between(origin, direction, 0.5, 1.0);
    rays.extend_from_block(&[[7.0; 4]; 3], &[[1.0; 4]; 3], 2);
    assert_sound(&rays);
    let none = [[MISS; 2]; 2];
    let all = [none, [[3, 4], [5, 6]], none, none, none];
    assert_eq!(rays.endpoint_triangles(), Some(&all[..]));
    assert_eq!(rays.t_max(), [f64::INFINITY, 2.0, 1.0, f64::INFINITY, f64::INFINITY]);

    let mut picked = RayBatch::default();
    assert_eq!((rays.times(), rays.time(3)), (&[][..], 0.0));
    rays.set_times((0..5).map(f64::from));
    picked.gather(&rays, [1, 4, 0].into_iter());
    assert_eq!(picked.times(), [1.0, 4.0, 0.0]);
    picked.push(origin, direction);
    assert_eq!(picked.times(), [1.0, 4.0, 0.0, 0.0]);
    assert_sound(&picked);
    assert_eq!(picked.endpoint_triangles(), Some(&[[[3, 4], [5, 6]], none, none, none][..]));
    assert_eq!(picked.origin(1), DVec3::splat(7.0));

    rays.retain(|i| i % 2 == 1);
    assert_sound(&rays);
    assert_eq!((rays.len(), rays.t_max()[0]), (2, 2.0));
    assert_eq!(rays.times(), [1.0, 3.0]);

    rays.reset(3);
    assert_sound(&rays);
    assert_eq!((rays.endpoint_triangles(), rays.t_min()), (None, &[0.0; 3][..]));
}
