//! Measured again: what acted on the touches is added to, what did not act is replaced, what the touches do not tell stays.

use super::controls::{
    CONTROLS, Planted, accepting, correction, described, found_during, found_with_held, left, loaded, plan, readings,
    scenario, tables, text,
};
use super::support::machine;
use axiscal::diag::source;
use axiscal::machine::Machine;
use axiscal::post::tables::LengthUnit;
use axiscal::tables::Compensation;
use axiscal::tables::control::backup::{self, Old};
use axiscal::tables::control::{self, Export, Options};
use axiscal::tables::correction::During;
use axiscal::tables::linuxcnc;

const BARE: During = During { loaded: None, transformation: false };

fn errors() -> Planted<'static> {
    vec![
        ("location-a", "EY0A", 0.021),
        ("location-a", "EZ0A", -0.033),
        ("location-c", "EX0C", 0.012),
        ("location-c", "EY0C", 0.026),
    ]
}

fn during(machine: &Machine, control: &str, planted: &Planted, during: During, old: Old) -> Export {
    let found = found_during(machine, planted, during);
    let options = Options { old, ..accepting() };
    let unknown = during.loaded.is_none() && options.old.values.is_empty();
    let options = if unknown { described(machine, control, &found, &options) } else { options };
    control::export(machine, control, &tables(control), &found, &options).unwrap().0
}

fn values(export: &Export) -> Vec<(String, f64, f64)> {
    export.values.iter().map(|v| (v.id.clone(), v.old, v.new)).collect()
}

/// Largest reading on the machine with these errors under a table, the workpiece touched off again, µm.
fn reads(machine: &Machine, planted: &Planted, export: &Export) -> f64 {
    let plan = plan(machine, 3);
    left(&plan, &readings(machine, &plan, &scenario(machine, planted), Some(&loaded(machine, export, None)))) * 1e3
}

/// A program of axis positions shows the whole errors, whatever vectors the control holds: they are not added twice.
#[test]
fn vectors_that_did_not_act_are_replaced() {
    let machine = machine("trunnion");
    for control in CONTROLS {
        let first = during(&machine, control, &errors(), BARE, Old::default());
        let again = During { loaded: Some(&first.compensation), transformation: false };
        let second = during(&machine, control, &errors(), again, Old::default());
        for ((id, _, new), (_, old, again)) in values(&first).into_iter().zip(values(&second)) {
            assert!((old - new).abs() < 1e-9, "{control} {id}: the old value is what was loaded: {old} {new}");
            assert!((again - new).abs() < 1e-9, "{control} {id}: {new}, measured again {again}");
        }
        assert!(second.values.iter().all(|v| v.known), "{control}");
        assert!(reads(&machine, &errors(), &second) < 3.0, "{control}");
        // the same errors found under the transformation are what the first table left: they add
        let on = During { loaded: Some(&first.compensation), transformation: true };
        let added = during(&machine, control, &errors(), on, Old::default());
        assert!(reads(&machine, &errors(), &added) > 10.0, "{control}");
    }
}

/// What a second study does not tell stays as the first one wrote it.
#[test]
fn what_is_not_told_again_stays() {
    let machine = machine("trunnion");
    for control in CONTROLS {
        let first = during(&machine, control, &errors(), BARE, Old::default());
        let part: Planted = vec![("location-c", "EX0C", 0.016)];
        let again = During { loaded: Some(&first.compensation), transformation: false };
        let second = during(&machine, control, &part, again, Old::default());
        let now: Planted = errors().into_iter().map(|(e, n, v)| (e, n, if n == "EX0C" { 0.016 } else { v })).collect();
        assert!(reads(&machine, &now, &second) < 3.0, "{control}: {:?}", values(&second));
    }
}

