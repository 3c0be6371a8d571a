//! The built-in catalogue is read once, while the program is built: `effects.toml`, row by row, as MessagePack, which a process
//! reads in a tenth of the time. Nothing is checked or changed here: a test compares what comes of both (`model::catalogue`).

use std::error::Error;
use std::path::PathBuf;

fn main() -> Result<(), Box<dyn Error>> {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-changed=effects.toml");
    let out = PathBuf::from(std::env::var("OUT_DIR")?);
    let file: toml::Table = toml::from_str(&std::fs::read_to_string("effects.toml")?)?;
    let rows = file.get("effect").and_then(toml::Value::as_array).ok_or("effects.toml has no [[effect]]")?;
    let (mut bytes, mut ends) = (Vec::new(), Vec::new());
    for row in rows {
        let id = row.get("id").and_then(toml::Value::as_str).ok_or("a row of effects.toml has no id")?;
        bytes.extend(rmp_serde::to_vec_named(row)?);
        ends.push((id, bytes.len()));
    }
    std::fs::write(out.join("effects.msgpack"), &bytes)?;
    std::fs::write(out.join("effects_ends.rs"), format!("&{ends:?}"))?;
    Ok(())
}
