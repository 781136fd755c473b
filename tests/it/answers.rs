//! Answers of the station, which a terminal knows by their texts: each of them has its row in `text/answers.rs`, and each row
//! has its answer.

use std::{collections::BTreeSet, fs, path::Path};

use syn::visit::{self, Visit};

use crate::texts::{is_test, literals, sources, texts};

/// The texts with which access control refuses: what is in `Err(…)`, `refused(…)`, a constant, and what is called `why`.
#[derive(Default)]
struct Refusals {
    is_one: bool,
    texts: BTreeSet<String>,
}

impl Refusals {
    fn within(&mut self, visit: impl FnOnce(&mut Self)) {
        let before = std::mem::replace(&mut self.is_one, true);
        visit(self);
        self.is_one = before;
    }

    /// A word alone is no sentence.
    fn add(&mut self, text: &str) {
        if self.is_one && text.contains(' ') {
            self.texts.insert(text.to_owned());
        }
    }
}

impl<'a> Visit<'a> for Refusals {
    fn visit_item_mod(&mut self, module: &'a syn::ItemMod) {
        if !is_test(&module.attrs) {
            visit::visit_item_mod(self, module);
        }
    }
    fn visit_attribute(&mut self, _: &'a syn::Attribute) {}
    fn visit_expr_call(&mut self, call: &'a syn::ExprCall) {
        match &*call.func {
            syn::Expr::Path(path) if path.path.is_ident("Err") => self.within(|it| visit::visit_expr_call(it, call)),
            _ => visit::visit_expr_call(self, call),
        }
    }
    fn visit_expr_method_call(&mut self, call: &'a syn::ExprMethodCall) {
        self.visit_expr(&call.receiver);
        let visit = |it: &mut Self| call.args.iter().for_each(|argument| it.visit_expr(argument));
        // The requester's own, with nothing but the text.
        if call.method == "refused" && call.args.len() == 1 { self.within(visit) } else { visit(self) }
    }
    fn visit_item_const(&mut self, item: &'a syn::ItemConst) {
        self.within(|it| visit::visit_item_const(it, item));
    }
    fn visit_local(&mut self, local: &'a syn::Local) {
        match &local.pat {
            syn::Pat::Ident(name) if name.ident == "why" => self.within(|it| visit::visit_local(it, local)),
            _ => visit::visit_local(self, local),
        }
    }
    fn visit_lit_str(&mut self, text: &'a syn::LitStr) {
        self.add(&text.value());
    }
    fn visit_macro(&mut self, found: &'a syn::Macro) {
        literals(found.tokens.clone()).iter().for_each(|text| self.add(text));
    }
}

/// The text without the names of its places.
fn shape(text: &str) -> String {
    let mut parts = text.split('{');
    let first = parts.next().unwrap_or_default().to_owned();
    parts.fold(first, |shape, part| shape + "{}" + part.split_once('}').map_or(part, |(_, rest)| rest))
}

/// Names in the audit log, and what is said to a terminal before it has a session, or whose session ends: by the connection.
const NO_ANSWERS: [&str; 4] = [
    "not logged in",
    "requests from outside",
    "closed: no login for a long time, and another terminal needed the session",
    "{there} terminals{whose} are attached, no more may be",
];

#[test]
fn every_refusal_of_access_control_has_a_translation() {
    let access = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/access");
    let mut files = ["control.rs", "password.rs", "user.rs"].map(|name| access.join(name)).to_vec();
    sources(&access.join("control"), &mut files);
    let mut found = Refusals::default();
    for path in files {
        found.visit_file(&syn::parse_file(&fs::read_to_string(path).unwrap()).unwrap());
    }
    let known: BTreeSet<String> = texts()["text/answers"].iter().map(|text| shape(text)).collect();
    let is_answer = |text: &&String| !NO_ANSWERS.contains(&text.as_str());
    let unknown: Vec<_> = found.texts.iter().filter(is_answer).filter(|text| !known.contains(&shape(text))).collect();
    assert!(20 < found.texts.len(), "{:?}", found.texts);
    assert!(unknown.is_empty(), "English in every language, without a row in text/answers.rs: {unknown:#?}");
}

/// The terminal knows answers of the station by their texts: each stands in the code that gives it.
#[test]
fn every_known_answer_is_one_of_the_station() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    sources(&root.join("access"), &mut files);
    ["plant", "bus/io"].iter().for_each(|folder| sources(&root.join(folder), &mut files));
    let station: String = files.iter().map(|path| fs::read_to_string(path).unwrap()).collect();
    for answer in &texts()["text/answers"] {
        let literals = answer.split('{').filter_map(|part| part.rsplit('}').next());
        for piece in literals.flat_map(|literal| literal.split("; ")) {
            assert!(piece.is_empty() || station.contains(piece), "{answer:?}: {piece:?} is in no file of the station");
        }
    }
}
