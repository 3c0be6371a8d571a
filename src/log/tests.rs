#![allow(clippy::type_complexity)] // tables of cases

use super::*;
use crate::axes::Position;
use crate::diag::Severity;
use crate::post::LogRecord;
use crate::post::tests::{machine, plan};
use crate::program::plan::ControllerFrame;
use proptest::prelude::*;

fn post() -> Postprocessor {
    Postprocessor::load_built_in_or_file("linuxcnc").unwrap().0
}

/// All that are built in.
fn posts() -> &'static [Postprocessor] {
    static ALL: std::sync::LazyLock<Vec<Postprocessor>> =
        std::sync::LazyLock::new(|| Postprocessor::built_in().unwrap());
    &ALL
}

fn record(id: u64, position: Position) -> LogRecord {
    LogRecord { id, status: Status::Hit, position, time_s: None }
}

/// A log of the plan's touches, each a little off its nominal place.
fn records(plan: &Plan) -> Vec<LogRecord> {
    let off = |t: &crate::program::plan::PlanTouch| {
        let mut p = t.nominal_position();
        p.0[0] += 0.001 * t.id as f64;
        p
    };
    plan.touches.iter().map(|t| record(t.id, off(t))).collect()
}

fn codes(findings: &[Finding]) -> Vec<&'static str> {
    findings.iter().map(|f| f.code).collect()
}

#[test]
fn what_the_machine_would_write_is_read_back() {
    let machines = [
        ("swivel-head", "table"),
        ("trunnion", "table"),
        ("double-head", "head"),
        ("nutating-b", "table"),
        ("trunnion-offset", "table"),
    ];
    for ((name, mounting), post) in machines.into_iter().flat_map(|m| posts().iter().map(move |p| (m, p))) {
        let machine = machine(name);
        for frame in [ControllerFrame::Axes, ControllerFrame::Tcp] {
            let mut plan = plan(&machine, mounting, "x+");
            plan.controller_frame = frame;
            let text = post.log_text(&machine, &plan, &records(&plan));
            let (read, findings) = read(text.as_bytes(), "t.log", Writer::Controller(post), &machine, &plan).unwrap();
            assert!(findings.0.is_empty(), "{findings:?}");
            assert!(read.complete && read.runs.len() == 1 && read.touches.len() == 3);
            for (touch, record) in read.touches.iter().zip(records(&plan)) {
                assert_eq!(touch.id, record.id);
                for (a, b) in touch.position.0.iter().zip(record.position.0) {
                    // half a digit; a turn of the frame may add a last digit
                    assert!(
                        (a - b).abs() < 1.1 * 10f64.powi(-i32::try_from(post.log.decimals).unwrap()),
                        "{name} {frame:?} {touch:?}"
                    );
                }
            }
        }
    }
}

#[test]
fn the_last_complete_run_counts() {
    let machine = machine("swivel-head");
    let plan = plan(&machine, "head", "x+");
    let run = |shift: f64| {
        let mut all = records(&plan);
        all.iter_mut().for_each(|r| r.position.0[1] += shift);
        post().log_text(&machine, &plan, &all)
    };
    let stopped = run(0.5).lines().take(3).fold(String::new(), |t, l| t + l + "\n");
    let text = format!("{}{}{stopped}", run(0.1), run(0.2));
    let (read, findings) = read(text.as_bytes(), "t.log", Writer::Controller(&post()), &machine, &plan).unwrap();
    assert_eq!(codes(&findings.0), ["log::runs"]);
    assert_eq!(findings.0[0].place().unwrap(), "t.log:6:1");
    assert_eq!(read.runs.len(), 3);
    assert!((read.touches[0].position.0[1] - plan.touches[0].nominal.position().0[1] - 0.2).abs() < 1e-9);
}

