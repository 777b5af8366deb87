//! The source files of a crate form no import cycle: if `a.rs` uses names of `b.rs`, then `b.rs` uses none of `a.rs`, directly or through
//! other files.
//!
//! Imports are read from the sources: `use` trees and paths that begin with `crate`, `self`, `super`, a child module or an imported
//! module. A re-export is followed to the file that defines the name, so a parent that only declares and re-exports its children
//! depends on none of them. Code under `#[cfg(test)]` does not count.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// A module path inside a crate; the crate root is empty.
type Module = Vec<String>;

/// Splits Rust source into identifiers and punctuation (`::` is one token); comments and literals are dropped.
fn tokens(source: &str) -> Vec<String> {
    let chars: Vec<char> = source.chars().collect();
    let at = |i: usize| chars.get(i).copied().unwrap_or('\0');
    let word = |c: char| c.is_alphanumeric() || c == '_';
    let mut out = Vec::new();
    let mut i = 0;
    while i < chars.len() {
        let c = chars[i];
        let raw = matches!(c, 'r' | 'b') && {
            let hashes = (i + 1..).take_while(|&k| matches!(at(k), '#' | 'r')).count();
            at(i + 1 + hashes) == '"'
        };
        if c == '/' && at(i + 1) == '/' {
            while i < chars.len() && chars[i] != '\n' {
                i += 1;
            }
        } else if c == '/' && at(i + 1) == '*' {
            while i < chars.len() && !(at(i) == '*' && at(i + 1) == '/') {
                i += 1;
            }
            i += 2;
        } else if raw && (at(i + 1) != '"' || c == 'r') {
            let open = (i..).find(|&k| at(k) == '"').unwrap_or(i);
            let hashes = chars[i..open].iter().filter(|c| **c == '#').count();
            i = (open + 1..chars.len())
                .find(|&k| at(k) == '"' && (1..=hashes).all(|h| at(k + h) == '#'))
                .unwrap_or(chars.len())
                + hashes
                + 1;
        } else if c == '"' {
            i += 1;
            while i < chars.len() && at(i) != '"' {
                i += if at(i) == '\\' { 2 } else { 1 };
            }
            i += 1;
        } else if c == '\'' {
            // A character literal, or a lifetime.
            if at(i + 1) == '\\' {
                i = (i + 3..chars.len()).find(|&k| at(k) == '\'').unwrap_or(chars.len()) + 1;
            } else if at(i + 2) == '\'' {
                i += 3;
            } else {
                i += 1;
            }
        } else if word(c) {
            let end = (i..chars.len()).find(|&k| !word(chars[k])).unwrap_or(chars.len());
            out.push(chars[i..end].iter().collect());
            i = end;
        } else if c == ':' && at(i + 1) == ':' {
            out.push("::".to_owned());
            i += 2;
        } else {
            if !c.is_whitespace() {
                out.push(c.to_string());
            }
            i += 1;
        }
    }
    out
}

/// The index behind the block, or behind the `;`, of the item that begins at `from`.
fn end_of_item(tokens: &[String], from: usize) -> usize {
    let mut depth = 0;
    for (i, token) in tokens.iter().enumerate().skip(from) {
        match token.as_str() {
            "{" | "(" | "[" => depth += 1,
            "}" | ")" | "]" => {
                depth -= 1;
                if depth == 0 && token == "}" {
                    return i + 1;
                }
            }
            ";" if depth == 0 => return i + 1,
            _ => {}
        }
    }
    tokens.len()
}

/// The tokens without the items under `#[cfg(test)]`.
fn without_tests(tokens: Vec<String>) -> Vec<String> {
    let mark = ["#", "[", "cfg", "(", "test", ")", "]"];
    let mut out = Vec::new();
    let mut i = 0;
    while i < tokens.len() {
        if tokens[i..].iter().take(mark.len()).eq(mark.iter()) {
            i = end_of_item(&tokens, i + mark.len());
        } else {
            out.push(tokens[i].clone());
            i += 1;
        }
    }
    out
}

/// One leaf of a `use` tree.
#[derive(Clone, Debug)]
struct Import {
    path: Vec<String>,
    /// The name that it gets; `*` for a glob.
    name: String,
    public: bool,
}

