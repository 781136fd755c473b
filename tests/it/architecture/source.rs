//! What the laws need to know of a file: the paths it names, its functions and its texts, read from its syntax tree.

use std::{
    collections::{HashMap, HashSet},
    fs,
    path::Path,
    sync::LazyLock,
};

use super::reader;

/// Everything that the laws ask about one file.
pub struct Facts {
    /// From the root of the repository: `src/plant/mod.rs`.
    pub path: String,
    pub lines: usize,
    pub has_header: bool,
    /// The file holds only tests: it stands below `tests/`, or behind `#[cfg(test)] mod`.
    pub test_file: bool,
    pub names: Vec<Name>,
    pub functions: Vec<Function>,
    pub texts: Vec<Text>,
}

/// A path that the code names, with imports, renames and re-exports followed to where they come from.
pub struct Name {
    /// `crate::plant::Plant` or `std::fs::read`.
    pub path: String,
    pub line: usize,
    pub in_test: bool,
}

pub struct Function {
    pub name: String,
    pub line: usize,
    /// From `fn` to the closing brace.
    pub lines: usize,
    pub in_test: bool,
    /// It carries `#[test]` or `#[tokio::test]`.
    pub is_test: bool,
    pub asserts: bool,
}

/// A string literal.
pub struct Text {
    pub text: String,
    pub line: usize,
    pub in_test: bool,
}

impl Facts {
    /// `plant` for `src/plant/mod.rs` and `src/plant.rs`.
    pub fn top_module(&self) -> &str {
        let path = self.path.strip_prefix("src/").unwrap_or("");
        path.split('/').next().unwrap_or("").trim_end_matches(".rs")
    }

    /// Paths that production code names.
    pub fn production_names(&self) -> impl Iterator<Item = &Name> {
        self.names.iter().filter(|name| !self.test_file && !name.in_test)
    }

    /// Paths that tests name.
    pub fn test_names(&self) -> impl Iterator<Item = &Name> {
        self.names.iter().filter(|name| self.test_file || name.in_test)
    }
}

/// All Rust files of the repository, read once.
pub static ALL: LazyLock<Vec<Facts>> = LazyLock::new(|| {
    let mut files = Vec::new();
    for folder in ["src", "tests"] {
        walk(&root().join(folder), "rs", &mut files);
    }
    assert!(files.len() > 300, "the sources were found");
    facts(&files)
});

/// The root of the repository.
pub fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Adds `(path from the root, text)` of every file below the folder whose name has this ending.
pub fn walk(folder: &Path, ending: &str, found: &mut Vec<(String, String)>) {
    let mut entries: Vec<_> = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    entries.sort();
    for entry in entries {
        if entry.is_dir() {
            walk(&entry, ending, found);
        } else if entry.extension().is_some_and(|own| own == ending) {
            let path = entry.strip_prefix(root()).unwrap().to_str().unwrap().to_owned();
            found.push((path, fs::read_to_string(&entry).unwrap()));
        }
    }
}

/// The facts of one snippet: for the tests of the laws themselves.
pub fn snippet(path: &str, text: &str) -> Vec<Facts> {
    facts(&[(path.to_owned(), text.to_owned())])
}

/// Reads `(path, text)` of every file together, since a re-export in one can hide what another names.
pub fn facts(files: &[(String, String)]) -> Vec<Facts> {
    let mut scopes = Scopes::default();
    let raw: Vec<_> = files.iter().map(|(path, text)| reader::read(path, text, &mut scopes)).collect();
    let resolve = |raw: reader::RawName| Name {
        path: scopes.resolve(&raw.module, &raw.segments).join("::"),
        line: raw.line,
        in_test: raw.in_test,
    };
    let mut all = Vec::new();
    for ((path, text), raw) in files.iter().zip(raw) {
        all.push(Facts {
            test_file: !path.starts_with("src/") || raw.all_test || scopes.is_test_file(path),
            lines: text.lines().count(),
            has_header: text.starts_with("//! "),
            names: raw.names.into_iter().map(resolve).collect(),
            functions: raw.functions,
            texts: raw.texts,
            path: path.clone(),
        });
    }
    all
}

/// A module's path from the root of the crate: `["plant", "alarm"]`.
pub type Module = Vec<String>;

