//! What a device says of itself by function 43/14 (V1.1b3, 6.21), and what a profile compares it with.

use std::{cmp::Ordering, collections::BTreeMap, fmt, sync::Arc};

use serde::{Deserialize, Serialize};

use super::{compare::Compare, id::DeviceId};

/// Encapsulated interface transport, by which a device is asked.
pub const FUNCTION: u8 = 0x2B;

/// The objects that the standard names, as a profile does.
const NAMED: [&str; 7] =
    ["vendor_name", "product_code", "revision", "vendor_url", "product_name", "model_name", "user_application_name"];

/// MajorMinorRevision.
const REVISION: IdentityObject = IdentityObject(2);

/// An object of the identification of a device, by its number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct IdentityObject(pub u8);

impl IdentityObject {
    /// By the name that it has in a profile: `revision`, `object_0x80`.
    pub fn of(name: &str) -> Option<IdentityObject> {
        let named = || (0..).zip(NAMED).find_map(|(id, known)| (known == name).then_some(id));
        let hex = |digits: &str| u8::from_str_radix(digits, 16).ok().filter(|id| digits.len() == 2 && 0x80 <= *id);
        named().or_else(|| hex(name.strip_prefix("object_0x")?)).map(IdentityObject)
    }

    /// The names of the standard.
    pub fn names() -> impl Iterator<Item = &'static str> {
        NAMED.into_iter()
    }
}

impl fmt::Display for IdentityObject {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match NAMED.get(usize::from(self.0)) {
            Some(name) => f.write_str(name),
            None => write!(f, "object_0x{:02X}", self.0),
        }
    }
}

/// What devices say of themselves, as far as it was read since they were last lost. Shared with snapshots.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct Identities(Arc<BTreeMap<DeviceId, Vec<(IdentityObject, String)>>>);

impl Identities {
    /// What a device says as this object.
    pub fn said(&self, device: DeviceId, object: IdentityObject) -> Option<&str> {
        let objects = self.0.get(&device)?;
        objects.iter().find(|(of, _)| *of == object).map(|(_, text)| text.as_str())
    }

    /// A device says this, or nothing; is that new?
    pub fn set(&mut self, device: DeviceId, objects: Vec<(IdentityObject, String)>) -> bool {
        if self.0.get(&device).map_or(&[][..], Vec::as_slice) == objects {
            return false;
        }
        let all = Arc::make_mut(&mut self.0);
        if objects.is_empty() {
            all.remove(&device)
        } else {
            all.insert(device, objects)
        };
        true
    }

    /// It is gone.
    pub fn forget(&mut self, device: DeviceId) {
        if self.0.contains_key(&device) {
            Arc::make_mut(&mut self.0).remove(&device);
        }
    }

    /// Takes over what was known under another definition of the devices that are the same; `was` is the id of before.
    pub fn take_over(&mut self, before: &Identities, devices: impl Iterator<Item = (DeviceId, DeviceId)>) {
        let known = devices.filter_map(|(now, was)| Some((now, before.0.get(&was)?.clone())));
        Arc::make_mut(&mut self.0).extend(known);
    }
}

/// An object of the identification of a device is compared with a text.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct IdentityTest {
    /// Whose.
    pub device: DeviceId,
    /// Which object.
    pub object: IdentityObject,
    /// How.
    pub compare: Compare,
    /// With what.
    pub with: String,
}

impl IdentityTest {
    /// Does what the device says fit? `None`: it should be a version, and is none. Texts are equal whatever the case of
    /// their letters and the blanks around them.
    pub fn holds(&self, found: &str) -> Option<bool> {
        let order = if self.is_of_versions() {
            Some(version(found)?.cmp(&version(&self.with)?))
        } else {
            let text = |text: &str| text.trim_matches(|c: char| c.is_whitespace() || c == '\0').to_lowercase();
            (text(found) == text(&self.with)).then_some(Ordering::Equal)
        };
        Some(self.compare.fits(order))
    }

