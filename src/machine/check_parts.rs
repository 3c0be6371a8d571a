//! The parts of a machine that are no axes: spindle, probe, solids and mountings, checked for [`super::check`].

use super::as_written as w;
use super::check::{Check, LARGEST, LARGEST_SCATTER_UM};
use super::risers;
use super::{Block, Carrier, Form, Mounting, SAME_STYLUS_MM, Shape, Solid, Stylus, Tool};
use crate::diag::Finding;
use crate::units::Plain;
use nalgebra::Vector3;
use std::ops::Range;

/// What can bear a solid or a mounting.
pub(super) struct Carriers<'a> {
    pub(super) of: &'a dyn Fn(&str) -> Option<Carrier>,
    /// An axis was refused, so the chain may lack axes that the file has: a missing carrier is not worth saying.
    pub(super) cut: bool,
}

/// What a body measures, mm.
struct Dimensions {
    /// The box that holds it.
    size: Vector3<f64>,
    diameter: Option<f64>,
}

impl Check<'_> {
    pub(super) fn tool(&mut self, machine: &str, t: &w::Tool) -> Option<Tool> {
        let direction = self.direction(&t.direction.span(), "direction of the tool", *t.direction.get_ref());
        let pivot = self.finite3(&t.parent.span(), "pivot of the tool", t.pivot);
        let length = *t.length.get_ref();
        if !(length > 0.0 && length <= LARGEST) {
            self.error(
                &t.length.span(),
                "machine::tool_length",
                format!("tool length of {machine:?} is {} mm", Plain(length)),
                format!("from the pivot to the ball's centre, more than 0 and up to {LARGEST}"),
            );
        }
        if t.spindle_sense.abs() != 1 {
            self.error(
                &t.parent.span(),
                "machine::sense",
                format!("spindle_sense is {}, expected 1 or -1", t.spindle_sense),
                "1: M19 counts right-handed about direction",
            );
        }
        Some(Tool { pivot: pivot?, direction: direction?, length_mm: length, spindle_sense: t.spindle_sense as f64 })
    }

    /// The probe; false where one of its numbers is none, and nothing that is told by them can be judged.
    pub(super) fn probe(&mut self, machine: &str, probe: &toml::Spanned<w::Probe>) -> bool {
        let p = probe.get_ref();
        let positive = [
            ("ball_radius", p.ball_radius),
            ("stem_radius", p.stem_radius),
            ("stem_length", p.stem_length),
            ("body_radius", p.body_radius),
            ("body_length", p.body_length),
            ("head_radius", p.head_radius),
            ("repeatability_um", p.repeatability_um),
            ("overtravel", p.overtravel),
            ("approach", p.approach),
            ("search", p.search),
            ("clearance", p.clearance),
            ("placement_tolerance", p.placement_tolerance),
            ("fast_feed", p.fast_feed),
            ("slow_feed", p.slow_feed),
            ("position_feed", p.position_feed),
            ("back_off", p.back_off),
        ];
        let mut are_good = true;
        for (field, value) in positive {
            let largest = if field == "repeatability_um" { LARGEST_SCATTER_UM } else { LARGEST };
            if !(value > 0.0 && value <= largest) {
                are_good = false;
                self.error(
                    &probe.span(),
                    "machine::probe",
                    format!("{field} of the probe of {machine:?} is {}", Plain(value)),
                    format!("write a number greater than 0, up to {largest}"),
                );
            }
        }
        // how they stand to one another says nothing while one of them is no length
        if !are_good {
            return false;
        }
        if p.stem_radius >= p.ball_radius {
            self.error(
                &probe.span(),
                "machine::probe",
                format!(
                    "the stem of {machine:?} (radius {} mm) is not thinner than the ball ({} mm)",
                    Plain(p.stem_radius),
                    Plain(p.ball_radius)
                ),
                "check the two radii: the ball must touch first",
            );
        }
        if p.search > p.overtravel {
            self.error(
                &probe.span(),
                "machine::overtravel",
                format!(
                    "a search ends {} mm past the nominal contact, the probe of {machine:?} can be pushed {} mm",
                    Plain(p.search),
                    Plain(p.overtravel)
                ),
                "lower search, or correct overtravel from the probe's data sheet",
            );
        }
        if p.placement_tolerance > p.approach.min(p.search) {
            self.error(
                &probe.span(),
                "machine::placement_tolerance",
                format!(
                    "placement tolerance {} mm of {machine:?} is larger than approach or search",
                    Plain(p.placement_tolerance)
                ),
                "a block within the tolerance must be met by the search",
            );
        }
        if p.back_off >= p.approach {
            self.error(
                &probe.span(),
                "machine::back_off",
                format!(
                    "back_off {} mm of {machine:?} is not less than approach {} mm",
                    Plain(p.back_off),
                    Plain(p.approach)
                ),
                "the ball must stay within the cleared approach",
            );
        }
        if p.slow_feed > p.fast_feed {
            self.error(
                &probe.span(),
                "machine::feed",
                format!("slow_feed {} is above fast_feed {}", Plain(p.slow_feed), Plain(p.fast_feed)),
                "swap the two feeds",
            );
        }
        true
    }

    /// Further styli. Plans know a stylus by its length and ball, so no two may be alike.
    pub(super) fn styli(&mut self, machine: &str, written: &[w::Stylus], p: &w::Probe) -> Vec<Stylus> {
        let mut styli: Vec<Stylus> = Vec::new();
        for s in written {
            let stylus = Stylus {
                name: s.name.get_ref().clone(),
                says: s.says.clone(),
                longer: s.longer,
                ball_radius: s.ball_radius.unwrap_or(p.ball_radius),
                stem_radius: s.stem_radius.unwrap_or(p.stem_radius),
            };
            let name = &stylus.name;
            let alike = |longer: f64, ball_radius: f64| {
                (longer - stylus.longer).abs() < SAME_STYLUS_MM
                    && (ball_radius - stylus.ball_radius).abs() < SAME_STYLUS_MM
            };
            let fault = if styli.iter().any(|o| o.name == *name) {
                Some("stands twice".to_owned())
            } else if !(stylus.longer.abs() <= LARGEST && p.stem_length + stylus.longer > stylus.ball_radius) {
                Some(format!("is {} mm longer than the probe's own", Plain(stylus.longer)))
            } else if !(stylus.stem_radius > 0.0
                && stylus.stem_radius < stylus.ball_radius
                && stylus.ball_radius <= LARGEST)
            {
                Some(format!(
                    "has a stem of radius {} mm and a ball of radius {} mm",
                    Plain(stylus.stem_radius),
                    Plain(stylus.ball_radius)
                ))
            } else if alike(0.0, p.ball_radius) || styli.iter().any(|o| alike(o.longer, o.ball_radius)) {
                Some("has the length and the ball of another one".to_owned())
            } else {
                None
            };
            if let Some(fault) = fault {
                self.error(
                    &s.name.span(),
                    "machine::stylus",
                    format!("stylus {name:?} of {machine:?} {fault}"),
                    "a stylus has a name of its own, differs in length or ball, and is thinner than its ball",
                );
            }
            styli.push(stylus);
        }
        styli
    }

    pub(super) fn solid(&mut self, machine: &str, s: &w::Solid, carriers: &Carriers) -> Option<Solid> {
        let name = s.name.get_ref();
        let carrier = self.carrier(machine, name, &s.carrier, carriers);
        let shape = match (s.cuboid, s.cylinder) {
            (Some(b), None)
                if b.size.iter().all(|x| *x <= LARGEST && *x > 0.0) && b.centre.iter().all(|x| x.abs() <= LARGEST) =>
            {
                Some(Shape::Box { centre: b.centre.into(), size: b.size.into() })
            }
            (None, Some(c))
                if c.radius > 0.0
                    && c.height > 0.0
                    && c.radius <= LARGEST
                    && c.height <= LARGEST
                    && c.foot.iter().all(|x| x.abs() <= LARGEST) =>
            {
                self.direction(&s.name.span(), "direction of the cylinder", c.direction).map(|direction| {
                    Shape::Cylinder { foot: c.foot.into(), direction, radius: c.radius, height: c.height }
                })
            }
            _ => {
                self.error(
                    &s.name.span(),
                    "machine::shape",
                    format!("solid {name:?} of {machine:?} has no usable shape"),
                    format!(
                        "give either box = {{ centre, size }} or cylinder = {{ foot, direction, radius, height }}, \
                         with positive sizes and no number above {LARGEST} mm"
                    ),
                );
                None
            }
        };
        Some(Solid { name: name.clone(), carrier: carrier?, shape: shape? })
    }

    fn carrier(
        &mut self,
        machine: &str,
        what: &str,
        word: &toml::Spanned<String>,
        carriers: &Carriers,
    ) -> Option<Carrier> {
        let found = (carriers.of)(word.get_ref());
        if found.is_none() && !carriers.cut {
            self.error(
                &word.span(),
                "machine::carrier",
                format!(
                    "{what:?} of {machine:?} is carried by {:?}, which is no part of the workpiece side",
                    word.get_ref()
                ),
                "write \"base\", \"table\" or the letter of an axis on the workpiece side",
            );
        }
        found
    }

    /// The edges of the box that holds a body, and its diameter.
    fn dimensions(&mut self, b: &w::Block) -> Option<Dimensions> {
        let block = b.name.get_ref();
        let is_length = |mm: f64| mm > 0.0 && mm <= LARGEST;
        let size = b.size.as_ref().map(|s| *s.get_ref());
        if let (Some(written), Some(size)) = (&b.size, size.filter(|s| !s.iter().all(|mm| is_length(*mm)))) {
            self.error(
                &written.span(),
                "machine::block_size",
                format!("size of block {block:?} is {size:?}"),
                format!("write three edges in mm, more than 0 and up to {LARGEST}"),
            );
            return None;
        }
        for (field, length) in [("diameter", &b.diameter), ("height", &b.height)] {
            if let Some(written) = length.as_ref().filter(|mm| !is_length(*mm.get_ref())) {
                self.error(
                    &written.span(),
                    "machine::block_size",
                    format!("{field} of block {block:?} is {} mm", Plain(*written.get_ref())),
                    format!("write mm, more than 0 and up to {LARGEST}"),
                );
                return None;
            }
        }
        let (diameter, height) = (b.diameter.as_ref().map(|d| *d.get_ref()), b.height.as_ref().map(|h| *h.get_ref()));
        let edges = match (b.form, size, diameter, height) {
            (Form::Box | Form::Plane, Some(size), None, None) => Some(size),
            (Form::Sphere, None, Some(d), None) => Some([d; 3]),
            (Form::Cylinder, None, Some(d), Some(h)) => Some([d, d, h]),
            (Form::Bore, Some(size), Some(d), None) if d < size[0].min(size[1]) => Some(size),
            _ => None,
        };
        if edges.is_none() {
            let needs = match b.form {
                Form::Box | Form::Plane => "size = [x, y, z]",
                Form::Sphere => "diameter",
                Form::Cylinder => "diameter and height",
                Form::Bore => {
                    "diameter (of the hole) and size = [x, y, z] (of the body round it, larger than the hole)"
                }
                Form::Centre | Form::Reading | Form::Part => {
                    "a place in plans only: write sphere, cylinder, bore, plane or box with its dimensions"
                }
            };
            self.error(
                &b.name.span(),
                "machine::block_form",
                format!("block {block:?} is a {}, and its dimensions do not say so", b.form.as_str()),
                format!("a {} has {needs}, in mm, and nothing else", b.form.as_str()),
            );
        }
        edges.map(|size| Dimensions { size: size.into(), diameter })
    }

    fn riser_is_good(&mut self, span: &Range<usize>, of: &str, r: &w::Riser) -> bool {
        let is_length = |mm: f64| mm > 0.0 && mm <= LARGEST;
        let wide =
            r.diameter.map_or_else(|| r.size.iter().all(|s| is_length(*s)), |d| is_length(d) && r.size == [0.0; 2]);
        let is_good = is_length(r.height) && wide;
        if !is_good {
            let help = format!("write height, and size or diameter, in mm, more than 0 and up to {LARGEST}");
            self.error(span, "machine::riser", format!("riser of {of} has no usable size"), help);
        }
        is_good
    }

    /// A riser that ends in the air: its length or its direction is another one.
    fn say_hanging(&mut self, machine: &str, block: &w::Block, placed: &risers::Placed) {
        let name = block.name.get_ref();
        let toward = placed.toward.as_str();
        let message = match placed {
            risers::Placed { meets_nothing: true, .. } => {
                format!("the riser of block {name:?} of {machine:?} goes to {toward} and meets no solid of its carrier")
            }
            risers::Placed { gap_mm: Some(gap), .. } => format!(
                "the riser of block {name:?} of {machine:?} goes to {toward} and ends {gap:.1} mm from the solid that is there"
            ),
            _ => return,
        };
        let help =
            "write the direction to the table into the riser, e.g. toward = \"-Y\", or correct its height or the solid";
        self.findings
            .push(Finding::warning("machine::riser_hangs", message).help(help).at(self.source, block.name.span()));
    }

    /// `fixed`: the machine's own solids.
    pub(super) fn mounting(
        &mut self,
        machine: &str,
        x: &w::Mounting,
        fixed: &[Solid],
        carriers: &Carriers,
    ) -> Option<Mounting> {
        let name = x.name.get_ref();
        if x.carrier.get_ref() == "base" {
            self.error(
                &x.carrier.span(),
                "machine::block_carrier",
                format!("mounting {name:?} of {machine:?} is carried by \"base\", which bears solids but no blocks"),
                "write \"table\": on a machine without a linear axis on the workpiece side that is what stands on the \
                 base",
            );
            return None;
        }
        let carrier = self.carrier(machine, name, &x.carrier, carriers)?;
        let mut solids: Vec<Solid> = x.solid.iter().filter_map(|s| self.solid(machine, s, carriers)).collect();
        let n_own = solids.len();
        let mut blocks: Vec<Block> = Vec::new();
        let of_all = x.riser.filter(|r| self.riser_is_good(&x.name.span(), &format!("mounting {name:?}"), r));
        for b in &x.block {
            let block = b.name.get_ref();
            if blocks.iter().any(|o| &o.name == block) {
                self.error(
                    &b.name.span(),
                    "machine::block_twice",
                    format!("block {block:?} stands twice in mounting {name:?}"),
                    "give each block a name of its own",
                );
            }
            let centre = self.finite3(&b.centre.span(), &format!("centre of block {block:?}"), *b.centre.get_ref())?;
            let Some(Dimensions { size, diameter }) = self.dimensions(b) else { continue };
            // blocks may touch, not stand in each other
            let within = |o: &Block| ((o.size + size) / 2.0 - (o.centre - centre).abs()).min();
            if let Some(other) = blocks.iter().find(|o| within(o) > 1e-6) {
                self.error(
                    &b.centre.span(),
                    "machine::blocks_overlap",
                    format!(
                        "blocks {:?} and {block:?} of mounting {name:?} stand {:.3} mm in each other",
                        other.name,
                        within(other)
                    ),
                    "check the two centres and sizes",
                );
            }
            let carrier = match &b.carrier {
                Some(word) if word.get_ref() == "base" => {
                    self.error(
                        &word.span(),
                        "machine::block_carrier",
                        format!("block {block:?} is carried by \"base\", which bears solids but no blocks"),
                        "write \"table\"",
                    );
                    continue;
                }
                Some(word) => self.carrier(machine, block, word, carriers)?,
                None => carrier,
            };
            let own = b.riser.filter(|r| self.riser_is_good(&b.name.span(), &format!("block {block:?}"), r));
            let mut riser = if b.riser.is_some() { own } else { of_all };
            if let Some(r) = &mut riser {
                let bearing: Vec<&Solid> = fixed.iter().chain(&solids[..n_own]).collect();
                let placed = risers::place(&centre, &size, r, carrier, &bearing);
                self.say_hanging(machine, b, &placed);
                r.toward = Some(placed.toward);
                // a stem goes into its sphere
                let within = if b.form == Form::Sphere { size / 2.0 } else { Vector3::zeros() };
                let whole = w::Riser { height: r.height + within.z, ..*r };
                solids.push(Solid {
                    name: format!("riser of {block}"),
                    carrier,
                    shape: risers::body(&centre, &(size - within * 2.0), &whole, placed.toward),
                });
            }
            blocks.push(Block { name: block.clone(), form: b.form, centre, size, diameter, riser, carrier });
        }
        if blocks.is_empty() {
            self.error(
                &x.name.span(),
                "machine::no_block",
                format!("mounting {name:?} of {machine:?} has no block"),
                "add [[machine.mounting.block]] tables",
            );
        }
        Some(Mounting { name: name.clone(), says: x.says.clone(), carrier, blocks, solids })
    }
}
