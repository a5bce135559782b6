//! Fuzzes the reader of tree files: the input is a file, or changes of words in the sections of a valid one, with checksums that match.
#![no_main]

use std::path::Path;
use std::sync::OnceLock;

use kd::{BuildOptions, KdTree, Layout, Mesh, Ray};
use kd_file::{Contents, SavedFile, Section, SectionKind};

/// The sections of a file, and bytes of their elements.
const SECTIONS: [(SectionKind, usize); 9] = [
    (SectionKind::Tree, 4),
    (SectionKind::Positions, 12),
    (SectionKind::Triangles, 12),
    (SectionKind::WideNodes, 256),
    (SectionKind::WideBlocks, 320),
    (SectionKind::BinaryNodes, 16),
    (SectionKind::BinaryBlocks, 320),
    (SectionKind::KdNodes, 16),
    (SectionKind::KdReferences, 4),
];

type Words = Vec<(Section, usize, Vec<u32>)>;

/// The sections of a small tree in each layout.
fn examples() -> &'static [Words; 2] {
    static EXAMPLES: OnceLock<[Words; 2]> = OnceLock::new();
    EXAMPLES.get_or_init(|| {
        [Layout::Wide, Layout::Binary].map(|layout| {
            let corner = |i: u32| {
                let i = i as f32;
                [(0.7 * i).sin(), (0.3 * i).cos(), 0.1 * i]
            };
            let triangles = (0..40).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
            let mesh = Mesh::new((0..120).map(corner).collect(), triangles).expect("valid");
            let options = BuildOptions::balanced().with_layout(layout);
            let tree = KdTree::build(mesh, &options).expect("within limits");
            let path = file_name();
            tree.save(&path).expect("written");
            let file = SavedFile::open(&path).expect("just written");
            let there = |(kind, bytes): (SectionKind, usize)| {
                let section = Section::new(kind, 0);
                let words = match bytes {
                    4 => words::<1>(&file, section),
                    12 => words::<3>(&file, section),
                    16 => words::<4>(&file, section),
                    256 => words::<64>(&file, section),
                    _ => words::<80>(&file, section),
                };
                file.has(section).then_some((section, bytes, words))
            };
            SECTIONS.into_iter().filter_map(there).collect()
        })
    })
}

fn words<const N: usize>(file: &SavedFile, section: Section) -> Vec<u32>
where
    [u32; N]: bytemuck::Pod,
{
    let elements = file.elements::<[u32; N]>(section);
    elements.map_or_else(|_| Vec::new(), |elements| elements.as_flattened().to_vec())
}

fn file_name() -> std::path::PathBuf {
    std::env::temp_dir().join(format!("kd-fuzz-{}.kd", std::process::id()))
}

fn save(sections: &Words, path: &Path) {
    let mut contents = Contents::new();
    for (section, bytes, words) in sections {
        match bytes {
            4 => contents.add(*section, words),
            12 => contents.add(*section, words.as_chunks::<3>().0),
            16 => contents.add(*section, words.as_chunks::<4>().0),
            256 => contents.add(*section, words.as_chunks::<64>().0),
            _ => contents.add(*section, words.as_chunks::<80>().0),
        }
    }
    contents.save(path).expect("written");
}

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let path = file_name();
    match bytes.split_first() {
        Some((which @ 0..2, changes)) => {
            let mut sections = examples()[usize::from(*which)].clone();
            // A section, a place and a word for each change; every other change copies a word from elsewhere.
            for change in changes.as_chunks::<8>().0 {
                let [section, copies, low, high, word @ ..] = *change;
                let count = sections.len();
                let words = &mut sections[usize::from(section) % count].2;
                let place = usize::from(u16::from_le_bytes([low, high])) % words.len();
                let word = u32::from_le_bytes(word);
                words[place] = if copies & 1 == 0 {
                    word
                } else {
                    words[word as usize % words.len()]
                };
            }
            save(&sections, &path);
        }
        _ => std::fs::write(&path, bytes).expect("written"),
    }
    match KdTree::load(&path) {
        Ok(tree) => {
            let mut hits = Vec::new();
            for i in 0..16_u8 {
                let i = f32::from(i);
                let ray = Ray::new(
                    [i.sin() * 3.0, i.cos() * 3.0, 2.0],
                    [-i.sin(), -i.cos(), 0.1 * i - 0.8],
                );
                tree.hits(&ray, 10, &mut hits);
                assert!(
                    hits.len() <= 10 && hits.is_sorted_by(|a, b| a.t <= b.t),
                    "{hits:?}"
                );
                let triangles = tree.mesh().len();
                assert!(hits.iter().all(|hit| (hit.triangle as usize) < triangles));
                assert_eq!(tree.occluded(&ray), tree.intersect(&ray).is_some());
            }
        }
        Err(error) => {
            let text = error.to_string();
            assert!(text.contains("kd-fuzz-") && !text.contains('\n'), "{text}");
        }
    }
});