#[test]
fn a_run_that_was_started_again_goes_on() {
    let machine = machine("swivel-head");
    let plan = plan(&machine, "head", "x+");
    let text = post().log_text(&machine, &plan, &records(&plan));
    let lines: Vec<&str> = text.lines().collect();
    let again = lines[0].strip_suffix("U1").unwrap().to_owned() + "U2";
    let text = [lines[0], lines[1], lines[2], &again, lines[2], lines[3], lines[4], ""].join("\n");
    let (read, findings) = read(text.as_bytes(), "t.log", Writer::Controller(&post()), &machine, &plan).unwrap();
    assert_eq!(codes(&findings.0), ["log::resumed", "log::twice"]);
    assert_eq!(findings.0[0].place().unwrap(), "t.log:4:1");
    assert!(findings.0[0].message.contains("set-up 2"), "{}", findings.0[0].message);
    assert!(read.complete);
    assert_eq!(read.touches.iter().map(|t| t.line).collect::<Vec<_>>(), [2, 5, 6]);
}

/// A run that was started again in the middle, whose second head is lost, is one run; one that has lost its beginning is another.
#[test]
fn a_second_start_without_its_head_is_the_same_run() {
    let machine = machine("swivel-head");
    let mut plan = plan(&machine, "head", "x+");
    let last = plan.touches[2].clone();
    for _ in 0..4 {
        plan.touches.push(crate::program::plan::PlanTouch { id: plan.touches.len() as u64 + 1, ..last.clone() });
    }
    for name in ["fanuc", "sinumerik", "heidenhain", "linuxcnc"] {
        let post = Postprocessor::load_built_in_or_file(name).unwrap().0;
        let mut all = records(&plan);
        let mut lines_of = |from_s: f64, aside: f64| -> Vec<String> {
            all.iter_mut().enumerate().for_each(|(i, r)| {
                r.time_s = Some(from_s + 20.0 * i as f64);
                r.position.0[1] += aside;
            });
            post.log_text(&machine, &plan, &all).lines().map(str::to_owned).collect()
        };
        let (first, again, other) = (lines_of(30.0, 0.0), lines_of(-30.0, 0.001), lines_of(31.0, 0.001));
        let head = first.iter().position(|l| l.starts_with("H ")).unwrap();
        let touch = |n: usize| head + n;
        let with = |behind: &[String]| {
            let text = [&first[..=touch(5)], behind, &[String::new()]].concat().join("\r\n");
            read(text.as_bytes(), "t.log", Writer::Controller(&post), &machine, &plan).unwrap()
        };
        // touches 4 and 5 are made again
        let (log, findings) = with(&again[touch(4)..]);
        assert!(log.complete && log.runs.len() == 1, "{name}: {findings:?}");
        assert!(codes(&findings.0).contains(&"log::twice"), "{name}: {findings:?}");
        assert_eq!(codes(&findings.0).contains(&"log::resumed"), post.log.writes_time, "{name}: {findings:?}");
        let times: Vec<bool> = log.touches.iter().map(|t| t.time_s.is_some()).collect();
        let timed = post.log.writes_time;
        assert_eq!(times, [timed, timed, timed, false, false, false, false], "{name}");
        // with a clock another run shows that it is one
        let (log, _) = with(&other[touch(3)..]);
        assert_eq!(log.runs.len(), if timed { 2 } else { 1 }, "{name}");
        // and so it does where it begins at its beginning
        assert_eq!(with(&again[touch(1)..]).0.runs.len(), 2, "{name}");
    }
}

