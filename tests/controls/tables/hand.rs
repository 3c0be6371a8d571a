//! Numeric examples worked by hand from the cited pages: what stands in the files, number by number.
//!
//! HEIDENHAIN and Haas have no page that says what their values mean: their examples only hold the sheets to what this program
//! means by them (round trip only).

use super::controls::{accepting, correction, export, loaded, plan, readings, scenario, tables, text};
use super::support::machine;
use axiscal::diag::source;
use axiscal::machine::Machine;
use axiscal::post::tables::LengthUnit;
use axiscal::simulate::Compensation;
use axiscal::tables::control::{self, Export, Options};

/// The number behind a name and `=`.
fn value(text: &str, name: &str) -> f64 {
    let line = text
        .lines()
        .find(|l| l.split('=').next().unwrap().trim() == name)
        .unwrap_or_else(|| panic!("no {name}\n{text}"));
    line.split('=').nth(1).unwrap().split(';').next().unwrap().trim().parse().unwrap()
}

/// By hand from IM9 03/2013 p. 502 and 12/2017 p. 572, for the trunnion: axes through (0, 0, -250), pivot at 0, A about X
/// and C about Z, both turning the table right-handed. EY0A = 0.02, EZ0A = -0.03, EX0C = 0.01.
/// I2 = reference point to A = (0, 0.02, -250.03). C has moved with A, and by its own 0.01: I3 = A to C = (0.01, 0, 0).
/// I4 = -(I2 + I3). The workpiece moves, so V1 = -X, V2 = -Z.
#[test]
fn sinumerik_by_hand() {
    let machine = machine("trunnion");
    let planted = vec![("location-a", "EY0A", 0.02), ("location-a", "EZ0A", -0.03), ("location-c", "EX0C", 0.01)];
    let export = export(&machine, "sinumerik", &planted, &accepting());
    let text = text(&export, "axiscal_tcarr.ini");
    let value = |n: usize| -> f64 {
        let line = text.lines().find(|l| l.starts_with(&format!("$TC_CARR{n}[1]="))).unwrap();
        line.split('=').nth(1).unwrap().split(';').next().unwrap().trim().parse().unwrap()
    };
    let three = |n| [value(n), value(n + 1), value(n + 2)];
    assert_eq!(three(4), [0.0, 0.02, -250.03]);
    assert_eq!(three(15), [0.01, 0.0, 0.0]);
    assert_eq!(three(18), [-0.01, -0.02, 250.03]);
    assert_eq!((three(7), three(10)), ([-1.0, 0.0, 0.0], [0.0, 0.0, -1.0]));
    assert!(text.contains("$TC_CARR23[1]=\"P\""));
}

/// By hand, swivel-head (kind M): B through (0, 0, 0) with the pivot there, so the adapter stands on it: I2 = 0. EX0B is
/// behind the rotation: the ball stands 0.02 further in X, so the axis lies 0.02 less far: I2 = (-0.02, 0, 0), I1 = (0.02,
/// 0, 0). Counted from the ball, C lies 0.02 less far too, and 0.05 further by EX0C: I3 = (0.03, 0, 0), I4 = (-0.03, 0, 0).
#[test]
fn a_head_and_a_table_by_hand() {
    let machine = machine("swivel-head");
    let planted = vec![("location-b", "EX0B", 0.02), ("location-c", "EX0C", 0.05)];
    let text = text(&export(&machine, "sinumerik", &planted, &accepting()), "axiscal_trafo.ini");
    for line in [
        "$MC_TRAFO5_BASE_TOOL_1[0]=-0.020000 ",
        "$MC_TRAFO5_JOINT_OFFSET_1[0]=0.020000 ",
        "$MC_TRAFO5_JOINT_OFFSET_PART_1[0]=0.030000 ",
        "$MC_TRAFO5_PART_OFFSET_1[0]=-0.030000 ",
        "$MC_TRAFO5_AXIS1_1[1]=1.000000000 ",
        "$MC_TRAFO5_AXIS2_1[2]=-1.000000000 ",
    ] {
        assert!(text.contains(line), "{line}\n{text}");
    }
}

