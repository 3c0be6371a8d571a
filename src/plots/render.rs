//! A chart as SVG and PNG. The letters of the PNG are those of a font that is inside the program: a machine without fonts
//! draws the same.

use super::chart::{Axis, Chart, Dash, Ink, Look, Mark, Pen, Shape};
use crate::diag::{Failure, Result};
use plotters::backend::{BitMapBackend, DrawingBackend, SVGBackend};
use plotters::coord::Shift;
use plotters::drawing::{DrawingArea, DrawingAreaErrorKind, IntoDrawingArea};
use plotters::element::{Circle, PathElement, Polygon, Rectangle, Text};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, FontDesc, FontFamily, FontStyle, FontTransform, RGBColor, ShapeStyle, TextStyle, WHITE};
use std::sync::OnceLock;

/// Width of a plot, px.
const WIDTH: u32 = 1200;

const GRID: RGBColor = RGBColor(223, 227, 232);
const FRAME: RGBColor = RGBColor(89, 97, 107);
const INK: RGBColor = rgb(Ink::Ink);

const FONT: &[u8] = include_bytes!("../../web/vendor/DejaVuSans.ttf");

type Drawn<DB> = std::result::Result<(), DrawingAreaErrorKind<<DB as DrawingBackend>::ErrorType>>;

/// Makes the font known; once for the process.
fn font() -> Result<()> {
    static READY: OnceLock<bool> = OnceLock::new();
    let ready = READY.get_or_init(|| {
        let styles = [FontStyle::Normal, FontStyle::Bold, FontStyle::Italic, FontStyle::Oblique];
        styles.into_iter().all(|style| plotters::style::register_font("sans-serif", style, FONT).is_ok())
    });
    if *ready {
        Ok(())
    } else {
        Err(Failure::new("plots::font", "the font of the plots cannot be read")
            .help("report this: it is a fault of the program"))
    }
}

fn failed(e: impl std::fmt::Display) -> Failure {
    Failure::new("plots::draw", format!("a plot cannot be drawn: {e}"))
}

fn height(chart: &Chart) -> u32 {
    (f64::from(WIDTH) * chart.aspect).clamp(300.0, 3000.0) as u32
}

/// The chart as SVG.
///
/// # Errors
/// When it cannot be drawn.
pub fn svg(chart: &Chart) -> Result<String> {
    font()?;
    let mut out = String::new();
    {
        let root = SVGBackend::with_string(&mut out, (WIDTH, height(chart))).into_drawing_area();
        draw(&root, chart).map_err(failed)?;
        root.present().map_err(failed)?;
    }
    Ok(out)
}

/// The chart as PNG.
///
/// # Errors
/// When it cannot be drawn.
pub fn png(chart: &Chart) -> Result<Vec<u8>> {
    font()?;
    let (w, h) = (WIDTH, height(chart));
    let mut pixels = vec![0u8; (w * h * 3) as usize];
    {
        let root = BitMapBackend::with_buffer(&mut pixels, (w, h)).into_drawing_area();
        draw(&root, chart).map_err(failed)?;
        root.present().map_err(failed)?;
    }
    let mut out = Vec::new();
    let mut encoder = png::Encoder::new(&mut out, w, h);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    let mut writer = encoder.write_header().map_err(failed)?;
    writer.write_image_data(&pixels).map_err(failed)?;
    writer.finish().map_err(failed)?;
    Ok(out)
}

/// On white paper. The colours are Okabe and Ito's, which colour-blind people tell apart.
const fn rgb(ink: Ink) -> RGBColor {
    match ink {
        Ink::Blue | Ink::Band => RGBColor(0, 114, 178),
        Ink::Red => RGBColor(213, 94, 0),
        Ink::Green => RGBColor(0, 158, 115),
        Ink::Purple => RGBColor(204, 121, 167),
        Ink::Orange => RGBColor(230, 159, 0),
        Ink::Sky => RGBColor(86, 180, 233),
        Ink::Ink => RGBColor(22, 25, 29),
        Ink::Muted => RGBColor(120, 126, 134),
    }
}

fn stroke(c: RGBColor, width: u32, opacity: f64) -> ShapeStyle {
    ShapeStyle { color: c.mix(opacity), filled: false, stroke_width: width }
}