/// Reads the `use` tree at `*i` up to the `,`, `}` or `;` behind it.
fn use_tree(tokens: &[String], i: &mut usize, before: &[String], public: bool, out: &mut Vec<Import>) {
    let mut path = before.to_vec();
    while *i < tokens.len() {
        match tokens[*i].as_str() {
            "::" => *i += 1,
            "{" => {
                *i += 1;
                while *i < tokens.len() && tokens[*i] != "}" {
                    use_tree(tokens, i, &path, public, out);
                    if tokens[*i] == "," {
                        *i += 1;
                    }
                }
                *i += 1;
                return;
            }
            "," | "}" | ";" => break,
            "as" => {
                out.push(Import { path, name: tokens[*i + 1].clone(), public });
                *i += 2;
                return;
            }
            segment => {
                path.push(segment.to_owned());
                *i += 1;
            }
        }
    }
    if path.last().is_some_and(|last| last == "self") {
        path.pop();
    }
    if let Some(name) = path.last().cloned() {
        out.push(Import { path, name, public });
    }
}

/// What a file says about names.
#[derive(Default)]
struct Source {
    module: Module,
    children: Vec<String>,
    imports: Vec<Import>,
    /// Names that the file defines.
    defined: BTreeSet<String>,
    /// Paths in code, and single identifiers.
    paths: Vec<Vec<String>>,
}

fn read(file: &Path, module: Module) -> Source {
    let tokens = without_tests(tokens(&fs::read_to_string(file).expect("a source file")));
    let mut source = Source { module, ..Source::default() };
    let is_word = |t: &str| t.chars().all(|c| c.is_alphanumeric() || c == '_');
    let mut i = 0;
    while i < tokens.len() {
        let token = tokens[i].as_str();
        let next = tokens.get(i + 1).map_or("", String::as_str);
        match token {
            "use" => {
                // `pub`, `pub(crate)`, `pub(super)`, `pub(in ...)`
                let public = i > 0 && (tokens[i - 1] == "pub" || tokens[i - 1] == ")");
                i += 1;
                use_tree(&tokens, &mut i, &[], public, &mut source.imports);
            }
            "mod" if tokens.get(i + 2).is_some_and(|t| t == ";") => {
                source.children.push(next.to_owned());
                i += 3;
            }
            "fn" | "struct" | "enum" | "trait" | "type" | "const" | "static" | "union" | "mod"
                if is_word(next) =>
            {
                source.defined.insert(next.to_owned());
                i += 2;
            }
            _ if is_word(token) => {
                let mut path = vec![token.to_owned()];
                while tokens.get(i + 1).is_some_and(|t| t == "::")
                    && tokens.get(i + 2).is_some_and(|t| is_word(t))
                {
                    path.push(tokens[i + 2].clone());
                    i += 2;
                }
                source.paths.push(path);
                i += 1;
            }
            _ => i += 1,
        }
    }
    source
}

/// The files of a crate by module.
fn sources(root: &Path) -> (BTreeMap<Module, PathBuf>, BTreeMap<Module, Source>) {
    let (mut files, mut all) = (BTreeMap::new(), BTreeMap::new());
    let mut open = vec![(Module::new(), root.to_owned())];
    while let Some((module, file)) = open.pop() {
        let source = read(&file, module.clone());
        let name = file.file_stem().expect("a file").to_string_lossy().into_owned();
        let folder = file.parent().expect("a folder");
        let below = if module.is_empty() || name == "mod" { folder.to_owned() } else { folder.join(&name) };
        for child in &source.children {
            let places = [below.join(format!("{child}.rs")), below.join(child).join("mod.rs")];
            if let Some(place) = places.into_iter().find(|place| place.exists()) {
                open.push(([&module[..], std::slice::from_ref(child)].concat(), place));
            }
        }
        files.insert(module.clone(), file);
        all.insert(module, source);
    }
    (files, all)
}

struct Resolver<'a> {
    all: &'a BTreeMap<Module, Source>,
}