/// By hand from A-79348E p. 82: table position = a point of A in machine coordinates, 19703.. = from A to B(=C).
#[test]
fn fanuc_by_hand() {
    let machine = machine("trunnion");
    let planted = vec![("location-a", "EY0A", 0.0204), ("location-c", "EX0C", 0.0106)];
    let export = export(&machine, "fanuc", &planted, &accepting());
    let text = text(&export, "axiscal_parameters.txt");
    let (title, text) = text.split_once("\n\r\r").unwrap();
    for word in ["%", "STUDY.TOML", "0123ABCD", "2026-11-20", "NOT VERIFIED, SEE README.TXT: FILE AXISCAL_G10.NC, "] {
        assert!(title.contains(word), "{title}");
    }
    let expected = "N19700Q1L1M0.000 \n\r\rN19701Q1L1M0.020 \n\r\rN19702Q1L1M-250.000 \n\r\rN19703Q1L1M0.011 \n\r\rN19704Q1L1M0.000 \n\r\rN19705Q1L1M0.000 \n\r\r%\n\r\r";
    assert_eq!(text, expected);
    assert!(self::text(&export, "axiscal_g10.nc").contains("G10 L52\nN19700 R0.000\n"));
    // inch: the letter says it, and the control reads the same place
    let inch = self::export(&machine, "fanuc", &planted, &Options { unit: LengthUnit::Inch, ..accepting() });
    assert!(self::text(&inch, "axiscal_parameters.txt").contains("N19702Q1L1I-9.8425 \n\r\r"));
}

/// By hand from IM9 03/2013 p. 502, type T (double-head: B carries A, both through (0, 0, 0), the adapter there). EZ0A = 0.03
/// stands behind A's rotation: the ball is 0.03 higher, so A lies 0.03 lower as seen from the adapter: I3 = (0, 0, -0.03). EX0B =
/// 0.02 stands between B and A: from A, B lies 0.02 less far in X: I2 = (-0.02, 0, 0). I1 = -(I2 + I3). The tool moves: V1 = +Y,
/// V2 = +X.
#[test]
fn a_head_of_two_axes_by_hand() {
    let machine = machine("double-head");
    let planted = vec![("location-a", "EZ0A", 0.03), ("location-b", "EX0B", 0.02)];
    let of = |control: &str, file: &str| text(&export(&machine, control, &planted, &accepting()), file);
    let carrier = of("sinumerik", "axiscal_tcarr.ini");
    let three = |first: usize| [0, 1, 2].map(|k| value(&carrier, &format!("$TC_CARR{}[1]", first + k)));
    assert_eq!((three(4), three(15)), ([-0.02, 0.0, 0.0], [0.0, 0.0, -0.03]));
    assert_eq!(three(1), [0.02, 0.0, 0.03]);
    assert_eq!((three(7), three(10)), ([0.0, 1.0, 0.0], [1.0, 0.0, 0.0]));
    assert!(carrier.contains("$TC_CARR23[1]=\"T\""));
    // A-78712E pp. 61, 62, type 2: 19709.. tool axis to the tool's rotary axis, 19712.. from there to the first one
    let fanuc = of("fanuc", "axiscal_parameters.txt");
    let expected = "N19709Q1L1M0.000 \n\r\rN19710Q1L1M0.000 \n\r\rN19711Q1L1M-0.030 \n\r\rN19712Q1L1M-0.020 \n\r\rN19713Q1L1M0.000 \n\r\rN19714Q1L1M0.000 \n\r\r%\n\r\r";
    assert_eq!(fanuc.split_once("\n\r\r").unwrap().1, expected);
}

/// By hand from A-79348E p. 82 and A-78712E p. 61, type 21, the machine and errors of [`a_head_and_a_table_by_hand`]: the table's
/// axis 0.03 further in X, the head's 0.02 less far.
#[test]
fn fanuc_head_and_table_by_hand() {
    let planted = vec![("location-b", "EX0B", 0.02), ("location-c", "EX0C", 0.05)];
    let text = text(&export(&machine("swivel-head"), "fanuc", &planted, &accepting()), "axiscal_parameters.txt");
    let expected = "N19700Q1L1M0.030 \n\r\rN19701Q1L1M0.000 \n\r\rN19702Q1L1M0.000 \n\r\rN19709Q1L1M-0.020 \n\r\rN19710Q1L1M0.000 \n\r\rN19711Q1L1M0.000 \n\r\r%\n\r\r";
    assert_eq!(text.split_once("\n\r\r").unwrap().1, expected);
}

/// By hand: A tilted by 0.02 deg about Z points along (cos, sin, 0) = (0.999999939, 0.000349066, 0). C tilted by 0.01 deg about Y
/// points along (sin, 0, cos) = (0.000174533, 0, 0.999999985) in what A carries, and A's tilt turns that about Z: its Y becomes
/// 0.000174533 x 0.000349066 = 0.000000061. The workpiece moves, so the control counts both against that (IM9 12/2017 p. 572).
#[test]
fn tilted_directions_by_hand() {
    let planted = vec![("location-a", "EC0A", 0.02), ("location-c", "EB0C", 0.01)];
    let text = text(&export(&machine("trunnion"), "sinumerik", &planted, &accepting()), "axiscal_trafo.ini");
    let three = |name: &str| [0, 1, 2].map(|k| value(&text, &format!("$MC_TRAFO5_{name}_1[{k}]")));
    assert_eq!(three("AXIS1"), [-0.999_999_939, -0.000_349_066, 0.0]);
    assert_eq!(three("AXIS2"), [-0.000_174_533, -0.000_000_061, -0.999_999_985]);
}