/// The clock of a program counts from its start: behind a second start it says nothing of the first one's.
#[test]
fn times_behind_a_second_start_are_not_used() {
    let machine = machine("swivel-head");
    let plan = plan(&machine, "head", "x+");
    for name in ["fanuc", "sinumerik", "heidenhain"] {
        let post = Postprocessor::load_built_in_or_file(name).unwrap().0;
        let mut all = records(&plan);
        let mut lines_of = |times: [f64; 3]| -> Vec<String> {
            all.iter_mut().zip(times).for_each(|(r, t)| r.time_s = Some(t));
            post.log_text(&machine, &plan, &all).lines().map(str::to_owned).collect()
        };
        let mut lines = lines_of([400.0, 45.0, 60.0]);
        let head = lines.iter().position(|l| l.starts_with("H ")).unwrap();
        let u = lines[head].rfind('U').unwrap();
        let again = lines[head][..u].to_owned() + &lines[head][u..].replace('1', "2");
        let with_times = |lines: &[String]| {
            let text = lines.join("\r\n") + "\r\n";
            let (read, findings) = read(text.as_bytes(), "t.log", Writer::Controller(&post), &machine, &plan).unwrap();
            (read.touches.iter().map(|t| t.time_s).collect::<Vec<_>>(), codes(&findings.0).contains(&"log::resumed"))
        };
        // the head of the second start is lost: its clock shows it
        assert_eq!(with_times(&lines), (vec![Some(400.0), None, None], true), "{name}");
        lines.insert(head + 2, again);
        assert_eq!(with_times(&lines), (vec![Some(400.0), None, None], true), "{name}");
        // it is damaged: there is something that may be one, and the clock may be further than before already
        let mut lines = lines_of([30.0, 45.0, 60.0]);
        let whole = vec![Some(30.0), Some(45.0), Some(60.0)];
        assert_eq!(with_times(&lines), (whole.clone(), false), "{name}");
        lines.insert(head + 3, "H AXISXAL 1 FA".to_owned());
        assert_eq!(with_times(&lines), (vec![Some(30.0), Some(45.0), None], true), "{name}");
        for other in ["no line of a log", "HELLO OPERATOR", "H N3 S1 X37.9791"] {
            lines[head + 3] = other.to_owned();
            assert_eq!(with_times(&lines), (whole.clone(), false), "{name} {other}");
        }
        // lines that were copied are no second start, nor is one in the wrong place
        lines[head + 3] = lines[head + 1].clone();
        assert_eq!(with_times(&lines), (whole.clone(), false), "{name}");
        lines.insert(head + 4, lines[head + 2].clone());
        assert_eq!(with_times(&lines), (whole.clone(), false), "{name}");
        lines.drain(head + 3..=head + 4);
        lines.swap(head + 1, head + 2);
        assert_eq!(with_times(&lines), (whole, false), "{name}");
    }
}

#[test]
fn simple_mistakes_are_named() {
    let machine = machine("swivel-head");
    // enough touches for "most of them"
    let mut plan = plan(&machine, "head", "x+");
    let more: Vec<_> =
        plan.touches.iter().cloned().map(|t| crate::program::plan::PlanTouch { id: t.id + 10, ..t }).collect();
    plan.touches.extend(more);
    let as_csv = |change: &dyn Fn(&mut Position)| {
        let touches: Vec<Touch> = records(&plan)
            .into_iter()
            .map(|r| {
                let mut position = r.position;
                change(&mut position);
                let (id, status) = (r.id, r.status);
                Touch { id, position, status, time_s: None, digit_mm: None, temperature_deg_c: None, line: 0 }
            })
            .collect();
        let text = csv::write(&machine, &touches);
        read(text.as_bytes(), "t.csv", Writer::Csv, &machine, &plan)
    };
    as_csv(&|_| {}).unwrap();
    type Change<'a> = &'a dyn Fn(&mut Position);
    let cases: [(Change, &str); 6] = [
        (&|p| p.0.swap(0, 2), "the columns X and Z were exchanged"),
        (&|p| p.0[0] = -p.0[0], "the sign of X were the other one"),
        (&|p| p.0[..3].iter_mut().for_each(|v| *v /= 25.4), "the numbers were inches"),
        (&|p| p.0[..3].iter_mut().for_each(|v| *v *= 25.4), "the numbers were millimetres"),
        (&|p| p.0[1] += 100.0, "shifted by X 0.011 Y 100.000"),
        (&|p| p.0 = [p.0[2] * 3.0, 77.0 + p.0[1] * p.0[0], -p.0[0], 0.0, 0.0, 0.0], "another program or machine"),
    ];
    for (change, expected) in cases {
        let failure = as_csv(change).unwrap_err();
        let error = failure.0.iter().find(|f| f.severity == Severity::Error).unwrap();
        assert!(error.message.contains(expected), "{}", error.message);
        assert_eq!(error.place().unwrap(), "t.csv:2:1");
    }
}

