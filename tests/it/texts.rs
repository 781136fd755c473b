//! The catalogue of texts: it has each text that the program shows, and no other.

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::{Path, PathBuf},
};

use syn::{
    Attribute, ExprStruct, ImplItemFn, ItemFn, ItemMod, LitStr, Macro,
    parse::Parser,
    visit::{self, Visit},
};

type Texts = BTreeMap<String, BTreeSet<String>>;

/// Texts of one file: of `t!`, of functions that label a state, and of rows of tables.
#[derive(Default)]
struct Found {
    texts: BTreeSet<String>,
    in_label: bool,
    /// The keywords of `profile` are only read from files.
    in_profile: bool,
}

fn is_test(attributes: &[Attribute]) -> bool {
    attributes.iter().any(|attribute| {
        attribute.path().is_ident("cfg") && attribute.parse_args::<syn::Ident>().is_ok_and(|name| name == "test")
    })
}

impl Found {
    fn add(&mut self, text: String) {
        if text.chars().any(char::is_alphabetic) {
            self.texts.insert(text);
        }
    }
    /// A label of a state is a `&'static str` that is translated where it is drawn.
    fn within(&mut self, signature: &syn::Signature, visit: impl FnOnce(&mut Self)) {
        let is_label =
            ["label", "word", "words", "message", "advice", "mode"].iter().any(|name| signature.ident == name);
        let is_text = matches!(&signature.output, syn::ReturnType::Type(_, of)
            if matches!(&**of, syn::Type::Reference(text) if text.lifetime.as_ref().is_some_and(|of| of.ident == "static")));
        let before = std::mem::replace(&mut self.in_label, is_label && is_text);
        visit(self);
        self.in_label = before;
    }
}

impl<'a> Visit<'a> for Found {
    fn visit_item_mod(&mut self, module: &'a ItemMod) {
        if !is_test(&module.attrs) {
            visit::visit_item_mod(self, module);
        }
    }
    fn visit_item_fn(&mut self, function: &'a ItemFn) {
        self.within(&function.sig, |found| visit::visit_item_fn(found, function));
    }
    fn visit_impl_item_fn(&mut self, function: &'a ImplItemFn) {
        self.within(&function.sig, |found| visit::visit_impl_item_fn(found, function));
    }
    fn visit_attribute(&mut self, attribute: &'a Attribute) {
        if attribute.path().is_ident("error")
            && let syn::Meta::List(list) = &attribute.meta
        {
            texts_of_calls(list.tokens.clone()).into_iter().for_each(|text| self.add(text));
        }
    }
    fn visit_item_macro(&mut self, item: &'a syn::ItemMacro) {
        if item.ident.as_ref().is_some_and(|name| name == "motions") {
            literals(item.mac.tokens.clone()).into_iter().for_each(|text| self.add(text));
        }
        if item.mac.path.is_ident("keyword_enum") && !self.in_profile {
            words_of_variants(item.mac.tokens.clone()).into_iter().for_each(|text| self.add(text));
        }
        visit::visit_item_macro(self, item);
    }
    fn visit_lit_str(&mut self, text: &'a LitStr) {
        if self.in_label {
            self.add(text.value());
        }
    }
    fn visit_expr_struct(&mut self, row: &'a ExprStruct) {
        let of_keys = row.path.segments.last().is_some_and(|name| name.ident == "Key");
        for field in row.fields.iter().filter(|_| of_keys) {
            if let (syn::Member::Named(name), syn::Expr::Lit(literal)) = (&field.member, &field.expr)
                && (["label", "word", "words", "message", "advice", "mode"].iter().any(|label| name == label))
                && let syn::Lit::Str(text) = &literal.lit
            {
                self.add(text.value());
            }
        }
        visit::visit_expr_struct(self, row);
    }
    fn visit_expr_call(&mut self, call: &'a syn::ExprCall) {
        // Rows of the tables of keys and of alarm metrics.
        let name = match &*call.func {
            syn::Expr::Path(path) => path.path.segments.iter().map(|part| part.ident.to_string()).collect(),
            _ => Vec::new(),
        };
        if [vec!["row"], vec!["goal"], vec!["Key", "new"]].iter().any(|row| *row == name) {
            for argument in &call.args {
                if let syn::Expr::Lit(literal) = argument
                    && let syn::Lit::Str(text) = &literal.lit
                {
                    self.add(text.value());
                }
            }
        }
        visit::visit_expr_call(self, call);
    }
    fn visit_macro(&mut self, found: &'a Macro) {
        let tokens = found.tokens.clone();
        if found.path.is_ident("t") {
            let first = |input: syn::parse::ParseStream| {
                let text: LitStr = input.parse()?;
                let _rest: proc_macro2::TokenStream = input.parse()?;
                Ok(text)
            };
            if let Ok(text) = first.parse2(tokens.clone()) {
                self.add(text.value());
            }
        }
        if found.path.is_ident("tabs") || found.path.is_ident("motions") {
            literals(tokens.clone()).into_iter().for_each(|text| self.add(text));
        }
        // Arguments of any macro may hold texts too.
        let arguments = syn::punctuated::Punctuated::<syn::Expr, syn::Token![,]>::parse_terminated;
        if let Ok(arguments) = arguments.parse2(tokens) {
            let within = self.in_label;
            self.in_label &= !found.path.is_ident("t");
            arguments.iter().for_each(|argument| self.visit_expr(argument));
            self.in_label = within;
        }
    }
}

