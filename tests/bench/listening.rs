//! The line of another master, heard with lost, flipped, merged, late bytes: how many values are called good and are wrong
//! (none), and how much of the time values are good. `cargo bench --bench listening -- 100000` hears so many of each kind.
#![allow(clippy::print_stdout, missing_docs)]

mod heard;

use heard::{Outcome, damages, models, run};

/// Values that are sent on each line, for each kind of damage.
const VALUES: u64 = 20_000;

fn main() {
    let mut args = std::env::args().skip(1).filter(|arg| !arg.starts_with("--"));
    let values = args.next().and_then(|count| count.parse().ok()).unwrap_or(VALUES);
    let seed = args.next().and_then(|seed| seed.parse().ok()).unwrap_or(38);
    let only = args.next();
    println!("{:34} {:>10} {:>10} {:>6} {:>7}   least", "damage", "sent", "heard", "wrong", "good");
    let mut all = Outcome::default();
    for damage in damages().iter().filter(|damage| only.as_deref().is_none_or(|only| damage.name.contains(only))) {
        let (mut sum, mut least) = (Outcome::default(), (2.0, ""));
        for model in &models() {
            let outcome = run(model, damage, seed, values);
            if only.is_some() || 0 < outcome.wrong {
                println!(
                    "    {:30} {:10} {:10} {:6} {:6.1} %",
                    model.name,
                    outcome.sent,
                    outcome.heard,
                    outcome.wrong,
                    100.0 * outcome.good_share()
                );
            }
            if 0 < outcome.looks && outcome.good_share() < least.0 {
                least = (outcome.good_share(), model.name);
            }
            sum.add(outcome);
        }
        println!(
            "{:34} {:10} {:10} {:6} {:6.1} %   {:.1} % {}",
            damage.name,
            sum.sent,
            sum.heard,
            sum.wrong,
            100.0 * sum.good_share(),
            100.0 * least.0,
            least.1
        );
        all.add(sum);
    }
    println!("{:34} {:10} {:10} {:6} {:6.1} %", "all", all.sent, all.heard, all.wrong, 100.0 * all.good_share());
}