#[test]
fn floods_are_short_and_a_wrong_sign_is_named() {
    let machine = machine("swivel-head");
    let mut plan = plan(&machine, "head", "x+");
    let three = plan.touches.clone();
    let sets: Vec<(u64, f64)> = vec![(0, 0.0), (10, 0.0), (20, 0.0), (30, -90.0), (40, -90.0)];
    plan.touches = sets
        .into_iter()
        .flat_map(|(more, b)| {
            three.iter().cloned().map(move |mut t| {
                t.id += more;
                t.pose.set(crate::axes::AxisName::B, b);
                t
            })
        })
        .collect();
    let mut all = records(&plan);
    all.iter_mut().for_each(|r| r.position.0[4] = -r.position.0[4]);
    let text = post().log_text(&machine, &plan, &all);
    let (_, findings) = read(text.as_bytes(), "t", Writer::Controller(&post()), &machine, &plan).unwrap();
    assert_eq!(codes(&findings.0), [vec!["log::swapped"], vec!["log::implausible"; 4]].concat());
    assert!(findings.0[0].message.contains("15 would be right if the sign of B were the other one"), "{findings:?}");
    assert!(findings.0[4].message.contains("and 3 more"), "{findings:?}");
    let text = post().log_text(&machine, &plan, &[records(&plan), records(&plan)].concat());
    let (read, findings) = read(text.as_bytes(), "t", Writer::Controller(&post()), &machine, &plan).unwrap();
    assert_eq!(codes(&findings.0), ["log::twice"; 4]);
    assert!(findings.0[3].message.contains("and 12 more") && read.complete);
}

#[test]
fn a_csv_may_come_from_a_spreadsheet() {
    let expected = csv::read(b"id,X,Y,Z,B,status\n1,1.5,-2,3,-30,hit\n2,1,2,3,4,miss\n", "t").unwrap().0;
    assert_eq!(expected[0].position.0, [1.5, -2.0, 3.0, 0.0, -30.0, 0.0]);
    assert_eq!(expected[0].present, [true, true, true, false, true, false]);
    for other in [
        "id;X;Y;Z;B;status\n1;1,5;-2;3;-30;hit\n2;1;2;3;4;miss\n",
        "status\tB\tZ\tY\tX\tid\nhit\t-30\t3\t-2\t1.5\t1\nmiss\t4\t3\t2\t1\t2\n",
        "\u{feff}\"id\",\"X\",\"Y\",\"Z\",\"B\",\"status\"\r\n\"1\",1.5,-2,3,-30,hit\r\n2,1,2,3,4,\"miss\"",
    ] {
        assert_eq!(csv::read(other.as_bytes(), "t").unwrap().0, expected, "{other}");
    }
    let (touches, findings) = csv::read(b"id,X,Y,Z\n1,1,5,-2,3\n2,1,2,3\n3,1,2,nan\n4,1,2,", "t").unwrap();
    assert_eq!(touches.len(), 1);
    let places: Vec<_> = findings.0.iter().map(|f| f.place().unwrap()).collect();
    assert_eq!(places, ["t:2:1", "t:4:7", "t:5:7"]);
    assert!(findings.0[0].message.contains("decimal commas"));
    let cold = b"id,X,Y,Z,temperature_degC\n1,1,2,3,-400\n2,1,2,3,20\n";
    let (touches, findings) = csv::read(cold, "t").unwrap();
    assert_eq!((touches.len(), findings.0[0].place().as_deref()), (1, Some("t:2:9")));
    for bad in ["id,X,Y\n1,2,3\n", "id,X,Y,Z,Q\n1,2,3,4,5\n", "id,X,Y,Z,X\n1,2,3,4,5\n", "id,X,Y,Z\n", " \n"] {
        assert!(csv::read(bad.as_bytes(), "t").is_err(), "{bad}");
    }
}

