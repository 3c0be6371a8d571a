//! World ↔ joints against the independent chain.

use super::by_hand::tip;
use super::support::{MACHINES, Spread, all_terms, machine, pose};
use axiscal::tables::kins::{Errors, Kins};

/// The whole purpose: driven to the joints, the real machine holds the tip where the errorless one holds it at the world
/// coordinates.
#[test]
fn the_compensated_tip_is_the_nominal_one() {
    let mut worst: f64 = 0.0;
    for name in MACHINES {
        let machine = machine(name);
        for seed in 0..20 {
            let mut spread = Spread::new(seed);
            let terms = all_terms(&machine, &mut spread);
            let reference = [spread.next(50.0), spread.next(50.0), -250.0 + spread.next(50.0)];
            let length = 150.0 + spread.next(100.0);
            let kins = Kins::new(&machine, Errors::from_terms(&terms, reference), length);
            for _ in 0..20 {
                let world = pose(&machine, &mut spread);
                let joints = kins.joints(&world).unwrap();
                let real = tip(&machine, &joints, &terms, reference, length);
                let meant = tip(&machine, &world, &[], reference, length);
                let uncorrected = tip(&machine, &world, &terms, reference, length);
                let off = |a: [f64; 3]| (0..3).map(|k| (a[k] - meant[k]).abs()).fold(0.0, f64::max);
                worst = worst.max(off(real));
                assert!(off(uncorrected) > 1e-3, "{name}: the errors do nothing");
                assert!(kins.ball_error(&world, &joints).amax() < 1e-12);
                let back = kins.world(&joints).unwrap();
                for k in 0..6 {
                    assert!((back.0[k] - world.0[k]).abs() < 1e-12, "{name}: {back:?} {world:?}");
                }
            }
        }
    }
    println!("largest distance of the compensated tip from the nominal one: {worst:.2e} mm");
    assert!(worst < 1e-12, "{worst:e}");
}
