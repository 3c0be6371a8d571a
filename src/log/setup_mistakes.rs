//! When most touches lie far from their places: which simple mistake would explain it?

use super::matching::{POSE_ROOM_DEG, fits, ranges, turned_deg};
use super::origin_shift::common_shift;
use super::position_rows::Lines;
use super::touch::RawTouch;
use crate::axes::{AxisName, Position};
use crate::diag::Finding;
use crate::machine::Machine;
use crate::program::plan::{Plan, PlanTouch};
use crate::units::{inch_from_mm, mm_from_inch};
use nalgebra::Vector3;

/// A simple mistake that puts touches elsewhere.
#[derive(Debug, Clone, PartialEq)]
pub enum LogMistake {
    /// The sign of these axes.
    Sign(Vec<AxisName>),
    /// The columns of two axes are exchanged.
    Exchanged(AxisName, AxisName),
    /// The columns of X, Y and Z are exchanged in a circle.
    ExchangedXyz,
    /// Inches were read as millimetres.
    Inches,
    /// Millimetres were read as inches.
    Millimetres,
    /// All positions are shifted.
    Shift {
        /// By so much.
        by_mm: Vector3<f64>,
        /// They are inches as well.
        inches: bool,
    },
}

impl LogMistake {
    /// As the effect of set-up mistakes calls its parameters: `flip_B`, `flip_B flip_C`, `swap_XY`, `inch`.
    #[must_use]
    pub fn name(&self) -> String {
        match self {
            Self::Sign(axes) => axes.iter().map(|a| format!("flip_{a}")).collect::<Vec<_>>().join(" "),
            Self::Exchanged(a, b) => format!("swap_{a}{b}"),
            Self::ExchangedXyz => "swap_XYZ".to_owned(),
            Self::Inches => "inch".to_owned(),
            Self::Millimetres => "mm".to_owned(),
            Self::Shift { inches: true, .. } => "inch shift".to_owned(),
            Self::Shift { inches: false, .. } => "shift".to_owned(),
        }
    }

    /// After "would be right if".
    #[must_use]
    pub fn says(&self) -> String {
        crate::words::log::mistake(self)
    }
}

/// A mistake with what to check and what undoes it.
struct Mistake {
    kind: LogMistake,
    help: &'static str,
    undo: Box<dyn Fn(Position) -> Position>,
}

/// What would put the touches that are far from their places where they belong.
#[derive(Debug, Clone, PartialEq)]
pub struct Supposed {
    pub mistake: LogMistake,
    /// What to look at.
    pub help: &'static str,
    /// So many touches are far from their places …
    pub far: usize,
    /// … so many would be right …
    pub right: usize,
    /// … of so many.
    pub of: usize,
}

/// The one simple mistake that explains nearly all touches that lie far from their places, without harm to the rest: the
/// sign of a rotary axis shows only in the poses where it is not 0. Each touch with its position and the axes that the
/// log holds.
#[must_use]
pub fn suppose(machine: &Machine, touches: &[(&PlanTouch, Position, [bool; 6])]) -> Option<Supposed> {
    let fits_as = |undo: &dyn Fn(Position) -> Position| -> Vec<bool> {
        touches.iter().map(|(planned, at, present)| fits(machine, planned, &undo(*at), *present)).collect()
    };
    let good = fits_as(&|p| p);
    let far = good.iter().filter(|g| !**g).count();
    if far < 3 {
        return None;
    }
    mistakes(machine).into_iter().find_map(|mistake| {
        let mended = fits_as(&mistake.undo);
        let right = mended.iter().filter(|m| **m).count();
        let of_far = mended.iter().zip(&good).filter(|(m, g)| **m && !**g).count();
        (of_far * 10 >= far * 9 && right * 10 >= touches.len() * 9).then_some(Supposed {
            mistake: mistake.kind,
            help: mistake.help,
            far,
            right,
            of: touches.len(),
        })
    })
}

/// The finding where some touches (not most) lie far from their places and one simple mistake explains it.
pub(super) fn hint(machine: &Machine, pairs: &[(&PlanTouch, RawTouch)]) -> Option<Finding> {
    let touches: Vec<(&PlanTouch, Position, [bool; 6])> =
        pairs.iter().map(|(planned, raw)| (*planned, whole(raw, planned), raw.present)).collect();
    let Supposed { mistake, help, far, right, of } = suppose(machine, &touches)?;
    let says = mistake.says();
    let message =
        format!("{far} of {of} touches are far from their planned positions; {right} would be right if {says}");
    Some(Finding::warning("log::swapped", message).help(help))
}

