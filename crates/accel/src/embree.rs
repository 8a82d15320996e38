#![expect(unsafe_code, reason = "Embree's C interface; the rest of the workspace has none")]
//! Embree behind four owners, each of one handle that it releases itself: [`Device`], [`EmbreeGeometry`],
//! [`SceneBuilder`] and [`CommittedScene`].
//!
//! * `SceneBuilder` can be changed and not traced, `CommittedScene` traced and not changed: Embree wants
//!   modifying, committing and tracing strictly one after the other (manual, `rtcCommitScene`), and
//!   moving the one into the other proves it.
//! * Vertex and index buffers are shared, not copied, where they stand as Embree wants them; a
//!   `CommittedScene` keeps the [`Geometry`] that owns them alive.
//! * Errors come through the device's error function, with Embree's own words. Tracing reports none.
//! * Masks, ids and the 16 bytes behind the last vertex are seen to here and nowhere else.

mod blocks;
mod device;
mod filter;
#[cfg(feature = "limit")]
pub mod limit;
mod shape;
mod trace;

use std::ffi::c_void;
use std::fmt;
use std::ptr::{self, NonNull};
use std::sync::Arc;

use embree4_sys as sys;
use etendue_geometry::glam::{DMat3, DVec3};
use etendue_geometry::{Geometry, Mesh, Placement, Transform};

use self::device::{Device, SceneHandle};
use self::shape::{EmbreeGeometry, InstanceChoice, InstanceKind};
use crate::{BuildError, BuildOptions, single};

pub use self::device::{Version, version};
pub(crate) use self::filter::{ExactFilter, NearestSearch};
pub(crate) use self::trace::FoundHits;

type ProgressFn = dyn Fn(f64) -> bool + Send + Sync;

unsafe extern "C" fn on_progress(user: *mut c_void, done: f64) -> bool {
    // SAFETY: `user` points to the reference that `SceneBuilder::commit` keeps on its stack for as
    // long as the callback is registered.
    let progress = unsafe { *user.cast::<&ProgressFn>() };
    progress(done)
}

/// A scene that takes shapes and cannot be traced yet.
struct SceneBuilder<'a> {
    device: &'a Device,
    handle: SceneHandle,
}

impl<'a> SceneBuilder<'a> {
    fn new(device: &'a Device, options: &BuildOptions) -> Result<Self, BuildError> {
        // SAFETY: the device is live.
        let handle = unsafe { sys::rtcNewScene(device.handle.as_ptr()) };
        device.check("rtcNewScene")?;
        let Some(handle) = NonNull::new(handle) else {
            return Err(BuildError::Library {
                call: "rtcNewScene",
                message: "no scene".to_owned(),
            });
        };
        let handle = SceneHandle(handle);
        let mut flags = sys::RTC_SCENE_FLAG_NONE;
        if options.robust {
            flags = sys::RTCSceneFlags(flags.0 | sys::RTC_SCENE_FLAG_ROBUST.0);
        }
        if options.robust && options.refine {
            flags =
                sys::RTCSceneFlags(flags.0 | sys::RTC_SCENE_FLAG_FILTER_FUNCTION_IN_ARGUMENTS.0);
        }
        if options.compact {
            flags = sys::RTCSceneFlags(flags.0 | sys::RTC_SCENE_FLAG_COMPACT.0);
        }
        // SAFETY: the scene is live and ours alone.
        unsafe {
            sys::rtcSetSceneFlags(handle.0.as_ptr(), flags);
            sys::rtcSetSceneBuildQuality(handle.0.as_ptr(), options.quality.to_embree());
        }
        Ok(Self { device, handle })
    }

    fn attach(&mut self, shape: &EmbreeGeometry, id: u32) {
        // SAFETY: both are live; the scene retains the geometry.
        unsafe {
            sys::rtcAttachGeometryByID(self.handle.0.as_ptr(), shape.handle.as_ptr(), id);
        }
    }

    /// Builds the acceleration structure.
    fn commit(self, progress: Option<&ProgressFn>) -> Result<SceneHandle, BuildError> {
        let scene = self.handle.0.as_ptr();
        if let Some(progress) = progress {
            let user: *mut c_void = ptr::from_ref(&progress).cast_mut().cast();
            // SAFETY: `progress` outlives the commit; the callback is taken off right after.
            unsafe {
                sys::rtcSetSceneProgressMonitorFunction(scene, Some(on_progress), user);
                sys::rtcCommitScene(scene);
                sys::rtcSetSceneProgressMonitorFunction(scene, None, ptr::null_mut());
            }
        } else {
            // SAFETY: the scene is live and ours alone.
            unsafe { sys::rtcCommitScene(scene) };
        }
        match self.device.check("rtcCommitScene") {
            Ok(()) => Ok(self.handle),
            Err(error) => {
                let is_asked_for =
                    matches!(error, BuildError::Stopped | BuildError::MemoryLimit { .. });
                if !is_asked_for {
                    // TBB may have failed in setting the build off, and left the group of its tasks
                    // unfinished: the destructor of that group throws out of Embree's, which ends the
                    // process. What the scene still holds is small; its triangles are freed.
                    std::mem::forget(self.handle);
                }
                Err(error)
            }
        }
    }
}

