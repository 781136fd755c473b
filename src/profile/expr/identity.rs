//! A condition on what a device says of itself, in the `when` of a tag: `revision >= "2.10"`, `model_name = "PXR-4"`.

use super::{COMPARES, Reader};
use crate::{
    plant::{
        def::DeviceId,
        identity::{IdentityObject, IdentityTest, is_version},
    },
    profile::reader::At,
};

/// The length of a text in quotes, double or single, that stands at the beginning.
pub(super) fn quoted(rest: &str) -> Option<usize> {
    let quote = rest.chars().next().filter(|first| "\"'".contains(*first))?;
    rest[1..].find(quote).map(|end| end + 2)
}

impl<'a> Reader<'a, '_> {
    /// The test that stands next, `Some(None)` after the problem was added; `None`: it is none.
    pub(super) fn identity_test(&mut self) -> Option<Option<IdentityTest>> {
        let (name, sign) = (self.peek()?, self.tokens.get(self.next + 1)?);
        let (_, compare) = COMPARES.iter().find(|(word, _)| *word == sign.value)?;
        let object = IdentityObject::of(name.value);
        let with = self.tokens.get(self.next + 2).copied();
        let text = with.filter(|with| quoted(with.value).is_some());
        let is_tag = self.is_tag(name.value);
        // A tag of that name is compared with a number or a label.
        if is_tag && (object.is_none() || text.is_none()) || object.is_none() && text.is_none() {
            return None;
        }
        Some(self.checked(name, object, text).map(|(device, object, text)| {
            self.next += 3;
            IdentityTest { device, object, compare: *compare, with: text.to_owned() }
        }))
        .map(|test| test.filter(|test| self.fits(test, with)))
    }

    fn is_tag(&self, name: &str) -> bool {
        let inside = self.device.map(|device| format!("{device}.{name}"));
        [Some(name), inside.as_deref()].into_iter().flatten().any(|name| self.defs.names.tags.contains_key(name))
    }

    fn checked(
        &mut self,
        name: At<&'a str>,
        object: Option<IdentityObject>,
        text: Option<At<&'a str>>,
    ) -> Option<(DeviceId, IdentityObject, &'a str)> {
        let Some(object) = object else {
            let problem = self.problems.add(name.at, format!("unknown identification object `{}`", name.value));
            let known: Vec<&str> = IdentityObject::names().collect();
            let expected = format!("expected one of {} and object_0x80 to object_0xFF", known.join(", "));
            problem.label(expected).suggest(name.value, known);
            return None;
        };
        let Some(device) = self.identified else {
            let problem = self.problems.add(name.at, format!("the {object} of a device is not known here"));
            problem.label("expected only in the `when` of a tag");
            return None;
        };
        let Some(text) = text else {
            let problem = self.problems.add(name.at, format!("the {object} of a device is compared with a text"));
            problem.label(format!("expected {object} >= \"2.10\" or {object} = \"…\", with the quotes"));
            return None;
        };
        Some((device, object, &text.value[1..text.value.len() - 1]))
    }

    /// Can what the test compares with be found?
    fn fits(&mut self, test: &IdentityTest, with: Option<At<&'a str>>) -> bool {
        let at = with.map_or(self.end, |with| with.at);
        if test.is_of_versions() && !is_version(&test.with) {
            let problem = self.problems.add(at, format!("`{}` is not a version", test.with));
            problem.label("expected numbers with dots between them, as \"2.10\"");
            return false;
        }
        if test.with.trim().is_empty() {
            self.problems.add(at, format!("the {} is compared with nothing", test.object)).label("expected a text");
            return false;
        }
        true
    }
}
