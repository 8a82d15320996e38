//! What stands around the picture.

pub(crate) mod asking;
pub(crate) mod bar;
pub(crate) mod inspect;
pub(crate) mod lens;
pub(crate) mod light_field;
pub(crate) mod listing;
pub(crate) mod scene;
pub(crate) mod status;
