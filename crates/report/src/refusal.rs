use std::fmt;

/// Reason why something is not done: where, why, and what would do.
///
/// Written as `place: why`, with the remedy on a line of its own below it:
///
/// ```
/// # use etendue_report::Refusal;
/// let refusal = Refusal::new("180° is no angle of view").at("camera.fov").at("scene.json");
/// let text = refusal.hint("give less than 180°").to_string();
/// assert_eq!(text, "scene.json: camera.fov: 180° is no angle of view\nhint: give less than 180°");
/// assert_eq!(Refusal::from(text).remedy(), Some("give less than 180°"));
/// ```
///
/// Whoever knows no place says why in a text, with the remedy behind `\nhint: ` where there is one: whoever adds the
/// place makes a refusal of it, and so the remedy stays at the end, through errors that are texts alone, too.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Refusal(Box<Words>);

/// Words of a refusal, in a box: results that hardly ever are refusals stay small.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
struct Words {
    place: String,
    why: String,
    remedy: Option<String>,
}

/// Separator before a remedy.
const HINT: &str = "\nhint: ";

impl Refusal {
    /// A refusal of something whose place whoever asked knows. `why` may end in a remedy.
    #[must_use]
    pub fn new(why: impl Into<String>) -> Self {
        let why = why.into();
        let (why, remedy) = match why.split_once(HINT) {
            Some((why, remedy)) => (why.to_owned(), Some(remedy.to_owned())),
            None => (why, None),
        };
        Self(Box::new(Words { place: String::new(), why, remedy }))
    }

    /// Makes a refusal of an error: its message, and behind it those of its causes that it does not quote.
    #[must_use]
    pub fn of(error: &dyn std::error::Error) -> Self {
        let mut refusal = Self::new(error.to_string());
        let mut cause = error.source();
        while let Some(inner) = cause {
            let said = Self::new(inner.to_string());
            if !refusal.why().contains(said.why()) {
                refusal = refusal.and(": ").and(said.why());
                if let Some(remedy) = said.0.remedy {
                    refusal = refusal.hint(remedy);
                }
            }
            cause = inner.source();
        }
        refusal
    }

    /// Adds a place, which stands before those that it has: a file, a line, a key.
    #[must_use]
    pub fn at(mut self, place: impl fmt::Display) -> Self {
        let inner = std::mem::replace(&mut self.0.place, place.to_string());
        let outer = &mut self.0.place;
        if !outer.is_empty() && !inner.is_empty() {
            outer.push_str(": ");
        }
        outer.push_str(&inner);
        self
    }

    /// Returns the refusal without its place.
    #[must_use]
    pub fn without_place(mut self) -> Self {
        self.0.place.clear();
        self
    }

    /// Adds more words behind those that say why.
    #[must_use]
    pub fn and(mut self, words: &str) -> Self {
        self.0.why.push_str(words);
        self
    }

    /// Adds a remedy, below those that it has.
    #[must_use]
    pub fn hint(mut self, remedy: impl Into<String>) -> Self {
        let remedy = remedy.into();
        self.0.remedy = Some(match self.0.remedy.take() {
            Some(before) => before + HINT + &remedy,
            None => remedy,
        });
        self
    }

    /// Place of the fault; empty where that is not known.
    #[must_use]
    pub fn place(&self) -> &str {
        &self.0.place
    }

    /// Reason.
    #[must_use]
    pub fn why(&self) -> &str {
        &self.0.why
    }

    /// Remedy, if one is known.
    #[must_use]
    pub fn remedy(&self) -> Option<&str> {
        self.0.remedy.as_deref()
    }
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Words { place, why, remedy } = &*self.0;
        if !place.is_empty() {
            write!(f, "{place}: ")?;
        }
        f.write_str(why)?;
        match remedy {
            Some(remedy) => write!(f, "{HINT}{remedy}"),
            None => Ok(()),
        }
    }
}

impl std::error::Error for Refusal {}

impl From<String> for Refusal {
    fn from(why: String) -> Self {
        Self::new(why)
    }
}

impl From<&String> for Refusal {
    fn from(why: &String) -> Self {
        Self::new(why)
    }
}

impl From<&str> for Refusal {
    fn from(why: &str) -> Self {
        Self::new(why)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_remedy_stays_behind_all_that_is_added() {
        let inner = Refusal::new("no such file: \"a\"\nhint: did you mean \"b\"?");
        let outer = Refusal::from(inner.at("objects[0].file").to_string()).at("scene.json, line 3");
        let outer = outer.and(" (from here)").hint("leave it out");
        assert_eq!(
            outer.to_string(),
            "scene.json, line 3: objects[0].file: no such file: \"a\" (from here)\nhint: did you mean \"b\"?\
             \nhint: leave it out"
        );
        assert_eq!(Refusal::new("why").to_string(), "why");
        assert_eq!(
            Refusal::new("why").hint("do").at("a").without_place().to_string(),
            "why\nhint: do"
        );
        assert_eq!(Refusal::new("why").at("").at("b").at("a").to_string(), "a: b: why");
        assert_eq!(Refusal::from(outer.to_string()).remedy(), outer.remedy());
    }
}
