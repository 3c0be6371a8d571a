//! Generic shapes on a small plan: which variable is named, where it acts, and how often clean data are suspected.

use super::dependence::{Dependence, dependences, depends_on_anything};
use super::multiplicity::FAMILY_LEVEL;
use super::pattern_tests::{CONSTANT, Direction, Features, Generics, Kind, Rows, Variable, generics};
use super::testing::{noise, rng};
use super::tests::{ask, correlated_library};
use super::*;
use nalgebra::{DMatrix, DVector, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use std::f64::consts::TAU;
use std::sync::Arc;

/// A small plan: nine angles of C, six of B in changing order, two blocks, five faces each touched twice; 2.2 h.
fn table_of_touches(rng: &mut ChaCha8Rng) -> Features {
    let mut f = Features::default();
    let (mut x, mut b_angle, mut c_angle, mut t, mut sense) = (vec![], vec![], vec![], vec![], vec![]);
    let (mut machine, mut carrier) = (vec![], vec![]);
    let mut clock = 0.0;
    for visit in 0..27usize {
        let c = [0.0, 130.0, 45.0, 270.0, 90.0, 315.0, 200.0, 160.0, 20.0][visit % 9] * TAU / 360.0;
        let b = [0.0, -60.0, -25.0, -90.0, -40.0, -10.0][(visit * 5 + visit / 9) % 6] * TAU / 360.0;
        clock += 0.03;
        for block in 0..2usize {
            for face in 0..5usize {
                for _ in 0..2 {
                    let n = [Vector3::x(), -Vector3::x(), Vector3::y(), -Vector3::y(), Vector3::z()][face];
                    let turned = Vector3::new(c.cos() * n.x + c.sin() * n.y, c.cos() * n.y - c.sin() * n.x, n.z);
                    carrier.push(n);
                    machine.push(turned);
                    x.push((60.0 * block as f64 - 30.0) * c.cos() + 200.0 * b.sin() + rng.random_range(-3.0..3.0));
                    b_angle.push(b);
                    c_angle.push(c);
                    t.push(clock);
                    sense.push(if visit % 4 < 2 { 1.0 } else { -1.0 });
                    f.block.push(block);
                    f.face.push(face);
                    f.visit.push(visit);
                    clock += 0.0025;
                }
            }
        }
    }
    f.directions = Direction::of_normals(&machine, &carrier, "Z");
    f.variables = vec![
        Variable::new("X", Kind::Linear, x),
        Variable::new("B", Kind::Rotary, b_angle),
        Variable::new("C", Kind::Rotary, c_angle),
        Variable::new("t", Kind::Time, t),
        Variable::new("sC", Kind::Plain, sense),
    ];
    f
}

/// Place and location of this plan: each block's three coordinates, and what turns with C and B.
fn location_base(f: &Features) -> Basis {
    let n = f.block.len();
    let column = |v: &dyn Fn(usize) -> f64| DVector::from_fn(n, |i, _| v(i));
    let mut columns = Vec::new();
    for d in 0..7 {
        for block in 0..2 {
            columns.push(column(&|i| f.directions[d].weight[i] * f64::from(u8::from(f.block[i] == block))));
        }
    }
    for d in 0..3 {
        columns.push(column(&|i| f.directions[d].weight[i] * f.variables[1].values[i].cos()));
        columns.push(column(&|i| f.directions[d].weight[i] * f.variables[1].values[i].sin()));
    }
    Basis::new(&DMatrix::from_columns(&columns))
}

/// Rows of touches as they are.
struct Plain(usize);

impl Rows for Plain {
    fn count(&self) -> usize {
        self.0
    }

    fn all(&self, columns_um: DMatrix<f64>) -> DMatrix<f64> {
        columns_um
    }
}

fn generics_of(f: &Features) -> Generics {
    generics(&Arc::new(f.clone()), Arc::new(Plain(f.block.len())))
}

fn found(f: &Features, g: &Generics, base: &Basis, r: &DVector<f64>) -> Vec<Dependence> {
    dependences(&Search::new(ask(r, base), &g.library), f, g)
}

#[test]
fn shapes_of_no_catalogue_are_named_by_their_variable() {
    let mut rng = rng(20);
    let f = table_of_touches(&mut rng);
    let base = location_base(&f);
    let g = generics_of(&f);
    let n = f.block.len();
    let values = |v: usize| &f.variables[v].values;
    type Effect<'a> = (&'a str, Box<dyn Fn(usize) -> f64 + 'a>);
    let effects: Vec<Effect> = vec![
        ("C", Box::new(|i| (7.0 * values(2)[i] + 0.4).sin() * f.directions[2].weight[i])),
        ("B", Box::new(|i| f64::from(u8::from(values(1)[i] < -0.8)) * f.directions[0].weight[i])),
        ("t", Box::new(|i| f64::from(u8::from(values(3)[i] > 1.1)) * f.directions[1].weight[i])),
        ("t", Box::new(|i| (TAU * values(3)[i] / 0.15).cos() * f.directions[2].weight[i])),
        (
            "t*block",
            Box::new(|i| f64::from(u8::from(values(3)[i] > 0.9 && f.block[i] == 1)) * f.directions[3].weight[i]),
        ),
        ("sC", Box::new(|i| values(4)[i] * f.directions[4].weight[i])),
        ("X", Box::new(|i| (values(0)[i] / 100.0).powi(2) * f.directions[2].weight[i])),
    ];
    for (wanted, effect) in &effects {
        let shape = DVector::from_fn(n, |i, _| effect(i));
        let left = base.project(&shape).norm_squared();
        let mut hits = 0;
        for _ in 0..10 {
            let r = noise(&mut rng, n) - &shape * (60.0 / left).sqrt();
            let list = found(&f, &g, &base, &r);
            hits += usize::from(list[0].on == *wanted);
            assert!(list[0].p_adjusted < 0.05 || list[0].on != *wanted);
        }
        println!("{wanted}: first in {hits} of 10");
        assert!(hits >= 8, "{wanted}: {hits}");
    }
    // the tooth pattern by its order, with a formula that takes it away
    let tooth = DVector::from_fn(n, |i, _| effects[0].1(i) * 5.0);
    let r = noise(&mut rng, n) - &tooth;
    let first = &found(&f, &g, &base, &r)[0];
    assert_eq!((first.scanned, first.direction.as_str(), first.dof.as_str()), (7.0, "machine-Z", "dz"));
    assert_eq!(first.terms[0].formula.as_deref(), Some("cos(7*C) - 1"));
    let amplitude = first.terms[0].size.hypot(first.terms[1].size);
    assert!((amplitude - 5.0).abs() < 0.5, "{amplitude}");
    assert!(first.share > 0.6 && first.curve.len() > 100);
    // the curve is about its mean over the touches
    let ends = first.curve.iter().fold((f64::MAX, f64::MIN), |(low, high), p| (low.min(p.y), high.max(p.y)));
    assert!((0.5 * (ends.1 - ends.0) - amplitude).abs() < 0.05 * amplitude, "{ends:?} {amplitude}");
    // the cycle by its period, as a number that a fit may refine
    let cycle = DVector::from_fn(n, |i, _| effects[3].1(i) * 3.0);
    let r = noise(&mut rng, n) - &cycle;
    let first = &found(&f, &g, &base, &r)[0];
    let shape = first.shape.as_ref().unwrap();
    assert_eq!((shape.name.as_str(), shape.unit.as_str()), ("period", "h"));
    assert!(shape.min < 0.15 && 0.15 < shape.max, "{shape:?}");
    assert_eq!(first.terms[1].formula.as_deref(), Some("sin(2*pi*t/period)"));
}

#[test]
fn the_short_question_has_the_answer_of_the_long_one() {
    let mut rng = rng(22);
    let f = table_of_touches(&mut rng);
    let n = f.block.len();
    // a base that leaves the constants of all other directions
    let base = Basis::new(&DMatrix::from_column_slice(n, 1, &f.directions[0].weight));
    let g = generics_of(&f);
    let alone = (0..f.directions.len()).map(|d| f.directions[d].weight.clone());
    let of_c = |d: usize| (0..n).map(|i| f.directions[d].weight[i] * (3.0 * f.variables[2].values[i]).sin()).collect();
    let planted: Vec<Vec<f64>> = alone.chain((0..3).map(of_c)).collect();
    let (mut variable, mut constant, mut no) = (0, 0, 0);
    for shape in planted.into_iter().map(DVector::from_vec) {
        let left = base.project(&shape).norm();
        // from nothing to what nobody overlooks, with most in between
        for size in [0.0, 3.0, 4.0, 5.0, 6.0, 7.0, 9.0] {
            let r = noise(&mut rng, n) - &shape * if left > 1e-6 { size / left } else { 0.0 };
            let all = found(&f, &g, &base, &r);
            let expected = all.iter().any(|d| d.p_adjusted < FAMILY_LEVEL);
            assert_eq!(depends_on_anything(ask(&r, &base), &g), expected, "{:?}", all.first());
            let of_variable = all.iter().any(|d| d.p_adjusted < FAMILY_LEVEL && d.on != CONSTANT);
            let of_constant = all.iter().any(|d| d.p_adjusted < FAMILY_LEVEL && d.on == CONSTANT);
            variable += usize::from(of_variable && !of_constant);
            constant += usize::from(of_constant && !of_variable);
            no += usize::from(!expected);
        }
    }
    // each answer for a reason of its own
    assert!(variable > 2 && constant > 2 && no > 10, "{variable} {constant} {no}");
}

#[test]
fn a_variable_is_nothing_where_it_does_not_act() {
    let mut f = table_of_touches(&mut rng(23));
    let everywhere = generics_of(&f);
    let first: Vec<bool> = f.block.iter().map(|block| *block == 0).collect();
    f.variables[2] = f.variables[2].clone().acting(first.clone());
    let here = generics_of(&f);
    let mut seen = 0;
    for (c, candidate) in here.library.candidates().iter().enumerate() {
        let Some(other) = everywhere.library.position(&candidate.id) else { continue };
        // places of steps are those of the values where the variable acts
        for (v, variant) in candidate.variants.iter().enumerate() {
            let Some(same) =
                everywhere.library.candidates()[other].variants.iter().position(|o| o.shape == variant.shape)
            else {
                continue;
            };
            if here.shapes[c].functions[v] != everywhere.shapes[other].functions[same] {
                continue;
            }
            let (own, all) = (here.library.columns(c, v), everywhere.library.columns(other, same));
            let of_it = here.shapes[c].variables.contains(&2);
            let expected =
                DMatrix::from_fn(all.nrows(), all.ncols(), |i, k| if of_it && !first[i] { 0.0 } else { all[(i, k)] });
            assert_eq!(own, expected, "{}", candidate.id);
            seen += usize::from(of_it && own != all);
        }
    }
    assert!(seen > 100, "{seen}");
}

#[test]
fn named_effects_and_shapes_share_one_level() {
    let mut rng = rng(21);
    let f = table_of_touches(&mut rng);
    let base = location_base(&f);
    let n = f.block.len();
    let mut library = correlated_library(&mut rng, n, 60);
    library.append(generics_of(&f).library);
    let runs = std::env::var("RUNS").map_or(250, |r| r.parse().unwrap());
    let (mut any, mut generic) = (0, 0);
    for _ in 0..runs {
        let r = noise(&mut rng, n);
        let search = Search::new(ask(&r, &base), &library);
        any += usize::from(search.leader().is_some() || search.leading_shape().is_some());
        generic += usize::from(search.leading_shape().is_some());
    }
    println!("clean data: any proposal in {any} of {runs}, generic in {generic}");
    // 5 % and two standard errors
    assert!(any * 1000 < 78 * runs, "{any}");
}