/// By hand: X that goes 20 um/m too far stands 20e-6 x off; a control that adds the table's value to the axis (Extended
/// Functions 03/2013 pp. 248, 249) needs minus that. The page does not say the sense, and so does the file.
#[test]
fn the_sign_of_a_position_table_by_hand() {
    let planted = vec![("scale-x", "EXX", 20.0)];
    let machine = machine("trunnion");
    let t = tables("sinumerik");
    let export = export(&machine, "sinumerik", &planted, &accepting());
    let text = text(&export, "axiscal_cec.ini");
    let [low, high] = [value(&text, "$AN_CEC_MIN[0]"), value(&text, "$AN_CEC_MAX[0]")];
    let points = ((high - low) / value(&text, "$AN_CEC_STEP[0]")).round() as usize;
    assert!((value(&text, "$AN_CEC[0,0]") + 20e-6 * low).abs() < 2e-6 && low < -100.0);
    assert!((value(&text, &format!("$AN_CEC[0,{points}]")) + 20e-6 * high).abs() < 2e-6 && high > 100.0);
    assert!(text.contains("NOT VERIFIED") && text.contains("the sign: values are taken as added"), "{text}");
    let correction = correction(&machine, &planted, None);
    let refused = control::export(&machine, "sinumerik", &t, &correction, &Options::default()).unwrap_err();
    assert!(refused.0.iter().any(|f| f.code == "tables::unverified" && f.message.contains("the sign")), "{refused}");
}

/// Round trip only: the sheets say what this program means by their names.
#[test]
fn the_sheets_by_hand_round_trip_only() {
    let planted = vec![("location-a", "EY0A", 0.02), ("location-a", "EZ0A", -0.03), ("location-c", "EX0C", 0.01)];
    let of = |machine: &Machine, control: &str| {
        text(&export(machine, control, &planted, &accepting()), "axiscal_worksheet.txt")
    };
    let trunnion = machine("trunnion");
    let sheet = of(&trunnion, "heidenhain");
    let three = |sheet: &str, what: &str| ["X", "Y", "Z"].map(|k| value(sheet, &format!("{what} {k}")));
    assert_eq!(three(&sheet, "FIRST TABLE AXIS"), [0.0, 0.02, -250.03]);
    assert_eq!(three(&sheet, "SECOND TABLE AXIS"), [0.01, 0.0, 0.0]);
    // C goes with A: its line is 0.01 further in X, and passes A's there: MRZP = (0.01, 0.02, -250.03)
    let sheet = of(&trunnion, "haas");
    let three = |first: usize| [0, 1, 2].map(|k| value(&sheet, &format!("SETTING {}", first + k)));
    assert_eq!((three(300), three(303)), ([0.0, 0.02, -250.03], [0.01, 0.02, -250.03]));
    assert_eq!(three(255), [0.01, 0.02, -250.03]);
}

/// The numbers of a G10 program, in mm: `G20` or `G21`, then `N19700 R0.02` in each line between `G10 L52` and `G11`.
fn programmed(text: &str) -> Vec<(u32, f64)> {
    let unit = if text.lines().any(|l| l == "G20") { 25.4 } else { 1.0 };
    assert!(text.lines().filter(|l| ["G20", "G21"].contains(l)).count() == 1, "{text}");
    // and leaves the control in the unit in which it was
    let at = |line: &str| text.lines().position(|l| l == line).unwrap_or_else(|| panic!("{line}: {text}"));
    assert!(at("#14=#4006") < at("G10 L52") && at("G11") < at("G#14") && at("G#14") < at("M30"));
    let lines = text.lines().skip_while(|l| *l != "G10 L52").skip(1).take_while(|l| *l != "G11");
    lines
        .map(|l| {
            let (number, value) = l.strip_prefix('N').unwrap().split_once(" R").unwrap();
            (number.parse().unwrap(), value.parse::<f64>().unwrap() * unit)
        })
        .collect()
}

