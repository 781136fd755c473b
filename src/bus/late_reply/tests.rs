//! Which replies of a unit are outstanding, and what proves that none is.

use super::*;
use crate::{
    bus::plan,
    plant::{def::LineId, fixture},
};

#[test]
fn a_probe_never_has_an_outstanding_signature() {
    let blocks = plan::blocks(&fixture::plant(), LineId(0), &plan::UnreadableRanges::default());
    let inputs = &blocks[0];
    let mut outstanding = OutstandingReplies::default();
    assert!(outstanding.is_clear());
    let mut asked = Vec::new();
    // Every probe in vain is outstanding too; each next one differs until the block has no more signatures to offer.
    outstanding.add(response_signature(&inputs.request()).unwrap());
    assert!(outstanding.is_ambiguous(response_signature(&inputs.request()).unwrap()));
    while let Some(probe) = outstanding.probe([inputs].into_iter()) {
        assert!(!asked.contains(&probe));
        assert!(probe[5] < inputs.count as u8);
        outstanding.add(response_signature(&probe).unwrap());
        asked.push(probe);
    }
    assert_eq!(asked.len(), 7, "one to seven of eight registers");
    outstanding.clear();
    assert!(!outstanding.is_ambiguous(response_signature(&inputs.request()).unwrap()));
}

#[test]
fn a_unit_that_owes_too_much_is_asked_nothing() {
    let mut outstanding = OutstandingReplies::default();
    for count in 1..=OUTSTANDING_MAX as u8 {
        outstanding.add(response_signature(&[1, 3, 0, 0, 0, count]).unwrap());
    }
    assert!(outstanding.is_ambiguous(response_signature(&[1, 4, 0, 0, 0, 99]).unwrap()));
}

#[test]
fn a_loopback_is_never_ambiguous_and_its_first_refusal_is_proof() {
    let mut outstanding = OutstandingReplies::default();
    let signature = |number| response_signature(&loopback(1, number)).unwrap();
    assert!(outstanding.refusal_proves());
    outstanding.add(signature(7));
    assert!(!outstanding.is_clear() && !outstanding.refusal_proves());
    assert!(!outstanding.is_ambiguous(signature(8)));
    outstanding.clear();
    assert!(outstanding.is_clear() && outstanding.refusal_proves());
}

#[test]
fn writes_are_distinguished_by_their_echo() {
    let mut outstanding = OutstandingReplies::default();
    outstanding.add(response_signature(&[1, 6, 0, 1, 0, 5]).unwrap());
    assert!(!outstanding.is_ambiguous(response_signature(&[1, 6, 0, 1, 0, 6]).unwrap()));
    assert!(outstanding.is_ambiguous(response_signature(&[1, 6, 0, 1, 0, 5]).unwrap()));
}

#[test]
fn a_unit_that_was_late_must_rest_longer() {
    let s = Duration::from_secs;
    let mut replies = LineReplies::new(s(1), 0);
    let request = [1, 3, 0, 0, 0, 2];
    assert_eq!(replies.forget(1, s(0)), None, "without an outstanding reply there is nothing to forget");
    replies.failed(&request, s(100));
    assert!(replies.is_ambiguous(&request) && !replies.is_ambiguous(&[2, 3, 0, 0, 0, 2]));
    assert_eq!(replies.forget(1, s(104)), Some(s(6)), "ten timeouts");
    let answer = |unit| [unit, 3, 4, 0, 1, 0, 2];
    assert!(replies.on_late_reply(1, &answer(1), s(108)) && !replies.on_late_reply(2, &answer(2), s(108)));
    assert_eq!(replies.forget(1, s(110)), Some(s(8)), "twice the 9 s that it was late");
    assert_eq!(replies.forget(1, s(118)), None);
    assert!(!replies.is_ambiguous(&request));
}

