//! Where the normal approximation of the Poisson distribution fails: charts into the file that is
//! named, a table to standard output.
//!
//! ```sh
//! cargo run --release -p etendue-sensor --example approximation -- docs/images/normal-approximation.svg
//! ```

use etendue_sensor::approximation::{charts, table};

fn main() -> std::io::Result<()> {
    if let Some(path) = std::env::args_os().nth(1) {
        std::fs::write(path, charts())?;
    }
    print!("{}", table());
    Ok(())
}
