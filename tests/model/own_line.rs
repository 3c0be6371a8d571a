//! A rotary axis turns about its own line: ten readings worked out by hand, for the virtual machine and for the model.
//!
//! The virtual machine and the model have no arithmetic in common, but whoever wrote both could have misunderstood the
//! same sentence twice. So the expected numbers below come from plane geometry on paper, each with its way, and not from
//! either program.
//!
//! The machine: a table whose first axis passes through (0, 0, -250) and whose C line passes 35 mm beside it, through
//! (0, 35). Its reference point is (0, 0, -250), on no line of C. One block of 10 mm edges stands on C with its centre at
//! (0, 5, -202.684): 30 mm from C's line towards -Y, 47.316 mm above the first axis. The ball's radius is 3 mm, so that
//! its centre stays 8 mm from the block's centre plane at contact.
//!
//! With ω = 1 mrad: tan ω = 0.001 000 000 333, 1/cos ω = 1.000 000 500. A turn by ω of a plane whose distance from the
//! line is h, touched at a distance a along the plane from the foot of that line, is met at h / cos ω + a · tan ω: the
//! reading (met less nominal, outwards) is h · (1/cos ω - 1) + a · tan ω.

use crate::common;
use axiscal::axes::AxisName;
use axiscal::diag::source;
use axiscal::machine::{self, Machine};
use axiscal::model::catalogue::Catalogue;
use axiscal::model::data::{Run, assemble};
use axiscal::model::predict::Model;
use axiscal::program::plan::Plan;
use axiscal::simulate::{self, scenario};
use common::matched;
use serde_json::json;

/// 1 mrad in degrees, as `zero-*` are given.
const MRAD_DEG: f64 = 0.057_295_779_513_082_32;

/// Half of the last digit that is worked out below, mm.
const BY_HAND_MM: f64 = 6e-9;

/// The table of the file's head: `first` is the first rotary axis (letter, direction), `sense_c` the sense of C.
fn table(first: (&str, [f64; 3]), sense_c: i32) -> Machine {
    let (letter, d) = first;
    let text = format!(
        r#"
format = "axiscal-machines/1"
[[machine]]
name = "by-hand"
says = "a table whose axes do not meet"
origin = {{ X = 0.0, Y = 0.0, Z = 0.0, {letter} = 0.0, C = 0.0 }}
[[machine.axis]]
name = "{letter}"
parent = "base"
kind = "rotary"
direction = [{}, {}, {}]
point = [0.0, 0.0, -250.0]
sense = 1
range = [-180.0, 180.0]
indexing_repeatability_um = 0.5
[[machine.axis]]
name = "C"
parent = "{letter}"
kind = "rotary"
direction = [0.0, 0.0, 1.0]
point = [0.0, 35.0, -250.0]
sense = {sense_c}
range = [-360.0, 360.0]
indexing_repeatability_um = 0.5
[[machine.axis]]
name = "X"
parent = "base"
kind = "linear"
direction = [1.0, 0.0, 0.0]
range = [-300.0, 300.0]
[[machine.axis]]
name = "Y"
parent = "X"
kind = "linear"
direction = [0.0, 1.0, 0.0]
range = [-300.0, 300.0]
[[machine.axis]]
name = "Z"
parent = "Y"
kind = "linear"
direction = [0.0, 0.0, 1.0]
range = [-200.0, 350.0]
[machine.workpiece]
parent = "C"
[machine.tool]
parent = "Z"
pivot = [0.0, 0.0, 0.0]
direction = [0.0, 0.0, 1.0]
length = 202.684
spindle_sense = 1
[machine.reference]
pivot = [0.0, 0.0, -250.0]
ball = [0.0, 0.0, -202.684]
table = [0.0, 0.0, -267.684]
[machine.probe]
ball_radius = 3.0
stem_radius = 1.5
stem_length = 75.0
body_radius = 20.0
body_length = 60.0
head_radius = 50.0
repeatability_um = 1.0
overtravel = 4.0
approach = 2.0
search = 2.0
clearance = 0.3
placement_tolerance = 1.0
fast_feed = 300.0
slow_feed = 60.0
position_feed = 1500.0
back_off = 0.5
"#,
        d[0], d[1], d[2]
    );
    machine::load(&source("by-hand", text)).unwrap().0.remove(0)
}

