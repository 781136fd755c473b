//! Walks a syntax tree and writes down what the laws ask for, with test code marked as such wherever it stands.

use proc_macro2::{Delimiter, TokenStream, TokenTree};
use syn::{
    Attribute, Block, Expr, ImplItem, Item, Lit, Meta, Signature, Token, TraitItem, UseTree,
    punctuated::Punctuated,
    spanned::Spanned,
    visit::{self, Visit},
};

use super::source::{Function, Module, Scopes, Text, module_of};

/// A path as it is written, and the module in which it is.
pub struct RawName {
    pub module: Module,
    pub segments: Vec<String>,
    pub line: usize,
    pub in_test: bool,
}

/// What one file holds.
pub struct Raw {
    pub names: Vec<RawName>,
    pub functions: Vec<Function>,
    pub texts: Vec<Text>,
    /// The file begins with `#![cfg(test)]`.
    pub all_test: bool,
}

/// Reads one file; its imports go into the scopes.
pub fn read(path: &str, text: &str, scopes: &mut Scopes) -> Raw {
    let tree = syn::parse_file(text).unwrap_or_else(|error| panic!("{path}: {error}"));
    let raw = Raw { names: Vec::new(), functions: Vec::new(), texts: Vec::new(), all_test: is_test(&tree.attrs) };
    let mut reader = Reader { path, raw, scopes, module: module_of(path), tests: 0, inside: Vec::new() };
    reader.visit_file(&tree);
    reader.raw
}

struct Reader<'a> {
    path: &'a str,
    raw: Raw,
    scopes: &'a mut Scopes,
    module: Module,
    /// How many test items enclose this place.
    tests: usize,
    /// The functions that enclose this place.
    inside: Vec<usize>,
}

/// `true` if this is compiled only for tests: `#[test]`, `#[cfg(test)]`, `#[cfg(all(test, …))]`.
pub fn is_test(attrs: &[Attribute]) -> bool {
    attrs.iter().any(|attr| {
        let is_cfg = attr.path().is_ident("cfg");
        is_test_function(attr) || is_cfg && attr.parse_args::<Meta>().is_ok_and(|meta| needs_test(&meta))
    })
}

fn needs_test(condition: &Meta) -> bool {
    let Meta::List(list) = condition else { return condition.path().is_ident("test") };
    let inner = list.parse_args_with(Punctuated::<Meta, Token![,]>::parse_terminated).unwrap_or_default();
    if list.path.is_ident("all") {
        inner.iter().any(needs_test)
    } else {
        list.path.is_ident("any") && !inner.is_empty() && inner.iter().all(needs_test)
    }
}

fn is_test_function(attr: &Attribute) -> bool {
    attr.path().segments.last().is_some_and(|last| last.ident == "test")
}

/// Names of macros, functions and methods that fail a test visibly. A wait fails at its deadline.
fn asserts(name: &str) -> bool {
    let starts = ["assert", "debug_assert", "prop_assert", "check", "expect_", "refuse", "until", "wait_for"];
    starts.iter().any(|start| name.starts_with(start))
        || ["panic", "unreachable", "unwrap_err", "proptest"].contains(&name)
}

/// The attributes of the variants of an enum that have some.
macro_rules! attrs {
    ($value:expr, $kind:ident: $($variant:ident)*) => {
        match $value { $($kind::$variant(inner) => &inner.attrs,)* _ => return false }
    };
}

fn is_test_item(item: &Item) -> bool {
    is_test(attrs!(item, Item: Const Enum ExternCrate Fn ForeignMod Impl Macro Mod Static Struct Trait Type Union Use))
}

fn is_test_impl_item(item: &ImplItem) -> bool {
    is_test(attrs!(item, ImplItem: Const Fn Type Macro))
}

fn is_test_trait_item(item: &TraitItem) -> bool {
    is_test(attrs!(item, TraitItem: Const Fn Type Macro))
}

fn is_test_expr(expr: &Expr) -> bool {
    is_test(
        attrs!(expr, Expr: Assign Block Call Closure ForLoop If Loop Macro Match MethodCall Path Struct Tuple Unsafe While),
    )
}

