//! Transaction ids.

use super::*;

#[test]
fn the_id_of_an_abandoned_request_is_not_used_again() {
    let mut transactions = Transactions::new();
    let id = transactions.begin(&[1, 3, 0, 0, 0, 1], Duration::from_secs(1), Instant::now());
    transactions.under_way[0].sent_at = Some(Instant::now());
    transactions.give_up_all();
    for _ in 0..=u16::MAX {
        let later = transactions.begin(&[1, 3, 0, 9, 0, 1], Duration::from_secs(1), Instant::now());
        assert_ne!(later, id, "its reply is outstanding");
        transactions.under_way.clear();
    }
    assert!(matches!(transactions.take(id), Owner::Unknown), "it is not late: no time was given to it");
}
