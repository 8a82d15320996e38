//! Whole renders: from the text of a scene to the values of its layers.
#![allow(clippy::disallowed_methods, reason = "tests set their stage by hand")]

mod adaptive;
mod band_borders;
mod band_paths;
mod blocks;
mod coarse_images;
mod curves;
mod diffraction;
mod dispersion;
mod divided;
mod known_radiance;
mod layers;
mod light_field;
mod light_parts;
mod light_sampling;
mod many_lights;
mod modulation;
mod moving;
mod moving_lights;
mod overruled;
mod overruled_camera;
mod passes;
mod second_readers;
mod shutter;
mod spectra;
mod spectral_surfaces;
mod steps;
mod textures;
mod tolerance;
mod unseen;
