//! Messages between the window and the thread that renders.

use std::collections::VecDeque;
use std::path::PathBuf;
use std::sync::mpsc::Sender;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

use etendue::{Error, Inspector, Preview, Progress, Screen, Still};
use serde_json::Value;

use crate::document::View;

/// Wish of what is to be seen.
#[derive(Debug, Clone)]
pub(crate) struct Wish {
    /// Numbers rise; answers carry them.
    pub(crate) number: u64,
    pub(crate) scene: Arc<Value>,
    pub(crate) view: View,
    /// Of a layer with several parts, the one to show, by the name that files give it.
    pub(crate) part: Option<String>,
    /// One of the scene's frames.
    pub(crate) frame: Option<usize>,
}

/// Something to be done once.
#[derive(Debug)]
pub(crate) enum Task {
    /// Open a scene, a model, a lens or an image.
    Open(PathBuf),
    /// Begin with a scene that is in no file: its name and its JSON.
    Begin(&'static str, &'static str),
    /// Write the scene to a file.
    Save(PathBuf, Arc<Value>),
    /// Render the scene as the command line does, and write its files into a folder.
    Render(PathBuf, Arc<Value>, Option<usize>),
}

/// Kind of file that a scene was made for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    Scene,
    /// A scene that is in no file yet.
    First,
    Model,
    Lens,
}

/// News that the thread tells.
#[derive(Debug)]
pub(crate) enum News {
    /// A file was opened: what it is, and the values of its scene.
    Opened(PathBuf, Kind, Arc<Value>),
    /// An image was opened, or has changed.
    Looked(PathBuf, Arc<Still>),
    /// The file has changed: what it says now, and that with the edits that were not saved.
    TakenUp(Arc<Value>, Arc<Value>),
    /// A wish makes sense: what it shows can be asked. With the number of the scene's frames.
    Accepted(u64, Arc<Value>, Inspector, Option<usize>),
    /// A wish makes no sense.
    Refused(u64, String),
    /// A picture, rough or fine.
    Shown(Box<ScreenPicture>),
    /// Work that is being done, and the share of it that is done.
    Busy(&'static str, f64),
    /// Nothing is being done.
    Idle,
    /// The scene stands in this file now.
    Saved(PathBuf, Arc<Value>),
    /// Files were written into a folder.
    Written(PathBuf, usize),
    /// Something else went wrong.
    Fault(String),
}

/// A picture to be shown.
#[derive(Debug)]
pub(crate) struct ScreenPicture {
    /// The wish that it answers.
    pub(crate) number: u64,
    pub(crate) screen: Screen,
    /// Pixels of the picture along the side of one of these.
    pub(crate) factor: u32,
    /// The layer that it shows, as files call it; empty for the picture.
    pub(crate) layer: String,
    /// All layers that there are.
    pub(crate) layers: Vec<String>,
    /// Preview that it was made of; none for a picture between two passes.
    pub(crate) preview: Option<Arc<Preview>>,
    /// Samples that its pixels have, and are to have, where that is known.
    pub(crate) samples: Option<[u32; 2]>,
    /// There is none finer to come.
    pub(crate) is_final: bool,
}

/// State that the two threads share.
#[derive(Debug, Default)]
pub(super) struct Desk {
    pub(super) tasks: VecDeque<Task>,
    pub(super) wish: Option<Wish>,
    /// Stops what may be stopped for something newer.
    pub(super) refining: Option<Progress>,
    /// Stops what only the user stops.
    pub(super) working: Option<Progress>,
    pub(super) closes: bool,
}

#[derive(Debug, Default)]
pub(crate) struct WorkerState {
    desk: Mutex<Desk>,
    pub(super) bell: Condvar,
}

impl WorkerState {
    pub(super) fn desk(&self) -> MutexGuard<'_, Desk> {
        self.desk.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Tells the window that there is news.
pub(crate) type Wake = Arc<dyn Fn() + Send + Sync>;

/// Sends news to the window.
#[derive(Clone)]
pub(crate) struct NewsSender {
    pub(super) to: Sender<News>,
    pub(super) wake: Wake,
}

impl NewsSender {
    pub(super) fn send(&self, news: News) {
        // Nobody listens any more when the window is closing.
        let _ = self.to.send(news);
        (self.wake)();
    }

    pub(super) fn fault(&self, error: &Error) {
        if !error.is_stopped() {
            self.send(News::Fault(error.message()));
        }
    }
}