fn fill(ink: Ink, opacity: f64) -> ShapeStyle {
    /// What is below a band is seen through it.
    const BAND: f64 = 0.13;
    let opacity = if ink == Ink::Band { BAND * opacity } else { opacity };
    ShapeStyle { color: rgb(ink).mix(opacity), filled: true, stroke_width: 0 }
}

fn letters<'a>(size: f64, h: HPos, v: VPos) -> TextStyle<'a> {
    let font: FontDesc = FontDesc::new(FontFamily::SansSerif, size, FontStyle::Normal);
    let mut style = TextStyle::from(font).pos(Pos::new(h, v));
    style.color = INK.to_backend_color();
    style
}

/// Where the axes stand on the paper.
struct Frame<'c> {
    chart: &'c Chart,
    left: f64,
    top: f64,
    width: f64,
    height: f64,
}

impl Frame<'_> {
    fn x(&self, v: f64) -> f64 {
        self.left + self.chart.x.share(v) * self.width
    }

    fn y(&self, v: f64) -> f64 {
        let share = self.chart.y.share(v);
        self.top + if self.chart.downwards { share } else { 1.0 - share } * self.height
    }

    /// On the paper, if it is finite and near.
    fn at(&self, x: f64, y: f64) -> Option<(i32, i32)> {
        let (px, py) = (self.x(x), self.y(y));
        let near = |v: f64| v.is_finite() && v.abs() < 1e5;
        (near(px) && near(py)).then(|| (px.round() as i32, py.round() as i32))
    }

    fn inside(&self, p: (i32, i32)) -> bool {
        let (x, y) = (f64::from(p.0), f64::from(p.1));
        (self.left - 1.0..=self.left + self.width + 1.0).contains(&x)
            && (self.top - 1.0..=self.top + self.height + 1.0).contains(&y)
    }
}

fn widest(axis: &Axis) -> f64 {
    let longest = axis.ticks().iter().flat_map(|t| t.1.lines().map(|l| l.chars().count()).max()).max().unwrap_or(0);
    8.6 * longest as f64
}

fn draw<DB: DrawingBackend>(root: &DrawingArea<DB, Shift>, chart: &Chart) -> Drawn<DB> {
    root.fill(&WHITE)?;
    let (w, h) = root.dim_in_pixel();
    let legend = legend(chart);
    let top = 56.0 + if legend.is_empty() { 0.0 } else { 26.0 };
    let left = if chart.picture.is_some() { 20.0 } else { 44.0 + widest(&chart.y) };
    let bottom = if chart.picture.is_some() { 20.0 } else { 62.0 };
    let mut frame = Frame { chart, left, top, width: f64::from(w) - left - 30.0, height: f64::from(h) - top - bottom };
    if chart.picture.is_some() {
        equal_lengths(&mut frame);
    }
    root.draw(&Text::new(chart.title.clone(), (20, 16), letters(20.0, HPos::Left, VPos::Top)))?;
    draw_legend(root, &legend)?;
    if chart.picture.is_none() {
        axes(root, &frame)?;
    }
    for mark in &chart.marks {
        draw_mark(root, &frame, mark)?;
    }
    Ok(())
}

/// Shrinks the frame so that a millimetre is as long in both directions.
fn equal_lengths(frame: &mut Frame) {
    let (x, y) = (frame.chart.x.range, frame.chart.y.range);
    let scale = (frame.width / (x.1 - x.0)).min(frame.height / (y.1 - y.0));
    let (w, h) = (scale * (x.1 - x.0), scale * (y.1 - y.0));
    frame.left += 0.5 * (frame.width - w);
    frame.top += 0.5 * (frame.height - h);
    (frame.width, frame.height) = (w, h);
}

/// The named series, once each.
fn legend(chart: &Chart) -> Vec<&Mark> {
    let mut out: Vec<&Mark> = Vec::new();
    let name = |m: &Mark| match m {
        Mark::Points { series, .. } | Mark::Line { series, .. } | Mark::Area { series, .. } => series.clone(),
        _ => String::new(),
    };
    for mark in &chart.marks {
        if !name(mark).is_empty() && !out.iter().any(|m| name(m) == name(mark)) {
            out.push(mark);
        }
    }
    out
}