#[test]
fn pins_that_did_not_act_are_replaced() {
    let machine = machine("trunnion");
    let planted: Planted = vec![("location-a", "EY0A", 0.021), ("location-c", "EX0C", 0.012), ("zero-c", "EC0C", 0.01)];
    let export = |during: During| {
        linuxcnc::export(&machine, &found_during(&machine, &planted, during), &linuxcnc::Options::default()).unwrap().0
    };
    let stock = |e: &linuxcnc::Export| e.stock.compensation.clone();
    let first = stock(&export(BARE));
    let pins = |c: &Compensation| c.stock.as_ref().unwrap().pins.clone();
    let off = stock(&export(During { loaded: Some(&first), transformation: false }));
    assert_eq!(pins(&off), pins(&first));
    // a home offset acts always
    let home = |c: &Compensation| c.stock.as_ref().unwrap().home_offset_deg.values().sum::<f64>();
    assert!((home(&off) - 2.0 * home(&first)).abs() < 1e-9 && home(&first) != 0.0);
    let on = stock(&export(During { loaded: Some(&first), transformation: true }));
    assert!((pins(&on)["x-rot-point"] - 0.024).abs() < 1e-9, "{:?}", pins(&on));
}

/// The builder's numbers are right but for 1 um, and the machine's description is nominal: touches of a program of axis
/// positions hold those 0.12 mm, which must not be counted twice. What lies along a line is the user's own.
#[test]
fn old_values_that_did_not_act_are_no_base() {
    let machine = machine("trunnion");
    let t = tables("fanuc");
    let text_of = "%\nN19700Q1M0.050;\nN19701Q1M0.120;\nN19702Q1M-250.000;\nN19703Q1M0.000;\nN19704Q1M0.000;\nN19705Q1M0.500;\n%\n";
    let old = || backup::read(&source("b", text_of), &t.backup, &control::names(&machine, &t)).unwrap();
    let planted: Planted = vec![
        ("location-a", "EY0A", 0.121),
        ("location-a", "EZ0A", 0.0),
        ("location-c", "EX0C", 0.0),
        ("location-c", "EY0C", 0.0),
    ];
    let found = found_during(&machine, &planted, BARE);
    let options = Options { old: old(), ..accepting() };
    let (export, findings) = control::export(&machine, "fanuc", &t, &found, &options).unwrap();
    let of = |e: &Export, name: &str| e.values.iter().find(|v| v.names.values().any(|n| n == name)).unwrap().new;
    assert!((of(&export, "N19701") - 0.121).abs() < 1e-9, "{}", of(&export, "N19701"));
    assert!((of(&export, "N19700") - 0.050).abs() < 1e-9 && (of(&export, "N19702") + 250.0).abs() < 1e-9);
    // A's point along A, and C's along C, are where the builder has them
    assert!((of(&export, "N19705") - 0.5).abs() < 1e-9 && (of(&export, "N19703") + 0.05).abs() < 1e-9);
    assert!(
        findings.0.iter().any(|f| f.code == "tables::old_did_not_act" && f.message.contains("place axis A 0.1200 mm"))
    );
    assert!(reads(&machine, &planted, &export) < 1.5);
    assert!(
        text(&export, "restore_parameters.txt").contains("N19701Q1L1M0.120"),
        "{:?}",
        export.files.iter().map(|f| &f.0).collect::<Vec<_>>()
    );
    // what the study does not tell stays the builder's: a machine that stands where those numbers say
    let part: Planted = vec![("location-c", "EX0C", 0.004)];
    let export = during(&machine, "fanuc", &part, BARE, old());
    assert!((of(&export, "N19701") - 0.120).abs() < 1e-9 && (of(&export, "N19703") - 0.004 + 0.05).abs() < 1e-9);
}

