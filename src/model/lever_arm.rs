//! A turn about a bearing or a carriage that stands somewhere else than where rotations are stated: besides the turn, what it turns
//! is displaced in proportion to the distance. Nobody knows that distance, so that it is a parameter of the shape.

use super::as_written::{EffectAsWritten, Grid, Placed, Scan, ShapeAsWritten, TermAsWritten};

/// How far from where rotations are stated a bearing or a carriage may be, mm.
pub const FARTHEST_MM: f64 = 400.0;

/// Distances that are tried between −400 and 400 mm: what lies between them is found by refining the best.
const TRIED: usize = 9;

/// Puts the lever arm of a row with `arm` into its terms and shapes: a turn of θ about r̂ through a point at a·d̂ is the same turn
/// through the origin and a displacement of −a·θ·(r̂ × d̂).
pub(super) fn with_arm(mut row: EffectAsWritten) -> EffectAsWritten {
    let Some(along) = row.arm.as_ref().and_then(|word| component(word.get_ref())) else { return row };
    let name = format!("arm_{}", row.id.get_ref().replace('-', "_"));
    let displaced = |term: &TermAsWritten| {
        let about = component(term.dof.get_ref().strip_prefix('r')?)?;
        let (to, sign) = cross(about, along)?;
        let mut shift = term.clone();
        *shift.dof.get_mut() = format!("d{}", ["x", "y", "z"][to]);
        *shift.formula.get_mut() = format!("{}{name}*({})", if sign > 0.0 { "-" } else { "" }, term.formula.get_ref());
        Some(shift)
    };
    let shifts: Vec<TermAsWritten> = row.terms.iter().filter_map(displaced).collect();
    row.terms.extend(shifts);
    let at_the_word = |text: &str, place: &Placed| Placed::new(place.span(), text.to_owned());
    let place = row.id.clone();
    row.shape.push(ShapeAsWritten {
        parameter: at_the_word(&name, &place),
        unit: at_the_word("mm", &place),
        start: 0.0,
        min: Some(-2.0 * FARTHEST_MM),
        max: Some(2.0 * FARTHEST_MM),
        scan: Some(Scan::Grid(Grid { from: -FARTHEST_MM, to: FARTHEST_MM, points: TRIED, log: false })),
        between: None,
        source: None,
    });
    row
}

fn component(letter: &str) -> Option<usize> {
    ["x", "y", "z"].iter().position(|l| *l == letter)
}

/// Unit vectors r̂ × d̂: along which axis, and with which sign.
fn cross(r: usize, d: usize) -> Option<(usize, f64)> {
    match (3 + d - r) % 3 {
        1 => Some(((r + 2) % 3, 1.0)),
        2 => Some(((r + 1) % 3, -1.0)),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use crate::diag::source;
    use crate::model::catalogue::Catalogue;

    #[test]
    fn a_turn_about_a_point_below_shifts_what_is_above_it() {
        // about y through a point 100 mm below: what stands at the origin goes to +x with a positive turn
        let text = "[[effect]]\nid = \"my-lean\"\nat = \"X\"\narm = \"z\"\nterms = [{ parameter = \"lean\", unit = \"urad\", \
                    dof = \"ry\", formula = \"X/300\" }]\n";
        let mut catalogue = Catalogue::default();
        catalogue.add_file(&source("my.toml", text)).unwrap();
        let effect = catalogue.iter().next().unwrap();
        let names: Vec<&str> = effect.parameters.iter().map(|p| p.name.as_str()).collect();
        assert_eq!(names, ["lean", "arm_my_lean"]);
        let shift = &effect.terms[1];
        assert_eq!((shift.component, shift.formula.text()), (0, "-arm_my_lean*(X/300)"));
        let wrong = Catalogue::default().add_file(&source("my.toml", text.replace("\"z\"", "\"q\""))).unwrap_err();
        assert_eq!(wrong.0[0].code, "effects::arm");
    }
}
