//! Modules import downwards: no circles but those of parent and child.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

/// The text of every module, by its path of names below the crate.
fn modules(folder: &Path, path: &[String], found: &mut BTreeMap<Vec<String>, String>) {
    for entry in fs::read_dir(folder).expect("a folder of sources") {
        let entry = entry.expect("an entry").path();
        let name = entry.file_stem().expect("a name").to_string_lossy();
        let path = [path, &[name.into_owned()]].concat();
        if entry.is_dir() {
            modules(&entry, &path, found);
        } else if entry.extension().is_some_and(|extension| extension == "rs") {
            found.insert(path, fs::read_to_string(&entry).expect("a text"));
        }
    }
}

/// The paths after `crate::` and `super::` in a text, from the crate; of a list in braces, each.
fn paths(text: &str, own: &[String]) -> Vec<Vec<String>> {
    let mut found = Vec::new();
    for (start, parent) in [("crate::", &[][..]), ("super::", &own[..own.len() - 1])] {
        for rest in text.split(start).skip(1) {
            let (list, is_list) = match rest.strip_prefix('{') {
                Some(list) => (list.split('}').next().unwrap_or_default(), true),
                None => (rest, false),
            };
            for item in list.split(',').take(if is_list { usize::MAX } else { 1 }) {
                let is_part_of_name = |c: char| c.is_alphanumeric() || c == '_';
                let names = item.trim().split("::");
                let names = names.map(|name| name.split(|c| !is_part_of_name(c)).next());
                let names = names.map(|name| name.unwrap_or_default().to_owned());
                found.push(parent.iter().cloned().chain(names).collect());
            }
        }
    }
    found
}

/// The modules that are reached from one by imports.
fn reached<'a>(
    edges: &'a BTreeMap<Vec<String>, BTreeSet<Vec<String>>>,
    from: &'a [String],
) -> BTreeSet<&'a [String]> {
    let mut reached = BTreeSet::new();
    let mut open = vec![from];
    while let Some(module) = open.pop() {
        for next in &edges[module] {
            if reached.insert(next.as_slice()) {
                open.push(next);
            }
        }
    }
    reached
}

#[test]
fn imports_form_no_circle() {
    let mut all = BTreeMap::new();
    let sources = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    modules(&sources, &[], &mut all);
    let mut edges = BTreeMap::new();
    for (own, text) in &all {
        let code = text
            .split("#[cfg(test)]\nmod tests")
            .next()
            .unwrap_or_default();
        let code: Vec<&str> = code
            .lines()
            .filter(|line| !line.trim_start().starts_with("//"))
            .collect();
        let imported = paths(&code.join("\n"), own)
            .into_iter()
            .filter_map(|mut path| {
                while !path.is_empty() && !all.contains_key(&path) {
                    path.pop();
                }
                let is_family = path.starts_with(own) || own.starts_with(&path);
                (!path.is_empty() && !is_family).then_some(path)
            });
        edges.insert(own.clone(), imported.collect::<BTreeSet<_>>());
    }
    let count: usize = edges.values().map(BTreeSet::len).sum();
    assert!(count > 100, "imports are found: {count}");
    for module in all.keys() {
        let circle = reached(&edges, module).contains(module.as_slice());
        let path = module.join("::");
        assert!(
            !circle,
            "{path} imports itself by way of {:?}",
            edges[module]
        );
    }
}