/// Under the transformation the control's own numbers acted: without a backup they are what the loaded compensation wrote,
/// to the digit, so that rounding does not grow.
#[test]
fn the_next_export_starts_from_what_was_written() {
    let machine = machine("trunnion");
    let t = tables("fanuc");
    let text_of = "%\nN19700Q1M0.000;\nN19701Q1M0.000;\nN19702Q1M-250.081;\nN19703Q1M0.000;\nN19704Q1M0.000;\nN19705Q1M0.000;\n%\n";
    let old = backup::read(&source("b", text_of), &t.backup, &control::names(&machine, &t)).unwrap();
    let on = During { loaded: None, transformation: true };
    let mut last =
        during(&machine, "fanuc", &vec![("location-a", "EY0A", 0.0104), ("location-a", "EZ0A", -0.02)], on, old);
    let of = |e: &Export, name: &str| e.values.iter().find(|v| v.names.values().any(|n| n == name)).unwrap().clone();
    assert_eq!((of(&last, "N19701").new, of(&last, "N19702").new), (0.010, -250.101));
    for round in 0..3 {
        // what rounding left is found again, each time
        let again = During { loaded: Some(&last.compensation), transformation: true };
        let next = during(
            &machine,
            "fanuc",
            &vec![("location-a", "EY0A", 0.0004), ("location-a", "EZ0A", 0.0)],
            again,
            Old::default(),
        );
        assert_eq!((of(&next, "N19701").old, of(&next, "N19702").old), (0.010, -250.101), "{round}");
        assert_eq!((of(&next, "N19701").new, of(&next, "N19702").new), (0.010, -250.101), "{round}");
        assert!(next.values.iter().all(|v| v.known));
        assert!(text(&next, "restore_parameters.txt").contains("N19702Q1L1M-250.101 "));
        last = next;
    }
}

/// A control without directions takes a tilt as the offset that it makes at the workpiece's height. Where the study does not
/// know the offset, the tilt moves it from nowhere: nothing is written, in the next round neither.
#[test]
fn a_tilt_moves_no_place_that_is_not_told() {
    let machine = machine("swivel-head");
    let tilts: Planted = vec![("location-c", "EA0C", 0.004), ("location-c", "EB0C", 0.01)];
    for control in ["fanuc", "heidenhain"] {
        let found = found_during(&machine, &tilts, BARE);
        let (export, findings) = control::export(&machine, control, &tables(control), &found, &accepting()).unwrap();
        assert!(export.values.iter().all(|v| v.new == v.old), "{control}: {:?}", values(&export));
        assert!(findings.0.iter().any(|f| f.code == "tables::kept" && f.message.contains("EX0C")), "{control}");
        let again = During { loaded: Some(&export.compensation), transformation: true };
        let second = during(&machine, control, &tilts, again, Old::default());
        assert!(second.values.iter().all(|v| v.new == v.old), "{control}: {:?}", values(&second));
        // where it is told, the tilt counts
        let mut told = tilts.clone();
        told.extend([("location-c", "EX0C", 0.0), ("location-c", "EY0C", 0.0)]);
        let told = during(&machine, control, &told, BARE, Old::default());
        assert!(told.values.iter().any(|v| (v.new - v.old).abs() > 0.005), "{control}: {:?}", values(&told));
    }
}

/// Along its line an axis stands nowhere in particular: round after round the numbers there stay.
#[test]
fn nothing_is_written_along_an_axis_s_own_line() {
    let machine = machine("trunnion");
    let mut planted = errors();
    planted.extend([("location-a", "EB0A", 0.008), ("location-a", "EC0A", -0.006), ("location-c", "EA0C", 0.005)]);
    for control in CONTROLS {
        let mut export = during(&machine, control, &planted, BARE, Old::default());
        for _ in 0..2 {
            let x = export.values.iter().find(|v| v.unit == "mm" && v.id.ends_with(".x")).unwrap();
            assert!(x.says.contains('A') || !x.says.is_empty());
            assert_eq!(x.new, x.old, "{control}: {}", x.id);
            // tilts that the control cannot hold are found again, with what they leave
            let tilts: Planted = planted
                .iter()
                .filter(|(_, n, _)| !n.starts_with("EX") && !n.starts_with("EY") && !n.starts_with("EZ"))
                .copied()
                .collect();
            let again = During { loaded: Some(&export.compensation), transformation: true };
            export = during(&machine, control, &tilts, again, Old::default());
        }
    }
}

