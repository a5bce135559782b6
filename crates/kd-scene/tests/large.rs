//! Large files are read in one pass, in memory for at most twice what is kept.
#![allow(clippy::print_stderr, reason = "a part that is skipped reports it")]

use std::io::{self, Read};

use kd_core::Mesh;
use kd_oracle::effort;
use kd_scene::{LoadError, read_obj, read_ply};

/// A text or binary file that is made while it is read: a strip of triangles, two for each pair of vertices.
struct Generated<F> {
    element: F,
    next: usize,
    count: usize,
    /// Bytes that are made, and how many of them are read.
    made: Vec<u8>,
    read: usize,
}

impl<F: Fn(usize, &mut Vec<u8>)> Generated<F> {
    fn new(head: String, count: usize, element: F) -> Self {
        Self {
            element,
            next: 0,
            count,
            made: head.into_bytes(),
            read: 0,
        }
    }
}

impl<F: Fn(usize, &mut Vec<u8>)> Read for Generated<F> {
    fn read(&mut self, to: &mut [u8]) -> io::Result<usize> {
        if self.read == self.made.len() {
            self.made.clear();
            self.read = 0;
            while self.made.len() < 1 << 16 && self.next < self.count {
                (self.element)(self.next, &mut self.made);
                self.next += 1;
            }
        }
        let length = to.len().min(self.made.len() - self.read);
        to[..length].copy_from_slice(&self.made[self.read..self.read + length]);
        self.read += length;
        Ok(length)
    }
}

fn position(vertex: usize) -> [f32; 3] {
    let along = (vertex / 2) as f32;
    [
        0.25 * along,
        (vertex % 2) as f32,
        (vertex % 1000) as f32 * 0.001,
    ]
}

fn corners(triangle: usize) -> [usize; 3] {
    let first = triangle & !1;
    if triangle.is_multiple_of(2) {
        [first, first + 1, first + 2]
    } else {
        [first + 2, first + 1, first + 3]
    }
}

/// An OBJ file of `vertices` vertices.
fn obj(vertices: usize) -> impl Read {
    use std::io::Write;

    Generated::new(String::new(), 2 * vertices - 2, move |number, to| {
        let written = if number < vertices {
            let [x, y, z] = position(number);
            writeln!(to, "v {x} {y} {z}")
        } else {
            let [a, b, c] = corners(number - vertices).map(|corner| corner + 1);
            writeln!(to, "f {a} {b} {c}")
        };
        written.expect("memory is written");
    })
}

/// A binary PLY file of `vertices` vertices.
fn ply(vertices: usize) -> impl Read {
    let triangles = vertices - 2;
    let head = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {vertices}\nproperty float x\nproperty float y\nproperty float z\n\
         element face {triangles}\nproperty list uchar int vertex_indices\nend_header\n"
    );
    Generated::new(head, vertices + triangles, move |number, to| {
        if number < vertices {
            to.extend(position(number).iter().flat_map(|x| x.to_le_bytes()));
            return;
        }
        to.push(3);
        for corner in corners(number - vertices) {
            to.extend(
                u32::try_from(corner)
                    .expect("fewer than 2^32")
                    .to_le_bytes(),
            );
        }
    })
}

/// The most memory that the process had since the last call of [`reset_peak`], and what it has now.
fn memory() -> Option<[u64; 2]> {
    let text = std::fs::read_to_string("/proc/self/status").ok()?;
    let kilobytes = |name: &str| -> Option<u64> {
        let line = text.lines().find_map(|line| line.strip_prefix(name))?;
        line.trim().strip_suffix("kB")?.trim().parse().ok()
    };
    Some([kilobytes("VmHWM:")? * 1024, kilobytes("VmRSS:")? * 1024])
}

fn reset_peak() -> bool {
    std::fs::write("/proc/self/clear_refs", "5").is_ok()
}

fn check(what: &str, vertices: usize, read: impl FnOnce() -> Result<Mesh, LoadError>) {
    let before = memory().filter(|_| reset_peak());
    let mesh = read().unwrap_or_else(|error| panic!("{what}: {error}"));
    assert_eq!(
        (mesh.positions().len(), mesh.len()),
        (vertices, vertices - 2),
        "{what}"
    );
    let last = u32::try_from(vertices - 3).expect("fewer than 2^32");
    let expected = corners(vertices - 3).map(|corner| glam::Vec3::from(position(corner)));
    assert_eq!(mesh.corners(last), expected, "{what}");
    let (Some([_, before]), Some([peak, _])) = (before, memory()) else {
        eprintln!("{what}: memory is not checked: the system does not tell it");
        return;
    };
    let kept = mesh.bytes() as u64;
    let (taken, allowed) = (peak - before, 2 * kept + (8 << 20));
    assert!(taken <= allowed, "{what}: {taken} bytes to keep {kept}");
}

/// One test, since all tests of a process share its memory.
#[test]
fn large_files_are_read_in_one_pass() {
    // 2 GB of each in long tests.
    let obj_vertices = effort::count(1_000_000, 45_000_000);
    let ply_vertices = effort::count(2_000_000, 80_000_000);
    check("OBJ", obj_vertices, || read_obj(obj(obj_vertices), "a.obj"));
    check("PLY", ply_vertices, || read_ply(ply(ply_vertices), "a.ply"));
}
