//! The frames of a scene: what is set for each of its pictures.

mod colmap;
mod frame;
mod path;
mod trajectory;
mod transforms;

use etendue_camera::{CameraSpec, Convention, Maps, PoseSpec};
use etendue_files::Opener;
use etendue_report::Refusal;

use crate::SceneError;
use crate::error::not_found;
use crate::file::{CameraPath, FramesSpec, SceneFile, ScenePath, Setting};
use crate::import::Note;
use frame::{MOST_FRAMES, PoseAxes, Station, too_many};
use trajectory::TrajectorySource;
use transforms::ScenePicture;

pub(crate) use frame::listed;
pub use frame::{Frame, Frames, RigCamera, Start};

impl SceneFile {
    /// The frames of the scene, in order; `None` when it has no `frames` and is one picture. `start` is
    /// asked for when a path of the camera begins where the camera stands.
    ///
    /// # Errors
    ///
    /// When a path of the scene cannot be set, a pose is no rotation, or a trajectory's file is missing or
    /// broken; the message names the frame.
    pub fn frames(
        &self,
        opener: &Opener,
        start: impl FnOnce() -> Result<Start, SceneError>,
    ) -> Result<Option<Frames>, SceneError> {
        let Some(spec) = &self.spec.frames else { return Ok(None) };
        if self.spec.render.frame != 0 {
            let why = "each of `frames` has its own number\nhint: leave one of the two out";
            return Err(self.fault("render.frame", why));
        }
        let mut notes = Vec::new();
        let frames = match spec {
            FramesSpec::List(list) => listed(list),
            FramesSpec::Path(CameraPath::Rig { cameras, path }) => {
                let start = start()?;
                let pose = start.pose;
                let moments = match &**path {
                    FramesSpec::List(list) => listed(list),
                    FramesSpec::Path(CameraPath::Rig { .. }) => {
                        return Err(self.fault(
                            "frames.path.type",
                            "a rig on a rig is one rig; list its cameras",
                        ));
                    }
                    FramesSpec::Path(path) => {
                        self.along(&"frames.path".into(), path, opener, &mut notes, || Ok(start))?
                    }
                };
                path::rig_frames(self, cameras, &moments, &pose)
                    .map_err(|(place, why)| self.fault(place, why))?
            }
            FramesSpec::Path(path) => {
                self.along(&"frames".into(), path, opener, &mut notes, start)?
            }
        };
        if frames.len() > MOST_FRAMES {
            return Err(self.fault("frames", too_many(frames.len())));
        }
        if frames.is_empty() {
            return Err(
                self.fault("frames", "there is no frame\nhint: leave `frames` out for one picture")
            );
        }
        self.check_frame_times(&frames)?;
        if let FramesSpec::List(_) | FramesSpec::Path(CameraPath::Rig { .. }) = spec {
            // Known now, and not when it is that frame's turn; but for lenses, which take some milliseconds each.
            let folder = self.open_folder(opener)?;
            for frame in &frames {
                let file = self.at(frame)?;
                if let Some(CameraSpec::Pinhole(_) | CameraSpec::Orthographic(_)) = file.spec.camera
                {
                    file.camera_alone(&folder, &[])?;
                }
            }
        }
        Ok(Some(Frames { frames, notes }))
    }

    /// The scene with a frame's settings and its number, and without `frames`: as if each stood in a file of
    /// its own. The number is that among all frames, so that its random numbers do not depend on which of
    /// them are rendered; a frame may set another.
    ///
    /// # Errors
    ///
    /// When the format does not know what they say; the message names the frame.
    pub fn at(&self, frame: &Frame) -> Result<Self, SceneError> {
        let number = Some(Setting::new("render.frame", frame.number.to_string()));
        let own = frame.settings.iter().map(|(path, value)| Setting::new(path, value.to_string()));
        // When a moving camera's frame is taken.
        let time = frame.time.filter(|_| self.has_clock());
        let time = time.map(|time| Setting::new("render.time", time.to_string()));
        let settings: Vec<Setting> =
            number.filter(|_| frame.number > 0).into_iter().chain(time).chain(own).collect();
        let in_frame = |error: SceneError| {
            let why = match error {
                // Its place is the frame, which is told here.
                SceneError::Invalid { path, why, .. } => why.at(path),
                other => Refusal::new(other.to_string()),
            };
            self.fault(ScenePath::of("frames").index(frame.number), why)
        };
        self.without_frames()?.of_frame(frame.number).with(&settings).map_err(in_frame)
    }