fn draw_legend<DB: DrawingBackend>(root: &DrawingArea<DB, Shift>, legend: &[&Mark]) -> Drawn<DB> {
    let mut x = 28;
    let y = 58;
    for mark in legend {
        let series = match mark {
            Mark::Points { series, look, .. } => {
                symbol(root, (x, y), &Look { size: 6, opacity: 1.0, ..*look })?;
                series
            }
            Mark::Line { series, pen, .. } => {
                let ends = [(f64::from(x - 12), f64::from(y)), (f64::from(x + 12), f64::from(y))];
                polyline(root, &ends, *pen)?;
                series
            }
            Mark::Area { series, ink, opacity, .. } => {
                root.draw(&Rectangle::new([(x - 12, y - 7), (x + 12, y + 7)], fill(*ink, *opacity)))?;
                series
            }
            _ => continue,
        };
        root.draw(&Text::new(series.clone(), (x + 18, y), letters(14.0, HPos::Left, VPos::Center)))?;
        x += 52 + (8.0 * series.chars().count() as f64) as i32;
    }
    Ok(())
}

fn axes<DB: DrawingBackend>(root: &DrawingArea<DB, Shift>, frame: &Frame) -> Drawn<DB> {
    let chart = frame.chart;
    let (left, right) = (frame.left as i32, (frame.left + frame.width) as i32);
    let (top, bottom) = (frame.top as i32, (frame.top + frame.height) as i32);
    for (v, text) in chart.x.ticks() {
        let x = frame.x(v) as i32;
        root.draw(&PathElement::new(vec![(x, top), (x, bottom)], stroke(GRID, 1, 1.0)))?;
        for (k, line) in text.lines().enumerate() {
            let at = (x, bottom + 8 + 15 * k as i32);
            root.draw(&Text::new(line.to_owned(), at, letters(14.0, HPos::Center, VPos::Top)))?;
        }
    }
    for (v, text) in chart.y.ticks() {
        let y = frame.y(v) as i32;
        root.draw(&PathElement::new(vec![(left, y), (right, y)], stroke(GRID, 1, 1.0)))?;
        let lines: Vec<&str> = text.lines().collect();
        for (k, line) in lines.iter().enumerate() {
            let at = (left - 8, y + (15.0 * (k as f64 - 0.5 * (lines.len() as f64 - 1.0))) as i32);
            root.draw(&Text::new((*line).to_owned(), at, letters(14.0, HPos::Right, VPos::Center)))?;
        }
    }
    root.draw(&Rectangle::new([(left, top), (right, bottom)], stroke(FRAME, 1, 1.0)))?;
    let middle = ((left + right) / 2, bottom + 34);
    root.draw(&Text::new(chart.x.title.clone(), middle, letters(16.0, HPos::Center, VPos::Top)))?;
    if !chart.y.title.is_empty() {
        let style = letters(16.0, HPos::Center, VPos::Top).transform(FontTransform::Rotate270);
        root.draw(&Text::new(chart.y.title.clone(), (8, (top + bottom) / 2), style))?;
    }
    Ok(())
}

fn draw_mark<DB: DrawingBackend>(root: &DrawingArea<DB, Shift>, frame: &Frame, mark: &Mark) -> Drawn<DB> {
    match mark {
        Mark::Points { look, points, .. } => {
            for p in points.iter().filter_map(|p| frame.at(p.x, p.y)).filter(|p| frame.inside(*p)) {
                symbol(root, p, look)?;
            }
        }
        Mark::Line { pen, points, .. } => {
            let mut run: Vec<(f64, f64)> = Vec::new();
            for p in points {
                match frame.at(p.x, p.y) {
                    Some((x, y)) => run.push((f64::from(x), f64::from(y))),
                    None => polyline(root, &std::mem::take(&mut run), *pen)?,
                }
            }
            polyline(root, &run, *pen)?;
        }
        Mark::Area { ink, opacity, x, y, .. } => {
            let clip = |v: f64, axis: &Axis| v.clamp(axis.range.0, axis.range.1);
            let (cx, cy) = (&frame.chart.x, &frame.chart.y);
            if let (Some(a), Some(b)) = (frame.at(clip(x.0, cx), clip(y.0, cy)), frame.at(clip(x.1, cx), clip(y.1, cy)))
            {
                let corners = [(a.0.min(b.0), a.1.min(b.1)), (a.0.max(b.0), a.1.max(b.1))];
                root.draw(&Rectangle::new(corners, fill(*ink, *opacity)))?;
            }
        }
        Mark::Word { text, at } => {
            if let Some((x, y)) = frame.at(at.0, at.1) {
                root.draw(&Text::new(text.clone(), (x + 6, y - 6), letters(15.0, HPos::Left, VPos::Bottom)))?;
            }
        }
        // what stands for touches, space or a whole axis has become one of these on paper
        _ => {}
    }
    Ok(())
}

