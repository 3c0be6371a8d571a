//! The pins of the stock modules against the modules themselves, as LinuxCNC installs them.

use super::by_hand::tip;
use super::support::{Spread, ask, harness, have, machine, pose, term};
use axiscal::axes::{AxisName, Position};
use axiscal::machine::{Carrier, Machine};
use axiscal::post::Postprocessor;
use axiscal::tables::compensation::Term;
use axiscal::tables::linuxcnc::stock::{self, Module, pins};
use axiscal::tables::place::{Dof, Place};
use std::path::PathBuf;

/// The module in the version that Debian's package has.
fn module_of(machine: &Machine) -> Module {
    let (post, _) = Postprocessor::load_built_in_or_file("linuxcnc").unwrap();
    stock::module_of(machine, post.release(Some("2.9")).unwrap()).unwrap()
}

/// Where Debian's package puts the modules.
fn installed(module: Module) -> Option<PathBuf> {
    let path = PathBuf::from(format!("/usr/lib/linuxcnc/modules/{}.so", module.name));
    if !path.exists() {
        println!("LEFT OUT: {} is not installed", module.name);
        return None;
    }
    have("gcc", "--version", "the stock modules").then_some(path)
}

fn five(p: &Position, machine: &Machine) -> String {
    let joints: Vec<String> = AxisName::ALL
        .into_iter()
        .filter(|a| machine.axis(*a).is_some())
        .map(|a| format!("{:.17e}", p.get(a)))
        .collect();
    format!("forward {} 0", joints.join(" "))
}

fn offsets(module: Module, spread: &mut Spread) -> Vec<Term> {
    [module.tilting, AxisName::C]
        .into_iter()
        .flat_map(|axis| [Dof::Dx, Dof::Dy, Dof::Dz].map(|dof| term(axis, Place::Before, dof, 0.0)))
        .map(|t| Term { value: spread.next(0.4), ..t })
        .collect()
}

/// World coordinates of the module are the tip's place in the real workpiece, shifted by what the pins file says and by
/// the tool's length (and the origin and pivot): at any place of the rotary axes, with offsets of both.
#[test]
fn pins_say_where_the_real_axes_are() {
    for name in ["trunnion", "swivel-table-b"] {
        let mut machine = machine(name);
        let Some(so) = installed(module_of(&machine)) else { return };
        let folder = tempfile::tempdir().unwrap();
        let harness = harness(folder.path());
        for seed in 0..10 {
            let mut spread = Spread::new(seed);
            // axes that do not meet, a pivot and an origin: nothing may hide in a zero
            for axis in machine.axes.iter_mut().filter(|a| a.name.is_rotary()) {
                axis.point = nalgebra::Vector3::new(spread.next(40.0), spread.next(40.0), -250.0 + spread.next(40.0));
            }
            machine.tool.pivot = nalgebra::Vector3::new(spread.next(30.0), spread.next(30.0), spread.next(30.0));
            for axis in [AxisName::X, AxisName::Y, AxisName::Z] {
                machine.origin.set(axis, spread.next(100.0));
            }
            let module = module_of(&machine);
            let terms = offsets(module, &mut spread);
            let found = pins(&machine, module, &terms);
            let mut lines: Vec<String> =
                found.pins.iter().map(|(pin, v)| format!("set {}.{pin} {v}", module.name)).collect();
            let poses: Vec<Position> = (0..40).map(|_| pose(&machine, &mut spread)).collect();
            let displayed = |p: &Position| {
                let mut shown = *p;
                for axis in &machine.axes {
                    shown.set(axis.name, p.get(axis.name) + machine.origin.get(axis.name).unwrap_or(0.0));
                }
                shown
            };
            lines.extend(poses.iter().map(|p| five(&displayed(p), &machine)));
            let letters: String =
                AxisName::ALL.into_iter().filter(|a| machine.axis(*a).is_some()).map(AxisName::letter).collect();
            let answers = ask(&harness, &so, &letters, &lines);
            let length = machine.tool.length_mm;
            for (p, world) in poses.iter().zip(answers) {
                // the reference does not matter: there are no tilts
                let real = tip(&machine, p, &terms, [0.0; 3], length);
                for k in 0..3 {
                    let axis = [AxisName::X, AxisName::Y, AxisName::Z][k];
                    let shown = real[k] + found.workpiece_shift_mm[k] - machine.tool.pivot[k]
                        + machine.origin.get(axis).unwrap_or(0.0)
                        + if k == 2 { length } else { 0.0 };
                    assert!((world[k] - shown).abs() < 1e-10, "{name} {axis}: {} {shown}", world[k]);
                }
            }
        }
    }
}

/// A machine whose positive angles turn the table left-handed is one with conventional directions: the joints that its own chain
/// needs are those that LinuxCNC issue 2435 expects, with both axes through the machine's zero and no tool.
#[test]
fn a_left_handed_table_needs_the_joints_that_others_expect() {
    let mut machine = machine("swivel-table-b");
    for axis in machine.axes.iter_mut().filter(|a| a.name.is_rotary()) {
        (axis.point, axis.sense) = (nalgebra::Vector3::zeros(), -1.0);
    }
    machine.tool.pivot = nalgebra::Vector3::zeros();
    let (post, _) = Postprocessor::load_built_in_or_file("linuxcnc").unwrap();
    let module = stock::module_of(&machine, post.release(Some("master")).unwrap()).unwrap();
    assert_eq!((module.name, module.conventional), ("xyzbc-trt-kins", Some(true)));
    let table = include_str!("../../linuxcnc_kins/expected_xyzbc_trt.csv");
    assert_eq!(table.lines().count(), 4);
    for line in table.lines().skip(1) {
        let v: Vec<f64> = line.split(',').map(|v| v.parse().unwrap()).collect();
        let mut pose = Position::default();
        pose.set(AxisName::B, v[3]);
        pose.set(AxisName::C, v[4]);
        let point = nalgebra::Vector3::new(v[0], v[1], v[2]);
        let joints = machine.linear_for_ball(Carrier::Axis(AxisName::C), &pose, &point, 0.0).unwrap().xyz_mm();
        let expected = nalgebra::Vector3::new(v[5], v[6], v[7]);
        assert!((joints - expected).amax() < 1e-12, "{line}: {joints}");
    }
}