/// A committed scene: nothing changes it any more, so any number of threads may trace it.
pub(crate) struct CommittedScene {
    // The order matters: the scene lets go of the buffers, then the device, then the geometry.
    handle: SceneHandle,
    /// The scenes of meshes that have one of their own.
    shared: Vec<Option<Arc<SceneHandle>>>,
    device: Arc<Device>,
    geometry: Arc<Geometry>,
    /// Some meshes are scenes of their own.
    has_instances: bool,
    /// Built in Embree's compact mode.
    is_compact: bool,
    /// Rotations that bring the normal that Embree gives of each placement into the world; `None`
    /// where that is true of all as they are.
    turns: Option<Vec<DMat3>>,
    /// Bytes of vertices that had to be copied.
    pub(crate) copied_bytes: u64,
}

impl fmt::Debug for CommittedScene {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Scene").field("device", &self.device).finish_non_exhaustive()
    }
}

impl CommittedScene {
    /// Builds the scene of `geometry` with coordinates relative to `origin`. After `before`, of which
    /// something was moved or replaced, large meshes get scenes of their own, and those that `before`
    /// has of the same meshes are kept.
    pub(crate) fn build(
        geometry: Arc<Geometry>,
        origin: DVec3,
        options: &BuildOptions,
        before: Option<&Self>,
    ) -> Result<Self, BuildError> {
        let device = match before {
            Some(before) => Arc::clone(&before.device),
            None => Arc::new(Device::new(options)?),
        };
        let mut copied_bytes = 0;
        let instanced = InstanceChoice::of(&geometry, origin, before.is_some());
        let mut shared: Vec<Option<Arc<SceneHandle>>> = Vec::with_capacity(geometry.meshes.len());
        for (index, (mesh, &wanted)) in geometry.meshes.iter().zip(&instanced.meshes).enumerate() {
            // While both geometries live, buffers of one address are one buffer, which the new geometry
            // keeps alive as well.
            if wanted && let Some(kept) = before.and_then(|before| before.scene_of(index, mesh)) {
                shared.push(Some(kept));
                continue;
            }
            let mut scene = None;
            let to_frame = Transform::new(DMat3::IDENTITY, -mesh_origin(mesh));
            if wanted && let Some(shape) = EmbreeGeometry::mesh(&device, mesh, &to_frame, options)?
            {
                let mut builder = SceneBuilder::new(&device, options)?;
                copied_bytes += shape.copied_bytes;
                builder.attach(&shape, 0);
                scene = Some(Arc::new(builder.commit(options.progress.as_deref())?));
            }
            shared.push(scene);
        }
        let mut builder = SceneBuilder::new(&device, options)?;
        for (id, kind) in (0..).zip(&instanced.placements) {
            let placement = &geometry.placements[id as usize];
            let mesh = geometry.mesh_of(placement);
            let mut to_frame = placement.world_from_mesh;
            to_frame.translation -= origin;
            let shape = match (kind, &shared[placement.mesh as usize]) {
                (InstanceKind::LeftOut, _) => continue,
                (InstanceKind::Instance, Some(scene)) => {
                    let back = Transform::new(DMat3::IDENTITY, mesh_origin(mesh));
                    Some(EmbreeGeometry::instance(
                        &device,
                        scene,
                        &to_frame.then_inner(&back),
                        options,
                    )?)
                }
                (InstanceKind::Instance | InstanceKind::Baked, _) => {
                    EmbreeGeometry::mesh(&device, mesh, &to_frame, options)?
                }
            };
            let Some(shape) = shape else { continue };
            copied_bytes += shape.copied_bytes;
            builder.attach(&shape, id);
        }
        device.check("rtcAttachGeometry")?;
        let handle = builder.commit(options.progress.as_deref())?;
        let has_instances = instanced.meshes.contains(&true);
        let turns = turns(&geometry, &instanced);
        let is_compact = options.compact;
        Ok(Self {
            handle,
            shared,
            device,
            geometry,
            has_instances,
            is_compact,
            turns,
            copied_bytes,
        })
    }

    /// The scene of mesh `index`, where that is `mesh`.
    fn scene_of(&self, index: usize, mesh: &Mesh) -> Option<Arc<SceneHandle>> {
        let is_same = self.geometry.meshes.get(index)?.has_surface_of(mesh);
        self.shared.get(index)?.as_ref().filter(|_| is_same).map(Arc::clone)
    }

    /// The geometry whose buffers are shared.
    pub(crate) fn geometry(&self) -> &Arc<Geometry> {
        &self.geometry
    }

    /// Turns the normal that Embree gives of a hit on a placement into the world.
    pub(crate) fn turns(&self) -> Option<&[DMat3]> {
        self.turns.as_deref()
    }

    /// Bytes that Embree holds.
    pub(crate) fn bytes(&self) -> u64 {
        self.device.bytes()
    }

    /// Rays per packet of coherent batches.
    pub(crate) fn packet_width(&self) -> usize {
        self.device.width
    }
}

/// [`CommittedScene::turns`]: an instance's normal is its mesh's own; one that was baked into a mirror image is of
/// the wrong side.
fn turns(geometry: &Geometry, instanced: &InstanceChoice) -> Option<Vec<DMat3>> {
    let turn = |(placement, kind): (&Placement, &InstanceKind)| {
        let transform = &placement.world_from_mesh;
        match kind {
            InstanceKind::Instance => transform.normal_matrix(),
            InstanceKind::Baked | InstanceKind::LeftOut => DMat3::IDENTITY * transform.handedness(),
        }
    };
    let turns: Vec<DMat3> =
        geometry.placements.iter().zip(&instanced.placements).map(turn).collect();
    turns.iter().any(|turn| *turn != DMat3::IDENTITY).then_some(turns)
}

/// The origin that an instanced mesh is traced relative to: its own, unless it lies far from it.
fn mesh_origin(mesh: &Mesh) -> DVec3 {
    single::F32Frame::of(mesh.bounds).origin
}
