//! The names at the root of the crate: few enough to read on one page of documentation.

/// Upper limit on the names.
const LIMIT: usize = 42;

/// The names that the top level of a source file exports.
fn exported(source: &str) -> Vec<String> {
    let code: String = source
        .lines()
        .filter(|line| !line.trim_start().starts_with("//"))
        .flat_map(|line| [line, " "])
        .collect();
    let mut names = Vec::new();
    let mut rest = code.as_str();
    while let Some(start) = rest.find("pub ") {
        rest = &rest[start + "pub ".len()..];
        let (kind, after) = rest.split_once(' ').expect("an item has a kind");
        let end = after.find([';', '{']).expect("an item ends");
        let head = after[..end].trim();
        if kind == "use" {
            // A list is in braces, which are part of the statement.
            let end = after.find(';').expect("a statement ends");
            let (_, last) = after[..end]
                .rsplit_once("::")
                .unwrap_or(("", &after[..end]));
            let list = last.trim().trim_matches(['{', '}']).split(',');
            names.extend(
                list.map(|name| name.trim().to_owned())
                    .filter(|name| !name.is_empty()),
            );
            rest = &after[end..];
            continue;
        }
        names.push(head.to_owned());
        rest = &after[end..];
        if rest.starts_with('{') {
            let mut depth = 0;
            let block = rest.find(|letter| {
                depth += i32::from(letter == '{') - i32::from(letter == '}');
                letter == '}' && depth == 0
            });
            rest = &rest[block.expect("a block ends")..];
        }
    }
    names
}

#[test]
fn the_root_has_few_names() {
    let names = exported(include_str!("../src/lib.rs"));
    for expected in ["KdTree", "Mesh", "load_mesh", "scene", "custom"] {
        assert!(names.iter().any(|name| name == expected), "{names:?}");
    }
    let count = names.len();
    assert!(count <= LIMIT, "{count} names, at most {LIMIT}: {names:?}");
}

#[test]
fn names_are_counted() {
    let source = "//! pub use no::Comment;\npub use glam;\npub use a::{\n    B, c,\n};\n/// Docs.\npub mod d {\n    pub use e::{F, G};\n}\n\
        pub(crate) use h::I;\nmod j;\npub mod k;\n";
    assert_eq!(exported(source), ["glam", "B", "c", "d", "k"]);
}
