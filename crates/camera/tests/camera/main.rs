//! Cameras: the rays that they send out, and what is refused.

mod coarser;
mod imu;
mod lens_camera;
mod light_field;
mod opencv_fit;
mod sampler;
mod shutter;
mod unprojection;