#[test]
fn a_unit_rests_while_the_line_may_stand_still() {
    let s = Duration::from_secs;
    let blocks = plan::blocks(&fixture::plant(), LineId(0), &plan::UnreadableRanges::default());
    let at = |unit: u8| Block { unit, ..blocks[0].clone() };
    let mut replies = LineReplies::new(s(1), 0);
    replies.expect(&[at(1), at(2)]);
    let (request, probe, probed) = ([1, 3, 0, 0, 0, 2], [2, 3, 0, 0, 0, 1], [2, 3, 2, 0, 1]);
    replies.answered(&probe, &probed, true, s(99));
    replies.failed(&request, s(100));
    assert_eq!(replies.forget(1, s(110)), Some(s(90)), "nothing has answered since");
    replies.answered(&probe, &probed, false, s(111));
    assert_eq!(replies.forget(1, s(111)), Some(s(89)), "that may have been an older answer");
    replies.answered(&probe, &probed, true, s(112));
    assert_eq!(replies.forget(1, s(112)), None, "ten timeouts, and the line goes on");
    replies.failed(&request, s(200));
    replies.expect(&[at(1)]);
    assert_eq!(replies.forget(1, s(210)), None, "there is no other unit to tell");
}

#[test]
fn answers_that_overtake_each_other_prove_nothing() {
    let s = Duration::from_secs;
    let mut replies = LineReplies::new(s(1), 0);
    let (request, answer) = ([1, 3, 0, 0, 0, 2], [1, 3, 4, 0, 1, 0, 2]);
    let (probe, probed) = ([1, 3, 0, 0, 0, 1], [1, 3, 2, 0, 1]);
    replies.failed(&request, s(100));
    replies.answered(&probe, &probed, true, s(101));
    assert!(!replies.is_ambiguous(&request), "units are taken to answer in order");
    assert!(replies.detect_reordering(1, &answer, s(102)) && !replies.detect_reordering(1, &answer, s(103)));
    replies.failed(&request, s(200));
    replies.answered(&probe, &probed, true, s(201));
    assert!(replies.is_ambiguous(&request) && replies.must_wait(&request) && !replies.must_wait(&probe));
    assert!(replies.on_late_reply(1, &answer, s(202)));
    assert!(!replies.is_ambiguous(&request), "the outstanding reply has come");
    replies.failed(&request, s(300));
    assert_eq!((replies.forget(1, s(305)), replies.forget(1, s(310))), (Some(s(5)), None), "or it never comes");
}

#[test]
fn silence_is_tried_late_where_an_answer_has_proved_enough() {
    let mut replies = LineReplies::new(Duration::from_secs(1), 0);
    let tried = |replies: &mut LineReplies, count: usize| -> Vec<Proof> {
        let next = |replies: &mut LineReplies| {
            replies.proof_failed(1);
            replies.proof(1)
        };
        (0..count).map(|_| next(replies)).collect()
    };
    assert!(tried(&mut replies, 3).contains(&Proof::Silence), "nothing is known of it");
    replies.proof_given(1);
    assert!(!tried(&mut replies, 8).contains(&Proof::Silence), "it has only been silent for a while");
    assert!(tried(&mut replies, 3).contains(&Proof::Silence), "it may be another device");
}

#[test]
fn what_came_late_before_a_proof_has_overtaken_nothing() {
    let s = Duration::from_secs;
    let mut replies = LineReplies::new(s(1), 0);
    let (request, probe) = ([1, 3, 0, 0, 0, 2], [1, 3, 0, 0, 0, 1]);
    replies.failed(&request, s(100));
    let late = [1, 3, 4, 0, 1, 0, 2];
    assert!(!replies.detect_reordering(1, &late, s(101)) && replies.on_late_reply(1, &late, s(101)));
    replies.answered(&probe, &[1, 3, 2, 0, 1], true, s(102));
    assert!(!replies.detect_reordering(1, &[1, 3, 4, 0, 9, 0, 9], s(103)), "nothing is missing that it could be");
}