/// The control's basic system says the unit: a table in inches does what the one in millimetres does.
#[test]
fn tables_in_inches_do_the_same() {
    let machine = machine("trunnion");
    for control in CONTROLS {
        let found = correction(&machine, &errors(), None);
        let options = Options { unit: LengthUnit::Inch, ..accepting() };
        let (export, _) = control::export(&machine, control, &tables(control), &found, &options).unwrap();
        let reads = reads(&machine, &errors(), &export);
        assert!(reads < 3.0, "{control}: {reads} um");
    }
}

/// Tilts that the control cannot hold stand in its offsets at the workpiece's height. Measured again with axis positions the
/// whole of them is found again: what they made along an axis's line is made anew, and not on top of itself.
#[test]
fn the_share_of_a_tilt_does_not_grow() {
    let mut planted = errors();
    planted.extend([
        ("location-a", "EB0A", 0.0131),
        ("location-a", "EC0A", -0.006),
        ("location-c", "EA0C", 0.005),
        ("location-c", "EB0C", -0.0124),
    ]);
    let machine = machine("trunnion");
    let rounds = |control: &str, tilts_held: bool| {
        let first = during(&machine, control, &planted, BARE, Old::default());
        let again = During { loaded: Some(&first.compensation), transformation: false };
        let held: &[&str] = if tilts_held { &["EB0A", "EC0A", "EA0C", "EB0C"] } else { &[] };
        let found = found_with_held(&machine, &planted, held, again);
        let second = control::export(&machine, control, &tables(control), &found, &accepting()).unwrap().0;
        for ((id, _, new), (_, _, again)) in values(&first).into_iter().zip(values(&second)) {
            assert!((new - again).abs() < 1.1e-3, "{control} {id} ({held:?}): {new}, measured again {again}");
        }
    };
    for control in ["fanuc", "haas", "heidenhain"] {
        rounds(control, false);
        rounds(control, true);
    }
    rounds("sinumerik", false);
    let stock = |during: During| {
        let found = found_during(&machine, &planted, during);
        linuxcnc::export(&machine, &found, &linuxcnc::Options::default()).unwrap().0.stock.compensation
    };
    let first = stock(BARE);
    let second = stock(During { loaded: Some(&first), transformation: false });
    for (pin, value) in &first.stock.as_ref().unwrap().pins {
        let again = second.stock.as_ref().unwrap().pins[pin];
        assert!((value - again).abs() < 1e-9, "{pin}: {value}, measured again {again}");
    }
}

/// A turn of the head stands in offsets at the ball. Measured again under the transformation the turn is found again, and the
/// table's axis as much further off as the ball was: nothing changes. The same with axis positions.
#[test]
fn the_share_of_a_turn_of_the_head_does_not_grow() {
    let machine = machine("swivel-head");
    let aside_mm = 202.684 * 0.01_f64.to_radians().sin();
    let with = |ey0c: f64| vec![("location-b", "EA0B", 0.01), ("location-c", "EY0C", ey0c)];
    for control in ["fanuc", "heidenhain"] {
        let bare = during(&machine, control, &with(0.01), BARE, Old::default());
        let tcp = During { loaded: None, transformation: true };
        let first = during(&machine, control, &with(0.01), tcp, Old::default());
        assert_eq!(values(&bare), values(&first), "{control}");
        assert!(values(&first).iter().any(|(_, old, new)| (new - old - (0.01 - aside_mm)).abs() < 1.1e-3), "{control}");
        for (transformation, ey0c) in [(true, aside_mm), (false, 0.01)] {
            let loaded = During { loaded: Some(&first.compensation), transformation };
            let second = during(&machine, control, &with(ey0c), loaded, Old::default());
            for ((id, _, new), (_, _, again)) in values(&first).into_iter().zip(values(&second)) {
                assert!((new - again).abs() < 1.1e-3, "{control} {id} {transformation}: {new}, measured again {again}");
            }
            let (rest, again) = (first.rest_um, second.rest_um);
            assert!((rest - again).abs() < 1.0, "{control} {transformation}: {rest} um, measured again {again} um");
        }
    }
}

