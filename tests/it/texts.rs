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

pub type Texts = BTreeMap<String, BTreeSet<String>>;

/// Functions and fields whose texts are translated where they are drawn.
const LABELS: [&str; 8] = ["label", "word", "words", "message", "advice", "mode", "effect", "guidance"];

/// Texts of one file: of `t!`, of functions that label a state, and of rows of tables.
#[derive(Default)]
struct Found {
    texts: BTreeSet<String>,
    in_label: bool,
    in_guidance: bool,
    /// The keywords of `profile` are only read from files.
    in_profile: bool,
}

pub fn is_test(attributes: &[Attribute]) -> bool {
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
        let is_label = LABELS.iter().any(|name| signature.ident == name);
        let is_static = |of: &syn::Type| matches!(of, syn::Type::Reference(text) if text.lifetime.as_ref().is_some_and(|of| of.ident == "static"));
        let is_text = match &signature.output {
            syn::ReturnType::Type(_, of) => match &**of {
                syn::Type::Array(texts) => signature.ident == "guidance" && is_static(&texts.elem),
                of => is_static(of),
            },
            syn::ReturnType::Default => false,
        };
        self.in_guidance = is_label && signature.ident == "guidance";
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
        match (self.in_label, self.in_guidance) {
            // Steps of an action are shown one by one.
            (true, true) => text.value().split("; ").for_each(|step| self.add(step.to_owned())),
            (true, false) => self.add(text.value()),
            (false, _) => {}
        }
    }
    fn visit_expr_struct(&mut self, row: &'a ExprStruct) {
        let of_keys = row.path.segments.last().is_some_and(|name| name.ident == "Key");
        for field in row.fields.iter().filter(|_| of_keys) {
            if let (syn::Member::Named(name), syn::Expr::Lit(literal)) = (&field.member, &field.expr)
                && LABELS.iter().any(|label| name == label)
                && let syn::Lit::Str(text) = &literal.lit
            {
                self.add(text.value());
            }
        }
        visit::visit_expr_struct(self, row);
    }
    fn visit_expr_call(&mut self, call: &'a syn::ExprCall) {
        // Rows of the tables of keys, of alarm metrics and of the layout of frames; headings of columns.
        let name = match &*call.func {
            syn::Expr::Path(path) => path.path.segments.iter().map(|part| part.ident.to_string()).collect(),
            _ => Vec::new(),
        };
        let rows = ["row", "echo", "goal", "rows words", "rows number", "fact", "Address", "count", "Byte", "Word"];
        if rows.contains(&name.join(" ").as_str())
            || name.first().is_some_and(|name| ["Column", "Key", "GlobalKey"].contains(&name.as_str()))
        {
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
pub fn literals(tokens: proc_macro2::TokenStream) -> Vec<String> {
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

pub fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
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
pub fn texts() -> Texts {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    sources(&root, &mut files);
    files.sort();
    let (mut all, mut known) = (Texts::new(), BTreeSet::new());
    for path in files {
        let in_profile = path.starts_with(root.join("profile"));
        let mut found = Found { in_profile, ..Found::default() };
        found.visit_file(&syn::parse_file(&fs::read_to_string(&path).unwrap()).unwrap());
        if path.ends_with("controllers/guide.rs") {
            let guide = fs::read_to_string(path.with_extension("txt")).unwrap();
            guide.lines().for_each(|line| found.add(line.trim_start_matches("# ").to_owned()));
        }
        let new: BTreeSet<String> = found.texts.into_iter().filter(|text| known.insert(text.clone())).collect();
        let name = path.strip_prefix(&root).unwrap().with_extension("").display().to_string();
        if !new.is_empty() {
            all.insert(name, new);
        }
    }
    all
}

/// A file of `src/text`.
fn catalogue_file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("src/text").join(name)
}

/// The catalogue of a language in the order of the code, with the translations that there are.
fn document(heading: &str, translated: impl Fn(&str) -> Option<String>) -> String {
    let mut document = heading.to_owned();
    for (file, texts) in texts() {
        let known = texts.into_iter().filter_map(|text| Some((translated(&text)?, text)));
        let table: toml::Table = known.map(|(value, text)| (text, toml::Value::String(value))).collect();
        if !table.is_empty() {
            document += &format!("\n[{file:?}]\n{}", toml::to_string(&table).unwrap());
        }
    }
    document
}

#[test]
fn the_catalogue_has_every_text_and_no_other() {
    let path = catalogue_file("en.toml");
    let heading = "# Every text of the screens, by the file that it stands in. A language is a copy of this file with other values.\n\
         # Made from the code: SIGHTGLASS_WRITE=1 cargo test --release --test it texts::\n";
    let document = document(heading, |text| Some(text.to_owned()));
    if std::env::var_os("SIGHTGLASS_WRITE").is_some() {
        fs::write(&path, &document).unwrap();
    }
    let written = fs::read_to_string(&path).unwrap_or_default();
    let lines = |text: &str| text.lines().map(str::to_owned).collect::<BTreeSet<_>>();
    let missing: Vec<_> = lines(&document).difference(&lines(&written)).cloned().collect();
    let unused: Vec<_> = lines(&written).difference(&lines(&document)).cloned().collect();
    assert!(written == document, "en.toml is not what the code shows; missing: {missing:#?}, unused: {unused:#?}");
}

/// A catalogue as texts and translations.
fn translations(written: &str) -> BTreeMap<String, String> {
    let files: BTreeMap<String, BTreeMap<String, String>> = toml::from_str(written).unwrap();
    files.into_values().flatten().collect()
}

/// `SIGHTGLASS_WRITE=1` sorts a catalogue as the code does and takes out what is not used any more; what is missing is
/// for a translator.
#[test]
fn every_language_has_every_text() {
    for entry in fs::read_dir(catalogue_file("")).unwrap().map(Result::unwrap) {
        let name = entry.file_name().into_string().unwrap();
        if !name.ends_with(".toml") || name == "en.toml" {
            continue;
        }
        let written = fs::read_to_string(entry.path()).unwrap();
        let translated = translations(&written);
        let heading =
            written.lines().take_while(|line| line.starts_with('#')).fold(String::new(), |all, line| all + line + "\n");
        let document = document(&heading, |text| translated.get(text).cloned());
        if std::env::var_os("SIGHTGLASS_WRITE").is_some() {
            fs::write(entry.path(), &document).unwrap();
        }
        let used: BTreeSet<String> = texts().into_values().flatten().collect();
        let missing: Vec<_> = used.iter().filter(|text| !translated.contains_key(*text)).collect();
        assert!(missing.is_empty(), "{name} lacks {} texts: {missing:#?}", missing.len());
        let written = fs::read_to_string(entry.path()).unwrap();
        assert!(written == document, "{name} has unused texts or another order: SIGHTGLASS_WRITE=1 rewrites it");
        let wrong: Vec<_> = translated.iter().flat_map(|(text, value)| faults(text, value)).collect();
        assert!(wrong.is_empty(), "{name}:\n{}", wrong.join("\n"));
    }
}

/// What is wrong with a translation.
fn faults(text: &str, value: &str) -> Vec<String> {
    let placeholders = |text: &str| {
        let mut names: Vec<_> =
            text.split('{').skip(1).filter_map(|part| Some(part.split_once('}')?.0.to_owned())).collect();
        names.sort();
        names
    };
    let spaces = |text: &str| (text.starts_with(' '), text.ends_with(' '));
    // Of two neighbours, the first of one kind and the second of another.
    let follow = |first: &dyn Fn(char) -> bool, second: &dyn Fn(char) -> bool| {
        value.chars().zip(value.chars().skip(1)).any(|(a, b)| first(a) && second(b))
    };
    let is_tone = |c| ('\u{e48}'..='\u{e4b}').contains(&c);
    let is_vowel_mark = |c| c == '\u{e31}' || ('\u{e34}'..='\u{e3a}').contains(&c);
    let is_mark = |c| is_vowel_mark(c) || ('\u{e47}'..='\u{e4e}').contains(&c);
    let is_consonant = |c| ('\u{e01}'..='\u{e2e}').contains(&c);
    let rules = [
        (value.is_empty(), "is empty"),
        (placeholders(text) != placeholders(value), "has other placeholders"),
        (spaces(text) != spaces(value), "begins or ends with another space"),
        (value.chars().any(|c| ('\u{e50}'..='\u{e59}').contains(&c)), "has Thai digits"),
        (value.contains("\u{e4d}\u{e32}"), "has SARA AM as two characters"),
        (value.contains("\u{e40}\u{e40}"), "has two SARA E in place of SARA AE"),
        (follow(&is_tone, &is_vowel_mark), "has a tone mark before a vowel mark"),
        (follow(&|c| !is_consonant(c) && !is_mark(c), &is_mark), "has a mark without a consonant"),
        (value.starts_with('\u{200b}') || value.ends_with('\u{200b}'), "begins or ends with a break point"),
        (value.contains('¦'), "has a break point that is not U+200B"),
    ];
    let is_wrong = |(wrong, what): (bool, &str)| wrong.then(|| format!("{text:?} = {value:?} {what}"));
    rules.into_iter().filter_map(is_wrong).collect()
}

#[test]
fn the_rules_of_a_translation_find_its_faults() {
    let check = |text: &str, value: &str, expect: &str| {
        let found = faults(text, value).join(", ");
        assert!(found.ends_with(expect) && found.is_empty() == expect.is_empty(), "{value:?}: {found:?}");
    };
    check("water", "น้ำ", "");
    check("in {n} s", "ใน {n} วินาที", "");
    check("in {n} s", "ใน วินาที", "other placeholders");
    check("water", " น้ำ", "another space");
    check("3", "๓", "Thai digits");
    check("do", "ท\u{e4d}\u{e32}", "as two characters");
    check("show", "\u{e40}\u{e40}สดง", "in place of SARA AE");
    check("that", "ท\u{e48}\u{e35}", "before a vowel mark");
    check("water", "น\u{e33}\u{e49}", "without a consonant");
    check("water", "เ\u{e49}น", "without a consonant");
    check("line", "สาย\u{200b}", "a break point");
}
