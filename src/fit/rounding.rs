//! What the last digit of a log takes away.

use crate::model::data::Data;

/// What rounding to the last digit of a log does to a touch.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Rounding {
    /// The last digit, mm; 0 where nothing is lost.
    digit_mm: f64,
}

impl Rounding {
    /// Of the touches of a study, each with the digits of its own log.
    pub(super) fn of_touches(data: &Data) -> Self {
        let touches = |run: usize| data.observations.iter().filter(|o| o.run == run).count();
        Self::from_logs(data.digits_mm.iter().enumerate().map(|(run, digit_mm)| (touches(run), *digit_mm)))
    }

    /// Of logs whose touches count as many as given, each with its last digit, mm: the root mean square.
    fn from_logs(logs: impl Iterator<Item = (usize, Option<f64>)>) -> Self {
        let (mut touches, mut squares) = (0, 0.0);
        for (n, digit_mm) in logs {
            touches += n;
            squares += n as f64 * digit_mm.unwrap_or(0.0).powi(2);
        }
        Self { digit_mm: (squares / touches.max(1) as f64).sqrt() }
    }

    #[cfg(test)]
    fn to(digit_mm: f64) -> Self {
        Self { digit_mm }
    }

    /// Standard deviation of what is rounded away, mm: it is even between half a digit less and half a digit more.
    #[must_use]
    pub fn sigma_mm(&self) -> f64 {
        self.digit_mm / 12f64.sqrt()
    }

    /// A standard deviation, mm, with what is rounded away: it depends on the last digits of a touch only, and hence on nothing
    /// of its noise.
    #[must_use]
    pub fn added_to(&self, sigma_mm: f64) -> f64 {
        sigma_mm.hypot(self.sigma_mm())
    }

    /// The standard deviation of rounded touches, mm, from that of rounded touches of one place.
    ///
    /// Of what is rounded away a part is the same in all touches of a place and does not show in them. The part is the
    /// mean of the rounding's sawtooth over the noise; with the sawtooth as a sum of sines, its mean square over all places is
    /// d²/(2π²)·Σ exp(−4π²k²σ²/d²)/k² (Widrow and Kollár, Quantization Noise, 2008, chapter 4).
    #[must_use]
    pub(super) fn with_what_repeats_hide(&self, repeats_mm: f64) -> f64 {
        use std::f64::consts::PI;
        let d2 = self.digit_mm * self.digit_mm;
        if d2 <= 0.0 {
            return repeats_mm;
        }
        let hidden = |total2: f64| -> f64 {
            let noise2 = (total2 - d2 / 12.0).max(0.0);
            let term = |k: f64| (-4.0 * (PI * k).powi(2) * noise2 / d2).exp() / (k * k);
            d2 / (2.0 * PI * PI) * (1..=50).map(|k| term(f64::from(k))).sum::<f64>()
        };
        let found2 = repeats_mm * repeats_mm;
        // total − hidden(total) grows with the total
        let (mut low, mut high) = (found2, found2 + d2 / 12.0);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if middle - hidden(middle) < found2 { low = middle } else { high = middle }
        }
        (0.5 * (low + high)).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::Rounding;

    /// Rounded draws at places of their own say what repeats see and what there is, for coarse and fine digits.
    #[test]
    fn repeats_hide_what_is_rounded_alike() {
        use rand::{RngExt, SeedableRng};
        use rand_distr::{Distribution, StandardNormal};
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(4);
        for sigma in [0.15, 0.3, 0.5, 1.0] {
            let (mut within, mut all, n) = (0.0, 0.0, 60_000);
            for _ in 0..n {
                let place: f64 = rng.random_range(0.0..1.0);
                let mut draw = || -> f64 {
                    let noise: f64 = StandardNormal.sample(&mut rng);
                    (place + sigma * noise).round() - place
                };
                let (a, b) = (draw(), draw());
                within += 0.5 * (a - b) * (a - b);
                all += 0.5 * (a * a + b * b);
            }
            let (within, all) = ((within / f64::from(n)).sqrt(), (all / f64::from(n)).sqrt());
            let rounding = Rounding::to(1.0);
            assert!((rounding.added_to(sigma) / all - 1.0).abs() < 0.01, "{sigma}");
            assert!((rounding.with_what_repeats_hide(within) / all - 1.0).abs() < 0.01, "{sigma} {within} {all}");
            assert!(sigma > 0.2 || within < 0.92 * all, "{sigma}");
        }
        assert!((Rounding::from_logs([(300, Some(2e-3)), (100, None)].into_iter()).sigma_mm() - 5e-4).abs() < 1e-12);
        assert_eq!(Rounding::default().with_what_repeats_hide(1e-3), 1e-3);
    }
}