/// The axis positions of a touch; axes that the log lacks stand at the plan's pose.
fn whole(raw: &RawTouch, planned: &PlanTouch) -> Position {
    let mut position = planned.nominal_position();
    AxisName::ALL.into_iter().filter(|a| raw.present[a.index()]).for_each(|a| position.set(a, raw.position.get(a)));
    position
}

/// The finding for a log of which `bad` touches are not where the plan has them.
pub(super) fn explain(machine: &Machine, pairs: &[(&PlanTouch, RawTouch)], bad: usize) -> Finding {
    for mistake in mistakes(machine).into_iter().chain(shift(pairs, whole)) {
        let good = pairs
            .iter()
            .filter(|(planned, raw)| fits(machine, planned, &(mistake.undo)(whole(raw, planned)), raw.present))
            .count();
        if good * 10 >= pairs.len() * 9 {
            let message = format!(
                "{bad} of {} touches are far from their planned positions, and {good} would be right if {}",
                pairs.len(),
                mistake.kind.says()
            );
            return Finding::error("log::swapped", message).help(mistake.help);
        }
    }
    let ids: Vec<u64> = pairs.iter().map(|(t, _)| t.id).collect();
    let message = format!(
        "{bad} of {} touches are far from where the plan has them (touches {}): this is the log of another program or machine",
        pairs.len(),
        ranges(&ids)
    );
    Finding::error("log::other_plan", message)
        .help("use the plan that `axiscal generate` wrote together with the program")
}

/// What would put most rows of a log without numbers onto the lines of the plan's touches; `on_none` lie on none.
pub(super) fn explain_rows(plan: &Plan, lines: &Lines<'_>, rows: &[RawTouch], on_none: usize) -> Option<Finding> {
    let supposed = suppose_rows(plan, lines, rows, on_none)?;
    let message = format!(
        "{} of {} rows lie on the line of no touch, and {} would if {}",
        supposed.far,
        supposed.of,
        supposed.right,
        supposed.mistake.says()
    );
    Some(Finding::error("log::swapped", message).help(supposed.help))
}

/// The one simple mistake that explains nearly all rows.
pub(super) fn suppose_rows(plan: &Plan, lines: &Lines<'_>, rows: &[RawTouch], on_none: usize) -> Option<Supposed> {
    let right = |undo: &dyn Fn(Position) -> Position| {
        rows.iter().filter(|row| !lines.at(&undo(row.position), row.present).is_empty()).count()
    };
    let simple = mistakes(lines.machine()).into_iter();
    let shifts =
        [(false, Box::new(|p: Position| p) as Box<dyn Fn(Position) -> Position>), (true, Box::new(inches_undone))];
    let shifted = shifts.into_iter().filter_map(|(inches, first)| {
        let by = shift_of_rows(plan, lines, rows, &first)?;
        Some(Mistake {
            kind: LogMistake::Shift { by_mm: by, inches },
            help: SHIFT_HELP,
            undo: Box::new(move |p| {
                let p = first(p);
                p.with_xyz_mm(p.xyz_mm() - by)
            }),
        })
    });
    simple.chain(shifted).find_map(|mistake| {
        let right = right(&mistake.undo);
        let help = match mistake.kind {
            LogMistake::Inches => "rows do not say their unit: write unit = \"inch\" into [log.columns] of a postprocessor file of your own",
            LogMistake::Shift { .. } => {
                "rows of PROBEOPEN and of a console are in the work coordinate system that was active: was it another one than the program's? is `origin` in machines.toml the machine position at the origin of R?"
            }
            _ => mistake.help,
        };
        (right * 10 >= rows.len() * 9).then_some(Supposed {
            mistake: mistake.kind,
            help,
            far: on_none,
            right,
            of: rows.len(),
        })
    })
}