/// The file in inches, and the G10 program in both units, set what the file in mm sets, to half a step of each.
#[test]
fn fanuc_s_forms_are_read_back() {
    for name in ["trunnion", "swivel-head", "double-head"] {
        let machine = machine(name);
        let planted = vec![match name {
            "trunnion" => ("location-a", "EY0A", 0.0204),
            _ => ("location-b", "EX0B", 0.0204),
        }];
        let of = |unit: LengthUnit| -> Export {
            let options = Options { unit, ..accepting() };
            export(&machine, "fanuc", &planted, &options)
        };
        let (mm, inch) = (of(LengthUnit::Mm), of(LengthUnit::Inch));
        let values = |e: &Export, unit: f64| e.values.iter().map(|v| v.new * unit).collect::<Vec<_>>();
        for (export, unit, half) in [(&mm, 1.0, 0.000_501), (&inch, 25.4, 0.001_271)] {
            let read = programmed(&text(export, "axiscal_g10.nc"));
            assert_eq!(read.len(), values(export, unit).len());
            for ((number, found), value) in read.iter().zip(values(export, unit)) {
                assert!((found - value).abs() < 1e-9, "{name} {number}: {found} {value}");
            }
            for (found, exact) in values(export, unit).iter().zip(values(&mm, 1.0)) {
                assert!((found - exact).abs() <= half + 0.000_501, "{name}: {found} {exact}");
            }
        }
        let (plan, scenario) = (plan(&machine, 11), scenario(&machine, &planted));
        let with = |c: Option<&Compensation>| readings(&machine, &plan, &scenario, c);
        let (mm, inch) = (with(Some(&loaded(&machine, &mm, None))), with(Some(&loaded(&machine, &inch, None))));
        // 0.0001 inch is 2.54 um
        assert!(mm.iter().zip(&inch).all(|(a, b)| (a - b).abs() < 0.004), "{name}");
        assert!(with(None).iter().zip(&inch).any(|(a, b)| (a - b).abs() > 0.01), "{name}: nothing was applied");
    }
}

/// Extended Functions 03/2013 p. 264: X from -585 to -5 mm with a step of 58 mm has 11 points.
#[test]
fn points_of_a_position_table_by_hand() {
    let machine = machine("trunnion");
    let mut lines = String::from("CHANDATA(1)\n");
    for t in 0..2 {
        for n in 0..11 {
            lines += &format!("$AN_CEC[{t},{n}]={}\n", (n as f64 - 5.0) * 0.001 * if t == 0 { 1.0 } else { -1.0 });
        }
        for (what, value) in [
            ("INPUT_AXIS", "(AX1)"),
            ("OUTPUT_AXIS", "(AX1)"),
            ("STEP", "58"),
            ("MIN", "-585"),
            ("MAX", "-5"),
            ("MULT_BY_TABLE", "0"),
            ("IS_MODULO", "0"),
        ] {
            lines += &format!("$AN_CEC_{what}[{t}]={value}\n");
        }
        lines += &format!("$AN_CEC_DIRECTION[{t}]={}\n", if t == 0 { 1 } else { -1 });
    }
    let trafo =
        text(&export(&machine, "sinumerik", &vec![("location-c", "EX0C", 0.01)], &accepting()), "axiscal_trafo.ini");
    let json =
        text(&export(&machine, "sinumerik", &vec![("location-c", "EX0C", 0.01)], &accepting()), "compensation.json");
    let json = json.replace("\"axiscal_trafo.ini\"", "\"axiscal_trafo.ini\", \"cec.ini\"");
    let read = |lines: &str| {
        let open = |name: &str| Ok(source(name, if name == "cec.ini" { lines.to_owned() } else { trafo.clone() }));
        Compensation::parse_with(&source("compensation.json", json.clone()), &machine, &open)
    };
    read(&lines).unwrap();
    // the eleventh point is needed, a twelfth is not
    let without = lines.replace("$AN_CEC[0,10]=0.005\n", "");
    assert!(read(&without).unwrap_err().to_string().contains("$AN_CEC[0,10]"));
}

/// Whoever loads a file has not seen the screen: what is not verified is named in each of them.
#[test]
fn what_is_not_verified_is_named_in_every_file() {
    for (control, name) in [("fanuc", "trunnion"), ("haas", "trunnion"), ("heidenhain", "swivel-head")] {
        let machine = machine(name);
        let effect = if name == "trunnion" { ("location-a", "EY0A", 0.02) } else { ("location-b", "EX0B", 0.01) };
        let export = export(&machine, control, &vec![effect], &accepting());
        let unverified = &export.compensation.tables.as_ref().unwrap().unverified;
        assert!(!unverified.is_empty(), "{control}");
        for (file, _) in export.files.iter().filter(|(file, _)| file != "compensation.json") {
            let held = self::text(&export, file).to_uppercase().replace('_', "-");
            assert!(held.contains("NOT VERIFIED"), "{control} {file}");
            for what in unverified.keys() {
                assert!(held.contains(&what.to_uppercase().replace('_', "-")), "{control} {file}: {what}");
            }
        }
        let record: serde_json::Value = serde_json::from_str(&self::text(&export, "compensation.json")).unwrap();
        assert_eq!(record["tables"]["unverified"].as_object().unwrap().len(), unverified.len());
    }
}