impl Reader<'_> {
    fn within(&mut self, test: bool, visit: impl FnOnce(&mut Self)) {
        self.tests += usize::from(test);
        visit(self);
        self.tests -= usize::from(test);
    }

    fn name(&mut self, segments: Vec<String>, line: usize) {
        let (module, in_test) = (self.module.clone(), self.tests > 0);
        self.raw.names.push(RawName { module, segments, line, in_test });
    }

    fn text(&mut self, text: String, line: usize) {
        self.raw.texts.push(Text { text, line, in_test: self.tests > 0 });
    }

    fn asserted(&mut self, name: &str) {
        if asserts(name) {
            self.inside.iter().for_each(|&at| self.raw.functions[at].asserts = true);
        }
    }

    fn import(&mut self, tree: &UseTree, before: &[String]) {
        let with = |name: &syn::Ident| {
            let own = (name != "self" || before.is_empty()).then(|| name.to_string());
            before.iter().cloned().chain(own).collect::<Vec<_>>()
        };
        let line = tree.span().start().line;
        match tree {
            UseTree::Path(path) => self.import(&path.tree, &with(&path.ident)),
            UseTree::Group(group) => group.items.iter().for_each(|tree| self.import(tree, before)),
            UseTree::Glob(_) => {
                self.scopes.import_all(&self.module, before.to_vec());
                self.name([before, &["*".to_owned()]].concat(), line);
            }
            UseTree::Name(name) => self.import_as(with(&name.ident), None, line),
            UseTree::Rename(rename) => self.import_as(with(&rename.ident), Some(rename.rename.to_string()), line),
        }
    }

    fn import_as(&mut self, path: Vec<String>, name: Option<String>, line: usize) {
        let name = name.unwrap_or_else(|| path.last().expect("a path has a name").clone());
        self.name(path.clone(), line);
        self.scopes.import(&self.module, name, path);
    }

    fn function(
        &mut self,
        attrs: &[Attribute],
        signature: &Signature,
        block: Option<&Block>,
        visit: impl FnOnce(&mut Self),
    ) {
        let line = signature.span().start().line;
        let end = block.map_or(line, |block| block.span().end().line);
        let (is_test, in_test) = (attrs.iter().any(is_test_function), self.tests > 0);
        self.inside.push(self.raw.functions.len());
        let name = signature.ident.to_string();
        self.raw.functions.push(Function { name, line, lines: end - line + 1, in_test, is_test, asserts: false });
        visit(self);
        self.inside.pop();
    }

    /// Tokens have no syntax tree: every `a::b` in them is a path, every literal a text.
    fn tokens(&mut self, tokens: TokenStream) {
        let mut path: Vec<String> = Vec::new();
        let mut colons = 0;
        let mut line = 0;
        let mut previous = String::new();
        let mut tokens = tokens.into_iter().peekable();
        while let Some(token) = tokens.next() {
            match token {
                TokenTree::Punct(punct) if punct.as_char() == ':' => colons += 1,
                TokenTree::Ident(ident) => {
                    if colons != 2 {
                        self.token_path(std::mem::take(&mut path), line);
                    }
                    (colons, line) = (0, ident.span().start().line);
                    let word = ident.to_string();
                    let called = matches!(tokens.peek(), Some(TokenTree::Group(_)))
                        || matches!(tokens.peek(), Some(TokenTree::Punct(next)) if next.as_char() == '!');
                    if called {
                        self.asserted(&word);
                    }
                    if previous == "fn" {
                        self.token_function(&word, line);
                    }
                    path.push(word.clone());
                    previous = word;
                    continue;
                }
                TokenTree::Group(group) => {
                    // `use a::{b, c}` inside a macro: each of them begins with what stands before the brace.
                    let base =
                        if colons == 2 && group.delimiter() == Delimiter::Brace { path.clone() } else { Vec::new() };
                    for name in first_words(group.stream()).into_iter().filter(|_| !base.is_empty()) {
                        self.token_path([base.clone(), vec![name]].concat(), line);
                    }
                    self.tokens(group.stream());
                    colons = 0;
                }
                TokenTree::Literal(literal) => {
                    self.literal(&Lit::new(literal));
                    colons = 0;
                }
                TokenTree::Punct(_) => colons = 0,
            }
            if colons == 0 {
                self.token_path(std::mem::take(&mut path), line);
            }
            previous.clear();
        }
        self.token_path(path, line);
    }

    fn token_path(&mut self, path: Vec<String>, line: usize) {
        if path.len() > 1 {
            self.name(path, line);
        }
    }

    /// A function inside `proptest!` is a test; the macro itself asserts.
    fn token_function(&mut self, name: &str, line: usize) {
        let in_test = self.tests > 0;
        let name = name.to_owned();
        self.raw.functions.push(Function { name, line, lines: 1, in_test, is_test: in_test, asserts: true });
    }

    fn literal(&mut self, literal: &Lit) {
        match literal {
            Lit::Str(text) => self.text(text.value(), text.span().start().line),
            Lit::ByteStr(bytes) => {
                self.text(String::from_utf8_lossy(&bytes.value()).into_owned(), bytes.span().start().line);
            }
            _ => {}
        }
    }
}

/// The first word of every part between commas.
fn first_words(tokens: TokenStream) -> Vec<String> {
    let mut words = Vec::new();
    let mut first = true;
    for token in tokens {
        match token {
            TokenTree::Ident(ident) if first => words.push(ident.to_string()),
            TokenTree::Punct(punct) if punct.as_char() == ',' => {
                first = true;
                continue;
            }
            _ => {}
        }
        first = false;
    }
    words
}