/// The texts of `t!(…)` among the tokens of an attribute, which are no expressions: `t!("read back {value}", value = .0)`.
fn texts_of_calls(tokens: proc_macro2::TokenStream) -> Vec<String> {
    use proc_macro2::TokenTree::{Group, Ident};
    let tokens: Vec<_> = tokens.into_iter().collect();
    let text = |three: &[proc_macro2::TokenTree]| match three {
        [Ident(name), _, Group(call)] if name == "t" => literals(call.stream()).into_iter().next(),
        _ => None,
    };
    tokens.windows(3).filter_map(text).collect()
}

/// The strings among the tokens of a table.
fn literals(tokens: proc_macro2::TokenStream) -> Vec<String> {
    let texts = |token| match token {
        proc_macro2::TokenTree::Group(group) => literals(group.stream()),
        proc_macro2::TokenTree::Literal(literal) => {
            syn::parse_str::<LitStr>(&literal.to_string()).map(|text| text.value()).into_iter().collect()
        }
        _ => Vec::new(),
    };
    tokens.into_iter().flat_map(texts).collect()
}

/// The words after the arrows of an enum with keywords, not its docs.
fn words_of_variants(tokens: proc_macro2::TokenStream) -> Vec<String> {
    let (mut words, mut after_arrow) = (Vec::new(), false);
    for token in tokens {
        match &token {
            proc_macro2::TokenTree::Group(group) => words.append(&mut words_of_variants(group.stream())),
            proc_macro2::TokenTree::Literal(_) if after_arrow => words.append(&mut literals(token.clone().into())),
            _ => {}
        }
        after_arrow = matches!(&token, proc_macro2::TokenTree::Punct(punct) if punct.as_char() == '>');
    }
    words
}

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for path in fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        if name == "tests" || name == "tests.rs" || name.starts_with("fixture") {
            continue;
        }
        if path.is_dir() {
            sources(&path, found);
        } else if name.ends_with(".rs") {
            found.push(path);
        }
    }
}

/// The texts of the program by the file that they stand in.
fn texts() -> Texts {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    sources(&root, &mut files);
    files.sort();
    let (mut all, mut known) = (Texts::new(), BTreeSet::new());
    for path in files {
        let in_profile = path.starts_with(root.join("profile"));
        let mut found = Found { in_profile, ..Found::default() };
        found.visit_file(&syn::parse_file(&fs::read_to_string(&path).unwrap()).unwrap());
        let new: BTreeSet<String> = found.texts.into_iter().filter(|text| known.insert(text.clone())).collect();
        let name = path.strip_prefix(&root).unwrap().with_extension("").display().to_string();
        if !new.is_empty() {
            all.insert(name, new);
        }
    }
    all
}

#[test]
fn the_catalogue_has_every_text_and_no_other() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/text/en.toml");
    let mut document = String::from(
        "# Every text of the screens, by the file that it stands in. A language is a copy of this file with other values.\n\
         # Made from the code: SIGHTGLASS_WRITE=1 cargo test --release --test it the_catalogue_has_every_text\n",
    );
    for (file, texts) in texts() {
        let table: toml::Table = texts.into_iter().map(|text| (text.clone(), toml::Value::String(text))).collect();
        document += &format!("\n[{file:?}]\n{}", toml::to_string(&table).unwrap());
    }
    if std::env::var_os("SIGHTGLASS_WRITE").is_some() {
        fs::write(&path, &document).unwrap();
    }
    let written = fs::read_to_string(&path).unwrap_or_default();
    let lines = |text: &str| text.lines().map(str::to_owned).collect::<BTreeSet<_>>();
    let missing: Vec<_> = lines(&document).difference(&lines(&written)).cloned().collect();
    let unused: Vec<_> = lines(&written).difference(&lines(&document)).cloned().collect();
    assert!(written == document, "en.toml is not what the code shows; missing: {missing:#?}, unused: {unused:#?}");
}
