//! Poses at which the user's own cycle measures the centre of a sphere: a table, and a CSV to be filled in.

use super::write_program::{say_separations, separates};
use super::{Answer, Args, Io};
use crate::axes::AxisMap;
use crate::design::questions::Questions;
use crate::diag::Result;
use crate::files;
use crate::report::fit::{number, table};
use crate::workflow::plan_next::Poses;
use comfy_table::Cell;
use serde_json::json;

/// Writes the CSV and says what the centres will tell.
pub(super) fn write_centres(args: &Args, name: &str, questions: &Questions, poses: &Poses, io: &Io) -> Result<Answer> {
    let file = args.out.join(format!("{name}.csv"));
    let axes: Vec<String> =
        poses.centres.first().map_or_else(Vec::new, |c| c.pose.iter().map(|(a, _)| a.to_string()).collect());
    let angles = |pose: &AxisMap| pose.iter().map(|(_, deg)| deg.to_string()).collect::<Vec<_>>();
    let mut text = format!("sphere,{},X,Y,Z\n", axes.join(","));
    for c in &poses.centres {
        text += &format!("{},{},,,\n", c.sphere, angles(&c.pose).join(","));
    }
    files::write_together(&[(file.clone(), text.as_bytes())])?;
    io.say(&questions.says);
    io.say("measure these centres with the cycle that measured the others; the sphere stays where it is:");
    let heads: Vec<String> = std::iter::once("sphere".to_owned())
        .chain(axes.iter().map(|a| format!("{a} (deg)")))
        .chain(["X", "Y", "Z"].map(|a| format!("{a} about (mm)")))
        .collect();
    let mut t = table(&heads.iter().map(String::as_str).collect::<Vec<_>>());
    for c in &poses.centres {
        let mut row = vec![Cell::new(&c.sphere)];
        row.extend(angles(&c.pose).into_iter().map(number));
        row.extend(c.expected_mm.iter().map(|mm| number(format!("{mm:.1}"))));
        t.add_row(row);
    }
    io.say(io.paper(false).plain(t.to_string()));
    io.say("X, Y and Z are axis positions of the spindle, relative to R. The ways between the poses are not proven");
    say_separations(&poses.separations, io);
    io.say(format!(
        "written: {}\nfill in X, Y and Z, add the rows to your file of centres in the order of its columns, and run `axiscal new --centres` again",
        file.display()
    ));
    let centres: Vec<_> = poses
        .centres
        .iter()
        .map(|c| json!({ "sphere": c.sphere, "pose": c.pose, "expected_mm": [c.expected_mm.x, c.expected_mm.y, c.expected_mm.z] }))
        .collect();
    io.answer(&json!({
        "format": "axiscal-next/1",
        "says": questions.says,
        "pairs": poses.separations,
        "separates": separates(&poses.separations),
        "centres": centres,
        "file": file.display().to_string(),
    }));
    Ok(Answer::Done)
}