impl Resolver<'_> {
    /// The path from the crate root, if it is one inside the crate.
    fn absolute(&self, from: &Source, path: &[String]) -> Option<Vec<String>> {
        let mut base = from.module.clone();
        let mut rest = path;
        match path.first()?.as_str() {
            "crate" => {
                base.clear();
                rest = &path[1..];
            }
            "self" => rest = &path[1..],
            "super" => {
                while rest.first().is_some_and(|s| s == "super") {
                    base.pop()?;
                    rest = &rest[1..];
                }
            }
            first if from.children.iter().any(|child| child == first) => {}
            first => {
                let import =
                    from.imports.iter().find(|import| import.name == first && import.path != path)?;
                base = self.absolute(from, &import.path)?;
                rest = &path[1..];
            }
        }
        base.extend(rest.iter().cloned());
        Some(base)
    }

    /// The module whose file defines what a path from the crate root names.
    fn home(&self, path: &[String], depth: usize) -> Option<Module> {
        let length = (0..=path.len()).rev().find(|&n| self.all.contains_key(&path[..n]))?;
        let module = &self.all[&path[..length]];
        let Some(name) = path.get(length) else { return Some(module.module.clone()) };
        if module.defined.contains(name) || depth > 8 {
            return Some(module.module.clone());
        }
        for import in module.imports.iter().filter(|import| import.public) {
            let Some(target) = self.absolute(module, &import.path) else { continue };
            if import.name == *name {
                return self.home(&[&target[..], &path[length + 1..]].concat(), depth + 1);
            }
            if import.name == "*" {
                let inside = &target[..target.len() - 1];
                if let Some(home) = self.home(&[inside, &path[length..]].concat(), depth + 1)
                    && self.all[&home].defined.contains(name)
                {
                    return Some(home);
                }
            }
        }
        Some(module.module.clone())
    }

    /// The modules whose names a file uses.
    fn uses(&self, of: &Source) -> BTreeSet<Module> {
        let mut out = BTreeSet::new();
        for import in &of.imports {
            let own_child = import.path.first().is_some_and(|first| {
                let first = if first == "self" { import.path.get(1).unwrap_or(first) } else { first };
                of.children.contains(first)
            });
            let used = of.paths.iter().any(|path| path[0] == import.name);
            if import.public && own_child && !used {
                continue;
            }
            if let Some(path) = self.absolute(of, &import.path) {
                // Of a module that is imported the paths count that go through it.
                if !self.all.contains_key(&path) {
                    out.extend(self.home(&path, 0));
                }
            }
        }
        for path in of.paths.iter().filter(|path| path.len() > 1) {
            if let Some(path) = self.absolute(of, path) {
                out.extend(self.home(&path, 0));
            }
        }
        out.remove(&of.module);
        out
    }
}

/// Groups of modules that reach one another.
fn cycles(edges: &BTreeMap<Module, BTreeSet<Module>>) -> Vec<Vec<Module>> {
    let reach = |from: &Module| {
        let mut seen = BTreeSet::new();
        let mut open: Vec<&Module> = edges[from].iter().collect();
        while let Some(module) = open.pop() {
            if seen.insert(module.clone()) {
                open.extend(&edges[module]);
            }
        }
        seen
    };
    let reached: BTreeMap<&Module, BTreeSet<Module>> =
        edges.keys().map(|module| (module, reach(module))).collect();
    let mut groups = BTreeSet::new();
    for (module, to) in &reached {
        if to.contains(*module) {
            groups.insert(to.iter().filter(|other| reached[other].contains(*module)).cloned().collect());
        }
    }
    groups.into_iter().collect()
}

#[test]
fn the_files_of_a_crate_import_one_another_without_a_cycle() {
    let top = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut roots = vec![top.join("src/lib.rs"), top.join("src/main.rs")];
    for entry in fs::read_dir(top.join("crates")).expect("the crates").flatten() {
        roots.push(entry.path().join("src/lib.rs"));
    }
    roots.sort();
    let (mut found, mut imports) = (Vec::new(), 0);
    for root in roots.iter().filter(|root| root.exists()) {
        let (files, all) = sources(root);
        let resolver = Resolver { all: &all };
        let edges: BTreeMap<Module, BTreeSet<Module>> =
            all.iter().map(|(module, source)| (module.clone(), resolver.uses(source))).collect();
        imports += edges.values().map(BTreeSet::len).sum::<usize>();
        for cycle in cycles(&edges) {
            let mut text = String::new();
            for from in &cycle {
                for to in edges[from].iter().filter(|to| cycle.contains(to)) {
                    let short = |module: &Module| {
                        files[module].strip_prefix(top).expect("below").display().to_string()
                    };
                    text += &format!("\n  {} uses {}", short(from), short(to));
                }
            }
            found.push(text);
        }
    }
    assert!(imports > 500, "{imports} imports between files were read: the sources are not understood");
    assert!(found.is_empty(), "{} import cycles:{}", found.len(), found.join("\n"));
}
