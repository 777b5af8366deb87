//! Promise: `include/stylet.h` is up to date with the library.

use std::path::Path;

fn generated() -> String {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let config = cbindgen::Config::from_file(root.join("cbindgen.toml")).expect("a configuration");
    let sources = cbindgen::Builder::new()
        .with_config(config)
        .with_src(root.join("src/lib.rs"))
        .with_src(root.join("src/tissue.rs"));
    let header = sources.generate().expect("a header");
    let mut text = Vec::new();
    header.write(&mut text);
    String::from_utf8(text).expect("text")
}

#[test]
fn the_committed_header_is_up_to_date() {
    let committed = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("include/stylet.h"));
    assert!(
        committed.expect("a header") == generated(),
        "include/stylet.h is out of date: cargo test -p stylet-capi --test header -- --ignored"
    );
}

#[test]
#[ignore = "writes the header"]
fn write_the_header() {
    std::fs::write(Path::new(env!("CARGO_MANIFEST_DIR")).join("include/stylet.h"), generated())
        .expect("written");
}
