#![forbid(unsafe_code)]
//! Scenes from files: the JSON format, glTF, OBJ and PLY meshes, procedural shapes; a validated
//! `Scene` out.