/// A turn of the head that the study holds is one of the machine's, too.
#[test]
fn a_turn_of_the_head_that_is_held_counts_as_one_that_is_found() {
    let machine = machine("swivel-head");
    let planted = vec![("location-b", "EA0B", 0.01), ("location-c", "EY0C", 0.01)];
    for control in ["fanuc", "heidenhain"] {
        let [found, held] = [&[][..], &["EA0B"]].map(|held| {
            let known = found_with_held(&machine, &planted, held, BARE);
            control::export(&machine, control, &tables(control), &known, &accepting()).unwrap().0
        });
        assert_eq!(values(&found), values(&held), "{control}");
        assert!((found.rest_um - held.rest_um).abs() < 1e-6, "{control}: {} {}", found.rest_um, held.rest_um);
    }
}

/// What is forced is still asked whether it is verified.
#[test]
fn force_does_not_accept_what_is_not_verified() {
    let machine = machine("swivel-head");
    let known = found_during(&machine, &errors_of_the_head(), BARE);
    let options = Options { force: true, ..Options::default() };
    let refused = control::export(&machine, "fanuc", &tables("fanuc"), &known, &options).unwrap_err();
    assert!(refused.0.iter().any(|f| f.code == "tables::unverified"), "{refused}");
}

fn errors_of_the_head() -> Planted<'static> {
    vec![("location-b", "EA0B", 0.01), ("location-c", "EY0C", 0.01)]
}

/// The head alone is measured: where the table stands next to it nobody touched, and the builder's number stays, moved with the
/// head. C lies at 0.060 and the ball 0.101 beside B: the control knows both to 1 um.
#[test]
fn a_table_that_is_not_told_stays_next_to_the_head() {
    let machine = machine("swivel-head");
    let found: Planted = vec![("location-b", "EX0B", 0.101), ("location-b", "EZ0B", 0.0)];
    for (control, text_of, name) in [
        (
            "fanuc",
            "%\nN19700Q1M-0.040;\nN19701Q1M0.000;\nN19702Q1M0.000;\nN19709Q1M-0.100;\nN19710Q1M0.000;\nN19711Q1M0.000;\n%\n",
            "N19700",
        ),
        (
            "sinumerik",
            "$MC_TRAFO5_BASE_TOOL_1[0]=-0.1\n$MC_TRAFO5_JOINT_OFFSET_1[0]=0.1\n$MC_TRAFO5_JOINT_OFFSET_PART_1[0]=-0.04\n$MC_TRAFO5_PART_OFFSET_1[0]=0.04\n",
            "$MC_TRAFO5_JOINT_OFFSET_PART_1[0]",
        ),
    ] {
        let t = tables(control);
        let old = || backup::read(&source("b", text_of), &t.backup, &control::names(&machine, &t)).unwrap();
        let of = |e: &Export| e.values.iter().find(|v| v.names.values().any(|n| n == name)).unwrap().new;
        let bare = during(&machine, control, &found, BARE, old());
        assert!((of(&bare) + 0.041).abs() < 1e-6, "{control}: {}", of(&bare));
        // under the transformation the same is left to find
        let on = During { loaded: None, transformation: true };
        let rest: Planted = vec![("location-b", "EX0B", 0.001), ("location-b", "EZ0B", 0.0)];
        assert!((of(&during(&machine, control, &rest, on, old())) + 0.041).abs() < 1e-6, "{control}");
        // and from what a first export wrote, without a backup
        let both: Planted = vec![("location-b", "EX0B", 0.101), ("location-c", "EX0C", 0.060)];
        let first = during(&machine, control, &both, BARE, Old::default());
        let again = During { loaded: Some(&first.compensation), transformation: false };
        let second = during(&machine, control, &found, again, Old::default());
        assert!((of(&second) + 0.041).abs() < 1e-6, "{control}: {}", of(&second));
    }
}