    /// Are versions compared? A revision is one; of another object it is asked which is the greater.
    pub fn is_of_versions(&self) -> bool {
        self.object == REVISION || self.compare.is_order()
    }
}

/// `revision >= "2.10"`.
impl fmt::Display for IdentityTest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {} \"{}\"", self.object, self.compare.sign(), self.with)
    }
}

/// The parts of a version, `V2.10` is 2 and 10: numbers with dots between them, after a V that does not count; parts of 0 at the
/// end do not count, nor does what follows. `None`: it does not begin so.
fn version(text: &str) -> Option<Vec<u64>> {
    let text = text.trim();
    let text = text.strip_prefix(['V', 'v']).map_or(text, str::trim_start);
    let end = text.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(text.len());
    let parts = text[..end].trim_end_matches('.').split('.').map(|part| part.parse().ok());
    let mut parts = parts.collect::<Option<Vec<u64>>>()?;
    while parts.last() == Some(&0) {
        parts.pop();
    }
    Some(parts)
}

/// Is a text a version and nothing else?
pub fn is_version(text: &str) -> bool {
    let digits = text.strip_prefix(['V', 'v']).unwrap_or(text);
    digits.bytes().all(|byte| byte.is_ascii_digit() || byte == b'.')
        && !digits.ends_with('.')
        && version(text).is_some()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_version_is_compared_part_by_part() {
        use Compare::{Above, AtLeast, AtMost, Below, Differs, Equal};
        let check = |object: &str, found: &str, compare, with: &str, expect| {
            let object = IdentityObject::of(object).expect("an object");
            let test = IdentityTest { device: DeviceId(0), object, compare, with: with.to_owned() };
            assert_eq!(test.holds(found), expect, "{test}, and it is {found}");
        };
        for (found, compare, with, expect) in [
            ("2.10", AtLeast, "2.9", Some(true)),
            ("2.9", AtLeast, "2.10", Some(false)),
            ("V2.10", AtLeast, "2.10", Some(true)),
            ("v 2.10.1", Above, "V2.10", Some(true)),
            ("2.10", Equal, "2.10.0", Some(true)),
            ("02.09", Equal, "2.9", Some(true)),
            ("2", Below, "2.0.1", Some(true)),
            ("2.10-rc1", AtMost, "2.10", Some(true)),
            ("2.10. build 7", Equal, "2.10", Some(true)),
            (" 2.10 ", Differs, "2.10", Some(false)),
            ("Rev A", AtLeast, "2.10", None),
            ("", Equal, "2.10", None),
            ("2..1", Below, "2.10", None),
            ("99999999999999999999", Above, "2", None),
        ] {
            check("revision", found, compare, with, expect);
        }
        check("object_0x80", "V1.3", Above, "1.2", Some(true));
        check("object_0x80", "V1.3", Equal, "1.3", Some(false));
    }

    #[test]
    fn a_text_is_the_same_in_any_case_of_its_letters() {
        let holds = |found: &str, compare| {
            let object = IdentityObject::of("model_name").expect("an object");
            IdentityTest { device: DeviceId(0), object, compare, with: "PXR-4".to_owned() }.holds(found)
        };
        assert_eq!(holds("pxr-4 \0", Compare::Equal), Some(true));
        assert_eq!(holds("PXR-40", Compare::Equal), Some(false));
        assert_eq!(holds("PXR-40", Compare::Differs), Some(true));
    }

    #[test]
    fn objects_have_the_names_of_the_standard() {
        for id in (0..7).chain(0x80..=0xFF).map(IdentityObject) {
            assert_eq!(IdentityObject::of(&id.to_string()), Some(id));
        }
        for wrong in ["", "Revision", "object_0x7F", "object_0x1", "object_0x100", "object_128", "object_0x+8"] {
            assert_eq!(IdentityObject::of(wrong), None, "{wrong}");
        }
        assert!(is_version("V2.10") && is_version("7"));
        assert!(["", "V", "2.10b", "2..1", "2.", "a"].into_iter().all(|text| !is_version(text)));
    }
}