    /// The frames along a path of the camera, which is written at `place`.
    pub(crate) fn along(
        &self,
        place: &ScenePath,
        path: &CameraPath,
        opener: &Opener,
        notes: &mut Vec<Note>,
        start: impl FnOnce() -> Result<Start, SceneError>,
    ) -> Result<Vec<Frame>, SceneError> {
        let fault = |(key, why): (&str, String)| self.fault(place.join(key), why);
        let stations = match path {
            CameraPath::Animation { .. } => {
                return path::animation_frames(self, path).map_err(fault);
            }
            CameraPath::Cameras {} => {
                return path::cameras(self, &start()?.cameras).map_err(fault);
            }
            CameraPath::Poses { poses, times } => {
                if let Some(times) = times
                    && times.len() != poses.len()
                {
                    let why = format!("{} times for {} poses", times.len(), poses.len());
                    return Err(fault(("times", why)));
                }
                let time = |i: usize| times.as_ref().map(|times| times[i].0);
                let station = |(i, pose): (usize, &PoseSpec)| Station {
                    time: time(i),
                    ..Station::new(pose.clone())
                };
                poses.iter().enumerate().map(station).collect()
            }
            CameraPath::Trajectory { file, format, maps, convention } => {
                let folder = self.open_folder(opener)?;
                let found = folder.find(file).map_err(|error| fault(("file", not_found(error))))?;
                let maps = maps.unwrap_or(Maps::WorldFromCamera);
                let convention = convention.unwrap_or(Convention::Opencv);
                let trajectory = TrajectorySource {
                    folder: &folder,
                    file,
                    format: *format,
                    axes: PoseAxes { maps, convention },
                    picture: self.picture(),
                };
                let (stations, found) = trajectory
                    .read(&found.path)
                    .map_err(|why| fault(("file", format!("\"{file}\" {why}"))))?;
                notes.extend(found);
                stations
            }
            CameraPath::Orbit { .. }
            | CameraPath::Dolly { .. }
            | CameraPath::Grid { .. }
            | CameraPath::Rig { .. } => path::made(path, &start()?).map_err(fault)?,
        };
        if stations.len() > MOST_FRAMES {
            return Err(self.fault(place, too_many(stations.len())));
        }
        let mut frames = Vec::with_capacity(stations.len());
        for (number, station) in stations.into_iter().enumerate() {
            // Told here, by its number, and not when it is that frame's turn.
            station.pose.build().map_err(|error| {
                let why = format!("pose {number}: {}", error.under("pose"));
                fault(match path {
                    CameraPath::Trajectory { file, .. } => ("file", format!("\"{file}\": {why}")),
                    _ => ("poses", why),
                })
            })?;
            let mut settings = station.settings;
            // A pose is made of numbers and words only, which always serialise.
            let pose = serde_json::to_value(&station.pose).unwrap_or_default();
            settings.push(("camera.pose".to_owned(), pose));
            frames.push(Frame { number, time: station.time, settings, rig: None });
        }
        Ok(frames)
    }
}

impl SceneFile {
    /// The pixels of the scene's own camera.
    fn picture(&self) -> ScenePicture {
        let camera = self.spec.camera.as_ref();
        let sensor = camera.map(|camera| camera.sensor().clone()).unwrap_or_default();
        let is_given = ["resolution", "model"]
            .iter()
            .any(|key| self.value().pointer(&format!("/camera/sensor/{key}")).is_some());
        ScenePicture { resolution: sensor.resolution, is_given }
    }
}
