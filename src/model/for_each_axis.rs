//! A row of effects with `axes` stands for one row of each axis: letters in braces follow the axis ([`AxisName::fill_in`]). A row with
//! `{place}` in a formula stands for one row of each side of the chain.

use super::as_written::{EffectAsWritten, Placed, Typical};
use super::lever_arm::with_arm;
use crate::axes::AxisName;
use crate::machine::Side;

/// The rows of a file, one for each axis. Rows with `with_previous` are repeated together with the row before them.
pub(super) fn expand(
    rows: Vec<EffectAsWritten>,
    mut axes: impl FnMut(&[Placed]) -> Vec<AxisName>,
) -> Vec<EffectAsWritten> {
    let mut out = Vec::new();
    for together in rows.chunk_by(|_, next| next.with_previous) {
        let letters = together.first().map(|row| axes(&row.axes)).unwrap_or_default();
        if letters.is_empty() {
            out.extend(together.iter().cloned());
        }
        for (number, axis) in letters.into_iter().enumerate() {
            out.extend(together.iter().map(|row| row.for_axis(axis, number)));
        }
    }
    out.into_iter().flat_map(EffectAsWritten::for_sides).map(with_arm).collect()
}

/// Where the carriage of the row's axis stands on its guideway, mm.
const PLACE: &str = "{place}";

impl EffectAsWritten {
    /// Does a formula speak of the place of the row's axis?
    pub(super) fn has_place(&self) -> bool {
        self.terms.iter().any(|term| term.formula.get_ref().contains(PLACE))
    }

    /// One row for each side, where a formula speaks of the place of the row's linear axis.
    fn for_sides(self) -> Vec<Self> {
        let at = self.at.get_ref().clone();
        if !self.has_place() || !["X", "Y", "Z"].contains(&at.as_str()) {
            return vec![self];
        }
        let on = |side: Side| {
            let mut row = self.clone();
            row.place_on = Some(side);
            let sign = if side.travel_sign() < 0.0 { "-" } else { "" };
            for term in &mut row.terms {
                let formula = term.formula.get_ref().replace(PLACE, &format!("({sign}{at})"));
                *term.formula.get_mut() = formula;
            }
            row
        };
        [Side::Tool, Side::Workpiece].map(on).into()
    }

    fn for_axis(&self, axis: AxisName, number: usize) -> Self {
        let mut row = self.clone();
        let Self { name, says, look, mends, too_large, .. } = &mut row;
        [name, says, look, mends, too_large].into_iter().for_each(|text| *text = axis.fill_in(text));
        let placed = |word: &mut Placed| *word.get_mut() = axis.fill_in(word.get_ref());
        let words = [&mut row.id, &mut row.at].into_iter().chain(&mut row.arm);
        words.chain(&mut row.needs).chain(&mut row.unless).chain(&mut row.includes).for_each(placed);
        for term in &mut row.terms {
            let always = [&mut term.parameter, &mut term.dof, &mut term.formula];
            always.into_iter().chain(&mut term.at).for_each(placed);
            [&mut term.iso, &mut term.alias].into_iter().flatten().for_each(|text| *text = axis.fill_in(text));
            if let Some(Typical::Each(sizes)) = &term.typical {
                term.typical = sizes.get(number).copied().map(Typical::All);
            }
        }
        for shape in &mut row.shape {
            std::iter::once(&mut shape.parameter).chain(&mut shape.between).for_each(placed);
        }
        row
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diag::source;
    use crate::model::catalogue::Catalogue;

    #[test]
    fn a_row_stands_for_each_of_its_axes() {
        let row = |id: &str, more: &str| {
            format!(
                "[[effect]]\nid = \"{id}-{{a}}\"\n{more}\nname = \"Tilt of {{A}}\"\nat = \"{{A}}\"\nterms = [{{ parameter = \
                 \"q{id}_{{B}}{{A}}\", unit = \"urad\", dof = \"r{{y}}\", formula = \"sin({{A}})\", typical = [3.0, 5.0] }}]\n"
            )
        };
        let text = row("p", "axes = [\"A\", \"C\"]") + &row("q", "with_previous = true");
        let mut catalogue = Catalogue::default();
        catalogue.add_file(&source("my.toml", text.clone())).unwrap();
        let found: Vec<_> = catalogue
            .iter()
            .map(|e| {
                let (p, t) = (&e.parameters[0], &e.terms[0]);
                (e.id.as_str(), e.name.as_str(), p.name.as_str(), p.typical, t.component, t.formula.text())
            })
            .collect();
        // about A the other two are Y and Z, about C they are X and Y
        let expected = [
            ("p-a", "Tilt of A", "qp_BA", 3.0, 4, "sin(A)"),
            ("q-a", "Tilt of A", "qq_BA", 3.0, 4, "sin(A)"),
            ("p-c", "Tilt of C", "qp_AC", 5.0, 3, "sin(C)"),
            ("q-c", "Tilt of C", "qq_AC", 5.0, 3, "sin(C)"),
        ];
        assert_eq!(found, expected);
        let wrong = Catalogue::default().add_file(&source("my.toml", text.replace("\"C\"]", "\"Q\"]"))).unwrap_err();
        assert_eq!(wrong.0[0].code, "effects::axis");
    }
    #[test]
    fn a_place_on_a_guideway_has_the_sign_of_its_side() {
        let text = "[[effect]]\nid = \"p\"\nat = \"X\"\nterms = [{ parameter = \"q\", unit = \"um\", dof = \"dz\", formula = \
                    \"{place} + X\" }]\n";
        let mut catalogue = Catalogue::default();
        catalogue.add_file(&source("my.toml", text.to_owned())).unwrap();
        let found: Vec<_> = catalogue.iter().map(|e| (e.place_on, e.terms[0].formula.text())).collect();
        let on = |side| Some((AxisName::X, side));
        assert_eq!(found, [(on(Side::Tool), "(X) + X"), (on(Side::Workpiece), "(-X) + X")]);
        for at in ["base", "C"] {
            let wrong = text.replace("\"X\"", &format!("{at:?}"));
            let findings = Catalogue::default().add_file(&source("my.toml", wrong)).unwrap_err();
            assert_eq!(findings.0.iter().map(|f| f.code).collect::<Vec<_>>(), ["effects::place"], "{at}");
        }
    }
}