/// Rows as LinuxCNC logs them for the moves of a touch, given how far along the search each stands, mm.
fn rows(plan: &Plan, touch: usize, along: &[f64]) -> String {
    let t = &plan.touches[touch];
    let (start, end) = (t.start_position(), t.end_position());
    let way = (end.xyz_mm() - start.xyz_mm()).normalize();
    along
        .iter()
        .map(|a| {
            let p = start.xyz_mm() + way * *a;
            let r = &start.0[3..];
            format!("{:.6} {:.6} {:.6} {:.6} {:.6} {:.6} 0.000000 0.000000 0.000000\n", p.x, p.y, p.z, r[0], r[1], r[2])
        })
        .collect()
}

#[test]
fn columns_are_matched_by_place() {
    let machine = machine("swivel-head");
    let plan = plan(&machine, "head", "x+");
    /// Name, log, touches that can be used, codes of findings.
    type Case<'a> = (&'a str, String, &'a [(u64, Status)], &'a [&'a str]);
    let cases: [Case; 7] = [
        (
            "search, release, measure",
            rows(&plan, 0, &[2.010, 1.995, 2.001])
                + &rows(&plan, 1, &[2.010, 1.995, 2.001])
                + &rows(&plan, 2, &[2.01, 1.99, 2.0]),
            &[(1, Status::Hit), (2, Status::Hit), (3, Status::Hit)],
            &[],
        ),
        (
            "duplicates dropped, head cut",
            rows(&plan, 1, &[2.001]) + &rows(&plan, 2, &[2.01, 1.99, 2.001]),
            &[(2, Status::Hit), (3, Status::Hit)],
            &["log::missing"],
        ),
        (
            "cut after the release: the row of the release is not taken for the touch",
            rows(&plan, 0, &[2.01, 1.99, 2.001]) + &rows(&plan, 1, &[2.01, 1.99]),
            &[(1, Status::Hit)],
            &["log::ambiguous", "log::missing"],
        ),
        (
            "a miss that looks like a hit",
            rows(&plan, 0, &[2.01, 1.99, 2.0]) + &rows(&plan, 1, &[3.997]),
            &[(1, Status::Hit), (2, Status::Miss)],
            &["log::missed", "log::missing"],
        ),
        (
            "rows of moves between",
            rows(&plan, 0, &[0.0, 2.01, 2.0, 1.51, 2.001, 1.999, 0.0]) + &rows(&plan, 1, &[2.01, 1.99, 2.001]),
            &[(1, Status::Hit), (2, Status::Hit)],
            &["log::missing"],
        ),
        (
            "elsewhere",
            rows(&plan, 0, &[2.01, 1.99, 2.001])
                + "1.000000 2.000000 3.000000 0.000000 0.000000 0.000000 0.000000 0.000000 0.000000\n",
            &[(1, Status::Hit)],
            &["log::unmatched", "log::missing"],
        ),
        (
            "overwritten in the middle of a number",
            rows(&plan, 0, &[2.01, 1.99, 2.001])
                + "28.00000028.000000 0.000000 8.000000 0.000000 0.000000 0.000000 0.000000 0.000000 0.000000\n",
            &[(1, Status::Hit)],
            &["log::in_number", "log::missing"],
        ),
    ];
    for (name, text, expected, expected_codes) in cases {
        let (read, findings) = read(text.as_bytes(), "t.log", Writer::Controller(&post()), &machine, &plan)
            .unwrap_or_else(|e| panic!("{name}: {:?}", e.0));
        let found: Vec<_> = read.touches.iter().map(|t| (t.id, t.status)).collect();
        assert_eq!(found, expected, "{name}");
        assert_eq!(codes(&findings.0), expected_codes, "{name}: {:?}", findings.0);
        if let Some(first) = read.touches.first().filter(|t| t.id == 1 && t.status == Status::Hit) {
            let off = (first.position.xyz_mm() - plan.touches[0].nominal_position().xyz_mm()).norm();
            assert!(off < 0.0011, "{name}: the measuring touch is the one that counts, not {off}");
        }
    }
}

#[test]
fn touches_at_one_place_are_shared_out_or_refused() {
    let machine = machine("swivel-head");
    let mut plan = plan(&machine, "head", "x+");
    let again = crate::program::plan::PlanTouch { id: 7, ..plan.touches[0].clone() };
    plan.touches.insert(1, again);
    let triples = rows(&plan, 0, &[2.01, 1.99, 2.001, 2.02, 1.98, 2.002]);
    let (read_back, _) = read(triples.as_bytes(), "t", Writer::Controller(&post()), &machine, &plan).unwrap();
    assert_eq!(read_back.touches.iter().map(|t| (t.id, t.line)).collect::<Vec<_>>(), [(1, 3), (7, 6)]);
    let dropped = rows(&plan, 0, &[2.01, 1.99, 2.001, 2.02, 1.98]) + &rows(&plan, 2, &[2.01, 1.99, 2.0]);
    let (read_back, findings) = read(dropped.as_bytes(), "t", Writer::Controller(&post()), &machine, &plan).unwrap();
    assert_eq!(read_back.touches.iter().map(|t| t.id).collect::<Vec<_>>(), [2]);
    assert!(codes(&findings.0).contains(&"log::ambiguous"));
}

/// What can happen to a file.
#[derive(Debug, Clone)]
enum Damage {
    Cut(usize),
    Delete(usize, usize),
    Overwrite(usize, Vec<u8>),
    Insert(usize, Vec<u8>),
    Repeat(usize, usize),
}

fn damage() -> impl Strategy<Value = Damage> {
    let bytes = prop::collection::vec(
        prop_oneof![any::<u8>(), prop::sample::select(&b"0123456789-. \n\rPNSXYZBCKHE,"[..])],
        1..12,
    );
    prop_oneof![
        any::<usize>().prop_map(Damage::Cut),
        (any::<usize>(), 1..40usize).prop_map(|(a, n)| Damage::Delete(a, n)),
        (any::<usize>(), bytes.clone()).prop_map(|(a, b)| Damage::Overwrite(a, b)),
        (any::<usize>(), bytes).prop_map(|(a, b)| Damage::Insert(a, b)),
        (any::<usize>(), 1..80usize).prop_map(|(a, n)| Damage::Repeat(a, n)),
    ]
}

fn apply(text: &mut Vec<u8>, damage: &Damage) {
    let len = text.len().max(1);
    match damage {
        Damage::Cut(at) => text.truncate(at % len),
        Damage::Delete(at, n) => drop(text.drain(at % len..(at % len + n).min(text.len()))),
        Damage::Overwrite(at, bytes) => {
            let place = text.iter_mut().skip(at % len);
            place.zip(bytes).for_each(|(t, b)| *t = *b);
        }
        Damage::Insert(at, bytes) => drop(text.splice(at % len..at % len, bytes.iter().copied())),
        Damage::Repeat(at, n) => {
            let piece = text[at % len..(at % len + n).min(text.len())].to_vec();
            text.extend(piece);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn positions_survive_writing_and_reading(values in prop::collection::vec(-400.0..400.0f64, 5), miss: bool) {
        let machine = machine("swivel-head");
        let plan = plan(&machine, "head", "x+");
        let position = Position([values[0], values[1], values[2], 0.0, values[3] / 10.0, values[4]]);
        let status = if miss { Status::Miss } else { Status::Hit };
        let text = post().log_text(&machine, &plan, &[LogRecord { id: 2, status, position, time_s: None }]);
        let (parsed, findings) = parse(text.as_bytes(), "t", &post()).unwrap();
        prop_assert!(findings.0.is_empty(), "{:?}", findings.0);
        prop_assert_eq!(parsed.touches.len(), 1);
        prop_assert_eq!(parsed.touches[0].status, status);
        for (a, b) in parsed.touches[0].position.0.iter().zip(position.0) {
            prop_assert!((a - b).abs() <= 0.5001e-6);
        }
    }

    #[test]
    fn a_csv_survives_writing_and_reading(
        values in prop::collection::vec(-400.0..400.0f64, 5),
        time in prop::option::of(0.0..1e5f64),
        degrees in prop::option::of(-50.0..100.0f64),
    ) {
        let machine = machine("swivel-head");
        let position = Position([values[0], values[1], values[2], 0.0, values[3], values[4]]);
        let touch = Touch { id: 3, position, status: Status::Miss, time_s: time, digit_mm: None,
temperature_deg_c: degrees, line: 2 };
        let (back, _) = csv::read(csv::write(&machine, std::slice::from_ref(&touch)).as_bytes(), "t").unwrap();
        prop_assert_eq!(back[0].position, position);
        prop_assert_eq!((back[0].id, back[0].status, back[0].time_s), (Some(3), Status::Miss, time));
    }

    #[test]
    fn damage_never_panics_and_never_invents_a_touch(damages in prop::collection::vec(damage(), 1..4)) {
        let machine = machine("swivel-head");
        let plan = plan(&machine, "head", "x+");
        for post in posts() {
            let clean = post.log_text(&machine, &plan, &records(&plan));
            let (original, _) = parse(clean.as_bytes(), "t", post).unwrap();
            let mut text = clean.into_bytes();
            damages.iter().for_each(|d| apply(&mut text, d));
            if let Ok((parsed, _)) = parse(&text, "t", post) {
                for touch in &parsed.touches {
                    // the sum of six rounded numbers leaves room for three digits of the last place: a damage of less
                    // than that cannot be seen in it
                    let room = 4.0 * 10f64.powi(-i32::try_from(post.log.decimals).unwrap());
                    let near = |a: &Position, b: &Position| a.0.iter().zip(b.0).all(|(a, b)| (a - b).abs() < room);
                    let known = original
                        .touches
                        .iter()
                        .any(|o| o.id == touch.id && near(&o.position, &touch.position) && o.status == touch.status);
                    prop_assert!(known, "{}: invented {:?} in {:?}", post.name, touch, String::from_utf8_lossy(&text));
                }
            }
            let _ = read(&text, "t", Writer::Controller(post), &machine, &plan);
            let _ = csv::read(&text, "t");
        }
    }

    /// Inspection results have no sum: a digit may change unseen, a point may not appear.
    #[test]
    fn damage_never_invents_an_inspected_point(damages in prop::collection::vec(damage(), 1..4)) {
        let machine = machine("swivel-head");
        let plan = plan(&machine, "head", "x+");
        let form = points::PointsForm::built_in().unwrap().into_iter().find(|f| f.name == "msr").unwrap();
        let mut text = include_bytes!("../../tests/logs/good/inspection.msr").to_vec();
        damages.iter().for_each(|d| apply(&mut text, d));
        let n_lines = |word: &[u8]| text.windows(word.len()).filter(|w| *w == word).count();
        for run in [None, Some(1)] {
            if let Ok((read, _)) = points::parse(&text, "t", &form, run) {
                prop_assert!(read.points.len() <= n_lines(b"G801").min(n_lines(b"G800")));
            }
        }
        if let Ok((read, _)) = read(&text, "t", Writer::Points(&form), &machine, &plan) {
            let ids: std::collections::BTreeSet<u64> = read.touches.iter().map(|t| t.id).collect();
            prop_assert!(ids.len() == read.touches.len() && ids.iter().all(|id| plan.touch(*id).is_some()));
        }
    }

    #[test]
    fn any_bytes_are_read_or_refused(bytes in prop::collection::vec(any::<u8>(), 0..400), text in "[PHEN0-9X.\\- \r\n]{0,300}") {
        let machine = machine("trunnion");
        let plan = plan(&machine, "table", "x+");
        for input in [bytes.as_slice(), text.as_bytes()] {
            let _ = read(input, "t", Writer::Controller(&post()), &machine, &plan);
            let _ = read(input, "t", Writer::Csv, &machine, &plan);
        }
    }
}
