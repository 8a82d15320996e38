//! Lenses in waves, against closed forms.

mod closed_forms;
mod aberrations;
mod lenses;