/// What each module imports and declares, and which modules are only tests.
#[derive(Default)]
pub struct Scopes {
    modules: HashMap<Module, Scope>,
    test_modules: HashSet<Module>,
    /// `#[path = "…"]` of such modules.
    test_files: HashSet<String>,
}

#[derive(Default)]
struct Scope {
    imports: HashMap<String, Vec<String>>,
    globs: Vec<Vec<String>>,
    children: HashSet<String>,
}

impl Scopes {
    pub fn import(&mut self, module: &Module, name: String, path: Vec<String>) {
        self.modules.entry(module.clone()).or_default().imports.insert(name, path);
    }

    pub fn import_all(&mut self, module: &Module, path: Vec<String>) {
        self.modules.entry(module.clone()).or_default().globs.push(path);
    }

    pub fn declare(&mut self, module: &Module, child: String) {
        self.modules.entry(module.clone()).or_default().children.insert(child);
    }

    pub fn declare_test(&mut self, module: Module, file: Option<String>) {
        self.test_modules.insert(module);
        self.test_files.extend(file);
    }

    fn is_test_file(&self, path: &str) -> bool {
        let module = module_of(path);
        self.test_files.contains(path) || (1..=module.len()).any(|end| self.test_modules.contains(&module[..end]))
    }

    /// The full path behind what a module calls so.
    fn resolve(&self, module: &Module, segments: &[String]) -> Vec<String> {
        let mut path = self.first(module, segments, 0);
        // An import on the way leads somewhere else: `crate::bus::File` may be `std::fs::File`.
        for _ in 0..8 {
            let Some(further) = self.follow(&path) else { break };
            path = further;
        }
        path
    }

    /// The path with its first segment made absolute: `crate`, or the name of another crate.
    fn first(&self, module: &Module, segments: &[String], depth: usize) -> Vec<String> {
        let own = |up: usize| {
            let mut path = vec!["crate".to_owned()];
            path.extend(module[..module.len().saturating_sub(up)].iter().cloned());
            path
        };
        let up = segments.iter().take_while(|segment| *segment == "super").count();
        let (mut path, rest) = match segments[0].as_str() {
            "sightglass" | "crate" => (vec!["crate".to_owned()], 1),
            "self" => {
                let up = segments[1..].iter().take_while(|segment| *segment == "super").count();
                (own(up), up + 1)
            }
            "super" => (own(up), up),
            name => match self.lookup(module, name, depth) {
                Some(path) => (path, 1),
                None => (Vec::new(), 0),
            },
        };
        path.extend(segments[rest..].iter().cloned());
        path
    }

    /// What a name means in a module, if the module imports or declares it.
    fn lookup(&self, module: &Module, name: &str, depth: usize) -> Option<Vec<String>> {
        let scope = self.modules.get(module)?;
        if depth > 8 {
            return None;
        }
        if let Some(path) = scope.imports.get(name) {
            return Some(if path[0] == name { path.clone() } else { self.first(module, path, depth + 1) });
        }
        if scope.children.contains(name) {
            let mut path = vec!["crate".to_owned()];
            path.extend(module.iter().cloned());
            path.push(name.to_owned());
            return Some(path);
        }
        scope.globs.iter().find_map(|glob| {
            let from = self.first(module, glob, depth + 1);
            (from.first()? == "crate").then(|| self.lookup(&from[1..].to_vec(), name, depth + 1)).flatten()
        })
    }

    fn follow(&self, path: &[String]) -> Option<Vec<String>> {
        if path.first()? != "crate" {
            return None;
        }
        (1..path.len()).find_map(|at| {
            let module = path[1..at].to_vec();
            let target = self.modules.get(&module)?.imports.get(&path[at])?;
            let mut further = self.first(&module, target, 0);
            further.extend(path[at + 1..].iter().cloned());
            (further != path).then_some(further)
        })
    }
}

/// The module that a file is: `["plant", "alarm"]` for `src/plant/alarm/mod.rs` and `src/plant/alarm.rs`.
pub fn module_of(path: &str) -> Module {
    let path = path.strip_prefix("src/").unwrap_or(path).trim_end_matches(".rs");
    let path = path.trim_end_matches("/mod");
    if path == "lib" { Vec::new() } else { path.split('/').map(str::to_owned).collect() }
}
