//! Lenses in waves, against closed forms.

mod aberrations;
mod closed_forms;
mod lenses;
