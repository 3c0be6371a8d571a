//! Scatter from a generator whose stream is fixed for ever: each touch and each visit draws from a stream of its own,
//! so that the noise of a touch depends on neither the others nor the number of threads.

use super::rigid::Vec3;
use super::scenario::{Noise, Scenario};
use crate::program::plan::Plan;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal, StandardUniform};
use sha2::{Digest, Sha256};

/// The scatter of one run.
#[derive(Debug, Clone)]
pub struct Dice {
    noise: Noise,
    seed: [u8; 32],
}

/// Streams of visits lie apart from those of touches.
const VISITS: u64 = 1 << 63;

impl Dice {
    /// For a run. Two runs of one study share the scenario's seed but not their noise: program, mounting and what the
    /// control compensates are mixed in.
    pub fn new(scenario: &Scenario, plan: &Plan, compensated: bool) -> Self {
        let mut hash = Sha256::new();
        hash.update(scenario.seed.to_le_bytes());
        for word in [&plan.program, &plan.mounting] {
            hash.update((word.len() as u64).to_le_bytes());
            hash.update(word.as_bytes());
        }
        hash.update([u8::from(compensated)]);
        hash.update(scenario.clock.started_s.to_le_bytes());
        Self { noise: scenario.noise, seed: hash.finalize().into() }
    }

    fn stream(&self, number: u64) -> ChaCha8Rng {
        let mut rng = ChaCha8Rng::from_seed(self.seed);
        rng.set_stream(number);
        rng
    }

    /// How much later a touch triggers, mm.
    pub fn late_mm(&self, id: u64) -> f64 {
        let Noise { touch_mm, outlier_share, outlier_mm, .. } = self.noise;
        if touch_mm == 0.0 && outlier_share == 0.0 {
            return 0.0;
        }
        let mut rng = self.stream(id & !VISITS);
        let deviate: f64 = StandardNormal.sample(&mut rng);
        let chance: f64 = StandardUniform.sample(&mut rng);
        // a chip or a drop between ball and block: the probe triggers too early
        let chip: f64 = StandardNormal.sample(&mut rng);
        let early = if chance < outlier_share { chip.abs() * outlier_mm } else { 0.0 };
        deviate * touch_mm - early
    }

    /// Where the ball stands during an index visit less where it should, mm in R.
    pub fn visit_mm(&self, visit: u64) -> Vec3 {
        if self.noise.visit_mm == 0.0 {
            return [0.0; 3];
        }
        let mut rng = self.stream(visit | VISITS);
        [(); 3].map(|()| {
            let deviate: f64 = StandardNormal.sample(&mut rng);
            deviate * self.noise.visit_mm
        })
    }
}
