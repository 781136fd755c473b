//! A decision over an enum of this crate names every variant, so that a new one has to be decided on. A `match` with one
//! arm beside `_` only asks whether it is that one, as `matches!` does.

use std::collections::HashSet;

use syn::{
    ExprMatch, ImplItemFn, ItemEnum, ItemFn, ItemImpl, ItemMod, Pat, Path, Type,
    spanned::Spanned,
    visit::{self, Visit},
};

use super::{Breaches, assert_law_counted, reader::is_test, source};

/// The names of the enums that some files declare.
#[derive(Default)]
struct Enums(HashSet<String>);

impl<'ast> Visit<'ast> for Enums {
    fn visit_item_enum(&mut self, item: &'ast ItemEnum) {
        self.0.insert(item.ident.to_string());
    }
}

/// Finds each `match` with `_ =>` beside two or more arms of an own enum.
struct Wildcards<'a> {
    enums: &'a HashSet<String>,
    /// The type whose `impl` this is, behind `Self`.
    own: String,
    found: Vec<String>,
}

impl Wildcards<'_> {
    /// The own enum whose variant a pattern names.
    fn of(&self, pattern: &Pat) -> Option<String> {
        let path = match pattern {
            Pat::Path(path) => &path.path,
            Pat::Struct(pattern) => &pattern.path,
            Pat::TupleStruct(pattern) => &pattern.path,
            Pat::Ident(bound) => return self.of(&bound.subpat.as_ref()?.1),
            Pat::Or(or) => return or.cases.iter().find_map(|case| self.of(case)),
            Pat::Guard(inner) => return self.of(&inner.pat),
            Pat::Paren(inner) => return self.of(&inner.pat),
            Pat::Reference(inner) => return self.of(&inner.pat),
            _ => return None,
        };
        let name = path.segments.iter().nth_back(1)?.ident.to_string();
        let name = if name == "Self" { self.own.clone() } else { name };
        self.enums.contains(&name).then_some(name)
    }
}

impl<'ast> Visit<'ast> for Wildcards<'_> {
    fn visit_item_mod(&mut self, item: &'ast ItemMod) {
        if !is_test(&item.attrs) {
            visit::visit_item_mod(self, item);
        }
    }

    fn visit_item_fn(&mut self, item: &'ast ItemFn) {
        if !is_test(&item.attrs) {
            visit::visit_item_fn(self, item);
        }
    }

    fn visit_impl_item_fn(&mut self, item: &'ast ImplItemFn) {
        if !is_test(&item.attrs) {
            visit::visit_impl_item_fn(self, item);
        }
    }

    fn visit_item_impl(&mut self, item: &'ast ItemImpl) {
        if let Type::Path(own) = &*item.self_ty {
            self.own = last(&own.path);
        }
        visit::visit_item_impl(self, item);
    }

    fn visit_expr_match(&mut self, decision: &'ast ExprMatch) {
        let wild = decision.arms.iter().find(|arm| matches!(arm.pat, Pat::Wild(_)));
        let name = decision.arms.iter().find_map(|arm| self.of(&arm.pat));
        if let (Some(wild), Some(name), true) = (wild, name, decision.arms.len() > 2) {
            self.found.push(format!("  line {}: `_ =>` over {name}", wild.span().start().line));
        }
        visit::visit_expr_match(self, decision);
    }
}

fn last(path: &Path) -> String {
    path.segments.last().map(|segment| segment.ident.to_string()).unwrap_or_default()
}

fn wildcards(files: &[(String, String)]) -> Breaches {
    let trees: Vec<_> = files.iter().map(|(path, text)| (path, syn::parse_file(text).unwrap())).collect();
    let mut enums = Enums::default();
    trees.iter().for_each(|(_, tree)| enums.visit_file(tree));
    let mut breaches = Breaches::new();
    for (path, tree) in trees {
        let mut search = Wildcards { enums: &enums.0, own: String::new(), found: Vec::new() };
        search.visit_file(&tree);
        if !search.found.is_empty() {
            breaches.insert(path.clone(), search.found);
        }
    }
    breaches
}

#[test]
fn a_decision_names_every_variant() {
    let production: HashSet<_> = source::ALL.iter().filter(|file| !file.test_file).map(|file| &file.path).collect();
    let mut files = Vec::new();
    source::walk(&source::root().join("src"), "rs", &mut files);
    files.retain(|(path, _)| production.contains(path));
    assert_law_counted("wildcard_arms", wildcards(&files));
}

#[test]
fn a_wildcard_arm_over_an_own_enum_is_seen() {
    let check = |body: &str, expected: usize| {
        let text = format!("enum Own {{ A, B(u8), C }} impl Own {{ fn f(x: Own) -> u8 {{ {body} }} }}");
        let found = wildcards(&[("src/a.rs".to_owned(), text)]);
        assert_eq!(found.get("src/a.rs").map_or(0, Vec::len), expected, "{body}");
    };
    check("match x { Own::A => 1, Own::C => 2, _ => 3 }", 1);
    check("match &x { &Own::A | Own::B(_) => 1, Own::C if true => 2, _ => 3 }", 1);
    check("match x { crate::a::Own::B(1) => 1, Own::B(_) => 2, _ => 3 }", 1);
    check("match x { Self::A => match x { Self::C => 1, Self::A => 2, _ => 3 }, Self::C => 4, _ => 5 }", 2);
    check("match x { Own::A => 1, Own::B(_) | Own::C => 2 }", 0);
    check("match x { Own::A => 1, Own::C => 2, other => other.g() }", 0);
    check("match x { Own::A => 1, _ => 2 }", 0);
    check("match (x, 1) { (Own::A, 1) => 1, (Own::C, 1) => 2, _ => 3 }", 0);
    check("match y { Other::A => 1, Other::C => 2, _ => 3 }", 0);
    let test =
        "enum Own { A, B } #[cfg(test)] mod tests { fn f(x: Own) { match x { Own::A => 1, Own::B => 2, _ => 3 }; } }";
    assert!(wildcards(&[("src/a.rs".to_owned(), test.to_owned())]).is_empty());
}
