use super::*;

fn trs(translation: [f64; 3], axis: DVec3, angle: f64, scale: [f64; 3]) -> Transform {
    let rotation = DQuat::from_axis_angle(axis.normalize(), angle);
    Transform::from_trs(translation.into(), rotation, scale.into())
}

fn distance(a: &Transform, b: &Transform) -> f64 {
    let points = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
    points.iter().map(|&p| a.point(p).distance(b.point(p))).fold(0.0, f64::max)
}

/// A few roundings of numbers of size 1 to 10.
const ROUNDING: f64 = 1e-14;

#[test]
fn a_spin_turns_by_any_number_of_revolutions() {
    let (axis, about) = (DVec3::new(1.0, 2.0, -1.0), DVec3::new(0.5, -2.0, 3.0));
    let unit = axis.normalize();
    for revolutions in [0.0, 0.25, 1.0, 2.0, -3.5, 10.1] {
        let rate = std::f64::consts::TAU * revolutions;
        let velocity = DVec3::new(1.0, 0.0, -2.0);
        let motion = Motion::steady(Steady { velocity, axis, rate, about }).expect("sound");
        for time in [-1.0, 0.0, 0.3, 0.5, 1.0] {
            for p in [DVec3::ZERO, DVec3::X, DVec3::new(3.0, 1.0, 2.0)] {
                // Rodrigues's formula.
                let (r, angle) = (p - about, rate * time);
                let expected = about
                    + velocity * time
                    + r * angle.cos()
                    + unit.cross(r) * angle.sin()
                    + unit * unit.dot(r) * (1.0 - angle.cos());
                assert!(motion.at(time).point(p).distance(expected) < 1e-13);
            }
        }
    }
}

#[test]
fn keys_are_met_held_and_joined_as_the_formulas_say() {
    let times = [-0.5, 0.25, 1.0, 3.0];
    let poses = [
        trs([0.0; 3], DVec3::Z, 0.1, [1.0, 2.0, 3.0]),
        trs([1.0, 2.0, 0.0], DVec3::Z, 1.1, [1.0, 2.0, 4.0]),
        trs([2.0, 2.0, 5.0], DVec3::Z, 3.1, [1.0, 2.0, 4.0]),
        trs([-2.0, 2.0, 5.0], DVec3::Z, 5.1, [1.0; 3]),
    ];
    for interpolation in [Interpolation::Linear, Interpolation::Cubic] {
        let motion = Motion::through(&times, &poses, interpolation).expect("sound");
        assert_eq!(motion.span(), [-0.5, 3.0]);
        for (time, pose) in times.iter().zip(&poses) {
            assert!(distance(&motion.at(*time), pose) < ROUNDING);
        }
        assert_eq!(motion.at(-7.0), motion.at(-0.5));
        assert_eq!(motion.at(9.0), motion.at(3.0));
        // The turn is about one axis all the time: 1 rad, then 2 rad in 0.75 s.
        for (time, angle) in [(-0.125, 0.6), (0.625, 2.1), (0.8125, 2.6), (2.0, 4.1)] {
            let place = motion.at(time).linear;
            let x = place.x_axis.normalize();
            assert!(x.distance(DVec3::new(f64::cos(angle), f64::sin(angle), 0.0)) < ROUNDING);
        }
    }
    let linear = Motion::through(&times, &poses, Interpolation::Linear).expect("sound");
    assert!(linear.at(0.625).translation.distance(DVec3::new(1.5, 2.0, 2.5)) < ROUNDING);
}

#[test]
fn a_cubic_gives_back_parabolas_at_uneven_times() {
    let path = |t: f64| DVec3::new(1.0 + t, 2.0 * t - 3.0 * t * t, 0.5 * t * t);
    let times = [0.0, 0.3, 0.5, 1.1, 1.2];
    let poses = times.map(|t| Transform::new(DMat3::IDENTITY, path(t)));
    let motion = Motion::through(&times, &poses, Interpolation::Cubic).expect("sound");
    // Three-point tangents are exact for parabolas; the outermost spans have one-sided ones.
    for time in [0.31, 0.4, 0.499, 0.7, 1.0, 1.1] {
        assert!(motion.at(time).translation.distance(path(time)) < ROUNDING, "at {time}");
    }
}

#[test]
fn a_sweep_holds_every_place_and_little_more() {
    let local = Bounds { min: DVec3::new(-1.0, -0.1, 0.0), max: DVec3::new(2.0, 0.1, 0.3) };
    let poses = [
        trs([0.0; 3], DVec3::Z, 0.1, [1.0, 2.0, 3.0]),
        trs([10.0, 2.0, 0.0], DVec3::X, 2.1, [1.0, 2.0, 4.0]),
        trs([2.0, 9.0, 5.0], DVec3::Y, 3.1, [2.0, 2.0, 4.0]),
    ];
    let steady = Steady { velocity: DVec3::X, axis: DVec3::Y, rate: 20.0, about: DVec3::Z };
    let keys = |kind| Motion::through(&[0.0, 0.4, 1.0], &poses, kind).expect("sound");
    let motions = [
        keys(Interpolation::Linear),
        keys(Interpolation::Cubic),
        Motion::steady(steady).expect("sound"),
        keys(Interpolation::Cubic).with_steady(steady).expect("sound"),
    ];
    for motion in &motions {
        let exposure = [-0.2, 0.9];
        let swept = motion.swept(local, exposure);
        let mut tight = Bounds::EMPTY;
        for i in 0..=5000 {
            let place = motion.at(-0.2 + 1.1 * f64::from(i) / 5000.0);
            local.corners().iter().for_each(|&corner| tight.include(place.point(corner)));
        }
        assert_eq!(swept.union(tight), swept, "{motion:?}");
        assert!(swept.diagonal() < 2.0 * tight.diagonal(), "{swept:?} around {tight:?}");
    }
}

#[test]
fn what_is_no_motion_is_refused() {
    let one = Transform::IDENTITY;
    let through = |times: &[f64], poses: &[Transform]| {
        Motion::through(times, poses, Interpolation::Linear).expect_err("refused")
    };
    assert!(matches!(through(&[], &[]), MotionError::Count { .. }));
    assert!(matches!(through(&[0.0, f64::NAN], &[one; 2]), MotionError::NotFinite(_)));
    assert!(matches!(through(&[0.0, 0.0], &[one; 2]), MotionError::Order { index: 1, .. }));
    assert!(matches!(through(&[1.0, 0.0], &[one; 2]), MotionError::Order { index: 1, .. }));
    let scaled = |s| Transform::new(DMat3::from_diagonal(s), DVec3::ZERO);
    let mirrored = scaled(DVec3::new(-1.0, 1.0, 1.0));
    assert_eq!(through(&[0.0, 1.0], &[one, mirrored]), MotionError::Scale(0));
    assert_eq!(through(&[0.0], &[scaled(DVec3::X)]), MotionError::Scale(0));
    let shear = DMat3::from_cols(DVec3::X, DVec3::ONE, DVec3::Z);
    assert_eq!(through(&[0.0], &[Transform::new(shear, DVec3::ZERO)]), MotionError::Shear(0));
    let spin = Steady { rate: 1.0, ..Steady::default() };
    assert_eq!(Motion::steady(spin), Err(MotionError::Axis));
}