/// One touch of the block's face with `normal`, at the middle of the face, with C at `c_deg` and the first axis at 0. The
/// ball's nominal place (mm in R) and the outward direction in R are the reader's own.
struct ByHand {
    /// What is planted, as a scenario says it.
    planted: &'static str,
    /// Effect and its values in the order of its parameters, for the model.
    effect: &'static str,
    theta: Vec<f64>,
    normal: [f64; 3],
    c_deg: f64,
    /// Nominal centre of the ball at contact, mm in R.
    ball: [f64; 3],
    /// Outward direction of the face, in R.
    outward: [f64; 3],
    /// The reading, mm.
    reading_mm: f64,
}

impl ByHand {
    fn check(&self, machine: &Machine, first: &str) {
        let at = |off: f64| {
            let ball: Vec<f64> = (0..3).map(|i| self.ball[i] + off * self.outward[i]).collect();
            // the ball stands at (X, Y, Z - 202.684)
            json!({ "X": ball[0], "Y": ball[1], "Z": ball[2] + 202.684 })
        };
        let centre = [0.0, 5.0, -202.684];
        let point: Vec<f64> = (0..3).map(|i| centre[i] + 5.0 * self.normal[i]).collect();
        let plan = json!({
            "format": "axiscal-plan/1", "machine": "by-hand", "program": "by-hand",
            "ball_radius_mm": 3.0, "tool_length_mm": 202.684,
            "blocks": [ { "name": "y-", "carrier": "C", "centre": centre, "size": [10.0, 10.0, 10.0] } ],
            "touches": [ { "id": 1, "stage": "by-hand", "repeat": 1, "carrier": "C", "block": "y-", "face": "",
                "point": point, "normal": self.normal, "pose": { first: 0.0, "C": self.c_deg },
                "start": at(2.0), "nominal": at(0.0), "end": at(-2.0) } ],
        });
        let plan: Plan = serde_json::from_value(plan).unwrap();
        let scenario = scenario::parse(&source("by-hand", self.planted), machine).unwrap().0;
        let (raw, _) = simulate::run(machine, &plan, &scenario, None).unwrap();
        let touch = matched(&raw[0]);
        let off = touch.position.xyz_mm() - plan.touches[0].nominal_position().xyz_mm();
        let reading = off.dot(&nalgebra::Vector3::from(self.outward));
        assert!(
            (reading - self.reading_mm).abs() < BY_HAND_MM,
            "virtual machine, {}: {reading:.9} mm, by hand {:.9}",
            self.planted,
            self.reading_mm
        );
        // the model finds no gap at a log that shows the reading by hand
        let mut by_hand = touch.clone();
        by_hand.position = plan.touches[0].nominal_position();
        for (i, letter) in ["X", "Y", "Z"].iter().enumerate() {
            let name = AxisName::from_letter(letter.chars().next().unwrap()).unwrap();
            by_hand.position.set(name, by_hand.position.get(name) + self.reading_mm * self.outward[i]);
        }
        let data = assemble(machine, &[Run { plan: &plan, touches: &[by_hand], mounting: None, started_s: None }]);
        let catalogue = Catalogue::built_in().unwrap();
        let effect = catalogue.get(self.effect, machine).unwrap();
        let model = Model::new(machine, &[effect], &data.set_ups, machine.reference.pivot);
        let gap = model.gap(&data.observations[0], &self.theta);
        assert!(gap.abs() < BY_HAND_MM, "model, {}: {gap:e} mm", self.planted);
    }
}

const X: [f64; 3] = [1.0, 0.0, 0.0];
const MINUS_X: [f64; 3] = [-1.0, 0.0, 0.0];
const Y: [f64; 3] = [0.0, 1.0, 0.0];
const MINUS_Y: [f64; 3] = [0.0, -1.0, 0.0];
const Z: [f64; 3] = [0.0, 0.0, 1.0];