impl<'ast> Visit<'ast> for Reader<'_> {
    fn visit_item(&mut self, item: &'ast Item) {
        self.within(is_test_item(item), |reader| visit::visit_item(reader, item));
    }

    fn visit_impl_item(&mut self, item: &'ast ImplItem) {
        self.within(is_test_impl_item(item), |reader| visit::visit_impl_item(reader, item));
    }

    fn visit_trait_item(&mut self, item: &'ast TraitItem) {
        self.within(is_test_trait_item(item), |reader| visit::visit_trait_item(reader, item));
    }

    fn visit_field(&mut self, field: &'ast syn::Field) {
        self.within(is_test(&field.attrs), |reader| visit::visit_field(reader, field));
    }

    fn visit_variant(&mut self, variant: &'ast syn::Variant) {
        self.within(is_test(&variant.attrs), |reader| visit::visit_variant(reader, variant));
    }

    fn visit_arm(&mut self, arm: &'ast syn::Arm) {
        self.within(is_test(&arm.attrs), |reader| visit::visit_arm(reader, arm));
    }

    fn visit_field_value(&mut self, value: &'ast syn::FieldValue) {
        self.within(is_test(&value.attrs), |reader| visit::visit_field_value(reader, value));
    }

    fn visit_local(&mut self, local: &'ast syn::Local) {
        self.within(is_test(&local.attrs), |reader| visit::visit_local(reader, local));
    }

    fn visit_stmt_macro(&mut self, statement: &'ast syn::StmtMacro) {
        self.within(is_test(&statement.attrs), |reader| visit::visit_stmt_macro(reader, statement));
    }

    fn visit_expr(&mut self, expr: &'ast Expr) {
        self.within(is_test_expr(expr), |reader| visit::visit_expr(reader, expr));
    }

    fn visit_item_mod(&mut self, item: &'ast syn::ItemMod) {
        let name = item.ident.to_string();
        self.scopes.declare(&self.module, name.clone());
        self.module.push(name);
        if self.tests > 0 && item.content.is_none() {
            let folder = self.path.rsplit_once('/').map_or("", |(folder, _)| folder);
            let named = item.attrs.iter().find(|attr| attr.path().is_ident("path"));
            let file = named.and_then(|attr| match &attr.meta {
                Meta::NameValue(pair) => Some(&pair.value),
                _ => None,
            });
            let file = file.and_then(|value| match value {
                Expr::Lit(literal) => Some(&literal.lit),
                _ => None,
            });
            let file = file.and_then(|literal| match literal {
                Lit::Str(text) => Some(format!("{folder}/{}", text.value())),
                _ => None,
            });
            self.scopes.declare_test(self.module.clone(), file);
        }
        visit::visit_item_mod(self, item);
        self.module.pop();
    }

    fn visit_item_use(&mut self, item: &'ast syn::ItemUse) {
        self.import(&item.tree, &[]);
    }

    fn visit_item_extern_crate(&mut self, item: &'ast syn::ItemExternCrate) {
        let name = item.rename.as_ref().map(|(_, name)| name.to_string());
        self.import_as(vec![item.ident.to_string()], name, item.span().start().line);
    }

    fn visit_item_fn(&mut self, item: &'ast syn::ItemFn) {
        self.function(&item.attrs, &item.sig, Some(&item.block), |reader| visit::visit_item_fn(reader, item));
    }

    fn visit_impl_item_fn(&mut self, item: &'ast syn::ImplItemFn) {
        self.function(&item.attrs, &item.sig, Some(&item.block), |reader| visit::visit_impl_item_fn(reader, item));
    }

    fn visit_trait_item_fn(&mut self, item: &'ast syn::TraitItemFn) {
        let block = item.default.as_ref();
        self.function(&item.attrs, &item.sig, block, |reader| visit::visit_trait_item_fn(reader, item));
    }

    fn visit_path(&mut self, path: &'ast syn::Path) {
        let segments: Vec<_> = path.segments.iter().map(|segment| segment.ident.to_string()).collect();
        self.name(segments, path.span().start().line);
        visit::visit_path(self, path);
    }

    fn visit_expr_call(&mut self, call: &'ast syn::ExprCall) {
        if let Expr::Path(path) = &*call.func
            && let Some(last) = path.path.segments.last()
        {
            self.asserted(&last.ident.to_string());
        }
        visit::visit_expr_call(self, call);
    }

    fn visit_expr_method_call(&mut self, call: &'ast syn::ExprMethodCall) {
        let name = call.method.to_string();
        self.asserted(&name);
        // A method has no path; those that read the disk or the clock are known by name.
        self.name(vec!["method".to_owned(), name], call.method.span().start().line);
        visit::visit_expr_method_call(self, call);
    }

    fn visit_macro(&mut self, called: &'ast syn::Macro) {
        let name = called.path.segments.last().map(|last| last.ident.to_string()).unwrap_or_default();
        self.asserted(&name);
        self.name(vec!["macro".to_owned(), name], called.path.span().start().line);
        self.visit_path(&called.path);
        self.tokens(called.tokens.clone());
    }

    fn visit_attribute(&mut self, attr: &'ast Attribute) {
        let silent = ["doc", "cfg", "path", "allow", "expect", "warn", "deny", "cfg_attr"];
        if let Meta::List(list) = &attr.meta
            && !silent.iter().any(|name| attr.path().is_ident(name))
        {
            self.tokens(list.tokens.clone());
        }
    }

    fn visit_lit(&mut self, literal: &'ast Lit) {
        self.literal(literal);
    }
}
