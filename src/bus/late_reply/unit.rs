//! What is known of one unit whose frames carry no transaction id: what is outstanding, and how it proves to be in sync.

use std::time::Duration;

use super::{OUTSTANDING_MAX, OutstandingReplies};
use crate::bus::frame::ResponseSignature;

/// How a unit proves that nothing older is still to come; what has failed gives way to the next.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Proof {
    /// It reads a part of a block: an answer of another signature.
    #[default]
    Part,
    /// It gives back a loopback.
    Loopback,
    /// It answers anything, and then nothing more comes of it: a serial device answers in order.
    Silence,
}

impl Proof {
    pub(super) fn next(self) -> Proof {
        match self {
            Proof::Part => Proof::Loopback,
            Proof::Loopback => Proof::Silence,
            Proof::Silence => Proof::Part,
        }
    }
}

/// Proofs in vain after which a unit that has given one by an answer may be another one, which cannot.
const IN_VAIN_MAX: u8 = 8;

#[derive(Debug, Clone, Default)]
pub(super) struct Unit {
    pub outstanding: OutstandingReplies,
    /// How late an outstanding reply has ever come, its timeout included.
    pub late_max: Duration,
    /// When it last failed to answer in time.
    pub failed_at: Option<Duration>,
    /// When it last answered in time what cannot have been answered before.
    pub proved_at: Option<Duration>,
    /// When it last sent what it was not asked for, unless it has been resynchronised since.
    pub unsolicited_at: Option<Duration>,
    /// Its last good answer, and whether that came again.
    pub answer: Vec<u8>,
    pub repeats: bool,
    /// Outstanding signatures of which one has come late.
    arrived: Vec<ResponseSignature>,
    /// What had not come, and since when it was outstanding, when it proved to be in sync: from a unit that answers in order, it
    /// never comes.
    disproved: Vec<(ResponseSignature, Duration)>,
    /// It does not answer in order.
    pub reorders: bool,
    /// More than one answer of a signature may be under way: only time clears what is outstanding.
    pub is_unsure: bool,
    /// What is tried next to prove that it is in sync.
    pub proof: Proof,
    /// Proofs that may still be in vain before silence is tried: it has proved to be in sync by an answer.
    spare_proofs: u8,
    /// Its last frame, if that answered a request without proving anything: see [`Proof::Silence`].
    pub settles_from: Option<Duration>,
}

impl Unit {
    pub fn resynchronise(&mut self) {
        self.outstanding.clear();
        self.arrived.clear();
        (self.failed_at, self.unsolicited_at, self.is_unsure, self.settles_from) = (None, None, false, None);
    }

    /// It has proved to be in sync by an answer.
    pub fn proof_given(&mut self) {
        self.spare_proofs = IN_VAIN_MAX;
    }

    /// What was tried has proved nothing. Silence takes longest, and is not tried where an answer would do.
    pub fn proof_failed(&mut self) {
        self.proof = self.proof.next();
        if self.proof == Proof::Silence && 0 < self.spare_proofs {
            self.proof = self.proof.next();
        }
        self.spare_proofs = self.spare_proofs.saturating_sub(1);
    }

    /// A frame of it came that answers nothing.
    pub fn unsettle(&mut self, now: Duration) {
        self.settles_from = self.settles_from.map(|_| now);
    }

    /// So long after its last frame nothing more comes: twice the time that is waited where nothing proves anything.
    pub fn settling_time(&self, timeout: Duration) -> Duration {
        2 * self.quarantine(timeout)
    }

    /// It has given an answer that cannot have been an older one.
    pub fn prove(&mut self, quarantine: Duration, now: Duration) {
        self.proved_at = Some(now);
        let (signatures, arrived) =
            (std::mem::take(&mut self.outstanding.signatures), std::mem::take(&mut self.arrived));
        let (failed_at, is_unsure) = (self.failed_at, self.is_unsure);
        self.resynchronise();
        let Some(failed_at) = failed_at else { return };
        if self.reorders {
            (self.outstanding.signatures, self.failed_at, self.is_unsure) = (signatures, Some(failed_at), is_unsure);
            return;
        }
        self.disproved.retain(|(_, failed_at)| now.saturating_sub(*failed_at) < quarantine);
        let missing = signatures
            .into_iter()
            .filter(|signature| !arrived.contains(signature))
            .map(|signature| (signature, failed_at));
        self.disproved.extend(missing.take(OUTSTANDING_MAX.saturating_sub(self.disproved.len())));
    }

    /// An answer has come late. `true` if it shows that answers overtake each other: nothing of its signature is outstanding but what
    /// cannot come any more from a unit that answers in order. All of that may still come now.
    pub fn detect_reordering(&mut self, message: &[u8], quarantine: Duration, now: Duration) -> bool {
        let fits = |signature: &&ResponseSignature| signature.fits(message);
        if let Some(signature) =
            self.outstanding.signatures.iter().find(fits).filter(|signature| !self.arrived.contains(signature))
        {
            self.arrived.push(*signature);
            return false;
        }
        self.disproved.retain(|(_, failed_at)| now.saturating_sub(*failed_at) < quarantine);
        let Some(place) = self.disproved.iter().position(|(signature, _)| signature.fits(message)) else {
            return false;
        };
        self.disproved.swap_remove(place);
        (self.reorders, self.is_unsure) = (true, !self.disproved.is_empty() || !self.outstanding.signatures.is_empty());
        for (signature, failed_at) in std::mem::take(&mut self.disproved) {
            self.outstanding.add(signature);
            self.failed_at = self.failed_at.max(Some(failed_at));
        }
        true
    }

    /// It is left alone so long for each outstanding reply, where nothing can prove that it is in sync.
    pub fn quarantine(&self, timeout: Duration) -> Duration {
        (2 * self.late_max).max(10 * timeout)
    }
}
