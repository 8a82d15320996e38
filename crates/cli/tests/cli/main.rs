//! The built command, as a user runs it.
#![allow(clippy::disallowed_methods, reason = "tests set their stage by hand")]

mod annotations; // copies of objects in data sets and mattes, by others' readers
mod assets; // real models from outside the repository
mod bad_input; // refused with exit code 2, one message, and nothing written
mod bad_light; // materials, textures and lights that make no sense
mod bench; // speed against accuracy on a tiny scene
mod calibration;
mod chips;
mod cubes; // surfaces and lamps by wavelength, from files of every form
mod cubes_around; // light by wavelength from all around
mod deforming; // skins and morph targets while the shutter is open
mod denoise; // pictures without their noise, where Open Image Denoise is there
mod emva; // the characterisation of what the command writes
mod expose; // pictures from elsewhere on a sensor
mod exposures; // what a scene's sensor makes of a render
mod figures; // models with skins, in the pose of their file
mod files; // what is no file, what costs without end, what real programs write
mod flow; // layers that compare two frames
mod frames; // many pictures of one scene, and trajectories of others
mod gallery; // the page of pictures, its commands and its scenes
mod generated; // schemas and pages that the program writes
mod gltf_looks; // materials and lights of models, with closed-form answers
mod gltf_textures; // textures of models, likewise
mod hidden; // meshes of one point, nodes scaled to 0
mod ids; // numbers of objects, copies, nodes and materials, and their names
mod images; // textures and environments of every kind and size
mod inputs; // every key of the schema that names a file: guarded, kept, and in the hash
mod lamps; // spectra, lumens and luminances of what shines
mod leniency; // comments, schema addresses, resolutions as words, quiet
mod lens; // tables, drawings and files of lenses, and what is refused
mod lens_pictures; // pictures through lenses, with closed-form answers
mod lens_reference; // lenses against other software
mod light_fields; // lenslets, arrays of cameras, and the page about them
mod limits; // what the page on limits lists
mod losses; // what files clip, saturate or show black
mod memory; // refused before it is taken
mod messages; // what is wrong, in plain words
mod models; // simpler models of a lens, and OpenCV's fitted to it
mod motion; // what moves while the shutter is open, crossed with all else
mod moving_lights; // lights that move while the shutter is open
mod moving_sets; // rolling shutters in data sets of frames, readings of an inertial unit
mod openings_and_glasses; // f-numbers that a lens lacks, glasses of earlier catalogues and of one's own
mod orbit; // a data set of a real model
mod overwriting; // inputs, results of an earlier run, and files of others
mod panes; // light that passes panes
mod photons; // electrons and noise of sensors, against sums by the nanometre
mod pictures; // exposure, tone maps, transparency, and which light there is
mod printing; // what names in files do to a terminal
mod render; // pictures with a closed-form answer
mod run; // running the command and reading what it left
mod schema; // the schema by another validator
mod sensor; // presets, curves, series of a characterisation
mod serial; // exposures in slots
mod shards; // renders that are divided or killed, and their pictures
mod spectral_files; // light in bands by others' readers and writers
mod spectrum_command; // curves in numbers and drawings
mod stale; // a render of one kind into the folder of another
mod stopping; // Ctrl-C and what it leaves
mod tolerance;
mod tools; // check, plan, schema, version
mod validation; // the page of effects, their sources and their tests
mod view; // the window, as far as there is none
mod views; // where a camera without a pose stands, and which way is up
mod waves; // wavefronts, MTF and reports of lenses, and what they are refused
