//! Machines that are not built in, so that every row of the catalogue applies somewhere: one rotary axis only, a head with
//! A or C, a table that moves along one axis.

use axiscal::diag::source;
use axiscal::machine::{self, Machine};

/// Name, workpiece side and tool side from the base on, what bears the blocks.
const CHAINS: [(&str, &str, &str, &str); 5] = [
    ("planer-with-a-head", "X", "YZA", "table"),
    ("cradle-b-on-y", "YB", "XZ", "B"),
    ("dividing-head", "A", "XYZ", "A"),
    ("fork-head", "", "XYZCA", "table"),
    ("turntable-only", "XYC", "Z", "C"),
];

/// The built-in machines and these.
pub fn all_machines() -> Vec<Machine> {
    let mut all = super::machines();
    all.extend(machine::load(&source("more machines", text())).unwrap().0);
    all
}

fn text() -> String {
    let probe = machine::BUILT_IN.split("[machine.probe]").nth(1).unwrap().split("[[").next().unwrap();
    let mut out = "format = \"axiscal-machines/1\"\n".to_owned();
    for (name, workpiece, tool, carrier) in CHAINS {
        let letters: String = format!("{workpiece}{tool}");
        let origin: Vec<String> = letters.chars().map(|c| format!("{c} = 0.0")).collect();
        out += &format!(
            "\n[[machine]]\nname = \"{name}\"\nsays = \"for tests\"\norigin = {{ {} }}\n",
            origin.join(", ")
        );
        let mut parents = Vec::new();
        for side in [workpiece, tool] {
            let mut parent = "base".to_owned();
            for c in side.chars() {
                out += &axis(c, &parent);
                parent = c.to_string();
            }
            parents.push(parent);
        }
        out += &format!(
            "[machine.workpiece]\nparent = \"{}\"\n[machine.tool]\nparent = \"{}\"\npivot = [0.0, 0.0, 0.0]\n\
             direction = [0.0, 0.0, 1.0]\nlength = 150.0\nspindle_sense = 1\n[machine.reference]\n\
             pivot = [0.0, 0.0, 0.0]\nball = [0.0, 0.0, -150.0]\ntable = [0.0, 0.0, -235.0]\n[machine.probe]{probe}\n\
             [[machine.mounting]]\nname = \"plate\"\nsays = \"two blocks\"\ncarrier = \"{carrier}\"\n\
             riser = {{ height = 60.0, size = [10.0, 10.0] }}\n",
            parents[0], parents[1]
        );
        for (block, x, y) in [("x+", 40.0, 5.0), ("y-", -10.0, -35.0)] {
            out += &format!(
                "[[machine.mounting.block]]\nname = \"{block}\"\ncentre = [{x:?}, {y:?}, -150.0]\nsize = [10.0, 12.0, 14.0]\n"
            );
        }
    }
    out
}

fn axis(letter: char, parent: &str) -> String {
    let along = "XYZABC".find(letter).unwrap() % 3;
    let direction: Vec<&str> = (0..3).map(|i| if i == along { "1.0" } else { "0.0" }).collect();
    let (kind, point) =
        if letter < 'X' { ("rotary", "point = [0.0, 0.0, -60.0]\nsense = 1\n") } else { ("linear", "") };
    format!(
        "[[machine.axis]]\nname = \"{letter}\"\nparent = \"{parent}\"\nkind = \"{kind}\"\ndirection = [{}]\n{point}range = [-400.0, 400.0]\n",
        direction.join(", ")
    )
}
