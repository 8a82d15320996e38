//! Time of a scene's picture: the frame's time, the shutter, and the camera's motion in the frame's
//! clock.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::SceneError;
use crate::file::{ImuSpec, ObjectMotionSpec, ObjectSpec, SceneFile, ScenePath};
use crate::frames::Frame;
use crate::import::{Deformer, Note, NoteKind};
use etendue_camera::{Camera, CameraMotionSpec, CameraSpec, ShutterKind};
use etendue_geometry::Geometry;
use etendue_geometry::units::Seconds;
use etendue_sensor::Sensor;
use etendue_tracer::{
    Clock, Light, LightMotionSpec, LightSpec, Material, MaterialSpec, Modulation, ModulationSpec,
};

impl SceneFile {
    /// The camera as the file has it, with its exposure from the sensor and its motion in the frame's clock.
    pub(crate) fn timed_camera(&self, mut spec: CameraSpec) -> CameraSpec {
        if spec.shutter().is_none() && spec.motion().is_none() && !self.changes() {
            return spec;
        }
        let shutter = spec.shutter_mut().get_or_insert_default();
        if shutter.exposure.is_none() {
            let shot = self.sensor.as_ref().and_then(|sensor| sensor.shots().next());
            shutter.exposure = shot.map(|shot| Seconds(shot.exposure));
        }
        let time = self.spec.render.time();
        if let Some(motion) = spec.motion_mut() {
            *motion = motion.from_time(time);
        }
        spec
    }

    /// Refuses times that contradict each other.
    pub(crate) fn check_times(&self) -> Result<(), SceneError> {
        let render = &self.spec.render;
        if let Some(Seconds(time)) = render.time
            && !time.is_finite()
        {
            return Err(self.fault("render.time", format!("{time} s is not finite")));
        }
        if let Some(rate) = render.rate
            && !(rate > 0.0 && rate.is_finite())
        {
            let why = format!("{rate} frames a second\nhint: give a number above 0");
            return Err(self.fault("render.rate", why));
        }
        if let Some((key, why)) = render.imu.as_ref().and_then(ImuSpec::fault) {
            return Err(self.fault(format!("render.imu.{key}"), why));
        }
        let camera = self.spec.camera.as_ref();
        let is_timed = |it: &&CameraSpec| it.shutter().is_some() || it.motion().is_some();
        let Some(camera) = camera.filter(|it| is_timed(it) || self.changes()) else {
            return Ok(());
        };
        let given = camera.shutter().and_then(|shutter| shutter.exposure);
        if let Some(sensor) = &self.sensor {
            self.check_exposures(camera, sensor, given)?;
        }
        let timed = self.timed_camera(camera.clone());
        let Some((shutter, rate)) = timed.shutter().zip(render.rate) else { return Ok(()) };
        let [_, rows] = timed.sensor().resolution;
        let line_time = shutter.line_time.map_or(0.0, |time| time.0);
        let readout = f64::from(rows) * line_time;
        if shutter.kind != ShutterKind::Global && readout > 1.0 / rate {
            let why = format!(
                "{rows} rows of {line_time} s are read in {readout} s, longer than the {} s from frame to frame of \
                 `render.rate`\nhint: shorten it, or lower the rate",
                1.0 / rate
            );
            return Err(self.fault("camera.shutter.line_time", why));
        }
        Ok(())
    }

    fn check_exposures(
        &self,
        camera: &CameraSpec,
        sensor: &Sensor,
        given: Option<Seconds>,
    ) -> Result<(), SceneError> {
        let first = sensor.shots().next().map(|shot| shot.exposure);
        let differ = sensor.shots().any(|shot| Some(shot.exposure) != first);
        if differ && given.is_none() && (camera.motion().is_some() || self.changes()) {
            let why = "the light is rendered once for all of them, and what moves or changes is otherwise in each\nhint: give \
                       the exposures to `frames`, such as [{\"camera.sensor.exposure\": 0.01}], or the shutter one \
                       `exposure`";
            return Err(self.fault("camera.sensor.exposures", why));
        }
        let is_metered = sensor.spec().auto_exposure.is_some();
        if is_metered && given.is_none() && (camera.motion().is_some() || self.changes()) {
            let why = "how long the shutter is open is known when the light is, and what moves or changes has to know it \
                       before\nhint: give the shutter its `exposure`, or the sensor the `exposure` that a render of the still \
                       scene reports";
            return Err(self.fault("camera.sensor.auto_exposure", why));
        }
        let is_written = self.value().pointer("/camera/sensor/exposure").is_some();
        match (given, first) {
            (Some(Seconds(given)), Some(exposure)) if is_written && given != exposure => {
                let why = format!(
                    "{given} s, and `camera.sensor.exposure` {exposure} s\nhint: leave one of them out"
                );
                Err(self.fault("camera.shutter.exposure", why))
            }
            _ => Ok(()),
        }
    }

    /// True if some object has a motion.
    fn objects_move(&self) -> bool {
        let plays = |object: &ObjectSpec| object.animation.as_ref().is_some_and(|it| it.plays);
        self.spec.objects.iter().any(|object| object.motion.is_some() || plays(object))
    }