#[test]
fn ten_readings_by_hand() {
    let along_a = ("A", [1.0, 0.0, 0.0]);
    let flat = table(along_a, 1);
    let zero_c = "[effects.zero-c]\nEC0C = { value = 1.0, unit = \"mrad\" }";

    // 1. C = 0, face +X. The plane x = 8 is 8 mm from C's line; the ball touches it 30 mm towards -Y of the foot of that
    //    line. The table turns left by ω: the face there goes to +X by 30 tan ω. 8 · 5.00e-7 + 30 · 0.001 000 000 333
    //    = 0.000 004 000 + 0.030 000 010. About the reference point (5 mm beside the block) it would be -0.005.
    ByHand {
        planted: zero_c,
        effect: "zero-c",
        theta: vec![MRAD_DEG],
        normal: X,
        c_deg: 0.0,
        ball: [8.0, 5.0, -202.684],
        outward: X,
        reading_mm: 0.030_004_010,
    }
    .check(&flat, "A");

    // 2. C = 90: the block has gone from 30 mm on the -Y side to 30 mm on the +X side of C's line, its face +X looks to
    //    +Y. In the table's own frame nothing has changed: the same reading, along +Y.
    ByHand {
        planted: zero_c,
        effect: "zero-c",
        theta: vec![MRAD_DEG],
        normal: X,
        c_deg: 90.0,
        ball: [30.0, 43.0, -202.684],
        outward: Y,
        reading_mm: 0.030_004_010,
    }
    .check(&flat, "A");

    // 3. C = 0, upper face: it moves in its own plane.
    ByHand {
        planted: zero_c,
        effect: "zero-c",
        theta: vec![MRAD_DEG],
        normal: Z,
        c_deg: 0.0,
        ball: [0.0, 5.0, -194.684],
        outward: Z,
        reading_mm: 0.0,
    }
    .check(&flat, "A");

    // 4. zero-a, upper face: the plane of the ball is 55.316 mm above A's line, touched 5 mm towards +Y of it; a turn
    //    right-handed about +X lifts +Y: 55.316 · 5.00e-7 + 5 · tan ω = 0.000 027 658 + 0.005 000 002.
    ByHand {
        planted: "[effects.zero-a]\nEA0A = { value = 1.0, unit = \"mrad\" }",
        effect: "zero-a",
        theta: vec![MRAD_DEG],
        normal: Z,
        c_deg: 0.0,
        ball: [0.0, 5.0, -194.684],
        outward: Z,
        reading_mm: 0.005_027_660,
    }
    .check(&flat, "A");

    // 5. zero-a, face -Y: the ball's plane y = -3 is 3 mm from A's line, touched 47.316 mm above it; what is above goes
    //    to -Y, outwards: 3 · 5.00e-7 + 47.316 · tan ω = 0.000 001 500 + 0.047 316 016.
    ByHand {
        planted: "[effects.zero-a]\nEA0A = { value = 1.0, unit = \"mrad\" }",
        effect: "zero-a",
        theta: vec![MRAD_DEG],
        normal: MINUS_Y,
        c_deg: 0.0,
        ball: [0.0, -3.0, -202.684],
        outward: MINUS_Y,
        reading_mm: 0.047_317_516,
    }
    .check(&flat, "A");

    // 6. positioning-c-1 with a cosine of 1000 µrad: at C = 180 the table stands back by 1 mrad. As in 1 with -ω:
    //    0.000 004 000 - 0.030 000 010, along the face's normal, which looks to -X. The block stands at y = 35 + 30.
    ByHand {
        planted: "[effects.positioning-c-1]\nECC1c = 1000.0",
        effect: "positioning-c-1",
        theta: vec![1000.0, 0.0],
        normal: X,
        c_deg: 180.0,
        ball: [-8.0, 65.0, -202.684],
        outward: MINUS_X,
        reading_mm: -0.029_996_010,
    }
    .check(&flat, "A");

    // 7. C counts the other way round (sense -1): C = 90 turns the table right-handed by -90, the block goes to the -X
    //    side, its face +X looks to -Y. An error is where the real part stands, right-handed in R, whatever the sense: 1.
    let backwards = table(along_a, -1);
    ByHand {
        planted: zero_c,
        effect: "zero-c",
        theta: vec![MRAD_DEG],
        normal: X,
        c_deg: 90.0,
        ball: [-30.0, 27.0, -202.684],
        outward: MINUS_Y,
        reading_mm: 0.030_004_010,
    }
    .check(&backwards, "A");

    // 8. tilt-c-1: C leans about X by 1 mrad, about the point of its own line at the ball's height, (0, 35, -202.684).
    //    Upper face: 8 mm above that point, touched 30 mm towards -Y of it; +Y is lifted, so -Y sinks:
    //    0.000 004 000 - 0.030 000 010.
    ByHand {
        planted: "[effects.tilt-c-1]\nEAC1c = 1000.0",
        effect: "tilt-c-1",
        // the last is the lever arm
        theta: vec![1000.0, 0.0, 0.0, 0.0, 0.0],
        normal: Z,
        c_deg: 0.0,
        ball: [0.0, 5.0, -194.684],
        outward: Z,
        reading_mm: -0.029_996_010,
    }
    .check(&flat, "A");

    // 9. The first axis is B, inclined at 45° between Y and Z, direction d = (0, 1, 1)/√2. zero-b turns about that line,
    //    not about Y. Face +X, ball at (8, 5, 47.316) from the line's point: the part of (0, 5, 47.316) that a turn about
    //    d moves along X is d × p = (47.316 - 5)/√2 = 29.921 930 55 along +X. 8 · 5.00e-7 + 29.921 930 55 · tan ω
    //    = 0.000 004 000 + 0.029 921 941.
    let inclined = ("B", [0.0, std::f64::consts::FRAC_1_SQRT_2, std::f64::consts::FRAC_1_SQRT_2]);
    let nutating = table(inclined, 1);
    ByHand {
        planted: "[effects.zero-b]\nEB0B = { value = 1.0, unit = \"mrad\" }",
        effect: "zero-b",
        theta: vec![MRAD_DEG],
        normal: X,
        c_deg: 0.0,
        ball: [8.0, 5.0, -202.684],
        outward: X,
        reading_mm: 0.029_925_941,
    }
    .check(&nutating, "B");

    // 10. axial-b-1 with 10 µm at B = 0: B floats along its own line, which is halfway between Y and Z. The upper face
    //    rises by 0.010 / √2.
    ByHand {
        planted: "[effects.axial-b-1]\nEYB1c = 10.0",
        effect: "axial-b-1",
        theta: vec![10.0, 0.0],
        normal: Z,
        c_deg: 0.0,
        ball: [0.0, 5.0, -194.684],
        outward: Z,
        reading_mm: 0.007_071_068,
    }
    .check(&nutating, "B");
}

/// The rule for effects of a user's own: a constant tilt is a location error, stated at the reference point; a constant
/// turn of a table about itself, and whatever varies, turns about the axis's own line.
#[test]
fn a_users_turns_follow_the_same_rule() {
    let machine = table(("A", [1.0, 0.0, 0.0]), 1);
    let own = r#"
[[effect]]
id = "my-zero"
at = "C"
terms = [ { parameter = "turn", unit = "mrad", dof = "rz", formula = "1" } ]
[[effect]]
id = "my-lean"
at = "C"
terms = [ { parameter = "lean", unit = "mrad", dof = "rx", formula = "1" } ]
"#;
    let file = source("own.toml", own);
    let mut catalogue = Catalogue::built_in().unwrap();
    catalogue.add_file(&file).unwrap();
    let effects: Vec<_> = ["my-zero", "my-lean"].iter().map(|id| catalogue.get(id, &machine).unwrap()).collect();
    let model = Model::new(&machine, &effects, &[], machine.reference.pivot);
    assert!(!model.unknowns[0].at_reference);
    assert!(model.unknowns[1].at_reference);
}
