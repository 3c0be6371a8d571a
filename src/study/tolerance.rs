//! How large an error of the machine may be before somebody has to do something: said in the study, or taken as a default
//! that is named as one wherever it is used.

use crate::diag::{Finding, Findings, Source};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use toml::Spanned;

/// What one error may do where nobody said anything, µm.
pub const DEFAULT_UM: f64 = 10.0;

/// At which distance from the axis, mm: that at which `export` states what it leaves, too.
pub const DEFAULT_RADIUS_MM: f64 = 100.0;

/// The tolerance as written.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AsWritten {
    /// What one error may do to a point at `radius_mm`, µm (default: 10).
    #[schemars(with = "Option<f64>")]
    pub error_um: Option<Spanned<f64>>,
    /// At which distance from the axis, mm (default: 100).
    #[schemars(with = "Option<f64>")]
    pub radius_mm: Option<Spanned<f64>>,
    /// Single parameters that have a tolerance of their own, in their units (`EX0C = 0.005`).
    #[serde(default)]
    #[schemars(with = "BTreeMap<String, f64>")]
    pub parameters: BTreeMap<String, Spanned<f64>>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Tolerance {
    /// What one error may do to a point at `radius_mm`, µm.
    pub error_um: f64,
    /// At which distance from the axis, mm.
    pub radius_mm: f64,
    /// Single parameters, in their units.
    pub parameters: BTreeMap<String, f64>,
    /// False where nobody said anything and the default stands.
    pub stated: bool,
}

impl Default for Tolerance {
    fn default() -> Self {
        Self { error_um: DEFAULT_UM, radius_mm: DEFAULT_RADIUS_MM, parameters: BTreeMap::new(), stated: false }
    }
}

impl Tolerance {
    /// How large a parameter of this unit may be: its own tolerance, or what makes the error at the radius; none where its unit
    /// says nothing about that.
    #[must_use]
    pub fn limit(&self, name: &str, unit: &str) -> Option<f64> {
        let own = self.parameters.iter().find(|(own, _)| crate::symbols::same(own, name)).map(|(_, v)| *v);
        let per_unit = crate::tables::correction::left_um(1.0, unit, self.radius_mm).filter(|um| *um > 0.0);
        own.or_else(|| per_unit.map(|um| self.error_um / um))
    }

    /// From the study's text; what is unusable becomes a finding with its place.
    pub(super) fn read(written: Option<AsWritten>, source: &Source, findings: &mut Findings) -> Self {
        let Some(w) = written else { return Self::default() };
        let mut number = |given: Option<&Spanned<f64>>, what: &str, default: f64| match given {
            None => default,
            Some(n) if n.get_ref().is_finite() && *n.get_ref() > 0.0 && *n.get_ref() <= 1e6 => *n.get_ref(),
            Some(n) => {
                findings.push(
                    Finding::error("study::tolerance", format!("{what} of the tolerance is no usable number"))
                        .help("write a number greater than 0 and up to a million")
                        .at(source, n.span()),
                );
                default
            }
        };
        let error_um = number(w.error_um.as_ref(), "error_um", DEFAULT_UM);
        let radius_mm = number(w.radius_mm.as_ref(), "radius_mm", DEFAULT_RADIUS_MM);
        let parameters = w.parameters.iter().map(|(name, n)| (name.clone(), number(Some(n), name, 1.0))).collect();
        Self { error_um, radius_mm, parameters, stated: true }
    }
}

#[cfg(test)]
mod tests {
    use crate::diag::source;
    use crate::study::Study;

    const HEAD: &str =
        "machine = \"m\"\n[[data]]\nplan=\"p\"\nlog=\"l\"\ncontroller=\"csv\"\n[model]\neffects=[\"location-b\"]\n";

    #[test]
    fn a_tolerance_is_read_and_the_default_says_that_it_is_one() {
        let (study, _) = Study::parse(&source("s.toml", HEAD.to_owned())).unwrap();
        assert!(!study.tolerance.stated);
        assert_eq!((study.tolerance.error_um, study.tolerance.radius_mm), (10.0, 100.0));
        let text = format!("{HEAD}[tolerance]\nerror_um = 5\n[tolerance.parameters]\nEX0B = 0.002\n");
        let (study, _) = Study::parse(&source("s.toml", text)).unwrap();
        assert!(study.tolerance.stated);
        assert_eq!((study.tolerance.error_um, study.tolerance.radius_mm), (5.0, 100.0));
        assert_eq!(study.tolerance.parameters["EX0B"], 0.002);
    }

    #[test]
    fn rubbish_has_its_place() {
        for bad in ["error_um = 0", "error_um = -3", "error_um = nan", "radius_mm = inf", "radius_mm = 1e9"] {
            let text = format!("{HEAD}[tolerance]\n{bad}\n");
            let failure = Study::parse(&source("s.toml", text)).unwrap_err();
            assert_eq!(failure.0[0].code, "study::tolerance", "{bad}");
            assert!(failure.0[0].place().unwrap().starts_with("s.toml:9:"), "{:?}", failure.0[0].place());
        }
    }
}