    /// Motions of the scene's lights.
    fn light_motions(&self) -> impl Iterator<Item = &LightMotionSpec> {
        let motions = self.spec.lights.iter().flatten().filter_map(LightSpec::motion);
        motions.map(|(motion, _)| motion)
    }

    /// Modulations of lights over time, and their starts.
    fn modulations(&self) -> impl Iterator<Item = &ModulationSpec> {
        let lights = self.spec.lights.iter().flatten().filter_map(LightSpec::modulation);
        lights.chain(self.spec.materials.values().filter_map(MaterialSpec::modulation))
    }

    /// True if some object or light has a motion, some light a modulation, or the exposure several slots.
    fn changes(&self) -> bool {
        let has_slots = !self.spec.serial.is_empty();
        let lights_move = self.light_motions().next().is_some();
        has_slots || self.objects_move() || lights_move || self.modulations().next().is_some()
    }

    /// Refuses frames without times of what moves through poses or transforms, which have them.
    pub(crate) fn check_frame_times(&self, frames: &[Frame]) -> Result<(), SceneError> {
        let has_time = |frame: &Frame| {
            frame.time.is_some() || frame.settings.iter().any(|(path, _)| path == "render.time")
        };
        let motion = self.spec.camera.as_ref().and_then(CameraSpec::motion);
        let through = |object: &ObjectSpec| {
            matches!(object.motion, Some(ObjectMotionSpec::Transforms { .. }))
        };
        let needs = matches!(motion, Some(CameraMotionSpec::Poses { .. }))
            || self.spec.objects.iter().any(through)
            || self.light_motions().any(LightMotionSpec::has_times)
            || self.modulations().any(|modulation| modulation.clock() == Clock::Scene);
        let is_timed = self.spec.render.rate.is_some() || frames.iter().all(has_time);
        if !needs || is_timed {
            return Ok(());
        }
        let why = "something moves or changes, and nobody says when each frame is taken\nhint: give `render.rate` (frames a second), \
                   or each frame its `render.time`";
        Err(self.fault("frames", why))
    }

    /// True if frames are taken at their times.
    pub(crate) fn has_clock(&self) -> bool {
        let camera = self.spec.camera.as_ref();
        camera.is_some_and(|camera| camera.motion().is_some()) || self.changes()
    }
}

/// Notes for the user on the camera's shutter and motion.
pub(crate) fn notes(camera: &Camera) -> Vec<Note> {
    let note = |message: String| Note {
        kind: NoteKind::Irregular,
        subject: "the camera's shutter".to_owned(),
        message,
        count: 1,
    };
    let Some(shutter) = camera.shutter() else { return Vec::new() };
    let Some(motion) = camera.motion() else {
        return match shutter.is_fully_open() && !camera.is_timed() && !camera.lights_change() {
            true => vec![note("nothing moves while it is open, so that it changes nothing".into())],
            false => Vec::new(),
        };
    };
    let ([open, close], [first, last]) = (shutter.whole_span(), motion.span());
    if open < first || close > last {
        return vec![note(format!(
            "it is open from {open} s to {close} s, and the poses of the motion last from {first} s to {last} s: before \
             and after them the camera stands still"
        ))];
    }
    Vec::new()
}

/// A note where the keys of an animation that plays begin or end while the shutter is open.
pub(crate) fn held(
    camera: &Camera,
    geometry: &Geometry,
    deformers: &BTreeMap<u32, Arc<Deformer>>,
    lights: &[Light],
) -> Option<Note> {
    let [open, close] = camera.exposure_span();
    let motions = geometry.placements.iter().filter_map(|placement| placement.motion.as_ref());
    let motions = motions.chain(lights.iter().filter_map(|light| light.motion.as_ref()));
    let deformers = deformers.values().filter_map(|deformer| deformer.played_span());
    let [first, last] = motions
        .filter_map(|motion| motion.played_span())
        .chain(deformers)
        .find(|[first, last]| open < close && (*first > open || *last < close))?;
    Some(Note {
        kind: NoteKind::Irregular,
        subject: "animation".to_owned(),
        message: format!(
            "its keys last from {first} s to {last} s of the frame, and the shutter is open from {open} s to {close} s: \
             before and after them all stands still"
        ),
        count: 1,
    })
}

/// A note for each light that is dark as long as the shutter is open.
pub(crate) fn dark_lights(camera: &Camera, lights: &[Light], materials: &[Material]) -> Vec<Note> {
    let [open, close] = camera.exposure_span();
    let lamps = (0..)
        .zip(lights)
        .map(|(i, light)| (ScenePath::of("lights").index(i).to_string(), &light.modulation));
    let surfaces = materials.iter().filter_map(|material| {
        Some((material.name.clone(), &material.emission.as_ref()?.modulation))
    });
    let is_dark = |(_, modulation): &(String, &Option<Arc<Modulation>>)| {
        modulation.as_ref().is_some_and(|modulation| modulation.mean([open, close]) <= 0.0)
    };
    let note = |(subject, _)| Note {
        kind: NoteKind::Irregular,
        subject,
        message: format!(
            "its `modulation` leaves it dark while the shutter is open, from {open} s to {close} s of the frame"
        ),
        count: 1,
    };
    lamps.chain(surfaces).filter(is_dark).map(note).collect()
}
