//! The thread that renders: always at the latest wish, and stopped when there is a newer one.
//!
//! The first, rough picture of a wish is finished even when there is a newer one, so that a hand that
//! keeps moving sees something; what refines it is not.

mod desk;
mod studio;

use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel};
use std::thread::JoinHandle;

use etendue::{Options, Progress};

use self::desk::{NewsSender, WorkerState};
use self::studio::PreviewRenderer;

pub(crate) use self::desk::{Kind, News, ScreenPicture, Task, Wake, Wish};

/// The thread, seen from the window.
#[derive(Debug)]
pub(crate) struct Worker {
    shared: Arc<WorkerState>,
    news: Receiver<News>,
    thread: Option<JoinHandle<()>>,
}

impl Worker {
    pub(crate) fn start(options: Options, wake: Wake) -> std::io::Result<Self> {
        let shared = Arc::new(WorkerState::default());
        let (to, news) = channel();
        let sender = NewsSender { to, wake };
        let mut studio = PreviewRenderer::new(options, sender, Arc::clone(&shared));
        let thread = std::thread::Builder::new()
            .name("render".to_owned())
            // Scenes are read by recursion.
            .stack_size(8 << 20)
            .spawn(move || studio.work())?;
        Ok(Self { shared, news, thread: Some(thread) })
    }

    /// Replaces the wish before.
    pub(crate) fn wish(&self, wish: Wish) {
        let mut desk = self.shared.desk();
        desk.wish = Some(wish);
        desk.refining.iter().for_each(Progress::cancel);
        drop(desk);
        self.shared.bell.notify_one();
    }

    pub(crate) fn ask(&self, task: Task) {
        let mut desk = self.shared.desk();
        desk.tasks.push_back(task);
        desk.refining.iter().for_each(Progress::cancel);
        drop(desk);
        self.shared.bell.notify_one();
    }

    /// Stops what is being done.
    pub(crate) fn cancel(&self) {
        let desk = self.shared.desk();
        desk.refining.iter().chain(&desk.working).for_each(Progress::cancel);
    }

    pub(crate) fn news(&self) -> impl Iterator<Item = News> + '_ {
        self.news.try_iter()
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        let mut desk = self.shared.desk();
        desk.closes = true;
        desk.refining.iter().chain(&desk.working).for_each(Progress::cancel);
        drop(desk);
        self.shared.bell.notify_one();
        if let Some(thread) = self.thread.take() {
            // A panic there was told already.
            let _ = thread.join();
        }
    }
}
