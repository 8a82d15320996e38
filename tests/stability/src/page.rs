//! The page of the documents.

use std::fmt::Write as _;

use crate::{METHODS, Outcome, Scale};

/// Path of the page, whatever folder the program is run from.
pub const PATH: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/measurements/stability.md");

const HEAD: &str = "\
# Stability

Every method taken to where it is known to fail: the regime, what must happen there, and what happens.
Written by the suite itself ([`tests/stability`](../../tests/stability)) with

```sh
make docs-stability
```

which runs each case at full scale; `cargo test -p etendue-stability` runs the same cases at a smaller
one, and fails when something that must happen does not. A known limit is a regime that is not mended:
what is asserted there is that it is no worse.
";

/// The page of what all cases, by method and name, came to.
#[must_use]
pub fn write(scale: Scale, ran: &[(&str, &str, Outcome)]) -> String {
    let found = |method: &str, case: &str| {
        let outcome = ran.iter().find(|(m, c, _)| (*m, *c) == (method, case));
        outcome.map(|(.., outcome)| cell(&outcome.to_string())).unwrap_or_default()
    };
    let mut page = HEAD.to_owned();
    let embree = etendue_accel::embree_version();
    let embree = embree.map_or_else(|error| error.to_string(), |version| version.to_string());
    let version = env!("CARGO_PKG_VERSION");
    let how = scale.pick("the tests' scale (`ARGS=--quick`)", "full scale");
    let _ = writeln!(page, "\nMeasured at {how} with etendue {version}, {embree}.");
    for method in METHODS {
        let _ = writeln!(page, "\n## {}\n", method.name);
        page.push_str("| case | regime | what must happen | what happens |\n|---|---|---|---|\n");
        for case in method.cases {
            let limit = if case.limit.is_some() { " (known limit)" } else { "" };
            let (regime, must) = (cell(case.regime), cell(case.must));
            let found = found(method.name, case.name);
            let _ = writeln!(page, "| `{}`{limit} | {regime} | {must} | {found} |", case.name);
        }
    }
    page.push_str("\n## Known limits\n\n");
    for method in METHODS {
        for case in method.cases {
            let Some(why) = case.limit else { continue };
            let found = found(method.name, case.name);
            let name = case.name.replace('_', " ");
            let _ = writeln!(page, "- **{}, {name}.** {why} Measured: {found}.", method.name);
        }
    }
    page
}

/// Text that stays within its cell.
fn cell(text: &str) -> String {
    text.replace('|', "\\|").replace('\n', " ")
}
