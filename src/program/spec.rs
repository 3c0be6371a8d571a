//! A probing program as it can be relied on: from `programs/*.toml` as written, all findings at once.
//!
//! What only a machine can tell (does the mounting have this block, does the axis go there) is checked by `layout`.

use super::as_written::{self as w, FacesIn, RingIn};
use super::find::{MOST_ASTRAY_MM, is_placement_tolerance};
use super::parts::{PartSpec, part_of};
use crate::axes::{AxisMap, AxisName};
use crate::diag::{Finding, Findings, Result, Source, from_toml};
use crate::units::Plain;
use nalgebra::Vector3;
use std::ops::Range;

/// The format line of a program.
pub const FORMAT: &str = "axiscal-programs/1";

/// How far past a pose a rotary axis goes to come to it from the other side, deg. More than any backlash of a worm drive
/// (tenths of a degree) and its acceleration ramp, little enough to cost no time.
const DEFAULT_OVERSHOOT_DEG: f64 = 5.0;

/// More repeats than this are a slip of the pen: a hundred touches tell the noise of a touch to 7 %.
const MOST_REPEATS: i64 = 1000;

/// More touches than this in one program would take days.
pub(super) const MOST_TOUCHES: usize = 100_000;

/// A word or number with its place in the program's file.
#[derive(Debug, Clone)]
pub struct At<T> {
    pub value: T,
    /// Byte range in [`ProgramSpec::source`].
    pub span: Range<usize>,
}

impl<T: Clone> From<&toml::Spanned<T>> for At<T> {
    fn from(spanned: &toml::Spanned<T>) -> Self {
        Self { value: spanned.get_ref().clone(), span: spanned.span() }
    }
}

/// A face of a box along the axes of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Face {
    /// 0, 1, 2 = X, Y, Z.
    pub axis: usize,
    /// True for the face that looks along +.
    pub positive: bool,
}

impl Face {
    /// Reads `+X` … `-Z`.
    #[must_use]
    pub fn parse(word: &str) -> Option<Self> {
        let positive = match word.as_bytes().first()? {
            b'+' => true,
            b'-' => false,
            _ => return None,
        };
        let axis = ["X", "Y", "Z"].iter().position(|l| *l == &word[1..])?;
        Some(Self { axis, positive })
    }

    /// From an outward normal along an axis.
    #[must_use]
    pub fn from_normal(normal: &Vector3<f64>) -> Self {
        let axis = normal.iamax();
        Self { axis, positive: normal[axis] > 0.0 }
    }

    /// Outward unit normal.
    #[must_use]
    pub fn normal(self) -> Vector3<f64> {
        let mut n = Vector3::zeros();
        n[self.axis] = if self.positive { 1.0 } else { -1.0 };
        n
    }

    /// The directions of `u` and `v` on this face.
    #[must_use]
    pub fn tangents(self) -> (Vector3<f64>, Vector3<f64>) {
        match self.axis {
            0 => (Vector3::y(), Vector3::z()),
            1 => (Vector3::x(), Vector3::z()),
            _ => (Vector3::x(), Vector3::y()),
        }
    }
}

impl std::fmt::Display for Face {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}{}", if self.positive { '+' } else { '-' }, ["X", "Y", "Z"][self.axis])
    }
}

/// Second coordinate of a point on a face, mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Across {
    /// From the centre of the face along `v`.
    FromCentre(f64),
    /// Down from the upper edge.
    Depth(f64),
}

/// A point of a grid: `u` in mm from the centre of the face, and the second coordinate.
pub type GridPoint = (f64, Across);

/// A face and the points on it.
#[derive(Debug, Clone)]
pub struct FaceGrid {
    pub face: At<Face>,
    /// Its points, mm.
    pub points: Vec<GridPoint>,
    /// Name of the grid.
    pub grid: At<String>,
}

/// Where a point of a ring lies besides its azimuth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Along {
    /// On a sphere: over the equator, deg.
    Elevation(f64),
    /// On a cylinder or in a bore: down from the upper end, mm.
    Depth(f64),
}

/// Points on what is round.
#[derive(Debug, Clone)]
pub struct RingPoints {
    pub name: At<String>,
    /// What directions on a sphere count in.
    pub directions_in: RingIn,
    /// Azimuth, deg, and the second coordinate.
    pub points: Vec<(f64, Along)>,
}

