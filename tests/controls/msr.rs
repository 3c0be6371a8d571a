//! Inspection results (.msr): the public files beside the project with what their own library's tests expect of each, and
//! the frame rule on all points. Files of the project's own with the same forms and faults are in `tests/logs`.
//!
//! The public files are Autodesk's (PowerShapeAndPowerMillAPI, MIT) and no part of the project; where they are missing
//! the test says so. `AXISCAL_REQUIRE_SHARED_DATA=1` makes that a failure.

use axiscal::diag::Finding;
use axiscal::log::points::{Points, PointsForm, parse};
use std::path::PathBuf;

fn form() -> PointsForm {
    PointsForm::built_in().unwrap().into_iter().find(|f| f.name == "msr").unwrap()
}

/// The folder of the public files.
fn public() -> Option<PathBuf> {
    let root = std::env::var_os("AXISCAL_SHARED_DATA")
        .map_or_else(|| PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../shared/data"), PathBuf::from);
    let folder = root.join("msr");
    if folder.is_dir() {
        return Some(folder);
    }
    let missing = format!("left out: {} is not there (AXISCAL_SHARED_DATA names another place)", folder.display());
    assert!(std::env::var_os("AXISCAL_REQUIRE_SHARED_DATA").is_none(), "{missing}");
    println!("{missing}");
    None
}

fn read(folder: &std::path::Path, name: &str, run: Option<usize>) -> Result<(Points, Vec<Finding>), Vec<Finding>> {
    let bytes = std::fs::read(folder.join(name)).unwrap_or_else(|e| panic!("{name}: {e}"));
    parse(&bytes, name, &form(), run).map(|(points, f)| (points, f.0)).map_err(|f| f.0)
}

/// What is expected of a file: so many points, or a refusal whose first error has this code, place and words.
enum Outcome {
    Points(usize),
    Refused(&'static str, &'static str, &'static str),
}
use Outcome::{Points as Read, Refused};

#[test]
fn the_public_files_give_what_their_own_tests_expect() {
    let Some(folder) = public() else { return };
    // controllers' survey: file, expected outcome; places by hand from the files
    let cases = [
        ("Culture-Agnostic.msr", Read(1)),
        ("Empty-File.msr", Refused("log::empty", "", "the log is empty")),
        ("Extra-Ordinate.msr", Refused("log::word_twice", "36:28", "the word Y appears twice")),
        ("G330-Detransformed.msr", Read(81)),
        ("G330-Untransformed.msr", Read(81)),
        (
            "Line-Number-Error.msr",
            Refused("log::order", "9:1", "the centre is of point N3, the nominal point before it is N2"),
        ),
        ("Missing-G800-Line.msr", Refused("log::order", "12:1", "the line G800 N4 is missing before this one")),
        ("Missing-G801-Line.msr", Refused("log::order", "19:1", "the line G801 N7 is missing")),
        ("No-Data.msr", Refused("log::nothing", "1:1", "the file holds no point")),
        ("Odd-Characters.msr", Refused("log::no_text", "7:6", "byte 0xC6 at offset")),
        ("TwoEnds.msr", Refused("log::blocks", "14:1", "a second START in the file")),
        // its START is missing: read all the same, and said
        ("TwoEndsOK.msr", Read(6)),
        ("TwoStarts.msr", Refused("log::blocks", "14:1", "a second START in the file")),
        ("TwoStartsOK.msr", Read(6)),
    ];
    let mut wrong = Vec::new();
    for (name, expected) in &cases {
        let found = read(&folder, name, None);
        let right = match (expected, &found) {
            (Read(n), Ok((points, findings))) => {
                let said: Vec<&str> = findings.iter().map(|f| f.code).collect();
                // one lacks its START, one its END: read all the same, and said
                let (expected, ended): (&[&str], bool) = match *name {
                    "TwoEndsOK.msr" => (&["log::no_head"], true),
                    "TwoStartsOK.msr" => (&["log::truncated"], false),
                    _ => (&[], true),
                };
                points.points.len() == *n && points.ended == ended && said == expected
            }
            (Refused(code, place, words), Err(findings)) => {
                let first = findings.iter().find(|f| f.severity == axiscal::diag::Severity::Error).unwrap();
                let at = first.place().unwrap_or_default();
                first.code == *code && at.ends_with(place) && first.message.contains(words) && first.help.is_some()
            }
            _ => false,
        };
        if !right {
            let found =
                found.map(|(p, f)| (p.points.len(), p.ended, f.iter().map(ToString::to_string).collect::<Vec<_>>()));
            wrong.push(format!(
                "{name}: {:?}",
                found.map_err(|f| f.iter().map(ToString::to_string).collect::<Vec<_>>())
            ));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    let mut there: Vec<String> = std::fs::read_dir(&folder)
        .unwrap()
        .map(|e| e.unwrap().file_name().to_string_lossy().into_owned())
        .filter(|n| n.ends_with(".msr"))
        .collect();
    there.sort();
    assert_eq!(there, cases.map(|(name, _)| name), "every file has its line here");
    // the offset of the odd byte is that of the file
    let odd = read(&folder, "Odd-Characters.msr", None).unwrap_err();
    let bytes = std::fs::read(folder.join("Odd-Characters.msr")).unwrap();
    let at = bytes.iter().position(|b| *b >= 0x80).unwrap();
    assert!(odd.iter().any(|f| f.message.contains(&format!("byte 0xC6 at offset {at} "))), "{odd:?}");
    // several blocks are offered
    for name in ["TwoEnds.msr", "TwoStarts.msr"] {
        let counts = [1, 2].map(|run| read(&folder, name, Some(run)).unwrap().0.points.len());
        assert_eq!(counts, [6, 35], "{name}");
    }
    let second = read(&folder, "TwoEnds.msr", Some(2)).unwrap().0;
    assert_eq!(second.runs.iter().filter(|r| r.taken).map(|r| r.number).collect::<Vec<_>>(), [2]);
}

#[test]
fn the_frame_of_a_point_is_turned_as_the_public_twin_files_say() {
    let Some(folder) = public() else { return };
    let turned = read(&folder, "G330-Untransformed.msr", None).unwrap().0;
    let part = read(&folder, "G330-Detransformed.msr", None).unwrap().0;
    assert_eq!((turned.points.len(), part.points.len()), (81, 81));
    let mut orientations: Vec<[f64; 3]> = turned.points.iter().map(|p| p.orientation_deg).collect();
    orientations.dedup();
    assert_eq!(orientations, [[-45.0, -72.766, 0.0], [160.0, -87.234, 180.0], [0.0, -22.766, 0.0]]);
    let (mut worst_centre, mut worst_nominal) = (0.0f64, 0.0f64);
    for (from, to) in turned.points.iter().zip(&part.points) {
        assert_eq!(from.number, to.number);
        worst_centre = worst_centre.max((from.in_part(&from.centre) - to.centre).amax());
        worst_nominal = worst_nominal.max((from.in_part(&from.nominal) - to.nominal).amax());
    }
    println!("largest difference: centres {worst_centre:.1e} mm, nominal points {worst_nominal:.1e} mm");
    assert!(worst_centre <= 1e-4, "centres: {worst_centre} mm");
    assert!(worst_nominal <= 1e-3, "nominal points have three decimals: {worst_nominal} mm");
}
