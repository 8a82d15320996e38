//! The program looks for Embree beside itself first, in `../lib/etendue`: what is unpacked anywhere runs.

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    if std::env::var("CARGO_CFG_TARGET_OS").as_deref() == Ok("linux") {
        // Of the older kind, which holds for what Embree itself asks for, too.
        println!(
            "cargo::rustc-link-arg-bins=-Wl,--disable-new-dtags,-rpath,$ORIGIN/../lib/etendue"
        );
    }
}