/// A set-up in one pose.
#[derive(Debug, Clone)]
pub struct SetupSpec {
    /// Stage of the procedure.
    pub stage: String,
    /// Place of its part in [`ProgramSpec::parts`].
    pub part: usize,
    /// Rotary axes that are named, deg.
    pub pose: At<AxisMap>,
    /// The sense in which a rotary axis must come to the pose.
    pub from: At<AxisMap>,
    /// Orientation of the spindle, right-handed about the tool frame's +z, deg.
    pub spindle_deg: Option<f64>,
    /// Feed of the measuring touch, mm/min.
    pub feed_mm_min: Option<f64>,
    /// How often each point is touched.
    pub repeats: u32,
    /// The blocks; `None`: all of the mounting.
    pub blocks: Option<Vec<At<String>>>,
    /// What is touched on each that has faces.
    pub faces: Vec<FaceGrid>,
    /// What is touched on each that is round.
    pub rings: Vec<RingPoints>,
}

/// A checked program. Lengths mm, angles deg.
#[derive(Debug, Clone)]
pub struct ProgramSpec {
    /// Short name.
    pub name: String,
    /// The machine that it was written for.
    pub machine: Option<At<String>>,
    pub says: String,
    /// Blocks and stylus, from stop to stop: at least one part.
    pub parts: Vec<PartSpec>,
    /// What the names of faces mean.
    pub faces_in: FacesIn,
    /// How far a rotary axis goes past a pose that it must come to from the other side.
    pub overshoot_deg: f64,
    /// The artefact is put down by eye within this, and found by the first touches.
    pub placement_tolerance_mm: Option<f64>,
    /// The set-ups, in order; lists of angles are spread out.
    pub setups: Vec<SetupSpec>,
    /// The file, for messages.
    pub source: Source,
}

impl ProgramSpec {
    /// A finding with its place in the program's file.
    #[must_use]
    pub(super) fn error(&self, span: &Range<usize>, code: &'static str, message: String, help: String) -> Finding {
        Finding::error(code, message).help(help).at(&self.source, span.clone())
    }
}

/// Reads and checks a program file.
///
/// # Errors
/// When the text is not TOML of this form or contradicts itself; every finding has its place and remedy.
pub fn load(source: &Source) -> Result<(ProgramSpec, Findings)> {
    let file: w::File = toml::from_str(source.inner()).map_err(|e| {
        from_toml(&e, source, "program::not_toml")
            .help("`axiscal schema programs` prints the form; `axiscal programs show head` shows an example")
    })?;
    let mut check = Check { source, findings: Findings::default() };
    let spec = check.file(&file);
    check.findings.finish(spec)
}

/// What a program names once and uses by name.
struct Named {
    grids: Vec<(String, Vec<GridPoint>, bool)>,
    rings: Vec<NamedRing>,
}

/// A ring as the file has it: name, frame, points.
type NamedRing = (String, RingIn, Vec<(f64, Along)>);

struct Check<'a> {
    source: &'a Source,
    findings: Findings,
}

