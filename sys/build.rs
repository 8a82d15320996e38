//! Finds Embree, binds to the header that is installed, links the library beside it.

use std::path::{Path, PathBuf};

/// A library and the header that describes it.
struct Library {
    major: u32,
    header: PathBuf,
}

const NO_EMBREE: &str = "Library was not found: install it with `apt install libembree-dev` (or set \
    EMBREE_DIR to a folder with include/ and lib/), or build without it: `cargo build -p etendue-cli \
    --no-default-features`";

const NO_LIBCLANG: &str = "libclang, which reads Library's header, was not found: install it with \
    `apt install libclang-dev` (or set LIBCLANG_PATH to its folder), or build without Library: \
    `cargo build -p etendue-cli --no-default-features`";

fn main() {
    println!("cargo::rustc-check-cfg=cfg(embree3, embree4)");
    println!("cargo::rerun-if-env-changed=EMBREE_DIR");
    println!("cargo::rerun-if-env-changed=LIBCLANG_PATH");
    if let Err(message) = build() {
        println!("cargo::error={message}");
    }
}

fn build() -> Result<(), String> {
    let embree = match std::env::var_os("EMBREE_DIR") {
        Some(dir) => given(Path::new(&dir))?,
        None => ["/usr/include", "/usr/local/include"]
            .iter()
            .find_map(|include| find(Path::new(include)))
            .ok_or(NO_EMBREE)?,
    };
    generate(&embree)?;
    println!("cargo::rustc-cfg=embree{}", embree.major);
    println!("cargo::metadata=major={}", embree.major);
    println!("cargo::rustc-link-lib=embree{}", embree.major);
    Ok(())
}

/// The Embree of the folder that `EMBREE_DIR` names, which must have one.
fn given(dir: &Path) -> Result<Library, String> {
    let embree = find(&dir.join("include"))
        .ok_or_else(|| format!("EMBREE_DIR={}: {NO_EMBREE}", dir.display()))?;
    for lib in ["lib", "lib64"].map(|lib| dir.join(lib)).iter().filter(|lib| lib.is_dir()) {
        println!("cargo::rustc-link-search=native={}", lib.display());
    }
    Ok(embree)
}

/// The newest Embree with a header below `include`.
fn find(include: &Path) -> Option<Library> {
    [4, 3]
        .map(|major| Library { major, header: include.join(format!("embree{major}/rtcore.h")) })
        .into_iter()
        .find(|embree| embree.header.is_file())
}

/// Writes the bindings. At build time, because the size of a hit record depends on how the
/// installed Embree was configured; C's enums become integer newtypes, so that a value this header
/// does not list is not undefined behaviour. Bindgen asserts every size, alignment and offset.
fn generate(embree: &Library) -> Result<(), String> {
    clang_sys::load().map_err(|_| NO_LIBCLANG)?;
    let header = embree.header.to_str().ok_or("the path of Embree's header is not UTF-8")?;
    let out = std::env::var("OUT_DIR").map_err(|error| format!("OUT_DIR: {error}"))?;
    bindgen::builder()
        .header(header)
        .allowlist_item("(rtc|RTC).*")
        .newtype_global_enum("RTC.*")
        .prepend_enum_name(false)
        .derive_default(true)
        .no_default("RTC(IntersectArguments|OccludedArguments|RayQueryContext)")
        .generate_cstr(true)
        .rust_edition(bindgen::RustEdition::Edition2024)
        .formatter(bindgen::Formatter::None)
        .parse_callbacks(Box::new(bindgen::CargoCallbacks::new()))
        .generate()
        .map_err(|error| format!("{header} could not be read: {error}"))?
        .write_to_file(Path::new(&out).join("bindings.rs"))
        .map_err(|error| format!("{out}/bindings.rs: {error}"))
}
