//! Choice among several kinds that a value may be, and the message when it is none.

use serde_json::{Map, Value};

use crate::file::PathStep;
use crate::words::known_words;

use super::{
    Checker, Outcome, Problem, ScenePath, keys_of, nearest, problem, show, suggest, wrong_kind,
};

/// The key by which a branch says what it is, and its word there.
#[derive(Clone, Copy)]
struct KindTag<'a> {
    key: &'a str,
    word: &'a str,
}

impl<'a> Checker<'a> {
    /// Goes on in the branch that was meant: by tag, by the kind of value, or by the keys.
    pub(super) fn choose(&self, branches: &'a [Value], value: &Value, path: &ScenePath) -> Outcome {
        let branches: Vec<&Value> = branches.iter().map(|branch| self.resolve(branch)).collect();
        let fitting: Vec<&Value> =
            branches.iter().copied().filter(|branch| self.may_be(branch, value)).collect();
        let considered = if fitting.is_empty() { &branches } else { &fitting };
        let words: Vec<&Value> = considered.iter().filter_map(|b| b.get("const")).collect();
        if words.len() == considered.len() {
            return Self::no_such_word(&words, value, path);
        }
        match (&fitting[..], value) {
            ([], _) => {
                let kinds: Vec<&str> = branches.iter().flat_map(|b| self.kinds(b)).collect();
                problem(path, wrong_kind(value, &kinds))
            }
            ([branch], _) => self.visit(branch, value, path),
            (objects, Value::Object(members)) => self.choose_object(objects, members, path),
            (several, _) => {
                // Same kind, different contents: right when one of them allows it.
                let mut first = Ok(());
                for branch in several {
                    match self.visit(branch, value, path) {
                        Ok(()) => return Ok(()),
                        fault if first.is_ok() => first = fault,
                        _ => {}
                    }
                }
                first
            }
        }
    }

    fn choose_object(
        &self,
        branches: &[&'a Value],
        members: &Map<String, Value>,
        path: &ScenePath,
    ) -> Outcome {
        let tag_of = |branch: &'a Value| {
            let properties = branch.get("properties").and_then(Value::as_object)?;
            properties.iter().find_map(|(key, schema)| {
                schema.get("const").and_then(Value::as_str).map(|word| KindTag { key, word })
            })
        };
        let tags: Vec<Option<KindTag<'_>>> = branches.iter().map(|branch| tag_of(branch)).collect();
        for (branch, tag) in branches.iter().zip(&tags) {
            if let Some(KindTag { key, word }) = tag
                && members.get(*key).and_then(Value::as_str) == Some(word)
            {
                return match branch.get("oneOf").and_then(Value::as_array) {
                    // A choice within the choice, such as the shape of an aperture.
                    Some(inner) => {
                        let inner: Vec<&Value> = inner.iter().map(|b| self.resolve(b)).collect();
                        self.choose_object(&inner, members, path)
                    }
                    None => self
                        .object(branch, members, path)
                        .map_err(|found| at_home_elsewhere(found, path, branch, branches, word)),
                };
            }
        }
        let named = tags.iter().flatten().find(|tag| members.contains_key(tag.key));
        if let Some(KindTag { key, .. }) = named {
            let words = tags.iter().flatten().filter(|tag| tag.key == *key).map(|tag| tag.word);
            let given = &members[*key];
            let known = suggest(given.as_str().unwrap_or_default(), words);
            return problem(&path.key(key), format!("unknown {key} {}{known}", show(given)));
        }
        self.choose_by_keys(branches, &tags, members, path)
    }

    /// Chooses a branch where no tag was given: the branch with the most of these keys, and of them
    /// the one that lacks the least.
    fn choose_by_keys(
        &self,
        branches: &[&'a Value],
        tags: &[Option<KindTag<'a>>],
        members: &Map<String, Value>,
        path: &ScenePath,
    ) -> Outcome {
        let score = |branch: &Value| {
            let has = |key: &String| branch.get("properties").and_then(|p| p.get(key)).is_some();
            let required = branch.get("required").and_then(Value::as_array);
            let lacking = required
                .into_iter()
                .flatten()
                .filter_map(Value::as_str)
                .filter(|key| !members.contains_key(*key))
                .count();
            (members.keys().filter(|key| has(key)).count(), std::cmp::Reverse(lacking))
        };
        let untagged = branches.iter().zip(tags).filter(|(_, tag)| tag.is_none());
        let best = untagged.map(|(branch, _)| *branch).max_by_key(|branch| score(branch));
        let keys: Vec<&str> = tags.iter().flatten().map(|tag| tag.key).collect();
        match (best, keys.first()) {
            (Some(best), _) if score(best).1.0 == 0 || keys.is_empty() => {
                self.object(best, members, path)
            }
            (_, Some(tag)) => self.say_what_it_is(branches, tag, members, path),
            (best, None) => best.map_or(Ok(()), |best| self.object(best, members, path)),
        }
    }

    /// That an object says not which of several things it is, with all ways to say so; and with the
    /// key that was probably meant for one.
    fn say_what_it_is(
        &self,
        branches: &[&'a Value],
        tag: &'a str,
        members: &Map<String, Value>,
        path: &ScenePath,
    ) -> Outcome {
        let mut ways = Vec::new();
        let mut words = Vec::new();
        // By which words or keys the branches are told apart.
        for branch in branches {
            let word = branch.pointer(&format!("/properties/{tag}/const")).and_then(Value::as_str);
            let required = branch.pointer("/required/0").and_then(Value::as_str);
            match (word, required) {
                (Some(word), _) => words.push(format!("`{word}`")),
                (None, Some(key)) => ways.push(format!("`{key}`")),
                _ => {}
            }
        }
        ways.push(format!("`{tag}` (one of {})", words.join(", ")));
        let ways = ways.join(" or ");
        // A key that none of them has is the first suspect.
        let known: Vec<&str> = branches.iter().flat_map(|branch| keys_of(branch)).collect();
        match members.keys().find(|key| !known.contains(&key.as_str())) {
            Some(key) => {
                let near = match nearest(key, std::iter::once(tag).chain(known)) {
                    Some(near) => format!("did you mean `{near}`? give"),
                    None => "give".to_owned(),
                };
                let reason = format!("unknown key\nhint: {near} the object {ways}");
                problem(&path.key(key), reason)
            }
            None => problem(path, format!("says not what it is\nhint: give it {ways}")),
        }
    }

    pub(super) fn no_such_word(words: &[&Value], value: &Value, path: &ScenePath) -> Outcome {
        if words.contains(&value) {
            return Ok(());
        }
        let known = words.iter().filter_map(|word| word.as_str());
        let given = value.as_str().unwrap_or_default();
        problem(path, format!("{} is not known here{}", show(value), suggest(given, known)))
    }
}

/// A key that a branch refuses and another one knows does not go with the word that chose the branch.
fn at_home_elsewhere(
    found: Problem,
    path: &ScenePath,
    branch: &Value,
    branches: &[&Value],
    word: &str,
) -> Problem {
    let inside = found.path.inside(path).filter(|_| found.is_unknown_key);
    match inside.as_ref().map(ScenePath::steps) {
        Some([PathStep::Key(key)]) if branches.iter().any(|b| keys_of(b).any(|k| k == key)) => {
            let known = known_words(keys_of(branch));
            let reason = format!("`{key}` does not go with `{word}`\nhint: {known}");
            Problem { reason, ..found }
        }
        _ => found,
    }
}