impl Check<'_> {
    fn error(&mut self, span: Range<usize>, code: &'static str, message: impl Into<String>, help: impl Into<String>) {
        self.findings.push(Finding::error(code, message).help(help).at(self.source, span));
    }

    fn file(&mut self, f: &w::File) -> ProgramSpec {
        if f.format.get_ref() != FORMAT {
            self.error(
                f.format.span(),
                "program::format",
                format!("format is {:?}, expected {FORMAT:?}", f.format.get_ref()),
                "write the format line of this version",
            );
        }
        let name = f.name.get_ref();
        if name.is_empty() || !name.chars().all(|c| c.is_ascii_alphanumeric() || c == '-' || c == '_') {
            self.error(
                f.name.span(),
                "program::name",
                format!("a program cannot be called {name:?}: files are named after it"),
                "use letters, digits, - and _",
            );
        }
        let overshoot_deg = f.overshoot_deg.as_ref().map_or(DEFAULT_OVERSHOOT_DEG, |o| *o.get_ref());
        if let Some(o) = f.overshoot_deg.as_ref().filter(|o| !(*o.get_ref() > 0.0 && *o.get_ref() <= 90.0)) {
            self.error(
                o.span(),
                "program::overshoot",
                format!("overshoot_deg is {}", Plain(overshoot_deg)),
                "write an angle above 0 and up to 90",
            );
        }
        let placement_tolerance_mm = f.placement_tolerance.as_ref().map(|mm| *mm.get_ref());
        if let Some(mm) = f.placement_tolerance.as_ref().filter(|mm| !is_placement_tolerance(*mm.get_ref())) {
            self.error(
                mm.span(),
                "program::placement_tolerance",
                format!("placement_tolerance is {} mm", Plain(*mm.get_ref())),
                format!("write how far off the artefact may stand, more than 0 and up to {MOST_ASTRAY_MM} mm"),
            );
        }
        let named = Named { grids: self.grids(&f.grid), rings: self.rings(&f.ring, f.faces_in) };
        let repeats = self.repeats(f.repeats.as_ref()).unwrap_or(1);
        let (mut setups, mut parts) = (Vec::new(), Vec::new());
        if f.stage.is_empty() {
            self.error(
                f.name.span(),
                "program::empty",
                "the program has no stage",
                "add a [[stage]] table with set-ups",
            );
        }
        for stage in &f.stage {
            let repeats = self.repeats(stage.repeats.as_ref()).unwrap_or(repeats);
            if stage.setup.is_empty() {
                self.error(
                    stage.name.span(),
                    "program::empty",
                    format!("stage {:?} has no set-up", stage.name.get_ref()),
                    "add a [[stage.setup]] table",
                );
            }
            let mounting = stage.mounting.as_ref().unwrap_or(&f.mounting);
            let stylus = stage.stylus.as_ref().or(f.stylus.as_ref());
            let part = part_of(&mut parts, mounting.into(), stylus.map(At::from), stage.placed);
            for setup in &stage.setup {
                self.setup((stage.name.get_ref(), part), repeats, setup, &named, &mut setups);
            }
        }
        if parts.is_empty() {
            part_of(&mut parts, At::from(&f.mounting), f.stylus.as_ref().map(At::from), None);
        }
        ProgramSpec {
            name: name.clone(),
            machine: f.machine.as_ref().map(At::from),
            says: f.says.clone(),
            parts,
            faces_in: f.faces_in,
            overshoot_deg,
            placement_tolerance_mm,
            setups,
            source: self.source.clone(),
        }
    }

    fn repeats(&mut self, written: Option<&toml::Spanned<i64>>) -> Option<u32> {
        let written = written?;
        match u32::try_from(*written.get_ref()) {
            Ok(n) if n > 0 && i64::from(n) <= MOST_REPEATS => Some(n),
            _ => {
                self.error(
                    written.span(),
                    "program::repeats",
                    format!("each point is to be touched {} times", written.get_ref()),
                    format!("write a number from 1 to {MOST_REPEATS}"),
                );
                None
            }
        }
    }

    fn grids(&mut self, written: &[w::Grid]) -> Vec<(String, Vec<GridPoint>, bool)> {
        let mut out: Vec<(String, Vec<GridPoint>, bool)> = Vec::new();
        for g in written {
            let name = g.name.get_ref();
            if out.iter().any(|(n, ..)| n == name) {
                self.error(
                    g.name.span(),
                    "program::grid_twice",
                    format!("grid {name:?} stands twice"),
                    "give each grid a name of its own",
                );
            }
            if g.u.is_empty() || g.v.is_empty() == g.depth.is_empty() {
                self.error(
                    g.name.span(),
                    "program::grid",
                    format!("grid {name:?} needs u, and either v or depth"),
                    "write u = [..] and v = [..] (from the centre), or u = [..] and depth = [..] (from the upper edge)",
                );
            }
            if g.u.iter().chain(&g.v).chain(&g.depth).any(|x| !x.is_finite()) {
                self.error(
                    g.name.span(),
                    "program::grid",
                    format!("grid {name:?} holds a number that is not finite"),
                    "write millimetres",
                );
            }
            let across = || {
                let v = g.v.iter().map(|&v| Across::FromCentre(v));
                v.chain(g.depth.iter().map(|&d| Across::Depth(d)))
            };
            let points = g.u.iter().flat_map(|&u| across().map(move |v| (u, v))).collect();
            out.push((name.clone(), points, !g.depth.is_empty()));
        }
        out
    }

    fn rings(&mut self, written: &[w::Ring], faces_in: FacesIn) -> Vec<NamedRing> {
        let mut out: Vec<NamedRing> = Vec::new();
        let usual = if faces_in == FacesIn::Machine { RingIn::Machine } else { RingIn::Block };
        for r in written {
            let name = r.name.get_ref();
            if out.iter().any(|(n, ..)| n == name) {
                self.error(
                    r.name.span(),
                    "program::ring_twice",
                    format!("ring {name:?} stands twice"),
                    "give each ring a name of its own",
                );
            }
            let steep = |deg: &f64| !(-90.0..=90.0).contains(deg);
            let odd = |x: &f64| !x.is_finite();
            if r.azimuth_deg.is_empty()
                || r.elevation_deg.is_empty() == r.depth.is_empty()
                || r.elevation_deg.iter().any(steep)
                || r.azimuth_deg.iter().chain(&r.depth).any(odd)
            {
                self.error(
                    r.name.span(),
                    "program::ring",
                    format!("ring {name:?} needs azimuth_deg, and either elevation_deg (-90 to 90) or depth"),
                    "write azimuth_deg = [..] and elevation_deg = [..] for spheres, azimuth_deg = [..] and depth = [..] in mm \
                     from the upper end for cylinders and bores",
                );
                continue;
            }
            let along = || {
                let elevations = r.elevation_deg.iter().map(|&deg| Along::Elevation(deg));
                elevations.chain(r.depth.iter().map(|&mm| Along::Depth(mm)))
            };
            let points = r.azimuth_deg.iter().flat_map(|&azimuth| along().map(move |v| (azimuth, v))).collect();
            out.push((name.clone(), r.directions_in.unwrap_or(usual), points));
        }
        out
    }

    fn ring(&mut self, written: &toml::Spanned<String>, rings: &[NamedRing]) -> Option<RingPoints> {
        let found = rings.iter().find(|(name, ..)| name == written.get_ref());
        if found.is_none() {
            let names: Vec<&str> = rings.iter().map(|(n, ..)| n.as_str()).collect();
            self.error(
                written.span(),
                "program::unknown_ring",
                format!("no ring is called {:?}", written.get_ref()),
                format!("the file has: {}", names.join(", ")),
            );
        }
        let ring = |(_, frame, points): &NamedRing| RingPoints {
            name: At::from(written),
            directions_in: *frame,
            points: points.clone(),
        };
        found.map(ring)
    }

    fn setup(
        &mut self,
        (stage, part): (&str, usize),
        repeats: u32,
        s: &w::Setup,
        named: &Named,
        out: &mut Vec<SetupSpec>,
    ) {
        let poses = self.poses(&s.pose);
        let from = self.senses(s.from.as_ref(), s.pose.span());
        let repeats = self.repeats(s.repeats.as_ref()).unwrap_or(repeats);
        if let Some(feed) = s.feed.as_ref().filter(|f| !(f.get_ref().is_finite() && *f.get_ref() > 0.0)) {
            self.error(
                feed.span(),
                "program::feed",
                format!("feed is {} mm/min", Plain(*feed.get_ref())),
                "write the feed of the measuring touch, more than 0",
            );
        }
        if let Some(angle) = s.spindle_deg.as_ref().filter(|a| !(-360.0..=360.0).contains(a.get_ref())) {
            self.error(
                angle.span(),
                "program::spindle",
                format!("the spindle is to be oriented to {} degrees", Plain(*angle.get_ref())),
                "write an angle from -360 to 360",
            );
        }
        if s.touch.is_empty() || s.blocks.as_ref().is_some_and(Vec::is_empty) {
            self.error(
                s.pose.span(),
                "program::empty",
                "the set-up touches nothing",
                "write touch = [{ faces = [\"+Z\"], grid = \"…\" }], and name at least one block or leave blocks out",
            );
        }
        let (mut faces, mut rings) = (Vec::new(), Vec::new());
        for group in &s.touch {
            match (&group.ring, &group.grid) {
                (Some(ring), None) if group.faces.is_empty() => rings.extend(self.ring(ring, &named.rings)),
                (None, Some(grid)) => self.touch_group(group, grid, &named.grids, &mut faces),
                _ => self.error(
                    s.pose.span(),
                    "program::touch",
                    "what is touched is either faces with a grid, or a ring",
                    "write { faces = [\"+Z\"], grid = \"…\" } for a body with faces, { ring = \"…\" } for one that is round",
                ),
            }
        }
        if let Some(blocks) = &s.blocks {
            for (i, b) in blocks.iter().enumerate() {
                if blocks[..i].iter().any(|o| o.get_ref() == b.get_ref()) {
                    self.error(
                        b.span(),
                        "program::block_twice",
                        format!("block {:?} stands twice in a set-up", b.get_ref()),
                        "touch it once, with repeats where more touches are wanted",
                    );
                }
            }
        }
        for pose in poses {
            out.push(SetupSpec {
                stage: stage.to_owned(),
                part,
                pose: At { value: pose, span: s.pose.span() },
                from: from.clone(),
                spindle_deg: s.spindle_deg.as_ref().map(|a| *a.get_ref()),
                feed_mm_min: s.feed.as_ref().map(|f| *f.get_ref()),
                repeats,
                blocks: s.blocks.as_ref().map(|b| b.iter().map(At::from).collect()),
                faces: faces.clone(),
                rings: rings.clone(),
            });
        }
    }

    fn touch_group(
        &mut self,
        group: &w::TouchGroup,
        written: &toml::Spanned<String>,
        grids: &[(String, Vec<GridPoint>, bool)],
        out: &mut Vec<FaceGrid>,
    ) {
        let grid = grids.iter().find(|(name, ..)| name == written.get_ref());
        if grid.is_none() {
            let names: Vec<&str> = grids.iter().map(|(n, ..)| n.as_str()).collect();
            self.error(
                written.span(),
                "program::unknown_grid",
                format!("no grid is called {:?}", written.get_ref()),
                format!("the file has: {}", names.join(", ")),
            );
        }
        if group.faces.is_empty() {
            self.error(written.span(), "program::empty", "no face is named", "write faces = [\"+Z\"]");
        }
        for face_word in &group.faces {
            let Some(face) = Face::parse(face_word.get_ref()) else {
                self.error(
                    face_word.span(),
                    "program::unknown_face",
                    format!("there is no face {:?}", face_word.get_ref()),
                    "faces are +X, -X, +Y, -Y, +Z, -Z",
                );
                continue;
            };
            let Some((name, points, depth)) = grid else { continue };
            if *depth && face.axis == 2 {
                self.error(
                    face_word.span(),
                    "program::depth",
                    format!("grid {name:?} gives depths below an upper edge, and face {face} has none"),
                    "use a grid with u and v there",
                );
                continue;
            }
            out.push(FaceGrid {
                face: At { value: face, span: face_word.span() },
                points: points.clone(),
                grid: At::from(written),
            });
        }
    }

    /// All combinations of the angles, the last axis changing fastest.
    fn poses(&mut self, written: &toml::Spanned<std::collections::BTreeMap<String, w::Angles>>) -> Vec<AxisMap> {
        let mut poses = vec![AxisMap::default()];
        for (word, angles) in written.get_ref() {
            let Some(axis) = self.rotary(word, written.span()) else { continue };
            let angles = angles.all();
            if angles.is_empty() || angles.iter().any(|a| !a.is_finite()) {
                self.error(
                    written.span(),
                    "program::pose",
                    format!("the angles of {axis} are {angles:?}"),
                    "write at least one angle in degrees",
                );
                continue;
            }
            if poses.len().saturating_mul(angles.len()) > MOST_TOUCHES {
                self.error(written.span(), "program::too_many", "too many poses", "write fewer angles");
                break;
            }
            poses = poses.iter().flat_map(|p| angles.iter().map(|&a| p.with(axis, a))).collect();
        }
        poses
    }

    fn senses(
        &mut self,
        written: Option<&toml::Spanned<std::collections::BTreeMap<String, i64>>>,
        setup: Range<usize>,
    ) -> At<AxisMap> {
        let mut out = AxisMap::default();
        let Some(written) = written else { return At { value: out, span: setup } };
        for (word, sense) in written.get_ref() {
            let Some(axis) = self.rotary(word, written.span()) else { continue };
            if sense.abs() == 1 {
                out.set(axis, *sense as f64);
            } else {
                self.error(
                    written.span(),
                    "program::from",
                    format!("{axis} is to come from sense {sense}"),
                    "1: with rising angle, -1: with falling angle",
                );
            }
        }
        At { value: out, span: written.span() }
    }

    fn rotary(&mut self, word: &str, span: Range<usize>) -> Option<AxisName> {
        let mut letters = word.chars();
        let axis = letters.next().and_then(AxisName::from_letter).filter(|a| a.is_rotary() && letters.next().is_none());
        if axis.is_none() {
            self.error(
                span,
                "program::unknown_axis",
                format!("{word:?} is no rotary axis"),
                "a pose names A, B and C; the program finds X, Y, Z itself",
            );
        }
        axis
    }
}