/// The shift that puts nearly all rows onto lines of the plan; `first` is done before.
fn shift_of_rows(
    plan: &Plan,
    lines: &Lines<'_>,
    rows: &[RawTouch],
    first: &dyn Fn(Position) -> Position,
) -> Option<Vector3<f64>> {
    let machine = lines.machine();
    let found: Vec<Position> = rows.iter().map(|row| first(row.position)).collect();
    let found_mm: Vec<Vector3<f64>> = found.iter().map(Position::xyz_mm).collect();
    let planned: Vec<Position> = plan.touches.iter().map(PlanTouch::nominal_position).collect();
    let planned_mm: Vec<Vector3<f64>> = planned.iter().map(Position::xyz_mm).collect();
    let posed = |i: usize, j: usize| turned_deg(machine, &found[i], &planned[j], rows[i].present) <= POSE_ROOM_DEG;
    let lies = |i: usize, by: &Vector3<f64>| {
        lines.at(&found[i].with_xyz_mm(found_mm[i] - by), rows[i].present).first().copied()
    };
    common_shift(&found_mm, &planned_mm, &posed, &lies)
}

fn mistakes(machine: &Machine) -> Vec<Mistake> {
    let columns = "check the order of the columns: the file itself is not changed";
    let signs =
        "coordinates are NC coordinates, tool over workpiece: X grows when the tool goes to +X over the workpiece";
    let mut all = Vec::new();
    let [x, y, z] = [0usize, 1, 2];
    let orders = [
        ([y, x, z], LogMistake::Exchanged(AxisName::X, AxisName::Y)),
        ([z, y, x], LogMistake::Exchanged(AxisName::Z, AxisName::X)),
        ([x, z, y], LogMistake::Exchanged(AxisName::Y, AxisName::Z)),
        ([y, z, x], LogMistake::ExchangedXyz),
        ([z, x, y], LogMistake::ExchangedXyz),
    ];
    for (order, kind) in orders {
        all.push(Mistake {
            kind,
            help: columns,
            undo: Box::new(move |p| p.with_xyz_mm(Vector3::new(p.0[order[0]], p.0[order[1]], p.0[order[2]]))),
        });
    }
    let rotary: Vec<AxisName> = machine.rotary().map(|a| a.name).collect();
    if let [first, second] = rotary[..] {
        all.push(Mistake {
            kind: LogMistake::Exchanged(first, second),
            help: columns,
            undo: Box::new(move |mut p| {
                p.0.swap(first.index(), second.index());
                p
            }),
        });
    }
    all.push(Mistake {
        kind: LogMistake::Inches,
        help: "the head of a log says its unit, MM or INCH, as the program was written (unit in [log]): was the log written by it?",
        undo: Box::new(inches_undone),
    });
    all.push(Mistake {
        kind: LogMistake::Millimetres,
        help: "the head of a log says INCH, or `unit` of [log] does: was the log written by that program?",
        undo: Box::new(|p| p.with_xyz_mm(p.xyz_mm().map(inch_from_mm))),
    });
    let axes: Vec<AxisName> = AxisName::ALL.into_iter().filter(|a| machine.axis(*a).is_some()).collect();
    for subset in 1u32..1 << axes.len() {
        // one or two signs: more is no simple mistake any longer
        if subset.count_ones() > 2 {
            continue;
        }
        let turned: Vec<AxisName> =
            axes.iter().enumerate().filter(|(i, _)| subset >> i & 1 == 1).map(|(_, a)| *a).collect();
        all.push(Mistake {
            kind: LogMistake::Sign(turned.clone()),
            help: signs,
            undo: Box::new(move |mut p| {
                turned.iter().for_each(|a| p.set(*a, -p.get(*a)));
                p
            }),
        });
    }
    all
}

fn inches_undone(at: Position) -> Position {
    at.with_xyz_mm(at.xyz_mm().map(mm_from_inch))
}

const SHIFT_HELP: &str =
    "is `origin` in machines.toml the machine position at the origin of R? was another offset active in that run?";

/// The same shift in all touches: another origin.
fn shift(pairs: &[(&PlanTouch, RawTouch)], whole: impl Fn(&RawTouch, &PlanTouch) -> Position) -> Option<Mistake> {
    let median = |axis: usize| {
        let mut all: Vec<f64> =
            pairs.iter().map(|(t, raw)| whole(raw, t).0[axis] - t.nominal_position().0[axis]).collect();
        all.sort_by(f64::total_cmp);
        all.get(all.len() / 2).copied()
    };
    let by = Vector3::new(median(0)?, median(1)?, median(2)?);
    Some(Mistake {
        kind: LogMistake::Shift { by_mm: by, inches: false },
        help: SHIFT_HELP,
        undo: Box::new(move |p| p.with_xyz_mm(p.xyz_mm() - by)),
    })
}