/// A line, dashed where asked.
fn polyline<DB: DrawingBackend>(root: &DrawingArea<DB, Shift>, points: &[(f64, f64)], pen: Pen) -> Drawn<DB> {
    if points.len() < 2 {
        return Ok(());
    }
    let style = stroke(rgb(pen.ink), pen.width, 1.0);
    let whole = |p: &(f64, f64)| (p.0.round() as i32, p.1.round() as i32);
    let (on, off) = match pen.dash {
        Dash::Solid => (f64::INFINITY, 0.0),
        Dash::Dash => (9.0, 6.0),
        Dash::Dot => (3.0, 4.0),
        Dash::DashDot => (14.0, 6.0),
    };
    if pen.dash == Dash::Solid {
        root.draw(&PathElement::new(points.iter().map(whole).collect::<Vec<_>>(), style))?;
        return Ok(());
    }
    let mut left = on;
    let mut drawing = true;
    for pair in points.windows(2) {
        let (mut from, to) = (pair[0], pair[1]);
        loop {
            let length = (to.0 - from.0).hypot(to.1 - from.1);
            let step = left.min(length);
            let share = if length > 0.0 { step / length } else { 1.0 };
            let end = (from.0 + share * (to.0 - from.0), from.1 + share * (to.1 - from.1));
            if drawing && step > 0.0 {
                root.draw(&PathElement::new(vec![whole(&from), whole(&end)], style))?;
            }
            left -= step;
            from = end;
            if left <= 1e-9 {
                drawing = !drawing;
                left = if drawing { on } else { off };
            }
            if length - step <= 1e-9 {
                break;
            }
        }
    }
    Ok(())
}

fn symbol<DB: DrawingBackend>(root: &DrawingArea<DB, Shift>, p: (i32, i32), look: &Look) -> Drawn<DB> {
    let r = look.size;
    let outline = stroke(rgb(look.ink), 2, look.opacity);
    let style = if look.filled { fill(look.ink, look.opacity) } else { outline };
    let corners: Vec<(i32, i32)> = match look.shape {
        Shape::Circle => return root.draw(&Circle::new(p, r, style)),
        Shape::Square => vec![(p.0 - r, p.1 - r), (p.0 + r, p.1 - r), (p.0 + r, p.1 + r), (p.0 - r, p.1 + r)],
        Shape::Triangle => vec![(p.0 - r, p.1 + r), (p.0, p.1 - r), (p.0 + r, p.1 + r)],
        Shape::Diamond => vec![(p.0 - r, p.1), (p.0, p.1 - r), (p.0 + r, p.1), (p.0, p.1 + r)],
        Shape::Tick => return root.draw(&PathElement::new(vec![(p.0, p.1 - r), (p.0, p.1 + r)], outline)),
        Shape::Cross => {
            root.draw(&PathElement::new(vec![(p.0 - r, p.1 - r), (p.0 + r, p.1 + r)], outline))?;
            return root.draw(&PathElement::new(vec![(p.0 - r, p.1 + r), (p.0 + r, p.1 - r)], outline));
        }
    };
    if look.filled {
        root.draw(&Polygon::new(corners, style))
    } else {
        let closed: Vec<(i32, i32)> = corners.iter().chain(corners.first()).copied().collect();
        root.draw(&PathElement::new(closed, style))
    }
}
